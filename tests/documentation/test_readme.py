"""The README is true: its commands run, in its order and from one folder, and its figures are there."""

from __future__ import annotations

import os
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tribodyn import hbm
from tribodyn.reduction import foreign
from tribodyn.workflows.accuracy import accuracy, trade_table
from tribodyn.workflows.scene import scene_file

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
START = "./tribodyn "


def commands(label: str) -> list[str]:
    """Lines of the fences with this label."""
    fences = re.findall(rf"^```{label}\n(.*?)^```", README, re.M | re.S)
    return [line for fence in fences for line in fence.splitlines() if line]


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command of the README with the program of this tree."""
    assert line.startswith(START)
    arguments = shlex.split(line.removeprefix(START))
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "tribodyn", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_commands_run_one_after_the_other(tmp_path: Path) -> None:
    lines = commands("sh")
    assert lines[0] == "./tribodyn run beam"
    for line in lines:
        done = run(line, tmp_path)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    pictures = sorted((tmp_path / "results/beam/pictures").glob("*.png"))
    assert len(pictures) == 10
    figure = ROOT / "docs/figures/beam_patch.png"
    made = tmp_path / "results/beam/pictures/patch.png"
    assert abs(figure.stat().st_size / made.stat().st_size - 1) < 0.2  # the same picture, up to fonts and rounding


@pytest.mark.slow
def test_long_commands_run(tmp_path: Path) -> None:
    for line in commands("sh long"):
        done = run(line, tmp_path)
        assert done.returncode == 0, f"{line}: {done.stderr}"


def test_the_check_is_what_ci_runs() -> None:
    assert commands("sh check") == ["./tribodyn check"]
    assert 'tribodyn" check' in (ROOT / ".ci/run").read_text()


def test_figures_are_there() -> None:
    for figure in re.findall(r"!\[.*?\]\((.*?)\)", README, re.S):
        assert (ROOT / figure).is_file(), figure


def test_the_python_is_what_the_documentation_of_foreign_matrices_says() -> None:
    """That one is executed word for word by test_workflows_matrices."""
    documented = [line.strip() for line in (foreign.__doc__ or "").splitlines()]
    (example,) = re.findall(r"^```python\n(.*?)^```", README, re.M | re.S)
    lines = example.splitlines()
    assert lines == documented[documented.index(lines[0]) :][: len(lines)]


def test_the_map_of_the_solver_names_every_module_once() -> None:
    named = re.findall(r"\w+", (hbm.__doc__ or "").partition("\n")[2])
    for module in pkgutil.iter_modules(hbm.__path__):
        assert named.count(module.name) == 1, module.name


LABELS = {
    "FE mesh": "fe_mesh", "contact grid": "contact_grid", "vertex nodes only": "nodes", "modes": "modes",
    "interface rank": "interface_rank", "harmonics 0..1": "harmonics", "32 ... 256 samples": "samples",
    "uncoupled friction": "friction", "Newton": "newton", "points": "points", "wear tolerance": "wear",
    "thesis's wear step": "wear_thesis",
}  # fmt: skip
COLUMNS = (
    *((scene, quantity) for scene in ("beam", "blade") for quantity in ("peak_m", "energy_J", "life_cycles")),
    ("leaf_seal", "peak_m"), *(("rig", quantity) for quantity in ("peak_hz", "energy_J", "life_cycles")),
)  # fmt: skip


def test_the_table_of_errors_says_what_the_trades_say() -> None:
    """The coarsest and the finest setting that leaves an error, to the digits that are printed."""
    tables = {name: trade_table.load(accuracy.beside(scene_file.read(name))) for name, _ in COLUMNS}
    _, _, below = README.partition("| | beam: amplitude | beam: energy |")
    lines = below.split("\n\n")[0].splitlines()[2:]
    assert len(lines) == len(LABELS)
    for line in lines:
        label, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        (knob,) = {LABELS[start] for start in LABELS if label.startswith(start)}
        for (scene, quantity), cell in zip(COLUMNS, cells, strict=True):
            rows = tables[scene].of(knob)
            known = [i for i, row in enumerate(rows) if row.errors[quantity] is not None]
            errors = [error for i in known if (error := accuracy.error_of(rows, i, quantity)) > 0]
            said = [float(number) for number in re.findall(r"[\d.]+(?:e-\d+)?(?=$|[ ,])", cell) if number != "..."]
            where = f"{label}: {scene}, {quantity}: {cell}"
            if not errors:
                assert not said, where
                continue
            for number, error in zip((said[0], said[-1]), (errors[0], errors[-1]), strict=True):
                assert number == pytest.approx(100 * error, rel=0.06), where
