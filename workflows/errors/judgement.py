"""The verdict on a result: every quantity with its total error, by one rule from the table of measured changes.

total error = safety x change by the combined refinement / (1 - ratio^-order), see `RefinementLimits.total`.
How often that holds on scenes that nobody has tuned is measured by ./tribodyn prove scoreboard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import process_time

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, StatedQuantity, WearQuantity, with_error
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import time_comparison
from tribodyn.workflows.errors.change_table import ChangeTable, measure_changes
from tribodyn.workflows.errors.operating_states import OperatingState
from tribodyn.workflows.errors.refinement_limits import DEFAULT, RefinementLimits
from tribodyn.workflows.errors.time_comparison import MotionDifference
from tribodyn.workflows.result.answers import worn_contact
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
    with progress.stage("time integration"):
        comparison = None
        if table.first is not None and time_comparison.is_checked(table.first, file.scene.verdict.in_time, limits):
            comparison = _compare(table.first)
        if comparison is not None and result.wear_steps and file.scene.wear is not None:
            table.rows += time_comparison.changes_along_wear(file, model.balance, result, limits)
    statements = {}
    for kind in (CycleQuantity, WearQuantity):
        for quantity in with_error(kind):
            value = _value(quantity, table, result)
            statements[quantity.name] = _statement(quantity, value, table, comparison, result, limits)
    return Verdict(statements, tuple(table.rows), table.ratio, process_time() - clock, table.worn_ratio)


def _compare(state: OperatingState) -> MotionDifference | str | None:
    """The state before wear in time; why that is not stationary; None without an equation in time."""
    try:
        return time_comparison.compare(state)
    except Refusal:
        return None
    except SolverFailure as failure:
        return str(failure)


def _value(quantity: StatedQuantity, table: ChangeTable, result: Result) -> float | None:
    """Of the state before wear, or of the whole wear."""
    if isinstance(quantity, CycleQuantity):
        return None if table.first is None else table.first.values.get(quantity.name)
    worn = worn_contact(result) if result.wear_steps else None
    return None if worn is None else quantity.value(worn)


def _statement(
    quantity: StatedQuantity, value: float | None, table: ChangeTable, comparison: MotionDifference | str | None,
    result: Result, limits: RefinementLimits,
) -> Statement:  # fmt: skip
    if value is None:
        return Statement(None, None, None, Status.ABSENT, _why_absent(quantity, table, result))
    wears, sampled = isinstance(quantity, WearQuantity), quantity.error is not ErrorKind.UNSAMPLED_CYCLE
    if not sampled and table.first is not None and isinstance(table.first.site, AtFrequency):
        return Statement(value, 0.0, None, Status.REPORTED, "given by the scene")
    rows = [row for row in table.rows if row.quantity == quantity.name]
    error, reason_unknown = total_error(rows, table.worn_ratio if wears else table.ratio, limits)
    dominated = dominating(rows)
    if wears and comparison is None and result.wear is not None:
        unstable = result.wear.unstable_share or 0.0  # what wears there instead is not known
        error = None if error is None else error + unstable
        if unstable > limits.largest:
            return Statement(value, error, dominated, Status.UNSTABLE, f"for {unstable:.0%} of the cycles")
    elif not wears and sampled and comparison is not None:
        status, reason = _judged_in_time(comparison, quantity, error)
        if status is not None:
            return Statement(value, error, dominated, status, reason)
    if error is None:
        return Statement(value, None, dominated, Status.NOT_KNOWN, reason_unknown)
    if error > limits.largest:
        return Statement(value, error, dominated, Status.TOO_LARGE, "")
    return Statement(value, error, dominated, Status.REPORTED, "measured on this scene")


def _judged_in_time(
    comparison: MotionDifference | str, quantity: StatedQuantity, error: float | None
) -> tuple[Status | None, str]:
    if isinstance(comparison, str):
        return Status.UNSETTLED, comparison
    return comparison.judge(quantity.name, error)


def total_error(
    rows: Sequence[MeasuredChange], ratio: float | None, limits: RefinementLimits = DEFAULT
) -> tuple[float | None, str]:
    """Total error of a quantity from its rows, and why it is not known where it is not.

    It is no less than what the wear steps say of themselves: a coarser mesh is worn with the same steps
    """

    def sizes(*refinements: Refinement) -> list[float]:
        return [row.relative or 0.0 for row in rows if row.refinement in refinements]

    needed = (Refinement.COMBINED, Refinement.OTHER_MOTION)
    unknown = [row.description for row in rows if row.relative is None and row.refinement in needed]
    if unknown or not sizes(Refinement.COMBINED):
        return None, (*unknown, "no refinement was measured")[0]
    least = max(sizes(Refinement.MOTION, Refinement.WEAR_STEPS), default=0.0)
    chance = least if sizes(Refinement.MOTION) else 0.0  # then means and steps scatter
    change = max(*sizes(Refinement.COMBINED), chance)
    return max(limits.total(change, ratio), least) + sum(sizes(Refinement.OTHER_MOTION)), ""


def dominating(rows: Sequence[MeasuredChange]) -> str | None:
    """The single refinement that changed a quantity most; of wear, whose mesh is not refined alone, or the combined."""
    combined = {quantity.name for quantity in with_error(WearQuantity)}
    counted = [
        row
        for row in rows
        if row.relative is not None and (row.refinement != Refinement.COMBINED or row.quantity in combined)
    ]
    return max(counted, key=lambda row: row.relative or 0.0).refinement if counted else None


def _why_absent(quantity: StatedQuantity, table: ChangeTable, result: Result) -> str:
    if isinstance(quantity, CycleQuantity):
        return table.reason or "no state was solved"
    if result.wear is None or not result.wear_steps:
        return "nothing was worn"
    if result.wear.ended.survived and quantity.error is ErrorKind.DURATION:
        return f"no life ends here: {result.wear.end}"
    return f"the preload has not fallen far enough: {result.wear.end}"
