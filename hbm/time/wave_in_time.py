"""A travelling wave in time: the sectors until it repeats itself, each with its contact, as one problem."""

from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.reduction.unrolled import unrolled
from tribodyn.reduction.wave_model import as_wave


def unroll(balance: HarmonicBalance, highest: float) -> HarmonicBalance:
    """The problem of a wave on all sectors until it repeats itself; `highest` as in `reduction.unrolled`."""
    wave = as_wave(balance.model)
    n = wave.sectors_in_time
    load = waves.on_wheel(balance.excitation, wave.engine_order, wave.n_sectors, n)
    all_sectors = HarmonicBalance.of(
        unrolled(wave, highest),
        balance.contact.repeat(n),
        balance.basis,
        load,
        balance.omega_max,
        np.tile(balance.memory, (n, 1)),
    )
    harmonics = None if balance.at_rest is None else np.tile(balance.at_rest, (n, 1))
    return replace(all_sectors, load_factor=balance.load_factor, at_rest=harmonics)


def state_of(balance: HarmonicBalance, all_sectors: HarmonicBalance, state: State) -> State:
    """The state of a wave as that of all its sectors."""
    wave, basis = as_wave(balance.model), balance.basis
    x = [waves.at_sector(basis, state.x, wave.engine_order, wave.n_sectors, n) for n in range(wave.sectors_in_time)]
    return all_sectors.evaluate(state.omega, np.concatenate(x))
