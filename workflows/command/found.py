"""The words of the command, found: a new one is one new file with `COMMANDS`, in this folder or in a case's."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

from tribodyn.workflows import cases
from tribodyn.workflows import command as room

Command = Callable[..., Any]


def commands() -> Iterator[Command]:
    """The functions in `COMMANDS` of every module here, and of every case that has a module `commands`."""
    for name in (*_here(), *_of_cases()):
        yield from getattr(importlib.import_module(name), "COMMANDS", ())


def _here() -> list[str]:
    return [f"{room.__name__}.{module.name}" for module in pkgutil.iter_modules(room.__path__) if module.name != "main"]


def _of_cases() -> list[str]:
    return [
        f"{cases.__name__}.{case.name}.commands"
        for case in pkgutil.iter_modules(cases.__path__)
        if case.ispkg and importlib.util.find_spec(f"{cases.__name__}.{case.name}.commands") is not None
    ]
