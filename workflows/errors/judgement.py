"""The verdict on a result: every quantity with its total error, by one rule from the table of measured changes.

total error = safety x change by another mesh and more modes / (1 - ratio^-order), see `RefinementLimits.total`, and
safety x change by harmonics and samples: amounts are added, so that none cancels another by chance.
How often that holds on scenes that nobody has tuned is measured by ./tribodyn prove scoreboard."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import log
from time import process_time

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.fatigue import largest_von_mises
from tribodyn.hbm.quantity import (
    CurveQuantity,
    CycleQuantity,
    ErrorKind,
    StatedQuantity,
    WearQuantity,
    of_wear_with_error,
    quantities_of,
    with_error,
)
from tribodyn.hbm.stability import floquet
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import time_comparison
from tribodyn.workflows.errors.change_table import ChangeTable, measure_changes
from tribodyn.workflows.errors.operating_states import OperatingState, place_of_peak, relative_change
from tribodyn.workflows.errors.refinement_limits import DEFAULT, RefinementLimits
from tribodyn.workflows.errors.time_comparison import MotionDifference
from tribodyn.workflows.result.answers import solved_curve, worn_contact
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement, Statement, Status, Verdict
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile


def with_verdict(file: SceneFile, model: Model, result: Result, progress: Progress) -> Result:
    """The result with its verdict: what `run` has done after everything else."""
    return replace(result, verdict=judge(file, model, result, progress))


def judge(
    file: SceneFile, model: Model, result: Result, progress: Progress, limits: RefinementLimits = DEFAULT
) -> Verdict:
    """Measure what refinements change in a finished result, and what its errors are."""
    clock = process_time()
    with progress.stage("errors"):
        table = measure_changes(file, model, result, progress.detail, limits)
    comparison: MotionDifference | str | None = None
    with progress.stage("time integration"):
        if table.first is not None and not table.in_time:
            growth = floquet.growth_by_negative_damping(table.first.balance, table.first.point.state)
            if growth is not None:
                comparison = f"negative damping feeds a vibration that grows by {growth:.2g} 1/s"
            elif time_comparison.is_checked(table.first, file.scene.verdict.in_time, limits):
                comparison = _compare(table, table.first)
            if comparison is not None and result.wear_steps and file.scene.wear is not None:
                table.rows += time_comparison.changes_along_wear(file, model.balance, result, table.wear_harmonics)
    known = None if table.first is None else table.first.values | table.in_time
    cycle_quantities = [q for q in with_error(CycleQuantity) if known is None or q.name in known]
    of_curve = [quantity for quantity in quantities_of(CurveQuantity) if unbounded(quantity, table)]
    quantities = (*cycle_quantities, *of_wear_with_error(worn_contact(result)), *of_curve)
    statements = {quantity.name: _statement(quantity, table, comparison) for quantity in quantities}
    return Verdict(statements, tuple(table.rows), table.ratio, process_time() - clock, table.worn_ratio)


def _compare(table: ChangeTable, state: OperatingState) -> MotionDifference | str | None:
    """The state before wear in time; why that is not stationary; None without an equation in time.

    Where it contradicts the balance it is repeated with time steps half as long. It leaves out no harmonic: at a
    frequency that the scene gives, values in time are stated where they differ by more than the mesh explains"""
    limits, at_frequency = table.limits, isinstance(state.site, AtFrequency)
    bounds = {name: total_error(table.of(name), table.ratio, limits)[0] for name in state.values}
    shift = 0.0 if at_frequency else min(bounds[place_of_peak()] or 0.0, limits.largest)
    if at_frequency:
        changes = {name: size(table.of(name), Refinement.MESH, Refinement.MODES) for name in bounds}
        bounds |= {name: limits.total(change, table.ratio) for name, change in changes.items()}
    try:
        comparison = time_comparison.compare(state, shift=shift)
        if comparison.contradicts(bounds):
            coarse, comparison = comparison.values, time_comparison.compare(state, 2, shift)
            if at_frequency and comparison.contradicts(bounds):
                steps = {name: relative_change(coarse[name], x) for name, x in comparison.values.items()}
                scatter, mesh = {name: x + comparison.error for name, x in steps.items()}, None
                if table.last is not None and time_comparison.is_checked(table.last, None, limits):
                    with suppress(Refusal, SolverFailure):
                        mesh = Refinement.MESH, time_comparison.compare(table.last, 2).values, "in time"
                table.take_motion(comparison.values, scatter, mesh)
    except Refusal:
        return None
    except SolverFailure as failure:
        return str(failure)
    return comparison


def _statement(quantity: StatedQuantity, table: ChangeTable, comparison: MotionDifference | str | None) -> Statement:
    """Of the state before wear, that in time where a machine leaves that of the balance, or of the whole wear."""
    result, limits, first = table.result, table.limits, table.first
    if isinstance(quantity, CycleQuantity):
        value = None if first is None else (first.values | table.in_time).get(quantity.name)
    else:
        worn_through = worn_contact(result) if result.wear_steps else None
        source = solved_curve(result) if isinstance(quantity, CurveQuantity) else worn_through
        value = None if source is None else quantity.value(source)
    if value is None:
        reason = table.reason or "no state was solved"
        if isinstance(quantity, WearQuantity):
            wear = result.wear if result.wear_steps else None
            survived = wear is not None and wear.ended.survived and quantity.error is ErrorKind.DURATION
            reason = "no life ends here" if survived else "the preload has not fallen far enough"
            reason = "nothing was worn" if wear is None else f"{reason}: {wear.end}"
        return Statement(None, None, None, Status.ABSENT, reason)
    wears, sampled = isinstance(quantity, WearQuantity), quantity.error is not ErrorKind.UNSAMPLED_CYCLE
    at_peak = first is not None and not isinstance(first.site, AtFrequency)
    if not sampled and not at_peak:
        return Statement(value, 0.0, None, Status.REPORTED, "given by the scene")
    rows = table.of(quantity.name)
    worn = wears or any(row.refinement == Refinement.COMBINED for row in rows)
    of_order = replace(limits, order=quantity.order or limits.order)
    error, reason_unknown = total_error(rows, table.worn_ratio if worn else table.ratio, of_order)
    if isinstance(quantity, CycleQuantity) and at_peak and not quantity.at_rest and error is not None:
        # compliance goes with the square of the frequency: a height that a refinement changes less agrees by chance
        moves = table.of(place_of_peak())
        moved = limits.factor(table.ratio) * size(moves, Refinement.MODES, Refinement.MESH)
        moved += limits.safety * size(moves, Refinement.HARMONICS)
        if isinstance(comparison, MotionDifference):  # where it leaves the peak, that is another one in time
            frequency, _ = total_error(moves, table.ratio, limits)
            moved += comparison.contradicts(dict.fromkeys(comparison.differences, frequency))
        error = max(error, 2 * moved if sampled else 0.0)
    dominated, reason = dominating(rows), "measured on this scene"
    if wears and comparison is None and result.wear is not None:
        unstable = result.wear.unstable_share or 0.0  # what wears there instead is not known
        error = None if error is None else error + unstable
        if unstable > limits.largest:
            return Statement(value, error, dominated, Status.UNSTABLE, f"for {unstable:.0%} of the cycles")
    elif quantity.name in table.in_time and first is not None:
        balance = first.values[quantity.name]
        reason = f"in time; the balance, {balance:.3g} {quantity.unit}, is left or has too few harmonics"
    elif not wears and isinstance(comparison, str):
        return Statement(value, error, dominated, Status.UNSETTLED, comparison)
    elif isinstance(comparison, MotionDifference) and not wears:
        names = comparison.differences if not sampled else (quantity.name,)  # no peak where the motion is another one
        if difference := comparison.contradicts({name: error for name in names}):
            reason = f"of the contact before wear, by {difference:.1%}"
            return Statement(value, error, dominated, comparison.status, reason)
    if singularity := unbounded(quantity, table):
        return Statement(value, None, dominated, Status.UNBOUNDED, singularity)
    if error is None:
        return Statement(value, None, dominated, Status.NOT_KNOWN, reason_unknown)
    if error > limits.largest:
        return Statement(value, error, dominated, Status.TOO_LARGE, "")
    return Statement(value, error, dominated, Status.REPORTED, reason)


def size(rows: Sequence[MeasuredChange], *refinements: Refinement) -> float:
    """Sum of the relative changes by some refinements, of those that were measured."""
    return sum(row.relative or 0.0 for row in rows if row.refinement in refinements)


def total_error(
    rows: Sequence[MeasuredChange], ratio: float | None, limits: RefinementLimits = DEFAULT
) -> tuple[float | None, str]:
    """Total error of a quantity from its rows, and why it is not known where it is not.

    It is no less than what the wear steps say of themselves: a coarser mesh is worn with the same steps"""
    needed = (
        Refinement.COMBINED, Refinement.MESH, Refinement.HARMONICS, Refinement.SPRINGS, Refinement.OTHER_MOTION,
    )  # fmt: skip
    unknown = [row.description for row in rows if row.relative is None and row.refinement in needed]
    if unknown or not any(row.refinement in (*needed, Refinement.MOTION) for row in rows):
        return None, (*unknown, "no refinement was measured")[0]
    least = max(size(rows, Refinement.MOTION), size(rows, Refinement.WEAR_STEPS))
    chance = least if size(rows, Refinement.MOTION) else 0.0  # then means and steps scatter
    change = max(size(rows, Refinement.COMBINED, Refinement.MESH, Refinement.MODES), chance)
    truncation = limits.safety * size(rows, Refinement.HARMONICS, Refinement.SAMPLES, Refinement.SPRINGS)
    motion = size(rows, Refinement.OTHER_MOTION, Refinement.PLACE)
    return max(limits.total(change, ratio), least) + truncation + motion, ""


def unbounded(quantity: StatedQuantity, table: ChangeTable, least: float = 0.02) -> str:
    """Why a number of the stress has no value that finer meshes come to; "" for others. One of a wear or a response
    has none where the stress before wear grows at the place that decides it.

    least : exponent of its growth with the number of elements along an edge, which comes to 0.3 at the border of a
        clamp and to 0.46 at a re-entrant right angle
    Source  Williams, J. Applied Mechanics 19 (1952) 526"""
    first, last, ratio = table.first, table.last, table.ratio
    if quantity.where is None or first is None or last is None or last.balance.stress is None or ratio is None:
        return ""
    cycles = [first.cycle, last.cycle]
    if isinstance(quantity, CycleQuantity):
        where, rows = quantity.where(cycles[1]), table.of(quantity.name)
        values = [(row.value or 0.0, row.refined or 0.0) for row in rows if row.refinement == Refinement.MESH]
    else:
        source = solved_curve(table.result) if isinstance(quantity, CurveQuantity) else worn_contact(table.result)
        where = "" if source is None else quantity.where(source)
        places = [(place, cycle) for cycle in cycles for place in cycle.places if place.name == where]
        stress = [float(largest_von_mises(place.stress(c.response, c.basis), c.basis)) for place, c in places]
        values = [(stress[0], stress[1])] if stress else []
    value, refined = values[0] if values else (0.0, 0.0)
    if min(value, refined) <= 0 or log(refined / value) / log(ratio) < least:
        return ""
    place = last.balance.stress.singularity(where)
    growth = f"{abs(refined / value - 1):.0%} {'more' if refined > value else 'less'} on a mesh {ratio:.3g} times"
    return f"{place}, {growth} as fine: round it, or name a place away from it" if place else ""


def dominating(rows: Sequence[MeasuredChange]) -> str | None:
    """The refinement that changed a quantity most."""
    counted = [row for row in rows if row.relative is not None]
    return max(counted, key=lambda row: row.relative or 0.0).refinement if counted else None
