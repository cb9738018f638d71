"""Reduced models for tests: of a part as `modelling.build` makes it, without the cache; of systems that differ."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import modelling, part_reduction
from tribodyn.workflows.scene.schema import MeshScene


def reduce_part(scene: MeshScene, part: Part) -> ReducedModel:
    """The part on its contact and load nodes and a few modes, damped and held as the scene asks."""
    return part_reduction.with_prescribed(scene, part, modelling.damped(scene, modelling.plain_model(scene, part)))


@dataclass(frozen=True)
class HarmonicModel(ReducedModel):
    """A model each harmonic of which sees a system of its own, as those of a cyclic part do."""

    system_of: Callable[[int], tuple[SecondOrderSystem, np.ndarray]] = field(kw_only=True)

    has_one_system: ClassVar[bool] = False
    has_motion_in_time: ClassVar[bool] = False

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        return self.system_of(h)
