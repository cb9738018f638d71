"""Wear along the motion in time: what a machine does, without harmonics.

The motion is marched through time while the contact wears, each wear step at the mean rate of a motion that has settled
(hbm.time.mean_motion): periodic, or one that never repeats itself, but none that a machine would leave.
Pressure reacts to local depth at once, so that dw/dZ = r(w) is stiff. A Rosenbrock step of second order takes an
approximate derivative of r: the rate of a pair in proportion to its normal force, and that by the static stiffness of
the pairs that touch. Its order does not depend on how good the derivative is.
Source  ROS2: Verwer, Spee, Blom and Hundsdorfer 1999, SIAM J. Sci. Comput. 20(4), gamma = 1 - 1/sqrt(2)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.time.mean_motion import Follower, MeanMotion, MeanOptions
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.wear import law as wear_law
from tribodyn.hbm.wear.evolution import LARGEST_SHIFT, WearProblem
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_share
from tribodyn.hbm.wear.step_control import Tolerance, growth, local_error

GAMMA = 1 - 1 / np.sqrt(2)


@dataclass(frozen=True)
class StepRules:
    """How the steps of this rule are placed."""

    first_step: float = 0.3  # depth of the first step, of the tolerance on depth
    reached: float = 0.999  # share of the volume of a leg, from which on it has ended
    # depth of the shortest one, likewise: the scatter of the rates is no error that shorter steps lower
    shortest: float = 0.05


RULES = StepRules()


@dataclass(frozen=True)
class MotionExposure(wear_law.Exposure):
    """One period of a motion in time as a wear law sees it; `state` is the part of it in the balance's harmonics."""

    motion: PeriodicMotion | None = None

    @cached_property
    def energy(self) -> np.ndarray:
        """(n_pair,) friction work over the period [J]."""
        assert self.motion is not None
        return np.maximum(self.motion.energy[self.joint.rows], 0.0)

    @property
    def status(self) -> np.ndarray:
        """(n_pair,) bits of what happened in the period."""
        assert self.motion is not None
        return self.motion.status[self.joint.rows]

    @cached_property
    def history(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] and contact force [N], both (n_pair, n_component, n_step)."""
        assert self.motion is not None
        at = np.ix_(self.joint.rows, self.balance.contact.columns(self.joint))
        return self.motion.x[at], self.motion.force[at]


class Places(Protocol):
    """Where the cycles are taken while the contact wears: legs, between which the motion jumps.

    ends : worn volume at which each leg ends, and the wear with the last one [m3]
    """

    @property
    def ends(self) -> Sequence[float]: ...

    def start(self, leg: int, depth: np.ndarray) -> Sequence[State]:
        """States that the motion of every duty begins at, of the contact worn by a depth (n_pair,) [m]."""
        ...

    def omegas(self, leg: int, removed: float) -> Sequence[float]:
        """Frequency of every duty at a worn volume [m3], within the leg also beyond its end [rad/s]."""
        ...


class FixedPlaces:
    """The frequencies that a mission names; one leg."""

    ends: Sequence[float] = (np.inf,)

    def __init__(self, problem: WearProblem):
        self._problem = problem
        self._omegas: tuple[float, ...] = ()

    def start(self, leg: int, depth: np.ndarray) -> Sequence[State]:
        """The balances at the frequencies; see `Places`."""
        problem = self._problem
        states = [duty.site.first(problem.in_duty(duty, depth)).state for duty in problem.mission]
        self._omegas = tuple(state.omega for state in states)
        return states

    def omegas(self, leg: int, removed: float) -> Sequence[float]:
        """The frequencies, whatever is worn."""
        return self._omegas


class PlacesOfRun:
    """Where a wear run took its cycles: the frequency against what it had worn, with its jumps.

    A run whose contact was not lost is followed as far as it went.
    """

    def __init__(self, problem: WearProblem, run: WearHistory):
        self._problem, self._run = problem, run
        self._removed = run.depth @ problem.area
        omega = run.duty_omega
        moved = np.abs(omega[1:] / omega[:-1] - 1).max(axis=1)
        self._firsts = [0, *(1 + int(i) for i in np.flatnonzero(moved > LARGEST_SHIFT))]
        last = np.inf if run.ended.lost else float(self._removed[-1])
        self.ends: Sequence[float] = [*(float(self._removed[i]) for i in self._firsts[1:]), last]

    def start(self, leg: int, depth: np.ndarray) -> Sequence[State]:
        """The motion of the run's first row on the leg; see `Places`."""
        row, problem = self._firsts[leg], self._problem
        states = []
        for i, duty in enumerate(problem.mission):
            balance = problem.in_duty(duty, depth)
            x = self._run.duty_displacement[row, i].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
            states.append(balance.evaluate(float(self._run.duty_omega[row, i]), x, jacobian=False))
        return states

    def omegas(self, leg: int, removed: float) -> Sequence[float]:
        """Between the rows of the leg, along the worn volume; see `Places`."""
        rows = slice(self._firsts[leg], (*self._firsts[1:], len(self._removed))[leg])
        at = self._removed[rows]
        return [float(np.interp(removed, at, omega)) for omega in self._run.duty_omega[rows].T]


