"""Floquet exponents from the linearised time steps of an integrated periodic motion.

Of large models the largest multiplier alone, by Arnoldi's method on differences of marched periods.
Source  Newton-Krylov shooting and its multipliers: Sanchez, Net, Garcia-Archilla and Simo 2004"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigvalsh, norm

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import STICKS
from tribodyn.hbm.stability.exponents import CLEAR, remembers, stability
from tribodyn.hbm.time import period_search
from tribodyn.hbm.time.period_search import Period, PeriodSearch, perturb
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.hbm.time.time_integration import integrate
from tribodyn.hbm.time.verify import Verification
from tribodyn.refusal import Refusal, SolverFailure

MULTIPLIERS = "its Floquet multipliers in time"
HILL = "Hill's method"
MOTION_TOLERANCE = 0.2  # largest difference of the vibration at the contact, relative, up to which both motions are one


@dataclass(frozen=True)
class MultiplierRules:
    """How far multipliers are known, and what they may cost; see docs/developers/ablations.md."""

    # of a perturbation over a period, below which the multipliers of so many steps cannot tell it from none
    growth: float = 1e-3
    accuracy: float = 5e-3  # of the largest multiplier of a large model, where it is above 1
    fewest_products: int = 12  # periods marched for it
    most_products: int = 60
    dense: int = 400  # state variables up to which the largest multiplier is taken from the whole monodromy matrix
    pushed: int = 120  # periods in which a push must die away, where differences tell that it grows
    max_states: int = 900  # up to which the monodromy matrix is formed, whose eigenvalues are dense work
    least_multiplier: float = 1e-10  # smaller ones belong to the time stepping, not to the structure


RULES = MultiplierRules()


class NoMultipliers(SolverFailure):
    """Time integration comes to no periodic motion near a state, or to none whose multipliers can be computed."""


def floquet_exponents(balance: HarmonicBalance, state: State, options: Options | None = None) -> np.ndarray:
    """Floquet exponents of the motion that time integration finds from a balance state.

    Returns (n,) complex [1/s], without those of sliders that never move: any position of theirs is an equilibrium
    Raises  NoMultipliers for models too large, or where the motion does not become periodic"""
    options = options or Options()
    stepper = TimeStepper(balance, state.omega, options)
    motion = integrate(balance, state.omega, state, options, with_slopes=True)
    if not motion.periodic:
        raise NoMultipliers(f"no periodic motion near this state: {motion.outcome}")
    multipliers = np.linalg.eigvals(monodromy(stepper, motion.slopes))
    multipliers = multipliers[np.abs(multipliers) > RULES.least_multiplier]
    return np.log(multipliers.astype(complex)) * state.omega / (2 * np.pi)


def largest_multiplier(balance: HarmonicBalance, state: State, options: Options | None = None) -> float:
    """Modulus of the largest multiplier of the periodic motion near a balance state: above 1 the motion is left.

    Sliders that never move do not count, and a force that holds a mean displacement stays as it is. Of a large model
    it is that of differences, and one that is below 1 in any case need not be exact. Where sliders just reach their
    limit differences have a kink, and what seems to grow may be a combination of both sides that no motion has: a push
    in its direction or one against it must grow in a plain march, as a multiplier of 1.01 does, else it is taken for 1.
    Raises  NoMultipliers; Refusal for models without an equation of motion in time"""
    options = options or Options()
    stepper = TimeStepper(balance, state.omega, options)
    if _size(stepper) <= RULES.dense:
        growth = floquet_exponents(balance, state, options).real * 2 * np.pi / state.omega
        return float(np.exp(growth.max(initial=-np.inf)))
    modulus, direction, period = _by_differences(stepper, state, options)
    plain = PeriodSearch(stepper, replace(options, accelerate=False, max_periods=RULES.pushed), False)
    if modulus > 1 + RULES.growth and not any(perturb(plain, period, 8, s * direction).grows for s in (1.0, -1.0)):
        return 1.0
    return modulus


def grows_in_time(balance: HarmonicBalance, state: State, options: Options | None = None) -> bool | None:
    """Whether a perturbation of the periodic motion near a state grows in time; None where that is not known."""
    if balance.model.is_wave or not balance.model.has_motion_in_time:
        return None
    try:
        return largest_multiplier(balance, state, options) > 1 + RULES.growth
    except NoMultipliers:
        return None


def growth_by_negative_damping(balance: HarmonicBalance, state: State, rounding: float = 1e-9) -> float | None:
    """Rate [1/s] at which a perturbation of a solved state grows that a negative damping feeds; None where none does.

    It may take longer to show in time than an integration lasts; rounding : of all damping, that counts as none"""
    damping = balance.model.at_harmonic(1)[0].damping
    if damping is None or eigvalsh(damping + damping.conj().T)[0] >= -rounding * norm(damping):
        return None
    with suppress(Refusal):
        growth = float(stability(balance, state).exponents[0].real)
        return growth if growth > CLEAR * state.omega or (growth > 0 and grows_in_time(balance, state)) else None
    return None


def is_stable(
    balance: HarmonicBalance, state: State, verification: Verification | None, options: Options
) -> tuple[bool | None, str]:
    """Whether no perturbation of the motion near a balance state grows, and the method that says so; None: not known.

    verification : the state in time integration, which may have come to another motion, or to none; None: not compared
    Hill's method takes the contact's answer to a perturbation as that to a steady vibration. Where sliders slip in a
    cycle that may miss what grows, so that it serves only where there are no multipliers, and is not sure of little
    growth or decay"""
    is_confirmed = (
        verification is not None and verification.motion.periodic and verification.contact <= MOTION_TOLERANCE
    )
    grows = grows_in_time(balance, state, options) if is_confirmed else None
    if grows is not None:
        return not grows, MULTIPLIERS
    result = stability(balance, state)
    is_sure = result.is_clear or not remembers(balance, state)
    return (result.stable, HILL) if is_sure else (None, f"{HILL} is not sure, and time integration does not decide")


def _by_differences(stepper: TimeStepper, state: State, options: Options) -> tuple[float, np.ndarray, Period]:
    """Modulus of the largest multiplier and its direction as a state vector, and the periodic motion."""
    balance = stepper.balance
    search = PeriodSearch(stepper, replace(options, accelerate=True), False)
    period = search.mix(stepper.start_from(state))
    if period.drift > options.tolerance:
        raise NoMultipliers(f"no periodic motion near this state: drift {period.drift:.1e} at least")
    plain = PeriodSearch(stepper, replace(options, accelerate=False, max_periods=1 + RULES.most_products), False)
    base = plain.step(period.end)
    size = period_search.RULES.difference * float(np.linalg.norm(base.start))
    moves = np.ones(len(base.start), bool)
    moves[2 * stepper.n_dynamic :] = False  # what holds a mean displacement stays as it is
    n_memory = balance.memory.size
    moves[2 * stepper.n_dynamic :][:n_memory] = np.repeat(
        (period.record.bits != STICKS) | stepper.is_timed, balance.memory.shape[1]
    )

    def product(v: np.ndarray) -> np.ndarray:
        disturbed = plain.step(plain.vector.unpack(base.start + size * v, period.end))
        return np.where(moves, (disturbed.image - base.image) / size, 0.0)

    start = np.where(moves, np.random.default_rng(0).normal(size=len(moves)), 0.0)
    return *_largest_ritz(product, start), period


def _largest_ritz(product: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> tuple[float, np.ndarray]:
    """Modulus of the largest eigenvalue of a map and its vector, by Arnoldi's method; of one below 1 a bound does."""
    v = [start / np.linalg.norm(start)]
    h = np.zeros((RULES.most_products + 1, RULES.most_products))
    for k in range(1, RULES.most_products + 1):
        w = product(v[-1])
        for i in (*range(k), *range(k)):  # twice: the basis loses its right angles otherwise
            share = v[i] @ w
            h[i, k - 1] += share
            w = w - share * v[i]
        h[k, k - 1] = np.linalg.norm(w)
        values, vectors = np.linalg.eig(h[:k, :k])
        top = int(np.argmax(np.abs(values)))
        modulus, miss = float(np.abs(values[top])), float(h[k, k - 1] * np.abs(vectors[-1, top]))
        if miss <= RULES.accuracy * modulus or (k >= RULES.fewest_products and modulus + miss < 1):
            return modulus, np.real(np.array(v).T @ vectors[:, top])
        v.append(w / h[k, k - 1])
    raise NoMultipliers(f"the largest multiplier did not converge: {modulus:.3g}, off by up to {miss:.1g}")


