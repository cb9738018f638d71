"""The start script: syntax, and the refusals that need no installation."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [ROOT / "tribodyn", ROOT / ".ci" / "run"]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_scripts_are_executable_and_parse(script):
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", str(script)], check=True)


def test_a_python_that_is_too_old_is_refused_in_one_sentence(tmp_path):
    shutil.copy(ROOT / "tribodyn", tmp_path)
    for name in ("pyproject.toml", "locked.txt"):
        shutil.copy(ROOT / name, tmp_path)
    environment = {**os.environ, "TRIBODYN_PYTHON": "false"}
    done = subprocess.run([tmp_path / "tribodyn", "run"], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == "tribodyn: TRIBODYN_PYTHON=false is not a Python 3.11 or newer: name one that is."


FAKE_PYTHON = """#!/bin/sh
echo "$*" >>"$LOG"
if [ "$1 $2" = "-m venv" ]; then
    mkdir -p "$3/bin"
    cp "$0" "$3/bin/python"
    cp "$FAKE_COMMAND" "$3/bin/tribodyn"
fi
"""
FAKE_COMMAND = """#!/bin/sh
printf "%s|" "$@"
echo "$NUMBA_CACHE_DIR $VTK_DEFAULT_OPENGL_WINDOW"
exit 3
"""


def test_environment_is_made_once_and_handed_over_to(tmp_path):
    """A stand-in for Python records what is asked of it: one installation, then none until pyproject.toml changes."""
    home = tmp_path / "a folder"
    home.mkdir()
    for name in ("tribodyn", "pyproject.toml", "locked.txt"):
        shutil.copy(ROOT / name, home)
    for name, text in {"python": FAKE_PYTHON, "command": FAKE_COMMAND}.items():
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    environment = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "VTK_DEFAULT_OPENGL_WINDOW")}
    environment |= {"LOG": str(tmp_path / "log"), "FAKE_COMMAND": str(tmp_path / "command")}
    environment["TRIBODYN_PYTHON"] = str(tmp_path / "python")

    def start() -> str:
        (tmp_path / "log").write_text("")
        done = subprocess.run(
            [home / "tribodyn", "run", "two words"], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 3
        assert done.stdout.strip() == f"run|two words|{home}/.venv/numba-cache vtkEGLRenderWindow"
        return (tmp_path / "log").read_text()

    first = start()
    assert f"-m venv {home}/.venv" in first
    assert f"-m pip install --no-compile --editable {home}[all] --constraint {home}/locked.txt\n" in first
    assert "import gmsh" in first
    assert "import pyvista" in first
    assert start() == "-c \n"  # it only makes sure that this Python still runs
    with (home / "pyproject.toml").open("a") as file:
        file.write("\n# changed\n")
    changed = start()
    assert "-m pip install --no-compile --editable" in changed
    assert "-m venv" not in changed
