"""Constraints: faces glued together though their meshes differ, points that carry faces, and points linked together.

Source  ties: Wohlmuth, A mortar finite element method using dual spaces for the Lagrange multiplier, SIAM Journal on
    Numerical Analysis 38, 2000; distributed coupling: the mean motion of a face in the sense of least squares,
    weighted by area"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import coo_matrix, csr_matrix, diags_array, eye_array, kron

from tribodyn.fem.constraints import Dependence, find_group
from tribodyn.fem.elements import coordinates
from tribodyn.fem.mortar import MORTAR, SharedSurface, Side, coefficients, dual, shared_surface, side
from tribodyn.fem.mortar_contact import describe_separation
from tribodyn.fem.springs import shares
from tribodyn.fem.surface import tabulate
from tribodyn.refusal import Refusal

SMALL = 1e-13  # of a coefficient that is left out


@dataclass(frozen=True)
class Tie:
    """Glue a face to another one: the jump vanishes in the mean against every dual function of the first face.

    The functions are dual to those of its coefficients, so that each of these follows the other face near it alone

    label : for errors; first, second : boundary names; reach : farthest opening [m], which is then bridged; where
        it is None a tenth of the length of the first face, and faces that are apart are refused"""

    label: str
    first: str
    second: str
    reach: float | None = None

    def meeting(self, mesh: Any) -> tuple[Side, Side, SharedSurface]:
        """Both faces and the surface that they share; raises Refusal as `build` does."""
        faces = mesh.boundaries or {}
        side_1, side_2 = (side(mesh, find_group(faces, name, "face")) for name in (self.first, self.second))
        reach = MORTAR.reach * side_1.length if self.reach is None else self.reach
        shared = shared_surface(side_1, side_2, reach)
        if not len(shared.weight):
            raise Refusal(f"{self.label}: {describe_separation(side_1, side_2, reach)}")
        return side_1, side_2, shared

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """The nodes of the first face in terms of the others.

        Raises  Refusal where a face is unknown, or the faces do not meet"""
        side_1, side_2, shared = self.meeting(mesh)
        gap = float(np.average(np.abs(shared.gap), weights=np.abs(shared.weight)))
        if self.reach is None and gap > MORTAR.separated * side_1.length:
            who = f"{self.first} and {self.second} are {1e3 * gap:.3g} mm apart on average"
            raise Refusal(f'{self.label}: {who}: bring them together, or give reach = "{2e3 * gap:.2g} mm"')
        n, k = mesh.doflocs.shape[1], side_1.nodes.shape[1]
        psi, d = dual(side_1, shared)
        shapes = tabulate(side_2.nodes.shape[1], shared.eta)[0]
        cuts = shared.cuts[:-1]
        M = _summed(
            np.array([psi[:, g] @ shapes[:, g].T for *_, g in shared.each()]),
            side_1.nodes[shared.first[cuts]],
            side_2.nodes[shared.second[cuts]],
            n,
        )
        edge = side_1.points[:, 1:3] - side_1.points[:, :1]
        area = np.linalg.norm(np.cross(edge[:, 0], edge[:, 1]), axis=1)
        weigh, full_weight, count = np.zeros((3, n))
        for into, value in ((weigh, d), (full_weight, area[:, None] / k), (count, 1.0)):
            np.add.at(into, side_1.nodes, value)
        nodes = np.flatnonzero(count)
        is_tied = weigh > MORTAR.tied * full_weight
        tied, untied = nodes[is_tied[nodes]], nodes[~is_tied[nodes]]
        # of second order, coefficients F u are tied: F u_tied + F u_rest = M u_2 / d, F = diagonal (1 - N), N^3 = 0
        F = _summed(np.tile(coefficients(k), (len(side_1.nodes), 1, 1)), side_1.nodes, side_1.nodes, n)
        F = csr_matrix(diags_array(1 / count[tied]) @ F[tied])
        free = csr_matrix((np.ones(len(untied)), (untied, untied)), shape=(n, n))
        right = diags_array(1 / weigh[tied]) @ M[tied] - F @ free
        inverse = diags_array(1 / F[:, tied].diagonal())
        N = csr_matrix(eye_array(len(tied)) - inverse @ F[:, tied])
        dependence = inverse @ right
        dependence = csr_matrix(dependence + N @ (dependence + N @ dependence))
        dependence.data[np.abs(dependence.data) < SMALL] = 0.0
        dependence.eliminate_zeros()
        dofs = (tied[:, None] * 3 + np.arange(3)).ravel()
        return Dependence(dofs, csr_matrix(kron(dependence, np.eye(3), format="csr")), self.label)


@dataclass(frozen=True)
class Equation:
    """A linear equation between displacements of single nodes, sum of factor * u = 0; the first one that can follows.

    label : for errors; terms : (group of one node, axis 0..2, factor)"""

    label: str
    terms: Sequence[tuple[str, int, float]]

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """The first displacement in terms of the others; raises Refusal where its factor is zero."""
        if len({term[:2] for term in self.terms}) < max(len(self.terms), 2) or not self.terms[0][2]:
            raise Refusal(f"{self.label} needs two terms or more of different displacements, the first not times zero")
        dofs = [3 * int(find_group(node_sets, group)[0]) + axis for group, axis, _ in self.terms]
        factors = [-factor / self.terms[0][2] for _, _, factor in self.terms[1:]]
        row = coo_matrix((factors, ([0] * len(factors), dofs[1:])), shape=(1, 3 * mesh.doflocs.shape[1]))
        return Dependence(np.array(dofs[:1]), csr_matrix(row), self.label, equation=True)


def _summed(blocks: np.ndarray, rows: np.ndarray, columns: np.ndarray, n: int) -> csr_matrix:
    """Matrix (n, n) of blocks (m, k, l) at rows (m, k) and columns (m, l)."""
    at = (np.broadcast_to(places, blocks.shape).ravel() for places in (rows[:, :, None], columns[:, None]))
    return csr_matrix(coo_matrix((blocks.ravel(), tuple(at)), shape=(n, n)))


@dataclass(frozen=True)
class RigidCoupling:
    """A face that moves as a rigid body with a reference point of the assembly. point, face : names."""

    point: str
    face: str

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """The nodes of the face in terms of the point; raises Refusal where the face is unknown."""
        nodes = find_group(node_sets, self.face)
        place, turn = mesh.points[self.point]
        arm = coordinates(mesh)[nodes] - coordinates(mesh)[place]
        rows = 3 * len(nodes)
        columns = np.concatenate([3 * place + np.arange(3), 3 * turn + np.arange(3)])
        values = np.zeros((rows, 6))
        values[:, :3] = np.tile(np.eye(3), (len(nodes), 1))
        values[:, 3:] = _turning(arm).reshape(rows, 3)
        matrix = csr_matrix((values.ravel(), (np.repeat(np.arange(rows), 6), np.tile(columns, rows))),
                            shape=(rows, 3 * mesh.doflocs.shape[1]))  # fmt: skip
        matrix.eliminate_zeros()
        return Dependence((nodes[:, None] * 3 + np.arange(3)).ravel(), matrix, f"couplings.{self.point}")


@dataclass(frozen=True)
class DistributedCoupling:
    """A reference point of the assembly that moves as the mean of a face does. point, face : names."""

    point: str
    face: str

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """The point in terms of the nodes of the face.

        Raises  Refusal where the face is unknown, or its nodes lie on one line, so that it has no turn"""
        nodes, share = shares(mesh, node_sets, self.face)
        place, turn = mesh.points[self.point]
        points = coordinates(mesh)
        centre = share @ points[nodes]
        arm = points[nodes] - centre
        cross = _turning(arm)  # u = theta x arm
        inertia = np.einsum("k,kij,kil->jl", share, cross, cross)
        if not np.linalg.eigvalsh(inertia)[0] > 1e-9 * np.trace(inertia):
            raise Refusal(f"couplings.{self.point}: the nodes of '{self.face}' lie on one line; give a face")
        theta = np.linalg.solve(inertia, np.einsum("k,kij->jki", share, cross).reshape(3, -1))  # 3, k * 3
        mean = np.kron(share, np.eye(3))
        at = mean + _turning((points[place] - centre)[None])[0] @ theta
        columns = (nodes[:, None] * 3 + np.arange(3)).ravel()
        values = np.vstack([at, theta])
        matrix = csr_matrix((values.ravel(), (np.repeat(np.arange(6), len(columns)), np.tile(columns, 6))),
                            shape=(6, 3 * len(points)))  # fmt: skip
        dofs = np.concatenate([3 * place + np.arange(3), 3 * turn + np.arange(3)])
        return Dependence(dofs, matrix, f"couplings.{self.point}")


@dataclass(frozen=True)
class Link:
    """Two points of couplings that move alike but for some of their motions.

    label : for errors; first, second : the couplings; free : motions out of 0..2 along and 3..5 about x, y, z in
        which they stay free of each other"""

    label: str
    first: RigidCoupling | DistributedCoupling
    second: RigidCoupling | DistributedCoupling
    free: Sequence[int] = ()

    def build(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Dependence:
        """As many displacements of the first point, or of the face that it follows, in terms of the others."""
        linked = np.setdiff1d(np.arange(6), np.asarray(self.free, int))
        motion_1, motion_2 = (self._motion(c, mesh, node_sets)[linked] for c in (self.first, self.second))
        rows = csr_matrix(motion_1 - motion_2)
        columns = np.unique(motion_1.nonzero()[1])
        pivots = columns[np.sort(qr(motion_1[:, columns].toarray(), mode="r", pivoting=True)[1][: len(linked)])]
        coefficients = np.linalg.solve(rows[:, pivots].toarray(), -rows.toarray())
        coefficients[:, pivots] = 0.0
        coefficients[np.abs(coefficients) < SMALL] = 0.0
        return Dependence(pivots, csr_matrix(coefficients), self.label)

    @staticmethod
    def _motion(
        coupling: RigidCoupling | DistributedCoupling, mesh: Any, node_sets: Mapping[str, np.ndarray]
    ) -> csr_matrix:
        """(6, n_dof) the motion of a point: its own DOFs, or those of the face that it follows."""
        place, turn = mesh.points[coupling.point]
        dofs = np.concatenate([3 * place + np.arange(3), 3 * turn + np.arange(3)])
        if isinstance(coupling, DistributedCoupling):
            return csr_matrix(coupling.build(mesh, node_sets).map)
        return csr_matrix(eye_array(3 * mesh.doflocs.shape[1], format="csr")[dofs])


def _turning(arm: np.ndarray) -> np.ndarray:
    """(k, 3, 3) matrices A with theta x arm = A theta."""
    x, y, z = arm.T
    zero = np.zeros(len(arm))
    return np.stack([zero, z, -y, -z, zero, x, y, -x, zero], axis=1).reshape(-1, 3, 3)
