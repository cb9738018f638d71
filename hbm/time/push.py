"""Whether a small push drives a periodic motion away: what a machine would do, without a derivative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tribodyn.hbm.time.period_search import Period, PeriodSearch
from tribodyn.hbm.time.time_step import Moving


@dataclass(frozen=True)
class PushRules:
    """How far a periodic motion is pushed, and when it has come back or left."""

    # push of a periodic motion, relative to its vibration; share of it down to which it must die away; times of it
    # that tell growth at the end; distance, relative to the vibration, at which the motion has left
    push: float = 1e-3
    decayed: float = 0.3
    grown: float = 3.0
    left: float = 0.1


RULES = PushRules()


class Pushed(NamedTuple):
    """away : whether the motion has left; motion : after the last period that was marched."""

    away: bool
    motion: Moving


def push(plain: PeriodSearch, found: Period, every: int, along: np.ndarray | None = None) -> Pushed:
    """March on from a periodic motion that is pushed, until it has come back or left, or no more periods are allowed.

    plain : of plain periods; found : the periodic motion; every : periods after which to see whether it came back
    along : direction of the push as a state vector, by default all modes alike
    Sliders that come to rest elsewhere leave a part of the push, which does not count as away
    Raises  IntegrationFailed
    """
    away, motion = 0.0, plain.vector.unpack(plain.vector.pushed(found.image, RULES.push * found.size, along), found.end)
    while plain.periods < plain.options.max_periods:
        later = plain.step(motion)
        motion = later.end
        away = plain.vector.apart(later.image, found.image) / found.size
        if away >= RULES.left:
            return Pushed(True, motion)
        if plain.periods % every == 0 and away <= RULES.decayed * RULES.push:
            break
    return Pushed(away > RULES.grown * RULES.push, motion)
