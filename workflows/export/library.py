"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from typing import Any


def library(name: str) -> Any:
    """A library of the extra "exports"; raises ValueError with how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.split(".")[0].replace("_", "-")
        raise ValueError(
            f'this needs the package {package}: install it with pip install "{package}", '
            'or all formats at once with pip install "tribodyn[exports]"'
        ) from None
