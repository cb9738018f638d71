"""Curves of results as plotly figures, plain data for the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tribodyn.workflows.pictures.loops import loop_size, pair_name
from tribodyn.workflows.pictures.plots import with_gaps
from tribodyn.workflows.pictures.style import CYCLE, GREY, INK
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.states import state_of

Chart = dict[str, Any]

LOOPS = 3  # pairs whose loops are drawn


def charts(results: Sequence[tuple[str, Result]]) -> dict[str, Chart]:
    """Charts by title, each with the curves of all results that have them."""
    found = {
        "Response": _response(results),
        "Peak frequency under wear": _wear(results, "omega", "frequency / Hz", 1 / (2 * np.pi)),
        "Amplitude under wear": _wear(results, "amplitude", "amplitude / mm", 1e3),
        "Preload": _wear(results, "preload", "preload / N", 1.0),
        "Largest wear depth": _wear(results, "depth", "largest total depth / mm", 1e3),
        "Friction work per cycle": _wear(results, "energy", "energy per cycle / J", 1.0),
        "Hysteresis": _loops(results),
    }
    return {title: chart for title, chart in found.items() if chart["data"]}


def _chart(data: list[Chart], x: str, y: str, log: bool = False) -> Chart:
    axis = {"showline": True, "linecolor": INK, "gridcolor": "#dfe2e6", "zeroline": False, "automargin": True}
    layout = {
        "xaxis": {**axis, "title": {"text": x}},
        "yaxis": {**axis, "title": {"text": y}, "type": "log" if log else "linear"},
        "margin": {"l": 60, "r": 12, "t": 10, "b": 45},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "height": 330 + 20 * max(len(data), 2),
        "font": {"color": INK},
        "legend": {"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom"},
        "hovermode": "closest",
        "colorway": list(CYCLE),
    }
    return {"data": data, "layout": layout}


def _line(name: str, x: np.ndarray, y: np.ndarray, **more: Any) -> Chart:
    return {"type": "scatter", "mode": "lines", "name": name, "x": plain(x), "y": plain(y), **more}


def plain(values: np.ndarray, digits: int = 7) -> list[Any]:
    """Numbers with a few digits as JSON has them; nan as null."""
    flat = np.asarray(values, float)
    if flat.ndim > 1:
        return [plain(row, digits) for row in flat]
    return [None if not np.isfinite(v) else float(f"{v:.{digits}g}") for v in flat]


def _response(results: Sequence[tuple[str, Result]]) -> Chart:
    data = []
    for number, (name, result) in enumerate(results):
        color = CYCLE[number % len(CYCLE)]
        linear, frf = result.references, result.response
        if linear is not None:
            hertz = linear.omega / (2 * np.pi)
            more: Chart = {"visible": True if number == 0 else "legendonly"}
            for label, height, dash in (("free", linear.free, "dash"), ("stuck", linear.stuck, "dot")):
                style = {"dash": dash, "color": GREY if label == "free" else INK, "width": 1}
                data.append(_line(f"{name}: {label}", hertz, 1e3 * height, line=style, **more))
        if frf is not None:
            good = frf.converged
            for k, output in enumerate(frf.output_names):
                height = np.where(good, 1e3 * frf.amplitude(output), np.nan)
                more = {"line": {"color": color}} if k == 0 else {"visible": "legendonly"}
                data.append(_line(f"{name}: {output}", frf.frequency, height, **more))
            if result.stability is not None:
                height = np.where(good & ~result.stability.stable, 1e3 * frf.amplitude(frf.output_names[0]), np.nan)
                data.append(_line(f"{name}: unstable", frf.frequency, height, line={"color": "#d55e00", "width": 4}))
        if result.worn is not None:
            for row, omega, height in zip(result.worn.row, result.worn.omega, result.worn.amplitude, strict=True):
                label = state_of(result, int(row)).label
                data.append(_line(f"{name}: {label}", omega / (2 * np.pi), 1e3 * height))
        if result.wear is not None and result.wear_steps:
            hertz, height = with_gaps(result.wear, result.wear.omega / (2 * np.pi), 1e3 * result.wear.amplitude)
            data.append(_line(f"{name}: peak under wear", hertz, height, mode="lines+markers", marker={"size": 4}))
    return _chart(data, "frequency / Hz", "amplitude / mm", log=True)


def _wear(results: Sequence[tuple[str, Result]], what: str, label: str, scale: float) -> Chart:
    data = []
    for name, result in results:
        if result.wear is None or not result.wear_steps:
            continue
        values = np.asarray(getattr(result.wear, what))
        if values.ndim == 2:
            values = values.max(axis=1) if what == "depth" else values.sum(axis=1)
        cycles, shown = with_gaps(result.wear, result.wear.cycles, scale * values)
        data.append(_line(name, cycles, shown, mode="lines+markers", marker={"size": 4}))
    return _chart(data, "vibration cycles", label)


def _loops(results: Sequence[tuple[str, Result]]) -> Chart:
    data = []
    for name, result in results:
        loops, patch = result.loops, result.patch
        if loops is None:
            continue
        size = loop_size(result)
        busiest = int(np.argmax(size.sum(axis=(1, 2))))
        for at, row in enumerate(loops.row):
            for rank, pair in enumerate(np.argsort(-size[at].sum(axis=1))[:LOOPS]):
                c = int(np.argmax(size[at, pair]))
                x, f = loops.displacement[at, pair, c], loops.force[at, pair, c]
                where = f"{pair_name(result, int(pair))}, {patch.components[c]}"
                label = f"{name}: {state_of(result, int(row)).label}, {where}"
                shown = {"visible": True if (at, rank) == (busiest, 0) else "legendonly"}
                data.append(_line(label, 1e6 * np.append(x, x[0]), np.append(f, f[0]), **shown))
    return _chart(data, "relative displacement / µm", "contact force / N")
