"""What every wear run shares: the problem, the wear rate of one state, and when a run is over."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.hbm.continuation.operating_condition import OperatingCondition
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.newton import lead
from tribodyn.hbm.outcome import CONVERGED, Outcome, WearEnd
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.wear import law as wear_law
from tribodyn.hbm.wear.history import WearRow
from tribodyn.hbm.wear.law import JointWear
from tribodyn.refusal import Refusal

FADED_SHARE = 1e-3  # share of the first friction work per cycle below which wear may have faded out
ENDLESS = 1e12  # cycles: thirty years at 1 kHz, longer than any machine runs


@dataclass(frozen=True)
class Duty:
    """A part of the mission: `share` of all cycles run at `site`, with the harmonic loads times `load`.

    balance : its own unworn problem over the same contact, as at another speed of rotation; None for the common one
    start : frequency [rad/s] and x (n_pair, n_component, n_coeff) [m] beside its unworn cycle; looked for where None
    """

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
    copies : of one contact, one behind the other, whose joints then count by themselves: those of a wheel's sectors
    lost_below_at_rest : the run ends when the preload without the harmonic loads falls to this share of its first
        value, see hbm.wear.preload_at_rest; None: it is not looked at
    """

    balance: HarmonicBalance
    mission: tuple[Duty, ...]
    wear: JointWear | Mapping[str, JointWear]
    area: np.ndarray
    lost_below: float = 0.0
    lost_below_at_rest: float | None = None
    any_joint: bool = False
    copies: int = 1

    def __post_init__(self) -> None:
        shares = [duty.share for duty in self.mission]
        if not self.mission or min(shares) < 0 or abs(sum(shares) - 1) > 1e-9:
            raise Refusal(f"the shares of the mission's duties must be >= 0 and sum to 1, not {shares}")
        for duty in self.mission:
            own = self.balance if duty.balance is None else duty.balance
            if own.basis != self.balance.basis or own.contact.n_pair != self.balance.contact.n_pair:
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

    def numbers(self, joint: str) -> dict[str, np.ndarray]:
        """The own numbers of a joint's wear law, each (n_pair,) of the joint."""
        n = len(self.balance.contact.joint(joint).rows)
        given = self.wearing[joint].numbers
        return {name: np.array(np.broadcast_to(np.asarray(v, float), (n,))) for name, v in given.items()}

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
        own = self.balance if duty.balance is None else duty.balance
        worn = own if depth is None else own.with_gap(own.contact.gap + depth)
        return worn.with_load(duty.load)


@dataclass(frozen=True)
class Means:
    """Means over the periods of a motion in time, of the first duty but for what says how well they are known.

    energy : (n_pair,) friction work per period [J]; normal_force : (n_pair,) [N]; amplitude : of the first output [m]
    spread : standard deviation of the work of a period, over its mean; error : standard error of that mean, relative
    settled : whether the means came to rest; periods : marched
    moving : what moved before, to begin from again; empty where the motion began in the balance
    """

    energy: np.ndarray
    normal_force: np.ndarray
    amplitude: float
    spread: float
    error: float
    settled: bool
    periods: int
    moving: np.ndarray


@dataclass(frozen=True)
class WearState:
    """A worn contact with its solved duties.

    depth : (n_pair,) [m]; cycles : passed before; points : one per duty; pairs : of the joints that wear
    rate : (n_pair,) wear depth per cycle [m], work : (n_pair,) friction work per cycle [J]; averages over the mission
    preload_at_rest : [N], nan where it was not asked for
    lost : why there is no preload at rest, or no motion in time
    means : of the motion in time where a machine leaves that of the balance, see hbm.wear.machine_motion
    growth : of the perturbation of the balance's motions that grows fastest, per radian; nan where it is not known
    """

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
        of_joint = (problem.area[pairs], problem.numbers(name), depth[pairs])
        exposure = wear_law.Exposure(balance, solved, *of_joint, cycles, name, motion)
        rate[pairs], work[pairs] = wear_law.depth_rate(wear.law, exposure), exposure.energy
    return rate, work


