"""A study as a picture: what was computed against each key."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.workflows.pictures.style import BLUE, INK, STYLE

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.table import StudyTable

WIDE_SCALE = 30.0  # largest over least value, from which on a scale is logarithmic
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


def wide(values: np.ndarray) -> bool:
    """Whether values spread so far that their logarithms are shown."""
    return bool(values.min() > 0 and values.max() > WIDE_SCALE * values.min())
