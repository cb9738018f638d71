"""A plot in a notebook that grows during a run: the response as it is followed, the preload as it wears away."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.run.progress import Advance, Progress


class Live(Progress):
    """Progress as a plot below a notebook's cell, as in `td.run("beam", progress=td.plot.Live())`.

    interval : between two drawings [s]
    """

    def __init__(self, interval: float = 2.0):
        super().__init__(Console(), details=False)
        self._interval = interval

    @contextmanager
    def track(self, name: str) -> Iterator[Advance]:
        """Long work; that which comes by no points is not drawn."""
        from IPython import get_ipython
        from IPython.display import display

        points: list[tuple[float, float]] = []
        shown, last = None, -np.inf if get_ipython() else np.inf  # outside of a notebook nothing is drawn

        def advance(share: float, note: str, *point: tuple[float, float]) -> None:
            nonlocal shown, last
            points.extend(point)
            if point and time.perf_counter() - last >= self._interval:
                shown = shown or display(drawn(name, points), display_id=True)
                shown.update(drawn(name, points))
                last = time.perf_counter()

        yield advance
        if shown:
            shown.update(drawn(name, points))


def drawn(name: str, points: list[tuple[float, float]]) -> Figure:
    """points : angular frequency [rad/s] and amplitude [m], of wear cycles and preload [N]"""
    x, y = np.array(points).T
    unit, scale = length_unit(y.max())
    of_wear = ("vibration cycles / million", "preload / kN", x / 1e6, y / 1e3)
    across, up, x, y = (
        of_wear if name == "wear" else ("frequency / Hz", f"amplitude / {unit}", x / 2 / np.pi, scale * y)
    )
    with axes_of(5.2, 2.8) as (figure, axes):
        axes.plot(x, y, ".")
        axes.set(xlabel=across, ylabel=up, title=name)
    return figure
