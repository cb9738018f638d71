"""Convergence with the contact grid and the mesh: answers on finer and finer ones, and how far each is from the limit.

The limit is Richardson's, a power of the node spacing fitted to the three finest grids, where they settle. Contact
forces have kinks where the contact begins to slip and to lift, and it is chance where these lie between the nodes:
answers scatter with the grid. A study may measure every grid with its nodes placed otherwise too; a limit is then known
to the range of the finest grids, and a grid has the error of the worst of its placements. Fields of the finest grid are
carried to each coarser one, so that differences can be mapped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from os import fspath
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from matplotlib.tri import Triangulation
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from tribodyn.workflows.errors import limit
from tribodyn.workflows.errors.cost import Measured, measure
from tribodyn.workflows.errors.ladders import Ladder, Setting, study_of, study_path
from tribodyn.workflows.errors.limit import Limit
from tribodyn.workflows.errors.trade_table import ANSWERED, NAMES, QUANTITIES
from tribodyn.workflows.pictures.style import BLUE, GREEN, GREY, ORANGE, STYLE
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.source import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies.files import write_files

WANTED = 0.01
FLAT = 1e-6  # area over the mean one of a triangle that is no part of a map
MOST_SHOWN = 0.98  # share of the nodes whose difference is within the colours of a map


@dataclass(frozen=True)
class GridRow:
    """One grid.

    size : nodes along the patch; setting : its overrides; own : whether the scene has this grid
    values, errors : by trade_table.QUANTITIES, errors against the limit
    worst : largest error of all placements of the nodes, without its sign, and the doubt in the limit
    map_difference : r.m.s. difference of friction work per area from the finest grid, over its r.m.s.
    """

    size: float
    setting: str
    own: bool
    pairs: int
    values: dict[str, float | None]
    errors: dict[str, float | None]
    worst: dict[str, float | None]
    map_difference: float | None
    seconds: float
    outcome: str


@dataclass(frozen=True)
class Study:
    """Rows of one ladder of grids or meshes, from coarse to fine, and the limit of each quantity."""

    scene: str
    ladder: str
    rows: tuple[GridRow, ...]
    limits: dict[str, Limit]
    measured: tuple[Measured, ...]

    def needed(self, quantity: str) -> GridRow | None:
        """The coarsest grid from which on every grid is within the wanted error, however its nodes are placed."""
        found = None
        for row in reversed(self.rows):
            error = row.worst[quantity]
            if error is not None and error > WANTED:
                break
            found = found if error is None else row
        return found


@dataclass(frozen=True)
class Converged:
    """Studies of the grids of a scene."""

    studies: tuple[Study, ...]

    def record(self) -> list[dict[str, Any]]:
        """For machines."""
        return [{"scene": s.scene, "ladder": s.ladder, **asdict(row)} for s in self.studies for row in s.rows]

    def lines(self) -> list[str]:
        """For people: tables, limits with their orders, the grid that a wanted accuracy needs, the scene's judged."""
        return [line for study in self.studies for line in _lines(study)]

    def write(self, folder: Path) -> list[Path]:
        """Write a picture of each."""
        return write_files(folder, {}, {f"converge_{one.scene}_{one.ladder}": picture(one) for one in self.studies})


def converge(scene: AnyPath, *, most: float = 99, overrides: Overrides = (), progress: Report = None) -> Converged:
    """Refine the contact grid and the mesh until the answers settle, and say which grid a per cent needs.

    scene : name of a scene with a study of its grids
    most : finest grid, in nodes along the patch
    Raises  ValueError for a scene whose study has no ladders, or fewer than three grids
    """
    name, texts, say = fspath(scene), override_texts(overrides), reporter(progress).say
    file = scene_file.read(name)
    ladders = study_of(file).ladders
    if not ladders:
        raise ValueError(f"{file.name} has no study of its grids: name them under [converge] in {study_path(file)}")
    return Converged(tuple(_climb(name, ladder, (*ladder.base, *texts), most, say) for ladder in ladders))


