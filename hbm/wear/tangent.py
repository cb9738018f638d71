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
Source  ours; of the step Alexander 1977, see sdirk_stages
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.operating_condition import AtPeakRatio
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.derivatives.cycle_derivatives import peak_moves
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.derivatives.parameter_effects import ParameterEffects
from tribodyn.hbm.linearisation import Linearisation
from tribodyn.hbm.newton import RULES as NEWTON
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.harmonic_fallback import top_harmonic
from tribodyn.hbm.wear.history import LARGEST_SHIFT, LIFE_SHARE, StepScheme, WearHistory, WearRow, cycles_to_preload
from tribodyn.hbm.wear.implicit_stage import WearingBalance, work_slope
from tribodyn.hbm.wear.preload_at_rest import PreloadAtRest
from tribodyn.hbm.wear.sdirk_stages import GAMMA, FrequencySearch, depth_per_work, initial_guess, solve_first_stage
from tribodyn.hbm.wear.step_memory import StepMemory
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.hbm.wear.wear_rows import state_of
from tribodyn.hbm.wear.wear_state import WearState, assess, wear_of


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
    Raises  NoDerivative where there is no life, or no derivative along it
    """
    life = cycles_to_preload(worn, share)
    if life is None:
        raise NoDerivative(f"the contact has no life: {worn.end}")
    preload = worn.preload if worn.preload_at_rest is None else worn.preload_at_rest
    end = int(np.flatnonzero(preload < share * preload[0])[0])
    end -= int(preload[end] <= 0)  # all apart: the row before is the last that tells of the parameters
    if end == 0:
        raise NoDerivative("the first step of wear parts the contact")
    rows = worn.rows()[: end + 1]
    _check(problem, rows, worn.scheme)
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
    tangent, depth = _Tangent(problem, changes, by_law, opens, worn.scheme), np.zeros_like(opens)
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
class _Tangent:
    """The columns of a tangent, the changes first.

    by_law : the problem a step above and a step below each number of a wear law, and the step; one column follows, of
        all steps longer together; opens : (n_pair, n) d gap besides the wear; scheme : of the steps
    corners : cycles of the states where a pair is at a corner of its force, and the tangent that of one side
    """

    problem: WearProblem
    changes: tuple[ParameterChange, ...]
    by_law: tuple[tuple[WearProblem, WearProblem, float], ...]
    opens: np.ndarray
    scheme: str
    corners: list[float] = field(default_factory=list)

    def along(
        self, row: WearRow, earlier: Sequence[WearRow], before: WearState, after: WearState, depth: np.ndarray
    ) -> np.ndarray:
        """Derivatives of the depth (n_pair, n) behind a step from those before it; past : the rows before."""
        self._check_status(before, after)
        stride = row.cycles_in_step
        if self.scheme == StepScheme.EXPLICIT:
            return depth + stride * self.moved(before, depth, 0.0)[1]
        drift, slopes = initial_guess(
            self.problem, before, earlier, self.problem
        )  # the first stage again, as the run came to it
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

        Returns those of depth [m], depth per cycle, both (n_pair, n), and preload of the joints that wear (n,)
        """
        problem, n, n_change = self.problem, base.shape[1], len(self.changes)
        cycles = [_Cycle(self, duty, at.state, state) for duty, at in zip(problem.mission, state.points, strict=True)]
        force, x, rate_by_x, *rates = zip(*(cycle.slopes(n) for cycle in cycles), strict=True)
        force, x, rate_by_x = (np.concatenate(part, axis=1) for part in (force, x, rate_by_x))
        rate, by_gap, by_depth = (np.sum(part, axis=0) for part in rates)
        rate = rate + by_gap[:, None] * self.opens
        rate[:, n_change + len(self.by_law)] += state.rate
        slope = stretch * rate_by_x / (1 - stretch * by_depth)[:, None]
        depth = (base + stretch * rate) / (1 - stretch * by_depth)[:, None]
        duties = [problem.in_duty(duty) for duty in problem.mission]
        fixed = (state.depth, 0.0, np.zeros_like(state.depth), state.depth)
        stage = WearingBalance(duties, [duty.share for duty in problem.mission], *fixed)
        omegas = tuple(cycle.solved.omega for cycle in cycles)
        solved, side = stage.evaluate(omegas, np.concatenate([c.solved.x for c in cycles], axis=1)), stage.at(omegas)
        jac, n_coeff, components = solved.cycle.jacobian, solved.x.shape[2], problem.balance.contact.components
        normal = components.index("n") * n_coeff
        assert jac is not None
        gap = -jac[:, :, normal :: len(components) * n_coeff].sum(axis=2)
        opened = force + gap[..., None] * (depth + self.opens)[:, None]
        right = [
            x_part.reshape(-1, n_coeff) - side.apply(f.reshape(-1, n_coeff))
            for x_part, f in zip(np.moveaxis(x, 2, 0), np.moveaxis(opened, 2, 0), strict=True)
        ]
        moving = [cycle for cycle in cycles if not isinstance(cycle.duty.site, AtFrequency)]
        right += [side.join([(c is m) * -c.balance.frequency_slope(c.solved)[0] for c in cycles]) for m in moving]
        wearing = replace(solved.cycle, jacobian=jac + gap[:, :, None] * slope[:, None, :])
        columns = _solved(stage.linearise(replace(solved, cycle=wearing)), right)
        dx, by_omega = np.split(columns.reshape(*gap.shape, -1), [n], axis=2)
        depth = depth + np.einsum("pc,pcn->pn", slope, dx)
        if moving:
            moves = np.stack([cycle.moves() for cycle in moving])
            by_pair, turn = moves[:, n_change:], np.einsum("pc,pcn->pn", slope, by_omega)
            omega = by_pair @ (depth + self.opens)
            omega[:, :n_change] += moves[:, :n_change]
            omega = np.linalg.solve(np.eye(len(moving)) - by_pair @ turn, omega)
            depth, dx = depth + turn @ omega, dx + by_omega @ omega
        force_change = force + jac @ dx + gap[..., None] * (depth + self.opens)[:, None]
        rate = rate + by_depth[:, None] * depth + np.einsum("pc,pcn->pn", rate_by_x, dx)
        return depth, rate, force_change[problem.pairs, normal].sum(axis=0)


