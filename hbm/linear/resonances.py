"""Where the linear responses of a balance resonate, its contact absent or closed and stuck."""

import numpy as np

from tribodyn.fem.modes import lowest_squares
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.linear.expansion import RULES
from tribodyn.reduction.linear import stuck_stiffness


def linear_resonances(balance: HarmonicBalance, springs: np.ndarray | None, count: int) -> np.ndarray:
    """Frequencies at which a loaded harmonic meets one of the lowest modes [rad/s].

    springs : (n_pair, n_component) stuck contact [N/m], None for no contact; count : of modes"""
    resonances = [np.zeros(0)]
    orders = {order for order, _ in balance.excitation.loads}
    if balance.excitation.base is not None:
        orders.update(balance.basis.harmonics)
    for h in sorted(orders - {0}):
        system, B = balance.model.at_harmonic(h)
        stiffness = system.stiffness if springs is None else stuck_stiffness(system.stiffness, B, springs)
        lam = lowest_squares(stiffness, system.mass, min(count, system.n_dof))
        resonances.append(np.sqrt(np.maximum(lam, 0.0)) / h)
    return np.concatenate(resonances)


def narrow_resonances(balance: HarmonicBalance, omega: np.ndarray) -> np.ndarray:
    """Frequencies of the linear resonances, free and stuck, that points of a curve (n,) [rad/s] do not resolve.

    These are more than four half-power half widths apart there, by the damping of the stuck modes nearby; a resonance
    without damping is left out, for its response is infinite"""
    if balance.model.follows_frequency:
        return np.zeros(0)
    expansion = balance.compliance.groups[-1][0]
    modes = np.sqrt(expansion.lam)
    ratios = np.divide(np.diag(expansion.c).real, 2 * modes, out=np.ones(len(modes)), where=modes > 0)
    places = np.sort(omega)
    steps = np.diff(places)
    if 4 * ratios.min() * places[0] > steps.max(initial=0.0):
        return np.zeros(0)
    states = (None, balance.contact.stiffness)
    resonances = np.unique([linear_resonances(balance, springs, len(modes)) for springs in states])
    resonances = resonances[(resonances > places[0]) & (resonances < places[-1])]
    ratio = np.interp(resonances, modes, ratios)
    is_narrow = 4 * ratio * resonances < steps[np.searchsorted(places, resonances) - 1]
    return np.asarray(resonances[is_narrow & (ratio > RULES.resonance_distance)])
