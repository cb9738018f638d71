"""The verdict on a result: every quantity with its total error, by one rule from the table of measured changes.

total error = safety x change by the combined refinement / (1 - ratio^-order), see `options.Options.total`.
How often that holds on scenes that nobody has tuned is measured by ./tribodyn prove scoreboard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import process_time

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.workflows.errors import in_time
from tribodyn.workflows.errors.in_time import Left
from tribodyn.workflows.errors.measure import OF_WEAR, Table, measure
from tribodyn.workflows.errors.options import DEFAULT, Options
from tribodyn.workflows.errors.states import State
from tribodyn.workflows.result import summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import QUANTITIES, Change, Refinement, Statement, Status, Verdict
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile


def with_verdict(file: SceneFile, model: Model, result: Result, progress: Progress) -> Result:
    """The result with its verdict: what `run` has done after everything else."""
    return replace(result, verdict=judge(file, model, result, progress))


def judge(file: SceneFile, model: Model, result: Result, progress: Progress, options: Options = DEFAULT) -> Verdict:
    """Measure what refinements change in a finished result, and what its errors are."""
    clock = process_time()
    with progress.stage("errors"):
        table = measure(file, model, result, progress.detail, options)
    with progress.stage("time integration"):
        look = None
        if table.first is not None and in_time.is_checked(table.first, file.scene.verdict.in_time, options):
            look = _look(table.first)
        if look is not None and result.wear_steps and file.scene.wear is not None:
            table.rows += in_time.rows(file, model.balance, result, options)
    values = values_of(table, result)
    statements = {name: _statement(name, values[name], table, look, result, options) for name in QUANTITIES}
    return Verdict(statements, tuple(table.rows), table.ratio, process_time() - clock, table.worn_ratio)


def _look(state: State) -> Left | str | None:
    """The unworn state beside what a machine does, why that does not settle, None without an equation in time."""
    try:
        return in_time.left(state)
    except ValueError:
        return None
    except RuntimeError as refusal:
        return str(refusal)


def values_of(table: Table, result: Result) -> dict[str, float | None]:
    """The quantities of a result: of its unworn state, and of its whole wear."""
    values: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    if table.first is not None:
        values |= table.first.answers
    if result.wear is not None and result.wear_steps:
        values["depth"] = float(result.depth_after(-1).max())
        values["life"] = summary.life(result)
    return values


def _statement(
    name: str, value: float | None, table: Table, look: Left | str | None, result: Result, options: Options
) -> Statement:
    if value is None:
        return Statement(None, None, None, Status.ABSENT, _absent(name, table, result))
    if name == "peak_frequency" and table.first is not None and isinstance(table.first.site, AtFrequency):
        return Statement(value, 0.0, None, Status.REPORTED, "given by the scene")
    own = [row for row in table.rows if row.quantity == name]
    error, why = error_of(own, table.worn_ratio if name in OF_WEAR else table.ratio, options)
    dominated = dominating(own)
    if name in OF_WEAR and look is None and result.wear is not None:
        unstable = result.wear.unstable_share or 0.0  # what a machine wears there instead is not known
        error = None if error is None else error + unstable
        if unstable > options.largest:
            return Statement(value, error, dominated, Status.UNSTABLE, f"for {unstable:.0%} of the cycles")
    elif name not in (*OF_WEAR, "peak_frequency") and look is not None:
        status, reason = (Status.UNSETTLED, look) if isinstance(look, str) else look.judged(name, error)
        if status is not None:
            return Statement(value, error, dominated, status, reason)
    if error is None:
        return Statement(value, None, dominated, Status.NOT_KNOWN, why)
    if error > options.largest:
        return Statement(value, error, dominated, Status.TOO_LARGE, "")
    return Statement(value, error, dominated, Status.REPORTED, "measured on this scene")


def error_of(rows: Sequence[Change], ratio: float | None, options: Options = DEFAULT) -> tuple[float | None, str]:
    """Total error of a quantity from its rows, and why it is not known where it is not.

    It is no less than what the wear steps say of themselves: a coarser mesh is worn with the same steps
    """

    def sizes(*of: Refinement) -> list[float]:
        return [row.relative or 0.0 for row in rows if row.refinement in of]

    needed = (Refinement.COMBINED, Refinement.OTHER_MOTION)
    unknown = [row.how for row in rows if row.relative is None and row.refinement in needed]
    if unknown or not sizes(Refinement.COMBINED):
        return None, (*unknown, "no refinement was measured")[0]
    least = max(sizes(Refinement.MOTION, Refinement.WEAR_STEPS), default=0.0)
    chance = least if sizes(Refinement.MOTION) else 0.0  # then means and steps scatter
    change = max(*sizes(Refinement.COMBINED), chance)
    return max(options.total(change, ratio), least) + sum(sizes(Refinement.OTHER_MOTION)), ""


def dominating(rows: Sequence[Change]) -> str | None:
    """The single refinement that changed a quantity most; of wear, whose mesh is not refined alone, or the combined."""
    known = [row for row in rows if row.relative is not None]
    counted = [row for row in known if row.refinement != Refinement.COMBINED or row.quantity in OF_WEAR]
    return max(counted, key=lambda row: row.relative or 0.0).refinement if counted else None


def _absent(name: str, table: Table, result: Result) -> str:
    if name not in OF_WEAR:
        return table.why or "no state was solved"
    if result.wear is None or not result.wear_steps:
        return "nothing was worn"
    if result.wear.ended.survived and name == "life":
        return f"no life ends here: {result.wear.end}"
    return f"the preload has not fallen far enough: {result.wear.end}"
