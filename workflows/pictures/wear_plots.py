"""Wear of a result against its cycles: depth, peak, preload, energy, status."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tribodyn.hbm.wear.history import WearHistory
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import (
    axes_of,
    length_unit,
    log_axis,
    positive_range,
    present,
    shade_beyond_linear_model,
    status_name,
    titled,
)
from tribodyn.workflows.pictures.matplotlib_names import Figure, MaxNLocator
from tribodyn.workflows.pictures.theme import BLUE, GREEN, ORANGE, RED, STATUS
from tribodyn.workflows.result.contact_states import shown_cycles
from tribodyn.workflows.result.result import Result


def wear(result: Result, quantity: str = "depth") -> Figure:
    """Course of the wear against cycles: depth, peak, preload, energy or status, or the cycles_per_step.

    Raises  Refusal where nothing was worn, or for another word"""
    if not result.wear_steps:
        raise Refusal("the result holds no wear steps: its scene needs [wear] with max_steps above 0")
    if quantity not in COURSES:
        raise Refusal(f'no wear plot "{quantity}": there are {", ".join(COURSES)}')
    return COURSES[quantity](result)


def cycles_per_step(result: Result) -> Figure:
    """Cycles that each wear step stands for."""
    wear = present(result.wear)
    with axes_of() as (figure, axes):
        count = wear.cycles_in_step[: result.wear_steps]
        unit, scale = cycle_unit(count.max())
        axes.step(np.arange(1, len(count) + 1), scale * count, where="mid", color=BLUE)
        axes.set(xlabel="wear step", ylabel=f"cycles in the step{unit}", title=titled(result, "cycles per wear step"))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if count.max() > 30 * count.min():
            log_axis(axes.yaxis, *positive_range(scale * count))
        else:
            axes.set_ylim(bottom=0)
    return figure


def amplitude_against_cycles(result: Result) -> Figure:
    """Amplitude and frequency of the cycle that wears, against cycles."""
    wear = present(result.wear)
    with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
        scale_cycles = cycle_axis(lower, wear)
        unit, scale = length_unit(wear.amplitude.max())
        _course(upper, scale_cycles, wear, scale * wear.amplitude, BLUE)
        shade_beyond_linear_model(upper, result, scale)
        upper.set(ylabel=f"amplitude / {unit}", title=titled(result, "response under wear"))
        _course(lower, scale_cycles, wear, wear.frequency, ORANGE)
        lower.set(ylabel="frequency / Hz")
    return figure


def preload_against_cycles(result: Result) -> Figure:
    """Mean normal force of the contact against cycles, and that at rest where the run ends by it."""
    wear = present(result.wear)
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
    wear, patch = present(result.wear), result.patch
    with axes_of(7.2, 5.6, rows=2) as (figure, (axes, area_axes)):
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
        cycle_axis(area_axes, wear)
        area_axes.plot(x, 1e6 * worn_area(wear.depth, patch.area), color=ORANGE)
        area_axes.set(ylabel="worn area / mm²", ylim=(0, 1.05e6 * patch.area.sum()))
    return figure


def worn_area(depth: np.ndarray, area: np.ndarray) -> np.ndarray:
    """(n_row,) area of the pairs that have worn a thousandth of the depth that is largest in the end [m2].

    depth : (n_row, n_pair) [m]; area : (n_pair,) [m2]"""
    return (depth > 1e-3 * depth[-1].max()) @ area


def energy_against_cycles(result: Result) -> Figure:
    """Energy per cycle against cycles, and worn volume against accumulated energy."""
    wear, patch = present(result.wear), result.patch
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
    wear, patch = present(result.wear), result.patch
    with axes_of() as (figure, axes):
        scale = cycle_axis(axes, wear)
        shares = [100 * (wear.status == bits) @ patch.area / patch.area.sum() for bits in STATUS]
        occurring = [k for k, share in enumerate(shares) if share.any()]
        kinds = [(status_name(bits, patch.components), color) for bits, (_, color) in STATUS.items()]
        axes.stackplot(
            scale * wear.cycles, [shares[k] for k in occurring], labels=[kinds[k][0] for k in occurring],
            colors=[kinds[k][1] for k in occurring], step="mid",
        )  # fmt: skip
        axes.set(ylabel="share of the area / %", ylim=(0, 100), title=titled(result, "contact status under wear"))
        figure.legend(loc="outside lower center", ncols=min(4, len(occurring)))
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


def cycle_axis(axes: Any, wear: WearHistory) -> float:
    """Label the axis of cycles, with the end of the run where that is not drawn; returns the factor of the axis."""
    shown, last = shown_cycles(wear), float(wear.cycles[-1])
    unit, scale = cycle_unit(shown)
    if shown < last:
        axes.set_xlim(-0.03 * scale * shown, scale * shown)
    end = f" (the last touch ends at {scale * last:.3g})" if shown < last else ""
    axes.set_xlabel(f"vibration cycles{unit}{end}")
    return scale


def cycle_unit(largest: float) -> tuple[str, float]:
    """Text after "cycles" and the factor that goes with it."""
    power = 3 * int(np.log10(max(largest, 1)) // 3)
    return ("", 1.0) if power == 0 else (f" / 10$^{power}$", 10.0**-power)


COURSES: dict[str, Callable[[Result], Figure]] = {
    "cycles_per_step": cycles_per_step,
    "peak": amplitude_against_cycles,
    "preload": preload_against_cycles,
    "depth": depth_against_cycles,
    "energy": energy_against_cycles,
    "status": status_against_cycles,
}
