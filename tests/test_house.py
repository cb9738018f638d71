"""The shape of the house: the order of its rooms, no loop of imports, plain names, and how much there is to remember.

Imports within functions count, those for type checkers alone do not."""

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

import tribodyn
from tests.conftest import PROCESSES, ROOMS as ROOMS_OF_TESTS
from tests.helpers.private_words import share_of_private_words

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

# the most that there may be. A limit only falls: it is compared with every earlier version of this file
LIMITS = {
    "import loops": 0,
    "imports upwards": 0,
    "commands": 13,
    "public names": 40,
    "constants": 480,
    "lines": 56_450,
    "lines of tests": 32_000,
    "lines of proof": 8_500,
    "lines of one file": 330,
    "lines of one function of hbm.wear": 50,
    "repeated file names": 0,
    "repeated class names": 0,
    "handlers of ValueError": 29,
    "assertions of not None": 39,
    "private words of 10 000": 40,
}
# limit -> number of the issue of a new ability -> what that issue allows besides
GRANTS: dict[str, dict[int, int]] = {"lines": {57: 1_200, 58: 1_500, 59: 900}}
# limits that are not met yet -> what there is; it only falls, and goes when the limit is met
MISSED = {
    "lines": 61_934,
}


@cache
def _modules() -> dict[str, Path]:
    """Name -> file of every module of the package."""
    modules = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            modules[".".join(("tribodyn", *(parts[:-1] if parts[-1] == "__init__" else parts)))] = path
    for path in sorted((ROOT / "src" / "tribodyn").glob("*.py")):
        modules["tribodyn" if path.stem == "__init__" else f"tribodyn.{path.stem}"] = path
    return modules


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
    modules, graph = _modules(), {}
    for name, path in modules.items():
        targets: set[str] = set()
        for node in _import_statements(_tree(path)):
            if isinstance(node, ast.Import):
                targets |= {alias.name for alias in node.names}
            else:
                assert not node.level, f"{name}: give the full name of what is imported"
                full = {f"{node.module}.{alias.name}" for alias in node.names}
                targets |= {module if module in modules else str(node.module) for module in full}
        graph[name] = (targets & modules.keys()) - {name}
    return graph


def _import_loops() -> list[str]:
    """Sets of more than one module that import each other: strongly connected components, after Tarjan (1972)."""
    graph, number, lowest = _imports(), dict[str, int](), dict[str, int]()
    stack, components = list[str](), list[list[str]]()

    def visit(name: str) -> None:
        number[name] = lowest[name] = len(number)
        stack.append(name)
        for target in graph[name]:
            if target not in number:
                visit(target)
                lowest[name] = min(lowest[name], lowest[target])
            elif target in stack:
                lowest[name] = min(lowest[name], number[target])
        if lowest[name] == number[name]:
            at = stack.index(name)
            component, stack[at:] = stack[at:], []
            components.append(sorted(component))

    for name in graph:
        if name not in number:
            visit(name)
    return [" ".join(component) for component in components if len(component) > 1]


def _room(name: str) -> tuple[int, str] | None:
    """Height and name of the room of a module, None for the modules of the front door."""
    inside = name.removeprefix("tribodyn.")
    for height, rooms in enumerate(ORDER):
        for room in rooms:
            if inside == room or inside.startswith(f"{room}."):
                return height, room
    return None


def _imports_upwards() -> list[str]:
    """Imports from a room of one that is not below it."""
    upwards = []
    for name, targets in _imports().items():
        for target in sorted(targets):
            source, destination = _room(name), _room(target)
            if source and destination and source[1] != destination[1] and destination[0] >= source[0]:
                upwards.append(f"{name} -> {target}")
    return upwards


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


def _numbers_of(body: list[ast.stmt]) -> Iterator[str]:
    """Names that a body sets to numbers; each name of `A, B = 1, 2` is one, and so is a tuple of numbers."""
    for node in body:
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


def _constants() -> list[str]:
    """Numbers at module level, and defaults of the classes of rules, options and limits."""
    names = []
    for module, path in _modules().items():
        names += [f"{module}: {name}" for name in _numbers_of(_tree(path).body)]
        for node in ast.walk(_tree(path)):
            if isinstance(node, ast.ClassDef) and node.name.endswith(("Rules", "Options", "Limits")):
                names += [f"{module}: {node.name}.{name}" for name in _numbers_of(node.body)]
    return names


def _commands() -> list[str]:
    from tribodyn.workflows.command.main import app

    return [word for word in app if not word.startswith("-")]


def _lines(*folders: str) -> int:
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def _long_files() -> int:
    return max(len(path.read_text(encoding="utf-8").splitlines()) for path in _modules().values())


