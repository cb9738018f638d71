"""Modes of a structure with its contacts stuck, among them the rigid motions that nothing resists."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla


@dataclass(frozen=True)
class RigidModeRules:
    """Which modes are rigid.

    suspect : squared frequency over rounding, below which a mode may be rigid
    gap : squared frequency of a rigid mode over that of the first elastic one, at max_count
    rounded : the same where it is the rounding of far stiffer modes
    max_count : of rigid modes; four bodies that nothing joins have so many"""

    suspect: float = 1e3
    gap: float = 1e-10
    rounded: float = 1e-6
    max_count: int = 24


RIGID_MODES = RigidModeRules()


def rigid_motions(stiffness: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, float]:
    """Mass-normalised motions (n, r) that nothing resists, and a squared frequency between them and the others.

    Raises  LinAlgError where there are none, or the mass is not positive"""
    squares, shapes = sla.eigh(stiffness, mass, subset_by_index=(0, min(len(mass), RIGID_MODES.max_count + 1) - 1))
    largest = float(np.max(np.diag(stiffness).real / np.diag(mass).real)) or 1.0
    size = np.maximum.accumulate(np.abs(squares))
    rounding = len(mass) * float(np.finfo(float).eps) * largest
    above = [float(squares[r]) if r < len(squares) else largest for r in range(1, len(squares) + 1)]
    gaps = [
        r
        for r, next_one in enumerate(above, start=1)
        if size[r - 1] <= max(RIGID_MODES.gap * next_one, min(rounding, RIGID_MODES.rounded * next_one))
    ]
    if not gaps or gaps[-1] > RIGID_MODES.max_count:
        raise np.linalg.LinAlgError
    r = gaps[-1]
    # two steps of inverse iteration take the rounding of the stiff modes out of the shapes
    factor = sla.cho_factor(stiffness + 0.3 * above[r - 1] * mass)
    R = shapes[:, :r]
    for _ in range(2):
        R = sla.cho_solve(factor, mass @ R)
        R = R @ np.linalg.inv(np.linalg.cholesky(R.conj().T @ mass @ R)).conj().T
    return R, 0.3 * above[r - 1]


def stuck_modes(stiffness: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All modes of a stuck structure: squared frequencies (n,), shapes (n, n) of unit modal mass, which are rigid (n,).

    Those that nothing resists come first, with zero for their squared frequency."""
    largest = float(np.max(np.diag(stiffness).real / np.diag(mass).real))
    squares, shapes = sla.eigh(stiffness, mass)
    free = np.zeros(len(mass), bool)
    if squares[0] <= RIGID_MODES.suspect * len(mass) * np.finfo(float).eps * largest:
        try:
            rigid, shift = rigid_motions(stiffness, mass)
        except np.linalg.LinAlgError:
            return squares, shapes, free
        momentum = mass @ rigid
        squares, shapes = sla.eigh(stiffness + shift * momentum @ momentum.T, mass)
        free[: rigid.shape[1]] = True
        squares[free], shapes[:, free] = 0.0, rigid
    return squares, shapes, free


def lowest_modes(stiffness: np.ndarray, mass: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The lowest modes: squared frequencies (count,) and shapes (n, count) of unit modal mass.

    They come from the compliance's side, M phi = nu K phi: rounding is then relative to the softest mode, however much
    stiffer the contact springs are, and what it does to stiff ones is as small as their share in the compliance."""
    n = len(mass)
    nu, phi = sla.eigh(mass, stiffness, subset_by_index=None if count >= n else (n - count, n - 1))
    nu, phi = nu[::-1], phi[:, ::-1]
    lam = 1.0 / np.maximum(nu, np.finfo(float).eps ** 2 * nu[0])  # without mass: as good as rigid
    return lam, phi * np.sqrt(lam)
