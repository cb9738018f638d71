"""Reduction without contact masters: modes of the stuck structure, Ritz vectors, and what flexibility these leave out.

A Craig-Bampton model keeps every contact DOF, and with thousands of them its constraint modes, its matrices and the
compliance made of these are dense. Here the structure with its contact springs k stuck and closed,

    K_s = K + B^T k B,

is described by few coordinates: its lowest modes, and its static shapes under every load, under every output and under
smooth contact tractions, one for each component on each of some clusters of pairs. By Rayleigh and Ritz these give
squared frequencies Lambda and shapes V of unit modal mass, V^T K_s V = Lambda. What flexibility they leave out,

    R = B K_s^-1 B^T - B V Lambda^-1 V^T B^T,

is static up to (omega / omega_next)^2 of itself and is added as it stands: never as a matrix, each product with it is
one solution by the sparse factor of K_s. So statics under any contact force are exact, and set-up and memory grow as
the factor does. R vanishes at loads and outputs, whose static shapes V holds.

Source  residual flexibility of free-interface modes: MacNeal 1971, doi 10.1016/0045-7949(71)90031-9; Rubin 1975,
    doi 10.2514/3.60497. Clusters of tractions in place of more modes, and contact springs in K_s, are ours."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from tribodyn.fem.factor import Factor, factorise, solve_selected
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.craig_bampton import fixed_interface_modes, with_static_shapes
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import linear_modes, stuck_stiffness
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.refusal import Refusal


@dataclass(frozen=True, eq=False)
class ResidualFlexibility:
    """Static contact flexibility that the coordinates of a reduced model leave out.

    stiffness : (n_contact,) contact springs that are part of K_s [N/m]; free : (n_full, n_full) K without them, sparse
    B : (n_contact, n_full) sparse contact map; shapes : (n_full, n) V; squares : (n,) Lambda [rad2/s2]
    mass : (n_full, n_full); solver : see fem.factor"""

    stiffness: np.ndarray
    free: Any
    B: csr_matrix
    shapes: np.ndarray
    squares: np.ndarray
    mass: Any
    solver: str | None = None

    @property
    def matrix(self) -> Any:
        """(n_full, n_full) K_s, made anew: it is as large as K, and only its factor is needed often."""
        return stuck_stiffness(self.free, self.B, self.stiffness)

    @cached_property
    def factor(self) -> Factor:
        """Of K_s; it does not travel between processes, each makes its own."""
        return factorise(self.matrix, solver=self.solver, selected_rows=np.unique(self.B.indices))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "factor"}

    @cached_property
    def at_contact(self) -> np.ndarray:
        """(n_contact, n) shapes at the contact."""
        return np.asarray(self.B @ self.shapes)

    def field(self, force: np.ndarray) -> np.ndarray:
        """Displacement (n_full, k) [m] under contact forces (n_contact, k) [N] that the coordinates leave out."""
        return self.factor.solve(self.B.T @ force) - self.shapes @ (self.at_contact.T @ force / self.squares[:, None])

    def apply(self, force: np.ndarray) -> np.ndarray:
        """R f: displacement of the contact (n_contact, k) [m] under contact forces (n_contact, k) [N]."""
        total: np.ndarray = self.B @ solve_selected(self.factor, self.B.T @ force)
        return total - self.at_contact @ (self.at_contact.T @ force / self.squares[:, None])

    def recalled(self, force: np.ndarray, cache: Sequence[np.ndarray]) -> np.ndarray:
        """R times the part of forces f (n_contact, k) that it is known of.

        cache : none, or one pair (2, n_contact, j): orthonormal k^-1/2 f of forces that R was asked for, and R f"""
        basis, displacement = cache[0] if cache else np.zeros((2, len(force), 0))
        product: np.ndarray = displacement @ (basis.T @ self.lacking(force))
        return product

    def lacking(self, force: np.ndarray, cache: Sequence[np.ndarray] = ()) -> np.ndarray:
        """k^-1/2 times the other part, all where R was not asked; infinite for a force where there is no spring."""
        root = np.sqrt(self.stiffness)[:, None]
        weighted = np.divide(force, root, out=np.where(force == 0.0, 0.0, np.inf), where=root > 0)
        return weighted - cache[0][0] @ (cache[0][0].T @ weighted) if cache else weighted

    def ask(self, force: np.ndarray, cache: list[np.ndarray], enough: float) -> None:
        """Let R f (n_contact, k) be known but for so much of k^-1/2 f: by the largest directions of what is not."""
        root = np.sqrt(self.stiffness)[:, None]
        lacking = self.lacking(root * self.lacking(force, cache), cache)  # twice, as it may be small beside f
        direction, size, _ = np.linalg.svd(lacking, full_matrices=False)
        direction = direction[:, np.sqrt(np.cumsum(size[::-1] ** 2))[::-1] > enough]
        if direction.size == 0:
            return
        columns_added = np.stack([direction, self.apply(root * direction)])
        columns = np.concatenate([*cache, columns_added], axis=2)
        parts = columns[0].T @ self.lacking(force)
        latest, _ = np.linalg.qr(np.hstack([parts, np.eye(len(parts))]))  # this force, then those before
        cache[:] = [columns @ latest[:, : LIMITS.recalled * force.shape[1]]]

    def at_most(self, weighted: np.ndarray, displacement: np.ndarray) -> float:
        """What |k^1/2 R f| is at most over |k^1/2 x|, Euclidean, for k^-1/2 f and x (n_contact, k), by `left_out`."""
        size = np.linalg.norm(np.sqrt(self.stiffness)[:, None] * displacement) or 1.0
        return self.left_out * float(np.linalg.norm(weighted) / size)

    @cached_property
    def left_out(self) -> float:
        """Largest eigenvalue of k^1/2 R k^1/2: 1 would be a contact that sees nothing else; by a Krylov space."""
        root, cache = np.sqrt(self.stiffness)[:, None], list[np.ndarray]()
        force = root * np.random.default_rng(0).standard_normal((len(root), LIMITS.power_vectors))
        for _ in range(LIMITS.power_steps):
            self.ask(force, cache, LIMITS.new_direction * float(np.linalg.norm(self.lacking(force))))
            basis, displacement = cache[0]
            force = root**2 * displacement[:, : force.shape[1]]
        inside = basis.T @ (root * displacement)
        return float(max(np.linalg.eigvalsh(0.5 * (inside + inside.T))[-1], 0.0))

    def error(self, omega: float) -> float:
        """Error of the contact compliance at a frequency [rad/s], over the static one, by the mass that R leaves out.

        The first term that is neglected, omega^2 B K_s^-1 M u less its part in V, u the field left out, under two
        smooth and two rough contact forces"""
        root = np.sqrt(self.stiffness)[:, None]
        rough = np.random.default_rng(0).standard_normal((len(root), 2))
        smooth = self.apply(root**2 * rough)
        force = np.concatenate([root * rough, root**2 * smooth / max(np.abs(smooth).max(), 1e-300)], axis=1)
        field = self.field(force)
        push = omega**2 * (self.mass @ field)
        retained = self.at_contact @ (self.shapes.T @ push / self.squares[:, None])
        correction = self.B @ self.factor.solve(push) - retained
        compliance = self.B @ field + self.at_contact @ (self.at_contact.T @ force / self.squares[:, None])
        return float(np.max(np.linalg.norm(correction, axis=0) / np.linalg.norm(compliance, axis=0)))


@dataclass(frozen=True)
class FlexibleModel(ReducedModel):
    """A model whose coordinates leave out a part of the contact flexibility, which `residual` adds."""

    residual: ResidualFlexibility = field(kw_only=True)

    leaves_flexibility_out: ClassVar[bool] = True

    def matches(self, other: ReducedModel, harmonics: Sequence[int]) -> bool:
        """Whether another model has equal matrices and the same residual flexibility."""
        is_shared = isinstance(other, FlexibleModel) and self.residual is other.residual
        return is_shared and super().matches(other, harmonics)

    def require_masters(self, needed_by: str) -> None:
        """Raise Refusal: the coordinates leave out a part of the contact flexibility."""
        raise Refusal(
            f"{needed_by} needs a model that keeps every contact DOF, which this one with its "
            f'{len(self.interface.B)} does not: set reduction.method = "craig_bampton", on a smaller contact'
        )


def residual_flexibility(
    system: SecondOrderSystem, interface: ContactInterface, stiffness: np.ndarray, n_modes: int | None = None,
    cutoff: float | None = None, clusters: int = LIMITS.clusters, solver: str | None = None,
) -> FlexibleModel:  # fmt: skip
    """Reduce a full system to modes of its stuck state and Ritz vectors, with the flexibility these leave out.

    system : sparse, n_full DOFs; interface : B over the same DOFs
    stiffness : (n_pair, n_component) contact springs [N/m]; n_modes : of the stuck structure
        kept, or cutoff : all of them up to this frequency [Hz]; give one of the two
    clusters : of pairs, whose tractions give Ritz vectors; solver : see fem.factor
    Returns the model; its coordinates are modal, mass = 1; the first omitted frequency is that of the stuck modes
    Raises  SingularStiffness where the structure can move rigidly with all contacts stuck"""
    k = np.ravel(np.asarray(stiffness, float))
    K = system.stiffness
    K_s = stuck_stiffness(K, interface.B, k)
    M, B = system.mass, csr_matrix(interface.B)
    factor = factorise(K_s, solver=solver, selected_rows=np.unique(csr_matrix(interface.B).indices))
    omega, phi, omitted = fixed_interface_modes(K_s, M, factor, n_modes, cutoff)
    del K_s
    forces = [csc_matrix(v[:, None], dtype=float) for v in (*system.loads.values(), *system.outputs.values())]
    tractions = csc_matrix(B.T @ clustered(interface, k, clusters))
    V, squares = with_static_shapes(omega, phi, [*forces, tractions], factor, M)
    at_contact = np.asarray(B @ V)
    free = np.diag(squares) - at_contact.T @ (k[:, None] * at_contact)
    reduced = SecondOrderSystem(
        np.eye(len(squares)),
        0.5 * (free + free.T),
        None if system.damping is None else V.T @ (system.damping @ V),
        {name: V.T @ load for name, load in system.loads.items()},
        {name: V.T @ row for name, row in system.outputs.items()},
        None if system.gyroscopic is None else V.T @ (system.gyroscopic @ V),
    )
    origin = ReductionBasis(V, np.zeros(0, int), len(squares), factor.name, omitted / (2 * np.pi))
    residual = ResidualFlexibility(k, K, B, V, squares, M, solver)
    residual.__dict__["factor"] = factor
    model = FlexibleModel(reduced, replace(interface, B=at_contact), origin, residual=residual)
    try:
        frequency, _ = linear_modes(model, None, min(LIMITS.reported_modes, len(squares)))
    except StaticDivergence:  # rotation carries away what only the contact holds
        return model
    return replace(model, free_frequency=frequency)


def clustered(interface: ContactInterface, weight: np.ndarray, clusters: int) -> csr_matrix:
    """Unit tractions (n_contact, n) on clusters of near pairs, a column for every component that a cluster has.

    weight : (n_contact,) share of each row in the traction of its cluster, such as the contact springs"""
    n_comp = len(interface.components)
    label = _bisected(interface.points, clusters)
    column = (label[:, None] * n_comp + np.arange(n_comp)).ravel()
    n = (label.max(initial=0) + 1) * n_comp
    shape = csr_matrix((weight, (np.arange(len(weight)), column)), shape=(len(weight), n))
    return csr_matrix(shape[:, np.flatnonzero(np.bincount(column, weight, n))])


def _bisected(points: np.ndarray, clusters: int) -> np.ndarray:
    """(n,) cluster of each point: the largest cluster is halved across its longest side until there are enough."""
    label = np.zeros(len(points), int)
    parts = [np.arange(len(points))]
    while len(parts) < min(clusters, len(points)):
        widest = int(np.argmax([np.ptp(points[p], axis=0).max() if len(p) > 1 else -1.0 for p in parts]))
        members = parts.pop(widest)
        axis = int(np.ptp(points[members], axis=0).argmax())
        order = members[np.argsort(points[members, axis], kind="stable")]
        parts += [order[: len(order) // 2], order[len(order) // 2 :]]
    for i, members in enumerate(parts):
        label[members] = i
    return label