@dataclass(frozen=True)
class TimeRow:
    """One wear step; the fields are those of WearInTime, without the row axis."""

    cycles: float
    cycles_in_step: float
    depth: np.ndarray
    energy: np.ndarray
    spread: float
    error: float
    preload: float
    normal_force: np.ndarray
    omega: float
    amplitude: float
    off: float
    apart: float
    works: np.ndarray
    repeats: int
    settled: bool
    periods: int
    step_error: float


@dataclass(frozen=True)
class WearInTime:
    """Wear of a contact along its motion in time; row i is the state at the start of wear step i.

    cycles, cycles_in_step : (n_row,) vibration cycles passed before the row, and that it stands for
    depth : (n_row, n_pair) [m]; energy : (n_row, n_pair) friction work per cycle, mean over periods [J]
    spread : (n_row,) standard deviation of the work of a period over its mean; error : (n_row,) of that mean, relative
    preload : (n_row,) mean normal force of the joints that wear [N]; normal_force : (n_row, n_pair)
    omega : (n_row,) frequency [rad/s]; amplitude : (n_row,) of the first output, mean over periods [m]; first duty
    off : (n_row,) largest difference of a mean displacement from what harmonic 0 prescribes [m]
    apart : (n_row,) share of the time in which no pair carries a force; works : (n_row, n_period) friction work of the
        last periods [J]; repeats : (n_row,) periods of the loads after which the motion comes back, 0 where it does
        not; first duty
    settled : (n_row,) whether the means had come to rest; periods : (n_row,) marched for the step
    step_error : (n_row,) local error of the wear step over its tolerance
    end : why the run ended
    """

    cycles: np.ndarray
    cycles_in_step: np.ndarray
    depth: np.ndarray
    energy: np.ndarray
    spread: np.ndarray
    error: np.ndarray
    preload: np.ndarray
    normal_force: np.ndarray
    omega: np.ndarray
    amplitude: np.ndarray
    off: np.ndarray
    apart: np.ndarray
    works: np.ndarray
    repeats: np.ndarray
    settled: np.ndarray
    periods: np.ndarray
    step_error: np.ndarray
    end: Outcome[WearEnd]

    def life(self, share: float = LIFE_SHARE) -> float | None:
        """Cycles until a share of the first preload is left; None where the run ends before."""
        return cycles_to_share(self.cycles, self.preload, share)

    @property
    def scatter(self) -> float:
        """Standard error of the cycles passed by the scatter of the motion, relative."""
        whole = float(self.cycles[-1])
        return float(np.sqrt(np.sum((self.cycles_in_step * self.error) ** 2))) / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class _Rate:
    """Means at one depth: of the first duty, and the mission's wear depth per cycle (n_pair,) [m]."""

    first: MeanMotion
    rate: np.ndarray
    energy: np.ndarray
    off: float
    spread: float
    error: float
    settled: bool
    periods: int


