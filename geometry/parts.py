"""Find a part by the name of its file.

A part is a file in this folder, or in the folder of a case, that defines `class Parameters` (a frozen dataclass in SI
units that validates itself) and `def build(parameters, path)` (writes a second-order .msh with physical groups). It may
list in `MESH` which of its parameters are numbers of elements or nodes, so that its mesh can be made coarser to measure
the mesh error. Nothing else lists it: the folders of the cases are searched by file, no case is imported before a scene
names its part."""

import ast
import importlib
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from tribodyn import declarations
from tribodyn.refusal import Refusal

_PACKAGE = Path(declarations.__file__).parent
_GENERAL, _CASES = "geometry/*.py", "workflows/cases/*/*.py"


@cache
def _files() -> dict[str, Path]:
    """Name -> file of every part, sorted; no part is imported."""
    files = [file for pattern in (_GENERAL, _CASES) for file in _PACKAGE.glob(pattern) if _is_part(file)]
    return {file.stem: file for file in sorted(files, key=lambda file: file.stem)}


def names() -> tuple[str, ...]:
    """Return the names of all parts, sorted."""
    return tuple(_files())


def file_of(name: str) -> Path:
    """The file of a part; raises Refusal with the names of all parts."""
    if name not in _files():
        raise Refusal(f"there is no part '{name}': the parts are {', '.join(names())}, or give a file my_part.py")
    return _files()[name]


def load(name: str) -> ModuleType:
    """Import a part.

    name : its file name without .py, or the path of a user's file, which ends with .py
    Returns the module, with `Parameters` and `build`
    Raises Refusal: there is no such part"""
    if name.endswith(".py"):
        return declarations.run_file(Path(name), "part", ("build", "Parameters"))
    module = file_of(name).relative_to(_PACKAGE).with_suffix("")
    return importlib.import_module(".".join(("tribodyn", *module.parts)))


def rescaled(part: ModuleType, parameters: Any, ratio: float) -> dict[str, int]:
    """Fewer or more elements along every edge of a part.

    parameters : of the part; ratio : of the new counts to those that the part lists in MESH, below or above 1
    Returns the new counts by name, the nearest that the part accepts; empty where it lists none or none can be changed
    """
    changed: dict[str, int] = {}
    for name in getattr(part, "MESH", ()):
        count = getattr(parameters, name)
        target = max(1, round(count * ratio))
        candidates = range(1, count) if ratio < 1 else range(count + 1, 2 * target)
        for candidate in sorted(candidates, key=lambda n: (abs(n - target), n)):
            try:
                parameters = replace(parameters, **{name: candidate})
            except ValueError:  # a user's part may raise its own
                continue
            changed[name] = candidate
            break
    return changed


def _is_part(file: Path) -> bool:
    body = ast.parse(file.read_text(encoding="utf-8")).body
    classes = {node.name for node in body if isinstance(node, ast.ClassDef)}
    functions = {node.name for node in body if isinstance(node, ast.FunctionDef)}
    return "Parameters" in classes and "build" in functions
