"""The solver alone, without the packages of its extras and without what Windows has not: what runs, what is refused."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import tribodyn as td
from tests.helpers.matrix_scene import matrix_folder
from tribodyn.extras import EXTRA

ROOT = Path(__file__).parents[2]
FOLDERS = ("geometry", "fem", "reduction", "hbm", "workflows", "src/tribodyn")
OF_OS = "fork forkpty getuid geteuid getgid kill killpg nice setsid sched_getaffinity sysconf wait waitpid statvfs"
SIGNALS = "SIGKILL SIGPIPE SIGHUP SIGALRM SIGUSR1 alarm setitimer pause"
POSIX = {"os": OF_OS.split(), "signal": SIGNALS.split()}
MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix"}
GUARDS = ("sys.platform", "hasattr(", "getattr(", '"SC_PAGE_SIZE"')
SOLVER_ALONE = """
import contextlib, importlib, importlib.abc, io, json, os, pkgutil, signal, sys
import cyclopts, filelock, h5py, multiprocessing.context, numba, numpy, pydantic, rich, scipy.linalg, subprocess

class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ABSENT:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
for module, names in POSIX.items():
    for name in names:
        if hasattr(sys.modules[module], name):
            delattr(sys.modules[module], name)

import tribodyn
for module in pkgutil.walk_packages(tribodyn.__path__, "tribodyn."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)

from tribodyn.workflows.command import main
ends = []
for words in COMMANDS:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main.main(words)
        except SystemExit as end:
            code = end.code or 0
    ends.append([code, out.getvalue(), err.getvalue()])
print(json.dumps(ends))
"""
SHORT = "--set wear= --set response.points=4 --set verdict.enabled=false"


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, str, str]]:
    """Exit code, output and errors of commands where nothing but the solver's packages is there."""
    folder = matrix_folder(tmp_path_factory.mktemp("alone"))
    td.build("beam", {"geometry.n_patch": 3})  # a part that an environment with the mesher has left in the cache
    lines = [f"run own.toml {SHORT} --out out", f"run own.toml {SHORT} --out out2 --no-pictures --quiet"]
    lines += ["run beam --set geometry.n_patch=3"]
    lines += [
        "draw out",
        "report out",
        "curve backbone own.toml --from 1um --to 2um --points 3 --quiet",
        "export out --to csv",
    ]
    commands = [line.split() for line in lines]
    head = f"ABSENT, POSIX, COMMANDS = {[*EXTRA, *MODULES - {'posix'}]!r}, {POSIX!r}, {commands!r}\n"
    done = subprocess.run([sys.executable, "-c", head + SOLVER_ALONE], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [tuple(end) for end in json.loads(done.stdout.splitlines()[-1])]


def test_matrices_are_solved_by_the_solver_alone(ends: list[tuple[int, str, str]]) -> None:
    assert [ends[number][0] for number in (0, 1, 6)] == [0, 0, 0], ends
    assert ends[0][1].count("no pictures: this needs the package matplotlib: install it with pip install") == 1
    assert not ends[1][1] + ends[1][2]


def test_a_missing_package_is_one_sentence(ends: list[tuple[int, str, str]]) -> None:
    for (code, _, error), package in zip(ends[2:5], ("gmsh", "matplotlib", "matplotlib"), strict=True):
        cure = f'install it with pip install "tribodyn[{EXTRA[package]}]"'
        assert (code, error) == (2, f"tribodyn: this needs the package {package}: {cure}.\n")


def test_a_curve_leaves_its_table_without_pictures(ends: list[tuple[int, str, str]]) -> None:
    code, out, error = ends[5]
    assert (code, out.split()[-1]) == (0, "results/own/backbone.csv")
    assert error.startswith("no pictures, tables alone: this needs the package matplotlib: install it with pip")


def _posix_words(tree: ast.AST) -> list[str]:
    words = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            words += [node.attr] if node.attr in POSIX.get(node.value.id, ()) else []
        elif isinstance(node, ast.Import):
            words += sorted(MODULES.intersection(alias.name for alias in node.names))
        elif isinstance(node, ast.Constant) and node.value in ("fork", "forkserver"):
            words.append(node.value)
    return words


def unguarded(text: str) -> list[str]:
    """What a source calls that Windows has not: at its head, or in a function that does not ask for the system."""
    tree = ast.parse(text)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    words = []
    for function in functions:
        source = ast.get_source_segment(text, function) or ""
        if not any(guard in source for guard in GUARDS):
            words += _posix_words(function)
        function.body = [ast.Pass()]
    return words + _posix_words(tree)


def test_what_windows_has_not_is_called_behind_a_question_for_the_system() -> None:
    files = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    met = {path.name: words for path in files if (words := unguarded(path.read_text(encoding="utf-8")))}
    assert met == {}
    assert unguarded("import os\nos.fork()") == ["fork"]
    assert unguarded("def f():\n    import fcntl\n    os.kill(1, signal.SIGKILL)") == ["fcntl", "kill", "SIGKILL"]
    assert unguarded("def f():\n    if sys.platform == 'linux':\n        os.fork()") == []
