"""States of a contact that errors are measured at, and the values of quantities there and of a whole wear run."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_condition import OperatingCondition
from tribodyn.hbm.continuation.operating_point import AtFrequency, OperatingPoint
from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED, SolveEnd
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle, WornContact, of_wear_with_error, with_error
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.refusal import Refusal, SolveFailed, SolverFailure
from tribodyn.workflows.errors.refinement_limits import RefinementLimits
from tribodyn.workflows.result.answers import EVENT_SAMPLES
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, response_curve, settings, wear_run
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene

Values = dict[str, float]
"""Quantity -> its value, in its unit."""


@dataclass(frozen=True)
class OperatingState:
    """A solved state of the contact.

    cycles : passed; balance : at its depth of wear; point : its solution; site : how it is found"""

    cycles: float
    balance: HarmonicBalance
    site: OperatingCondition | PeakOfCurve
    point: OperatingPoint

    @cached_property
    def cycle(self) -> SolvedCycle:
        """The solved cycle, whose quantities are stated."""
        return SolvedCycle.of(self.balance, self.point.state, settings.OUTPUT)

    @cached_property
    def values(self) -> Values:
        """Values of the quantities of a cycle whose errors are stated."""
        return values_of(self.cycle)


def values_of(cycle: SolvedCycle) -> Values:
    """Values of the quantities of a cycle whose errors are stated."""
    values = {quantity.name: quantity.value(cycle) for quantity in with_error(CycleQuantity)}
    return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class PeakOfCurve:
    """The highest point of a response curve that turns back.

    It may be a fold, whose neighbours a search at fixed frequencies does not see: the curve is followed again."""

    scene: Scene

    def solve(self, balance: HarmonicBalance) -> OperatingPoint:
        """Follow the curve of a contact as the run does. Raises NoPeak, SolveFailed."""
        branch = response_curve.follow_response(self.scene, balance)
        if not branch.converged[-1]:
            raise SolveFailed(f"the frequency response {branch.end}")
        if reason := branch.no_peak(settings.OUTPUT):
            raise NoPeak(f"no peak: {reason}")
        return highest_point(branch, balance)

    def solve_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The same: a neighbouring solution may lie beyond a fold."""
        return self.solve(balance)


def highest_point(branch: Branch, balance: HarmonicBalance) -> OperatingPoint:
    """The highest point of a response curve, as it is."""
    best = branch.highest(settings.OUTPUT)
    state = balance.evaluate(float(branch.omega[best]), balance.shaped(branch.contact[best]))
    return OperatingPoint.of(balance, Solution(state, CONVERGED, 0, 0, ()), settings.OUTPUT, len(branch.omega))


def turns_back(branch: Branch) -> bool:
    """Whether a response curve has folds."""
    forward = np.diff(branch.omega) > 0
    return bool(forward.any() and not forward.all())


def first_state(file: SceneFile, balance: HarmonicBalance, result: Result) -> OperatingState:
    """The state of a result before wear: where it begins to wear, or the peak of its response.

    Raises  Refusal where there is no contact or no response; SolverFailure where no solution is found"""
    if not balance.contact.n_pair:
        raise Refusal("there is no contact")
    wear = result.wear
    if wear is not None and len(wear.cycles) and file.scene.wear is not None:
        return worn_state(file, balance, result, 0)
    if result.response is None:
        raise Refusal("there is no response")
    return state_at_peak(file.scene, balance, result.response)


def state_at_peak(scene: Scene, balance: HarmonicBalance, branch: Branch) -> OperatingState:
    """The state at the highest point of a response; one that is no peak is solved at its frequency.

    Raises  NoPeak where nothing limits a resonance"""
    if any(outcome.kind is SolveEnd.UNLIMITED for outcome in branch.outcome):
        raise NoPeak(f"no peak: {branch.no_peak(settings.OUTPUT)}")
    point = highest_point(branch, balance)
    site: OperatingCondition | PeakOfCurve = settings.peak_of(scene)
    if branch.no_peak(settings.OUTPUT):
        site = AtFrequency(settings.OUTPUT, point.state.omega, settings.newton_options(scene))
    elif turns_back(branch):
        site = PeakOfCurve(scene)
    return OperatingState(0.0, balance, site, point)


