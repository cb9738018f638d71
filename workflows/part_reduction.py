"""From a part to its reduced model: masters, relative coordinates, prescribed static displacement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem.part import Part
from fem.springs import Spring
from reduction.craig_bampton import craig_bampton
from reduction.interface_modes import interface_modes
from reduction.model import ReducedModel
from reduction.prescribed import StaticReaction, prescribe
from reduction.relative import relative
from workflows.scene import PartScene

REACTION = "reaction"  # where the facts of a model keep its StaticReaction


def reduce(scene: PartScene, part: Part) -> ReducedModel:
    """The part on its contact, load and prescribed nodes and a few modes; not damped yet, nothing prescribed yet."""
    wanted, system, interface, back = scene.reduction, part.system, part.interface, None
    held = [part.dofs(given.group, given.axis) for given in scene.prescribed.values()]
    if held and len(part.held):
        raise ValueError("prescribed: a part whose turning is held cannot have prescribed nodes; hold it by springs")
    if wanted.relative:
        system, interface, back = relative(system, interface)
    extra = np.concatenate([[], *held]).astype(int)
    reduced = craig_bampton(system, interface, wanted.modes, wanted.cutoff, extra)
    if wanted.interface_modes is not None:
        masters = np.asarray(reduced.info["masters"])
        touched = np.flatnonzero(np.abs(np.asarray(reduced.interface.B)[:, : len(masters)]).max(axis=0))
        keep = np.union1d(np.delete(masters, touched), extra)
        if wanted.interface_keep is not None:
            named = [part.dofs(group, axis) for group in wanted.interface_keep for axis in "xyz"]
            keep = np.union1d(np.intersect1d(np.concatenate([[], *named]), masters), extra)
        reduced = interface_modes(reduced, wanted.interface_modes, keep.astype(int))
    return reduced if back is None else replace(reduced, basis=back @ reduced.basis)


def with_prescribed(scene: PartScene, part: Part, reduced: ReducedModel) -> ReducedModel:
    """The reduced model with the static displacement that the scene prescribes as a static load of that name."""
    for name, given in scene.prescribed.items():
        dofs = part.dofs(given.group, given.axis)
        support = np.zeros(len(dofs))
        for spring in (scene.springs[spring] for spring in given.springs):
            matrix = Spring(spring.group, spring.direction, spring.stiffness).matrix(part.mesh, part.node_sets)
            support += matrix.diagonal()[part.free[dofs]]
        masters = np.searchsorted(np.asarray(reduced.info["masters"]), dofs)
        reduced, reaction = prescribe(reduced, masters, name, support=support)
        reduced = replace(reduced, info={**reduced.info, REACTION: reaction})
    return reduced


def reaction_of(reduced: ReducedModel) -> StaticReaction:
    """What gives the static force at the prescribed nodes of a model that `with_prescribed` made."""
    reaction = reduced.info[REACTION]
    assert isinstance(reaction, StaticReaction)
    return reaction
