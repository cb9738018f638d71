"""Limits of the parameters of parts; each failure is one sentence that names the key and the cure."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from tribodyn.refusal import Refusal

MAX_COUNT = 2000  # elements or nodes along one edge of a part


def numbers(parameters: Any, odd: Sequence[str] = (), /, **limits: float | tuple[float, float] | None) -> None:
    """Refuse parameters that are not what their defaults are: whole numbers from 1 to MOST, else numbers above zero.

    odd : node counts, which second-order elements make odd, 2 n + 1 for n elements
    limits : least value of a whole number, least and largest of another one; None where the part itself refuses"""
    for item in fields(parameters):
        name, value = item.name, getattr(parameters, item.name)
        least: Any = limits.get(name, 3 if name in odd else 1)
        if least is None:
            continue
        number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        if not isinstance(item.default, int):
            low, high = least if isinstance(least, tuple) else (0.0, math.inf)
            if not number or not low <= value <= high or (value == 0 and high == math.inf):
                limits_text = f"from {low:g} to {high:g}" if high < math.inf else "above zero"
                raise Refusal(f"geometry.{name} is {value!r}: give a number {limits_text}")
        elif not number or not isinstance(value, int) or value < least:
            raise Refusal(f"geometry.{name} is {value!r}: give a whole number of at least {least}")
        elif value > MAX_COUNT:
            raise Refusal(f"geometry.{name} is {value}: give at most {MAX_COUNT}, a mesh of more has no use")
        elif name in odd and value % 2 == 0:
            raise Refusal(
                f"geometry.{name} is {value}: give an odd number of nodes, {value - 1} or {value + 1}, "
                "because second-order elements share their end nodes"
            )
