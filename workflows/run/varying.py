"""A scene whose numbers are varied: what a step of each of them makes of its problem, without solving it again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn import declare
from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.contact.joint import Contact
from tribodyn.hbm.derivatives import Change, Posed
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import joints, matrix_model, modelling, part_reduction
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.loads import KINDS
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene, PartScene, Scene

STEP = 1e-5  # relative, of a number that acts on contact, loads or damping alone
REBUILT = 1e-3  # the same of one with which the model is reduced anew, whose rounding is larger
OF_CONTACT = ("tangential_stiffness", "normal_stiffness")


def keys(scene: Scene) -> dict[str, float]:
    """The numbers of a scene that its response depends on smoothly, by their keys, in SI units; zeros are left out."""
    found: dict[str, float] = {}

    def add(table: str, values: Any, names: Sequence[str]) -> None:
        for name in names:
            value = values.get(name) if isinstance(values, dict) else getattr(values, name, None)
            if isinstance(value, float) and value != 0.0:
                found[f"{table}.{name}"] = value

    single = list(scene.joints) == ["contact"] and not getattr(scene, "contacts", None)
    for name, contact in scene.joints.items():
        table = "contact" if single else f"contacts.{name}"
        own = {n.name: contact.numbers.get(n.name) for n in declare.read(contact.law_file) if not n.whole}
        add(table, contact, OF_CONTACT)
        add(table, {name: None if value is None else float(value) for name, value in own.items()}, list(own))
    for kind in ("static", "harmonic"):
        for name, load in getattr(scene.loads, kind).items():
            add(f"loads.{kind}.{name}", load, KINDS)
    add("damping", scene.damping, ("modal", "mass", "stiffness"))
    add("material", getattr(scene, "material", None), ("young", "density"))
    for name, material in getattr(scene, "materials", {}).items():
        add(f"materials.{name}", material, ("young", "density"))
    for section, names in (
        ("springs", ("stiffness",)),
        ("prescribed", ("displacement",)),
        ("bolts", ("preload",)),
        ("motion", ("static", "harmonic")),
    ):
        for name, table in getattr(scene, section, {}).items():
            add(f"{section}.{name}", table, names)
    add("wheel", getattr(scene, "wheel", None), ("speed",))
    return found


class Varying:
    """A scene with its model, and what a step of each of its numbers makes of it."""

    def __init__(self, file: SceneFile, progress: Progress):
        self.file, self.scene = file, file.scene
        part = plain = None
        if isinstance(self.scene, MeshScene):
            with progress.stage("mesh, mass and stiffness, reduction"):
                part, plain = self._made(file)
            reduced = part_reduction.with_prescribed(self.scene, part, modelling.damped(self.scene, plain))
        else:
            assert isinstance(self.scene, MatrixScene)
            plain = matrix_model.make(self.scene, file.folder)
            reduced = modelling.damped(self.scene, plain)
        self.part, self.plain = part, plain
        self.model = modelling.make_model(self.scene, part, reduced)
        self.own = Posed.of(self.model.balance)

    @staticmethod
    def _made(file: SceneFile) -> tuple[Part, ReducedModel]:
        part, _ = modelling.with_surfaces(file.mesh_scene, modelling.part_of(file, Progress()), file.folder)
        return part, modelling.plain_of(file, part)

    def change(self, key: str, value: float) -> Change:
        """The problems a step above and below a value of a key."""
        if self._settles or self.anew(key):
            step = REBUILT * abs(value)
            far = self.posed(key, value + 2 * step), self.posed(key, value - 2 * step)
        else:
            step, far = STEP * abs(value), None
        return Change(key, step, self.posed(key, value + step), self.posed(key, value - step), far)

    def posed(self, key: str, value: float) -> Posed:
        """The problem with another value of a key; nothing is solved but what the preload comes to rest in."""
        file = self.file.changed(f"{key}={value!r}")
        scene, part, plain = file.scene, self.part, self.plain
        if self._scales(key):
            plain = _scaled(plain, key.rpartition(".")[2], value / keys(self.scene)[key])
        elif self.anew(key):
            part, plain = self._made(file)
        reduced = self.own.model
        if plain is not self.plain or self._damps(scene, plain):
            reduced = modelling.damped(scene, plain)
            if isinstance(scene, MeshScene) and part is not None:
                reduced = part_reduction.with_prescribed(scene, part, reduced)
        if self._settles:
            problem = modelling.Problem.of(scene, part, reduced)
            return Posed.of(problem.balance(self.model.balance.basis.harmonics))
        base = None
        if isinstance(scene, MeshScene) and part is not None:
            base = modelling.ground_motion(scene, part, self.model.balance.basis)
        contact = Contact.of(reduced, joints.make_joints(scene, plain))
        return Posed(reduced, contact, joints.excite(scene, base), self.own.memory)

    @property
    def _settles(self) -> bool:
        """Whether the contact comes to its preload in steps of their own, by bolts or without friction."""
        return self.scene.preload.frictionless or bool(getattr(self.scene, "bolts", None))

    @property
    def _spins(self) -> bool:
        wheel = getattr(self.scene, "wheel", None)
        return wheel is not None and wheel.speed > 0

    def anew(self, key: str) -> bool:
        """Whether the model is reduced anew: the stress of a part that spins is that of its contact at rest."""
        if self._scales(key):
            return False
        of_stress = ("contact.", "contacts.", "loads.static.") if self._spins else ()
        return key.startswith(("material.", "materials.", "springs.", "wheel.", *of_stress))

    def _scales(self, key: str) -> bool:
        """Whether stiffness or mass of the reduced model is proportional to it: of a part of one material alone."""
        scene = self.scene
        if key not in ("material.young", "material.density") or not isinstance(scene, PartScene) or self._spins:
            return False
        loads = {**scene.loads.static, **scene.loads.harmonic}.values()
        return not scene.springs and all(load.value is not None or load.pressure is not None for load in loads)

    def _damps(self, scene: Scene, plain: ReducedModel) -> bool:
        """Whether the damping of a scene is another one."""
        if scene.damping != self.scene.damping:
            return True
        own, springs = (joints.contact_stiffness(one, plain) for one in (self.scene, scene))
        return scene.damping.given and scene.damping.state == "stuck" and not np.array_equal(own, springs)


def _scaled(plain: ReducedModel, name: str, factor: float) -> ReducedModel:
    """The model with its stiffness or mass times a factor, as Young's modulus or the density of all of it make it."""
    matrix = {"young": "stiffness", "density": "mass"}[name]
    made: dict[int, tuple[SecondOrderSystem, SecondOrderSystem]] = {}

    def scaled(system: SecondOrderSystem) -> SecondOrderSystem:
        if id(system) not in made:
            made[id(system)] = system, replace(system, **{matrix: factor * getattr(system, matrix)})
        return made[id(system)][1]

    first, seen = scaled(plain.system), plain.per_harmonic
    if seen is None:
        return replace(plain, system=first)

    def per_harmonic(h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        system, B = seen(h)
        return scaled(system), B

    return replace(plain, system=first, per_harmonic=per_harmonic)
