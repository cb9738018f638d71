"""Limits of the parameters of parts; each failure is one sentence that names the key and the cure."""

from __future__ import annotations

import math
from typing import Any

MOST = 2000  # elements or nodes along one edge of a part


def positive(parameters: Any, *names: str, unit: str = "metres") -> None:
    """Refuse parameters that are not finite numbers above zero."""
    for name in names:
        value = getattr(parameters, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value <= 0:
            raise ValueError(f"geometry.{name} is {value!r}: give a number above zero ({unit})")


def within(parameters: Any, *names: str, least: float, most: float, unit: str) -> None:
    """Refuse parameters that are not numbers from `least` to `most`."""
    for name in names:
        value = getattr(parameters, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
            raise ValueError(f"geometry.{name} is {value!r}: give a number from {least:g} to {most:g} ({unit})")


def whole(parameters: Any, *names: str, least: int) -> None:
    """Refuse parameters that are not whole numbers from `least` to MOST."""
    for name in names:
        value = getattr(parameters, name)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ValueError(f"geometry.{name} is {value!r}: give a whole number of at least {least}")
        if value > MOST:
            raise ValueError(f"geometry.{name} is {value}: give at most {MOST}, a mesh of more has no use")


def odd(parameters: Any, *names: str, least: int = 3) -> None:
    """Refuse node counts that second-order elements cannot have: they are odd, 2 n + 1 for n elements."""
    whole(parameters, *names, least=least)
    for name in names:
        value = getattr(parameters, name)
        if value % 2 == 0:
            raise ValueError(
                f"geometry.{name} is {value}: give an odd number of nodes, {value - 1} or {value + 1}, "
                "because second-order elements share their end nodes"
            )
