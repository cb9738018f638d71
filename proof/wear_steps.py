"""What wear steps cost and how far they are off: both rules, against finer steps."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import process_time

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_preload
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import WearProblem
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import log_axis, positive_range
from tribodyn.workflows.pictures.theme import BLUE, GREY, ORANGE, STYLE
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import delta_max, free_deflection
from tribodyn.workflows.scene import scene_file

THESIS_STEPS = (0.1, 0.05, 0.02, 0.01, 0.005)  # of delta_max, tables 4.2 and 4.4
FINER_STEPS = (0.0025, 0.001, 0.0005)  # ours
TOLERANCES = (0.1, 0.03, 0.02, 0.01)
REFERENCE_TOLERANCES = (0.003, 0.001)
WearStep = tuple[int, int, float, float]
"""Wear iterations, seconds, largest depth [mm], its error against the finest step."""


def published_wear_steps(file: scene_file.SceneFile) -> dict[float, WearStep]:
    """Published wear runs by the largest depth of a step over delta_max; empty where the scene has none beside it."""
    path = file.folder / f"{file.name}.published.toml"
    rows = tomllib.loads(path.read_text(encoding="utf-8")).get("wear_step", []) if path.is_file() else []
    return {float(r["step"]): (r["wear_steps"], r["seconds"], r["depth_mm"], r["depth_error"]) for r in rows}


@dataclass(frozen=True)
class WearStepRow:
    """One setting: what it cost and how far it is from the reference.

    seconds : of one processor
    rule, step : "thesis" with the largest depth of a step over delta_max, or "error_controlled" with its tolerance
    depth_m : largest total depth when LIFE_SHARE of the preload is left; depth_error, life_error : relative
    roughness : largest second difference of the depth along the patch, over the depth"""

    rule: str
    step: float
    hbm_solves: int
    wear_steps: int
    seconds: float
    depth_m: float
    depth_error: float | None
    life: float
    life_error: float | None
    roughness: float
    end: str


@dataclass(frozen=True)
class WearStepTable:
    """Rows with their reference, which two finer runs of the error-controlled rule extrapolate.

    depth_uncertainty, life_uncertainty : relative difference of the reference to the finest run
    published : beside the scene, by the step"""

    scene: str
    rows: tuple[WearStepRow, ...]
    reference: WearStepRow
    depth_uncertainty: float
    life_uncertainty: float
    published: dict[float, WearStep] = field(default_factory=dict)


def compare(scene: str, say: Callable[[str], None], overrides: tuple[str, ...] = ()) -> WearStepTable:
    """Table 4.2 of the thesis with life added, the error-controlled rule beside it.

    Raises  ValueError for a scene without wear"""
    file = scene_file.read(scene, overrides)
    if file.scene.wear is None:
        raise Refusal(f"scene {file.name} has no [wear]: there is no wear step to trade")
    problem, delta = _problem(file)
    with threadpool_limits(1):
        fine = [_measure(problem, delta, "error_controlled", step, say) for step in REFERENCE_TOLERANCES]
        rows = [_measure(problem, delta, "thesis", step, say) for step in (*THESIS_STEPS, *FINER_STEPS)]
        rows += [_measure(problem, delta, "error_controlled", tolerance, say) for tolerance in TOLERANCES]
    # second order in the step, whose square the tolerance bounds: errors are proportional to the tolerance
    extrapolation = REFERENCE_TOLERANCES[1] / (REFERENCE_TOLERANCES[0] - REFERENCE_TOLERANCES[1])
    depth = fine[1].depth_m + extrapolation * (fine[1].depth_m - fine[0].depth_m)
    life = fine[1].life + extrapolation * (fine[1].life - fine[0].life)
    reference = replace(fine[1], depth_m=depth, life=life, step=0.0)

    def judged(row: WearStepRow) -> WearStepRow:
        return replace(row, depth_error=row.depth_m / depth - 1, life_error=row.life / life - 1)

    return WearStepTable(
        file.name,
        tuple(judged(row) for row in (*rows, *fine)),
        reference,
        abs(fine[1].depth_m / depth - 1),
        abs(fine[1].life / life - 1),
        published_wear_steps(file),
    )


def _problem(file: scene_file.SceneFile) -> tuple[WearProblem, float]:
    with threadpool_limits(1):
        model = modelling.build(file, Progress())
    problem = wear_run.wear_problem(file.scene, model.balance, LIFE_SHARE)
    return problem, delta_max(file.scene, free_deflection(model.balance), problem.area)


def _measure(problem: WearProblem, delta: float, rule: str, step: float, say: Callable[[str], None]) -> WearStepRow:
    clock = process_time()
    if rule == "thesis":
        worn = evolve(thesis.Rule(problem, step * delta))
    else:
        worn = evolve(error_controlled.Rule(problem, Tolerance(step, delta)))
    seconds = process_time() - clock
    life = cycles_to_preload(worn)
    say(f"{rule} {step:g}: {len(worn.cycles)} wear steps, {seconds:.1f} s, {worn.end}")
    return WearStepRow(
        rule=rule, step=step, hbm_solves=int(worn.solves.sum()), wear_steps=len(worn.cycles) - 1, seconds=seconds,
        depth_m=_depth_at_life(worn, life), depth_error=None, life=float("nan") if life is None else life,
        life_error=None, roughness=roughness(problem.balance.model.interface.points, worn.depth[-1]), end=str(worn.end),
    )  # fmt: skip


def _depth_at_life(worn: WearHistory, life: float | None) -> float:
    deepest = worn.depth.max(axis=1)
    return float(deepest[-1] if life is None else np.interp(life, worn.cycles, deepest))


def roughness(points: np.ndarray, depth: np.ndarray) -> float:
    """Largest second difference of a depth map between grid neighbours, over its largest depth.

    points : (n_pair, 3) positions on a structured, possibly graded grid [m]; depth : (n_pair,) [m]"""
    spread = np.argsort(np.ptp(points, axis=0))[-2:]
    worst = 0.0
    for direction, across in (spread, spread[::-1]):
        lines: dict[float, list[int]] = {}
        for i, point in enumerate(points):
            lines.setdefault(round(float(point[across]), 9), []).append(i)
        for line in lines.values():
            order = sorted(line, key=lambda i: points[i, direction])
            if len(order) < 3:
                continue
            s, w = points[order, direction], depth[order]
            share = (s[1:-1] - s[:-2]) / (s[2:] - s[:-2])
            straight = w[:-2] + share * (w[2:] - w[:-2])
            worst = max(worst, float(np.abs(w[1:-1] - straight).max()))
    return worst / float(depth.max()) if depth.max() > 0 else 0.0


def picture(table: WearStepTable) -> Figure:
    """Work and precision of both rules: error in life and in depth against balance solves."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.8), layout="constrained")
        panes = figure.subplots(1, 2, sharex=True)
        for pane, name, target in zip(panes, ("life", "depth"), (1e-2, 1e-3), strict=True):
            for rule, colour in (("thesis", ORANGE), ("error_controlled", BLUE)):
                rows = sorted((r for r in table.rows if r.rule == rule), key=lambda r: r.hbm_solves)
                error = [abs(getattr(r, f"{name}_error")) for r in rows]
                pane.loglog([r.hbm_solves for r in rows], error, "o-", color=colour, label=rule.replace("_", "-"))
                for row, height in zip(rows, error, strict=True):
                    at = (row.hbm_solves, height)
                    pane.annotate(f"{100 * row.step:g} %", at, (3, 4), textcoords="offset points", fontsize=7)
            pane.axhline(target, color=GREY, linestyle=":", linewidth=1)
            pane.set(title=f"{table.scene}: error in {name}", xlabel="harmonic balance solves")
            log_axis(pane.xaxis, *positive_range(np.array([row.hbm_solves for row in table.rows])))
        panes[0].set_ylabel("relative error")
        panes[0].legend(title="wear rule, step or tolerance")
    return figure


