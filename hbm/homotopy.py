"""A number of a problem led from where it is solved to where it is wanted, in steps that halve where one fails.

Source  Allgower and Georg 1990, chapter 1
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Strides:
    """first : step; growth : of a step that succeeds; shortest : step that is not tried any more."""

    first: float = 0.25
    growth: float = 1.5
    shortest: float = 1e-3


SHARES = Strides()  # of a load or of an opening
DECADES = Strides(first=1.0, growth=1.6, shortest=0.02)  # of a decimal logarithm


def lead(level: float, goal: float, strides: Strides, solve: Callable[[float, float], bool]) -> float:
    """How far a number comes from a level towards its goal.

    solve : whether there is a solution at its first argument beside the one at its second, the level reached so far;
        it keeps what it finds
    """
    stride = strides.first
    while level != goal and stride > strides.shortest:
        target = min(level + stride, goal) if goal > level else max(level - stride, goal)
        if solve(target, level):
            level, stride = target, strides.growth * stride
        else:
            stride *= 0.5
    return level
