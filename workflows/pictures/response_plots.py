"""Frequency responses of a result: unworn, worn, under control, of every output."""

from typing import Any

import numpy as np

from tribodyn.workflows.pictures.figures import (
    axes_of,
    length_unit,
    log_axis,
    positive_range,
    present,
    shade_beyond_linear_model,
    titled,
)
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, CYCLE, GREY, INK, ORANGE, RED, WEAR_MAP
from tribodyn.workflows.pictures.wear_plots import cycle_unit, with_gaps
from tribodyn.workflows.result.contact_states import shown_cycles
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import order_of_line

BIFURCATIONS = {"fold": "o", "flip": "s", "Neimark-Sacker": "D"}  # markers


def response(result: Result) -> Figure:
    """Unworn response between its free and stuck references, and the path of the peak under wear."""
    with axes_of(7.2, 4.6) as (figure, axes):
        unit, scale = length_unit(_largest_amplitude(result))
        if result.references is not None:
            hertz = result.references.omega / (2 * np.pi)
            reference_curves = (
                (result.references.free, "--", GREY, "free (contact absent)"),
                (result.references.stuck, ":", INK, "stuck (closed, no slip)"),
            )
            for height, style, color, label in reference_curves:
                if np.isfinite(height).any():
                    axes.plot(hertz, scale * height, style, color=color, label=label)
        if result.response is not None:
            good = result.response.converged
            amplitude = scale * result.response.amplitude(result.response.output_names[0])
            _curve(axes, result, good, amplitude)
        if result.wear is not None and result.wear_steps:
            wear = result.wear
            hertz = wear.omega / (2 * np.pi)
            unit_cycles, scale_cycles = cycle_unit(shown_cycles(wear))
            axes.plot(*with_gaps(wear, hertz, scale * wear.amplitude), color=ORANGE, zorder=3)
            dots = axes.scatter(
                hertz, scale * wear.amplitude, 16, scale_cycles * wear.cycles, cmap=WEAR_MAP, zorder=4,
                vmax=scale_cycles * shown_cycles(wear), label="cycle at each wear step",
            )  # fmt: skip
            figure.colorbar(dots, ax=axes, label=f"vibration cycles{unit_cycles}", pad=0.02)
        drawn = np.concatenate([line.get_ydata() for line in axes.lines])
        log_axis(axes.yaxis, *positive_range(drawn))
        shade_beyond_linear_model(axes, result, scale)
        if (order := order_of_line(result)) is not None:
            axes.secondary_xaxis("top", functions=(lambda f: 60 * f / order, lambda n: order * n / 60)).set_xlabel(
                f"speed / rpm (engine order {order})"
            )
        axes.set(xlabel="frequency / Hz", ylabel=f"amplitude / {unit}", title=titled(result, "frequency response"))
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def _curve(axes: Any, result: Result, good: np.ndarray, amplitude: np.ndarray) -> None:
    """The response curve: unstable stretches dashed, bifurcations marked."""
    marks, hertz = result.stability, present(result.response).frequency
    if marks is None:
        axes.plot(hertz[good], amplitude[good], color=BLUE, label="unworn contact")
        return
    # a stretch between neighbouring points is stable where both are
    both_stable = marks.stable[:-1] & marks.stable[1:]
    solved = good[:-1] & good[1:]
    for kind, style, name in ((both_stable, "-", "unworn contact, stable"), (~both_stable, ":", "unstable")):
        ends = np.flatnonzero(kind & solved)
        x = np.stack([hertz[ends], hertz[ends + 1], np.full(len(ends), np.nan)], axis=1).ravel()
        y = np.stack([amplitude[ends], amplitude[ends + 1], np.full(len(ends), np.nan)], axis=1).ravel()
        axes.plot(x, y, style, color=BLUE if style == "-" else RED, label=name if len(ends) else None)
    for kind, marker in BIFURCATIONS.items():
        at = [p for p, kind_of_mark in zip(marks.position, marks.kinds, strict=True) if kind_of_mark == kind]
        if at:
            x, y = (np.interp(at, np.arange(len(hertz)), values) for values in (hertz, amplitude))
            axes.plot(x, y, marker, color=RED, ms=6, label=kind)


def output_amplitudes(result: Result) -> Figure:
    """Amplitude of every observed output over frequency."""
    frf = present(result.response)
    good = frf.converged
    with axes_of() as (figure, axes):
        heights = {name: np.where(good, frf.amplitude(name), np.nan) for name in frf.displacements}
        unit, scale = length_unit(float(np.nanmax(list(heights.values()))))
        for name, color, style in zip(heights, CYCLE * 3, ["-"] * 6 + ["--"] * 6 + [":"] * 6, strict=False):
            axes.plot(frf.frequency, scale * heights[name], style, color=color, label=name.replace("_", " "))
        log_axis(axes.yaxis, *positive_range(scale * np.concatenate(list(heights.values()))))
        axes.set(xlabel="frequency / Hz", ylabel=f"amplitude / {unit}", title=titled(result, "outputs"))
        figure.legend(loc="outside lower center", ncols=4)
    return figure


def _largest_amplitude(result: Result) -> float:
    amplitudes = [np.zeros(1)]
    if result.references is not None:
        amplitudes.append(result.references.free)
    if result.response is not None:
        amplitudes.append(result.response.amplitude(result.response.output_names[0]))
    if result.wear is not None:
        amplitudes.append(result.wear.amplitude)
    return float(np.nanmax(np.concatenate(amplitudes)))
