"""What wears: the contact with its wear laws, the mission whose cycles wear it, and a state of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.operating_condition import OperatingCondition
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.newton import lead
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.wear import law as wear_law
from tribodyn.hbm.wear.law import JointWear
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Duty:
    """A part of the mission: `share` of all cycles run at `site`, with the harmonic loads times `load`.

    balance : its own unworn problem over the same contact, as at another speed of rotation; None for the common one
    start : frequency [rad/s] and x (n_pair, n_component, n_coeff) [m] beside its unworn cycle; looked for where None"""

    site: OperatingCondition
    share: float = 1.0
    load: float = 1.0
    balance: HarmonicBalance | None = None
    start: tuple[float, np.ndarray] | None = None

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """The cycle without a neighbouring state."""
        if self.start is None:
            return self.site.solve(balance)
        point = self.site.solve_near(balance, *self.start)
        return point if point.solution.converged else self.site.solve(balance)


@dataclass(frozen=True)
class WearProblem:
    """What wears, where the cycles are taken, and by which law.

    balance : the unworn problem; mission : its duties, whose shares sum to one
    wear : how the joints wear, by name; a joint that is not there does not wear. One alone serves all joints
    area : (n_pair,) [m2], of all joints
    lost_below : contact counts as lost when the preload falls below this share of its first value; the last touch
        of a vibrating contact wears ever more slowly, so that the time until it ends has no limit (see README)
    any_joint : whether a single joint whose preload has fallen below that share ends the run
    lost_below_at_rest : the run ends when the preload without the harmonic loads falls to this share of its first
        value, see hbm.wear.preload_at_rest; None: it is not looked at"""

    balance: HarmonicBalance
    mission: tuple[Duty, ...]
    wear: JointWear | Mapping[str, JointWear]
    area: np.ndarray
    lost_below: float = 0.0
    lost_below_at_rest: float | None = None
    any_joint: bool = False

    def __post_init__(self) -> None:
        shares = [duty.share for duty in self.mission]
        if not self.mission or min(shares) < 0 or abs(sum(shares) - 1) > 1e-9:
            raise Refusal(f"the shares of the mission's duties must be >= 0 and sum to 1, not {shares}")
        for duty in self.mission:
            duty_balance = self.balance if duty.balance is None else duty.balance
            if duty_balance.basis != self.balance.basis or duty_balance.contact.n_pair != self.balance.contact.n_pair:
                raise Refusal("every duty of a mission needs the same contact pairs and harmonics")
        if not self.wearing:
            raise Refusal("no joint wears: give at least one of them a wear law")
        if self.lost_below_at_rest is not None and (
            "n" not in self.balance.contact.components or not self.balance.basis.has_static
        ):
            raise Refusal("the preload at rest needs a contact with component n and harmonic 0 among those kept")

    @cached_property
    def wearing(self) -> dict[str, JointWear]:
        """The joints that wear."""
        joints = self.balance.contact.joints
        if isinstance(self.wear, JointWear):
            return {joint.name: self.wear for joint in joints}
        return {self.balance.contact.joint(name).name: wear for name, wear in self.wear.items()}

    def numbers(self, joint: str, depth: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """The own numbers of a joint's wear law, each (n_pair,) of the joint, at a depth (n_pair,) of it [m]."""
        n = len(self.balance.contact.joint(joint).rows)
        numbers = self.wearing[joint].at(np.zeros(n) if depth is None else depth)
        return {name: np.array(np.broadcast_to(np.asarray(v, float), (n,))) for name, v in numbers.items()}

    def with_number(self, name: str, value: np.ndarray | float, joints: Sequence[str]) -> WearProblem:
        """The problem with another value of a number of the wear law of some joints."""
        wear = {
            joint: replace(law, numbers={**law.numbers, name: value}) if joint in joints else law
            for joint, law in self.wearing.items()
        }
        contact = self.balance.contact
        contact = replace(contact, joints=tuple(_aging_by(joint, wear.get(joint.name)) for joint in contact.joints))
        return replace(self, wear=wear, balance=self.balance.with_contact(contact))

    @cached_property
    def pairs(self) -> np.ndarray:
        """Indices of the pairs of the joints that wear."""
        return np.sort(np.concatenate([self.balance.contact.joint(name).rows for name in self.wearing]))

    def preload_of(self, state: WearState) -> float:
        """Mean normal force of the joints that wear in the first duty of a state [N]."""
        return float(self.normal_force(state)[self.pairs].sum())

    def normal_force(self, state: WearState) -> np.ndarray:
        """(n_pair,) mean normal force in the first duty of a state [N]."""
        return self.balance.normal_force(state.points[0].state) if state.means is None else state.means.normal_force

    def in_duty(self, duty: Duty, depth: np.ndarray | None = None) -> HarmonicBalance:
        """The problem of a duty with its loads, worn by a depth (n_pair,) [m]; unworn by default."""
        unworn = self.balance if duty.balance is None else duty.balance
        worn = unworn if depth is None else unworn.worn(depth)
        return worn.with_load(duty.load)


