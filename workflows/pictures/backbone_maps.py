"""Maps of the contact along a backbone: how far its pairs slide, how far they open, and where the friction work is."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.workflows.pictures import motion_maps
from tribodyn.workflows.pictures.figures import length_unit, named
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
    slide, gap = motion_maps.slide_and_gap(balance.model.interface.components, x, balance.basis, contact.gap)
    return slide, gap, balance.energy(state) / balance.model.interface.area


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
    titles = [f"{factor * found.amplitude[at]:.3g} {unit}, {found.frequency[at]:.4g} Hz" for at in chosen]
    return motion_maps.draw(patch, columns, titles, named(scene, "contact along the backbone"))
