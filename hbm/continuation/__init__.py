"""Continuation methods, one file each, found by name.

A method is a module with `follow(balance, start, stop, options, on_point=None) -> Branch`.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType


def names() -> list[str]:
    """Names of the continuation methods there are."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def load(name: str) -> ModuleType:
    """The continuation module of this name; raises ValueError with the known names."""
    if name not in names():
        raise ValueError(f"no continuation '{name}': there are {', '.join(names())}")
    return importlib.import_module(f"{__name__}.{name}")
