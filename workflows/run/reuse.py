"""Scenes that differ little: each mesh, part and reduction is made once, and used again where a scene allows it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import joints, modelling, part_reduction
from tribodyn.workflows.run.kept import early_of
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile


@dataclass
class Bench:
    """Builds the problems of scenes, one after the other; what the next one shares with the last stays in memory."""

    early: str = ""
    part: Part | None = None
    reduced: ReducedModel | None = None
    measured: tuple[object, np.ndarray] = field(default_factory=lambda: (None, np.empty(0)))

    def plain(self, file: SceneFile, opening: np.ndarray | None = None) -> ReducedModel:
        """The reduced model, not damped, with nothing prescribed; opening : (n_pair,) added to its gaps [m]."""
        scene = file.mesh_scene
        early = early_of(scene)
        if self.part is None or self.reduced is None or early != self.early:
            self.part = modelling.part_of(file, Progress())
            self.reduced = modelling.plain_of(file, self.part)
            self.early = early
        left_out = self.reduced.residual
        springs = joints.contact_stiffness(scene, self.reduced).ravel()
        if left_out is not None and not np.array_equal(left_out.stiffness, springs):
            self.reduced = modelling.plain_of(file, self.part)  # its residual flexibility is that beside other springs
        interface, gap = self.reduced.interface, self.reduced.interface.gap
        if scene.surfaces is not None or any(joint.gap_map is not None for joint in scene.joints.values()):
            gap = gap + self._opening(file)
        if opening is not None:
            gap = gap + opening
        return replace(self.reduced, interface=replace(interface, gap=gap))

    def _opening(self, file: SceneFile) -> np.ndarray:
        assert self.part is not None
        key = (self.early, file.mesh_scene.model_dump_json(include={"surfaces"}), file.folder)
        if key != self.measured[0]:
            opened, _ = modelling.with_surfaces(file.mesh_scene, self.part, file.folder)
            self.measured = (key, opened.interface.gap - self.part.interface.gap)
        return self.measured[1]

    def model(self, file: SceneFile, opening: np.ndarray | None = None) -> modelling.Model:
        """The nonlinear problem of a scene; opening : (n_pair,) added to its gaps, such as a wear depth [m]."""
        scene, plain = file.mesh_scene, self.plain(file, opening)
        assert self.part is not None
        reduced = part_reduction.with_prescribed(scene, self.part, modelling.damped(scene, plain))
        return modelling.make_model(scene, self.part, reduced)
