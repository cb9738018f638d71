"""Scenes that differ little: each mesh, part and reduction is made once, and used again where a scene allows it."""

from __future__ import annotations

import json
import os
import pickle
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from filelock import FileLock

from tribodyn.fem.part import Part
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import joints, modelling, part_reduction
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene

_JOINT = {"law", "tangential_stiffness", "normal_stiffness", "friction", "punch"}
LATE: Any = {
    "scene": True, "damping": True, "harmonics": True, "wear": True, "solver": True, "pictures": True, "surfaces": True,
    "loads": {"static": {"__all__": {"value", "pressure"}}, "harmonic": {"__all__": {"value", "pressure", "phase"}}},
    "prescribed": {"__all__": {"displacement"}},
    "contact": _JOINT, "contacts": {"__all__": _JOINT},
    "response": {"frequency", "references", "points", "method", "stability", "bounds", "options"},
}  # fmt: skip
"""What a scene may change without another part or reduction."""
OF_STRESS = ("contact", "contacts", "loads")  # ... but not where a wheel spins, whose stress has its contact at rest


def early_of(scene: MeshScene) -> str:
    """What a part and its reduction are made of: equal texts, equal models."""
    spins = scene.wheel is not None and scene.wheel.speed > 0
    along = scene.wheel is not None and scene.wheel.along_speed  # its speeds are those of the response
    own = (*(OF_STRESS if spins else ()), *(("response",) if along else ()))
    late = {key: what for key, what in LATE.items() if key not in own}
    return json.dumps(scene.model_dump(mode="json", exclude=late), sort_keys=True)


@dataclass
class Bench:
    """Builds the problems of scenes, one after the other; what the next one shares with the last is not made again.

    store : file that processes share what is made through: the first one makes it while the others wait
    """

    early: str = ""
    part: Part | None = None
    reduced: ReducedModel | None = None
    measured: tuple[object, np.ndarray] = field(default_factory=lambda: (None, np.empty(0)))
    store: Path | None = None

    def plain(self, file: SceneFile, opening: np.ndarray | None = None) -> ReducedModel:
        """The reduced model, not damped, with nothing prescribed; opening : (n_pair,) added to its gaps [m]."""
        scene = file.mesh_scene
        early = early_of(scene)
        if self.part is None or self.reduced is None or early != self.early:
            self.part, self.reduced = self._shared(file)
            self.early = early
        left_out = self.reduced.residual
        springs = joints.contact_stiffness(scene, self.reduced).ravel()
        if left_out is not None and not np.array_equal(left_out.stiffness, springs):
            self.part, self.reduced = _made(file)  # its residual flexibility is that beside other springs
        interface, gap = self.reduced.interface, self.reduced.interface.gap
        if scene.surfaces is not None or any(joint.gap_map is not None for joint in scene.joints.values()):
            gap = gap + self._opening(file)
        if opening is not None:
            gap = gap + opening
        return replace(self.reduced, interface=replace(interface, gap=gap))

    def _shared(self, file: SceneFile) -> tuple[Part, ReducedModel]:
        """Part and reduction from the store, or made and left there."""
        if self.store is None or not self.store.parent.is_dir():
            return _made(file)
        with FileLock(self.store.with_suffix(".lock")):  # released by the system where its holder is killed
            if not self.store.exists():
                fresh = self.store.with_suffix(".new")
                fresh.write_bytes(pickle.dumps(_made(file), pickle.HIGHEST_PROTOCOL))
                os.replace(fresh, self.store)
        part, reduced = pickle.loads(self.store.read_bytes())
        return part, reduced

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


def _made(file: SceneFile) -> tuple[Part, ReducedModel]:
    """A part and its reduction, not damped, with nothing prescribed."""
    scene = file.mesh_scene
    with TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
    part = modelling.make_part(scene, mesh, node_sets, file.folder)
    return part, modelling.plain_model(scene, part)
