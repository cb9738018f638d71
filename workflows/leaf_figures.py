"""Pictures of the leaf seal in the manner of the thesis's figures 6.5 to 6.14, and the summary of the study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch

from hbm.aft import history
from hbm.branch import Branch
from hbm.law import SEPARATES, STICKS
from workflows.leaf_cases import Case
from workflows.leaf_response import LINER_NODE, LeafResponse
from workflows.maps import draw_field, draw_status
from workflows.references import linear_references
from workflows.result import Patch
from workflows.style import BLUE, GREEN, INK, ORANGE, PRESSURE_MAP, RED, STATUS, STYLE

TITLES = {"response": "upper patch, centre", "middle": "centre of the leaf", "lower_corner": "lower corner"}
MICRO = 1e6


def patch_of(response: LeafResponse) -> Patch:
    """Both patches of the leaf as pictures need them, seen in the plane of the leaf: x to the right, y up."""
    i = response.part.interface
    frames = np.tile(np.eye(3), (i.n_pair, 1, 1))
    nodes = np.full(i.n_pair, -1)
    return Patch(i.components, nodes, i.points, frames, i.area, i.gap, i.faces, np.full(i.n_pair, np.nan))


def response_figure(response: LeafResponse, low: float, high: float) -> Figure:
    """Harmonics 0 and 1 of the three published nodes between the free and the stuck leaf (figures 6.6 and 6.9).

    low, high : range of the linear references [Hz]
    """
    branch, balance = response.branch, response.balance
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 9.5), layout="constrained")
        grid = figure.subplots(3, 2, sharex=True)
        points = response.chosen()
        for (still, moving), output in zip(grid, TITLES, strict=True):
            row = branch.output_names.index(output)
            references = linear_references(balance, output, 2 * np.pi * low, 2 * np.pi * high)
            hertz = references.omega / (2 * np.pi)
            moving.plot(hertz, MICRO * references.free, "--", color=BLUE, lw=1, label="linear, free")
            moving.plot(hertz, MICRO * references.stuck, "-", color=GREEN, lw=1, label="linear, stuck")
            still.axhline(MICRO * balance.at(branch.omega[0]).outputs_lin[row, 0], color=GREEN, lw=1)
            mean = MICRO * branch.response[:, row, 0]
            height = MICRO * np.hypot(branch.response[:, row, 1], branch.response[:, row, 2])
            for axes, values in ((still, mean), (moving, height)):
                draw_curve(axes, branch, response.stability.stable, values, RED)
                for number, point in enumerate(points, start=1):
                    axes.plot(branch.frequency[point], values[point], "o", color=INK, ms=4)
                    axes.annotate(
                        str(number), (branch.frequency[point], values[point]), (5, 4), textcoords="offset points"
                    )
            moving.set(yscale="log", ylabel="µm")
            moving.set_ylim(0.5 * height.min(), 3 * height.max())
            still.set_ylabel(f"{TITLES[output]}\nµm")
        grid[0, 0].set_title("Harmonic 0")
        grid[0, 1].set_title("Harmonic 1")
        grid[0, 1].plot([], [], color=RED, label="nonlinear, stable")
        grid[0, 1].plot([], [], ":", color=RED, label="nonlinear, unstable")
        grid[0, 1].legend(fontsize=8)
        for axes in grid[-1]:
            axes.set_xlabel("frequency / Hz")
            axes.set_xlim(low, high)
    return figure


def draw_curve(axes: Any, branch: Branch, stable: np.ndarray, values: np.ndarray, color: Any, **options: Any) -> None:
    """A response curve, dotted where it is unstable."""
    axes.plot(branch.frequency, np.where(stable, values, np.nan), color=color, **options)
    joined = ~stable | np.append(~stable[1:], False) | np.append(False, ~stable[:-1])
    axes.plot(branch.frequency, np.where(joined, values, np.nan), ":", color=color, lw=1.4)


def contact_figure(shown: Sequence[tuple[str, LeafResponse, int]]) -> Figure:
    """Mean pressure, status, share of the cycle in contact and impact velocity at points of curves (6.10 to 6.14).

    shown : title, response and point of each column
    """
    patch = patch_of(shown[0][1])
    states = [response.state(point) for _, response, point in shown]
    chatters = [response.chatter(point) for _, response, point in shown]
    pressure = [1e-3 * state.cycle.force[:, 0, 0] / patch.area for state in states]
    speed = [1e3 * one.impact_velocity for one in chatters]
    aspect = np.ptp(patch.flat[:, 1]) / np.ptp(patch.flat[:, 0])
    n = len(shown)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(3.1 * n + 1.8, 4 * (3.1 * aspect + 0.15) + 0.5), layout="constrained")
        grid = figure.subplots(4, n + 1, squeeze=False, width_ratios=[1.0] * n + [0.55])
        for column, ((name, _, _), state, one) in enumerate(zip(shown, states, chatters, strict=True)):
            pressed = draw_field(grid[0, column], patch, pressure[column], PRESSURE_MAP, float(np.max(pressure)))
            draw_status(grid[1, column], patch, state.cycle.status)
            touching = draw_field(grid[2, column], patch, one.touching, "viridis", 1.0)
            struck = draw_field(grid[3, column], patch, speed[column], "magma", float(np.max(speed)))
            grid[0, column].set_title(name, fontsize=10, fontweight="normal")
        for axes in grid[:, -1]:
            axes.axis("off")
        for axes in grid[:, :-1].ravel():
            axes.set(xticks=[], yticks=[])
            axes.spines[:].set_visible(False)
        bars = ((0, pressed, "mean pressure\nkPa"), (2, touching, "share of cycle\nin contact"))
        for row, drawn, label in (*bars, (3, struck, "impact velocity\nmm/s")):
            figure.colorbar(drawn, cax=grid[row, -1].inset_axes([0, 0.05, 0.12, 0.9]), label=label)
        kinds = (STICKS, STICKS | SEPARATES, SEPARATES)
        swatches = [Swatch(color=STATUS[kind][1], label=STATUS[kind][0]) for kind in kinds]
        grid[1, -1].legend(handles=swatches, loc="center left", bbox_to_anchor=(-0.2, 0.5), fontsize=8, handlelength=1)
    return figure


def history_figure(response: LeafResponse, points: Sequence[int], names: Sequence[str]) -> Figure:
    """Displacement of the three nodes and force of three pairs over one cycle at points of the curve."""
    branch, balance = response.branch, response.balance
    angle = np.linspace(0.0, 2 * np.pi, 257)
    functions = balance.basis.functions(angle)
    pairs = chosen_pairs(response)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.7 * len(points) + 1.2, 5.6), layout="constrained")
        grid = figure.subplots(2, len(points), sharex=True, squeeze=False)
        for (above, below), point, name in zip(grid.T, points, names, strict=True):
            outputs = MICRO * branch.response[point] @ functions.T
            for output, color in zip(TITLES, (BLUE, ORANGE, GREEN), strict=True):
                above.plot(
                    angle / (2 * np.pi), outputs[branch.output_names.index(output)], color=color, label=TITLES[output]
                )
            _, force = history(balance.law, response.state(point).x, balance.parameters, balance.basis, balance.memory)
            for (label, pair), color in zip(pairs.items(), (BLUE, GREEN, RED), strict=True):
                below.plot(balance.basis.angle / (2 * np.pi), force[pair, 0], color=color, label=label)
            above.set_title(name, fontsize=10, fontweight="normal")
            below.set_xlabel("time / period")
        grid[0, 0].set_ylabel("displacement z / µm")
        grid[1, 0].set_ylabel("contact force / N")
        grid[0, 0].legend(fontsize=7)
        grid[1, 0].legend(fontsize=7)
    return figure


def chosen_pairs(response: LeafResponse) -> dict[str, int]:
    """Pairs whose force is shown: the middle of the upper patch, the middle and an end of the lower one."""
    points, pairs = response.part.interface.points, response.part.pairs
    found = {}
    for label, face, end in (
        ("upper, middle", "upper_contact", False),
        ("lower, middle", "lower_contact", False),
        ("lower, end", "lower_contact", True),
    ):
        x, y = points[pairs[face], 0], points[pairs[face], 1]
        score = -x if end else np.abs(x) + 1e-3 * np.abs(y - y.mean())
        found[label] = pairs[face].start + int(np.argmin(score))
    return found


def summary_figure(studied: Mapping[str, Sequence[tuple[Case, LeafResponse]]]) -> Figure:
    """Response curves of all configurations, one panel for each parameter; dotted where unstable."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14, 8.5), layout="constrained")
        grid = figure.subplots(2, 4, sharey=True).ravel()
        for axes, (group, responses) in zip(grid, studied.items(), strict=False):
            colors = mpl.colormaps["viridis"](np.linspace(0, 0.9, len(responses)))
            for color, (case, response) in zip(colors, responses, strict=True):
                height = MICRO * response.branch.amplitude(LINER_NODE)
                draw_curve(axes, response.branch, response.stability.stable, height, color, lw=1.3, label=case.label)
            axes.set(yscale="log", title=group, xlabel="frequency / Hz")
            axes.legend(fontsize=7)
        for axes in grid[len(studied) :]:
            axes.axis("off")
        for axes in grid[::4]:
            axes.set_ylabel("amplitude of the lower corner / µm")
    return figure
