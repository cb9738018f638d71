"""Pictures of the modes of a wheel: nodal diameters, Campbell diagram, SAFE diagram.

The SAFE diagram (Singh, Vargo, Schiffer and Dello, Texas A&M Turbomachinery Symposium, 1988) shows whether an engine
order meets a mode in frequency and in shape: a wave of engine order k excites the nodal diameter |k - N round(k/N)| of
N sectors alone. An excitation that stands in space runs against the rotation, and so does what it excites up to N/2
diameters; seen through the sectors, orders from N/2 to N run with it. Coriolis forces part the two."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tribodyn.reduction.wave_model import Crossings, diameter_of
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, named
from tribodyn.workflows.pictures.matplotlib_names import Figure, MaxNLocator, mpl
from tribodyn.workflows.pictures.theme import BLUE, GREY, INK, ORANGE, PAPER, RED, WEAR_MAP

Families = Mapping[str, np.ndarray]
"""Frequencies (n_diameter, family) [Hz] of the nodal diameters from 0 on, by the state of the contact."""

STATES = {
    "free": ("o--", GREY, "contact free"), "stuck": ("o-", BLUE, "contact stuck"),
    "free, against": (".:", GREY, "free, against the rotation"),
    "stuck, against": (".--", BLUE, "stuck, against the rotation"),
}  # fmt: skip
AGAINST = ", against"  # of a state: waves against the rotation, where they are others than those with it


def _top(families: Families) -> float:
    """A little above the highest frequency [Hz]."""
    return 1.08 * max(float(np.nanmax(values)) for values in families.values() if not np.isnan(values).all())


def nodal_diameters(families: Families, scene: str = "") -> Figure:
    """Frequencies over nodal diameters, for each state of the contact; scene : its name, for the title."""
    with axes_of(7.2, 4.8) as (figure, axes):
        for state, values in families.items():
            _families(axes, values, *STATES[state])
        axes.set(xlabel="nodal diameter", ylabel="frequency / Hz", title=named(scene, "nodal diameters"))
        axes.set_ylim(0, _top(families))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(loc="outside lower center", ncols=len(families))
    return figure


def _families(axes: Any, values: np.ndarray, style: str, color: str, label: str) -> None:
    if np.isnan(values).all():
        return
    for i, hertz in enumerate(values.T):
        axes.plot(np.arange(len(hertz)), hertz, style, color=color, ms=3.5, label=label if i == 0 else None)


def campbell(
    speeds: np.ndarray, frequencies: Mapping[str, np.ndarray], orders: Sequence[int], met: Crossings, scene: str = ""
) -> Figure:
    """Frequencies of several engine orders' waves over the speed, with the orders' lines.

    speeds : (n_speed,) [Hz]; frequencies : "free" and "stuck" (n_speed, n_order, family) [Hz], as `td.wheel.campbell`
        has them; those of orders below 0 are dashed where the opposite order is there too
    met : where orders meet modes; scene : its name, for the title"""
    with axes_of(7.2, 4.8) as (figure, axes):
        rpm, sizes = 60 * speeds, sorted({abs(order) for order in orders})
        free = frequencies["free"][:, 0]
        if np.isfinite(np.diff(free, axis=0)).any():  # of what only the contact holds they are known at rest alone
            axes.plot(rpm, free, "--", color=GREY, label=_first("free", free))
        top = 1.08 * max(float(np.nanmax(frequencies["stuck"])), *(m.frequency for of in met.values() for m in of), 0.0)
        for size, color in zip(sizes, shades(len(sizes)), strict=True):
            for i in [i for i, order in enumerate(orders) if abs(order) == size]:
                waves, style = frequencies["stuck"][:, i], "--" if orders[i] < 0 and size in orders else "-"
                axes.plot(rpm, waves, style, color=color, label=_first(f"stuck, wave {orders[i]}", waves))
            axes.plot(rpm, size * speeds, ":", color=color)
            end = min(1.0, top / (size * speeds[-1]))
            axes.annotate(
                f"EO {size}", (end * rpm[-1], end * size * speeds[-1]), (-8, 3),
                textcoords="offset points", ha="right", color=color,
            )  # fmt: skip
        for state, color in (("free", GREY), ("stuck", RED)):
            if at := [(60 * m.speed, m.frequency) for m in met.get(state, ())]:
                axes.plot(*np.transpose(at), "o", color=color, ms=6, zorder=4, ls="none", label=f"critical, {state}")
        axes.set(xlabel="speed / rpm", ylabel="frequency / Hz", ylim=(0, top))
        axes.set_title(named(scene, "Campbell diagram"))
        axes.set_xlim(0, rpm[-1])
        figure.legend(loc="outside right upper")
    return figure


def _first(label: str, curves: np.ndarray) -> list[str]:
    """Labels of curves (n, m) drawn at once: the first one's alone is in the legend."""
    return [label, *["_"] * (curves.shape[1] - 1)]


def safe(
    families: Families, n_sectors: int, slow: float, fast: float, scene: str = "", met: Crossings | None = None,
) -> Figure:  # fmt: skip
    """SAFE diagram: modes over nodal diameters, and what the engine orders reach in a range of speeds.

    families : at the highest speed, from which what is met at a lower one may lie apart
    slow, fast : ends of the range of speeds [Hz]; scene : its name, for the title
    met : modes that engine orders meet between them, which are ringed"""
    if not 0 <= slow < fast:
        raise Refusal(f"a SAFE diagram from {slow:g} to {fast:g} Hz: give a speed from 0 on and a higher one")
    max_diameter = max(len(values) for values in families.values()) - 1
    top = _top(families)
    with axes_of(7.6, 5.2) as (figure, axes):
        orders = np.arange(1, min(int(top / slow) + 1 if slow else n_sectors, n_sectors) + 1)
        places = np.array([diameter_of(int(order), n_sectors) for order in orders])
        shown = places <= max_diameter
        for speed, style in ((slow, "-"), (fast, "--")):
            label = f"engine orders to {orders[-1]} at {60 * speed:.5g} rpm"
            axes.plot(
                places[shown], orders[shown] * speed, style, color=ORANGE, label=label, zorder=1,
            )  # fmt: skip
        axes.vlines(places[shown], orders[shown] * slow, orders[shown] * fast, color=ORANGE, lw=5, alpha=0.35, zorder=1)
        for state, values in families.items():
            _families(axes, values, *STATES[state])
        rings = [match for matches in (met or {}).values() for match in matches]
        if rings:
            axes.plot(
                [m.diameter for m in rings], [m.frequency for m in rings], "o", ms=10, mfc="none", color=RED,
                label=f"met by an engine order ({len(rings)})",
            )  # fmt: skip
        for order, place in zip(orders[shown], places[shown], strict=True):
            if order * fast < top:
                axes.annotate(
                    f"{order}", (place, order * fast), (-9, 3), textcoords="offset points", ha="center",
                    color=INK, bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
                )  # fmt: skip
        axes.set(xlabel="nodal diameter", ylabel="frequency / Hz")
        axes.set_title(named(scene, f"SAFE diagram of {n_sectors} sectors"))
        axes.set_xlim(-0.5, max_diameter + 0.5)
        axes.set_ylim(0, top)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(loc="outside lower center", ncols=2, labelcolor=INK)
    return figure


def shades(count: int) -> list[Any]:
    """Colours from dark to light for a series of curves."""
    return [mpl.colormaps[WEAR_MAP](x) for x in np.linspace(0.0, 0.92, max(count, 2))[:count]]
