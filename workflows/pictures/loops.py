"""Hysteresis loops of a result: which are largest, and what one of them is in units that read well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.workflows.pictures.figures import force_unit, length_unit
from tribodyn.workflows.result.result import Result


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
    named = result.facts.pairs_of_joints
    of = next((name for name, pairs in named.items() if pair in range(pairs.start, pairs.stop)), "")
    return f"pair {pair} of {of.replace('_', ' ')}" if of and len(named) > 1 else f"pair {pair}"
