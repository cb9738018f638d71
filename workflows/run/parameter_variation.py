"""Variation of the numbers of a scene: the inputs of its balance for other values, without solving it again."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.reduction.relative import body_1_dofs, relative
from tribodyn.reduction.sensitivity import Sensitivity
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, matrix_model, modelling, part_reduction, scene_assembly, scene_loads
from tribodyn.workflows.run.part_changes import difference, moves_evenly, scaled
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.scene_numbers import is_loaded_alike, is_seen_by_contact, moves_nodes, with_value
from tribodyn.workflows.scene.fields import CONTACT, REDUCTION
from tribodyn.workflows.scene.load_tables import SpringTable, Vibrates
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.part_tables import Meshed
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.scene_values import smooth_numbers
from tribodyn.workflows.scene.schema import MeshScene, Scene, has_wheel
from tribodyn.workflows.scene.structure_tables import BoltTable

if TYPE_CHECKING:
    from tribodyn.reduction.sector_reduction import ReducedSector

# relative, of a number that acts on contact, loads or damping alone. With 1e-7 forces round: the law of scaling of the
# beam's stiffness is 2e-6 off, for 3e-8; with 1e-5 a peak at a corner, seen from 3e-4 half widths, 3e-4, for 3e-6
STEP = 1e-6
REBUILT = 1e-3  # the same of a number of the structure, whose rounding is larger
# by which lengths and angles move nodes, for matrices, areas and gaps, and in a wheel its rows, whose frames are no
# rotations elsewhere; a model is reduced anew by 4 times as much. By 10 times a harmonic beside its own resonance takes
# the coarse blade's preload by its span 4e-5 off; by 1, rounding the coarse rig's amplitude by its height
NODES = 1e-4


class ParameterVariation:
    """A scene with its model, and the inputs of its balance for another value of one of its numbers."""

    def __init__(self, file: SceneFile, progress: Progress):
        self.file, self.scene = file, file.scene
        part = plain = None
        if isinstance(self.scene, MeshScene):
            with progress.stage("mesh, mass and stiffness, reduction"):
                part, plain = self._part_and_model(file)
            self._damped = modelling.damped(self.scene, plain)
            reduced = part_reduction.with_prescribed(self.scene, part, self._damped)
        else:
            assert isinstance(self.scene, MatrixScene)
            plain = matrix_model.make(self.scene, file.folder)
            reduced = self._damped = modelling.damped(self.scene, plain)
        self.part, self.plain = part, plain
        self.model = modelling.make_model(self.scene, part, reduced, folder=file.folder)
        self.base = BalanceInputs.of(self.model.balance)
        self.numbers = smooth_numbers(self.scene)
        self._directions: dict[str, SecondOrderSystem] = {}  # key -> what the reduced model moves by where it doubles
        self._moved_parts: dict[str, tuple[Part, Part]] = {}  # key -> the part with its nodes moved to both sides

    @staticmethod
    def _part_and_model(file: SceneFile) -> tuple[Part, ReducedModel]:
        part, _ = modelling.with_surfaces(file, modelling.part_of(file, Progress()))
        return part, modelling.plain_of(file, part)

    def change(self, key: str, value: float) -> ParameterChange:
        """The problems a step above and below a value of a key."""
        number, needs_reduction = self.numbers[key], self._has_preload_steps or self.is_reduced_again(key)
        linear = self._scales(key) or self.is_linear(key)
        step = (REBUILT if needs_reduction or linear else STEP) * abs(value)
        if moves_nodes(number):
            self.nodes_moved(key)  # or refused
            step = (4 if needs_reduction else 1) * NODES * abs(value) if needs_reduction or self._sector else step
        far: tuple[BalanceInputs, ...] | None = () if needs_reduction or linear else None
        if self._has_preload_steps or (needs_reduction and number.stage <= REDUCTION):
            far = self.inputs(key, value + 2 * step), self.inputs(key, value - 2 * step)
        touching = None
        if (needs_reduction or linear) and not self._has_preload_steps and is_seen_by_contact(number):
            small = STEP * abs(value)
            up, down = (replace(self.base, contact=self._contact(key, value + side)) for side in (small, -small))
            touching = ParameterChange(key, small, up, down)
        return ParameterChange(key, step, self.inputs(key, value + step), self.inputs(key, value - step), far, touching)

    def _changed(self, key: str, value: float) -> SceneFile:
        """The scene with another value of a key; read again only where other numbers follow from it."""
        number = self.numbers[key]
        if number.path[0] == "wheel" or isinstance(number.table, Meshed) or number.name == "temperature":
            return self.file.changed(f"{key}={value!r}")
        return replace(self.file, scene=with_value(self.scene, number.path, value))

    def _contact(self, key: str, value: float) -> JointSet:
        """The contact with another value of a key."""
        plain = self.plain
        if moves_nodes(self.numbers[key]):
            plain = replace(plain, interface=self._interface(plain.interface, key, value))
        return JointSet.of(self.base.model, joints.make_joints(self._changed(key, value).scene, plain))

    def inputs(self, key: str, value: float) -> BalanceInputs:
        """The problem with another value of a key; nothing is solved but what the preload comes to rest in."""
        file = self._changed(key, value)
        scene, part, plain, number = file.scene, self.part, self.plain, self.numbers[key]
        if self._scales(key):
            plain = scaled(plain, number.name, value / number.value)
        elif self.is_linear(key):
            plain = self._changed_model(key, value)
            if part is not None and moves_nodes(number):
                part = replace(part, interface=self._interface(part.interface, key, value))
        elif self.is_reduced_again(key):
            part, plain = self._part_and_model(file)
        reduced = self.base.model
        if plain is not self.plain or self._damps(scene, plain):
            ratio, reference = value / number.value, self._damped
            if self._scales(key) and scene.damping.modal is not None and scene.damping.state != "stuck":
                ratio, reference = ratio**0.5, scaled(reference, number.name, ratio)  # as all frequencies go
            if key == "damping.modal" or reference is not self._damped:  # the same modes
                reduced = reference.with_damping(lambda system, _: ratio * np.asarray(system.damping))
            else:
                reduced = modelling.damped(scene, plain)
            if isinstance(scene, MeshScene) and part is not None:
                reduced = part_reduction.with_prescribed(scene, part, reduced)
        if self._has_preload_steps:
            problem = modelling.Problem.of(scene, part, reduced)
            balance = problem.balance(self.model.balance.basis.harmonics)
            return replace(BalanceInputs.of(balance), balance=balance)
        base = None
        if isinstance(scene, MeshScene) and part is not None:
            base = scene_loads.ground_motion(scene, part, self.model.balance.basis)
        contact = self._contact(key, value) if is_seen_by_contact(number) and plain is self.plain else self.base.contact
        loads = self.base.excitation if number.stage is CONTACT else joints.excite(scene, base)
        return BalanceInputs(reduced, contact, loads, self.base.memory, same_coordinates=self.is_linear(key))

    @property
    def _has_preload_steps(self) -> bool:
        """Whether the contact comes to its preload in steps of their own, by bolts or without friction."""
        return self.scene.preload.frictionless or bool(getattr(self.scene, "bolts", None))

    @property
    def _is_spinning(self) -> bool:
        wheel = getattr(self.scene, "wheel", None)
        return wheel is not None and wheel.speed > 0

    def is_reduced_again(self, key: str) -> bool:
        """Whether the model must be reduced again; the stress of a spinning part is that of its contact at rest."""
        number, scene = self.numbers.get(key), self.scene
        if (
            number is None
            or isinstance(number.table, (Vibrates, BoltTable))
            or self._scales(key)
            or self.is_linear(key)
        ):
            return False
        return number.stage <= (scene.reduced_through if isinstance(scene, MeshScene) else REDUCTION)

    def is_linear(self, key: str) -> bool:
        """Whether the full matrices are linear in a number, so that the reduced ones follow by projection."""
        number = self.numbers[key]
        if moves_nodes(number) and self._has_preload_steps:  # bolts are as long as their part is thick
            return False
        return number.stage <= REDUCTION and not self._scales(key) and self._sensitivity is not None

    @cached_property
    def _sensitivity(self) -> Sensitivity | None:
        """None where the model is no plain reduction by Craig and Bampton of a part that stands still."""
        part, plain, wave = self.part, self.plain, self._sector
        if part is None or len(part.held_rows) or self._is_spinning or (plain.is_wave and wave is None):
            return None
        plain = plain if wave is None else wave.model
        origin = plain.origin
        if not isinstance(origin, ReductionBasis) or origin.n_interface_modes or plain.leaves_flexibility_out:
            return None
        (system, _, back), shapes = self._base_coordinates, origin.basis
        if back is not None:
            shapes = shapes.copy()
            shapes[body_1_dofs(part.interface).ravel()] = part.interface.B @ origin.basis
        return Sensitivity(system, plain, shapes)

    @cached_property
    def _sector(self) -> ReducedSector | None:
        """The reduced sector of a wheel whose waves have all coordinates of it, None for other models."""
        if not self.plain.is_wave:
            return None
        from tribodyn.reduction.wave_model import WaveIndices, as_wave

        wave = as_wave(self.plain)
        has_all = isinstance(wave.index_of, WaveIndices) and wave.reduced.sector.system.n_dof <= LIMITS.many_coordinates
        return wave.reduced if has_all else None

    @cached_property
    def _base_coordinates(self) -> tuple[SecondOrderSystem, ContactInterface, csr_matrix | None]:
        """`_coordinates` of the own part."""
        return self._coordinates(cast(Part, self.part))

    def _coordinates(self, part: Part) -> tuple[SecondOrderSystem, ContactInterface, csr_matrix | None]:
        """System and interface of a part in the coordinates that it is reduced in, and the way back from them."""
        if self._sector is None and self.file.mesh_scene.reduction.relative:
            return relative(part.system, part.interface)
        return part.system, part.interface, None

    def _changed_model(self, key: str, value: float) -> ReducedModel:
        """The reduced model with another value of a key that it follows."""
        number, following, scene = self.numbers[key], self._sensitivity, self.file.mesh_scene
        share = value / number.value - 1
        assert following is not None
        if key == "material.young" and is_loaded_alike(scene):  # all stiffness but that of the springs
            springs = [spring for spring, number in self.numbers.items() if isinstance(number.table, SpringTable)]
            changed_model = following.model_at([(self._direction(spring), -share) for spring in springs], share)
        else:
            changed_model = following.model_at([(self._direction(key), share)])
        wave, turned = self._sector, list[Any]()
        if moves_nodes(number):
            moved_parts = self.nodes_moved(key)[int(share < 0)]
            rows = [(self._coordinates(moved_parts)[1].B, self._base_coordinates[1].B)]
            if wave is not None and has_wheel(scene):
                from tribodyn.workflows.run import sector

                rows.append(
                    tuple(
                        sector.sector(scene, moved_part).left_map for moved_part in (moved_parts, cast(Part, self.part))
                    )
                )
            turned = [
                abs(share) / NODES * ((rows_after - rows_before) @ following.shapes) for rows_after, rows_before in rows
            ]
            changed_model = replace(
                changed_model, interface=self._interface(changed_model.interface, key, value, turned[0])
            )
        if wave is None:
            return changed_model
        left = wave.sector.left_map + (turned[1] if turned else 0.0)
        small = replace(
            wave,
            sector=replace(wave.sector, system=changed_model.system, interface=changed_model.interface, left_map=left),
        )
        from tribodyn.reduction.wave_model import WaveIndices, as_wave, wave_model

        return wave_model(small, as_wave(self.plain).engine_order, WaveIndices(small))

    def _direction(self, key: str) -> SecondOrderSystem:
        """What the reduced model moves by where a key is doubled."""
        if key not in self._directions:
            assert self._sensitivity is not None
            if moves_nodes(self.numbers[key]):
                up, down = (self._coordinates(moved_part)[0] for moved_part in self.nodes_moved(key))
                change = difference(up, down, 1 / (2 * NODES))
            else:
                change = self._doubled(key)
                change = change if self._base_coordinates[2] is None else change.projected(self._base_coordinates[2])
            self._directions[key] = self._sensitivity.towards(change)
        return self._directions[key]

    def _reach(self, key: str) -> float:
        """Share of a length or angle within which its mesh has to stay the same one that moves."""
        return NODES if self.is_linear(key) else 8 * NODES

    def nodes_moved(self, key: str) -> tuple[Part, Part]:
        """The part with its nodes moved to a length or angle above and below.

        Raises  NoDerivative where the mesh or what meets at the contact is another one there, or none"""
        if key not in self._moved_parts:
            assert self.part is not None
            value, reach = self.numbers[key].value, self._reach(key)
            try:
                up, down = (self._part(self._changed(key, value * side)) for side in (1 + reach, 1 - reach))
            except Refusal as reason:
                raise NoDerivative(f"beside {key} = {value:g}: {reason}") from None
            if not moves_evenly(up, self.part, down):
                raise NoDerivative(f"beside {key} = {value:g} its mesh or what meets at the contact is another one")
            self._moved_parts[key] = up, down
        return self._moved_parts[key]

    @staticmethod
    def _part(file: SceneFile) -> Part:
        """The part of another scene, which is not kept."""
        with TemporaryDirectory() as folder:
            mesh, node_sets = modelling.make_mesh(file, Path(folder))
        part = modelling.make_part(file.mesh_scene, mesh, node_sets, file.folder)
        return modelling.with_surfaces(file, part)[0]

    def _interface(self, own: ContactInterface, key: str, value: float, turned: Any = 0.0) -> ContactInterface:
        """An interface with its places, frames, areas and gaps moved to another length or angle, its rows `turned`."""
        share = (value / self.numbers[key].value - 1) / (2 * self._reach(key))
        up, down = (part.interface for part in self.nodes_moved(key))
        names = ("points", "frames", "area", "gap")
        values = {n: getattr(own, n) + share * (getattr(up, n) - getattr(down, n)) for n in names}
        return replace(own, **values, B=own.B + turned)

    def _doubled(self, key: str) -> SecondOrderSystem:
        """What the full system moves by where a key is doubled; springs need no assembly."""
        number, part = self.numbers[key], self.part
        assert part is not None
        own = part.system
        if self.file.mesh_scene.material is not None and isinstance(number.table, SpringTable):
            spring = scene_assembly.make_spring(number.table)
            change = part.restricted(spring.matrix(part.mesh, part.node_sets))
            still = {kind: {name: 0 * v for name, v in getattr(own, kind).items()} for kind in ("loads", "outputs")}
            return SecondOrderSystem(csr_matrix(own.mass.shape), change, None, **still)
        return difference(self._part(self._changed(key, 2 * number.value)).system, own)

    def _scales(self, key: str) -> bool:
        """Whether stiffness or mass of the reduced model is proportional to it: of a part of one material alone."""
        scene = self.scene
        if key not in ("material.young", "material.density") or not isinstance(scene, MeshScene) or self._is_spinning:
            return False
        return is_loaded_alike(scene) and not (scene.springs and key == "material.young")

    def _damps(self, scene: Scene, plain: ReducedModel) -> bool:
        """Whether the damping of a scene is another one."""
        if scene.damping != self.scene.damping:
            return True
        springs_before, springs = (joints.contact_stiffness(scene_, plain) for scene_ in (self.scene, scene))
        return scene.damping.given and scene.damping.state == "stuck" and not np.array_equal(springs_before, springs)
