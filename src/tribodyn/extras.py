"""Packages that only some abilities need, and the extra of the installation that brings each."""

import importlib
from typing import Any

from tribodyn.refusal import Refusal

EXTRA = {
    "distributed": "cluster",
    "imageio_ffmpeg": "pictures",
    "plotly": "pictures",
    "pyvista": "pictures",
    "pyuff": "exports",
    "pypardiso": "mkl",
    "surfalize": "surfaces",
}


def package(name: str) -> Any:
    """A module of such a package; raises Refusal that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        root = name.partition(".")[0]
        raise Refusal(
            f'this needs the package {root.replace("_", "-")}: install it with pip install "tribodyn[{EXTRA[root]}]"'
        ) from None
