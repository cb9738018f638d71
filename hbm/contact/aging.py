"""What a joint becomes as it wears: numbers that change with the state of each pair, and worn material that stays.

The state of a pair is its depth. The friction work per area that went with it follows from the energy wear law,
dh = alpha(e) de, so that nothing besides the depth is integrated.
Source  tables: Fantetti et al. 2019 (stiffness and friction while running in); third body: Godet 1984, whose balance of
flows, what is worn less what is ejected, is put over the depth here (ours)"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class NumberTable:
    """A number over the state of a pair: linear between rows, constant beyond them.

    over : "depth" [m] or "energy_density" [J/m2]; at : ascending; values : above zero"""

    over: str
    at: tuple[float, ...]
    values: tuple[float, ...]

    @property
    def start(self) -> float:
        """The number before any wear."""
        return float(np.interp(0.0, self.at, self.values))

    def factor(self, depth: np.ndarray, energy: np.ndarray) -> np.ndarray:
        """(n_pair,) the number of worn pairs over that before any wear."""
        return np.asarray(np.interp(depth if self.over == "depth" else energy, self.at, self.values) / self.start)


@dataclass(frozen=True)
class EnergyByDepth:
    """Friction work per area [J/m2] that has worn a pair so deep, by the energy wear law.

    coefficient : before any wear [m3/J]; table : of it over the work, None where it is constant"""

    coefficient: float
    table: NumberTable | None = None

    def of(self, depth: np.ndarray) -> np.ndarray:
        """(n_pair,) the inverse of h(e), a parabola between two rows of the table."""
        if not self.coefficient > 0:
            return np.zeros_like(depth)
        if self.table is None:
            return depth / self.coefficient
        energy = np.concatenate([[0.0], [e for e in self.table.at if e > 0]])
        alpha = self.coefficient * self.table.factor(energy, energy)
        stride, slope = np.diff(energy), np.append(np.diff(alpha) / np.diff(energy), 0.0)
        known = np.concatenate([[0.0], np.cumsum(0.5 * (alpha[1:] + alpha[:-1]) * stride)])
        row = np.clip(np.searchsorted(known, depth, "right") - 1, 0, None)
        rest = depth - known[row]
        root = np.sqrt(np.maximum(alpha[row] ** 2 + 2 * slope[row] * rest, 0.0))
        return np.asarray(energy[row] + 2 * rest / (alpha[row] + root))


@dataclass(frozen=True)
class DebrisBed:
    """Worn material in the gap, of its own volume.

    retained : share of what is worn that stays in an empty gap
    thickness : of the bed that loses as much as stays of what is worn [m]"""

    retained: float = 0.0
    thickness: float = np.inf

    def bed(self, depth: np.ndarray) -> np.ndarray:
        """(n_pair,) thickness of the bed [m]: db/dh = retained (1 - b / thickness)."""
        if np.isinf(self.thickness):
            return self.retained * depth
        return np.asarray(-self.thickness * np.expm1(-self.retained * depth / self.thickness))

    def opening_slope(self, depth: np.ndarray) -> np.ndarray:
        """(n_pair,) share of what is being worn that leaves the gap."""
        return np.asarray(1 - self.retained * np.exp(-self.retained * depth / self.thickness))


@dataclass(frozen=True)
class Aging:
    """How a joint changes as it wears.

    tables : by the numbers of its law, "tangential_stiffness" and "normal_stiffness"
    energy : for tables over the friction work per area; None where there are none; debris : in the gap"""

    tables: Mapping[str, NumberTable] = field(default_factory=dict)
    energy: EnergyByDepth | None = None
    debris: DebrisBed = DebrisBed()

    def factors(self, depth: np.ndarray) -> dict[str, np.ndarray]:
        """(n_pair,) factor on each number that has a table."""
        energy = np.zeros_like(depth) if self.energy is None else self.energy.of(depth)
        return {name: table.factor(depth, energy) for name, table in self.tables.items()}
