"""States of a contact that errors are measured at, and the values of quantities there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_condition import OperatingCondition
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.quantity import CycleQuantity, SolvedCycle, with_error
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors.refinement_limits import DEFAULT, RefinementLimits
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, response_curve, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene

Values = dict[str, float]
"""Quantity -> its value, in its unit."""


@dataclass(frozen=True)
class OperatingState:
    """A solved state of the contact.

    cycles : passed; balance : at its depth of wear; point : its solution; site : how it is found
    """

    cycles: float
    balance: HarmonicBalance
    site: OperatingCondition | PeakOfCurve
    point: OperatingPoint

    @property
    def values(self) -> Values:
        """Values of the quantities of a cycle whose errors are stated."""
        cycle = SolvedCycle.of(self.balance, self.point.state, settings.OUTPUT)
        values = {quantity.name: quantity.value(cycle) for quantity in with_error(CycleQuantity)}
        return {name: value for name, value in values.items() if value is not None}

    def refined_top(self, limits: RefinementLimits = DEFAULT) -> int:
        """Highest harmonic of the refined balance."""
        return max(limits.harmonics, self.balance.basis.harmonics[-1] + 2)


@dataclass(frozen=True)
class PeakOfCurve:
    """The highest point of a response curve that turns back.

    It may be a fold, whose neighbours a search at fixed frequencies does not see: the curve is followed again.
    """

    scene: Scene

    def solve(self, balance: HarmonicBalance) -> OperatingPoint:
        """Follow the curve of a contact as the run does. Raises NoPeak, SolveFailed."""
        branch = response_curve.follow_response(self.scene, balance)
        if not branch.converged[-1]:
            raise SolveFailed(f"the frequency response {branch.end}")
        return highest_point(branch, balance)

    def solve_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The same: a neighbouring solution may lie beyond a fold."""
        return self.solve(balance)


def highest_point(branch: Branch, balance: HarmonicBalance) -> OperatingPoint:
    """The highest point of a response curve, as it is; raises NoPeak where that is an end of it."""
    best = _peak(branch)
    state = balance.evaluate(float(branch.omega[best]), balance.shaped(branch.contact[best]))
    height = branch.amplitude(branch.output_names[0])
    return OperatingPoint.of(balance, Solution(state, CONVERGED, 0, 0, ()), branch.output_names[0], len(height))


def _peak(branch: Branch) -> int:
    best = branch.peak(branch.output_names[0])
    if best is None:
        raise NoPeak(f"no peak: {branch.no_peak(branch.output_names[0])}")
    return best


def turns_back(branch: Branch) -> bool:
    """Whether a response curve has folds."""
    forward = np.diff(branch.omega) > 0
    return bool(forward.any() and not forward.all())


def first_state(file: SceneFile, balance: HarmonicBalance, result: Result) -> OperatingState:
    """The state of a result before wear: where it begins to wear, or the peak of its response.

    Raises  NoPeak; Refusal where there is no contact; SolverFailure where no solution is found
    """
    if not balance.contact.n_pair:
        raise Refusal("there is no contact")
    wear = result.wear
    if wear is not None and len(wear.cycles) and file.scene.wear is not None:
        return worn_state(file, balance, result, 0)
    if result.response is None:
        raise Refusal("there is no response")
    return state_at_peak(file.scene, balance, result.response)


def state_at_peak(scene: Scene, balance: HarmonicBalance, branch: Branch) -> OperatingState:
    """The state at the peak of a response; raises NoPeak, or SolverFailure where no solution is found."""
    if turns_back(branch):
        return OperatingState(0.0, balance, PeakOfCurve(scene), highest_point(branch, balance))
    best, site = _peak(branch), settings.peak_of(scene)
    point = site.solve_near(balance, float(branch.omega[best]), balance.shaped(branch.contact[best]))
    return _checked(OperatingState(0.0, balance, site, point))


def worn_state(file: SceneFile, balance: HarmonicBalance, result: Result, row: int) -> OperatingState:
    """The state of a wear row, solved again from what the row holds; raises SolverFailure without a solution."""
    wear = result.wear
    assert wear is not None
    duty = settings.mission(file.scene)[0]
    basis = HarmonicBasis(result.harmonics, balance.basis.n_samples)
    worn = balance.with_gap(balance.contact.gap + wear.depth[row]).with_load(duty.load)
    x = balance.shaped(basis.transfer(wear.displacement[row], balance.basis))
    point = duty.site.solve_near(worn, float(wear.omega[row]), x)
    return _checked(OperatingState(float(wear.cycles[row]), worn, duty.site, point))


def later_rows(result: Result) -> list[int]:
    """Wear rows halfway through the life and near its end."""
    wear = result.wear
    if wear is None or len(wear.cycles) < 3:
        return []
    loaded = np.flatnonzero(wear.preload > LIFE_SHARE * wear.preload[0]) if wear.preload[0] > 0 else np.arange(1)
    last = int(loaded[-1]) if len(loaded) else 0
    half = int(np.searchsorted(wear.cycles[: last + 1], wear.cycles[last] / 2, "right")) - 1
    return sorted({half, last} - {0})


def unworn_state(
    file: SceneFile, model: modelling.Model, reference: OperatingCondition | PeakOfCurve | None = None
) -> OperatingState:
    """The contact of a model before wear, its operating point searched from the start.

    reference : how the state of the scene was found: the peak of a curve that turns back is searched on the curve
    Raises  NoPeak, Refusal where it has no peak; SolverFailure where it has no solution
    """
    scene = file.scene
    site: OperatingCondition | PeakOfCurve = settings.peak_of(scene)
    site = PeakOfCurve(scene) if isinstance(reference, PeakOfCurve) else site
    load = 1.0
    if scene.wear is not None:
        duty = settings.mission(scene)[0]
        site, load = duty.site, duty.load
    balance = model.balance.with_load(load)
    return _checked(OperatingState(0.0, balance, site, site.solve(balance)))


def with_more_harmonics(state: OperatingState, top: int) -> OperatingState:
    """A state with all harmonics up to `top`, followed from its own solution.

    Raises  NoPeak; SolverFailure without a solution
    """
    wide = harmonic_choice.widened(state.balance, top, harmonic_choice.ROUGH)
    wide = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= top))
    x = state.balance.basis.transfer(state.point.state.x, wide.basis)
    point = state.site.solve_near(wide, state.point.state.omega, x)
    if not point.solution.converged:  # no solution is near: the operating point is searched from the start
        point = state.site.solve(wide)
    return _checked(replace(state, balance=wide, point=point))


def _checked(state: OperatingState) -> OperatingState:
    if not state.point.solution.converged:
        raise SolverFailure(str(state.point.solution.outcome))
    return state


def relative_change(value: float, refined: float) -> float:
    """Difference over the refined value; where that vanishes, 0 if both do and 1 if not."""
    if refined == 0:
        return 0.0 if value == 0 else 1.0
    return abs(value - refined) / abs(refined)
