"""The trade as a picture: what each setting of each parameter costs against what it is worth."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from tribodyn.workflows.errors.choice import front
from tribodyn.workflows.errors.trade_table import NAMES, QUANTITIES, Trade
from tribodyn.workflows.pictures.style import GREY, INK, STYLE

SHOWN = ("peak_m", "energy_J", "life_cycles")
FLOOR = 1e-8  # errors below this are drawn here
MARKERS = "osD^v<>PX*hp"


def picture(trade: Trade) -> Figure:
    """Error in amplitude, energy and life, as far as there are any, against seconds; the Pareto front as a line.

    The front is of settings of all parameters together, as they are chosen for smaller and smaller errors.
    """
    shown = [q for q in SHOWN if any(row.errors[q] is not None for row in trade.rows)]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.2 * len(shown) + 1.6, 4.0), layout="constrained")
        panes = figure.subplots(1, len(shown), squeeze=False)[0]
        colours = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]
        for pane, quantity in zip(panes, shown, strict=True):
            for i, parameter in enumerate(trade.parameters):
                rows = [
                    row for row in trade.of(parameter) if row.values[quantity] is not None and np.isfinite(row.size)
                ]
                if not rows:
                    continue
                off = [abs(row.errors[quantity] or 0.0) + (row.doubts[quantity] or 0.0) for row in rows]
                error = np.maximum(off, FLOOR)
                style = {"color": colours[i % 20], "marker": MARKERS[i % len(MARKERS)], "linestyle": "none"}
                pane.plot(
                    [row.seconds for row in rows], error, label=parameter.replace("_", " "), markersize=5, **style
                )
            together = front(trade, quantity)
            at = [[getattr(choice, name) for choice in together] for name in ("seconds", "error")]
            pane.plot(*at, color=INK, linewidth=0.8, marker=".", zorder=0, label="all together, as chosen")
            pane.set_xscale("log")  # before its formatter
            pane.axhline(0.01, color=GREY, linestyle=":", linewidth=1)
            pane.xaxis.set_minor_formatter(NullFormatter())
            name = NAMES[QUANTITIES.index(quantity)]
            pane.set(yscale="log", xlabel="seconds of one processor", title=f"{trade.scene}: {name}")
        panes[0].set_ylabel("relative error, with the doubt in it")
        known = panes[0].get_legend_handles_labels()
        panes[-1].legend(*known, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    return figure
