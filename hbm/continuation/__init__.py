"""Continuation methods, one file each, found by name.

A method is a module with `follow(balance, start, stop, options, on_point=None) -> Branch`.
"""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

from tribodyn import declare


def names() -> list[str]:
    """Names of the continuation methods there are."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def load(name: str) -> ModuleType:
    """The continuation module of this name, or of a file of one's own; raises ValueError with the known names.

    name : of a method of the package, or the path of a file that ends with .py
    """
    if name.endswith(".py"):
        return declare.run_file(Path(name), "continuation", ("follow", "Options"))
    if name not in names():
        raise ValueError(f"no continuation '{name}': there are {', '.join(names())}, or give a file my_method.py")
    return importlib.import_module(f"{__name__}.{name}")