@single
def evolve(
    problem: WearProblem,
    places: Places,
    tolerance: Tolerance,
    options: MeanOptions | None = None,
    max_steps: int = 1000,
    on_row: Callable[[TimeRow], None] | None = None,
) -> WearInTime:
    """Wear the contact along its motion until a share `lost_below` of the preload is left, LIFE_SHARE at least.

    tolerance : of a wear step, as of the error-controlled rule; options : of the motion between two of them
    on_row : called with each finished row
    Raises  ValueError where the motion cannot be marched in time; IntegrationFailed
    """
    walk = _Walk(problem, places, options or MeanOptions())
    rows: list[TimeRow] = []
    depth, cycles, stride = np.zeros_like(problem.area), 0.0, 0.0
    end = WearEnd.STEPS_DONE.say(f" {max_steps} wear steps")
    while len(rows) < max_steps:
        if rows and walk.done(depth):
            end = WearEnd.STEPS_DONE.say(" the volume that the run wore")
            break
        here = walk.at(depth, cycles)
        force = here.first.normal_force
        preload = float(force[problem.pairs].sum())
        first = rows[0].preload if rows else preload
        over = _over(problem, here, preload, first)
        worn, error, periods = np.zeros_like(depth), 0.0, here.periods
        if over is None:
            shortest = RULES.shortest * tolerance.share * tolerance.scale / float(here.rate.max())
            stride = stride or RULES.first_step / RULES.shortest * shortest
            stride = min(stride, walk.left(depth) / float(problem.area @ here.rate))
            while True:
                worn, deviation, spent = walk.step(depth, cycles, here, stride)
                periods += spent
                error = local_error(tolerance, problem.area, deviation, worn, stride, cycles + stride)
                if error <= 1.0 or stride <= shortest:
                    break
                stride = max(stride * growth(error), shortest)
        taken = 0.0 if over else stride
        rows.append(
            TimeRow(
                cycles=cycles,
                cycles_in_step=taken,
                depth=depth,
                energy=here.energy,
                spread=here.spread,
                error=here.error,
                preload=preload,
                normal_force=force,
                omega=walk.omega,
                amplitude=float(here.first.amplitude[0]),
                off=here.off,
                apart=here.first.apart,
                works=here.first.works,
                repeats=here.first.repeats,
                settled=here.settled,
                periods=periods,
                step_error=error,
            )
        )
        if on_row is not None:
            on_row(rows[-1])
        if over is not None:
            end = over
            break
        depth, cycles, stride = depth + worn, cycles + taken, stride * growth(error)
    return together(rows, end)


def together(rows: Sequence[TimeRow], end: Outcome[WearEnd]) -> WearInTime:
    """Rows put together."""
    columns = {f.name: np.array([getattr(row, f.name) for row in rows]) for f in fields(TimeRow)}
    return WearInTime(**columns, end=end)


def _over(problem: WearProblem, here: _Rate, preload: float, first: float) -> Outcome[WearEnd] | None:
    """Why the wear ends; None where it goes on."""
    share = max(problem.lost_below, LIFE_SHARE)
    if preload < share * first:
        return WearEnd.PRELOAD_LOST.say(f" {share:.3g} of its first value")
    if not here.rate.max() > 0:
        return WearEnd.NO_SLIP.say(f", the contact survives with {preload:.4g} N of preload left")
    return None