def _neighbour(
    problem: WearProblem,
    duty: Duty,
    balance: HarmonicBalance,
    known: OperatingPoint,
    known_depth: np.ndarray,
    depth: np.ndarray,
) -> OperatingPoint:
    omega, opening = known.state.omega, depth - known_depth
    before = problem.in_duty(duty, known_depth)
    guess = known.state.x + before.gap_response(before.evaluate(omega, known.state.x), opening)
    point = duty.site.solve_near(balance, omega, guess)
    if point.solution.converged:
        return point
    x, solves = _carry(before, omega, known.state.x, opening)
    solves += point.solves
    again = duty.site.solve_near(balance, omega, x)
    if not again.solution.converged:  # the neighbour's branch has ended: look as at the start
        solves += again.solves
        again = duty.site.solve(balance)
    return OperatingPoint(again.solution, again.amplitude, again.response, again.solves + solves)


def kept_beside(problem: WearProblem, before: WearState, depth: np.ndarray, cycles: float) -> WearState:
    """A state of duties at given frequencies that wears along motions in time, whatever their balances do.

    The balance's solution next to that of `before` goes along, for what is asked of it later. Where Newton finds none,
    the last one stays as it is: to look for another may take longer than all wear steps
    """
    points = []
    for duty, known in zip(problem.mission, before.points, strict=True):
        omega, x = known.state.omega, known.state.x
        near, balance = problem.in_duty(duty, before.depth), problem.in_duty(duty, depth)
        guess = x + near.gap_response(known.state, depth - before.depth)
        found = newton.solve(balance, omega, guess, duty.site.newton)
        if not found.converged:
            found = replace(known.solution, state=balance.evaluate(omega, x))
        points.append(OperatingPoint.of(balance, found, duty.site.output, 1))
    return worn_state(problem, depth, cycles, points, len(points))


def _carry(before: HarmonicBalance, omega: float, x: np.ndarray, opening: np.ndarray) -> tuple[np.ndarray, int]:
    """Follow x at fixed frequency while the gaps open, in steps that halve where Newton fails; x and solves spent."""
    gap, solves = before.contact.gap, 0

    def opened(reach: float, done: float) -> bool:
        nonlocal x, solves
        here, there = before.with_gap(gap + done * opening), before.with_gap(gap + reach * opening)
        guess = x + here.gap_response(here.evaluate(omega, x), (reach - done) * opening)
        solution = newton.solve(there, omega, guess)
        solves += 1
        x = solution.state.x if solution.converged else x
        return solution.converged

    lead(0.0, 1.0, opened, first=0.5)
    return x, solves


def reason_to_stop(
    problem: WearProblem,
    state: WearState,
    rows: Sequence[WearRow] = (),
    step_depth: float = 0.0,
) -> Outcome[WearEnd] | None:
    """Why a run ends at a state; None where it continues.

    rows : taken before; step_depth : a depth that is worth wearing [m]: wear has faded out where the deepest pair needs
        more than ENDLESS cycles for it
    """
    if state.failure:
        return state.failure
    share = problem.lost_below_at_rest
    if share is not None and state.preload_at_rest <= share * (rows[0] if rows else state).preload_at_rest:
        return WearEnd.LOST_AT_REST.say(f" {share:.3g} of its first value")
    if state.separated:
        return WearEnd.LOST.say()
    preload = problem.preload_of(state)
    if preload < problem.lost_below * first_preload(problem, rows, state):
        return WearEnd.PRELOAD_LOST.say(f" {problem.lost_below:.3g} of its first value")
    lost = lost_joint(problem, state, rows) if problem.any_joint else None
    if lost is not None:
        return WearEnd.PRELOAD_LOST.say(f" {problem.lost_below:.3g} of its first value in joint {lost}")
    left = f", the contact survives with {state.depth.max():.4g} m worn at most and {preload:.4g} N of preload left"
    if state.rate.max() <= 0.0:
        if state.work.max() > 0.0:
            return WearEnd.NO_LOSS.say()
        return (WearEnd.NO_SLIP if len(rows) else WearEnd.NEVER_SLIPS).say(left)
    fading = rows and state.work.sum() < FADED_SHARE * rows[0].energy.sum()
    if fading and state.rate.max() * ENDLESS < step_depth:
        return WearEnd.FADED.say(left)
    return None