@dataclass(frozen=True)
class _Cycle:
    """The cycle of one duty at a state of the wear, and the slopes of its forces and of the depth that it wears."""

    tangent: _Tangent
    duty: Duty
    solved: State
    state: WearState

    @cached_property
    def balance(self) -> HarmonicBalance:
        """Worn."""
        return self.tangent.problem.in_duty(self.duty, self.state.depth)

    @cached_property
    def changes(self) -> list[ParameterChange]:
        """Of the worn contact."""
        return [_worn(change, self.tangent.problem.balance, self.balance) for change in self.tangent.changes]

    def slopes(self, n: int) -> tuple[np.ndarray, ...]:
        """Changes of force and x (n_pair, n_component * n_coeff, n) at the same x and forces by n columns, d rate / d x
        (n_pair, n_component * n_coeff), d rate (n_pair, n), and d rate (n_pair,) by gap and by depth."""
        effects, problem = ParameterEffects(self.balance, self.solved), self.tangent.problem
        upper, lower = effects.of_gap()
        one_sided, by_work = (
            [(2 * (upper - lower), upper + lower)],
            {w.law for w in problem.wearing.values()} == {"energy"},
        )
        if by_work:  # in closed form by x and gap, which is faster; at a corner both are of the same side
            solved, basis, contact = self.solved, self.balance.basis, self.balance.contact
            gain = self.duty.share * depth_per_work(problem, self.state)
            rate_by_x = gain[:, None] * work_slope(self.balance, solved.x, solved.cycle)
            assert solved.cycle.jacobian is not None
            column = -solved.cycle.jacobian[:, :, contact.components.index("n") * basis.n_coeff]
            work = basis.work_per_cycle(column.reshape(solved.x.shape), solved.x)[:, contact.tangential]
            by_gap = by_depth = gain * work.sum(axis=1)
        else:
            by_gap, by_depth = self._by_depth(0.0), self._by_depth(1.0)
            one_sided.append((self._by_depth(0.0, RULES.law_step) - by_gap, by_gap))
            rate_by_x = self._by_x()
        if any(np.abs(differ).max() > RULES.corner * np.abs(size).max() for differ, size in one_sided):
            self.tangent.corners.append(self.state.cycles)
        force, x, rate = (np.zeros((*shape, n)) for shape in (rate_by_x.shape, rate_by_x.shape, (len(rate_by_x),)))
        for i, change in enumerate(self.changes):
            effect = np.mean(effects.of_change(change), axis=0)
            force[..., i], x[..., i] = effect[: 2 * rate_by_x.size].reshape(2, *rate_by_x.shape)
            rate[:, i] = self._by(change)
        for i, (up, down, step) in enumerate(self.tangent.by_law, len(self.changes)):
            rate[:, i] = (self._rate(problem=up) - self._rate(problem=down)) / (2 * step)
        later = RULES.law_step * self.state.cycles  # steps that are longer begin later, too
        aged = (self._rate(later=later) - self._rate(later=-later)) / (2 * RULES.law_step)
        rate[:, len(self.changes) + len(self.tangent.by_law)] = aged
        return force, x, rate_by_x, rate, by_gap, by_depth

    def _rate(
        self,
        balance: HarmonicBalance | None = None,
        x: np.ndarray | None = None,
        problem: WearProblem | None = None,
        deeper: np.ndarray | float = 0.0,
        later: float = 0.0,
    ) -> np.ndarray:
        """(n_pair,) share of the duty in the depth per cycle [m], with something changed."""
        changed, x = balance or self.balance, self.solved.x if x is None else x
        state = replace(self.solved, x=x, cycle=changed.contact.cycle(x, changed.basis, changed.memory, jacobian=False))
        depth, cycles = self.state.depth + deeper, self.state.cycles + later
        return self.duty.share * wear_of(problem or self.tangent.problem, changed, state, depth, cycles)[0]

    def _by(self, change: ParameterChange) -> np.ndarray:
        """(n_pair,) d rate by a parameter, at the same x."""
        base, sides, problem = self.balance, (change.above, change.below), self.tangent.problem
        slope = np.zeros(len(self.solved.x))
        if any(
            inputs.contact is not base.contact or inputs.memory is not base.memory or inputs.model is not base.model
            for inputs in sides
        ):
            up, down = (
                self._rate(
                    replace(base, contact=inputs.contact, memory=inputs.memory),
                    problem=replace(
                        problem, area=problem.area + inputs.model.interface.area - base.model.interface.area
                    ),
                )
                for inputs in sides
            )
            slope = (up - down) / (2 * change.step)
        return slope if change.contact_part is None else slope + self._by(change.contact_part)

    def _by_depth(self, worn: float, reach: float = RULES.gap_step) -> np.ndarray:
        """(n_pair,) d rate by the gap at the same x, which a depth opens that a law may ask for (worn = 1)."""
        base, gap, step = self.balance, self.balance.contact.gap, reach * self._size
        up, down = (self._rate(base.with_gap(gap + s), deeper=worn * s) for s in (step, -step))
        return (up - down) / (2 * step)

    def _by_x(self) -> np.ndarray:
        """(n_pair, n_component * n_coeff) d rate of each pair by its own x, one coefficient of all pairs at a time."""
        x, step = self.solved.x, RULES.gap_step * self._size
        moves = (step[:, None, None] * unit for unit in np.eye(x[0].size).reshape(-1, *x[0].shape))
        return np.stack([(self._rate(x=x + d) - self._rate(x=x - d)) / (2 * step) for d in moves], axis=1)

    @property
    def _size(self) -> np.ndarray:
        """(n_pair,) largest displacement [m]."""
        return np.asarray(np.abs(self.solved.x).max(axis=(1, 2), initial=1e-12))

    def moves(self) -> np.ndarray:
        """(n_change + n_pair,) d omega of a place that moves with a peak, see `peak_moves`."""
        site, balance, state, ratio = self.duty.site, self.balance, self.solved, 1.0
        if isinstance(site, AtPeakRatio):
            ratio, state = site.ratio, site.peak_near(balance, state.omega, state.x).state
        try:
            return ratio * peak_moves(balance, state, site.output, self.changes, site.newton)
        except NoDerivative as reason:
            raise NoDerivative(f"at {self.state.cycles:.4g} cycles {reason}") from None


