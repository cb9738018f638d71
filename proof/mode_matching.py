"""Which mode of a model is which of a measurement: by the kind of motion.

Frequencies alone mislead where modes cross. Where the kind of motion is known, such as "bending" or "torsion", a mode
belongs to a kind by the share of its motion."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment


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
    Raises  ValueError where there are fewer modes than wanted ones"""
    if len(targets) > len(frequency):
        raise ValueError(f"{len(targets)} modes are wanted of {len(frequency)}: compute more modes")
    distance = np.log(np.asarray(frequency)[None, :] / np.array([[value] for _, value in targets])) ** 2
    for row, (kind, _) in zip(distance, targets, strict=True):
        row[share[:, kind] < dominant] = stranger
    return np.asarray(linear_sum_assignment(distance)[1])
