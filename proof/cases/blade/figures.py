"""Pictures of the bladed disk in the manner of the thesis's figures 4.11 to 4.17, and its Campbell diagram."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tribodyn.style import BLUE, GREY, INK, ORANGE, RED
from tribodyn.workflows.pictures.figures import axes_of as plot_axes
from tribodyn.workflows.pictures.maps import patch_maps
from tribodyn.workflows.pictures.wheel_diagrams import nodal_diameters as plot_nodal_diameters, shades
from tribodyn.workflows.result.result import Result

if TYPE_CHECKING:
    from proof.cases.blade.study import Curve, Worn

MILLI = 1e3
SHOWN_DIAMETERS = 15  # in the thesis's figure 4.11


def diagram_figure(families: Mapping[str, np.ndarray]) -> Figure:
    """Frequencies over nodal diameters, free and stuck (figure 4.11), and how far the thesis shows them.

    families : "free" and "stuck" (n_diameter, family) [Hz]"""
    figure = plot_nodal_diameters(families)
    figure.axes[0].axvline(SHOWN_DIAMETERS, color=INK, lw=0.8, ls=":")
    return figure


def orders_figure(curves: Mapping[int, Curve]) -> Figure:
    """Responses to several engine orders, with free and stuck references (figure 4.12)."""
    with plot_axes(8.0, 4.8) as (figure, axes):
        for (order, curve), color in zip(curves.items(), shades(len(curves)), strict=True):
            hertz = curve.references.omega / (2 * np.pi)
            axes.plot(hertz, MILLI * curve.references.stuck, ":", color=color, lw=1)
            axes.plot(curve.branch.frequency, MILLI * curve.amplitude(), color=color, label=f"engine order {order}")
        first = next(iter(curves.values())).references
        axes.plot(first.omega / (2 * np.pi), MILLI * first.free, "--", color=GREY, lw=1.2, label="free")
        axes.plot([], [], ":", color=INK, lw=1, label="stuck, colour of its order")
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel="tip amplitude / mm", title="Engine orders")
        axes.legend(fontsize=8, ncols=2)
    return figure


def forces_figure(curves: Mapping[float, Curve]) -> Figure:
    """Responses to rising excitation at fixed preload, per force, between free and stuck (figure 4.13).

    curves : by amplitude of the force [N]"""
    with plot_axes(7.6, 4.8) as (figure, axes):
        kilo = 1e-3
        item, first = next(iter(curves.items()))
        hertz = first.references.omega / (2 * np.pi)
        scale = MILLI / (kilo * item)
        axes.plot(hertz, scale * first.references.free, "--", color=GREY, lw=1.2, zorder=3, label="free")
        axes.plot(hertz, scale * first.references.stuck, ":", color=INK, lw=1.2, zorder=3, label="stuck")
        for (force, curve), color in zip(curves.items(), shades(len(curves)), strict=True):
            scaled = MILLI * curve.amplitude() / (kilo * force)
            axes.plot(curve.branch.frequency, scaled, color=color, label=f"{kilo * force:g} kN")
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel="tip amplitude per force / (mm/kN)")
        axes.set_title("Rising excitation, fixed preload")
        axes.legend(fontsize=8, ncols=2)
    return figure


def maps_figure(result: Result, rows: np.ndarray) -> Figure:
    """Depth, status and pressure of the right shroud at some wear steps (figure 4.14)."""
    return patch_maps(result, rows)


def backbone_figure(curves: Sequence[tuple[int, Curve]], worn: Worn) -> Figure:
    """Responses of the worn shrouds, and the way of their peak (figure 4.15)."""
    history = worn.history
    with plot_axes(7.6, 4.8) as (figure, axes):
        references = curves[0][1].references
        hertz = references.omega / (2 * np.pi)
        axes.plot(hertz, MILLI * references.free, "--", color=GREY, lw=1.2, label="free")
        axes.plot(hertz, MILLI * references.stuck, ":", color=INK, lw=1.2, label="stuck")
        for (row, curve), color in zip(curves, shades(len(curves)), strict=True):
            label = f"before wear step {row + 1}, {MILLI * history.depth[row].max():.2f} mm"
            axes.plot(curve.branch.frequency, MILLI * curve.amplitude(), color=color, lw=1.2, label=label)
        way = history.omega / (2 * np.pi), MILLI * history.amplitude
        axes.plot(*way, ".-", color=RED, ms=5, label="peak under wear")
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel="tip amplitude / mm")
        axes.set_title(f"Response under wear, step {100 * worn.step:g} % of delta_max")
        axes.legend(fontsize=8)
    return figure


def cycles_figure(worn: Worn, published: int | None) -> Figure:
    """Cycles that each wear step stands for; published : number of wear steps (figure 4.16)."""
    count = worn.history.cycles_in_step[worn.history.cycles_in_step > 0]
    with plot_axes() as (figure, axes):
        axes.step(np.arange(1, len(count) + 1), count, where="mid", color=BLUE, label=f"ours, {len(count)} steps")
        if published is not None:
            label = f"contact lost in the thesis, {published} steps"
            axes.axvline(published, color=ORANGE, ls="--", label=label)
        axes.set(yscale="log", xlabel="wear step", ylabel="cycles in the step")
        axes.set_title(f"Cycles per wear step of {100 * worn.step:g} % of delta_max")
        axes.legend(fontsize=9)
    return figure


def peaks_figure(runs: Sequence[Worn]) -> Figure:
    """Largest response over cycles for every wear step (figure 4.17)."""
    with plot_axes(7.6, 4.6) as (figure, axes):
        for worn, color in zip(runs, shades(len(runs)), strict=True):
            history = worn.history
            label = f"{100 * worn.step:g} % of delta_max"
            axes.plot(1e-6 * history.cycles, MILLI * history.amplitude, ".-", color=color, ms=3, lw=1.2, label=label)
        axes.set(yscale="log", xlabel="vibration cycles / 10$^6$", ylabel="peak tip amplitude / mm")
        axes.set_title("Largest response against cycles")
        axes.legend(fontsize=9)
    return figure
