"""Packages that only some abilities need, and the extra of the installation that brings each."""

import importlib
from typing import Any

from tribodyn.refusal import Refusal

EXTRA = {
    "PIL": "pictures",
    "distributed": "cluster",
    "gmsh": "mesh",
    "imageio_ffmpeg": "pictures",
    "matplotlib": "pictures",
    "meshio": "mesh",
    "plotly": "pictures",
    "pypardiso": "mkl",
    "pyuff": "exports",
    "pyvista": "pictures",
    "skfem": "mesh",
    "surfalize": "surfaces",
}


class MissingPackage(Refusal):
    """Such a package is not installed."""


def package(name: str) -> Any:
    """A module of such a package; raises MissingPackage that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        root = name.partition(".")[0]
        raise MissingPackage(
            f'this needs the package {root.replace("_", "-")}: install it with pip install "tribodyn[{EXTRA[root]}]"'
        ) from None


class Deferred:
    """Such a package, or a name in it, imported where it is first used."""

    def __init__(self, module: str, name: str = "") -> None:
        self._module, self._name = module, name

    def _value(self) -> Any:
        module = package(self._module)
        return getattr(module, self._name) if self._name else module

    def __getattr__(self, name: str) -> Any:
        return getattr(self._value(), name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._value()(*arguments, **options)
