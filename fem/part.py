"""From mesh to a full second-order system with its contact: the chain that a scene runs for each part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tribodyn.fem.constraints import AXES, Clamp, NoMeanRotation, free_dofs, named
from tribodyn.fem.contact import ground_contact, join, pair_contact, plane_contact
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import COMPONENTS, ContactInterface
from tribodyn.fem.loads import Load, NodalForce
from tribodyn.fem.material import Material
from tribodyn.fem.springs import Spring
from tribodyn.fem.system import SecondOrderSystem


@dataclass(frozen=True)
class Contact:
    """What a scene says about one contact.

    face : boundary name of body 1; opposite : boundary name of body 2, None for the ground
    t1 : (3,) direction that the first tangent follows; components : those modelled; gap : [m], one or per pair
    vertices_only : pairs at the element corners only
    plane : (3,) towards a ground that is a plane, turned about t1 by inclination [rad]; see `plane_contact`
    """

    face: str
    t1: Sequence[float]
    opposite: str | None = None
    components: Sequence[str] = COMPONENTS
    gap: float | np.ndarray = 0.0
    vertices_only: bool = False
    plane: Sequence[float] | None = None
    inclination: float = 0.0

    def __post_init__(self) -> None:
        if self.plane is not None and self.opposite is not None:
            raise ValueError(f"contact '{self.face}': a plane ground and an opposite face exclude each other; drop one")
        if self.inclination and self.plane is None:
            raise ValueError(f"contact '{self.face}': an inclination needs a plane ground; give its plane")

    def build(self, mesh: Any) -> ContactInterface:
        """The interface over all DOFs of the mesh."""
        faces = mesh.boundaries or {}
        first = named(faces, self.face, "face")
        if self.plane is not None:
            return plane_contact(
                mesh, first, self.plane, self.t1, self.components, self.gap, self.vertices_only, self.inclination
            )
        if self.opposite is None:
            return ground_contact(mesh, first, self.t1, self.components, self.gap, self.vertices_only)
        second = named(faces, self.opposite, "face")
        return pair_contact(mesh, first, second, self.t1, self.components, self.gap, self.vertices_only)


@dataclass(frozen=True)
class Part:
    """system : over the free DOFs; interface : likewise; free : (n_free,) DOF of the mesh that each one is,
    node * 3 + component; points : (n_node, 3) coordinates of the nodes [m]; mesh : scikit-fem's;
    held : (k, n_free) motions that are held besides, held @ q = 0, for reduction.held
    pairs : contact face -> its pairs in the interface; node_sets : as geometry.mesh.read gives them
    """

    system: SecondOrderSystem
    interface: ContactInterface
    free: np.ndarray
    points: np.ndarray
    mesh: Any
    held: np.ndarray
    pairs: Mapping[str, slice]
    node_sets: Mapping[str, np.ndarray]

    def dofs(self, group: str, axis: str) -> np.ndarray:
        """Places among the free DOFs (k,) of the displacements of a node set along "x", "y" or "z".

        Raises  ValueError where the set is unknown or empty, or where one of them is clamped
        """
        wanted = named(self.node_sets, group) * 3 + AXES.index(axis)
        place = np.searchsorted(self.free, wanted)
        if not np.array_equal(self.free[np.minimum(place, len(self.free) - 1)], wanted):
            raise ValueError(f"a node of '{group}' is clamped along {axis}; choose nodes that can move")
        return place

    def field(self, q: np.ndarray) -> np.ndarray:
        """Displacement (n_node, 3, ...) [m] of all nodes from free DOFs q (n_free, ...)."""
        full = np.zeros((3 * len(self.points), *q.shape[1:]), dtype=q.dtype)
        full[self.free] = q
        return full.reshape(len(self.points), 3, *q.shape[1:])


def build(
    mesh: Any,
    node_sets: Mapping[str, np.ndarray],
    material: Material | Mapping[str, Material],
    clamps: Sequence[Clamp],
    contacts: Sequence[Contact],
    loads: Mapping[str, Load],
    outputs: Mapping[str, NodalForce],
    order: int | None = None,
    springs: Sequence[Spring] = (),
    held: Sequence[NoMeanRotation] = (),
) -> Part:
    """Assemble a part, hold it, and say where it touches, is loaded and is watched.

    mesh, node_sets : as geometry.mesh.read gives them; material : one, or subdomain name -> material
    order : quadrature order, 5 unless told; springs : joints that give way, to the ground or between sets
    held : motions that are held besides the clamps
    Raises  ValueError where a name is unknown or a group is empty, one sentence
    """
    M, K = assemble(mesh, material, order)
    K = sum((spring.matrix(mesh, node_sets) for spring in springs), start=K)
    points = coordinates(mesh)
    free = free_dofs(K.shape[0], clamps, node_sets)
    built = [contact.build(mesh) for contact in contacts]
    ends = np.cumsum([0] + [one.n_pair for one in built])
    pairs = {contact.face: slice(*ends[i : i + 2].tolist()) for i, contact in enumerate(contacts)}
    interface = join(built)
    system = SecondOrderSystem(
        mass=M[free][:, free],
        stiffness=K[free][:, free],
        loads={name: load.vector(mesh, node_sets, M)[free] for name, load in loads.items()},
        outputs={name: output.vector(mesh, node_sets)[free] for name, output in outputs.items()},
    )
    rows = np.array([motion.row(points, M)[free] for motion in held]).reshape(len(held), len(free))
    return Part(system, replace(interface, B=interface.B[:, free]), free, points, mesh, rows, pairs, node_sets)