def _climb(scene: str, ladder: Ladder, base: tuple[str, ...], most: float, say: Callable[[str], None]) -> Study:
    def found(setting: Setting, placement: tuple[str, ...]) -> Measured:
        file = scene_file.read(scene, (*base, *setting.overrides, *placement))
        measured = measure(file, wears=setting.size <= ladder.life_up_to)
        label = ", ".join((setting.label, *placement))
        say(f"{ladder.name}: {label}: {measured.seconds:.1f} s, {measured.outcome}")
        return measured

    settings = [setting for setting in ladder.settings if setting.size <= most]
    if len(settings) < 3:
        raise ValueError(f"{ladder.name}: a limit needs three grids, {len(settings)} are left up to {most:g}")
    placed = [((), *ladder.placements) if s.size <= ladder.placed_up_to else ((),) for s in settings]
    measured = [[found(s, placement) for placement in places] for s, places in zip(settings, placed, strict=True)]
    limits = {}
    for quantity in QUANTITIES:
        known = [(s.size, v) for s, grid in zip(settings, measured, strict=True) if (v := _values(grid, quantity))]
        if len(known) >= 3:
            limits[quantity] = limit_of([size for size, _ in known], [values for _, values in known])
    finest = next((grid[0] for grid in reversed(measured) if _responds(grid[0])), None)
    if finest is None:
        raise RuntimeError(f"{ladder.name}: no grid has an answer, the finest says: {measured[-1][0].outcome}")
    own = scene_file.read(scene, base).scene
    rows = tuple(
        GridRow(
            size=setting.size,
            setting=setting.label,
            own=scene_file.read(scene, (*base, *setting.overrides)).scene == own,
            pairs=len(grid[0].area),
            values=grid[0].values,
            errors={q: _off(grid[0].values[q], limits.get(q)) for q in QUANTITIES},
            worst={q: _worst(_values(grid, q), limits.get(q)) for q in QUANTITIES},
            map_difference=map_difference(grid[0], finest) if _responds(grid[0]) and grid[0] is not finest else None,
            seconds=sum(one.seconds for one in grid),
            outcome=next((one.outcome for one in grid if one.outcome != ANSWERED), ANSWERED),
        )
        for setting, grid in zip(settings, measured, strict=True)
    )
    return Study(scene_file.find(scene).stem, ladder.name, rows, limits, tuple(grid[0] for grid in measured))


def _values(grid: Sequence[Measured], quantity: str) -> list[float]:
    """What the placements of a grid answer, the grid itself first; none where that has no answer."""
    if grid[0].values[quantity] is None:
        return []
    return [v for one in grid if (v := one.values[quantity]) is not None]


def _responds(one: Measured) -> bool:
    """Whether the response has a peak; its wear may have no end of life."""
    return one.values["peak_m"] is not None


def _off(value: float | None, end: Limit | None) -> float | None:
    return None if value is None or end is None else value / end.value - 1


def _worst(values: Sequence[float], end: Limit | None) -> float | None:
    if not values or end is None:
        return None
    return max(abs(value / end.value - 1) for value in values) + end.doubt


def limit_of(size: Sequence[float], values: Sequence[Sequence[float]]) -> Limit:
    """Limit of answers on finer and finer grids, through the three finest.

    size : nodes along the patch, rising; values : of all placements on each, the first one counts
    Where the three do not settle, or the last step is within the scatter of the finest size with several placements,
    the middle of all values on the three stands, with half of their range as doubt.
    """
    last = [some[0] for some in values[-3:]]
    scatter = next((float(np.ptp(some)) for some in reversed(values) if len(some) > 1), 0.0)
    found = limit.limit_of([n - 1.0 for n in size[-3:]], last)
    if np.isfinite(found.order) and abs(last[-1] - last[-2]) > scatter:
        return found
    every = np.concatenate([np.asarray(some) for some in values[-3:]])
    middle = (every.min() + every.max()) / 2
    return Limit(float(middle), float("nan"), float(np.ptp(every) / 2 / abs(middle)))


