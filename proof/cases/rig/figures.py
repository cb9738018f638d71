"""The thesis's figures 5.26 to 5.31 redrawn with ours, and table 5.3 as a picture.

Published numbers are marked where the text gives them; the curves of the lost figures are not drawn."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from proof.cases.rig import published
from proof.cases.rig.cases import READINGS, Study, solved
from proof.cases.rig.wear import WORN, RigWear
from tribodyn.style import BLUE, GREEN, GREY, INK, ORANGE, RED, STYLE, WEAR_MAP
from tribodyn.workflows.pictures.maps import draw_field

MILLION, MICRO = 1e-6, 1e6
COLOURS = (BLUE, ORANGE, GREEN)
MARKS: dict[str, Any] = {"marker": "D", "color": RED, "ls": "none", "ms": 6, "zorder": 5}


def draw(study: Study, folder: Path) -> list[Path]:
    """Write every figure as a PNG; returns their paths."""
    figures: list[Callable[[Study], Figure]] = [
        energy_against_force, contact_area_maps, total_wear, worn_area, loops, preload, energy, response,
    ]  # fmt: skip
    paths = []
    for function in figures:
        with mpl.rc_context(STYLE):
            paths.append(folder / f"{function.__name__}.png")
            function(study).savefig(paths[-1])
    return paths


def energy_against_force(study: Study) -> Figure:
    """Table 5.3: energy per cycle and sliding range against shaker force."""
    figure, (remaining, second) = _axes(9.0, 3.8, 2)
    force = list(published.TABLE_5_3)
    for saved, style in zip(READINGS, ("o-", "s:"), strict=True):
        cycles = study.cycles[saved]
        name = f"ours, harmonics 0 to {saved[-1]}"
        remaining.plot(force, [MICRO * cycles[f].energy for f in force], style, color=BLUE, ms=4, label=name)
        second.plot(force, [2 * MICRO * cycles[f].slip for f in force], style, color=BLUE, ms=4, label=name)
    for axes, column in ((remaining, 0), (second, 1)):
        axes.plot(force, [MICRO * row[column] for row in published.TABLE_5_3.values()], label="experiment", **MARKS)
        axes.set(yscale="log", xlabel="shaker force / N")
    remaining.set(ylabel="energy per cycle / µJ", title="Table 5.3: 290 Hz, 31 N")
    second.set(ylabel="sliding range / µm")
    remaining.legend(fontsize=9)
    return figure


def contact_area_maps(study: Study) -> Figure:
    """Figure 5.26: depth at the cycles of the experiment's scans, with the worn part of the face."""
    run, patch = study.runs[0], study.patch
    cycles = [c for c in published.SCANS if c < run.history.cycles[-1]] + [float(run.history.cycles[-1])]
    largest = MICRO * run.history.depth.max()
    with mpl.rc_context({"axes.grid": False}):
        figure = Figure(figsize=(10.0, 3.0), layout="constrained")
        grid = figure.subplots(2, 4, sharex=True, sharey=True).ravel()
    for axes, count in zip(grid, cycles, strict=False):
        depth = np.array([np.interp(count, run.history.cycles, column) for column in run.history.depth.T])
        shown = draw_field(axes, patch, MICRO * depth, WEAR_MAP, largest)
        share = float((depth > WORN) @ run.area / run.area.sum())
        axes.set_title(f"{MILLION * count:.3g} million: {share:.0%}", fontsize=10, fontweight="normal")
    for axes in grid[len(cycles) :]:
        axes.axis("off")
    figure.colorbar(shown, ax=list(grid), label="total wear depth / µm")
    figure.suptitle("Figure 5.26: worn part of the face at the cycles of the scans; the column is below", fontsize=11)
    return figure


def total_wear(study: Study) -> Figure:
    """Figure 5.27: total wear when the preload is lost."""
    run = study.runs[0]
    path, y = 1e3 * run.points.T
    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    corners = study.patch.faces
    triangles = np.concatenate([corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)])
    height = -MICRO * run.history.depth[-1]
    shown = axes.plot_trisurf(y, path, height, triangles=triangles, cmap=WEAR_MAP + "_r", lw=0.2)
    figure.colorbar(shown, ax=axes, label="total wear / µm", shrink=0.7)
    axes.set(xlabel="sliding direction / mm", ylabel="along the beam / mm", yticks=[-1, 0, 1])
    axes.set_title("Figure 5.27: total wear", loc="left")
    axes.set_box_aspect((5, 3, 2), zoom=0.9)
    axes.view_init(35, -60)
    return figure


def worn_area(study: Study) -> Figure:
    """Figure 5.28: worn area against cycles."""
    figure, axes = _axes(7.2, 4.2)
    for run, colour in zip(study.runs, COLOURS, strict=True):
        axes.plot(MILLION * run.history.cycles, 100 * run.worn_share, color=colour, label=_name(run))
    at = MILLION * published.LIFE_MEASURED
    axes.plot([at], [100 * published.WORN_AREA], label="experiment, contact lost", **MARKS)
    axes.set(xlabel="million cycles", ylabel="worn area / % of the face", title="Figure 5.28: worn area", ylim=(0, 105))
    axes.legend(fontsize=9)
    return figure


