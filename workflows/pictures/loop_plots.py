"""Loops of pairs: force over displacement in the kept states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import force_unit, heading, length_unit, present
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.theme import BLUE, STYLE
from tribodyn.workflows.result.contact_states import state_of
from tribodyn.workflows.result.result import Result


def hysteresis(result: Result, pairs: Sequence[int] | None = None) -> Figure:
    """Loops in chosen states (columns) of some pairs (rows), those with the largest loops by default.

    Of a contact without friction normal force over approach.
    Raises  Refusal where no loops are kept, or for a pair that there is not"""
    loops, patch = result.loops, result.patch
    if loops is None:
        raise Refusal("the result holds no hysteresis loops: its scene needs a contact and pictures.plots = true")
    states, size = [state_of(result, int(row)) for row in loops.row], loop_size(result)
    largest = dict.fromkeys(int(np.argmax(sizes)) for sizes in size.sum(axis=2))
    pairs = list(largest if pairs is None else pairs)
    if not all(0 <= pair < len(patch.area) for pair in pairs):
        raise Refusal(f"pairs {pairs}: this contact has pairs 0 to {len(patch.area) - 1}")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.7 * len(states) + 0.4, 2.3 * len(pairs) + 0.6), layout="constrained")
        grid = figure.subplots(len(pairs), len(states), squeeze=False)
        for pair, line in zip(pairs, grid, strict=True):
            for at, axes in enumerate(line):
                loop = loop_of(result, at, pair, int(np.argmax(size[at, pair])))
                x, force = (np.append(values, values[0]) for values in (loop.displacement, loop.force))
                axes.plot(x, force, color=BLUE)
                axes.locator_params(nbins=5)
                if not loop.force.any():
                    axes.set(ylim=(-1, 1), yticks=[0])
                    axes.text(0.5, 0.6, "open all the cycle", transform=axes.transAxes, ha="center")
                axes.set_xlabel(loop.label_x)
                axes.set_ylabel(loop.label)
        for axes, state in zip(grid[0], states, strict=True):
            axes.set_title(state.label)
        title = "hysteresis loops by pair" if has_friction(result) else "normal force over approach by pair"
        heading(figure, result, title)
    return figure


@dataclass(frozen=True)
class Loop:
    """Displacement about its middle and force (n_sample,) of a pair and component, in the units of their labels."""

    displacement: np.ndarray
    force: np.ndarray
    label_x: str
    label: str


def has_friction(result: Result) -> bool:
    """Whether the contact has a tangential component, so that it can have hysteresis."""
    return any(name != "n" for name in result.patch.components)


def loop_size(result: Result) -> np.ndarray:
    """Size of the loops of every state, pair and component (n_field, n_pair, n_component).

    The work of the loop [J] where there is friction, 0 of its normal component; else the swing of the force [N]"""
    loops, patch = present(result.loops), result.patch
    if not has_friction(result):
        return np.asarray(np.ptp(loops.force, axis=-1))
    x = loops.displacement
    work = np.abs(np.sum(loops.force * (np.roll(x, -1, axis=-1) - np.roll(x, 1, axis=-1)), axis=-1)) / 2
    return work * [name != "n" for name in patch.components]


def loop_of(result: Result, at: int, pair: int, component: int) -> Loop:
    """One loop; its static offset is no part of it. at : which of result.loops"""
    loops, patch = present(result.loops), result.patch
    x, force = loops.displacement[at, pair, component], loops.force[at, pair, component]
    x = x - (x.max() + x.min()) / 2
    (unit_x, scale_x), (unit_f, scale_f) = length_unit(float(x.max())), force_unit(float(np.abs(force).max()))
    label_x = f"{patch.components[component]} / {unit_x}"
    return Loop(scale_x * x, scale_f * force, label_x, f"force at {pair_name(result, pair)} / {unit_f}")


def pair_name(result: Result, pair: int) -> str:
    """What a pair is called: its number, and its contact where there are several."""
    named = result.facts.joints
    of = next((name for name, pairs in named.items() if pair in range(pairs.start, pairs.stop)), "")
    return f"pair {pair} of {of.replace('_', ' ')}" if of and len(named) > 1 else f"pair {pair}"