def lost_joint(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> str | None:
    """The first joint whose preload has fallen below the share that the problem asks for; None for none."""
    if not rows or "n" not in problem.balance.contact.components or not problem.balance.basis.has_static:
        return None
    contact, normal = problem.balance.contact, problem.normal_force(state)
    size = contact.n_pair // problem.copies
    for name in problem.wearing:
        pairs = contact.joint(name).rows
        first, left = (
            np.bincount(pairs // size, force[pairs], problem.copies) for force in (rows[0].normal_force, normal)
        )
        lost = np.flatnonzero(left < problem.lost_below * first)
        if len(lost):
            return f"{name}@{lost[0]}" if problem.copies > 1 else name
    return None


def row_of(
    problem: WearProblem,
    state: WearState,
    cycles_in_step: float = 0.0,
    worn: np.ndarray | float = 0.0,
    work: np.ndarray | float = 0.0,
    step_error: float = 0.0,
    plan: np.ndarray | None = None,
) -> WearRow:
    """The history row of a state, with what its step wears [m] and dissipates [J]; the first duty is what it shows."""
    balance, point = problem.in_duty(problem.mission[0], state.depth), state.points[0]
    solved, shape = point.state, (-1, point.state.x.shape[2])
    row = WearRow(
        cycles=state.cycles,
        cycles_in_step=cycles_in_step,
        depth=state.depth,
        worn=np.broadcast_to(worn, state.depth.shape),
        energy=np.maximum(balance.energy(solved), 0.0),
        preload=problem.preload_of(state),
        normal_force=balance.normal_force(solved),
        status=solved.cycle.status,
        omega=solved.omega,
        amplitude=point.amplitude,
        force=solved.cycle.force.reshape(shape),
        response=point.response,
        solves=state.solves,
        step_error=step_error,
        plan=np.zeros(0) if plan is None else plan,
        work=np.broadcast_to(work, state.depth.shape),
        duty_omega=np.array([p.state.omega for p in state.points]),
        duty_displacement=np.stack([p.state.x.reshape(shape) for p in state.points]),
        preload_at_rest=state.preload_at_rest,
        growth=state.growth,
    )
    means = state.means
    if means is None:
        return row
    of_motion = {name: getattr(means, name) for name in ("energy", "normal_force", "amplitude", "spread", "moving")}
    return replace(row, **of_motion, mean_error=means.error, periods=means.periods, settled=means.settled)


def state_of(problem: WearProblem, row: WearRow) -> WearState:
    """The state that a row was made from, solved points included, so that a run resumes bit for bit."""
    points = []
    for i, duty in enumerate(problem.mission):
        balance = problem.in_duty(duty, row.depth)
        x = row.duty_displacement[i].reshape(len(row.depth), -1, balance.basis.n_coeff)
        state = balance.evaluate(float(row.duty_omega[i]), x)
        outcome = newton.Solution(state, CONVERGED, 0, 0, ())
        points.append(OperatingPoint(outcome, row.amplitude, balance.outputs(state), 0))
    return worn_state(problem, row.depth, row.cycles, points, row.solves)


def first_preload(problem: WearProblem, rows: Sequence[WearRow], state: WearState) -> float:
    """Preload of the unworn contact [N]."""
    return rows[0].preload if rows else problem.preload_of(state)