def loops(study: Study) -> Figure:
    """Figure 5.28 (second of that number): loops of the whole face at five stages of wear."""
    figure, axes = _axes(7.2, 4.6)
    run = study.runs[0]
    colours = mpl.colormaps[WEAR_MAP](np.linspace(0, 0.9, len(study.stages)))
    for stage, colour in zip(study.stages, colours, strict=True):
        middle = (stage.sliding.max() + stage.sliding.min()) / 2
        x, force = MICRO * (stage.sliding - middle), stage.friction
        name = f"{MILLION * run.history.cycles[stage.row]:.3g} million cycles, {run.rest[stage.row]:.2g} N at rest"
        axes.plot(np.append(x, x[0]), np.append(force, force[0]), color=colour, label=name)
    for sign in (1, -1):
        limit = sign * study.friction * published.PRELOAD
        axes.axhline(limit, color=RED, ls="--", lw=1, label="friction limit of 31 N, published" if sign > 0 else None)
    axes.set(xlabel="mean sliding displacement / µm", ylabel="friction force / N", title="Figure 5.28: loops with wear")
    axes.legend(fontsize=8)
    return figure


def preload(study: Study) -> Figure:
    """Figure 5.29: preload against friction work and against cycles, at rest and under vibration."""
    figure, two_results = _axes(10.0, 4.2, 2)
    ends = (published.WORK * 1e-3, published.LIFE_MEASURED * MILLION)
    for axes, end, of in zip(two_results, ends, (_kilojoules, _millions), strict=True):
        for run, colour in zip(study.runs, COLOURS, strict=True):
            axes.plot(of(run), run.rest, color=colour, label=_name(run))
            axes.plot(of(run), run.history.preload, ":", color=colour, lw=1.2)
        axes.plot([], [], ":", color=GREY, label="mean force while shaking")
        axes.plot([0, end], [published.PRELOAD, 0], label="experiment, start and loss", **MARKS)
        axes.set_ylim(bottom=0)
    two_results[0].set(xlabel="friction work / kJ", ylabel="preload / N", title="Figure 5.29: preload")
    two_results[1].set(xlabel="million cycles")
    two_results[1].legend(fontsize=8)
    return figure


def energy(study: Study) -> Figure:
    """Figure 5.30: energy per cycle against cycles."""
    figure, axes = _axes(7.2, 4.2)
    for run, colour in zip(study.runs, COLOURS, strict=True):
        axes.plot(_millions(run), MICRO * run.energy, color=colour, label=_name(run))
    start, mean = published.TABLE_5_3[70.0][0], published.WORK / published.LIFE_MEASURED
    axes.plot([0.0], [MICRO * start], label="experiment, start (table 5.3)", **MARKS)
    axes.axhline(MICRO * mean, color=RED, ls="--", lw=1, label="experiment, 12 kJ over 16 million cycles")
    axes.set(xlabel="million cycles", ylabel="energy per cycle / µJ", title="Figure 5.30: energy per cycle")
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=8)
    return figure


def response(study: Study) -> Figure:
    """Figure 5.31: response at five stages of wear between the open and the stuck one."""
    figure, axes = _axes(7.2, 4.6)
    hertz = study.references.omega / (2 * np.pi)
    axes.plot(hertz, MICRO * study.references.free, "--", color=GREY, label="open, linear")
    axes.plot(hertz, MICRO * study.references.stuck, ":", color=INK, label="stuck, linear")
    colours = mpl.colormaps[WEAR_MAP](np.linspace(0, 0.9, len(study.stages)))
    for stage, colour in zip(study.stages, colours, strict=True):
        good = solved(stage.response)
        amplitude = MICRO * stage.response.amplitude("response")
        name = f"{MILLION * study.runs[0].history.cycles[stage.row]:.3g} million cycles"
        axes.plot(stage.response.frequency[good], amplitude[good], color=colour, label=name)
    low, high = hertz[0], hertz[-1]
    for modes, style, name in ((published.OPEN, "--", "open"), (published.STUCK, ":", "stuck")):
        for value in (value for _, value in modes if low <= value <= high):
            axes.axvline(value, color=RED, ls=style, lw=1)
            axes.annotate(
                f"{name} {value:.0f}", (value, 0.02), (3, 0), textcoords="offset points", color=RED, fontsize=7,
                xycoords=("data", "axes fraction"), rotation=90, va="bottom",
            )  # fmt: skip
    axes.set(yscale="log", xlabel="frequency / Hz", ylabel="amplitude / µm", ylim=(None, 5 * axes.get_ylim()[1]))
    axes.set_title("Figure 5.31: response at 70 N under wear; red: published modes")
    axes.legend(fontsize=7, loc="upper right", ncols=2)
    return figure


def _axes(width: float, height: float, columns: int = 1) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, columns)


def _name(run: RigWear) -> str:
    return f"mating height {MICRO * run.shift:+.0f} µm"


def _millions(run: RigWear) -> np.ndarray:
    return np.asarray(MILLION * run.history.cycles)


def _kilojoules(run: RigWear) -> np.ndarray:
    return np.asarray(1e-3 * run.spent)