class _Walk:
    """The motions of all duties, marched on while the contact wears.

    omega : of the first duty at the state that a step starts from [rad/s]
    """

    def __init__(self, problem: WearProblem, places: Places, options: MeanOptions):
        self._problem, self._places = problem, places
        self._followers = [Follower(options) for _ in problem.mission]
        self._leg = -1
        self._stiffness = static_stiffness(problem.balance)
        self._omegas: Sequence[float] = ()
        self.omega = 0.0

    def done(self, depth: np.ndarray) -> bool:
        """Whether the last leg has ended."""
        return float(self._problem.area @ depth) >= RULES.reached * self._places.ends[-1]

    def left(self, depth: np.ndarray) -> float:
        """Volume left to wear on the leg [m3]."""
        return float(self._places.ends[self._leg] - self._problem.area @ depth)

    def at(self, depth: np.ndarray, cycles: float) -> _Rate:
        """Means at a depth, on the leg that it belongs to."""
        removed = float(self._problem.area @ depth)
        while self._leg < 0 or removed >= RULES.reached * self._places.ends[self._leg]:
            self._leg += 1
            states = self._places.start(self._leg, depth)
            for follower, duty, state in zip(self._followers, self._problem.mission, states, strict=True):
                follower.start(self._problem.in_duty(duty, depth), state)
        found = self._rate(depth, cycles)
        self.omega = self._omegas[0]
        return found

    def step(self, depth: np.ndarray, cycles: float, here: _Rate, stride: float) -> tuple[np.ndarray, np.ndarray, int]:
        """Depth that wears in a step (n_pair,) and its deviation from a step of first order [m]; periods marched."""
        matrix = np.eye(len(depth)) + GAMMA * stride * self._fall(here)
        k1 = np.linalg.solve(matrix, here.rate)
        there = self._rate(depth + stride * np.maximum(k1, 0.0), cycles + stride)
        k2 = np.linalg.solve(matrix, there.rate - 2 * k1)
        return np.maximum(stride * (1.5 * k1 + 0.5 * k2), 0.0), 0.5 * stride * (k1 + k2), there.periods

    def _rate(self, depth: np.ndarray, cycles: float) -> _Rate:
        problem = self._problem
        self._omegas = self._places.omegas(self._leg, float(problem.area @ depth))
        found: list[MeanMotion] = []
        for follower, duty, omega in zip(self._followers, problem.mission, self._omegas, strict=True):
            balance = problem.in_duty(duty, depth)

            def wears(motion: PeriodicMotion, balance: HarmonicBalance = balance) -> np.ndarray:
                return _depth_rate(problem, balance, motion, depth, cycles)

            found.append(follower.mean(balance, omega, wears))
        shares = [duty.share for duty in problem.mission]
        rate, energy = (
            np.sum([s * part for s, part in zip(shares, parts, strict=True)], axis=0)
            for parts in ([m.seen for m in found], [m.energy for m in found])
        )
        work = np.array([s * float(m.energy.sum()) for s, m in zip(shares, found, strict=True)])
        weight = work / work.sum() if work.sum() > 0 else work
        return _Rate(
            found[0], rate, energy,
            off=max(m.off for m in found),
            spread=float(weight @ [m.spread for m in found]),
            error=float(np.linalg.norm(weight * [m.error for m in found])),
            settled=all(m.settled for m in found),
            periods=sum(m.periods for m in found),
        )  # fmt: skip

    def _fall(self, here: _Rate) -> np.ndarray:
        """(n_pair, n_pair) - d rate / d depth, about."""
        force = here.first.normal_force
        touches = force > 0
        fall = np.zeros((len(force), len(force)))
        if not touches.any():
            return fall
        stiffness = self._stiffness[np.ix_(touches, touches)]
        if not touches.all():
            coupled = self._stiffness[np.ix_(touches, ~touches)]
            rest = self._stiffness[np.ix_(~touches, ~touches)]
            stiffness = stiffness - coupled @ np.linalg.lstsq(rest, coupled.T, rcond=None)[0]
        fall[np.ix_(touches, touches)] = (here.rate[touches] / force[touches])[:, None] * stiffness
        return fall


def _depth_rate(
    problem: WearProblem, balance: HarmonicBalance, motion: PeriodicMotion, depth: np.ndarray, cycles: float
) -> np.ndarray:
    """(n_pair,) wear depth of one period [m], by the laws of the joints."""
    x = motion.coefficients(motion.x, balance.basis)
    state = balance.evaluate(motion.omega, x, jacobian=False)
    rate = np.zeros_like(depth)
    for name, wear in problem.wearing.items():
        pairs = balance.contact.joint(name).rows
        of_joint = (problem.area[pairs], problem.numbers(name), depth[pairs])
        exposure = MotionExposure(balance, state, *of_joint, cycles, name, motion)
        rate[pairs] = wear_law.depth_rate(wear.law, exposure)
    return rate


def static_stiffness(balance: HarmonicBalance) -> np.ndarray:
    """(n_pair, n_pair) static normal forces that fall when gaps open, with every pair closed and stuck [N/m].

    Zero where the contact has no normal component or the balance no harmonic 0
    """
    contact, basis = balance.contact, balance.basis
    found = np.zeros((contact.n_pair, contact.n_pair))
    if "n" not in contact.components or not basis.has_static:
        return found
    width = len(contact.components)
    rows = contact.components.index("n") + width * np.arange(contact.n_pair)
    k = balance.reference_stiffness
    point = balance.at(balance.omega_max)
    for i, row in enumerate(rows):
        pull = np.zeros((len(k), basis.n_coeff))
        pull[row, 0] = k[row]
        found[:, i] = -k[rows] * point.apply(pull)[rows, 0]
        found[i, i] += k[row]
    return found
