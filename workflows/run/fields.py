"""Full displacement of the part and hysteresis loops of the contact, from the rows of a wear history."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.recovery import full_displacement
from tribodyn.hbm.wear_history import WearRow
from tribodyn.workflows.result.result import Fields, Loops, Result
from tribodyn.workflows.scene.schema import Scene


def with_shown(scene: Scene, result: Result, balance: HarmonicBalance, part: Part | None) -> Result:
    """The result of a wear run with the fields and loops that the pictures of the scene show, and no others.

    balance : the unworn problem under the load that the rows of the result come from
    """
    assert result.wear is not None
    if not result.wear_steps:
        return result
    rows, numbers = result.wear.rows(), replace(result, fields=None).shown_rows()
    if scene.pictures.renders and part is not None:
        result = replace(result, fields=displacement_fields(balance, part, rows, numbers))
    if scene.pictures.plots and any(c != "n" for contact in scene.joints.values() for c in contact.components):
        result = replace(result, loops=hysteresis_loops(balance, rows, numbers))
    return result


def displacement_fields(balance: HarmonicBalance, part: Part, rows: list[WearRow], numbers: np.ndarray) -> Fields:
    """Displacement of every node at chosen rows of a wear history.

    balance : the unworn problem under the load that the rows come from; numbers : (n_field,) rows to take
    """
    chosen = [rows[i] for i in numbers]
    found = [part.field(full_displacement(balance, row.displacement, row.force, row.omega)) for row in chosen]
    return Fields(np.asarray(numbers), np.stack(found))


def hysteresis_loops(balance: HarmonicBalance, rows: list[WearRow], numbers: np.ndarray) -> Loops:
    """Displacement and force of every pair over the cycle at chosen rows of a wear history."""
    shape = (balance.contact.n_pair, -1, balance.basis.n_coeff)
    displacement, force = [], []
    for i in numbers:
        contact = balance.contact.with_gap(balance.contact.gap + rows[i].depth)
        x, f = contact.history(rows[i].displacement.reshape(shape), balance.basis, balance.memory)
        displacement.append(x)
        force.append(f)
    return Loops(np.asarray(numbers), np.stack(displacement), np.stack(force))