def _aging_by(joint: Joint, wear: JointWear | None) -> Joint:
    """A joint whose age by friction work goes with a wear law."""
    aging = joint.parameters.aging
    if wear is None or aging is None or aging.energy is None:
        return joint
    return replace(joint, parameters=replace(joint.parameters, aging=replace(aging, energy=wear.energy)))


@dataclass(frozen=True)
class Means:
    """Means over the periods of a motion in time, of the first duty but for what says how well they are known.

    energy : (n_pair,) friction work per period [J]; normal_force : (n_pair,) [N]; amplitude : of the first output [m]
    spread : standard deviation of the work of a period, over its mean; error : standard error of that mean, relative
    is_stationary : whether the means came to rest; periods : marched
    moving : what moved before, to begin from again; empty where the motion began in the balance"""

    energy: np.ndarray
    normal_force: np.ndarray
    amplitude: float
    spread: float
    error: float
    is_stationary: bool
    periods: int
    moving: np.ndarray


@dataclass(frozen=True)
class WearState:
    """A worn contact with its solved duties.

    depth : (n_pair,) [m]; cycles : passed before; points : one per duty; pairs : of the joints that wear
    rate : (n_pair,) wear depth per cycle [m], work : (n_pair,) friction work per cycle [J]; averages over the mission
    preload_at_rest : [N], nan where it was not asked for
    lost : why there is no preload at rest, or no motion in time
    means : of the motion in time where a machine leaves that of the balance, see hbm.wear.steady_motion
    growth : of the perturbation of the balance's motions that grows fastest, per radian; nan where it is not known"""

    depth: np.ndarray
    cycles: float
    points: tuple[OperatingPoint, ...]
    rate: np.ndarray
    work: np.ndarray
    solves: int
    pairs: np.ndarray
    preload_at_rest: float = float("nan")
    lost: Outcome[WearEnd] | None = None
    means: Means | None = None
    growth: float = float("nan")

    @property
    def failure(self) -> Outcome[WearEnd] | None:
        """The end that the first duty which did not converge makes, None where all did."""
        for point in self.points:
            if not point.solution.converged:
                hertz = point.state.omega / (2 * np.pi)
                return WearEnd.SOLVE_FAILED.say(f" at {hertz:.6g} Hz: {point.solution.outcome}")
        return self.lost

    @property
    def means_in_time(self) -> Means:
        """Those of a state that was followed in time."""
        if self.means is None:
            raise RuntimeError("the state was not followed in time")
        return self.means

    @property
    def separated(self) -> bool:
        """Whether no pair that can wear touches at any moment of any duty."""
        if self.means is not None:
            return not self.rate.any() and not self.means.normal_force[self.pairs].any()
        return all(bool(np.all(point.state.cycle.status[self.pairs] == SEPARATES)) for point in self.points)


def assess(problem: WearProblem, depth: np.ndarray, cycles: float, before: WearState | None) -> WearState:
    """Solve every duty at a wear depth, warm from a neighbouring state, and apply the wear law."""
    points = []
    for i, duty in enumerate(problem.mission):
        balance = problem.in_duty(duty, depth)
        if before is None:
            points.append(duty.first(balance))
        else:
            points.append(_neighbour(problem, duty, balance, before.points[i], before.depth, depth))
    return worn_state(problem, depth, cycles, points, sum(point.solves for point in points))


