"""What is held in a reduced model: static displacement given, static force unknown, as of a platform at a height.

In harmonic 0 the chosen coordinates X_k have a known value and the force that keeps them there is unknown; in the other
harmonics they move like any others. Tamatam 2021 rearranges the unknowns for it (eq. 5.2-5.9). Here harmonic 0 sees a
system in which X_k is cut off, and the height is a static load on the rest,

    K_uu X_u = F_u - B^T f - K_uk X_k,      F_k = K_kk X_k + K_ku X_u,

so that every system stays symmetric and a height is an amplitude like a force is; F_k follows from the contact force.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
import scipy.linalg as sla
from scipy.linalg import null_space

from tribodyn.fem.constraints import partition
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel, ReductionBasis, SystemChange
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class StaticReaction:
    """The static force that keeps prescribed coordinates where they are.

    name : of the load whose static amplitude is the height
    dofs : (k,) coordinates of the reduced model, each displaced by the height
    psi : (n, k) static shapes of unit displacements of each; stiffness : (k, k) psi^T K psi [N/m]
    support : (k,) springs in the model that act about the prescribed position [N/m]"""

    name: str
    dofs: np.ndarray
    psi: np.ndarray
    stiffness: np.ndarray
    support: np.ndarray
    model: ReducedModel

    def force(self, height: float, contact_force: np.ndarray, loads: Mapping[str, float] | None = None) -> np.ndarray:
        """Force on each prescribed coordinate (k,) [N], along its displacement.

        height : [m]; contact_force : (n_pair, n_component) static part of the contact force [N]
        loads : other static loads by name [N]
        Source  Tamatam 2021, eq. 5.4a after eq. 5.4b is solved for X_u"""
        load = -np.asarray(self.model.interface.B).T @ np.ravel(contact_force)
        for name, value in (loads or {}).items():
            load = load + value * self.model.system.loads[name]
        return (self.stiffness.sum(axis=1) - self.support) * height - self.psi.T @ load


@dataclass(frozen=True)
class PrescribedModel(ReducedModel):
    """A model with a prescribed static displacement.

    static : the system of harmonic 0; reaction : gives the force that holds the displacement"""

    static: SecondOrderSystem = field(kw_only=True)
    reaction: StaticReaction = field(kw_only=True)

    has_one_system: ClassVar[bool] = False

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        return (self.static if h == 0 else self.system), np.asarray(self.interface.B)

    def with_systems(self, change: SystemChange) -> Self:
        B = np.asarray(self.interface.B)
        return replace(self, system=change(self.system, B), static=change(self.static, B))


def prescribe(model: ReducedModel, dofs: np.ndarray, name: str, support: np.ndarray | float = 0.0) -> PrescribedModel:
    """Prescribe the static displacement of some coordinates of a reduced model; the rest of their motion stays free.

    dofs : (k,) physical coordinates, outside the contact
    name : of the new load, whose static amplitude is the height [m]
    support : springs that hold each about the prescribed position, which are in the stiffness for the sake of the other
        harmonics and carry no force at that position [N/m]
    Returns the model, whose harmonic 0 sees another system
    Raises  Refusal where a coordinate belongs to the contact, where the name is taken, or where the part can still
        move rigidly"""
    system, B = model.system, np.asarray(model.interface.B)
    free, fixed = partition(system.n_dof, dofs, "prescribed displacement")
    if len(fixed) == 0:
        raise Refusal(f"prescribed displacement '{name}' chooses no coordinate; name a node set that is not clamped")
    if name in system.loads:
        raise Refusal(f"prescribed displacement '{name}' has the name of a load; give it another")
    if np.any(B[:, fixed]):
        raise Refusal(f"prescribed displacement '{name}' acts on contact nodes; choose nodes outside the contact")
    springs = np.empty(len(fixed))
    springs[np.searchsorted(fixed, np.asarray(dofs, dtype=int))] = support

    K = np.asarray(system.stiffness)
    try:
        factor = sla.cho_factor(K[np.ix_(free, free)])
    except np.linalg.LinAlgError:
        raise Refusal(
            f"with '{name}' held and the contact open the part can still move rigidly; clamp it or add a spring"
        ) from None
    psi = np.zeros((system.n_dof, len(fixed)))
    psi[fixed, np.arange(len(fixed))] = 1.0
    psi[free] = -sla.cho_solve(factor, K[np.ix_(free, fixed)])

    loads = {**system.loads, name: np.zeros(system.n_dof)}
    dynamic = replace(system, loads=loads)
    static = _cut(system, free, fixed, name)
    reaction = StaticReaction(name, fixed, psi, psi.T @ K @ psi, springs, model)
    return PrescribedModel(
        dynamic, model.interface, model.origin, model.joints, model.free_frequency, static=static, reaction=reaction
    )


def _cut(system: SecondOrderSystem, free: np.ndarray, fixed: np.ndarray, name: str) -> SecondOrderSystem:
    """The system with the held coordinates cut off; the load `name` moves each of them by its amplitude."""
    K, M = np.array(system.stiffness), np.array(system.mass)
    push = np.zeros(system.n_dof)
    push[free] = -K[np.ix_(free, fixed)].sum(axis=1)
    push[fixed] = np.diag(K)[fixed]
    damping = None if system.damping is None else np.array(system.damping)
    for matrix in (K, M, damping):
        if matrix is not None:
            matrix[np.ix_(free, fixed)] = 0.0
            matrix[np.ix_(fixed, free)] = 0.0
            matrix[np.ix_(fixed, fixed)] = np.diag(np.diag(matrix)[fixed])
    loads = {
        other: np.where(np.isin(np.arange(system.n_dof), fixed), 0.0, load) for other, load in system.loads.items()
    }
    return SecondOrderSystem(M, K, damping, {**loads, name: push}, system.outputs)


def hold(model: ReducedModel, rows: np.ndarray) -> ReducedModel:
    """The model without the motions that break rows @ q_full = 0.

    rows : (k, n_full), such as `Part.held_rows`; none leaves the model as it is
    Returns the model in coordinates p, q = N p with N an orthonormal basis of what is allowed; they are no longer the
        displacements of single DOFs, but the contact map, loads, outputs and the way back know that
    Raises  Refusal for a model without a full field, or one whose harmonics see different systems"""
    if len(rows) == 0:
        return model
    if not isinstance(model.origin, ReductionBasis) or not model.has_one_system:
        raise Refusal("motions can be held only in a model that was reduced from one mesh for all harmonics")
    constraint = rows @ model.origin.basis
    N = null_space(constraint / np.linalg.norm(constraint, axis=1, keepdims=True))
    held_model = model.projected(N)
    frequency, _ = linear_modes(held_model, n=min(LIMITS.reported_modes, N.shape[1]))
    return replace(held_model, free_frequency=frequency)
