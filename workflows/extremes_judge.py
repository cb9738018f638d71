"""Whether a balance solution may be believed: held against equations that the compliance form never sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hbm import recovery
from hbm.balance import HarmonicBalance, State
from hbm.branch import CONVERGED
from hbm.continuation import arc_length
from hbm.law import SEPARATES, STICKS
from hbm.newton import Solution
from hbm.reference import DenseBalance
from hbm.sampling import sampling_error

REFUSED, WRONG = "refused", "wrong"
AGREE = 1e-5  # relative difference in displacement, energy and preload that rounding and tolerances may leave
LARGEST_DENSE = 700  # unknowns up to which the dense reference is solved


@dataclass(frozen=True)
class Verdict:
    """outcome : "converged", "refused" or "wrong"; reason : how it was checked, why it was refused or what is wrong.

    deviation : largest relative difference in the checks; nan where refused
    """

    outcome: str
    reason: str
    deviation: float = float("nan")


def tried(balance: HarmonicBalance, omega: float) -> tuple[Verdict, Solution]:
    """Solve from rest, as a user gets it, and judge."""
    solution = arc_length.solve_along_load(balance, omega)
    if not solution.converged:
        return Verdict(REFUSED, solution.outcome), solution
    return judged(balance, solution.state), solution


def judged(balance: HarmonicBalance, state: State) -> Verdict:
    """Check a state that is said to be converged: equilibrium, the dense reference, linear limits, energy.

    With sampled transitions energy is as wrong as `sampling_error` says, so that it is checked where that is small.
    """
    energy = balance.energy(state)
    if not all(np.all(np.isfinite(a)) for a in (state.x, state.g, balance.outputs(state), energy)):
        return Verdict(WRONG, "a number is not finite")
    loops = np.abs(state.cycle.force).sum(axis=(1, 2)) * np.abs(state.x).sum(axis=(1, 2))
    gain = -energy.min()
    if gain > 1e-6 * loops.max() and not _excused(balance, state, gain / max(energy.sum(), 1e-300)):
        return Verdict(WRONG, f"a pair gains {gain:.1e} J in each cycle")
    scale = max(float(np.linalg.norm(state.x)), float(np.linalg.norm(balance.x_lin(state.omega))), 1e-300)
    checks = [("equilibrium of every coordinate", _equilibrium(balance, state, scale))]
    limit = _limit(balance, state, scale)
    if limit is not None:
        checks.append(limit)
    n_dense = balance.model.system.n_dof * balance.basis.n_coeff
    several = ""
    if n_dense <= LARGEST_DENSE:
        same = _dense(balance, state, scale)
        if same is None:
            several = "; from the free response the dense Newton finds no solution"
        elif same > AGREE:
            several = "; from the free response the dense Newton finds another solution"
        else:
            checks.append(("dense Newton from the free response", same))
    reason, deviation = max(checks, key=lambda check: check[1])
    if not deviation <= AGREE:
        return Verdict(WRONG, f"{reason} is off by {deviation:.1e}", deviation)
    return Verdict(CONVERGED, ", ".join(name for name, _ in checks) + several, deviation)


def _excused(balance: HarmonicBalance, state: State, share: float) -> bool:
    """Whether a gain of this share of all energy is within what the estimate of sampling says."""
    sampled = balance.basis.transitions == "sampled"
    return sampled and 0 < share < sampling_error(balance, state.omega, state.x)


def sampled_honestly(balance: HarmonicBalance, state: State) -> Verdict:
    """Whether the estimated error of sampling covers the true one: against located transitions and more samples."""
    estimate = sampling_error(balance, state.omega, state.x)
    fine = balance.with_samples(4096, located=True)
    reference = arc_length.solve_along_load(fine, state.omega)
    if not reference.converged:
        return Verdict(REFUSED, f"no reference with 4096 samples: {reference.outcome}")
    ours, theirs = balance.outputs(state)[:, 1:], fine.outputs(reference.state)[:, 1:]
    error = float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))
    says = f"error by sampling {error:.1e}, estimated {estimate:.1e}"
    return Verdict(CONVERGED if error <= 3 * estimate + AGREE else WRONG, says, error)


def _equilibrium(balance: HarmonicBalance, state: State, scale: float) -> float:
    """Coordinates from M, C, K and the contact forces, harmonic by harmonic: do they move the contact as x says?"""
    shape = (-1, balance.basis.n_coeff)
    x, force = state.x.reshape(shape), state.cycle.force.reshape(shape)
    found = recovery.coordinates(balance, x, force, state.omega)
    harmonics = balance.basis.harmonics
    moved = np.stack([balance.model.at_harmonic(h)[1] @ q for h, q in zip(harmonics, found, strict=True)], axis=-1)
    return float(np.linalg.norm(balance.basis.to_real(moved) - x) / scale)


def _limit(balance: HarmonicBalance, state: State, scale: float) -> tuple[str, float] | None:
    """Linear limits of the vibration: every pair stuck and closed through the cycle, or none ever touching.

    The static part of a stuck contact depends on what slipped while the loads came on, so that it has no such limit.
    """
    status = state.cycle.status
    system, b = balance.model.at_harmonic(balance.basis.harmonics[-1])
    if np.all(status == SEPARATES):
        stiffness, name = np.asarray(system.stiffness), "the structure without contact"
    elif np.all(status == STICKS) and not balance.parameters.gap.any():
        k = balance.parameters.stiffness.ravel()
        stiffness, name = system.stiffness + b.T @ (k[:, None] * b), "the structure stuck"
    else:
        return None
    basis, damping = balance.basis, np.zeros_like(system.mass) if system.damping is None else system.damping
    x = np.zeros((len(b), len(basis.harmonics)), complex)
    for (h, name_of_load), value in balance.excitation.loads.items():
        s = 1j * h * state.omega
        q = np.linalg.solve(stiffness + s * damping + s * s * system.mass, value * system.loads[name_of_load])
        x[:, basis.harmonics.index(h)] += b @ q
    off = (basis.to_real(x) - state.x.reshape(len(b), -1))[:, basis.order > 0]
    return name, float(np.linalg.norm(off) / scale)


def _dense(balance: HarmonicBalance, state: State, scale: float) -> float | None:
    """Difference of the dense reference, started from the free response; None where it does not converge."""
    dense = DenseBalance(balance)
    linear = dense.dynamic_stiffness(state.omega)
    try:
        start = np.linalg.lstsq(linear, dense.force.ravel(), rcond=1e-12)[0].reshape(-1, balance.basis.n_coeff)
        found = dense.solve(state.omega, start, tolerance=1e-9, max_steps=25)
    except np.linalg.LinAlgError:
        return None
    if found.outcome != CONVERGED:
        return None
    return float(np.linalg.norm(found.x - state.x) / scale)
