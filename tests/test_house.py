"""The shape of the house: the order of its rooms, no loop of imports, and how much there is to hold in the head.

Imports within functions count, those for type checkers alone do not.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import tribodyn
from tests.conftest import PROCESSES, ROOMS as ROOMS_OF_TESTS

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "tests"
FOLDERS = ("geometry", "fem", "reduction", "hbm", "workflows")

# from the bottom; rooms of one line do not import each other
ORDER = (
    ("geometry",),
    ("fem",),
    ("reduction",),
    ("hbm",),
    ("workflows.scene",),
    ("workflows.result",),
    ("workflows.run",),
    ("workflows.errors",),
    ("workflows.pictures",),
    ("workflows.report", "workflows.export"),
    ("workflows.studies",),
    ("workflows.command",),
    ("workflows.cases",),
)

# the most that there may be; only ever lowered
LIMITS = {"loops": 0, "imports upwards": 0, "commands": 13, "public names": 40, "constants": 250, "lines": 57_501}


@cache
def _modules() -> dict[str, Path]:
    """Name -> file of every module of the package."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(("tribodyn", *(parts[:-1] if parts[-1] == "__init__" else parts)))] = path
    for path in sorted((ROOT / "src" / "tribodyn").glob("*.py")):
        found["tribodyn" if path.stem == "__init__" else f"tribodyn.{path.stem}"] = path
    return found


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _import_statements(tree: ast.Module) -> Iterator[ast.Import | ast.ImportFrom]:
    """Those at the head and in functions, without those that only type checkers see."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif not isinstance(node, ast.expr) and not (
            isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        ):
            waiting += ast.iter_child_nodes(node)


@cache
def _imports() -> dict[str, set[str]]:
    """Module -> modules of the package that it imports, at its head or in a function."""
    modules, found = _modules(), {}
    for name, path in modules.items():
        own: set[str] = set()
        for node in _import_statements(_tree(path)):
            if isinstance(node, ast.Import):
                own |= {alias.name for alias in node.names}
            else:
                assert not node.level, f"{name}: give the whole name of what is imported"
                whole = {f"{node.module}.{alias.name}" for alias in node.names}
                own |= {module if module in modules else str(node.module) for module in whole}
        found[name] = (own & modules.keys()) - {name}
    return found


def _loops() -> list[list[str]]:
    """Sets of more than one module that import each other: strongly connected components, after Tarjan (1972)."""
    graph, number, lowest, stack, found = _imports(), {}, {}, [], []

    def visit(name: str) -> None:
        number[name] = lowest[name] = len(number)
        stack.append(name)
        for other in graph[name]:
            if other not in number:
                visit(other)
                lowest[name] = min(lowest[name], lowest[other])
            elif other in stack:
                lowest[name] = min(lowest[name], number[other])
        if lowest[name] == number[name]:
            at = stack.index(name)
            loop, stack[at:] = stack[at:], []
            found.append(sorted(loop))

    for name in graph:
        if name not in number:
            visit(name)
    return [loop for loop in found if len(loop) > 1]


def _place(name: str) -> tuple[int, str] | None:
    """Height and name of the room of a module, None for the modules beside the rooms."""
    inside = name.removeprefix("tribodyn.")
    for height, rooms in enumerate(ORDER):
        for room in rooms:
            if inside == room or inside.startswith(f"{room}."):
                return height, room
    return None


def _upwards() -> list[str]:
    """Imports from a room of one that is not below it."""
    found = []
    for name, others in _imports().items():
        for other in sorted(others):
            here, there = _place(name), _place(other)
            if here and there and here[1] != there[1] and there[0] >= here[0]:
                found.append(f"{name} -> {other}")
    return found


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float | complex) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        sides = value.left, value.right
        named = (ast.Name, ast.Attribute)
        return any(map(_is_number, sides)) and all(_is_number(s) or isinstance(s, named) for s in sides)
    return isinstance(value, ast.Tuple | ast.List) and bool(value.elts) and all(map(_is_number, value.elts))


def _constants(tree: ast.Module) -> Iterator[str]:
    """Names at module level that stand for numbers; each name of `A, B = 1, 2` is one, and so is a tuple of numbers."""
    for node in tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        value = node.value
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            pairs = [(target, value)]
            if isinstance(target, ast.Tuple | ast.List) and isinstance(value, ast.Tuple | ast.List):
                pairs = list(zip(target.elts, value.elts, strict=False))
            for name, number in pairs:
                if number is not None and _is_number(number):
                    yield ast.unparse(name)


def _commands() -> list[str]:
    from tribodyn.workflows.command.main import app

    return [word for word in app if not word.startswith("-")]


def _found(what: str) -> list[object]:
    """What there is of something that has a limit."""
    if what == "loops":
        return [" ".join(loop) for loop in _loops()]
    if what == "imports upwards":
        return list(_upwards())
    if what == "commands":
        return list(_commands())
    if what == "public names":
        return list(tribodyn.__all__)
    if what == "constants":
        return [f"{name}: {found}" for name, path in _modules().items() for found in _constants(_tree(path))]
    return [line for path in _modules().values() for line in path.read_text(encoding="utf-8").splitlines()]


@pytest.mark.parametrize("what", LIMITS)
def test_there_is_no_more_to_hold_in_the_head(what: str) -> None:
    found = _found(what)
    shown = "\n".join(map(str, found)) if len(found) < 1000 else ""
    assert len(found) <= LIMITS[what], f"{len(found)} {what}:\n{shown}"


def test_every_module_has_a_room() -> None:
    beside = {name for name in _modules() if _place(name) is None}
    assert all(name.count(".") < 2 for name in beside), "a room without a place in ORDER"


def test_no_test_imports_another_test_module() -> None:
    """What two of them need is a helper."""
    for path in TESTS.rglob("test_*.py"):
        for node in ast.walk(_tree(path)):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert not (name.startswith("tests.") and ".test_" in name), f"{path.name} imports {name}"


def test_every_room_of_tests_has_its_place_in_the_order() -> None:
    rooms = {path.name for path in TESTS.iterdir() if path.is_dir() and any(path.rglob("test_*.py"))}
    assert rooms <= set(ROOMS_OF_TESTS)


def test_what_starts_processes_imports_what_says_so() -> None:
    """`os.system` and such would not be seen by the order."""
    for path in TESTS.rglob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        if path == Path(__file__).resolve():
            continue  # it holds the words that it looks for
        assert "os.system(" not in text, path.name
        if "Popen(" in text or "get_context(" in text:
            assert any(f"import {name}" in text or f"from {name}" in text for name in PROCESSES), path.name
