"""Convergence with the settings of a scene: how far each is from where its answers tend to, and what it costs.

The limit is Richardson's, a power of the size fitted to the three finest settings, where they settle. Contact forces
have kinks where the contact begins to slip and to lift, and it is chance where these lie between the nodes: answers
scatter with the grid. A ladder may have each grid with its nodes placed otherwise too, as settings of the same size.
Friction work on the finest grid is carried to each coarser one, so that differences can be mapped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import fspath
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator
from matplotlib.tri import Triangulation
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from tribodyn.hbm.quantity import names_with_error, quantity_named
from tribodyn.refusal import Refusal
from tribodyn.workflows.errors.ladder_table import (
    SOLVED,
    LadderRow,
    LadderTable,
    LadderTables,
    SolvedSetting,
    measure_ladders,
)
from tribodyn.workflows.pictures.theme import CYCLE, GREY, INK, STYLE
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

TARGET_ERROR = 0.01
FLAT = 1e-6  # area over the mean one of a triangle that is no part of a map
MOST_SHOWN = 0.98  # share of the nodes whose difference is within the colours of a map
FLOOR = 1e-8  # errors below this are drawn here
MARKERS = "osD^v<>PX*hp"


@dataclass(frozen=True, repr=False)
class Convergence(StudyResult):
    """The settings of a scene, measured."""

    table: LadderTables

    def record(self) -> list[dict[str, Any]]:
        """For machines: one row for each setting, with its errors and what is doubtful about their limits."""
        return [_record(self.table.scene, ladder, row) for ladder in self.table.ladders for row in ladder.rows]

    def lines(self) -> list[str]:
        """For people: tables, limits with their orders, the setting that a wanted accuracy needs, what to use."""
        texts = [line for ladder in self.table.ladders for line in _lines(ladder)]
        return [*texts, *_advice(self.table)]

    def plot(self) -> Figure:
        """Draw errors against seconds, with the cheapest settings of all ladders together."""
        return costs(self.table)

    def write(self, folder: Path) -> list[Path]:
        """Write a picture of what the settings cost, and of each ladder of grids or meshes one."""
        grids = [ladder for ladder in self.table.ladders if len({len(row.solved.area) for row in ladder.rows}) > 1]
        drawn = {
            f"converge_{self.table.scene}_{ladder.ladder.name}": picture(self.table.scene, ladder) for ladder in grids
        }
        return write_files(folder, {}, {f"converge_{self.table.scene}": self.plot(), **drawn})


def converge(
    scene: AnyPath, *, settings: Sequence[str] = (), most: int = 99, overrides: Overrides = (), progress: Report = None
) -> Convergence:
    """Measure how far each setting of a scene is from where its answers tend to, and what it costs.

    scene : name of a scene or a .toml file, with its own ladders of grids and settings in NAME.study.toml beside it
    settings : ladder to measure, can be repeated. All by default
    most : settings of each ladder, the coarsest ones
    """
    if most < 1:
        raise Refusal(f"--most {most}: a ladder needs one setting at least")
    texts, say = override_texts(overrides), reporter(progress).say
    return Convergence(measure_ladders(fspath(scene), settings, texts, say, most))


def on_grid(fine: np.ndarray, field: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """A field (n_fine,) at fine (n_fine, 2) carried to the nodes coarse (n_coarse, 2): linear, nearest at the rim."""
    centre = fine.mean(axis=0)
    within = centre + (1 - 1e-6) * (coarse - centre)  # rounding must not put the rim outside, or into slivers along it
    inside = LinearNDInterpolator(fine, field)(within)
    return np.where(np.isnan(inside), NearestNDInterpolator(fine, field)(coarse), inside)


def map_difference(coarse: SolvedSetting, fine: SolvedSetting) -> float:
    """R.m.s. difference of friction work per area over its r.m.s. on the finer grid, by area of the coarser one."""
    reference = on_grid(fine.patch, fine.work, coarse.patch)
    size = float(coarse.area @ reference**2)
    return float(np.sqrt(coarse.area @ (coarse.work - reference) ** 2 / size)) if size > 0 else 0.0


def _record(scene: str, ladder: LadderTable, row: LadderRow) -> dict[str, Any]:
    measured = row.solved
    return plain(
        {
            "scene": scene, "ladder": ladder.ladder.name, "setting": row.setting.label, "size": row.setting.size,
            "of_the_scene": row.setting.label == ladder.scene_setting, "overrides": list(row.setting.overrides),
            "pairs": len(measured.area),
            "values": measured.values, "errors": {q: ladder.error(row, q) for q in names_with_error()},
            "bounds": {q: ladder.bound(row, q) for q in names_with_error()},
            "orders": {q: limit.order for q, limit in ladder.limits.items()},
            "map_difference": _difference(ladder, row),
            "seconds": measured.seconds, "share": row.share, "memory": measured.memory, "outcome": measured.outcome,
        }
    )  # fmt: skip


def _difference(ladder: LadderTable, row: LadderRow) -> float | None:
    """Of the map of a row from that of the finest grid; None of the grids that are as fine."""
    shown = [m for m in (other.solved for other in ladder.rows) if m.values["energy"]]
    if not shown or not row.solved.values["energy"] or len(row.solved.area) == len(shown[-1].area):
        return None
    return map_difference(row.solved, shown[-1])


def _lines(ladder: LadderTable) -> Iterator[str]:
    shown = [q for q in names_with_error() if q in ladder.limits]
    width = max(len(ladder.ladder.name), *(len(row.setting.label) for row in ladder.rows))
    yield _line(ladder.ladder.name.ljust(width), "pairs", "seconds", "MB", [_name(q) for q in shown], "map")
    for row in ladder.rows:
        measured, off = row.solved, _difference(ladder, row)
        failed = "" if measured.outcome == SOLVED else f"  {measured.outcome}"
        cells = [_cell(ladder, row, q) for q in shown]
        numbers = str(len(measured.area)), f"{measured.seconds:.2f}", f"{measured.memory / 1e6:.0f}"
        yield _line(row.setting.label.ljust(width), *numbers, cells, ("" if off is None else f"{off:.1%}") + failed)
    limits = [f"{ladder.limits[q].value:.5g} ({_order(ladder.limits[q].order)})" for q in shown]
    yield _line("limit".ljust(width), "", "", "", limits, "")
    for q in shown:
        enough = ladder.coarsest(q, TARGET_ERROR)
        needed = "a finer setting than these" if enough is None else f"{enough.setting.label} or finer"
        yield f"{TARGET_ERROR:.0%} on {_name(q)} needs {needed}; the limit is known to {ladder.limits[q].doubt:.2g}"
    for row in ladder.rows:
        if row.setting.label == ladder.scene_setting and shown:
            bounds = {q: b for q in shown if (b := ladder.bound(row, q)) is not None}
            missed = [_name(q) for q, b in bounds.items() if b > TARGET_ERROR]
            verdict = (
                f"misses {TARGET_ERROR:.0%} on {', '.join(missed)}"
                if missed
                else f"is good for {TARGET_ERROR:.0%} on all"
            )
            errors = ", ".join(f"{_name(q)} {b:.2g}" for q, b in bounds.items())
            yield f"the setting of the scene, {ladder.scene_setting}, {verdict}: {errors}"


def _line(setting: str, pairs: str, seconds: str, memory: str, cells: Sequence[str], maps: str) -> str:
    return f"{setting} {pairs:>6} {seconds:>8} {memory:>6} " + " ".join(f"{cell:>24}" for cell in cells) + f"  {maps}"


def _name(quantity: str) -> str:
    return quantity_named(quantity).label


def _cell(ladder: LadderTable, row: LadderRow, quantity: str) -> str:
    value, error = row.solved.values[quantity], ladder.error(row, quantity)
    if value is None or error is None:
        return ""
    doubt = ladder.limits[quantity].doubt
    return f"{value:.5g} ({100 * error:+.2g}{f' ~{100 * doubt:.2g}' if doubt else ''} %)"


def _order(order: float) -> str:
    return "scattered" if np.isnan(order) else f"order {order:.1f}"


def _advice(table: LadderTables) -> Iterator[str]:
    """What the numbers are, and for each quantity what to use for the wanted error."""
    yield "in brackets: error from where the setting tends to, behind ~ the doubt in that"
    yield f"each setting alone, the others as {table.scene} has them with {'; '.join(table.base) or 'nothing changed'}"
    for quantity in names_with_error():
        if any(quantity in ladder.limits and ladder.ladder.base is None for ladder in table.ladders):
            try:
                rows, error, seconds = table.choose(TARGET_ERROR, quantity)
            except Refusal as refusal:
                yield str(refusal)
                continue
            used = ", ".join(row.setting.label for row in rows)
            yield f"for {TARGET_ERROR:.0%} on {_name(quantity)} use {used}: {error:.1%}, {seconds:.2g} s"


def costs(table: LadderTables) -> Figure:
    """Error in amplitude, energy and life, as far as there are any, against seconds; the Pareto front as a line.

    The front is of settings of all ladders together, as they are chosen for smaller and smaller errors.
    """
    quantities = [q for q in ("amplitude", "energy", "life") if any(q in ladder.limits for ladder in table.ladders)]
    shown = quantities or ["amplitude"]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.2 * len(shown) + 1.6, 4.0), layout="constrained")
        panes = figure.subplots(1, len(shown), squeeze=False)[0]
        colours = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]
        for pane, quantity in zip(panes, shown, strict=True):
            for i, ladder in enumerate(table.ladders):
                points = [
                    (row.solved.seconds, b) for row in ladder.rows if (b := ladder.bound(row, quantity)) is not None
                ]
                seconds, errors = zip(*points, strict=True) if points else ((), ())
                style = {"color": colours[i % 20], "marker": MARKERS[i % len(MARKERS)], "linestyle": "none"}
                label = ladder.ladder.name.replace("_", " ")
                pane.plot(seconds, np.maximum(errors, FLOOR), label=label, markersize=5, **style)
            front = _front(table, quantity)
            pane.plot(*front, color=INK, linewidth=0.8, marker=".", zorder=0, label="all together, as chosen")
            pane.set_xscale("log")  # before its formatter
            pane.axhline(TARGET_ERROR, color=GREY, linestyle=":", linewidth=1)
            pane.xaxis.set_minor_formatter(NullFormatter())
            pane.set(yscale="log", xlabel="seconds of one processor", title=f"{table.scene}: {_name(quantity)}")
        panes[0].set_ylabel("relative error, with the doubt in it")
        handles = panes[0].get_legend_handles_labels()
        panes[-1].legend(*handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    return figure


def _front(table: LadderTables, quantity: str) -> tuple[list[float], list[float]]:
    """Seconds and errors of the cheapest settings for smaller and smaller errors, as far as they are known."""
    seconds, errors = [], []
    for target in np.logspace(-0.5, -5, 37):
        try:
            _, error, needed = table.choose(float(target), quantity)
        except Refusal:
            break
        seconds.append(needed)
        errors.append(error)
    return seconds, errors


def picture(scene: str, ladder: LadderTable) -> Figure:
    """Errors against the number of pairs, the work on the finest grid, and where coarser grids differ from it."""
    by_pairs = {len(m.area): m for m in reversed([row.solved for row in ladder.rows]) if m.values["energy"]}
    *coarser, finest = [by_pairs[n] for n in sorted(by_pairs)][-4:] or [ladder.rows[-1].solved]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.1 + 2.5 * len(coarser), 3.6), layout="constrained")
        panes = figure.subplots(1, 2 + len(coarser), width_ratios=[1.7] + [1] * (1 + len(coarser)), squeeze=False)[0]
        _draw_errors(panes[0], ladder)
        panes[0].set_title(f"{scene}: {ladder.ladder.name.replace('_', ' ')}")
        drawn = _map(panes[1], finest, 1e-3 * finest.work, {"cmap": "viridis"})
        figure.colorbar(drawn, ax=panes[1], label="work per cycle and area, kJ/m²", location="bottom")
        reach = max(float(finest.work.max()), 1e-300)
        offs = [(coarse.work - on_grid(finest.patch, finest.work, coarse.patch)) / reach for coarse in coarser]
        limit = max((float(np.quantile(np.abs(off), MOST_SHOWN)) for off in offs), default=0.0) or 1.0
        for pane, coarse, off in zip(panes[2:], coarser, offs, strict=True):
            drawn = _map(pane, coarse, off, {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit})
        if coarser:
            label = "work − that of the finest grid, over its largest"
            figure.colorbar(drawn, ax=list(panes[2:]), label=label, location="bottom", extend="both", aspect=40)
    return figure


def _draw_errors(pane: Any, ladder: LadderTable) -> None:
    for quantity, colour, mark in zip(names_with_error(), CYCLE, MARKERS, strict=False):
        points = [(len(row.solved.area), b) for row in ladder.rows if (b := ladder.bound(row, quantity))]
        if points:
            style = {"marker": mark, "markersize": 4, "color": colour, "label": _name(quantity)}
            pane.loglog(*zip(*points, strict=True), linestyle="none", **style)
    pane.axhline(TARGET_ERROR, color=GREY, linestyle=":", linewidth=1)
    ticks = sorted({len(row.solved.area) for row in ladder.rows})
    pane.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
    pane.xaxis.set_minor_locator(NullLocator())
    pane.set(xlabel="node pairs", ylabel="relative error, with the doubt in it")
    if pane.get_legend_handles_labels()[0]:
        pane.legend(fontsize=8, loc="upper right")


def _map(pane: Any, measured: SolvedSetting, field: np.ndarray, colours: dict[str, Any]) -> Any:
    mesh = Triangulation(*(1e3 * measured.patch.T))
    a, b, c = np.moveaxis(np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    mesh.set_mask(area < FLAT * area.mean())  # rounding makes slivers along the rim
    drawn = pane.tripcolor(mesh, field, shading="gouraud", **colours)
    pane.set(aspect="equal", title=f"{len(measured.area)} pairs", xlabel="mm")
    pane.grid(visible=False)
    return drawn
