"""The reduction of a part as `modelling.build` makes it, past what is kept on disk."""

from __future__ import annotations

from tribodyn.fem.part import Part
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import modelling, part_reduction
from tribodyn.workflows.scene.schema import MeshScene


def reduce_part(scene: MeshScene, part: Part) -> ReducedModel:
    """The part on its contact and load nodes and a few modes, damped and held as the scene asks."""
    return part_reduction.with_prescribed(scene, part, modelling.damped(scene, modelling.plain_model(scene, part)))
