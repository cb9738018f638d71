"""Which mode of one model is which of another, or of a measurement: by shape (MAC), or by the kind of motion.

Frequencies alone mislead where modes cross. Shapes at common points distinguish them; where only the kind of motion is
known, such as "bending" or "torsion", a mode belongs to a kind by the share of its motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment


def mac(first: np.ndarray, second: np.ndarray, weight: np.ndarray | None = None) -> np.ndarray:
    """Modal assurance criterion (n_first, n_second): |a^H W b|^2 / (a^H W a b^H W b), 1 for the same shape.

    first, second : (n_point, n_first), (n_point, n_second) shapes at common points, real or complex
    weight : (n_point, n_point) such as a mass matrix, None for the unit matrix
    Raises  ValueError where the points differ or a shape is zero
    Source  Allemang and Brown 1982; weighted by the mass matrix: Allemang 2003, Sound and Vibration 37(8)
    """
    a, b = np.atleast_2d(first), np.atleast_2d(second)
    if a.shape[0] != b.shape[0]:
        raise ValueError(f"shapes at {a.shape[0]} and {b.shape[0]} points cannot be compared: take common points")
    wa, wb = (a, b) if weight is None else (weight @ a, weight @ b)
    sizes = [np.einsum("ij,ij->j", item.conj(), other).real for item, other in ((a, wa), (b, wb))]
    if min(size.min() for size in sizes) <= 0:
        raise ValueError("a shape without motion at the common points belongs to no mode: leave it out")
    return np.asarray(np.abs(a.conj().T @ wb) ** 2 / np.outer(*sizes))


def match_modes(first: np.ndarray, second: np.ndarray, weight: np.ndarray | None = None) -> np.ndarray:
    """The mode of `second` (n_first,) that is each of `first`, no two the same, so that the sum of MAC is largest.

    Arguments and errors as for `mac`; second has at least as many modes as first
    """
    values = mac(first, second, weight)
    if values.shape[0] > values.shape[1]:
        raise ValueError(f"{values.shape[0]} modes cannot be matched to {values.shape[1]}: compute more of the second")
    return np.asarray(linear_sum_assignment(-values)[1])


def match_kinds(
    frequency: np.ndarray,
    share: np.ndarray,
    targets: Sequence[tuple[int, float]],
    dominant: float = 0.4,
    stranger: float = 10.0,
) -> np.ndarray:
    """The mode (n_wanted,) that stands for each wanted one: of its kind, and nearest in frequency on the whole.

    frequency : (n,) of the modes; share : (n, n_kind) of each mode's motion that is of a kind
    wanted : kind and frequency of each; dominant : share from which on a mode counts as one of a kind
    stranger : cost of a mode of another kind, beside squared logarithms of ratios of frequencies
    Returns indices into frequency, no two the same; where there are too few modes of a kind, one of another kind stands
    Raises  ValueError where there are fewer modes than wanted ones
    """
    if len(targets) > len(frequency):
        raise ValueError(f"{len(targets)} modes are wanted of {len(frequency)}: compute more modes")
    distance = np.log(np.asarray(frequency)[None, :] / np.array([[value] for _, value in targets])) ** 2
    for row, (kind, _) in zip(distance, targets, strict=True):
        row[share[:, kind] < dominant] = stranger
    return np.asarray(linear_sum_assignment(distance)[1])
