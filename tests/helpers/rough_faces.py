"""Rough faces of which all is known: caps of spheres on a plane, and waves of a band with random phases."""

import numpy as np

from tribodyn.geometry.asperities import Moments
from tribodyn.geometry.height_map import HeightMap


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
