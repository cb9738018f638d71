"""Derivatives of a life by any parameter: the tangent of the wear steps that a run took.

Every stage of a step ends at a depth h = b + s r(x, h, p), b the depth before it and s its cycles, with x in balance at
its place. Pairs wear by their own work E, r = c E, so that dh is eliminated pair by pair, and one factor of

    d x - G (k d x - d f) = x_p + R_w d w,    d f = f_x d x + f_p - f_n d h,    d h = d b + s (c_p E + c d E)

serves all parameters: dh/dp goes on from step to step, of as many directions as there are parameters. The frequency of
a peak moves with p and h, dw = w_p dp + w_h dh, see `hbm.derivatives`. The life Z ends where N(h(Z), p) is a share of
the first preload. Its steps keep their shares of it, so that all cycles times c act as all wear coefficients would:

    d ln Z / dp = (N0_p / N0 - N_p / N) / (N_c / N)

A jump to another resonance, a motion in time, or a step over the end of a branch has no derivative.
Source  ours; of the step Alexander 1977, see dirk_stages
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.balance import HarmonicBalance, Linearisation
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.sites import BesidePeak
from tribodyn.hbm.derivatives import RULES as EXACT, Derivatives, peak_moves
from tribodyn.hbm.gradient import Change, Gradient, NoDerivative, Posed
from tribodyn.hbm.newton import RULES as NEWTON
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.dirk_stages import GAMMA, Search, begun, depth_per_work, first_stage
from tribodyn.hbm.wear.evolution import WearProblem, WearState, assess, state_of
from tribodyn.hbm.wear.fewer_harmonics import top_harmonic
from tribodyn.hbm.wear.history import LARGEST_SHIFT, LIFE_SHARE, WearHistory, WearRow, cycles_to_preload
from tribodyn.hbm.wear.implicit_stage import work_slope
from tribodyn.hbm.wear.preload_at_rest import PreloadAtRest


@single
def of_life(
    problem: WearProblem,
    worn: WearHistory,
    changes: Iterable[Change],
    coefficients: Mapping[str, tuple[float, Sequence[str]]],
    share: float = LIFE_SHARE,
) -> Derivatives:
    """Derivatives of life [cycles], and of largest depth [m] and worn volume [m3] at its end.

    worn : a run of the problem; coefficients : name -> wear coefficient and the joints that wear by it
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
    _check(problem, rows)
    changes = tuple(changes)  # all at once: each state asks for all of them
    joints, columns = problem.balance.contact.joints, [*coefficients.values(), (1.0, tuple(problem.wearing))]
    last, n = len(changes) + len(coefficients), len(changes) + len(columns) + len(joints)
    area, spread = problem.area, np.zeros((len(problem.area), n))
    for i, change in enumerate(changes):  # lengths move the areas that wear
        up, down = (one.model.interface.area for one in (change.above, change.below))
        spread[:, i] = (up - down) / (2 * change.step)
    grows, opens = -spread / area[:, None], np.zeros((len(area), n))
    for i, (value, names) in enumerate(columns, len(changes)):  # the last of them: all steps, by all joints
        for name in names:
            grows[problem.balance.contact.joint(name).rows, i] = 1 / value
    for i, joint in enumerate(joints, last + 1):
        opens[joint.rows, i] = 1.0
    tangent, depth = _Tangent(problem, changes, grows, opens), np.zeros_like(opens)
    after = first = state_of(problem, rows[0])
    for i, row in enumerate(rows[:-1]):
        before, after = after, state_of(problem, rows[i + 1])
        depth = tangent.along(row, rows[:i], before, after, depth)
    ends, deepest = [first, after], int(after.depth.argmax())
    if worn.preload_at_rest is not None:
        quiet = PreloadAtRest(problem).quiet(first)
        rests = assess(quiet, first.depth, 0.0, None)
        tangent, ends = replace(tangent, problem=quiet), [rests, assess(quiet, after.depth, 0.0, rests)]
    had, left = (
        tangent.moved(state, base, 0.0).preload / problem.preload_of(state)
        for state, base in zip(ends, (np.zeros_like(depth), depth), strict=True)
    )
    longer = (had - left) / left[last]
    ended = depth + np.outer(depth[:, last], longer)
    slopes = np.stack([life * longer, ended[deepest], area @ ended + after.depth @ spread])
    by_gap = np.zeros((3, len(area)))
    for i, joint in enumerate(joints, last + 1):
        by_gap[:, joint.rows] = slopes[:, i, None] / len(joint.rows)
    by, values = slopes[:, :last], np.array([life, after.depth[deepest], area @ after.depth])
    return Derivatives(
        ("life", "depth", "volume"), values, (*(change.name for change in changes), *coefficients), by,
        np.full(last, bool(tangent.corners)), by, by, np.zeros(3), by_gap, first.points[0].state,
    )  # fmt: skip


