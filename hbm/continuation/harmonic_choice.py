"""Choice of harmonics, any set, from an estimate of what the others would change.

A solution with few harmonics is put into a balance with many. Its residual there is the contact force at the harmonics
left out, sent through their compliance; one Newton step turns it into a change of the response, coupling to the kept
harmonics included. The step is linear, so the change splits into one share for each harmonic left out: those with the
largest shares are taken in, until what remains is below the tolerance; harmonics that turn out useless are dropped.
Source  a posteriori estimate by one Newton step in the larger space, as in Urabe 1965 and Grolet and Thouverez 2012;
the split by harmonic is ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.linear_side import compliance_of
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.threads import single
from tribodyn.refusal import SolverFailure

LINEAR_ACCURACY = 1e-3  # of the linear solves behind an estimate, which is of first order itself
LEAST_VIBRATION = 1e-2  # an output that vibrates less than this share of the largest is measured against that share
ROUGH = 1e-5  # error of the compliance at the highest harmonic that estimates at single states may have
_WIDE: WeakKeyDictionary[ContactCompliance, ContactCompliance] = WeakKeyDictionary()


@dataclass(frozen=True)
class ChoiceOptions:
    """How harmonics are chosen.

    tolerance : of the response of each output, relative to its vibration
    highest : highest harmonic that may be kept; the estimate looks at half as many again
    rounds : times the set may grow
    allowed_share : of the tolerance, that the harmonics left out may use: the estimate sees each on its own
    useful_in_a_row : useful harmonics, the smallest first, after which no more are tried for dropping"""

    tolerance: float = 1e-2
    highest: int = 15
    rounds: int = 8
    allowed_share: float = 0.5
    useful_in_a_row: int = 3
    newton: NewtonOptions = field(default_factory=NewtonOptions)


@dataclass(frozen=True)
class Estimate:
    """What harmonics left out would change.

    error : change of the response of the worst output, relative to its vibration
    shares : harmonic left out -> its own share in the change, in the same measure
    x : (n_pair, n_component, n_coeff) the solution after the Newton step, with all harmonics [m]"""

    error: float
    shares: Mapping[int, float]
    x: np.ndarray

    def required(self, allowed: float, highest: int) -> dict[int, float]:
        """The fewest harmonics up to `highest`, with their shares, that leave no more than `allowed` to the others."""
        falling = sorted((h for h in self.shares if h <= highest), key=lambda h: -self.shares[h])
        values = np.array([self.shares[h] for h in falling])
        remaining = np.sqrt(np.cumsum(values[::-1] ** 2))[::-1]  # of this one and all smaller ones
        return {h: self.shares[h] for h, residual in zip(falling, remaining, strict=True) if residual > allowed}


@dataclass(frozen=True)
class HarmonicChoice:
    """The harmonics chosen and what they are worth.

    harmonics : the set; estimate : of its truncation error at the worst of the frequencies
    omega : frequencies [rad/s]
    history : sets tried in turn with their estimated errors
    balance : with the chosen harmonics; x : its solutions, one (n_pair, n_component, n_coeff) for each frequency [m]
    outcome : sentence"""

    harmonics: tuple[int, ...]
    estimate: Estimate
    omega: tuple[float, ...]
    history: tuple[tuple[tuple[int, ...], float], ...]
    balance: HarmonicBalance
    x: tuple[np.ndarray, ...]
    outcome: str


class NotSolved(SolverFailure):
    """The balance has no solution to estimate the error of; the message says where and why."""


@single
def choose(
    balance: HarmonicBalance, omega: Sequence[float], options: ChoiceOptions | None = None,
    solved_x: Mapping[float, np.ndarray] | None = None,
) -> HarmonicChoice:  # fmt: skip
    """Choose harmonics for a problem, at frequencies where the choice matters, such as about a resonance.

    balance : the problem; its samples are kept, its harmonics where it has `solved_x`, else those that carry loads
    omega : frequencies [rad/s]; solved_x : frequency -> x of a solution of the balance [m]
    Returns the choice; `outcome` says where it misses the tolerance and whether more harmonics have no solution nearby
    Raises  NotSolved; ValueError where the samples are too few for the highest harmonic of the estimate"""
    options = options or ChoiceOptions()
    wide = widened(balance, options.highest)
    loaded = {h for (h, _), value in balance.excitation.loads.items() if value != 0}
    if balance.basis.has_static:
        loaded.add(0)
    solved_x = solved_x or {}
    harmonics = tuple(sorted({*loaded, 1, *(balance.basis.harmonics if solved_x else ())}))
    starts = [[balance.basis.transfer(solved_x[w], wide.basis)] if w in solved_x else [] for w in omega]
    trial = _Trial.of(wide, harmonics, omega, starts, options)
    history, cure = [(harmonics, trial.error)], f"allow harmonics above {options.highest}"
    for _ in range(options.rounds):
        additions = trial.additions(options)
        if trial.error <= options.tolerance or not additions:
            break
        larger = tuple(sorted({*harmonics, *additions}))
        try:
            trial = _Trial.of(wide, larger, omega, trial.starts(wide), options, first=False)
        except NotSolved as not_solved:
            cure = str(not_solved).removeprefix("harmonics cannot be chosen: ")
            break
        harmonics = larger
        history.append((harmonics, trial.error))
    useful = 0
    least_first = [trial.harmonics[i] for i in np.argsort(trial.content) if len(history) > 1]
    for h in [h for h in least_first if h not in loaded and h != 1]:
        if trial.error > options.tolerance or useful == options.useful_in_a_row:
            break
        fewer = tuple(k for k in harmonics if k != h)
        useful += 1
        with suppress(NotSolved):
            attempt = _Trial.of(wide, fewer, omega, trial.starts(wide), options, first=False, shrinking=True)
            history.append((fewer, attempt.error))
            if attempt.error <= options.tolerance:
                harmonics, trial, useful = fewer, attempt, 0
    if not trial.worst.shares:
        trial = _Trial.of(wide, harmonics, omega, trial.starts(wide), options)
    outcome = f"harmonics {', '.join(map(str, harmonics))}: estimated truncation error {trial.error:.1e}"
    if trial.error > options.tolerance:
        outcome += f", above the tolerance {options.tolerance:.1e}: {cure}"
    chosen = wide.with_harmonics(harmonics)
    _WIDE[chosen.compliance] = wide.compliance  # where they are chosen again
    return HarmonicChoice(harmonics, trial.worst, tuple(omega), tuple(history), chosen, tuple(trial.x), outcome)


def widened(balance: HarmonicBalance, highest: int, error: float | None = None) -> HarmonicBalance:
    """The problem with all harmonics to half as many again as `highest`, for estimates; raises ValueError.

    The linear side is kept as long as that of the balance: problems that differ in contact, wear or load share it
    error : of the compliance at the highest harmonic, None: as a run needs it. ROUGH does not serve to follow a
        response: with 1e-6 a sweep of the beam jumped elsewhere"""
    top = highest + (highest + 1) // 2
    basis = replace(balance.basis, harmonics=tuple(range(top + 1)))
    excitation = balance.excitation
    if excitation.base is not None:
        excitation = replace(excitation, base=balance.basis.transfer(excitation.base, basis))
    linear, springs = balance.compliance, balance.reference_stiffness
    wide = _WIDE.get(linear)
    serves = wide is not None and wide.basis.harmonics[-1] >= top and (wide.target_error or 0.0) <= (error or 0.0)
    if wide is None or not serves or not np.array_equal(wide.k, springs):
        wide = _WIDE[linear] = compliance_of(balance.model, springs, basis, excitation, balance.omega_max, error)
    return replace(balance, basis=basis, excitation=excitation, compliance=wide.restricted(basis), at_rest=None)


def estimate(
    wide: HarmonicBalance, kept_harmonics: tuple[int, ...], omega: float, x: np.ndarray, split: bool = True
) -> Estimate:
    """What the harmonics of a wide balance would change in a solution with some of them.

    wide : from `widened`; kept_harmonics : those of the solution x (n_pair, n_component, n_coeff) [m] at omega [rad/s]
    split : whether the shares are wanted too, at the cost of one linear solve each"""
    narrow = wide.with_harmonics(kept_harmonics)
    response = narrow.basis.transfer(narrow.outputs(narrow.evaluate(omega, x, jacobian=False)), wide.basis)
    state = wide.evaluate(omega, narrow.basis.transfer(x, wide.basis))
    linear, point = wide.linearise(state), wide.at(omega)
    direct = wide.outputs(state)
    vibration = np.linalg.norm(response[:, wide.basis.order > 0], axis=1)
    scale = np.maximum(vibration, LEAST_VIBRATION * vibration.max(initial=0.0))
    scale[scale == 0] = np.inf

    def measure(change: np.ndarray) -> float:
        return float((np.linalg.norm(change, axis=1) / scale).max(initial=0.0))

    def change(of: list[int]) -> tuple[np.ndarray, np.ndarray]:
        rows = np.isin(wide.basis.order, of)
        dx, _, _ = linear.solve(np.where(rows, -state.residual, 0.0), LINEAR_ACCURACY)
        return dx, point.outputs(linear.departure_slope(dx)) + np.where(rows, direct, 0.0)

    absent = [h for h in wide.basis.harmonics if h not in kept_harmonics]
    steps = [change([h]) for h in absent] if split else [change(absent)]
    dx, total = (np.sum(parts, axis=0) for parts in zip(*steps, strict=True))
    shares = {h: measure(step[1]) for h, step in zip(absent, steps, strict=True)} if split else {}
    return Estimate(measure(total), shares, state.x + dx.reshape(state.x.shape))


@dataclass(frozen=True)
class _Trial:
    """One set of harmonics, solved and estimated at every frequency."""

    harmonics: tuple[int, ...]
    x: list[np.ndarray]
    content: np.ndarray
    estimates: list[Estimate]

    @classmethod
    def of(
        cls, wide: HarmonicBalance, kept_harmonics: tuple[int, ...], omega: Sequence[float],
        starts: Sequence[Sequence[np.ndarray]], options: ChoiceOptions, first: bool = True, shrinking: bool = False,
    ) -> _Trial:  # fmt: skip
        """Solve and estimate, from x with all harmonics at each frequency or else from rest; raises NotSolved.

        first : whether a solution that is found neither way is searched along the load, which takes long
        shrinking : only whether the tolerance is met matters, not the shares; ends at the first frequency where not"""
        narrow = wide.with_harmonics(kept_harmonics)
        solved, estimates = [], []
        content = np.zeros(len(kept_harmonics))
        for i, w in enumerate(omega):
            for start in starts[i]:
                solution = newton.solve(narrow, w, wide.basis.transfer(start, narrow.basis), options.newton)
                if solution.converged:
                    break
            if not starts[i] or not solution.converged:
                search = arc_length.solve_along_load if first else newton.solve_from_rest
                solution = search(narrow, w, options.newton)
            if not solution.converged:
                where = f"{w / (2 * np.pi):.6g} Hz with harmonics {', '.join(map(str, kept_harmonics))}"
                raise NotSolved(f"harmonics cannot be chosen: no solution at {where}: {solution.outcome}")
            x = solution.state.x
            solved.append(x)
            estimates.append(estimate(wide, kept_harmonics, w, x, split=not shrinking))
            size = np.array([np.linalg.norm(x[..., narrow.basis.order == h]) for h in kept_harmonics])
            content = np.maximum(content, size / size[np.array(kept_harmonics) > 0].max(initial=1e-300))
            if shrinking and estimates[-1].error > options.tolerance:
                break
        return cls(kept_harmonics, solved, content, estimates)

    def starts(self, wide: HarmonicBalance) -> list[list[np.ndarray]]:
        """x at each frequency with all harmonics, those left out at zero or as estimated [m]."""
        basis = replace(wide.basis, harmonics=self.harmonics)
        return [[basis.transfer(x, wide.basis), e.x] for x, e in zip(self.x, self.estimates, strict=True)]

    @property
    def worst(self) -> Estimate:
        """The estimate at the frequency where it is largest."""
        return max(self.estimates, key=lambda e: e.error)

    @property
    def error(self) -> float:
        """The largest estimated error."""
        return self.worst.error

    def additions(self, options: ChoiceOptions) -> set[int]:
        """Harmonics to take in: the fewest that leave the shares of the others below the tolerance everywhere."""
        largest_share: dict[int, float] = {}
        for estimate in self.estimates:
            if estimate.error > options.tolerance:
                required = estimate.required(options.allowed_share * options.tolerance, options.highest)
                largest_share |= {h: max(largest_share.get(h, 0.0), share) for h, share in required.items()}
        first = sorted(largest_share, key=lambda h: -largest_share[h])
        return set(first[: max(2, len(self.harmonics))])  # a rough solution tells little about the rest
