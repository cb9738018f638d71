"""Convergence with the contact grid and the mesh: answers on finer and finer ones, and how far each is from the limit.

The limit is Richardson's: a power of the node spacing fitted to the three finest grids. Fields of the finest grid are
carried to each coarser one, so that differences can be mapped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from hbm.branch import CONVERGED
from workflows import scene_file
from workflows.knobs import Ladder, study_of
from workflows.measure import Measured, measure
from workflows.style import BLUE, GREEN, GREY, ORANGE, STYLE
from workflows.trade_table import NAMES, QUANTITIES

WANTED = 0.01
ORDERS = (0.3, 6.0)  # between which a fitted order is believed


@dataclass(frozen=True)
class Row:
    """One grid.

    size : nodes along the patch; setting : its overrides
    values, errors : by trade_table.QUANTITIES, errors against the limit
    map_difference : r.m.s. difference of friction work per area from the finest grid, over its r.m.s.
    """

    size: float
    setting: str
    pairs: int
    values: dict[str, float | None]
    errors: dict[str, float | None]
    map_difference: float | None
    seconds: float
    outcome: str


@dataclass(frozen=True)
class Limit:
    """Richardson's limit of one quantity; order : observed, nan where the values do not settle monotonically.

    uncertainty : relative distance of the finest grid from the limit
    """

    value: float
    order: float
    uncertainty: float


@dataclass(frozen=True)
class Study:
    """Rows of one ladder of grids or meshes, from coarse to fine, and the limit of each quantity."""

    scene: str
    ladder: str
    rows: tuple[Row, ...]
    limits: dict[str, Limit]
    measured: tuple[Measured, ...]

    def needed(self, quantity: str, wanted: float = WANTED) -> Row | None:
        """The coarsest grid from which on every grid is within the wanted error."""
        found = None
        for row in reversed([row for row in self.rows if row.errors[quantity] is not None]):
            if abs(row.errors[quantity] or 0.0) > wanted:
                break
            found = row
        return found


def run(scene: str, overrides: Sequence[str], most: float, say: Callable[[str], None]) -> tuple[Study, ...]:
    """Every ladder of the scene's study, up to grids of `most` nodes along the patch.

    Raises  ValueError for a scene whose study has no ladders, or fewer than three grids
    """
    study = study_of(scene_file.find(scene).stem)
    if not study.ladders:
        raise ValueError(f"there is no study of grids for {scene}: name them in workflows/studies/{scene}.toml")
    return tuple(_climb(scene, ladder, (*ladder.base, *overrides), most, say) for ladder in study.ladders)


def _climb(scene: str, ladder: Ladder, base: tuple[str, ...], most: float, say: Callable[[str], None]) -> Study:
    found = []
    for setting in ladder.settings:
        if setting.size > most:
            continue
        file = scene_file.read(scene, (*base, *setting.overrides))
        measured = measure(file, wears=setting.size <= ladder.life_up_to)
        say(f"{ladder.name}: {setting.label}: {measured.seconds:.1f} s, {measured.outcome}")
        found.append((setting, measured))
    if len(found) < 3:
        raise ValueError(f"{ladder.name}: a limit needs three grids, {len(found)} are left up to {most:g}")
    good = [(s, m) for s, m in found if m.outcome == CONVERGED]
    limits = {}
    for quantity in QUANTITIES:
        known = [(s.size, v) for s, m in good if (v := m.values[quantity]) is not None]
        if len(known) >= 3:
            limits[quantity] = limit_of(*np.array(known).T)
    finest = good[-1][1]
    rows = tuple(
        Row(
            size=setting.size,
            setting=setting.label,
            pairs=len(measured.area),
            values=measured.values,
            errors={
                q: measured.values[q] / limits[q].value - 1 if q in limits and measured.values[q] is not None else None  # type: ignore[operator]
                for q in QUANTITIES
            },
            map_difference=None if measured is finest else map_difference(measured, finest),
            seconds=measured.seconds,
            outcome=measured.outcome,
        )
        for setting, measured in found
    )
    return Study(scene_file.find(scene).stem, ladder.name, rows, limits, tuple(m for _, m in found))


def limit_of(size: np.ndarray, value: np.ndarray) -> Limit:
    """Limit of value = v0 + c h^p, h = 1 / (size - 1), through the three finest sizes.

    size : (n,) nodes along the patch, rising; value : (n,) not all zero
    Where the three are not monotone, or the order is out of ORDERS, the finest value stands, and how far the three are
    spread is its uncertainty.
    Source  Roache, J. Fluids Eng. 116, 1994
    """
    h, v = 1.0 / (size[-3:] - 1.0), value[-3:]
    first, second = v[0] - v[1], v[1] - v[2]
    if first == second == 0:
        return Limit(float(v[2]), float("nan"), 0.0)
    if second != 0 and first / second > 0:
        trial = np.linspace(*ORDERS, 571)
        ratio = (h[0] ** trial - h[1] ** trial) / (h[1] ** trial - h[2] ** trial)
        best = int(np.argmin(np.abs(np.log(ratio) - np.log(first / second))))
        if 0 < best < len(trial) - 1:
            p = trial[best]
            limit = v[2] - second * h[2] ** p / (h[1] ** p - h[2] ** p)
            return Limit(float(limit), float(p), float(abs(v[2] / limit - 1)))
    return Limit(float(v[2]), float("nan"), float(np.ptp(v) / abs(v[2])))


def on_grid(fine: np.ndarray, field: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """A field (n_fine,) at fine (n_fine, 2) carried to the nodes coarse (n_coarse, 2): linear, nearest at the rim."""
    inside = LinearNDInterpolator(fine, field)(coarse)
    return np.where(np.isnan(inside), NearestNDInterpolator(fine, field)(coarse), inside)


def map_difference(coarse: Measured, fine: Measured) -> float:
    """R.m.s. difference of friction work per area over its r.m.s. on the finer grid, by area of the coarser one."""
    reference = on_grid(fine.patch, fine.energy / fine.area, coarse.patch)
    off = coarse.energy / coarse.area - reference
    size = float(coarse.area @ reference**2)
    return float(np.sqrt(coarse.area @ off**2 / size)) if size > 0 else 0.0


def as_records(studies: Sequence[Study]) -> list[dict[str, Any]]:
    """Rows for JSON."""
    return [{"scene": s.scene, "ladder": s.ladder, **asdict(row)} for s in studies for row in s.rows]


def as_text(studies: Sequence[Study]) -> str:
    """Tables for people, the limits with their orders, and the grid that a wanted accuracy needs."""
    lines = []
    for study in studies:
        shown = [q for q in QUANTITIES if q in study.limits]
        titles = [NAMES[QUANTITIES.index(q)] for q in shown]
        lines.append(f"{study.ladder:14} {'pairs':>6} {'seconds':>8} " + " ".join(f"{t:>22}" for t in titles) + "  map")
        for row in study.rows:
            cells = []
            for q in shown:
                value, error = row.values[q], row.errors[q]
                cells.append("" if value is None or error is None else f"{value:.5g} ({100 * error:+.2g} %)")
            maps = "" if row.map_difference is None else f"{100 * row.map_difference:.1f} %"
            failed = "" if row.outcome == CONVERGED else f"  {row.outcome}"
            head = f"{row.size:<14g} {row.pairs:6d} {row.seconds:8.1f} "
            lines.append(head + " ".join(f"{cell:>22}" for cell in cells) + f"  {maps}{failed}")
        limits = [study.limits[q] for q in shown]
        orders = ["not settled" if np.isnan(one.order) else f"order {one.order:.1f}" for one in limits]
        cells = [f"{one.value:.5g}, {order}" for one, order in zip(limits, orders, strict=True)]
        lines.append(f"{'limit':14} {'':6} {'':8} " + " ".join(f"{cell:>22}" for cell in cells))
        for quantity, title in zip(shown, titles, strict=True):
            enough = study.needed(quantity)
            need = "none of these grids" if enough is None else f"{enough.setting}, {enough.pairs} pairs"
            spread = 100 * study.limits[quantity].uncertainty
            lines.append(f"{100 * WANTED:g} % on {title} needs {need}; the finest is within {spread:.2g} %")
    return "\n".join(lines)


def picture(study: Study) -> Figure:
    """Errors against the number of pairs, and where the coarser grids differ from the finest one."""
    shown = [m for m in study.measured if m.outcome == CONVERGED]
    finest, some = shown[-1], shown[:-1][-3:]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.4 + 2.7 * len(some), 3.6), layout="constrained")
        panes = figure.subplots(1, 1 + len(some), width_ratios=[1.5] + [1] * len(some), squeeze=False)[0]
        for quantity, colour, mark in (("peak_m", BLUE, "o"), ("energy_J", ORANGE, "s"), ("life_cycles", GREEN, "D")):
            points = [(r.pairs, abs(e)) for r in study.rows if (e := r.errors[quantity]) is not None and e != 0]
            if points:
                x, y = zip(*points, strict=True)
                panes[0].loglog(x, y, marker=mark, color=colour, label=NAMES[QUANTITIES.index(quantity)])
        panes[0].axhline(WANTED, color=GREY, linestyle=":", linewidth=1)
        title = f"{study.scene}: {study.ladder.replace('_', ' ')}"
        panes[0].set(xlabel="node pairs", ylabel="relative error", title=title)
        panes[0].legend()
        reach = max(float((finest.energy / finest.area).max()), 1e-300)
        for pane, one in zip(panes[1:], some, strict=True):
            off = (one.energy / one.area - on_grid(finest.patch, finest.energy / finest.area, one.patch)) / reach
            drawn = pane.tripcolor(*(1e3 * one.patch.T), off, shading="gouraud", cmap="RdBu_r", vmin=-0.3, vmax=0.3)
            pane.set(aspect="equal", title=f"{len(one.area)} pairs", xlabel="mm")
            pane.grid(visible=False)
        if some:
            figure.colorbar(drawn, ax=panes[-1], label="work per area − finest, over its largest")
    return figure
