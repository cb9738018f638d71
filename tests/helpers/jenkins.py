"""A Jenkins element in closed form."""

import numpy as np


def describing_function(amplitude, kt, limit):
    """Cosine and sine coefficient of a Jenkins element under u = A cos t (Griffin 1980)."""
    if amplitude <= limit / kt:
        return kt * amplitude, 0.0
    ratio = limit / (kt * amplitude)
    theta = np.arccos(1 - 2 * ratio)
    return kt * amplitude / np.pi * (theta - 0.5 * np.sin(2 * theta)), -4 * limit / np.pi * (1 - ratio)
