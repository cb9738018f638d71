"""From the tables of a scene to its joints with their laws and springs, and to what excites the model."""

from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.declarations import Role, name_of
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.material import Material
from tribodyn.fem.part import Part
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.aging import Aging, DebrisBed, NumberTable
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.stiffness import rectangular_punch
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.wear.law import JointWear
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import decks, scene_assembly
from tribodyn.workflows.scene.contact import ContactTable, FaceContact
from tribodyn.workflows.scene.schema import CENTRIFUGAL, MeshScene, Scene
from tribodyn.workflows.scene.user_files import LawTable
from tribodyn.workflows.scene.wear import JointWearTable


def contact_stiffness(scene: Scene, reduced: ReducedModel) -> np.ndarray:
    """Contact springs (n_pair, n_component) [N/m], each joint's shared by its areas; zero where it models nothing."""
    interface = reduced.interface
    k = np.zeros((interface.n_pair, len(interface.components)))
    for name, pairs in joint_pairs(scene, reduced).items():
        contact = scene.joints[name]
        module = contact_law.load(contact.law_name)
        if getattr(module, "STIFFNESS_FROM_NUMBERS", False):
            columns = [interface.components.index(c) for c in contact.components]
            parameters = parameters_of(contact, interface, pairs, np.ones((len(interface.area[pairs]), len(columns))))
            k[pairs, columns] = module.springs(contact_law.complete(contact.law_name, parameters))
            continue
        tangential, normal = joint_stiffness(scene, contact)
        total = {"t1": tangential, "t2": tangential, "n": normal}
        stiffnesses = [total[c] if c in contact.components else 0.0 for c in interface.components]
        k[pairs] = np.outer(interface.area[pairs] / interface.area[pairs].sum(), stiffnesses)
    return k


def unreduced(part: Part) -> ReducedModel:
    """The part itself in the place of a reduced model, sparse."""
    return ReducedModel(part.system, part.interface, joints=dict(part.joints))


def joint_pairs(scene: Scene, reduced: ReducedModel) -> dict[str, slice]:
    """Pairs of every joint; all of them where there is one."""
    if len(scene.joints) == 1:
        return {name: slice(0, reduced.interface.n_pair) for name in scene.joints}
    return dict(reduced.joints)


def joint_stiffness(scene: Scene, contact: ContactTable) -> tuple[float, float]:
    """Tangential and normal stiffness of a joint [N/m]; those of a punch in shear along t1 serve both tangents."""
    if isinstance(contact, FaceContact) and contact.punch is not None:
        first = elastic(scene, contact.groups[0])
        second = first if contact.opposite is None else elastic(scene, contact.opposite)
        normal, tangential = rectangular_punch(*contact.punch, *first, *second)
        return tangential, normal
    return contact.tangential_stiffness or 0.0, contact.normal_stiffness or 0.0


def elastic(scene: Scene, face: str) -> tuple[float, float]:
    """Young's modulus [Pa] and Poisson's ratio of the body that a face belongs to.

    Raises  ValueError where it is orthotropic or of several materials"""
    assert isinstance(scene, MeshScene)
    solid = None if scene.material is None else scene_assembly.make_material(scene.material)
    if scene.material is None:
        body = scene.bodies.get(face.partition(".")[0])
        if body is None:
            raise Refusal(f"the punch on '{face}' needs a body of [bodies.NAME]: give its stiffness")
        name = body.material
        solid = scene_assembly.make_material(scene.materials[name]) if isinstance(name, str) else None
    if not isinstance(solid, Material):
        raise Refusal(f"the punch on '{face}' needs a body of one isotropic material: give its stiffness")
    return solid.E, solid.nu


def wear_table_of(scene: Scene, name: str = "") -> JointWearTable:
    """How a joint of a scene that wears does so: its own table, or that of all."""
    return getattr(scene.joints.get(name), "wear", None) or scene.wear_table


def wear_of(scene: Scene, name: str = "") -> JointWear:
    """The wear law of a joint of a scene that wears."""
    table = wear_table_of(scene, name)
    return replace(JointWear.of(table.law_name, **table.numbers), tables=_over_wear(table))


def _over_wear(table: LawTable) -> dict[str, NumberTable]:
    """The tables over the state of worn pairs."""
    states = table.by_state.items()
    return {name: NumberTable(s.over, s.at, s.values) for name, s in states if s.over != "temperature"}


def aging_of(scene: Scene, name: str) -> Aging | None:
    """What changes of a joint as it wears; None where its gap alone opens."""
    if scene.wear is None:
        return None
    tables, debris = _over_wear(scene.joints[name]), wear_table_of(scene, name).debris
    if not tables and debris is None:
        return None
    by_energy = any(table.over == "energy_density" for table in tables.values())
    bed = DebrisBed() if debris is None else DebrisBed(debris.retained, debris.thickness or np.inf)
    return Aging(tables, wear_of(scene, name).energy if by_energy else None, bed)


def make_joints(scene: Scene, reduced: ReducedModel) -> list[Joint]:
    """Every joint with its law and that law's parameters."""
    springs, interface = contact_stiffness(scene, reduced), reduced.interface
    made_joints = []
    for name, pairs in joint_pairs(scene, reduced).items():
        contact = scene.joints[name]
        columns = [interface.components.index(c) for c in contact.components]
        parameters = parameters_of(contact, interface, pairs, springs[pairs][:, columns])
        parameters = replace(parameters, aging=aging_of(scene, name))
        made_joints.append(Joint(name, contact.law_name, parameters, pairs))
    if not made_joints:  # a structure that touches nothing: a joint of no pairs
        zeros: dict[str, Any] = {number.name: 0.0 for number in contact_law.declared("jenkins")}
        nothing = contact_law.ContactParameters.of(interface.components, springs, gap=interface.gap, **zeros)
        made_joints.append(Joint("none", "jenkins", nothing))
    return made_joints


def parameters_of(
    contact: ContactTable, interface: ContactInterface, pairs: slice, springs: np.ndarray
) -> contact_law.ContactParameters:
    """The parameters of a joint with springs (n_pair, n_component); a law that counts by area has that of each pair."""
    numbers: dict[str, Any] = dict(contact.numbers)
    area = name_of(Role.AREA, contact_law.declared(contact.law_name))
    if area is not None:
        numbers.setdefault(area, interface.area[pairs])
    return contact_law.ContactParameters.of(
        contact.components,
        springs,
        gap=interface.gap[pairs],
        table=None if contact.table is None else np.array(contact.table),
        **numbers,
    )


def excite(scene: Scene, base: np.ndarray | None) -> Excitation:
    """The loads of the scene, F cos(h w t + phase) as amplitude F exp(i phase), and the motion of the ground."""
    loads: dict[tuple[int, str], complex] = {(0, name): load.amplitude for name, load in scene.loads.static.items()}
    if isinstance(scene, MeshScene):
        loads |= {(0, name): table.displacement for name, table in scene.prescribed.items()}
        loads |= {(0, decks.load_name(name)): 1.0 for name in scene.decks}
        if scene.wheel is not None and scene.wheel.speed:
            loads[0, CENTRIFUGAL] = (2 * np.pi * scene.wheel.speed) ** 2
    for name, load in scene.loads.harmonic.items():
        loads[load.harmonic, name] = load.amplitude * np.exp(1j * load.phase)
    return Excitation(loads, base)
