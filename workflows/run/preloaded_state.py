"""A balance that begins at its preloaded state, which it reaches without friction."""

from dataclasses import replace
from functools import partial

import numpy as np

from tribodyn.hbm import rest
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.damping_matrices import damping_matrix
from tribodyn.workflows.scene.schema import Scene


def preloaded(scene: Scene, reduced: ReducedModel, balance: HarmonicBalance) -> HarmonicBalance:
    """The balance resting in its preload, to which it has come without friction.

    Joints whose springs follow from their own numbers have those of this state, and so has the damping of its modes."""
    x = rest.displacement(balance, settings.newton_options(scene))
    resting = replace(balance, memory=rest.memory(balance, x), at_rest=x)
    tangent_springs = rest.tangents(resting, x)
    if not tangent_springs:
        return resting
    tangent = [
        replace(j, parameters=replace(j.parameters, stiffness=tangent_springs.get(j.name, j.parameters.stiffness)))
        for j in resting.contact.joints
    ]
    b, springs = balance, np.array(balance.contact.stiffness)
    for joint in tangent:
        springs[np.ix_(joint.rows, b.contact.columns(joint))] = joint.parameters.stiffness
    if scene.damping.given and scene.damping.state == "stuck":
        undamped = replace(reduced, system=replace(reduced.system, damping=None))
        reduced = undamped.with_damping(partial(damping_matrix, scene, springs))
    preloaded_balance = HarmonicBalance.of(reduced, tangent, b.basis, b.excitation, b.omega_max, resting.memory)
    return replace(preloaded_balance, at_rest=x)