def on_grid(fine: np.ndarray, field: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """A field (n_fine,) at fine (n_fine, 2) carried to the nodes coarse (n_coarse, 2): linear, nearest at the rim."""
    centre = fine.mean(axis=0)
    within = centre + (1 - 1e-6) * (coarse - centre)  # rounding must not put the rim outside, or into slivers along it
    inside = LinearNDInterpolator(fine, field)(within)
    return np.where(np.isnan(inside), NearestNDInterpolator(fine, field)(coarse), inside)


def map_difference(coarse: Measured, fine: Measured) -> float:
    """R.m.s. difference of friction work per area over its r.m.s. on the finer grid, by area of the coarser one."""
    reference = on_grid(fine.patch, fine.energy / fine.area, coarse.patch)
    off = coarse.energy / coarse.area - reference
    size = float(coarse.area @ reference**2)
    return float(np.sqrt(coarse.area @ off**2 / size)) if size > 0 else 0.0


def _lines(study: Study) -> Iterator[str]:
    shown = [q for q in QUANTITIES if q in study.limits]
    width = max(len(study.ladder), *(len(row.setting) for row in study.rows))
    yield _line(study.ladder.ljust(width), "pairs", "seconds", [_name(q) for q in shown], "map")
    for row in study.rows:
        maps = "" if row.map_difference is None else f"{100 * row.map_difference:.1f} %"
        failed = "" if row.outcome == ANSWERED else f"  {row.outcome}"
        cells = [_cell(row, q) for q in shown]
        yield _line(row.setting.ljust(width), str(row.pairs), f"{row.seconds:.1f}", cells, maps + failed)
    if not shown:
        yield "no limit is known: it needs three grids that answer"
        return
    limits = [f"{(one := study.limits[q]).value:.5g} ({_order(one)})" for q in shown]
    yield _line("limit".ljust(width), "", "", limits, "")
    yield "in brackets: error; of the worst placement of the nodes, with the doubt in the limit"
    for q in shown:
        known = f"the limit is known to {100 * study.limits[q].doubt:.2g} %"
        yield f"{100 * WANTED:g} % on {_name(q)} needs {_grid(study.needed(q))}; {known}"
    yield from (_judgement(row, shown) for row in study.rows if row.own)


def _line(setting: str, pairs: str, seconds: str, cells: Sequence[str], maps: str) -> str:
    return f"{setting} {pairs:>6} {seconds:>8} " + " ".join(f"{cell:>26}" for cell in cells) + f"  {maps}"


def _name(quantity: str) -> str:
    return NAMES[QUANTITIES.index(quantity)]


def _cell(row: GridRow, quantity: str) -> str:
    value, error, worst = row.values[quantity], row.errors[quantity], row.worst[quantity]
    if value is None or error is None or worst is None:
        return ""
    return f"{value:.5g} ({100 * error:+.2g}; {100 * worst:.2g} %)"


def _order(end: Limit) -> str:
    return "scattered" if np.isnan(end.order) else f"order {end.order:.1f}"


def _grid(row: GridRow | None) -> str:
    return "a finer grid than these" if row is None else f"{row.setting} ({row.pairs} pairs) or finer"


def _judgement(row: GridRow, quantities: Sequence[str]) -> str:
    """What the grid of the scene is good for."""
    known = {q: worst for q in quantities if (worst := row.worst[q]) is not None}
    errors = ", ".join(f"{_name(q)} {100 * worst:.2g} %" for q, worst in known.items())
    missed = [_name(q) for q, worst in known.items() if worst > WANTED]
    share = f"{100 * WANTED:g} %"
    verdict = f"misses {share} on {', '.join(missed)}" if missed else f"is good for {share} on all"
    return f"the grid of the scene, {row.setting} ({row.pairs} pairs), {verdict}: {errors}"


def picture(study: Study) -> Figure:
    """Errors against the number of pairs, the work on the finest grid, and where coarser grids differ from it."""
    shown = [m for m in study.measured if _responds(m)]
    finest, some = shown[-1], shown[:-1][-3:]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.1 + 2.5 * len(some), 3.6), layout="constrained")
        panes = figure.subplots(1, 2 + len(some), width_ratios=[1.7] + [1] * (1 + len(some)), squeeze=False)[0]
        _draw_errors(panes[0], study)
        work = finest.energy / finest.area
        drawn = _map(panes[1], finest, 1e-3 * work, {"cmap": "viridis"})
        figure.colorbar(drawn, ax=panes[1], label="work per cycle and area, kJ/m²", location="bottom")
        reach = max(float(work.max()), 1e-300)
        offs = [(one.energy / one.area - on_grid(finest.patch, work, one.patch)) / reach for one in some]
        most = max((float(np.quantile(np.abs(off), MOST_SHOWN)) for off in offs), default=0.0) or 1.0
        for pane, one, off in zip(panes[2:], some, offs, strict=True):
            drawn = _map(pane, one, off, {"cmap": "RdBu_r", "vmin": -most, "vmax": most})
        if some:
            label = "work − that of the finest grid, over its largest"
            figure.colorbar(drawn, ax=list(panes[2:]), label=label, location="bottom", extend="both", aspect=40)
    return figure


def _draw_errors(pane: Any, study: Study) -> None:
    drawn = (("peak_hz", GREY, "^"), ("peak_m", BLUE, "o"), ("energy_J", ORANGE, "s"), ("life_cycles", GREEN, "D"))
    by_pairs = len({row.pairs for row in study.rows}) > 1
    for quantity, colour, mark in drawn:
        points = [(r.pairs if by_pairs else r.size, e) for r in study.rows if (e := r.worst[quantity])]
        if points:
            pane.loglog(*zip(*points, strict=True), marker=mark, markersize=4, color=colour, label=_name(quantity))
    pane.axhline(WANTED, color=GREY, linestyle=":", linewidth=1)
    ticks = [row.pairs if by_pairs else row.size for row in study.rows]
    pane.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
    pane.xaxis.set_minor_locator(NullLocator())
    pane.set(xlabel="node pairs" if by_pairs else "size of the mesh", ylabel="relative error, worst placement")
    pane.set_title(f"{study.scene}: {study.ladder.replace('_', ' ')}")
    if pane.get_legend_handles_labels()[0]:
        pane.legend(fontsize=8, loc="upper right")


def _map(pane: Any, one: Measured, field: np.ndarray, colours: dict[str, Any]) -> Any:
    mesh = Triangulation(*(1e3 * one.patch.T))
    a, b, c = np.moveaxis(np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    mesh.set_mask(area < FLAT * area.mean())  # rounding makes slivers along the rim
    drawn = pane.tripcolor(mesh, field, shading="gouraud", **colours)
    pane.set(aspect="equal", title=f"{len(one.area)} pairs", xlabel="mm")
    pane.grid(visible=False)
    return drawn
