"""Full displacement of the part and hysteresis loops of the contact, at rows of a wear history or points of a curve."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.hbm.wear.history import WearRow
from tribodyn.workflows.result.result import Fields, Loops, Result
from tribodyn.workflows.scene.schema import MeshScene, Scene


@dataclass(frozen=True)
class SolvedState:
    """A solved state of the contact: what it shares with a WearRow.

    omega : [rad/s]; depth : (n_pair,) worn off [m]; displacement, force : (n_contact, n_coeff) [m], [N]"""

    omega: float
    depth: np.ndarray
    displacement: np.ndarray
    force: np.ndarray


States = Sequence[SolvedState | WearRow]


def with_shown(scene: Scene, result: Result, balance: HarmonicBalance, part: Part | None) -> Result:
    """The result with the fields and loops that its pictures show, and no others.

    balance : the unworn problem under the load that the states of the result come from"""
    result = replace(result, fields=None, loops=None, stress_field=None)
    numbers = result.shown_rows()
    if not len(numbers) or balance.contact.n_pair == 0:  # loops and states of a contact that is not there
        return result
    states: list[SolvedState | WearRow] = []
    if result.wear is not None:
        rows = result.wear.rows()
        states += [rows[i] for i in numbers]
    elif (frf := result.response) is not None:
        for i in numbers:
            omega, x = float(frf.omega[i]), frf.contact[i]
            state = balance.evaluate(omega, balance.shaped(x), jacobian=False)
            states.append(SolvedState(omega, np.zeros(len(state.x)), x, state.cycle.force.reshape(x.shape)))
    if part is not None and (scene.pictures.renders or balance.stress is not None):
        fields = displacement_fields(balance, part, states, numbers)
        result = replace(result, fields=fields if scene.pictures.renders else None)
        if balance.stress is not None and isinstance(scene, MeshScene) and scene.stress is not None:
            from tribodyn.workflows.run.stresses import stress_state  # only scenes that ask for stress need it

            spots = scene.stress.hot_spots
            stress = stress_state(balance.stress, part.points, fields, balance.basis, spots)
            result = replace(result, stress_field=stress)
    if scene.pictures.plots:
        result = replace(result, loops=hysteresis_loops(balance, states, numbers))
    return result


def displacement_fields(balance: HarmonicBalance, part: Part, states: States, numbers: np.ndarray) -> Fields:
    """Displacement of every node in solved states.

    balance : the unworn problem under the load that the states come from; numbers : (n_field,) rows or points"""
    fields = [part.field(full_displacement(balance, s.displacement, s.force, s.omega)) for s in states]
    return Fields(np.asarray(numbers), np.stack(fields))


def hysteresis_loops(balance: HarmonicBalance, states: States, numbers: np.ndarray) -> Loops:
    """Displacement and force of every pair over the cycle in solved states."""
    shape = (balance.contact.n_pair, -1, balance.basis.n_coeff)
    displacement, force = [], []
    for s in states:
        contact = balance.contact.worn(s.depth)
        x, f = contact.history(s.displacement.reshape(shape), balance.basis, balance.memory, s.omega)
        displacement.append(x)
        force.append(f)
    return Loops(np.asarray(numbers), np.stack(displacement), np.stack(force))
