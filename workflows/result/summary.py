"""The numbers of a result as plain data: for `tribodyn show --json`, for machines and for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tribodyn.hbm.continuation.parameter import FREQUENCY
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.workflows.result.answers import answers_of, values_by_name
from tribodyn.workflows.scene.schema import MeshScene

if TYPE_CHECKING:
    from tribodyn.workflows.result.result import Result

LARGEST_BEND = 0.1  # amplitude over the size of the part that a linear model describes


def summary(result: Result) -> dict[str, Any]:
    """The numbers of a result; what was not computed is None.

    Every quantity of `tribodyn.hbm.quantities` under its name: a value, or {"first": ..., "last": ...} for one of a
    cycle (before wear, or at the peak of a response that does not wear; at the end of wear; "stable": at the highest
    stable point of the response; "peak": at its peak, where wear is taken at another frequency)
    units : name -> unit of every quantity
    wear_steps, solves : steps taken and balance solves spent on wear; wear_end : why the wear ended
    peak_at_end : whether the peak is no peak, but an end of the response or a point whose peak was not found
    jumped : whether the response is a sweep that jumped at a fold, so that the curve may have a higher peak
    peak_is_stable : whether the peak of the response is stable, None where this was not asked for or is not known
    seconds : of computing, interrupted runs included
    joints : named contact -> pairs, area [m2], and its own quantities; empty where the scene names none
    verdict : quantity -> value, error, dominated_by, status, reason, stated, see result.verdict.Statement; None without
    notes : what of the scene is to be doubted, such as unusual numbers, in sentences
    changes : what each refinement changed, see result.verdict.Change"""
    return {name: plain(value) for name, value in numbers(result).items()}


def numbers(result: Result) -> dict[str, Any]:
    """The same as `summary`, with nan and inf where they are."""
    answers, facts, wear, verdict = answers_of(result), result.facts, result.wear, result.verdict
    statements = {} if verdict is None else verdict.statements
    return {
        "state": result.state,
        "finished": result.finished,
        "seconds": facts.seconds,
        **values_by_name([answer for answer in answers if not answer.joint]),
        "units": {answer.quantity.name: answer.quantity.unit for answer in answers},
        "wear_steps": result.wear_steps,
        "solves": None if wear is None or not len(wear.cycles) else int(wear.solves.sum()),
        "wear_end": None if wear is None or not len(wear.cycles) else str(wear.end),
        **{name: getattr(facts, name) for name in ("full_dofs", "model_dofs", "contact_pairs", "unknowns")},
        "delta_max": facts.delta_max,
        **_curve(result),
        "joints": {
            name: {"pairs": len(area), "area": float(area.sum())}
            | values_by_name([answer for answer in answers if answer.joint == name])
            for name, pairs in facts.joints.items()
            for area in (result.patch.area[pairs],)
        },
        "open_frequencies": facts.open_frequencies.tolist(),
        "stuck_frequencies": facts.stuck_frequencies.tolist(),
        "verdict": {name: asdict(statement) | {"stated": statement.stated} for name, statement in statements.items()}
        or None,
        "notes": list(facts.notes),
        "changes": [] if verdict is None else [asdict(change) for change in verdict.changes],
    }


def size_of(result: Result) -> float:
    """Diagonal of the box round the part [m], infinite without a mesh."""
    return float("inf") if result.part is None else float(np.linalg.norm(np.ptp(result.part.points, axis=0)))


def order_of_line(result: Result) -> int | None:
    """Engine order of an operating line, along which the frequency is that many times the speed; None for no line."""
    wheel = result.scene.wheel if isinstance(result.scene, MeshScene) else None
    return abs(wheel.engine_order) if wheel is not None and wheel.along_speed else None


def _curve(result: Result) -> dict[str, Any]:
    curve, marks = result.response, result.stability
    table: dict[str, Any] = {"harmonics": list(result.harmonics), "harmonics_error": result.facts.harmonics_error}
    names = ("response_end", "peak_at_end", "jumped", "peak_is_stable", "unstable_points", "bifurcations")
    if curve is None:
        return table | dict.fromkeys(names) | {"fold_frequencies": []}
    output, worn = curve.output_names[0], result.wear is not None and len(result.wear.omega) > 0
    table["response_end"] = str(curve.end)
    is_fixed = worn or curve.parameter_name != FREQUENCY
    table["peak_at_end"] = None if is_fixed else curve.peak(output) is None
    table["jumped"] = curve.ended is BranchEnd.JUMPED
    table["fold_frequencies"] = [float(curve.frequency[i]) for i in curve.folds]
    if marks is None:
        return table | dict.fromkeys(names[3:])
    changes = zip(marks.omega / (2 * np.pi), marks.kinds, strict=True)
    highest, is_known = curve.highest(output), marks.known
    table["peak_is_stable"] = bool(marks.stable[highest]) if is_known[highest] else None
    table["unstable_points"] = int(np.sum(is_known & ~marks.stable))
    table["bifurcations"] = [{"frequency": float(hertz), "kind": kind} for hertz, kind in changes]
    return table


def plain(value: Any) -> Any:
    """A value as JSON has it: nan and inf become None."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
