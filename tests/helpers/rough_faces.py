"""Rough faces of which all is known: caps of spheres on a plane, and waves of a band with random phases."""

from dataclasses import dataclass

import numpy as np

from tribodyn.geometry.height_map import HeightMap


@dataclass(frozen=True)
class Moments:
    """Spectral moments of a face, mean over x and y of their profiles.

    m0 : variance of the heights [m2];  m2 : of the slopes [-];  m4 : of the curvatures [1/m2]
    Source  McCool, Wear 107 (1986) 37; its summits where it is isotropic and Gaussian: Nayak, J. Lubr. Technol. 93
        (1971) 398"""

    m0: float
    m2: float
    m4: float

    @property
    def alpha(self) -> float:
        """Nayak's bandwidth m0 m4 / m2^2, 1.5 or more."""
        return self.m0 * self.m4 / self.m2**2

    @property
    def density(self) -> float:
        """Summits per area of a Gaussian face [1/m2]: Nayak's m4 / (6 pi sqrt(3) m2)."""
        return self.m4 / (6 * np.pi * np.sqrt(3) * self.m2)

    @property
    def radius(self) -> float:
        """One over the mean curvature of its summits [m]: 3/8 sqrt(pi / m4)."""
        return 3 / 8 * float(np.sqrt(np.pi / self.m4))

    @property
    def deviation(self) -> float:
        """Standard deviation of the heights of its summits [m]: sqrt((1 - 0.8968 / alpha) m0)."""
        return float(np.sqrt((1 - 0.8968 / self.alpha) * self.m0))

    @property
    def mean(self) -> float:
        """Mean height of its summits above the mean of the face [m]: 4 sqrt(m0 / (pi alpha))."""
        return 4 * float(np.sqrt(self.m0 / (np.pi * self.alpha)))


def caps(radius: float, heights: np.ndarray, distance: float, step: float) -> HeightMap:
    """Spheres of one radius on a square lattice, cut by a plane; heights : (n, n) of their summits above it."""
    per_cell = round(distance / step)
    cell = (np.arange(per_cell) - per_cell // 2) * step
    lower = np.hypot(cell[:, None], cell) ** 2
    drop = radius - np.sqrt(np.maximum(radius**2 - lower, 0.0))
    z = np.maximum(heights[:, None, :, None] - drop[None, :, None, :], 0.0).reshape(2 * (len(heights) * per_cell,))
    axis = np.arange(len(z)) * step
    return HeightMap(axis, axis, z, "caps")


def gaussian(n: int, step: float, longest: float, shortest: float, rms: float, seed: int) -> tuple[HeightMap, Moments]:
    """A periodic isotropic face with waves between two lengths, equally strong; and its moments, from the waves."""
    wave = 2 * np.pi * np.fft.fftfreq(n, step)
    k = np.hypot(wave[:, None], wave)
    band = (k >= 2 * np.pi / longest) & (k <= 2 * np.pi / shortest)
    amplitude = np.fft.fft2(np.random.default_rng(seed).standard_normal((n, n))) * band
    z = np.fft.ifft2(amplitude).real
    share = np.abs(amplitude) ** 2 / (np.abs(amplitude) ** 2).sum() * rms**2
    axis = np.arange(n) * step
    # mean of cos^2 and of cos^4 over all directions
    moments = Moments(rms**2, float((share * k**2).sum() / 2), float(3 / 8 * (share * k**4).sum()))
    return HeightMap(axis, axis, z * (rms / z.std()), "waves"), moments