def worn_state(
    problem: WearProblem, depth: np.ndarray, cycles: float, points: Sequence[OperatingPoint], solves: int
) -> WearState:
    """The wear law applied to solved duties."""
    rate, work = np.zeros_like(depth), np.zeros_like(depth)
    for duty, point in zip(problem.mission, points, strict=True):
        of_duty = wear_of(problem, problem.in_duty(duty, depth), point.state, depth, cycles)
        rate, work = rate + duty.share * of_duty[0], work + duty.share * of_duty[1]
    return WearState(depth, cycles, tuple(points), rate, work, solves, problem.pairs)


def wear_of(
    problem: WearProblem,
    balance: HarmonicBalance,
    solved: State | Callable[[], State],
    depth: np.ndarray,
    cycles: float,
    motion: PeriodicMotion | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(n_pair,) depth [m] and friction work [J] of a cycle of a worn contact, or of a motion in time."""
    rate, work = np.zeros_like(depth), np.zeros_like(depth)
    for name, wear in problem.wearing.items():
        pairs = balance.contact.joint(name).rows
        of_joint = (problem.area[pairs], problem.numbers(name, depth[pairs]), depth[pairs])
        exposure = wear_law.Exposure(balance, solved, *of_joint, cycles, name, motion)
        rate[pairs], work[pairs] = wear_law.depth_rate(wear.law, exposure), exposure.energy
    return rate, work


def _neighbour(
    problem: WearProblem,
    duty: Duty,
    balance: HarmonicBalance,
    previous: OperatingPoint,
    known_depth: np.ndarray,
    depth: np.ndarray,
) -> OperatingPoint:
    omega, before = previous.state.omega, problem.in_duty(duty, known_depth)
    opening = (depth - known_depth) * before.contact.of_pairs("opening_slope")
    guess = previous.state.x + before.gap_response(before.evaluate(omega, previous.state.x), opening)
    point = duty.site.solve_near(balance, omega, guess)
    if point.solution.converged:
        return point
    x, solves = _follow_opening(before, omega, previous.state.x, opening)
    solves += point.solves
    retried = duty.site.solve_near(balance, omega, x)
    if not retried.solution.converged:  # the neighbour's branch has ended: look as at the start
        solves += retried.solves
        retried = duty.site.solve(balance)
    return OperatingPoint(retried.solution, retried.amplitude, retried.response, retried.solves + solves)


def follow_balance(problem: WearProblem, before: WearState, depth: np.ndarray, cycles: float) -> WearState:
    """A state of duties at given frequencies that wears along motions in time, whatever their balances do.

    The balance's solution next to that of `before` goes along, for what is asked of it later. Where Newton finds none,
    the last one stays as it is: to look for another may take longer than all wear steps"""
    points = []
    for duty, previous in zip(problem.mission, before.points, strict=True):
        omega, x = previous.state.omega, previous.state.x
        previous_balance, balance = problem.in_duty(duty, before.depth), problem.in_duty(duty, depth)
        opening = (depth - before.depth) * previous_balance.contact.of_pairs("opening_slope")
        guess = x + previous_balance.gap_response(previous.state, opening)
        solved = newton.solve(balance, omega, guess, duty.site.newton)
        if not solved.converged:
            solved = replace(previous.solution, state=balance.evaluate(omega, x))
        points.append(OperatingPoint.of(balance, solved, duty.site.output, 1))
    return worn_state(problem, depth, cycles, points, len(points))


def _follow_opening(
    before: HarmonicBalance, omega: float, x: np.ndarray, opening: np.ndarray
) -> tuple[np.ndarray, int]:
    """Follow x at fixed frequency while the gaps open, in steps that halve where Newton fails; x and solves spent."""
    gap, solves = before.contact.gap, 0

    def opened(reach: float, done: float) -> bool:
        nonlocal x, solves
        present, opened_further = before.with_gap(gap + done * opening), before.with_gap(gap + reach * opening)
        guess = x + present.gap_response(present.evaluate(omega, x), (reach - done) * opening)
        solution = newton.solve(opened_further, omega, guess)
        solves += 1
        x = solution.state.x if solution.converged else x
        return solution.converged

    lead(0.0, 1.0, opened, first=0.5)
    return x, solves
