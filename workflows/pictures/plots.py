"""Curves of a result, drawn with matplotlib: each function draws one figure, `draw` writes all that can be drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tribodyn.hbm.wear.history import WearHistory
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import maps
from tribodyn.workflows.pictures.figures import (
    axes_of,
    force_unit,
    heading,
    length_unit,
    log_axis,
    save,
    status_name,
    titled,
)
from tribodyn.workflows.pictures.theme import BLUE, CYCLE, GREEN, GREY, INK, ORANGE, RED, STATUS, STYLE, WEAR_MAP
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.states import has_states, shown_cycles, state_of
from tribodyn.workflows.result.summary import LARGEST_BEND, order_of_line, size_of

BIFURCATIONS = {"fold": "o", "flip": "s", "Neimark-Sacker": "D"}  # markers


def draw(result: Result, folder: Path, formats: Sequence[str] = ("png",), dpi: int | None = None) -> list[Path]:
    """Write every figure that the result has data for; returns their paths."""
    return [path for name, make in figures(result).items() for path in save(make(result), folder / name, formats, dpi)]


def figures(result: Result) -> dict[str, Callable[[Result], Figure]]:
    """The figures that a result has data for, by name."""
    worn = result.wear_steps > 0
    mapped = len(result.patch.faces) > 0 and has_states(result)
    every: list[tuple[str, Callable[[Result], Figure], bool]] = [
        ("frf", response, result.response is not None or result.wear is not None),
        ("control", controlled, result.response is not None and result.response.controlled),
        ("outputs", output_amplitudes, result.response is not None and len(result.response.output_names) > 1),
        *((name, draw, worn) for name, draw in COURSES.items()),
        ("hysteresis", hysteresis, result.loops is not None and has_friction(result)),
        ("normal", hysteresis, result.loops is not None and not has_friction(result)),
        ("patch", maps.patch_maps, mapped),
        ("status_maps", maps.status_maps, mapped and worn),
    ]
    return {name: function for name, function, possible in every if possible}


def response(result: Result) -> Figure:
    """Unworn response between its free and stuck references, and the path of the peak under wear."""
    with axes_of(7.2, 4.6) as (figure, axes):
        unit, scale = length_unit(_largest_amplitude(result))
        if result.references is not None:
            hertz = result.references.omega / (2 * np.pi)
            both = (
                (result.references.free, "--", GREY, "free (contact absent)"),
                (result.references.stuck, ":", INK, "stuck (closed, no slip)"),
            )
            for height, style, color, label in both:
                if np.isfinite(height).any():
                    axes.plot(hertz, scale * height, style, color=color, label=label)
        if result.response is not None:
            good = result.response.converged
            amplitude = scale * result.response.amplitude(result.response.output_names[0])
            _curve(axes, result, good, amplitude, scale)
        if result.wear is not None and result.wear_steps:
            wear = result.wear
            hertz = wear.omega / (2 * np.pi)
            unit_cycles, scale_cycles = _cycles(shown_cycles(wear))
            axes.plot(*with_gaps(wear, hertz, scale * wear.amplitude), color=ORANGE, zorder=3)
            dots = axes.scatter(
                hertz, scale * wear.amplitude, 16, scale_cycles * wear.cycles, cmap=WEAR_MAP, zorder=4,
                vmax=scale_cycles * shown_cycles(wear), label="cycle at each wear step",
            )  # fmt: skip
            figure.colorbar(dots, ax=axes, label=f"vibration cycles{unit_cycles}", pad=0.02)
            if result.worn is not None:
                colors = mpl.colormaps[WEAR_MAP](wear.cycles[result.worn.row] / shown_cycles(wear))
                for omega, amplitude, color in zip(result.worn.omega, result.worn.amplitude, colors, strict=True):
                    axes.plot(omega / (2 * np.pi), scale * amplitude, color=color)
        drawn = np.concatenate([line.get_ydata() for line in axes.lines])
        log_axis(axes.yaxis, *_ends(drawn))
        beyond(axes, result, scale)
        if (order := order_of_line(result)) is not None:
            axes.secondary_xaxis("top", functions=(lambda f: 60 * f / order, lambda n: order * n / 60)).set_xlabel(
                f"speed / rpm (engine order {order})"
            )
        axes.set(xlabel="frequency / Hz", ylabel=f"amplitude / {unit}", title=titled(result, "frequency response"))
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def _curve(axes: Any, result: Result, good: np.ndarray, amplitude: np.ndarray, scale: float) -> None:
    """The response curve: unstable stretches dashed, bifurcations marked, the range over load paths as a band."""
    frf, marks, bounds = result.response, result.stability, result.bounds
    assert frf is not None
    hertz = frf.frequency
    if bounds is not None:
        low, high = scale * bounds.amplitude_low, scale * bounds.amplitude_high
        axes.fill_between(hertz[good], low[good], high[good], color=BLUE, alpha=0.25, lw=0, label="any load path")
    if marks is None:
        axes.plot(hertz[good], amplitude[good], color=BLUE, label="unworn contact")
        return
    # each stretch between neighbouring points is stable where both are
    both = marks.stable[:-1] & marks.stable[1:]
    solved = good[:-1] & good[1:]
    for kind, style, name in ((both, "-", "unworn contact, stable"), (~both, ":", "unstable")):
        ends = np.flatnonzero(kind & solved)
        x = np.stack([hertz[ends], hertz[ends + 1], np.full(len(ends), np.nan)], axis=1).ravel()
        y = np.stack([amplitude[ends], amplitude[ends + 1], np.full(len(ends), np.nan)], axis=1).ravel()
        axes.plot(x, y, style, color=BLUE if style == "-" else RED, label=name if len(ends) else None)
    for kind, marker in BIFURCATIONS.items():
        at = [p for p, found in zip(marks.position, marks.kinds, strict=True) if found == kind]
        if at:
            x, y = (np.interp(at, np.arange(len(hertz)), values) for values in (hertz, amplitude))
            axes.plot(x, y, marker, color=RED, ms=6, label=kind)


def wear(result: Result, what: str = "depth") -> Figure:
    """Course of the wear against cycles: depth, peak, preload, energy or status, or the cycles_per_step.

    Raises  ValueError where nothing was worn, or for another word
    """
    if not result.wear_steps:
        raise Refusal("the result holds no wear steps: its scene needs [wear] with max_steps above 0")
    if what not in COURSES:
        raise Refusal(f'no wear plot "{what}": there are {", ".join(COURSES)}')
    return COURSES[what](result)


def cycles_per_step(result: Result) -> Figure:
    """Cycles that each wear step stands for."""
    wear = _wear(result)
    with axes_of() as (figure, axes):
        count = wear.cycles_in_step[: result.wear_steps]
        unit, scale = _cycles(count.max())
        axes.step(np.arange(1, len(count) + 1), scale * count, where="mid", color=BLUE)
        axes.set(xlabel="wear step", ylabel=f"cycles in the step{unit}", title=titled(result, "cycles per wear step"))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if count.max() > 30 * count.min():
            log_axis(axes.yaxis, *_ends(scale * count))
        else:
            axes.set_ylim(bottom=0)
    return figure


def amplitude_against_cycles(result: Result) -> Figure:
    """Amplitude and frequency of the cycle that wears, against cycles."""
    wear = _wear(result)
    with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
        scale_cycles = cycle_axis(lower, wear)
        unit, scale = length_unit(wear.amplitude.max())
        _course(upper, scale_cycles, wear, scale * wear.amplitude, BLUE)
        beyond(upper, result, scale)
        upper.set(ylabel=f"amplitude / {unit}", title=titled(result, "response under wear"))
        _course(lower, scale_cycles, wear, wear.frequency, ORANGE)
        lower.set(ylabel="frequency / Hz")
    return figure


def preload_against_cycles(result: Result) -> Figure:
    """Mean normal force of the contact against cycles, and that at rest where the run ends by it."""
    wear = _wear(result)
    with axes_of() as (figure, axes):
        scale_cycles = cycle_axis(axes, wear)
        unit, scale = ("kN", 1e-3) if wear.preload.max() >= 1e3 else ("N", 1.0)
        if wear.preload_at_rest is not None:
            axes.plot(scale_cycles * wear.cycles, scale * wear.preload_at_rest, "--", color=ORANGE, label="at rest")
            axes.legend(loc="best")
        _course(axes, scale_cycles, wear, scale * wear.preload, BLUE)
        axes.set(ylabel=f"preload / {unit}", title=titled(result, "preload of the contact"))
        axes.set_ylim(bottom=0)
    return figure


def depth_against_cycles(result: Result) -> Figure:
    """Largest, mean and smallest wear depth of the patch, and the worn part of its area, against cycles."""
    wear, patch = _wear(result), result.patch
    with axes_of(7.2, 5.6, rows=2) as (figure, (axes, below)):
        scale_cycles = cycle_axis(axes, wear)
        unit, scale = length_unit(wear.depth.max())
        x = scale_cycles * wear.cycles
        mean = wear.depth @ patch.area / patch.area.sum()
        axes.fill_between(x, scale * wear.depth.min(1), scale * wear.depth.max(1), color=BLUE, alpha=0.18, lw=0)
        axes.plot(x, scale * wear.depth.max(1), color=RED, label="largest")
        axes.plot(x, scale * mean, color=BLUE, label="mean over the area")
        axes.plot(x, scale * wear.depth.min(1), color=GREEN, label="smallest")
        axes.set(ylabel=f"total wear depth / {unit}", title=titled(result, "wear depth"))
        figure.legend(loc="outside lower center", ncols=3)
        axes.set_xlabel("")
        cycle_axis(below, wear)
        below.plot(x, 1e6 * worn_area(wear.depth, patch.area), color=ORANGE)
        below.set(ylabel="worn area / mm²", ylim=(0, 1.05e6 * patch.area.sum()))
    return figure


def worn_area(depth: np.ndarray, area: np.ndarray) -> np.ndarray:
    """(n_row,) area of the pairs that have worn a thousandth of the depth that is largest in the end [m2].

    depth : (n_row, n_pair) [m]; area : (n_pair,) [m2]
    """
    return (depth > 1e-3 * depth[-1].max()) @ area


def energy_against_cycles(result: Result) -> Figure:
    """Energy per cycle against cycles, and worn volume against accumulated energy."""
    wear, patch = _wear(result), result.patch
    with axes_of(7.2, 5.6, rows=2, share=False) as (figure, (upper, lower)):
        scale_cycles = cycle_axis(upper, wear)
        _course(upper, scale_cycles, wear, wear.energy.sum(1), BLUE)
        upper.set(ylabel="energy per cycle / J", title=titled(result, "dissipated energy"))
        spent = np.concatenate([[0.0], np.cumsum(wear.work.sum(1))[:-1]])
        lower.plot(spent * 1e-6, 1e9 * wear.depth @ patch.area, ".-", color=ORANGE, ms=4)
        lower.set(xlabel="accumulated energy / MJ", ylabel="worn volume / mm³")
    return figure


def status_against_cycles(result: Result) -> Figure:
    """Share of the patch in each contact status, against cycles."""
    wear, patch = _wear(result), result.patch
    with axes_of() as (figure, axes):
        scale = cycle_axis(axes, wear)
        shares = [100 * (wear.status == bits) @ patch.area / patch.area.sum() for bits in STATUS]
        present = [k for k, share in enumerate(shares) if share.any()]
        kinds = [(status_name(bits, patch.components), color) for bits, (_, color) in STATUS.items()]
        axes.stackplot(
            scale * wear.cycles, [shares[k] for k in present], labels=[kinds[k][0] for k in present],
            colors=[kinds[k][1] for k in present], step="mid",
        )  # fmt: skip
        axes.set(ylabel="share of the area / %", ylim=(0, 100), title=titled(result, "contact status under wear"))
        figure.legend(loc="outside lower center", ncols=min(4, len(present)))
    return figure


def controlled(result: Result) -> Figure:
    """Fundamental amplitude, force and phase over frequency of a test whose force was found."""
    frf, force = result.response, result.driving_force
    assert frf is not None
    good, name = frf.converged, frf.output_names[0]
    y = frf.fundamental(name)[good]
    unit, scale = length_unit(float(np.abs(y).max()))
    phase = np.degrees(np.angle(y if force is None else y * np.conj(force)))
    size, of = (1.0, "factor on the loads") if force is None else (abs(force), "force / N")
    rows = ((scale * np.abs(y), f"amplitude / {unit}"), (size * frf.load_factor[good], of), (phase, "phase / deg"))
    with axes_of(7.2, 6.4, rows=3) as (figure, axes):
        heading(figure, result, "response under control")
        for each, (values, label) in zip(axes, rows, strict=True):
            each.plot(frf.frequency[good], values, color=BLUE)
            each.set_ylabel(label)
        for each, (values, _) in zip(axes[:2], rows[:2], strict=True):
            if values.max() > 1.01 * values.min():
                log_axis(each.yaxis, *_ends(values))
            else:
                each.set_ylim(0.0, 1.2 * values.max())
        axes[2].set(ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180), xlabel="frequency / Hz")
    return figure


def output_amplitudes(result: Result) -> Figure:
    """Amplitude of every observed output over frequency."""
    frf = result.response
    assert frf is not None
    good = frf.converged
    with axes_of() as (figure, axes):
        heights = {name: np.where(good, frf.amplitude(name), np.nan) for name in frf.output_names}
        unit, scale = length_unit(float(np.nanmax(list(heights.values()))))
        for name, color, style in zip(heights, CYCLE * 3, ["-"] * 6 + ["--"] * 6 + [":"] * 6, strict=False):
            axes.plot(frf.frequency, scale * heights[name], style, color=color, label=name.replace("_", " "))
        log_axis(axes.yaxis, *_ends(scale * np.concatenate(list(heights.values()))))
        axes.set(xlabel="frequency / Hz", ylabel=f"amplitude / {unit}", title=titled(result, "outputs"))
        figure.legend(loc="outside lower center", ncols=4)
    return figure


COURSES: dict[str, Callable[[Result], Figure]] = {
    "cycles_per_step": cycles_per_step,
    "peak": amplitude_against_cycles,
    "preload": preload_against_cycles,
    "depth": depth_against_cycles,
    "energy": energy_against_cycles,
    "status": status_against_cycles,
}


def hysteresis(result: Result, pairs: Sequence[int] | None = None) -> Figure:
    """Loops in chosen states (columns) of some pairs (rows), those with the largest loops by default.

    Of a contact without friction normal force over approach.
    Raises  ValueError where no loops are kept, or for a pair that there is not
    """
    loops, patch = result.loops, result.patch
    if loops is None:
        raise Refusal("the result holds no hysteresis loops: its scene needs a contact and pictures.plots = true")
    states, size = [state_of(result, int(row)) for row in loops.row], loop_size(result)
    largest = dict.fromkeys(int(np.argmax(one)) for one in size.sum(axis=2))
    pairs = list(largest if pairs is None else pairs)
    if not all(0 <= pair < len(patch.area) for pair in pairs):
        raise Refusal(f"pairs {pairs}: this contact has pairs 0 to {len(patch.area) - 1}")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.7 * len(states) + 0.4, 2.3 * len(pairs) + 0.6), layout="constrained")
        grid = figure.subplots(len(pairs), len(states), squeeze=False)
        for pair, line in zip(pairs, grid, strict=True):
            for at, axes in enumerate(line):
                loop = loop_of(result, at, pair, int(np.argmax(size[at, pair])))
                x, force = (np.append(values, values[0]) for values in (loop.displacement, loop.force))
                axes.plot(x, force, color=BLUE)
                axes.locator_params(nbins=5)
                if not loop.force.any():
                    axes.set(ylim=(-1, 1), yticks=[0])
                    axes.text(0.5, 0.6, "open all the cycle", transform=axes.transAxes, ha="center")
                axes.set_xlabel(loop.along)
                axes.set_ylabel(loop.label)
        for axes, state in zip(grid[0], states, strict=True):
            axes.set_title(state.label)
        what = "hysteresis loops by pair" if has_friction(result) else "normal force over approach by pair"
        heading(figure, result, what)
    return figure


def _course(axes: Any, scale: float, wear: WearHistory, values: np.ndarray, color: str) -> None:
    """Values against cycles, with a gap where the response jumped; hollow where they are means of a motion in time."""
    axes.plot(*with_gaps(wear, scale * wear.cycles, values), "-", color=color, zorder=2)
    axes.plot(scale * wear.cycles, values, "o", color=color, ms=3)
    if wear.in_time.any():
        of_time = scale * wear.cycles[wear.in_time], values[wear.in_time]
        axes.plot(*of_time, "o", color=color, mfc="white", ms=3, label="mean of the motion in time")
        axes.legend(loc="best")


def with_gaps(wear: WearHistory, *columns: np.ndarray) -> list[np.ndarray]:
    """Columns by wear step with a gap where the response jumped, so that no jump looks like a slope."""
    return [np.insert(column, wear.jumps + 1, np.nan) for column in columns]


def beyond(axes: Any, result: Result, scale: float) -> None:
    """Shade the amplitudes that a linear model does not describe, where the axes reach them."""
    low, high = axes.get_ylim()
    limit = scale * LARGEST_BEND * size_of(result)
    if low < limit < high:
        axes.axhspan(limit, high, color=RED, alpha=0.08, lw=0)
        axes.text(
            0.99, limit, "beyond the linear model", transform=axes.get_yaxis_transform(), color=RED, ha="right",
            va="bottom",
        )  # fmt: skip
        axes.set_ylim(low, high)


def _wear(result: Result) -> WearHistory:
    assert result.wear is not None
    return result.wear


def cycle_axis(axes: Any, wear: WearHistory) -> float:
    """Label the axis of cycles, with the end of the run where that is not drawn; returns the factor of the axis."""
    shown, last = shown_cycles(wear), float(wear.cycles[-1])
    unit, scale = _cycles(shown)
    if shown < last:
        axes.set_xlim(-0.03 * scale * shown, scale * shown)
    end = f" (the last touch ends at {scale * last:.3g})" if shown < last else ""
    axes.set_xlabel(f"vibration cycles{unit}{end}")
    return scale


def _ends(values: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest of some values above zero."""
    above = np.asarray(values, float)
    above = above[np.isfinite(above) & (above > 0)]
    return (float(above.min()), float(above.max())) if len(above) else (1.0, 10.0)


