"""Travelling waves: from the excited sector to any other, and from one sector to the wheel.

Sector n repeats sector 0 later by n phases: x_n(t) = x_0(t - n phi / w), phi = 2 pi EO / N, in its own turned frame;
harmonic h lags by h n phi.
Source  Petrov 2004; Tamatam 2021, section 3.2.3"""

from dataclasses import replace

import numpy as np

from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis


def at_sector(
    basis: HarmonicBasis, coefficients: np.ndarray, engine_order: int, n_sectors: int, sector: int
) -> np.ndarray:
    """Coefficients (..., n_coeff) of another sector from those of sector 0: displacement, force, output.

    The left contact of a sector is the right one of sector 1 in the frame of that sector; the force on it is opposite.
    """
    return basis.shift(coefficients, -2 * np.pi * (engine_order * sector % n_sectors) / n_sectors)


def on_wheel(excitation: Excitation, engine_order: int, n_sectors: int, shown: int | None = None) -> Excitation:
    """The excitation of one sector as loads "<name>@<sector>" of all sectors of a wheel, or of the first `shown`."""
    loads = {
        (h, f"{name}@{n}"): value * np.exp(-2j * np.pi * (h * engine_order * n % n_sectors) / n_sectors)
        for (h, name), value in excitation.loads.items()
        for n in range(shown or n_sectors)
    }
    return replace(excitation, loads=loads)