def _check(problem: WearProblem, rows: Sequence[WearRow]) -> None:
    """Raise NoDerivative where there is none along the rows of a run."""
    basis, (duty, *more) = problem.balance.basis, problem.mission
    laws = sorted({wear.law for wear in problem.wearing.values()} - {"energy"})
    if laws:
        raise NoDerivative(f"the depth by wear law {laws[0]} does not go with the friction work alone")
    if more or duty.balance is not None or isinstance(duty.site, BesidePeak) or problem.any_joint:
        raise NoDerivative("cycles at several places, beside a peak, or until any joint is lost")
    for row, following in pairwise(rows):
        where, moved = f"at {following.cycles:.4g} cycles", following.omega / row.omega - 1
        if row.periods:
            raise NoDerivative(f"at {row.cycles:.4g} cycles the motion is followed in time")
        if abs(moved) > LARGEST_SHIFT:
            jump = f"from {row.omega / (2 * np.pi):.5g} to {following.omega / (2 * np.pi):.5g} Hz"
            raise NoDerivative(f"{where} the response jumps {jump}")
        if len(row.plan) and not row.plan[0] > 0:
            raise NoDerivative(f"{where} the run stepped over the end of a branch of solutions, or to another peak")
        if top_harmonic(basis, [following.displacement]) < basis.harmonics[-1]:
            raise NoDerivative(f"{where} no motion with all harmonics follows")


@dataclass(frozen=True)
class _Moved:
    """Derivatives of a state: depth (n_pair, n), depth per cycle (n_pair, n), and preload of the joints that wear."""

    depth: np.ndarray
    rate: np.ndarray
    preload: np.ndarray