def _largest_amplitude(result: Result) -> float:
    found = [np.zeros(1)]
    if result.references is not None:
        found.append(result.references.free)
    if result.response is not None:
        found.append(result.response.amplitude(result.response.output_names[0]))
    if result.wear is not None:
        found.append(result.wear.amplitude)
    return float(np.nanmax(np.concatenate(found)))


def _cycles(largest: float) -> tuple[str, float]:
    """Text after "cycles" and the factor that goes with it."""
    power = 3 * int(np.log10(max(largest, 1)) // 3)
    return ("", 1.0) if power == 0 else (f" / 10$^{power}$", 10.0**-power)


@dataclass(frozen=True)
class Loop:
    """Displacement about its middle and force (n_sample,) of a pair and component, in the units of their labels."""

    displacement: np.ndarray
    force: np.ndarray
    along: str
    label: str


def has_friction(result: Result) -> bool:
    """Whether the contact has a tangential component, so that it can have hysteresis."""
    return any(name != "n" for name in result.patch.components)


def loop_size(result: Result) -> np.ndarray:
    """Size of the loops of every state, pair and component (n_field, n_pair, n_component).

    The work of the loop [J] where there is friction, 0 of its normal component; else the swing of the force [N]
    """
    loops, patch = result.loops, result.patch
    assert loops is not None
    if not has_friction(result):
        return np.asarray(np.ptp(loops.force, axis=-1))
    x = loops.displacement
    work = np.abs(np.sum(loops.force * (np.roll(x, -1, axis=-1) - np.roll(x, 1, axis=-1)), axis=-1)) / 2
    return work * [name != "n" for name in patch.components]


def loop_of(result: Result, at: int, pair: int, component: int) -> Loop:
    """One loop; its static offset is no part of it. at : which of result.loops"""
    loops, patch = result.loops, result.patch
    assert loops is not None
    x, force = loops.displacement[at, pair, component], loops.force[at, pair, component]
    x = x - (x.max() + x.min()) / 2
    (unit_x, scale_x), (unit_f, scale_f) = length_unit(float(x.max())), force_unit(float(np.abs(force).max()))
    along = f"{patch.components[component]} / {unit_x}"
    return Loop(scale_x * x, scale_f * force, along, f"force at {pair_name(result, pair)} / {unit_f}")


def pair_name(result: Result, pair: int) -> str:
    """What a pair is called: its number, and its contact where there are several."""
    named = result.facts.joints
    of = next((name for name, pairs in named.items() if pair in range(pairs.start, pairs.stop)), "")
    return f"pair {pair} of {of.replace('_', ' ')}" if of and len(named) > 1 else f"pair {pair}"
