"""When pairs first lift off, and when they lose contact for good, from the rows of a wear history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.history import WearHistory


@dataclass(frozen=True)
class WearEvents:
    """Cycles at which contact changes for good, nan where it has not.

    lifts : (n_pair,) from then on the pair opens in a part of the cycle; lost : (n_pair,) it touches no more
    """

    lifts: np.ndarray
    lost: np.ndarray

    @property
    def first_lift(self) -> float | None:
        """Cycles until a pair that was closed all the time opens for the first time."""
        return _first(self.lifts)

    @property
    def first_loss(self) -> float | None:
        """Cycles until the first pair loses contact."""
        return _first(self.lost)


def events(
    history: WearHistory, components: tuple[str, ...], gap: np.ndarray, basis: HarmonicBasis
) -> WearEvents | None:
    """Locate the events between rows by a straight line through the penetration of each pair.

    components : of the contact; gap : (n_pair,) of the unworn contact [m]
    Returns None for a contact without a normal component
    """
    if "n" not in components or not len(history.cycles):
        return None
    normal = history.displacement[:, components.index("n") :: len(components)]  # (n_row, n_pair, n_coeff)
    penetration = basis.to_time(normal) - (gap + history.depth)[..., None]
    deepest, shallowest = penetration.max(axis=-1), penetration.min(axis=-1)
    return WearEvents(_crossings(history.cycles, shallowest), _crossings(history.cycles, deepest))


def _crossings(cycles: np.ndarray, value: np.ndarray) -> np.ndarray:
    """(n_pair,) cycles at which a value (n_row, n_pair) last falls below zero to stay; 0 if it never was above."""
    n_row, n_pair = value.shape
    found = np.full(n_pair, np.nan)
    for i in range(n_pair):
        above = np.flatnonzero(value[:, i] > 0)
        if len(above) == 0:
            found[i] = 0.0
        elif above[-1] + 1 < n_row:
            k = above[-1]
            share = value[k, i] / (value[k, i] - value[k + 1, i])
            found[i] = cycles[k] + share * (cycles[k + 1] - cycles[k])
    return found


def _first(cycles: np.ndarray) -> float | None:
    later = cycles[cycles > 0]
    return float(later.min()) if len(later) else None
