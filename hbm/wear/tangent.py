"""Derivatives of a life by any parameter: the tangent of the wear steps that a run took.

Every stage of a step ends at a depth h = b + s r(x, h, p), b the depth before it and s its cycles, with the x of every
duty of the mission in balance at its place. A pair wears by its own cycles alone, so that dh is eliminated pair by
pair, and one factor of

    d x - G (k d x - d f) = x_p + R_w d w,    d f = f_x d x + f_p - f_n d h,    d h = d b + s (r_x d x + r_h d h + r_p)

serves all parameters: dh/dp goes on from step to step, of as many directions as there are parameters. The slopes of
the rate r are differences of the wear law itself, pair by pair, whatever it asks of a cycle. The frequency of a peak
moves with p and h, dw = w_p dp + w_h dh, see `hbm.derivatives.cycle_derivatives`. The life Z ends where N(h(Z), p) is a
share of the first preload. Its steps keep their shares of it, so that all cycles times c act as all wear coefficients
would:

    d ln Z / dp = (N0_p / N0 - N_p / N) / (N_c / N)

A jump to another resonance, a motion in time, a step over the end of a branch, or a wear law whose rate jumps as a pair
begins to lift has no derivative.
Source  ours; of the step Alexander 1977, see sdirk_stages"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.linearisation import Linearisation
from tribodyn.hbm.newton import RULES as NEWTON
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.harmonic_fallback import top_harmonic
from tribodyn.hbm.wear.history import LARGEST_SHIFT, LIFE_SHARE, StepScheme, WearHistory, WearRow, cycles_to_preload
from tribodyn.hbm.wear.implicit_stage import WearingBalance, slope_by_age
from tribodyn.hbm.wear.run_end import PreloadAtRest
from tribodyn.hbm.wear.sdirk_stages import GAMMA, FrequencySearch, initial_guess, solve_first_stage
from tribodyn.hbm.wear.step_memory import StepMemory
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess, wear_of
from tribodyn.hbm.wear.wear_rows import state_of
from tribodyn.hbm.wear.worn_cycle import WornCycle


@single
def of_life(
    problem: WearProblem,
    worn: WearHistory,
    changes: Iterable[ParameterChange],
    numbers: Mapping[str, tuple[str, Sequence[str]]],
    share: float = LIFE_SHARE,
) -> Derivatives:
    """Derivatives of life [cycles], and of largest depth [m] and worn volume [m3] at its end.

    worn : a run of the problem; numbers : name -> a wear law's own number, such as coefficient, and joints that have it
    share : of the first preload, where the life ends. The gaps of a joint open together: each pair has the same part
    Raises  NoDerivative where there is no life, or no derivative along it"""
    life, end = _life_and_last_row(worn, share)
    _check(problem, rows := worn.rows()[: end + 1], worn.scheme)
    changes = tuple(changes)  # all at once: each state asks for all of them
    joints, by_law = problem.balance.contact.joints, _by_numbers(problem, numbers)
    last, n = len(changes) + len(by_law), len(changes) + len(by_law) + 1 + len(joints)
    area, spread = problem.area, np.zeros((len(problem.area), n))
    for i, change in enumerate(changes):  # lengths move the areas that wear
        up, down = (inputs.model.interface.area for inputs in (change.above, change.below))
        spread[:, i] = (up - down) / (2 * change.step)
    opens = np.zeros((len(area), n))
    for i, joint in enumerate(joints, last + 1):
        opens[joint.rows, i] = 1.0
    tangent, depth = Tangent(problem, changes, by_law, opens, worn.scheme), np.zeros_like(opens)
    after = first = state_of(problem, rows[0])
    for i, row in enumerate(rows[:-1]):
        before, after = after, state_of(problem, rows[i + 1])
        depth = tangent.along(row, rows[:i], before, after, depth)
    ends, deepest = [first, after], int(after.depth.argmax())
    if worn.preload_at_rest is not None:
        quiet = PreloadAtRest(problem).quiet(first)
        rests = assess(quiet, first.depth, 0.0, None)
        tangent, ends = replace(tangent, problem=quiet), [rests, assess(quiet, after.depth, 0.0, rests)]
    initial, remaining = (
        tangent.moved(state, base, 0.0)[2] / problem.preload_of(state)
        for state, base in zip(ends, (np.zeros_like(depth), depth), strict=True)
    )
    longer = (initial - remaining) / remaining[last]
    ended = depth + np.outer(depth[:, last], longer)
    slopes = np.stack([life * longer, ended[deepest], area @ ended + after.depth @ spread])
    by_gap = np.zeros((3, len(area)))
    for i, joint in enumerate(joints, last + 1):
        by_gap[:, joint.rows] = slopes[:, i, None] / len(joint.rows)
    by, values = slopes[:, :last], np.array([life, after.depth[deepest], area @ after.depth])
    return Derivatives(
        ("life", "depth", "volume"), values, (*(change.name for change in changes), *numbers), by,
        np.full(last, bool(tangent.corners)), by, by, np.zeros(3), by_gap, first.points[0].state,
    )  # fmt: skip


def _life_and_last_row(worn: WearHistory, share: float) -> tuple[float, int]:
    """Life [cycles] until a share of the first preload is left, and the last row that depends on the parameters."""
    life = cycles_to_preload(worn, share)
    if life is None:
        raise NoDerivative(f"the contact has no life: {worn.end}")
    preload = worn.preload if worn.preload_at_rest is None else worn.preload_at_rest
    end = int(np.flatnonzero(preload < share * preload[0])[0])
    end -= int(preload[end] <= 0)  # without any force the row does not depend on them: take the one before
    if end == 0:
        raise NoDerivative("the first step of wear parts the contact")
    return life, end


def _check(problem: WearProblem, rows: Sequence[WearRow], scheme: str) -> None:
    """Raise NoDerivative where there is none along the rows of a run."""
    basis = problem.balance.basis
    if scheme == StepScheme.UNKNOWN:
        raise NoDerivative("the steps of the wear rule have no tangent")
    if problem.any_joint or any(duty.balance is not None for duty in problem.mission):
        raise NoDerivative("cycles at several speeds, or until any joint is lost")
    for row, following in pairwise(rows):
        where, shift = f"at {following.cycles:.4g} cycles", following.duty_omega / row.duty_omega - 1
        if row.periods:
            raise NoDerivative(f"at {row.cycles:.4g} cycles the motion is followed in time")
        if np.abs(shift).max() > LARGEST_SHIFT:
            i = int(np.abs(shift).argmax())
            jump = f"from {row.duty_omega[i] / (2 * np.pi):.5g} to {following.duty_omega[i] / (2 * np.pi):.5g} Hz"
            raise NoDerivative(f"{where} the response jumps {jump}")
        if scheme == StepScheme.IMPLICIT and not StepMemory.of_row(row).next_cycles > 0:
            raise NoDerivative(f"{where} the run stepped over the end of a branch of solutions, or to another peak")
        if top_harmonic(basis, list(following.duty_displacement)) < basis.harmonics[-1]:
            raise NoDerivative(f"{where} no motion with all harmonics follows")


@dataclass(frozen=True)
class Tangent:
    """The columns of a tangent, the changes first.

    by_law : the problem a step above and a step below each number of a wear law, and the step; one column follows, of
        all steps longer together; opens : (n_pair, n) d gap besides the wear; scheme : of the steps
    corners : cycles of the states where a pair is at a corner of its force, and the tangent that of one side"""

    problem: WearProblem
    changes: tuple[ParameterChange, ...]
    by_law: tuple[tuple[WearProblem, WearProblem, float], ...]
    opens: np.ndarray
    scheme: str
    corners: list[float] = field(default_factory=list)

    def along(
        self, row: WearRow, earlier: Sequence[WearRow], before: WearState, after: WearState, depth: np.ndarray
    ) -> np.ndarray:
        """Derivatives of the depth (n_pair, n) behind a step from those before it; earlier : the rows before."""
        self._check_status(before, after)
        stride = row.cycles_in_step
        if self.scheme == StepScheme.EXPLICIT:
            return depth + stride * self.moved(before, depth, 0.0)[1]
        # the first stage again, as the run came to it
        drift, slopes = initial_guess(self.problem, before, earlier, self.problem)
        searches = [FrequencySearch(float(slope)) for slope in slopes]
        reach, middle = GAMMA * stride, solve_first_stage(self.problem, before, stride, drift, searches)
        rate = (row.worn / stride - GAMMA * after.rate) / (1 - GAMMA)
        if middle.failure or np.abs(middle.rate - rate).max() > 1e-2 * rate.max():
            raise NoDerivative(f"at {middle.cycles:.4g} cycles the response passes to another motion within a step")
        between = self.moved(middle, depth, reach)[0]
        return self.moved(after, depth + (1 - GAMMA) / GAMMA * (between - depth), reach)[0]

    def _check_status(self, before: WearState, after: WearState) -> None:
        """Raise NoDerivative where a wear law jumps with what a pair does, as one of impacts where it lifts."""
        problem = self.problem
        for duty, start, end in zip(problem.mission, before.points, after.points, strict=True):
            balance, end_state = problem.in_duty(duty, after.depth), end.state
            status = replace(end_state, cycle=replace(end_state.cycle, status=start.state.cycle.status))
            rate, other = (wear_of(problem, balance, s, after.depth, after.cycles)[0] for s in (end_state, status))
            if np.abs(other - rate).max() > RULES.corner * np.abs(rate).max():
                raise NoDerivative(f"before {after.cycles:.4g} cycles a wear law jumps as a pair lifts, slips or stops")

    def moved(self, state: WearState, base: np.ndarray, stretch: float) -> tuple[np.ndarray, ...]:
        """Derivatives of a state whose depth is `base` + stretch * rate, base (n_pair, n) by its columns.

        Returns those of depth [m], depth per cycle, both (n_pair, n), and preload of the joints that wear (n,)"""
        problem, n, n_change = self.problem, base.shape[1], len(self.changes)
        cycles = [
            WornCycle(self, duty, at.state, state) for duty, at in zip(problem.mission, state.points, strict=True)
        ]
        force, x, rate_by_x, *rates = zip(*(cycle.slopes(n) for cycle in cycles), strict=True)
        force, x, rate_by_x = (np.concatenate(part, axis=1) for part in (force, x, rate_by_x))
        rate, by_gap, by_depth = (np.sum(part, axis=0) for part in rates)
        rate, contact = rate + by_gap[:, None] * self.opens, cycles[0].balance.contact
        opening = contact.of_pairs("opening_slope")[:, None]
        rate[:, n_change + len(self.by_law)] += state.rate
        slope = stretch * rate_by_x / (1 - stretch * by_depth)[:, None]
        depth = (base + stretch * rate) / (1 - stretch * by_depth)[:, None]
        duties = [problem.in_duty(duty) for duty in problem.mission]
        fixed = (state.depth, 0.0, np.zeros_like(state.depth), state.depth)
        stage = WearingBalance(duties, [duty.share for duty in problem.mission], *fixed)
        omegas = tuple(cycle.solved.omega for cycle in cycles)
        solved, side = stage.evaluate(omegas, np.concatenate([c.solved.x for c in cycles], axis=1)), stage.at(omegas)
        jac, n_coeff, components = solved.cycle.slope, solved.x.shape[2], problem.balance.contact.components
        normal = components.index("n") * n_coeff
        gap = -jac[:, :, normal :: len(components) * n_coeff].sum(axis=2)
        worn = gap * opening + np.concatenate(
            [slope_by_age(c.balance, c.solved.x, c.solved.omega) for c in cycles], axis=1
        )
        opened = force + gap[..., None] * self.opens[:, None] + worn[..., None] * depth[:, None]
        right = [
            x_part.reshape(-1, n_coeff) - side.apply(f.reshape(-1, n_coeff))
            for x_part, f in zip(np.moveaxis(x, 2, 0), np.moveaxis(opened, 2, 0), strict=True)
        ]
        moving = [cycle for cycle in cycles if not isinstance(cycle.duty.site, AtFrequency)]
        right += [side.join([(c is m) * -c.balance.frequency_slope(c.solved)[0] for c in cycles]) for m in moving]
        wearing = replace(solved.cycle, jacobian=jac + worn[:, :, None] * slope[:, None, :])
        columns = _solved(stage.linearise(replace(solved, cycle=wearing)), right)
        dx, by_omega = np.split(columns.reshape(*gap.shape, -1), [n], axis=2)
        depth = depth + np.einsum("pc,pcn->pn", slope, dx)
        if moving:
            moves = np.stack([cycle.moves() for cycle in moving])
            n_own, turn = n_change + len(self.by_law), np.einsum("pc,pcn->pn", slope, by_omega)
            own, by_opening, by_age = np.split(moves, [n_own, n_own + len(gap)], axis=1)
            by_wear = by_opening * opening.T + by_age
            omega = by_wear @ depth + by_opening @ self.opens
            omega[:, :n_own] += own
            omega = np.linalg.solve(np.eye(len(moving)) - by_wear @ turn, omega)
            depth, dx = depth + turn @ omega, dx + by_omega @ omega
        force_change = force + jac @ dx + gap[..., None] * self.opens[:, None] + worn[..., None] * depth[:, None]
        rate = rate + by_depth[:, None] * depth + np.einsum("pc,pcn->pn", rate_by_x, dx)
        return depth, rate, force_change[problem.pairs, normal].sum(axis=0)


def _by_numbers(
    problem: WearProblem, numbers: Mapping[str, tuple[str, Sequence[str]]]
) -> tuple[tuple[WearProblem, WearProblem, float], ...]:
    """The problem a step above and a step below each number of the joints' wear laws."""

    pairs = []
    for name, joints in numbers.values():
        value = problem.wearing[joints[0]].numbers[name]
        step = RULES.law_step * float(np.max(value))
        up, down = (problem.with_number(name, value + s, joints) for s in (step, -step))
        pairs.append((up, down, step))
    return tuple(pairs)


def _solved(linear: Linearisation, right: Sequence[np.ndarray]) -> np.ndarray:
    """Solutions as columns (n_contact * n_coeff, n), by one factor where the balance is small enough."""
    if right[0].size <= NEWTON.most_dense:
        return np.asarray(
            sla.solve(linear.dense(), np.stack([column.ravel() for column in right], axis=1), overwrite_a=True)
        )
    return np.stack([linear.solve_refined(column, 1e-8).ravel() for column in right], axis=1)