def _by_numbers(
    problem: WearProblem, numbers: Mapping[str, tuple[str, Sequence[str]]]
) -> tuple[tuple[WearProblem, WearProblem, float], ...]:
    """The problem a step above and a step below each number of the joints' wear laws."""

    pairs = []
    for name, joints in numbers.values():
        value = problem.wearing[joints[0]].numbers[name]
        step = RULES.law_step * float(np.max(value))
        laws = [
            {
                of: replace(law, numbers={**law.numbers, name: value + s})
                for of, law in problem.wearing.items()
                if of in joints
            }
            for s in (step, -step)
        ]
        up, down = (replace(problem, wear={**problem.wearing, **changed}) for changed in laws)
        pairs.append((up, down, step))
    return tuple(pairs)


def _worn(change: ParameterChange, unworn: HarmonicBalance, balance: HarmonicBalance) -> ParameterChange:
    """A change of a worn contact."""
    opened = balance.contact.gap - unworn.contact.gap

    def there(posed: BalanceInputs) -> BalanceInputs:
        is_unworn = posed.contact is unworn.contact
        return replace(
            posed,
            contact=balance.contact if is_unworn else posed.contact.with_gap(posed.contact.gap + opened),
            balance=None,
        )

    twice = None if change.double_step is None else tuple(there(inputs) for inputs in change.double_step)
    touching = None if change.contact_part is None else _worn(change.contact_part, unworn, balance)
    return replace(
        change, above=there(change.above), below=there(change.below), double_step=twice, contact_part=touching
    )


def _solved(linear: Linearisation, right: Sequence[np.ndarray]) -> np.ndarray:
    """Solutions as columns (n_contact * n_coeff, n), by one factor where the balance is small enough."""
    if right[0].size <= NEWTON.most_dense:
        return np.asarray(
            sla.solve(linear.dense(), np.stack([column.ravel() for column in right], axis=1), overwrite_a=True)
        )
    return np.stack([linear.solve_refined(column, 1e-8).ravel() for column in right], axis=1)
