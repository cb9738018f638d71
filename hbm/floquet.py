"""Floquet exponents from the linearised time steps of an integrated periodic motion."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.time_integration import Options, PeriodicMotion, TimeStepper, integrate

LARGEST = 900  # state variables up to which the monodromy matrix is formed
DEAD = 1e-10  # multipliers below this belong to the time stepping, not to the structure


def exponents(balance: HarmonicBalance, state: State, options: Options | None = None) -> np.ndarray:
    """Floquet exponents of the motion that time integration finds from a balance state.

    Returns (n,) complex [1/s], without those of sliders that never move: any position of theirs is an equilibrium
    Raises  ValueError for models too large, or where the motion does not become periodic
    """
    options = options or Options()
    stepper = TimeStepper(balance, state.omega, options)
    size = 3 * len(stepper.lam) + balance.memory.size + len(stepper.U)
    if size > LARGEST:
        raise ValueError(f"{size} state variables are too many for Floquet multipliers: use the method hill")
    motion = integrate(balance, state.omega, state, options, with_slopes=True)
    if motion.outcome != "converged":
        raise ValueError(f"no periodic motion near this state: {motion.outcome}")
    multipliers = np.linalg.eigvals(monodromy(stepper, motion))
    multipliers = multipliers[np.abs(multipliers) > DEAD]
    return np.log(multipliers.astype(complex)) * state.omega / (2 * np.pi)


def monodromy(stepper: TimeStepper, motion: PeriodicMotion) -> np.ndarray:
    """Derivative of the state (eta, v, a, f, memory that moves) after a period with respect to the one before."""
    h, am, af, beta, gamma = stepper.scheme
    slopes = motion.slopes
    assert slopes is not None
    n, n_contact = len(stepper.lam), len(stepper.U)
    n_memory = stepper.balance.memory.size
    inverse = np.diag(stepper.inverse[0]) if stepper.diagonal else stepper.inverse
    damping = np.diag(stepper.damping[0]) if stepper.diagonal else stepper.damping
    lam, U, A = stepper.lam[:, None], stepper.U, stepper.compliance
    eta, v, a, f, s = np.split(np.eye(3 * n + n_contact + n_memory), np.cumsum([n, n, n, n_contact]))
    for j in range(len(slopes.force_x)):
        J, Fs, Sx, Ss = (_block_diagonal(blocks[j]) for blocks in vars(slopes).values())
        v_known = v + (1 - af) * h * (1 - gamma) * a
        eta_known = eta + (1 - af) * h * (v + h * (0.5 - beta) * a)
        b = inverse @ (-am * a - damping @ v_known - lam * eta_known - af * (U.T @ f))
        x_free = U @ (eta + h * v + h * h * ((0.5 - beta) * a + beta * b))
        remembered = Fs @ s
        x = np.linalg.solve(np.eye(n_contact) + A @ J, x_free - A @ remembered)
        f = J @ x + remembered
        s = Sx @ x + Ss @ s
        a_new = b - (1 - af) * (inverse @ (U.T @ f))
        eta = eta + h * v + h * h * ((0.5 - beta) * a + beta * a_new)
        v = v + h * ((1 - gamma) * a + gamma * a_new)
        a = a_new
    whole = np.concatenate([eta, v, a, f, s])
    fixed = np.zeros(len(whole), bool)
    first = 3 * n + n_contact
    fixed[first:] = np.all(whole[first:] == np.eye(len(whole))[first:], axis=1)
    return whole[np.ix_(~fixed, ~fixed)]


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    n, r, c = blocks.shape
    full = np.zeros((n, r, n, c))
    full[np.arange(n), :, np.arange(n)] = blocks
    return full.reshape(n * r, n * c)