@dataclass(frozen=True)
class _Tangent:
    """The columns of a tangent, the changes first.

    grows : (n_pair, n) d ln depth per work; opens : (n_pair, n) d gap besides the wear
    corners : cycles of the states where a pair is at a corner of its force, and the tangent that of one side
    """

    problem: WearProblem
    changes: tuple[Change, ...]
    grows: np.ndarray
    opens: np.ndarray
    corners: list[float] = field(default_factory=list)

    def along(
        self, row: WearRow, past: Sequence[WearRow], before: WearState, after: WearState, depth: np.ndarray
    ) -> np.ndarray:
        """Derivatives of the depth (n_pair, n) behind a step from those before it; past : the rows before."""
        stride = row.cycles_in_step
        if not len(row.plan):  # of the thesis's rule
            return depth + stride * self.moved(before, depth, 0.0).rate
        reach, middle = GAMMA * stride, self._between(row, past, before)
        rate = (row.worn / stride - GAMMA * after.rate) / (1 - GAMMA)
        if middle.failure or np.abs(middle.rate - rate).max() > 1e-2 * rate.max():
            raise NoDerivative(f"at {middle.cycles:.4g} cycles the response passes to another motion within a step")
        between = self.moved(middle, depth, reach).depth
        return self.moved(after, depth + (1 - GAMMA) / GAMMA * (between - depth), reach).depth

    def _between(self, row: WearRow, past: Sequence[WearRow], before: WearState) -> WearState:
        """The first stage of a step again, as the run came to it."""
        drift, slopes = begun(self.problem, before, past, self.problem)
        searches = [Search(float(slope)) for slope in slopes]
        return first_stage(self.problem, before, row.cycles_in_step, drift, searches)

    def moved(self, state: WearState, base: np.ndarray, stretch: float) -> _Moved:
        """Derivatives of a state whose depth is `base` + stretch * rate, base (n_pair, n) by its columns."""
        problem, solved, (duty,) = self.problem, state.points[0].state, self.problem.mission
        balance = problem.in_duty(duty, state.depth)
        changes = [_worn(change, problem.balance, balance) for change in self.changes]
        jac, (n_pair, _, n_coeff), size = solved.cycle.jacobian, solved.x.shape, solved.x.size
        assert jac is not None
        normal = balance.contact.components.index("n") * n_coeff
        gap, along = -jac[:, :, normal], work_slope(balance, solved.x, solved.cycle)
        force, x = np.zeros((*gap.shape, base.shape[1])), np.zeros((size, base.shape[1]))
        gradient = Gradient(balance, solved, ())
        above, below = gradient.of_gap()
        if 2 * np.abs(above - below).max() > EXACT.corner * np.abs(above + below).max():
            self.corners.append(state.cycles)
        for i, change in enumerate(changes):
            mean = np.mean(gradient.effects(change), axis=0)
            force[..., i], x[:, i] = mean[:size].reshape(gap.shape), mean[size : 2 * size]
        by_work, falls = depth_per_work(problem, state)[:, None], -_work(balance, gap[..., None], solved.x)
        grows = by_work * state.work[:, None] * self.grows
        at_x = _work(balance, force, solved.x) - falls * self.opens  # friction work at fixed x and depth
        bend = 1 + stretch * by_work * falls
        depth = (base + stretch * (grows + by_work * at_x)) / bend
        slope = stretch * by_work / bend * along
        point, opened = balance.at(solved.omega), force + gap[..., None] * (depth + self.opens)[:, None]
        cycle = replace(solved.cycle, jacobian=jac + gap[:, :, None] * slope[:, None, :])
        right = [
            own.reshape(-1, n_coeff) - point.apply(f.reshape(-1, n_coeff))
            for own, f in zip(x.T, np.moveaxis(opened, 2, 0), strict=True)
        ]
        right.append(-balance.frequency_slope(solved)[0])
        solution = _solved(Linearisation(point, balance.reference_stiffness, solved.x, cycle), right)
        dx, by_omega = np.split(solution.reshape(n_pair, -1, len(right)), [-1], axis=2)
        depth = depth + np.einsum("pc,pcn->pn", slope, dx)
        if not isinstance(duty.site, AtFrequency):
            try:
                moves = peak_moves(balance, solved, duty.site.output, changes, duty.site.newton)
            except NoDerivative as reason:
                raise NoDerivative(f"at {state.cycles:.4g} cycles {reason}") from None
            by_gap, turn = moves[len(changes) :], np.einsum("pc,pcn->pn", slope, by_omega)
            omega = by_gap @ (depth + self.opens)
            omega[: len(changes)] += moves[: len(changes)]
            omega /= 1 - by_gap @ turn
            depth, dx = depth + turn * omega, dx + by_omega * omega
        moved = force + np.einsum("pcd,pdn->pcn", jac, dx) + gap[..., None] * (depth + self.opens)[:, None]
        rate = grows + by_work * (at_x - falls * depth + np.einsum("pc,pcn->pn", along, dx))
        return _Moved(depth, rate, moved[problem.pairs, normal].sum(axis=0))


def _work(balance: HarmonicBalance, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(n_pair, n) friction work along x of n forces (n_pair, n_component * n_coeff, n) [J]."""
    forces = np.moveaxis(force, 2, 1).reshape(len(x), -1, *x.shape[1:])
    works = balance.basis.work_per_cycle(forces, x[:, None])
    return np.asarray(works[:, :, balance.contact.tangential].sum(axis=2))


def _worn(change: Change, unworn: HarmonicBalance, balance: HarmonicBalance) -> Change:
    """A change of a worn contact."""
    opened = balance.contact.gap - unworn.contact.gap

    def there(posed: Posed) -> Posed:
        same = posed.contact is unworn.contact
        return replace(
            posed, contact=balance.contact if same else posed.contact.with_gap(posed.contact.gap + opened), balance=None
        )

    twice = None if change.twice is None else tuple(there(one) for one in change.twice)
    touching = None if change.touching is None else _worn(change.touching, unworn, balance)
    return replace(change, above=there(change.above), below=there(change.below), twice=twice, touching=touching)


def _solved(linear: Linearisation, right: Sequence[np.ndarray]) -> np.ndarray:
    """Solutions as columns (n_contact * n_coeff, n), by one factor where the balance is small enough."""
    if right[0].size <= NEWTON.most_dense:
        return np.asarray(sla.solve(linear.dense(), np.stack([one.ravel() for one in right], axis=1), overwrite_a=True))
    return np.stack([linear.solve_refined(one, 1e-8).ravel() for one in right], axis=1)
