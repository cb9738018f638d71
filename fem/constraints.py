"""Which DOFs are free, clamped or prescribed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.sparse import csr_matrix, eye_array, vstack

from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.geometry.sources.directions import Directions


AXES = "xyz"


def find_group(groups: Mapping[str, np.ndarray], name: str, kind: str = "node set") -> np.ndarray:
    """The group of that name.

    Raises  Refusal that lists the names which exist, or that the group is empty"""
    if name not in groups:
        matches = get_close_matches(name, groups, 1)
        guess = f" (did you mean '{matches[0]}'?)" if matches else ""
        raise Refusal(f"the mesh has no {kind} '{name}'{guess}; it has {', '.join(sorted(groups)) or 'none'}")
    if len(groups[name]) == 0:
        raise Refusal(f"the {kind} '{name}' is empty; check the geometry that defines it")
    return np.asarray(groups[name])


@dataclass(frozen=True)
class Clamp:
    """Hold a node set. nodes : its name; axes : which of "xyz" are held."""

    nodes: str
    axes: str = AXES

    def __post_init__(self) -> None:
        if not self.axes or set(self.axes) - set(AXES):
            raise Refusal(f"clamp '{self.nodes}': axes = '{self.axes}' must be some of the letters x, y, z")

    def dofs(self, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """DOFs that are held."""
        nodes = find_group(node_sets, self.nodes)
        return (nodes[:, None] * 3 + [AXES.index(a) for a in self.axes]).ravel()


@dataclass(frozen=True)
class NoMeanRotation:
    """Hold the mean rotation about an axis through the centre of mass: c q = 0, c = (M psi)^T, psi the rotation.

    Every elastic mode of a free part is orthogonal to psi in this sense and stays as it is; only the rotation is lost.
    axis : (3,)"""

    axis: Sequence[float]

    def row(self, points: np.ndarray, mass: Any) -> np.ndarray:
        """c (3 n_node,) [kg], for nodes at points (n_node, 3) and the mass over all DOFs.

        Raises  Refusal for an axis that is none"""
        axis = np.asarray(self.axis, dtype=float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise Refusal(f"the axis {list(np.ravel(axis))} of a held rotation must be three numbers, not all zero")
        share = np.asarray(mass @ np.tile([1.0, 0.0, 0.0], len(points)))[::3]
        arm = points - share @ points / share.sum()
        return np.asarray(mass @ np.cross(axis / np.linalg.norm(axis), arm).ravel())


def free_dofs(n_dof: int, clamps: Iterable[Clamp], node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
    """Sorted DOFs (n_free,) that no clamp holds.

    Raises  Refusal where everything is held"""
    free = np.ones(n_dof, dtype=bool)
    for clamp in clamps:
        free[clamp.dofs(node_sets)] = False
    if not free.any():
        raise Refusal("the clamps hold every DOF of the part; leave some node free")
    return np.flatnonzero(free)


@dataclass(frozen=True)
class Dependence:
    """DOFs (k,) that depend on others: u[dofs] = map @ u with map (k, n_dof); label : of the constraint, for errors.

    equation : each DOF is of an equation, and another of it may follow where this one is held or follows already"""

    dofs: np.ndarray
    map: csr_matrix
    label: str
    equation: bool = False


class Constraint(Protocol):
    """A constraint that knows which DOFs follow which."""

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence: ...


@dataclass(frozen=True)
class ClampAlong:
    """Hold a node set along directions of a local system. axes : which of its directions 0..2"""

    nodes: str
    system: Directions
    axes: Sequence[int]

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """The largest displacement along each direction in terms of the others."""
        nodes, n = find_group(node_sets, self.nodes), 3 * mesh.doflocs.shape[1]
        rows = self.system.at(mesh.doflocs.T[nodes])[:, list(self.axes)]  # nodes, axes, 3
        dofs = np.broadcast_to(3 * nodes[:, None, None] + np.arange(3), rows.shape).reshape(-1, 3)
        rows = rows.reshape(-1, 3)
        k = np.arange(len(rows))
        pivot = np.abs(rows).argmax(axis=1)
        factors = -rows / rows[k, pivot][:, None]
        factors[k, pivot] = 0.0
        factors[np.abs(factors) < 1e-12] = 0.0
        matrix = csr_matrix((factors.ravel(), (np.repeat(k, 3), dofs.ravel())), shape=(len(k), n))
        matrix.eliminate_zeros()
        return Dependence(dofs[k, pivot], matrix, f"the support of '{self.nodes}'", equation=True)


def restriction(n_dof: int, free: np.ndarray, constraints: Sequence[Dependence]) -> tuple[np.ndarray, csr_matrix]:
    """The independent DOFs (n_free,), and the map (n_dof, n_free) from them to all DOFs.

    free : DOFs that no clamp holds
    Raises  Refusal, naming the constraints, where a DOF follows twice, is clamped and follows, or follows itself"""
    owner = np.full(n_dof, -1)
    clamped = np.ones(n_dof, dtype=bool)
    clamped[free] = False
    constraints = pivoted(constraints, clamped)
    rows, dofs = [], []
    for number, constraint in enumerate(constraints):
        occupied = constraint.dofs[owner[constraint.dofs] >= 0]
        if len(occupied):
            raise Refusal(
                f"{constraint.label} and {constraints[owner[occupied[0]]].label} both move the same nodes; let one "
                "of them take the other face first"
            )
        if clamped[constraint.dofs].any():
            raise Refusal(f"{constraint.label} moves nodes that are clamped; swap its faces, or clamp the other one")
        owner[constraint.dofs] = number
        rows.append(constraint.map)
        dofs.append(constraint.dofs)
    dependent = np.concatenate([*dofs, []]).astype(int)
    identity = eye_array(n_dof, format="csr")
    keep = csr_matrix(identity.multiply((owner < 0)[:, None]))
    place = csr_matrix((np.ones(len(dependent)), (dependent, np.arange(len(dependent)))), shape=(n_dof, len(dependent)))
    step = csr_matrix(keep + place @ csr_matrix(vstack(rows)))
    follow = step
    for _ in range(len(constraints)):
        if not (np.abs(follow[:, dependent]).sum() if len(dependent) else 0):
            break
        follow = csr_matrix(follow @ step)
    else:
        if len(dependent) and np.abs(follow[:, dependent]).sum():
            names = ", ".join(constraint.label for constraint in constraints)
            raise Refusal(f"the nodes moved by {names} follow each other in a circle; swap the faces of one of them")
    independent = np.setdiff1d(free, dependent)
    follow = csr_matrix(follow[:, independent])
    follow.eliminate_zeros()
    return independent, follow


def pivoted(constraints: Sequence[Dependence], clamped: np.ndarray) -> list[Dependence]:
    """The constraints, equations last and each for a DOF that neither is held nor follows already, by elimination."""
    solved_constraints = [constraint for constraint in constraints if not constraint.equation]
    if len(solved_constraints) == len(constraints):
        return solved_constraints
    row_of = {
        int(dof): (constraint.map, k) for constraint in solved_constraints for k, dof in enumerate(constraint.dofs)
    }
    rows = (
        (constraint, int(first), k)
        for constraint in constraints
        if constraint.equation
        for k, first in enumerate(constraint.dofs)
    )
    for constraint, first, k in rows:
        row: dict[int, float] = {}
        waiting = [(first, -1.0), *_entries(constraint.map, k)]
        while waiting:
            dof, factor = waiting.pop()
            if dof in row_of:
                waiting += [(other, factor * value) for other, value in _entries(*row_of[dof])]
            elif not clamped[dof]:
                row[dof] = row.get(dof, 0.0) + factor
        largest = max(map(abs, row.values()), default=0.0)
        row = {dof: value for dof, value in row.items() if abs(value) > 1e-12 * largest}
        if not row:
            continue  # the others say it already
        pivot = first if first in row else max(row, key=lambda dof: abs(row[dof]))
        coefficients = {dof: -value / row[pivot] for dof, value in row.items() if dof != pivot}
        at = ([0] * len(coefficients), list(coefficients))
        shape = (1, constraint.map.shape[1])
        solved = Dependence(
            np.array([pivot]), csr_matrix((list(coefficients.values()), at), shape), constraint.label, True
        )
        row_of[pivot] = (solved.map, 0)
        solved_constraints.append(solved)
    return solved_constraints


def _entries(matrix: csr_matrix, row: int) -> list[tuple[int, float]]:
    """Column and value of the entries of one row."""
    place = slice(*matrix.indptr[row : row + 2].tolist())
    return list(zip(matrix.indices[place].tolist(), matrix.data[place].tolist(), strict=True))


def partition(n_dof: int, chosen: np.ndarray, label: str) -> tuple[np.ndarray, np.ndarray]:
    """Split the DOFs of a system into (remaining, chosen), both sorted: prescribed from free ones, masters from slaves.

    Raises  Refusal, naming the chosen ones by `label`, where one lies outside the system"""
    chosen = np.unique(np.asarray(chosen, dtype=int))
    if len(chosen) and not 0 <= chosen[0] <= chosen[-1] < n_dof:
        raise Refusal(f"a {label} lies outside the {n_dof} DOFs of the system; clamped DOFs are no part of it")
    return np.setdiff1d(np.arange(n_dof), chosen), chosen
