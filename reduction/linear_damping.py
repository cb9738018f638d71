"""Linear damping of a reduced system."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.blas import dsyrk, zherk

from tribodyn.fem.modes import dense_modes, lowest_squares
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.refusal import Refusal


def modal_damping(system: SecondOrderSystem, ratio: float | Sequence[float]) -> np.ndarray:
    """The same damping ratio in every mode of the free system, none for rigid-body modes; or one for each.

    C = M Phi diag(2 zeta omega) Phi^H M over all modes of the dense system without contact
    ratio : several are those of the modes that vibrate, in their order, the last that of all further ones
    Returns C (n, n) [N s/m]
    Raises  Refusal for a ratio below 0"""
    ratios = np.atleast_1d(ratio)
    if not (ratios >= 0).all():
        raise Refusal(f"damping: ratio = {ratio}: give a part of critical damping of 0 or more, such as 0.01")
    values, phi, _ = dense_modes(system.stiffness, system.mass)
    # below this an eigenvalue is rounding of a rigid-body mode
    values[values < len(values) * np.finfo(float).eps * values[-1]] = 0.0
    mode = np.arange(len(values)) - np.count_nonzero(values == 0)  # of those that vibrate
    weighted = (system.mass @ phi) * np.sqrt(2 * ratios[np.clip(mode, 0, len(ratios) - 1)] * np.sqrt(values))
    multiply = zherk if np.iscomplexobj(weighted) else dsyrk
    upper = np.triu(multiply(1.0, weighted))
    return upper + np.triu(upper, 1).conj().T


def modal_damping_towards(system: SecondOrderSystem, ratio: float) -> Callable[[np.ndarray], np.ndarray]:
    """What makes dC of any dK (n, n), for a system whose C is that of `modal_damping`.

    C M^-1 C = 4 zeta^2 K, so that dC M^-1 C + C M^-1 dC = 4 zeta^2 dK, in which every pair of modes is by itself"""
    values, phi = eigh(system.damping, system.mass)
    weighted, sums = system.mass @ phi, values[:, None] + values
    resisted = sums > len(values) * np.finfo(float).eps * sums.max()
    share = np.divide(4 * ratio**2, sums, out=np.zeros_like(sums), where=resisted)
    return lambda change: weighted @ (share * (phi.conj().T @ (change @ phi))) @ weighted.conj().T


def rayleigh(system: SecondOrderSystem, alpha: float, beta: float) -> np.ndarray:
    """C = alpha M + beta K (n, n) [N s/m]; alpha [1/s], beta [s].

    Raises  Refusal for a negative coefficient"""
    if not (alpha >= 0 and beta >= 0):
        raise Refusal(f"damping: alpha = {alpha} and beta = {beta} must not be negative")
    return alpha * system.mass + beta * system.stiffness


def rayleigh_of_ratios(
    system: SecondOrderSystem, modes: tuple[int, int], ratios: tuple[float, float]
) -> tuple[float, float]:
    """alpha [1/s] and beta [s] that give two modes of a system their damping ratios, zeta = alpha / 2 w + beta w / 2.

    Raises  Refusal where there are no such modes, one does not vibrate, or a coefficient would be negative"""
    squares = lowest_squares(system.stiffness, system.mass, min(max(modes) + 1, len(system.mass)))
    if max(modes) >= len(squares):
        raise Refusal(f"damping.modes: there is no mode {max(modes)}, the system has {len(squares)}")
    squares = squares[list(modes)]
    if not (squares > 0).all():
        raise Refusal(f"damping.modes: mode {min(modes)} is a motion as a rigid body: choose modes that vibrate")
    omega = np.sqrt(squares)
    alpha, beta = np.linalg.solve(np.column_stack([0.5 / omega, 0.5 * omega]), ratios)
    if min(alpha, beta) < 0:
        raise Refusal("damping.ratios: no damping of Rayleigh gives these two modes these ratios: change modes")
    return float(alpha), float(beta)
