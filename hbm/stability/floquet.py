"""Floquet exponents from the linearised time steps of an integrated periodic motion."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.time.time_integration import Options, PeriodicMotion, TimeStepper, integrate

MAX_STATES = 900  # up to which the monodromy matrix is formed, whose eigenvalues are dense work
LEAST_MULTIPLIER = 1e-10  # smaller ones belong to the time stepping, not to the structure


def exponents(balance: HarmonicBalance, state: State, options: Options | None = None) -> np.ndarray:
    """Floquet exponents of the motion that time integration finds from a balance state.

    Returns (n,) complex [1/s], without those of sliders that never move: any position of theirs is an equilibrium
    Raises  ValueError for models too large, or where the motion does not become periodic
    """
    options = options or Options()
    stepper = TimeStepper(balance, state.omega, options)
    if _size(stepper) > MAX_STATES:
        raise ValueError(f"{_size(stepper)} state variables are too many for Floquet multipliers: use the method hill")
    motion = integrate(balance, state.omega, state, options, with_slopes=True)
    if not motion.periodic:
        raise ValueError(f"no periodic motion near this state: {motion.outcome}")
    multipliers = np.linalg.eigvals(monodromy(stepper, motion))
    multipliers = multipliers[np.abs(multipliers) > LEAST_MULTIPLIER]
    return np.log(multipliers.astype(complex)) * state.omega / (2 * np.pi)


def size(balance: HarmonicBalance, omega: float, options: Options | None = None) -> int:
    """Number of state variables that the multipliers at a frequency [rad/s] are those of."""
    return _size(TimeStepper(balance, omega, options or Options()))


def _size(stepper: TimeStepper) -> int:
    return 2 * len(stepper.lam) + stepper.balance.memory.size + 2 * len(stepper.static)


def monodromy(stepper: TimeStepper, motion: PeriodicMotion) -> np.ndarray:
    """Derivative of the state (z, f, x, memory that moves) after a period with respect to the one before."""
    assert motion.slopes is not None
    linear, A, c = stepper.linear, stepper.contact.A.T, stepper.c
    n, n_contact, n_memory = len(linear.E), len(A), stepper.balance.memory.size
    n_state = motion.slopes.shape[2] - c
    z, f, x, s = np.split(np.eye(n + 2 * n_contact + n_memory), np.cumsum([n, n_contact, n_contact]))
    for D in motion.slopes:
        free = linear.E @ z - 0.5 * linear.Q @ (linear.U.T @ f)
        of_x, of_s, of_x0 = (
            _block_diagonal(part) for part in np.split(D, [c, c + n_state], axis=2)
        )  # each of (f, memory), pair by pair
        known = of_s @ s + of_x0 @ x
        force = np.arange(len(of_x)).reshape(-1, c + n_state)[:, :c].ravel()
        x_free = linear.U @ free[: n // 2] - A @ known[force]
        x = np.linalg.solve(np.eye(n_contact) + A @ of_x[force], x_free)
        both = of_x @ x + known
        f, s = both[force], np.delete(both, force, axis=0)
        z = free - 0.5 * linear.Q @ (linear.U.T @ f)
    whole = np.concatenate([z, f, x, s])
    fixed = np.zeros(len(whole), bool)
    first = n + 2 * n_contact
    fixed[first:] = np.all(whole[first:] == np.eye(len(whole))[first:], axis=1)
    return whole[np.ix_(~fixed, ~fixed)]


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    n, r, c = blocks.shape
    full = np.zeros((n, r, n, c))
    full[np.arange(n), :, np.arange(n)] = blocks
    return full.reshape(n * r, n * c)
