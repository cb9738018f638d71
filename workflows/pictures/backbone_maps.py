"""Maps of the contact along a backbone: how far its pairs slide, how far they open, and where the friction work is."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.workflows.pictures.figures import length_unit, named
from tribodyn.workflows.pictures.maps import colour_bar, draw_field, label_axes
from tribodyn.workflows.pictures.style import MOTION_MAP, PRESSURE_MAP, STYLE, WEAR_MAP
from tribodyn.workflows.result.result import Patch

COLUMNS = 4


def fields(balance: HarmonicBalance, found: Backbone, at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the pairs do at a point of the backbone, (n_pair,) each.

    Returns the largest distance from the mean place along the face [m], the largest gap of the cycle [m], negative
    where the faces stay in touch, and the friction work per cycle and area [J/m2]
    """
    contact = balance.contact
    x = found.contact[at].reshape(contact.n_pair, -1, balance.basis.n_coeff)
    state = balance.evaluate(float(found.omega[at]), x, jacobian=False)
    components = balance.model.interface.components
    motion = balance.basis.to_time(x)
    along = [c for c, name in enumerate(components) if name != "n"]
    slide = motion[:, along] - x[:, along, :1] * balance.basis.has_static
    swing = np.linalg.norm(slide, axis=1).max(axis=1)
    opening = np.full(contact.n_pair, -np.inf)
    if "n" in components:
        opening = contact.gap - motion[:, components.index("n")].min(axis=1)
    return swing, opening, balance.energy(state) / balance.model.interface.area


def picture(balance: HarmonicBalance, found: Backbone, scene: str = "") -> Figure | None:
    """The maps at some converged points, evenly spaced in the logarithm of the amplitude.

    Returns None where the contact is no face or has no friction; scene : its name, for the title
    """
    interface = balance.model.interface
    good = np.flatnonzero(found.converged)
    if not len(interface.faces) or not {"t1", "t2"} & set(interface.components) or not len(good):
        return None
    patch = Patch(
        interface.components,
        np.full(interface.n_pair, -1),
        interface.points,
        interface.frames,
        interface.area,
        interface.gap,
        interface.faces,
        np.zeros(interface.n_pair),
    )
    level = np.log(found.amplitude[good])
    wanted = np.linspace(level.min(), level.max(), COLUMNS)
    chosen = list(dict.fromkeys(int(good[np.abs(level - value).argmin()]) for value in wanted))
    columns = [fields(balance, found, at) for at in chosen]
    unit, factor = length_unit(float(found.amplitude[chosen].max()))
    aspect = float(np.clip(np.ptp(patch.flat[:, 1]) / max(np.ptp(patch.flat[:, 0]), 1e-12), 0.15, 2.0))
    rows = [("largest slide along the face", MOTION_MAP), ("largest gap", PRESSURE_MAP), ("friction work", WEAR_MAP)]
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (3.1 * len(chosen) + 0.4, len(rows) * (2.3 * aspect + 1.0) + 0.9)
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(len(rows), len(chosen), squeeze=False)
        for line, (name, colors) in enumerate(rows):
            for axes, values in zip(grid[line], columns, strict=True):
                _map(figure, axes, patch, values[line], name, colors)
        for axes, at in zip(grid[0], chosen, strict=True):
            axes.set_title(f"{factor * found.amplitude[at]:.3g} {unit}, {found.frequency[at]:.4g} Hz", fontsize=11)
        label_axes(grid, patch)
        figure.suptitle(named(scene, "contact along the backbone"), x=0.01, ha="left", fontsize=12)
    return figure


def _map(figure: Figure, axes: mpl.axes.Axes, patch: Patch, values: np.ndarray, name: str, colors: str) -> None:
    """One field with its own scale: lengths in the unit that suits them."""
    if name == "friction work":
        unit, factor = ("mJ/m²", 1e3) if values.max() < 0.5 else ("J/m²", 1.0)
    else:
        unit, factor = length_unit(float(np.abs(values).max()))
    shown = factor * values
    high, low = float(shown.max()), float(shown.min())
    colour_bar(figure, axes, draw_field(axes, patch, shown, colors, high, low), f"{name} / {unit}", high, low)
