"""A travelling wave in time: the sectors until it repeats itself, each with its contact, as one problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.reduction.unrolled import period, unrolled


def is_wave(balance: HarmonicBalance) -> bool:
    """Whether the problem is that of one sector under a travelling wave."""
    return balance.model.per_index is not None


def sectors_of(balance: HarmonicBalance) -> int:
    """Sectors that the problem stands for in time: one, or those of a wave until it repeats itself."""
    info = balance.model.info
    if not is_wave(balance) or info.n_sectors is None or info.engine_order is None:
        return 1
    return period(info.n_sectors, info.engine_order)


def unroll(balance: HarmonicBalance, highest: float) -> HarmonicBalance:
    """The problem of a wave on all sectors until it repeats itself; `highest` as in `reduction.unrolled`."""
    info, n = balance.model.info, sectors_of(balance)
    assert info.n_sectors is not None
    assert info.engine_order is not None
    load = waves.on_wheel(balance.excitation, info.engine_order, info.n_sectors, n)
    whole = HarmonicBalance.of(
        unrolled(balance.model, highest),
        balance.contact.repeated(n),
        balance.basis,
        load,
        balance.omega_max,
        np.tile(balance.memory, (n, 1)),
    )
    rest = None if balance.at_rest is None else np.tile(balance.at_rest, (n, 1))
    return replace(whole, load_factor=balance.load_factor, at_rest=rest)


def state_of(balance: HarmonicBalance, whole: HarmonicBalance, state: State) -> State:
    """The state of a wave as that of all its sectors."""
    info, basis = balance.model.info, balance.basis
    assert info.n_sectors is not None
    assert info.engine_order is not None
    x = [waves.at_sector(basis, state.x, info.engine_order, info.n_sectors, n) for n in range(sectors_of(balance))]
    return whole.evaluate(state.omega, np.concatenate(x))
