"""The contact interface: which displacements meet, in which frame, with which area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import issparse, vstack

from tribodyn.refusal import Refusal

COMPONENTS = ("t1", "t2", "n")


@dataclass(frozen=True)
class ContactInterface:
    """Node pairs (or nodes against the ground) whose relative displacement is x = B q.

    components : the components a scene needs, a subset of ("t1", "t2", "n") in this order
    points : (n_pair, 3) position of the body-1 node [m]
    frames : (n_pair, 3, 3) rows t1, t2, n; n points from body 1 into body 2, so closing is positive
    area : (n_pair,) tributary area [m2], sums to the area of the patch
    gap : (n_pair,) opening before loading [m], negative is interference
    B : (n_pair * n_component, n_dof) row pair * n_component + component, sparse (full model) or dense (reduced)
    faces : (n_face, k) corner-ordered polygons over the pairs, for area and pictures (may be empty)"""

    components: tuple[str, ...]
    points: np.ndarray
    frames: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    B: Any
    faces: np.ndarray

    @property
    def n_pair(self) -> int:
        """Number of node pairs."""
        return len(self.area)

    def stiffness(self, tangential: float, normal: float) -> np.ndarray:
        """Share the stiffness of the whole patch by tributary area.

        tangential, normal : stiffness of the whole patch [N/m]
        Returns (n_pair, n_component) [N/m], each column summing to the patch value
        Source  Tamatam 2021, section 3.3: distribution by elemental area contribution"""
        total = {"t1": tangential, "t2": tangential, "n": normal}
        return np.outer(self.area / self.area.sum(), [total[c] for c in self.components])


def checked_components(components: Sequence[str]) -> tuple[str, ...]:
    """The components; raises Refusal where they are not some of t1, t2, n in this order."""
    names = tuple(components)
    if not names or names != tuple(c for c in COMPONENTS if c in names):
        raise Refusal(f"contact components {list(names)} must be some of t1, t2, n, in this order")
    return names


def contact_frames(normals: np.ndarray, t1: Sequence[float] | None) -> np.ndarray:
    """Right-handed frames (k, 3, 3), rows t1, t2, n, from unit normals (k, 3) and a direction that t1 follows.

    t1 : where None the first of x, y, z that lies most along the face

    Raises  Refusal where the direction is along a normal"""
    if t1 is None:
        t1 = np.eye(3)[int(np.argmin(np.round(np.abs(normals).max(axis=0), 3)))]
    direction = unit(t1, "the contact direction t1")
    tangent = direction - (normals @ direction)[:, None] * normals
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    if (length < 1e-3).any():
        raise Refusal(f"the contact direction t1 = {list(t1)} is along the contact normal; give one along the face")
    first = tangent / length
    return np.stack([first, np.cross(normals, first), normals], axis=1)


def unit(direction: Sequence[float], label: str) -> np.ndarray:
    """Unit vector (3,) along a direction.

    Raises  Refusal, naming it by `label`, for a zero vector or a wrong length"""
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise Refusal(f"{label} must be three numbers that are not all zero, but is {list(np.ravel(direction))}")
    return vector / np.linalg.norm(vector)


def join(interfaces: Sequence[ContactInterface]) -> ContactInterface:
    """Several contacts of one structure as one interface, pairs in the order given; triangles become quadrangles that
    repeat a corner where there are quadrangles too.

    Raises  Refusal where they differ in components"""
    if len({i.components for i in interfaces}) > 1:
        raise Refusal("the contacts of a structure must be built with the same components")
    first = np.cumsum([0] + [i.n_pair for i in interfaces])
    names = ("points", "frames", "area", "gap")
    fields: dict[str, Any] = {name: np.concatenate([getattr(i, name) for i in interfaces]) for name in names}
    width, maps = max(i.faces.shape[1] for i in interfaces), [i.B for i in interfaces]
    faces = [np.pad(i.faces, ((0, 0), (0, width - i.faces.shape[1])), mode="edge") for i in interfaces]
    return ContactInterface(
        components=interfaces[0].components,
        **fields,
        B=vstack(maps, format="csr") if issparse(maps[0]) else np.concatenate(maps),
        faces=np.concatenate([of + start for of, start in zip(faces, first, strict=False)]),
    )