def _size(stepper: TimeStepper) -> int:
    return 2 * len(stepper.lam) + stepper.balance.memory.size + 2 * len(stepper.static)


def monodromy(stepper: TimeStepper, slopes: np.ndarray | None) -> np.ndarray:
    """Derivative of the state (z, f, x, memory that moves) after a period with respect to the one before.

    slopes : of `time_step.Record`; raises NoMultipliers for models too large"""
    if _size(stepper) > RULES.max_states:
        raise NoMultipliers(f"{_size(stepper)} state variables are too many for Floquet multipliers: use Hill's method")
    assert slopes is not None
    linear, A, c = stepper.linear, stepper.contact.A.T, stepper.c
    n, n_contact, n_memory = len(linear.E), len(A), stepper.balance.memory.size
    n_state = slopes.shape[2] - c
    z, f, x, s = np.split(np.eye(n + 2 * n_contact + n_memory), np.cumsum([n, n_contact, n_contact]))
    for D in slopes:
        free = linear.E @ z - 0.5 * linear.Q @ (linear.U.T @ f)
        # each of (f, memory), pair by pair
        of_x, of_s, of_x0 = map(_block_diagonal, np.split(D, [c, c + n_state], axis=2))
        free_part = of_s @ s + of_x0 @ x
        force = np.arange(len(of_x)).reshape(-1, c + n_state)[:, :c].ravel()
        x_free = linear.U @ free[: n // 2] - A @ free_part[force]
        x = np.linalg.solve(np.eye(n_contact) + A @ of_x[force], x_free)
        outputs = of_x @ x + free_part
        f, s = outputs[force], np.delete(outputs, force, axis=0)
        z = free - 0.5 * linear.Q @ (linear.U.T @ f)
    result = np.concatenate([z, f, x, s])
    fixed = np.zeros(len(result), bool)
    first = n + 2 * n_contact
    fixed[first:] = np.all(result[first:] == np.eye(len(result))[first:], axis=1)
    return result[np.ix_(~fixed, ~fixed)]


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    n, r, c = blocks.shape
    full = np.zeros((n, r, n, c))
    full[np.arange(n), :, np.arange(n)] = blocks
    return full.reshape(n * r, n * c)
