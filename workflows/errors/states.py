"""States of a contact that errors are measured at, and what their solutions answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_point import NoPeak, OperatingPoint
from tribodyn.hbm.continuation.sites import Site
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors.options import DEFAULT, Options
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import curve, modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene

Answers = dict[str, float]
"""What one solved cycle answers, by names of result.verdict.QUANTITIES and in their units."""


def answers_of(balance: HarmonicBalance, point: OperatingPoint) -> Answers:
    """The answers of a solved operating point."""
    state = point.state
    return {
        "peak_frequency": state.omega / (2 * np.pi),
        "amplitude": point.amplitude,
        "energy": float(balance.energy(state).sum()),
        "preload": balance.preload(state),
    }


@dataclass(frozen=True)
class State:
    """A solved state of the contact.

    cycles : passed; balance : at its depth of wear; here : its solution; site : how it is found
    """

    cycles: float
    balance: HarmonicBalance
    site: Site | OnCurve
    here: OperatingPoint

    @property
    def answers(self) -> Answers:
        """What it answers."""
        return answers_of(self.balance, self.here)

    def top(self, options: Options = DEFAULT) -> int:
        """Highest harmonic of the refined balance."""
        return max(options.harmonics, self.balance.basis.harmonics[-1] + 2)


@dataclass(frozen=True)
class OnCurve:
    """The highest point of a response curve that turns back.

    It may be a fold, whose neighbours a search at given frequencies does not see: the curve is followed again.
    """

    scene: Scene

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Follow the curve of a contact as the run does. Raises NoPeak, SolveFailed."""
        branch = curve.follow_response(self.scene, balance)
        if not branch.converged[-1]:
            raise SolveFailed(f"the frequency response {branch.end}")
        return highest_of(branch, balance)

    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The same: a neighbouring solution may lie beyond a fold."""
        return self.first(balance)


def highest_of(branch: Branch, balance: HarmonicBalance) -> OperatingPoint:
    """The highest point of a response curve, as it is; raises NoPeak where that is an end of it."""
    best = _highest(branch)
    state = balance.evaluate(float(branch.omega[best]), balance.shaped(branch.contact[best]))
    height = branch.amplitude(branch.output_names[0])
    return OperatingPoint.of(balance, Solution(state, CONVERGED, 0, 0, ()), branch.output_names[0], len(height))


def _highest(branch: Branch) -> int:
    best = branch.peak(branch.output_names[0])
    if best is None:
        raise NoPeak(f"no peak: {branch.no_peak(branch.output_names[0])}")
    return best


def turns_back(branch: Branch) -> bool:
    """Whether a response curve has folds."""
    forward = np.diff(branch.omega) > 0
    return bool(forward.any() and not forward.all())


def first_state(file: SceneFile, balance: HarmonicBalance, result: Result) -> State:
    """The unworn state of a result: where it begins to wear, or the peak of its response.

    Raises  NoPeak; ValueError where there is no contact; RuntimeError where no solution is found
    """
    if not balance.contact.n_pair:
        raise Refusal("there is no contact")
    wear = result.wear
    if wear is not None and len(wear.cycles) and file.scene.wear is not None:
        return worn_state(file, balance, result, 0)
    if result.response is None:
        raise Refusal("there is no response")
    return at_highest(file.scene, balance, result.response)


def at_highest(scene: Scene, balance: HarmonicBalance, branch: Branch) -> State:
    """The state at the peak of a response; raises NoPeak, or RuntimeError where no solution is found."""
    if turns_back(branch):
        return State(0.0, balance, OnCurve(scene), highest_of(branch, balance))
    best, site = _highest(branch), settings.peak_of(scene)
    point = site.next(balance, float(branch.omega[best]), balance.shaped(branch.contact[best]))
    return _solved(State(0.0, balance, site, point))


def worn_state(file: SceneFile, balance: HarmonicBalance, result: Result, row: int) -> State:
    """The state of a wear row, solved again from what the row holds; raises RuntimeError without a solution."""
    wear = result.wear
    assert wear is not None
    duty = settings.mission(file.scene)[0]
    basis = HarmonicBasis(result.harmonics, balance.basis.n_samples)
    worn = balance.with_gap(balance.contact.gap + wear.depth[row]).with_load(duty.load)
    x = balance.shaped(basis.transfer(wear.displacement[row], balance.basis))
    return _solved(State(float(wear.cycles[row]), worn, duty.site, duty.site.next(worn, float(wear.omega[row]), x)))


def later_rows(result: Result) -> list[int]:
    """Wear rows halfway through the life and near its end."""
    wear = result.wear
    if wear is None or len(wear.cycles) < 3:
        return []
    left = np.flatnonzero(wear.preload > LIFE_SHARE * wear.preload[0]) if wear.preload[0] > 0 else np.arange(1)
    last = int(left[-1]) if len(left) else 0
    half = int(np.searchsorted(wear.cycles[: last + 1], wear.cycles[last] / 2, "right")) - 1
    return sorted({half, last} - {0})


def unworn(file: SceneFile, model: modelling.Model, like: Site | OnCurve | None = None) -> State:
    """The unworn contact of a model, its place looked for anew.

    like : the place of the scene's own state: the highest point of a curve that turns back is looked for on the curve
    Raises  NoPeak, ValueError where it has no peak; RuntimeError where it has no solution
    """
    scene = file.scene
    site: Site | OnCurve = OnCurve(scene) if isinstance(like, OnCurve) else settings.peak_of(scene)
    load = 1.0
    if scene.wear is not None:
        duty = settings.mission(scene)[0]
        site, load = duty.site, duty.load
    balance = model.balance.with_load(load)
    return _solved(State(0.0, balance, site, site.first(balance)))


def widened(state: State, top: int) -> State:
    """A state with all harmonics up to one, followed from its own solution; raises NoPeak, RuntimeError without one."""
    wide = harmonic_choice.widened(state.balance, top, harmonic_choice.ROUGH)
    wide = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= top))
    x = state.balance.basis.transfer(state.here.state.x, wide.basis)
    point = state.site.next(wide, state.here.state.omega, x)
    if not point.solution.converged:  # no solution is near: the place is looked for as at the start
        point = state.site.first(wide)
    return _solved(State(state.cycles, wide, state.site, point))


def _solved(state: State) -> State:
    if not state.here.solution.converged:
        raise SolverFailure(str(state.here.solution.outcome))
    return state


def relative(ours: float, theirs: float) -> float:
    """Difference over the better value; where that vanishes, 0 if both do and 1 if not."""
    if theirs == 0:
        return 0.0 if ours == 0 else 1.0
    return abs(ours - theirs) / abs(theirs)
