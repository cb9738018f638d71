"""A study as pictures: what was computed against each key, and parallel coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, INK, PAPER, STYLE, WEAR_MAP

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.table import StudyTable

FEWEST_LINES = 3  # runs, and keys with the result, that parallel coordinates need
WIDE_SCALE = 30.0  # largest over least value, from which on a scale is logarithmic
BEHIND = {"boxstyle": "square,pad=0.1", "facecolor": PAPER, "edgecolor": "none", "alpha": 0.8}
SHOWN = {
    "peak_hz_first": "peak / Hz",
    "peak_m_first": "amplitude / m",
    "depth_max_m": "depth / m",
    "life_cycles": "life / cycles",
}


def shown(found: StudyTable) -> dict[str, str]:
    """Columns that a run has a number in, with their labels; empty where there is nothing to draw."""
    columns = found.columns
    return {name: label for name, label in SHOWN.items() if name in columns and np.isfinite(columns[name]).any()}


def panes(found: StudyTable) -> Figure:
    """Peak, amplitude, depth and life, as far as there are any, against the keys; rank correlation in each title."""
    if not (there := shown(found)):
        raise ValueError(f"{found.name}: no run has a peak, a depth or a life, there is nothing to draw")
    influence = found.influence()
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.4 * len(found.varied) + 0.8, 2.6 * len(there) + 0.3), layout="constrained")
        panes = figure.subplots(len(there), len(found.varied), squeeze=False, sharey="row", sharex="col")
        for line, (name, label) in zip(panes, there.items(), strict=True):
            for pane, key in zip(line, found.varied, strict=True):
                values = found.columns[key]
                where = values if values.dtype.kind == "f" else values.astype(str)
                good = np.isfinite(found.columns[name])
                pane.plot(where[good], found.columns[name][good], "o", color=BLUE, markersize=4, alpha=0.7)
                rank = influence.get(name, {}).get(key)
                if rank is not None:
                    pane.set_title(f"rank correlation {rank:+.2f}", fontsize=9, color=INK)
            line[0].set_ylabel(label)
        for pane, key in zip(panes[-1], found.varied, strict=True):
            pane.set_xlabel(key, fontsize=9)
    return figure


def subject(found: StudyTable) -> str | None:
    """The number that runs are coloured by: life, else amplitude, depth or peak; None where no run has one."""
    for name in ("life_cycles", "peak_m_first", "depth_max_m", "peak_hz_first"):
        if name in found.columns and np.isfinite(found.columns[name]).sum() >= FEWEST_LINES:
            return name
    return None


def parallel_possible(found: StudyTable) -> bool:
    """Whether there are runs and keys enough."""
    return subject(found) is not None and len(found.varied) + 1 >= FEWEST_LINES


def parallel(found: StudyTable, number: str | None = None) -> Figure:
    """Every run that has the number, as a line over the keys that vary, coloured by it.

    number : a computed one; life by default, or what there is. Values that are texts are in alphabetical order
    Raises  ValueError where too few runs have it
    """
    name = number or subject(found)
    if name is None or name not in found.computed:
        raise ValueError(f'{found.name} has no number "{number}": there are {", ".join(found.computed)}')
    good = np.isfinite(found.columns[name])
    if good.sum() < FEWEST_LINES:
        raise ValueError(f"{found.name}: {good.sum()} runs have a {name}, parallel coordinates need {FEWEST_LINES}")
    names = [*found.varied, name]
    columns = [_scaled(found.columns[one][good]) for one in names]
    heights = np.stack([height for height, _ in columns], axis=1)
    with axes_of(1.9 * len(names) + 1.6, 4.2) as (figure, axes):
        lines = np.stack([np.broadcast_to(np.arange(len(names)), heights.shape), heights], axis=-1)
        values = found.columns[name][good].astype(float)
        scale = (LogNorm if wide(values) else Normalize)(values.min(), values.max())
        order = np.argsort(values)[::-1]  # the least, which matter most of lives, on top
        axes.add_collection(
            LineCollection(list(lines[order]), colors=colormaps[WEAR_MAP](scale(values[order])), lw=1.1, alpha=0.8)
        )
        for at, (_, ticks) in enumerate(columns):
            axes.axvline(at, color=INK, lw=0.8)
            for height, text in ticks:
                axes.text(at + 0.02, height, text, fontsize=8, color=INK, va="center", bbox=BEHIND)
        axes.set(xlim=(-0.1, len(names) - 0.6), ylim=(-0.06, 1.06), yticks=[])
        axes.set_xticks(range(len(names)), [_label(one) for one in names], fontsize=8)
        axes.grid(False)
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.set_title(f"{found.name}: {good.sum()} of {len(good)} runs")
        figure.colorbar(ScalarMappable(scale, WEAR_MAP), ax=axes, label=SHOWN.get(name, name), pad=0.02)
    return figure


def _scaled(column: np.ndarray) -> tuple[np.ndarray, list[tuple[float, str]]]:
    """Heights from 0 to 1, and where which label stands."""
    if column.dtype.kind != "f":
        kinds = sorted(set(column.astype(str)))
        at = {kind: i / max(len(kinds) - 1, 1) for i, kind in enumerate(kinds)}
        return np.array([at[str(value)] for value in column]), [(at[kind], kind) for kind in kinds]
    if np.ptp(column) == 0:
        return np.full(len(column), 0.5), [(0.5, f"{column[0]:.4g}")]
    values = np.log(column) if wide(column) else column
    low, high = float(values.min()), float(values.max())
    ticks = [(share, low + share * (high - low)) for share in (0.0, 0.5, 1.0)]
    return (values - low) / (high - low), [(s, f"{np.exp(v) if wide(column) else v:.3g}") for s, v in ticks]


def wide(values: np.ndarray) -> bool:
    """Whether values spread so far that their logarithms are shown."""
    return bool(values.min() > 0 and values.max() > WIDE_SCALE * values.min())


def _label(name: str) -> str:
    return SHOWN.get(name, name.replace(".", "\n"))
