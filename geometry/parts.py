"""Find a part by the name of its file.

A part is a file in this folder that defines `class Parameters` (a frozen dataclass in SI units that validates itself)
and `def build(parameters, path)` (writes a second-order .msh with physical groups). It may list in `MESH` which of its
parameters are numbers of elements or nodes, so that its mesh can be made coarser to measure what it costs. Nothing else
lists it.
"""

from __future__ import annotations

import ast
import importlib
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from tribodyn import declare
from tribodyn.refusal import Refusal

_FOLDER = Path(__file__).parent


@cache
def names() -> tuple[str, ...]:
    """Return the names of all parts, sorted; no part is imported for it."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.py") if _is_part(file)))


def file_of(name: str) -> Path:
    """The file of a part; raises ValueError with the parts that there are."""
    file = _FOLDER / f"{name}.py"
    if file.parent != _FOLDER or not file.is_file() or not _is_part(file):
        raise Refusal(f"there is no part '{name}': the parts are {', '.join(names())}, or give a file my_part.py")
    return file


def load(name: str) -> ModuleType:
    """Import a part.

    name : its file name without .py, or the path of a file of one's own, which ends with .py
    Returns the module, with `Parameters` and `build`
    Raises ValueError: there is no such part
    """
    if name.endswith(".py"):
        return declare.run_file(Path(name), "part", ("build", "Parameters"))
    file_of(name)
    return importlib.import_module(f"tribodyn.geometry.{name}")


def rescaled(part: ModuleType, parameters: Any, ratio: float) -> dict[str, int]:
    """Fewer or more elements along every edge of a part.

    parameters : of the part; ratio : of the new counts to those that the part lists in MESH, below or above 1
    Returns the new counts by name, the nearest that the part accepts; empty where it lists none or none can be changed
    """
    changed: dict[str, int] = {}
    for name in getattr(part, "MESH", ()):
        count = getattr(parameters, name)
        wanted = max(1, round(count * ratio))
        others = range(1, count) if ratio < 1 else range(count + 1, 2 * wanted)
        for candidate in sorted(others, key=lambda n: (abs(n - wanted), n)):
            try:
                parameters = replace(parameters, **{name: candidate})
            except ValueError:
                continue
            changed[name] = candidate
            break
    return changed


@cache
def _is_part(file: Path) -> bool:
    body = ast.parse(file.read_text(encoding="utf-8")).body
    classes = {node.name for node in body if isinstance(node, ast.ClassDef)}
    functions = {node.name for node in body if isinstance(node, ast.FunctionDef)}
    return "Parameters" in classes and "build" in functions