def worn_state(file: SceneFile, balance: HarmonicBalance, result: Result, row: int) -> OperatingState:
    """The state of a wear row, solved again from what the row holds; raises SolverFailure without a solution."""
    wear = result.wear
    assert wear is not None
    duty = settings.mission(file.scene)[0]
    basis = HarmonicBasis(result.harmonics, balance.basis.n_samples)
    worn = balance.worn(wear.depth[row]).with_load(duty.load)
    x = balance.shaped(basis.transfer(wear.displacement[row], balance.basis))
    point = duty.site.solve_near(worn, float(wear.omega[row]), x)
    return require_solved(OperatingState(float(wear.cycles[row]), worn, duty.site, point))


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

    reference : how the state of the scene was found: the peak of a curve that turns back is searched on the curve, a
        highest point that is no peak is solved for at its frequency
    Raises  NoPeak, Refusal where it has no peak; SolverFailure where it has no solution"""
    scene = file.scene
    site = PeakOfCurve(scene) if isinstance(reference, PeakOfCurve) else reference or settings.peak_of(scene)
    load = 1.0
    if scene.wear is not None:
        duty = settings.mission(scene)[0]
        site, load = duty.site, duty.load
    balance = model.balance.with_load(load)
    return require_solved(OperatingState(0.0, balance, site, site.solve(balance)))


def require_solved(state: OperatingState) -> OperatingState:
    """A state with its solution; raises SolverFailure where it has none."""
    if not state.point.solution.converged:
        raise SolverFailure(str(state.point.solution.outcome))
    return state


def changes_near_peak(state: OperatingState, site: AtPeak) -> Values:
    """Relative changes of the quantities of a peak to both ends of where its search may end; the larger ones."""
    balance, peak, values = state.balance, state.point.state, state.values
    changes, reach = dict.fromkeys(values, 0.0), 2 * site.correction(balance, peak).accuracy
    for omega in (peak.omega - reach, peak.omega + reach):
        solution = newton.solve(balance, omega, peak.x, site.newton)
        if solution.converged:
            for name, value in values_of(SolvedCycle.of(balance, solution.state, settings.OUTPUT)).items():
                changes[name] = max(changes[name], relative_change(value, values[name]))
    return changes


def relative_change(value: float, refined: float) -> float:
    """Difference over the refined value; where that vanishes, 0 if both do and 1 if not."""
    if refined == 0:
        return 0.0 if value == 0 else 1.0
    return abs(value - refined) / abs(refined)


def place_of_peak() -> str:
    """Name of the quantity that says where a peak is: samples of the contact law do not move it."""
    return next(q.name for q in with_error(CycleQuantity) if q.error is ErrorKind.UNSAMPLED_CYCLE)


def worn_values(worn: WornContact | None) -> Values | None:
    """Values of a contact worn through; None where a quantity has none, as where no life has ended."""
    values = {q.name: None if worn is None else q.value(worn) for q in of_wear_with_error(worn)}
    complete = {name: value for name, value in values.items() if value is not None}
    return complete if len(complete) == len(values) else None


def values_through(worn: WornContact) -> Values:
    """The same of a contact that is worn through. Raises SolverFailure where no life ends."""
    values = None if worn.history.ended.failed else worn_values(worn)
    if values is None:
        raise SolverFailure(str(worn.history.end))
    return values


def values_before(worn: WornContact) -> Values:
    """Values of a cycle before wear, as a wear run begins with it, along its motion in time where it does so."""
    cycle = SolvedCycle.at_row(worn.history, 0, worn.basis, {})
    values = {q.name: q.value(cycle) for q in with_error(CycleQuantity) if q.error is not ErrorKind.UNSAMPLED_CYCLE}
    return {name: value for name, value in values.items() if value is not None}


def worn_by(file: SceneFile, model: modelling.Model, start: OperatingState | None = None) -> WornContact:
    """The contact of a scene worn as it says; start : state of its mesh before wear, None where it is searched."""
    wear, interface = file.scene.wear, model.balance.model.interface
    assert wear is not None
    basis, place = model.balance.basis, None
    if start is not None:
        place = start.point.state.omega, start.balance.basis.transfer(start.point.state.x, basis)
    return WornContact(
        wear_run.worn_out(file, model, wear.lost_below, place), interface.area, interface.gap, interface.components,
        HarmonicBasis(basis.harmonics, max(EVENT_SAMPLES, 2 * basis.harmonics[-1] + 1)), model.reduced.joints,
        wear.lost_below or LIFE_SHARE, wear.lost_of == "any", wear.split, places=model.balance.places,
        shares=tuple(duty.share for duty in wear.duties),
    )  # fmt: skip


def refine_harmonics(state: OperatingState, limits: RefinementLimits) -> tuple[OperatingState, Values]:
    """Take in what the contact force of a state requires, as many harmonics as the limits allow.

    Evaluated with many harmonics it has a part at those that the balance leaves out. Sent through the compliance at
    these frequencies, it changes the response: one Newton step tells by how much. Those that matter are taken in and
    the state is solved again, until what is left out changes no quantity by more than the least error that is stated.

    Where they matter much another peak may be the highest: the response is scanned for it
    Returns the state with them, and relative changes that the others would still make, by quantity
    Raises  NoPeak; SolverFailure where there is no solution with the first of them"""
    components, refined = state.balance.contact.stiffness.size, state
    highest = int(min(limits.highest, max(5, 2 * limits.max_unknowns / components)))
    rounds = 1 if isinstance(state.site, PeakOfCurve) else limits.harmonic_rounds
    for repeat in range(rounds + 1):
        estimate, remaining = _estimated(refined, highest)
        required = estimate.required(limits.harmonic_share * limits.floor, highest)
        if repeat == 0:
            error = estimate.error
        if repeat == rounds or max(remaining.values()) <= limits.floor or not required:
            break
        try:
            refined = with_harmonics(refined, (*refined.balance.basis.harmonics, *required), highest)
        except (Refusal, SolverFailure):
            if refined is state:
                raise
            break
    is_small = 4 * refined.balance.n_unknown <= limits.max_unknowns
    if error > limits.searched and isinstance(state.site, AtPeak) and is_small:
        with suppress(Refusal, SolverFailure):
            higher = state.site.dominant_peak(refined.balance, refined.point).point
            if higher is not None and higher.amplitude > refined.point.amplitude:
                refined = replace(refined, point=higher)
                _, remaining = _estimated(refined, highest)
    return refined, remaining


def with_harmonics(state: OperatingState, harmonics: tuple[int, ...], highest: int = 0) -> OperatingState:
    """A state with other harmonics, followed from its own solution; highest : of the states to come.

    Raises  NoPeak; SolverFailure without a solution"""
    balance = _widened(state, max(highest, *harmonics)).with_harmonics(tuple(sorted(set(harmonics))))
    x = state.balance.basis.transfer(state.point.state.x, balance.basis)
    point = state.site.solve_near(balance, state.point.state.omega, x)
    if not point.solution.converged:  # no solution is near: the operating point is searched from the start
        point = state.site.solve(balance)
    return require_solved(replace(state, balance=balance, point=point))


def _widened(state: OperatingState, highest: int) -> HarmonicBalance:
    """The balance of a state with all harmonics to half as many again as `highest`, and samples enough for them."""
    basis = state.balance.basis
    balance = state.balance.with_samples(max(basis.n_samples, 6 * highest), basis.transitions == "located")
    return harmonic_choice.widened(balance, highest, harmonic_choice.ROUGH)


def _estimated(state: OperatingState, highest: int) -> tuple[harmonic_choice.Estimate, Values]:
    """What the harmonics left out would change, and that as relative changes of the quantities.

    The step is one at a fixed frequency: that of a peak is taken to move by as much as the response changes"""
    wide, point, values = _widened(state, highest), state.point.state, state.values
    estimate = harmonic_choice.estimate(wide, state.balance.basis.harmonics, point.omega, point.x)
    changed = values_of(SolvedCycle.of(wide, wide.evaluate(point.omega, estimate.x, jacobian=False), settings.OUTPUT))
    remaining = {name: relative_change(value, changed[name]) for name, value in values.items()}
    if not isinstance(state.site, AtFrequency):
        remaining[place_of_peak()] = estimate.error
    return estimate, remaining
