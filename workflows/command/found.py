"""The words of the command, found: a new one is one new file with `COMMANDS` in this folder."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

from tribodyn.workflows import command as room

Command = Callable[..., Any]


def commands() -> Iterator[Command]:
    """The functions in `COMMANDS` of every module here."""
    for module in pkgutil.iter_modules(room.__path__):
        if module.name != "main":
            yield from getattr(importlib.import_module(f"{room.__name__}.{module.name}"), "COMMANDS", ())