def _long_functions() -> int:
    trees = [_tree(path) for name, path in _modules().items() if name.startswith("tribodyn.hbm.wear")]
    functions = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return max((node.end_lineno or 0) - node.lineno + 1 for node in functions)


def _repeated(names: list[str]) -> list[str]:
    return [f"{name} {count} times" for name, count in Counter(names).items() if count > 1]


# what users find by its file's name may have the name of another kind: `energy` is a quantity and a wear law
PLUGINS = (".laws.", ".rules.", ".methods.", ".quantities.")
CONTRACT = ("Parameters", "Options", "Rule")  # classes that each file of a kind has


def _repeated_files() -> list[str]:
    files = {name: path.name for name, path in _modules().items() if not any(kind in name for kind in PLUGINS)}
    return _repeated([file for file in files.values() if file != "__init__.py"])


def _repeated_classes() -> list[str]:
    classes = [n.name for path in _modules().values() for n in ast.walk(_tree(path)) if isinstance(n, ast.ClassDef)]
    return _repeated([name for name in classes if name not in CONTRACT])


def _nodes(kind: type[ast.AST], pattern: str) -> list[str]:
    """Places of the package where a node of this kind reads like the pattern."""
    return [
        f"{name}:{getattr(node, 'lineno', 0)}"
        for name, path in _modules().items()
        for node in ast.walk(_tree(path))
        if isinstance(node, kind) and re.search(pattern, ast.unparse(node).partition("\n")[0])
    ]


def _private_words() -> int:
    """The largest share of all folders."""
    folders = (*FOLDERS, "src/tribodyn", "tests", "proof")
    return round(max(share_of_private_words((ROOT / folder).rglob("*.py")) for folder in folders))


MEASURES: dict[str, Callable[[], list[str] | int]] = {
    "import loops": _import_loops,
    "imports upwards": _imports_upwards,
    "commands": _commands,
    "public names": lambda: list(tribodyn.__all__),
    "constants": _constants,
    "lines": lambda: sum(len(path.read_text(encoding="utf-8").splitlines()) for path in _modules().values()),
    "lines of tests": lambda: _lines("tests"),
    "lines of proof": lambda: _lines("proof"),
    "lines of one file": _long_files,
    "lines of one function of hbm.wear": _long_functions,
    "repeated file names": _repeated_files,
    "repeated class names": _repeated_classes,
    "handlers of ValueError": lambda: _nodes(ast.ExceptHandler, r"^except.*\bValueError\b"),
    "assertions of not None": lambda: _nodes(ast.Assert, r"is not None"),
    "private words of 10 000": _private_words,
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_kept(name: str) -> None:
    measured = MEASURES[name]()
    count = measured if isinstance(measured, int) else len(measured)
    shown = "" if isinstance(measured, int) or count > 999 else "\n".join(measured)
    assert count <= MISSED.get(name, LIMITS[name]), f"{count} {name}:\n{shown}"


def test_a_limit_that_is_met_is_missed_no_more() -> None:
    assert all(MISSED[name] > LIMITS[name] for name in MISSED)


def _without_grants(limits: dict[str, int], grants: dict[str, dict[int, int]]) -> dict[str, int]:
    return {name: limit - sum(grants.get(name, {}).values()) for name, limit in limits.items()}


def _literals(text: str) -> dict[str, object]:
    """LIMITS, GRANTS and MISSED of a version of this file."""
    literals = {}
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            target = ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)
            if target in ("LIMITS", "GRANTS", "MISSED"):
                literals[target] = ast.literal_eval(node.value)
    return literals


def test_limits_only_fall() -> None:
    """But for what the issue of a new ability grants, by its number."""
    git = ["git", "-C", str(ROOT)]
    log = subprocess.run([*git, "log", "--format=%H", "--", "tests/test_house.py"], capture_output=True, text=True)
    if log.returncode:
        pytest.skip("not a checkout of git")
    limits = _without_grants(LIMITS, GRANTS)
    for commit in log.stdout.split():
        show = subprocess.run([*git, "show", f"{commit}:tests/test_house.py"], capture_output=True, text=True)
        earlier = _literals(show.stdout)
        if "GRANTS" not in earlier:
            return  # the versions before had other limits
        for name, limit in _without_grants(earlier["LIMITS"], earlier["GRANTS"]).items():  # type: ignore[arg-type]
            assert limits.get(name, 0) <= limit, f"{name}: {limit} in {commit[:8]}"
            missed = earlier["MISSED"].get(name, limit)  # type: ignore[attr-defined]
            granted = sum(GRANTS.get(name, {}).values())
            assert MISSED.get(name, 0) - granted <= missed, f"{name}: {missed} in {commit[:8]}"


def test_every_module_has_a_room() -> None:
    front_door = {name for name in _modules() if _room(name) is None}
    assert all(name.count(".") < 2 for name in front_door), "a room without a place in ORDER"


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
