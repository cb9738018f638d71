"""Airfoil sections that fill a square of cells: cambered, blunt at both edges, turned by their stagger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Section:
    """chord, thickness : [m]; camber : height of the mean line over the chord; edge : thickness at the leading and the
    trailing edge over that at mid-chord; stagger : angle from x to the chord [rad].
    """

    chord: float
    thickness: float
    camber: float
    edge: float
    stagger: float

    def at(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions x, y [m] at fractions u of the chord and v of the thickness, centred on the mean line.

        Mean line and thickness are parabolas: no sharp edge folds a cell
        """
        bulge = 4 * u * (1 - u)
        slope = 4 * self.camber * (1 - 2 * u)
        offset = (v - 0.5) * self.thickness * (self.edge + (1 - self.edge) * bulge)
        along = (u - 0.5) * self.chord - offset * slope / np.hypot(1, slope)
        across = self.camber * self.chord * (bulge - 2 / 3) + offset / np.hypot(1, slope)
        c, s = np.cos(self.stagger), np.sin(self.stagger)
        return along * c - across * s, along * s + across * c


def between(root: Section, tip: Section, height: np.ndarray) -> Section:
    """Section at fractions `height` of the span, every property linear from root to tip (arrays like `height`)."""
    names = ("chord", "thickness", "camber", "edge", "stagger")
    a, b = ([getattr(s, n) for n in names] for s in (root, tip))
    return Section(*(np.asarray(p + (q - p) * height) for p, q in zip(a, b, strict=True)))  # type: ignore[arg-type]