def as_text(table: WearStepTable) -> str:
    """The table for people, the published one beside it."""
    lines = [
        "rule               step   steps (thesis)  solves  seconds (thesis)   depth mm (thesis)  error    life 1e6  "
        "error   roughness"
    ]
    for row in table.rows:
        published = table.published if row.rule == "thesis" else {}
        steps, seconds, depth, _ = published.get(row.step, (None,) * 4)
        lines.append(
            f"{row.rule:17} {100 * row.step:5.3g} % {row.wear_steps:6d} {_bracket(steps, 'd'):8} {row.hbm_solves:6d} "
            f"{row.seconds:8.1f} {_bracket(seconds, 'd'):9} {1e3 * row.depth_m:8.4f} {_bracket(depth, '.4f'):9} "
            f"{_percent(row.depth_error):>7} {1e-6 * row.life:9.3f} {_percent(row.life_error):>7} "
            f"{100 * row.roughness:8.2f} %"
        )
    lines.append(
        f"reference: {1e3 * table.reference.depth_m:.4f} mm (to {100 * table.depth_uncertainty:.2f} %), "
        f"{table.reference.life:.4g} cycles (to {100 * table.life_uncertainty:.2f} %), extrapolated from the "
        f"error-controlled rule at {', '.join(f'{100 * s:g} %' for s in REFERENCE_TOLERANCES)}"
    )
    lines += [
        f"life to {_percent(abs(row.life_error))}: error-controlled {row.hbm_solves} solves, {times}"
        for row in table.rows
        if row.rule == "error_controlled" and row.life_error is not None and (times := _times(table, row))
    ]
    share = f"{100 * LIFE_SHARE:g} % of the first preload is left"
    lines.append(f"life and depth where {share}; the thesis's depth where the contact has separated")
    return "\n".join(lines)


def _times(table: WearStepTable, row: WearStepRow) -> str:
    """How many more solves the thesis's rule takes to the life error of a row, by the rows that were measured."""
    assert row.life_error is not None
    errors = {r.hbm_solves: abs(r.life_error) for r in table.rows if r.rule == "thesis" and r.life_error is not None}
    if not errors:
        return ""
    enough = [n for n, e in errors.items() if e <= abs(row.life_error)]
    solves = min(enough, default=max(errors))
    return f"the thesis's rule {'' if enough else 'more than '}{solves}: {solves / row.hbm_solves:.0f} times"


def _bracket(value: float | None, form: str) -> str:
    return "" if value is None else f"({value:{form}})"


def _percent(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.2f} %"
