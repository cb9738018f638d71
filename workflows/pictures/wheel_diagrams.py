"""Pictures of the modes of a wheel: nodal diameters, Campbell diagram, SAFE diagram.

The SAFE diagram (Singh, Vargo, Schiffer and Dello, Texas A&M Turbomachinery Symposium, 1988) shows whether an engine
order meets a mode in frequency and in shape: a wave of engine order k excites the nodal diameter |k - N round(k/N)| of
N sectors alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tribodyn.workflows.pictures.figures import axes_of, named
from tribodyn.workflows.pictures.style import BLUE, GREY, INK, ORANGE, PAPER, RED, WEAR_MAP

Families = Mapping[str, np.ndarray]
"""Frequencies (n_diameter, family) [Hz] of the nodal diameters from 0 on, by the state of the contact."""

STATES = {"free": ("o--", GREY, "contact free"), "stuck": ("o-", BLUE, "contact stuck")}


@dataclass(frozen=True)
class Crossing:
    """An engine order that excites a mode in the range of speeds.

    speed : at which it does so [Hz]; frequency : of the mode [Hz]
    """

    engine_order: int
    diameter: int
    family: int
    speed: float
    frequency: float


def diameter_of(engine_order: int, n_sectors: int) -> int:
    """The nodal diameter that an engine order excites on a wheel of identical sectors."""
    rest = engine_order % n_sectors
    return min(rest, n_sectors - rest)


def crossings(frequency: np.ndarray, n_sectors: int, slow: float, fast: float) -> list[Crossing]:
    """Where engine orders excite modes in a range of speeds, by engine order and family.

    frequency : (n_diameter, family) of the nodal diameters from 0 on [Hz], taken as the same at all speeds of the range
    slow, fast : ends of the range [Hz], slow above 0
    """
    found: list[Crossing] = []
    if np.isnan(frequency).all():
        return found
    for order in range(1, int(np.nanmax(frequency) / slow) + 1):
        diameter = diameter_of(order, n_sectors)
        if diameter >= len(frequency):
            continue
        for family, hertz in enumerate(frequency[diameter]):
            if slow <= hertz / order <= fast:
                found.append(Crossing(order, diameter, family, float(hertz / order), float(hertz)))
    return found


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
    for i, hertz in enumerate(values.T):
        axes.plot(np.arange(len(hertz)), hertz, style, color=color, ms=3.5, label=label if i == 0 else None)


def campbell(
    speeds: np.ndarray,
    found: Mapping[str, np.ndarray],
    orders: Sequence[int],
    critical: Mapping[int, Sequence[float]],
    scene: str = "",
) -> Figure:
    """Frequencies of the first mode of several engine orders' waves over the speed, with the lines of these orders.

    speeds : (n_speed,) [Hz]; found : "free" and "stuck" (n_speed, n_order, family) [Hz], as studies.wheel.campbell
    critical : engine order -> speeds [Hz] at which it meets its first stuck frequency
    scene : its name, for the title
    """
    with axes_of(7.2, 4.8) as (figure, axes):
        rpm = 60 * speeds
        axes.plot(rpm, found["free"][:, 0, 0], "--", color=GREY, label="free")
        top = 1.3 * float(found["stuck"][:, :, 0].max())
        for i, (order, color) in enumerate(zip(orders, shades(len(orders)), strict=True)):
            axes.plot(rpm, found["stuck"][:, i, 0], color=color, label=f"stuck, engine order {order}")
            axes.plot(rpm, abs(order) * speeds, ":", color=color)
            for speed in critical.get(order, ()):
                axes.plot(60 * speed, abs(order) * speed, "o", color=RED, ms=6, zorder=4)
        axes.plot([], [], "o", color=RED, ms=6, label="critical speed")
        axes.set(xlabel="speed / rpm", ylabel="frequency / Hz", ylim=(0, top))
        axes.set_title(named(scene, "Campbell diagram, first mode"))
        axes.set_xlim(0, rpm[-1])
        figure.legend(loc="outside right upper")
    return figure


def safe(families: Families, n_sectors: int, slow: float, fast: float, scene: str = "") -> Figure:
    """SAFE diagram: modes over nodal diameters, and what the engine orders reach in a range of speeds.

    slow, fast : ends of the range of speeds [Hz]; modes that an engine order meets there are ringed
    scene : its name, for the title
    """
    if not 0 < slow < fast:
        raise ValueError(f"a SAFE diagram from {slow:g} to {fast:g} Hz: give two speeds above 0, the lower one first")
    most = max(len(values) for values in families.values()) - 1
    top = _top(families)
    with axes_of(7.6, 5.2) as (figure, axes):
        orders = np.arange(1, int(top / slow) + 2)
        places = np.array([diameter_of(int(order), n_sectors) for order in orders])
        there = places <= most
        for speed, style in ((slow, "-"), (fast, "--")):
            label = f"engine orders at {60 * speed:.5g} rpm"
            axes.plot(
                places[there], orders[there] * speed, style, color=ORANGE, label=label, zorder=1,
            )  # fmt: skip
        axes.vlines(places[there], orders[there] * slow, orders[there] * fast, color=ORANGE, lw=5, alpha=0.35, zorder=1)
        for state, values in families.items():
            _families(axes, values, *STATES[state])
        rings = [crossing for values in families.values() for crossing in crossings(values, n_sectors, slow, fast)]
        axes.plot(
            [m.diameter for m in rings], [m.frequency for m in rings], "o", ms=10, mfc="none", color=RED,
            label=f"met by an engine order ({len(rings)})",
        )  # fmt: skip
        for order, place in zip(orders[there], places[there], strict=True):
            if order * fast < top and order <= max(n_sectors // 2, 1):
                axes.annotate(
                    f"{order}", (place, order * fast), (-9, 3), textcoords="offset points", ha="center",
                    color=INK, bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
                )  # fmt: skip
        axes.set(xlabel="nodal diameter", ylabel="frequency / Hz")
        axes.set_title(named(scene, f"SAFE diagram of {n_sectors} sectors"))
        axes.set_xlim(-0.5, most + 0.5)
        axes.set_ylim(0, top)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(loc="outside lower center", ncols=2, labelcolor=INK)
    return figure


def shades(count: int) -> list[Any]:
    """Colours from dark to light for a series of curves."""
    return [mpl.colormaps[WEAR_MAP](x) for x in np.linspace(0.0, 0.92, max(count, 2))[:count]]
