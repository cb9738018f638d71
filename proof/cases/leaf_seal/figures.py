"""Pictures of the leaf seal in the manner of the thesis's figures 6.5 to 6.14, and the summary of the study."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch

from proof.cases.leaf_seal.record import Record
from proof.cases.leaf_seal.response import LeafResponse
from proof.problems import linear_references
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS
from tribodyn.style import BLUE, GREEN, INK, ORANGE, PRESSURE_MAP, RED, STATUS, STYLE
from tribodyn.workflows.pictures.maps import draw_field, draw_status
from tribodyn.workflows.result.result import Patch
from tribodyn.workflows.run.settings import OUTPUT

TITLES = {"upper_centre": "upper patch, centre", "middle": "centre of the leaf", OUTPUT: "lower corner"}
MICRO = 1e6


def patch_of(response: LeafResponse) -> Patch:
    """Both patches of the leaf as pictures need them, seen in the plane of the leaf: x to the right, y up."""
    i = response.part.interface
    frames = np.tile(np.eye(3), (i.n_pair, 1, 1))
    nodes = np.full(i.n_pair, -1)
    return Patch(i.components, nodes, i.points, frames, i.area, i.gap, i.faces, np.full(i.n_pair, np.nan))


def response_figure(response: LeafResponse, low: float, high: float) -> Figure:
    """Harmonics 0 and 1 of the three published nodes between the free and the stuck leaf (figures 6.6 and 6.9).

    low, high : range of the linear references [Hz]"""
    branch, balance = response.branch, response.balance
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 9.5), layout="constrained")
        grid = figure.subplots(3, 2, sharex=True)
        points = response.chosen()
        for (still, moving), output in zip(grid, TITLES, strict=True):
            row = branch.output_names.index(output)
            references = linear_references(balance, low, high, output)
            hertz = references.omega / (2 * np.pi)
            moving.plot(hertz, MICRO * references.free, "--", color=BLUE, lw=1, label="linear, free")
            moving.plot(hertz, MICRO * references.stuck, "-", color=GREEN, lw=1, label="linear, stuck")
            still.axhline(MICRO * balance.at(branch.omega[0]).outputs_lin[row, 0], color=GREEN, lw=1)
            mean = MICRO * branch.response[:, row, 0]
            height = MICRO * np.hypot(branch.response[:, row, 1], branch.response[:, row, 2])
            for axes, values in ((still, mean), (moving, height)):
                draw_curve(axes, branch.frequency, response.stability.stable, values, RED)
                lower = 2 if values[points[1]] < values[points[3]] else 4  # neighbours on two branches
                for number, point in enumerate(points, start=1):
                    axes.plot(branch.frequency[point], values[point], "o", color=INK, ms=4)
                    neighbour = (-3, -13) if number == lower else (5, 4)
                    axes.annotate(
                        str(number), (branch.frequency[point], values[point]), neighbour, textcoords="offset points"
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


def draw_curve(
    axes: Any, frequency: np.ndarray, stable: np.ndarray, values: np.ndarray, color: Any, **options: Any
) -> None:
    """A response curve, dotted where it is unstable."""
    axes.plot(frequency, np.where(stable, values, np.nan), color=color, **options)
    joined = ~stable | np.append(~stable[1:], False) | np.append(False, ~stable[:-1])
    axes.plot(frequency, np.where(joined, values, np.nan), ":", color=color, lw=1.4)


def contact_figure(shown: Sequence[tuple[str, LeafResponse, int]]) -> Figure:
    """Mean pressure, status, share of the cycle in contact and impact velocity at points of curves (6.10 to 6.14).

    shown : title, response and point of each column"""
    patch = patch_of(shown[0][1])
    states = [response.state(point) for _, response, point in shown]
    chatters = [response.chatter(point) for _, response, point in shown]
    pressure = [1e-3 * state.cycle.force[:, 0, 0] / patch.area for state in states]
    speed = [1e3 * contact.impact_velocity for contact in chatters]
    aspect = np.ptp(patch.flat[:, 1]) / np.ptp(patch.flat[:, 0])
    n = len(shown)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(3.1 * n + 1.8, 4 * (3.1 * aspect + 0.15) + 0.5), layout="constrained")
        grid = figure.subplots(4, n + 1, squeeze=False, width_ratios=[1.0] * n + [0.55])
        for column, ((name, _, _), state, contact) in enumerate(zip(shown, states, chatters, strict=True)):
            pressed = draw_field(grid[0, column], patch, pressure[column], PRESSURE_MAP, float(np.max(pressure)))
            draw_status(grid[1, column], patch, state.cycle.status)
            touching = draw_field(grid[2, column], patch, contact.touching, "viridis", 1.0)
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
    pairs, shares = chosen_pairs(response), np.append(balance.basis.angle / (2 * np.pi), 1.0)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.7 * len(points) + 2.2, 5.6), layout="constrained")
        grid = figure.subplots(2, len(points), sharex=True, squeeze=False)
        for (upper, lower), point, name in zip(grid.T, points, names, strict=True):
            outputs = MICRO * branch.response[point] @ functions.T
            for output, color in zip(TITLES, (BLUE, ORANGE, GREEN), strict=True):
                upper.plot(
                    angle / (2 * np.pi), outputs[branch.output_names.index(output)], color=color, label=TITLES[output]
                )
            _, force = balance.history(response.state(point))
            for (label, pair), color in zip(pairs.items(), (BLUE, GREEN, RED), strict=True):
                lower.plot(shares, np.append(force[pair, 0], force[pair, 0, 0]), color=color, label=label)
            upper.set_title(name, fontsize=10, fontweight="normal")
            lower.set_xlabel("time / period")
        grid[0, 0].set_ylabel("displacement z / µm")
        grid[1, 0].set_ylabel("contact force / N")
        for axes in grid[:, -1]:
            axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def chosen_pairs(response: LeafResponse) -> dict[str, int]:
    """Pairs whose force is shown: the middle of the upper patch, the middle and an end of the lower one."""
    points, pairs = response.part.interface.points, response.part.pairs
    result = {}
    for label, face, end in (
        ("upper, middle", "upper_contact", False),
        ("lower, middle", "lower_contact", False),
        ("lower, end", "lower_contact", True),
    ):
        x, y = points[pairs[face], 0], points[pairs[face], 1]
        score = -x if end else np.abs(x) + 1e-3 * np.abs(y - y.mean())
        result[label] = pairs[face].start + int(np.argmin(score))
    return result


def summary_figure(records: Sequence[Record]) -> Figure:
    """Response curves of all configurations, one panel for each parameter, dotted where unstable; and their seconds."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record.case.group, []).append(record)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14, 8.5), layout="constrained")
        panels = figure.subplots(2, 4).ravel()
        for axes, (group, members) in zip(panels, groups.items(), strict=False):
            colors = mpl.colormaps["viridis"](np.linspace(0, 0.9, len(members)))
            for color, member in zip(colors, members, strict=True):
                label = member.case.label if member.complete else f"{member.case.label}: incomplete"
                draw_curve(axes, member.frequency, member.stable, MICRO * member.amplitude, color, lw=1.3, label=label)
            axes.set(yscale="log", title=group, xlabel="frequency / Hz")
            axes.legend(fontsize=7)
        amplitudes = MICRO * np.concatenate([record.amplitude for record in records if len(record.amplitude)])
        for axes in panels[: len(groups)]:
            axes.set_ylim(0.8 * amplitudes.min(), 2 * amplitudes.max())
        for axes in panels[: len(groups) : 4]:
            axes.set_ylabel("amplitude of the lower corner / µm")
        for axes in panels[len(groups) : -1]:
            axes.axis("off")
        draw_seconds(panels[-1], groups)
    return figure


def draw_seconds(axes: Any, groups: Mapping[str, Sequence[Record]]) -> None:
    """Processor time of every configuration, one row of marks for each parameter."""
    total = 0.0
    for place, (group, members) in enumerate(groups.items()):
        axes.text(0.03, place, group, fontsize=8, transform=axes.get_yaxis_transform(), va="center")
        seconds = [member.numbers["seconds"] for member in members if "seconds" in member.numbers]
        axes.plot(seconds, [place] * len(seconds), "o", color=BLUE, ms=5, alpha=0.7)
        total += sum(seconds)
    axes.set(title=f"seconds, in all {total:.0f}", xlabel="processor time of model and curve / s")
    axes.set_xlim(-0.6 * axes.get_xlim()[1], None)  # room for the names
    axes.set_xticks([tick for tick in axes.get_xticks() if tick >= 0])
    axes.set_yticks([])
    axes.set_ylim(len(groups) - 0.5, -0.5)
