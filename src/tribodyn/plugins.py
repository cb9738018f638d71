"""Files found by their name, in a folder of the package or beside a scene: contact laws, wear laws, continuations."""

import importlib
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

    title : of the kind, in words; package : whose modules are the shipped files
    functions : functions or classes that each file must define
    class_name : of the class that declares its numbers, see `tribodyn.declarations`"""

    title: str
    package: str
    functions: tuple[str, ...]
    class_name: str = "Parameters"

    @property
    def folder(self) -> Path:
        """The folder of the shipped files; only the package itself is imported for it."""
        return Path(importlib.import_module(self.package).__path__[0])

    @cache  # noqa: B019
    def names(self) -> list[str]:
        """Names of the shipped files."""
        return sorted(module.name for module in pkgutil.iter_modules([str(self.folder)]))

    def file_of(self, name: str) -> Path:
        """The file of a name, which is not run; refuses an unknown name with a list of those that there are.

        name : of a shipped file, or the path of a user's file, which ends with .py"""
        if name.endswith(".py"):
            return Path(name)
        if name not in self.names():
            names = ", ".join(self.names())
            raise Refusal(f"no {self.title} '{name}': there are {names}, or give a file such as my_own.py")
        return self.folder / f"{name}.py"

    @cache  # noqa: B019  # kinds live as long as the program
    def load(self, name: str) -> ModuleType:
        """The module of a name, see `file_of`; refuses where there is none."""
        path = self.file_of(name)
        if name.endswith(".py"):
            return declarations.run_file(path, self.title, self.functions)
        return importlib.import_module(f"{self.package}.{name}")

    def declared(self, name: str) -> tuple[declarations.Number, ...]:
        """The numbers that a file declares; the file is not run."""
        return declarations.read(self.file_of(name), self.class_name)
