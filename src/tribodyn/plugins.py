"""Files found by their name: contact laws, wear laws and continuations, in a folder of the package or of one's own."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

from tribodyn import declarations
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class PluginKind:
    """One kind of file.

    what : it is, in words; package : whose modules are those of the product
    needs : functions or classes that each must have; declares : its class of numbers, see `tribodyn.declarations`
    """

    what: str
    package: str
    needs: tuple[str, ...]
    declares: str = "Parameters"

    @property
    def folder(self) -> Path:
        """The folder of the package's own files; nothing is imported for it but the package."""
        return Path(importlib.import_module(self.package).__path__[0])

    @cache  # noqa: B019
    def names(self) -> list[str]:
        """Names of the files there are."""
        return sorted(m.name for m in pkgutil.iter_modules([str(self.folder)]))

    def file_of(self, name: str) -> Path:
        """The file of this name, which is not run; raises ValueError with the known names.

        name : of a file of the package, or the path of a file of one's own, which ends with .py
        """
        if name.endswith(".py"):
            return Path(name)
        if name not in self.names():
            known = ", ".join(self.names())
            raise Refusal(f"no {self.what} '{name}': there are {known}, or give a file such as my_own.py")
        return self.folder / f"{name}.py"

    @cache  # noqa: B019  # kinds live as long as the program
    def load(self, name: str) -> ModuleType:
        """The module of this name, or of a file of one's own; raises ValueError where there is none."""
        path = self.file_of(name)
        if name.endswith(".py"):
            return declarations.run_file(path, self.what, self.needs)
        return importlib.import_module(f"{self.package}.{name}")

    def declared(self, name: str) -> tuple[declarations.Number, ...]:
        """The numbers that a file declares; it is not run."""
        return declarations.read(self.file_of(name), self.declares)
