"""Curves of a result, drawn with matplotlib: each function draws one figure, `draw` writes all that can be drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from hbm.branch import CONVERGED
from workflows import maps
from workflows.result import Result
from workflows.style import BLUE, GREEN, GREY, INK, ORANGE, RED, STYLE, WEAR_MAP


def draw(result: Result, folder: Path) -> list[Path]:
    """Write every figure that the result has data for as a PNG; returns their paths."""
    figures: list[tuple[str, Callable[[Result], Figure], bool]] = [
        ("frf", frequency_response, result.frf is not None or result.wear is not None),
        ("cycles_per_step", cycles_per_step, result.wear_steps > 0),
        ("peak", amplitude_against_cycles, result.wear_steps > 0),
        ("preload", preload_against_cycles, result.wear_steps > 0),
        ("depth", depth_against_cycles, result.wear_steps > 0),
        ("energy", energy_against_cycles, result.wear_steps > 0),
        ("hysteresis", hysteresis_loops, result.loops is not None),
        ("patch", maps.patch_maps, result.wear_steps > 0),
    ]
    written = []
    for name, function, possible in figures:
        if possible:
            with mpl.rc_context(STYLE):
                path = folder / f"{name}.png"
                function(result).savefig(path)
                written.append(path)
    return written


def frequency_response(result: Result) -> Figure:
    """Unworn response between its free and stuck references, and the path of the peak under wear."""
    with _axes(7.2, 4.6) as (figure, axes):
        unit, scale = _length(_largest_amplitude(result))
        if result.references is not None:
            hertz = result.references.omega / (2 * np.pi)
            axes.plot(hertz, scale * result.references.free, "--", color=GREY, label="free (contact absent)")
            axes.plot(hertz, scale * result.references.stuck, ":", color=INK, label="stuck (closed, no slip)")
        if result.frf is not None:
            good = np.array([outcome == CONVERGED for outcome in result.frf.outcome])
            amplitude = scale * result.frf.amplitude(result.frf.output_names[0])
            axes.plot(result.frf.frequency[good], amplitude[good], color=BLUE, label="unworn contact")
        if result.wear is not None and result.wear_steps:
            wear = result.wear
            hertz = wear.omega / (2 * np.pi)
            unit_cycles, scale_cycles = _cycles(wear.cycles[-1])
            axes.plot(hertz, scale * wear.amplitude, color=ORANGE, lw=1.0, zorder=3)
            dots = axes.scatter(
                hertz, scale * wear.amplitude, 16, scale_cycles * wear.cycles, cmap=WEAR_MAP, zorder=4,
                label="cycle at each wear step",
            )  # fmt: skip
            figure.colorbar(dots, ax=axes, label=f"vibration cycles{unit_cycles}", pad=0.02)
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel=f"amplitude / {unit}", title="Frequency response")
        axes.legend(loc="best", fontsize=9)
    return figure


def cycles_per_step(result: Result) -> Figure:
    """Cycles that each wear step stands for."""
    wear = _wear(result)
    with _axes() as (figure, axes):
        count = wear.cycles_in_step[: result.wear_steps]
        unit, scale = _cycles(count.max())
        axes.step(np.arange(1, len(count) + 1), scale * count, where="mid", color=BLUE)
        axes.set(xlabel="wear step", ylabel=f"cycles in the step{unit}", title="Cycles per wear step")
        axes.set_ylim(bottom=0)
    return figure


def amplitude_against_cycles(result: Result) -> Figure:
    """Amplitude and frequency of the cycle that wears, against cycles."""
    wear = _wear(result)
    with _axes(7.2, 5.6, rows=2) as (figure, (upper, lower)):
        unit_cycles, scale_cycles = _cycles(wear.cycles[-1])
        unit, scale = _length(wear.amplitude.max())
        upper.plot(scale_cycles * wear.cycles, scale * wear.amplitude, ".-", color=BLUE, ms=4)
        upper.set(ylabel=f"amplitude / {unit}", title="Response under wear")
        lower.plot(scale_cycles * wear.cycles, wear.omega / (2 * np.pi), ".-", color=ORANGE, ms=4)
        lower.set(ylabel="frequency / Hz", xlabel=f"vibration cycles{unit_cycles}")
    return figure


def preload_against_cycles(result: Result) -> Figure:
    """Static normal force of the contact against cycles."""
    wear = _wear(result)
    with _axes() as (figure, axes):
        unit_cycles, scale_cycles = _cycles(wear.cycles[-1])
        unit, scale = ("kN", 1e-3) if wear.preload.max() >= 1e3 else ("N", 1.0)
        axes.plot(scale_cycles * wear.cycles, scale * wear.preload, ".-", color=BLUE, ms=4)
        axes.set(xlabel=f"vibration cycles{unit_cycles}", ylabel=f"preload / {unit}", title="Contact preload")
        axes.set_ylim(bottom=0)
    return figure


def depth_against_cycles(result: Result) -> Figure:
    """Largest, mean and smallest wear depth of the patch against cycles."""
    wear, patch = _wear(result), result.patch
    assert patch is not None
    with _axes() as (figure, axes):
        unit_cycles, scale_cycles = _cycles(wear.cycles[-1])
        unit, scale = _length(wear.depth.max())
        x = scale_cycles * wear.cycles
        mean = wear.depth @ patch.area / patch.area.sum()
        axes.fill_between(x, scale * wear.depth.min(1), scale * wear.depth.max(1), color=BLUE, alpha=0.18, lw=0)
        axes.plot(x, scale * wear.depth.max(1), color=RED, label="largest")
        axes.plot(x, scale * mean, color=BLUE, label="mean over the area")
        axes.plot(x, scale * wear.depth.min(1), color=GREEN, label="smallest")
        axes.set(xlabel=f"vibration cycles{unit_cycles}", ylabel=f"total wear depth / {unit}", title="Wear depth")
        axes.legend(loc="best", fontsize=9)
    return figure


def energy_against_cycles(result: Result) -> Figure:
    """Energy per cycle against cycles, and worn volume against accumulated energy."""
    wear, patch = _wear(result), result.patch
    assert patch is not None
    with _axes(7.2, 5.6, rows=2, share=False) as (figure, (upper, lower)):
        unit_cycles, scale_cycles = _cycles(wear.cycles[-1])
        upper.plot(scale_cycles * wear.cycles, wear.energy.sum(1), ".-", color=BLUE, ms=4)
        upper.set(xlabel=f"vibration cycles{unit_cycles}", ylabel="energy per cycle / J", title="Dissipated energy")
        spent = np.concatenate([[0.0], np.cumsum(wear.work.sum(1))[:-1]])
        lower.plot(spent * 1e-6, 1e9 * wear.depth @ patch.area, ".-", color=ORANGE, ms=4)
        lower.set(xlabel="accumulated energy / MJ", ylabel="worn volume / mm³")
    return figure


def hysteresis_loops(result: Result) -> Figure:
    """Tangential loops of four nodes at the start, the middle and the end of the wear run."""
    loops, patch = result.loops, result.patch
    assert loops is not None
    assert patch is not None
    chosen = chosen_pairs(result)
    tangential = [c for c, name in enumerate(patch.components) if name != "n"]
    # the direction in which these nodes move most
    swing = [np.ptp(loops.displacement[:, chosen, c], axis=-1).max() for c in tangential]
    component = tangential[int(np.argmax(swing))]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.6, 6.4), layout="constrained")
        grid = np.atleast_1d(figure.subplots(2, 2)).ravel()
        unit_x, scale_x = _length(max(swing) / 2)
        unit_f, scale_f = _force(np.abs(loops.force[:, chosen, component]).max())
        colors = mpl.colormaps[WEAR_MAP](np.linspace(0, 0.9, len(loops.row)))
        for axes, pair, label in zip(grid, chosen, CHOSEN, strict=True):
            for color, row, x, force in zip(
                colors, loops.row, loops.displacement[:, pair, component], loops.force[:, pair, component], strict=True
            ):
                closed = np.append(np.arange(len(x)), 0)
                middle = (x.max() + x.min()) / 2  # the static offset says nothing about the loop
                axes.plot(scale_x * (x - middle)[closed], scale_f * force[closed], color=color, label=f"step {row}")
            axes.set_title(f"{label}: pair {pair}", fontsize=10)
            axes.set(xlabel=f"displacement {patch.components[component]} / {unit_x}", ylabel=f"force / {unit_f}")
        grid[0].legend(fontsize=8)
        figure.suptitle("Friction hysteresis", x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


CHOSEN = ("middle", "most worn", "least worn", "most energy")


def chosen_pairs(result: Result) -> list[int]:
    """Pairs whose loops are shown, one for each name in CHOSEN."""
    patch, wear = result.patch, result.wear
    assert patch is not None
    middle = int(np.argmin(np.linalg.norm(patch.points - patch.points.mean(0), axis=1)))
    if wear is None or not len(wear.depth):
        return [middle] * len(CHOSEN)
    depth, energy = wear.depth[-1], wear.energy[: max(result.wear_steps, 1)].sum(0)
    return [middle, int(np.argmax(depth)), int(np.argmin(depth)), int(np.argmax(energy))]


@contextmanager
def _axes(width: float = 7.2, height: float = 4.2, rows: int = 1, share: bool = True) -> Iterator[tuple[Figure, Any]]:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.subplots(rows, 1, sharex=share)


def _wear(result: Result) -> Any:
    assert result.wear is not None
    return result.wear


def _largest_amplitude(result: Result) -> float:
    found = [0.0]
    if result.references is not None:
        found.append(float(result.references.free.max()))
    if result.wear is not None and len(result.wear.amplitude):
        found.append(float(result.wear.amplitude.max()))
    return max(found)


def _length(largest: float) -> tuple[str, float]:
    """Unit and factor in which lengths [m] of this size read well."""
    if largest >= 0.5e-3:
        return "mm", 1e3
    return ("µm", 1e6) if largest >= 0.5e-6 else ("nm", 1e9)


def _force(largest: float) -> tuple[str, float]:
    if largest >= 1e3:
        return "kN", 1e-3
    return ("N", 1.0) if largest >= 1 else ("mN", 1e3)


def _cycles(largest: float) -> tuple[str, float]:
    """Text after "cycles" and the factor that goes with it."""
    power = 3 * int(np.log10(max(largest, 1)) // 3)
    return ("", 1.0) if power == 0 else (f" / 10$^{power}$", 10.0**-power)
