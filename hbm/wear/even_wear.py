"""How deep a contact may wear evenly until its preload is gone, to first order.

For structures that hold together by their contacts alone: elsewhere the deflection of the part without its contact
gives the depth.
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State

SMALL = 1e-4  # of the preload, by which its slope is taken


def depth_to_loss(balance: HarmonicBalance, state: State, joint: str | None = None) -> float:
    """Depth [m] at which pairs that wear alike have lost their preload, along the slope at a solved state.

    joint : name of the one whose pairs wear and whose preload counts; all by default
    Returns nan where there is no preload, or where wear does not lower it
    """

    def preload(of: HarmonicBalance, there: State) -> float:
        return of.preload(there) if joint is None else of.preload_by_joint(there)[joint]

    here, contact = preload(balance, state), balance.contact
    normal = contact.components.index("n") if "n" in contact.components else None
    if normal is None or here <= 0:
        return float("nan")
    wears = np.zeros(contact.n_pair)
    for one in contact.joints:
        if joint in (None, one.name):
            wears[one.rows] = 1.0
    moved = balance.gap_response(balance.evaluate(state.omega, state.x), wears)
    # the stiffest case, in which nothing gives way beside the contact springs, bounds the slope
    step = SMALL * here / float(wears @ contact.stiffness[:, normal])
    worn = balance.with_gap(contact.gap + step * wears)
    slope = (preload(worn, worn.evaluate(state.omega, state.x + step * moved, jacobian=False)) - here) / step
    return -here / slope if slope < 0 else float("nan")
