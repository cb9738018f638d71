"""What is held in a reduced model: static displacement given, static force unknown, as of a platform at a height.

In harmonic 0 the chosen coordinates X_k have a known value and the force that keeps them there is unknown; in the other
harmonics they move like any others. Tamatam 2021 rearranges the unknowns for it (eq. 5.2-5.9). Here harmonic 0 sees a
system in which X_k is cut off, and the height is a static load on the rest,

    K_uu X_u = F_u - B^T f - K_uk X_k,      F_k = K_kk X_k + K_ku X_u,

so that every system stays symmetric and a height is an amplitude like a force is; F_k follows from the contact force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sla
from scipy.linalg import null_space

from tribodyn.fem.constraints import partition
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel, StaticReaction
from tribodyn.refusal import Refusal


def prescribe(model: ReducedModel, dofs: np.ndarray, name: str, support: np.ndarray | float = 0.0) -> ReducedModel:
    """Prescribe the static displacement of some coordinates of a reduced model; the rest of their motion stays free.

    dofs : (k,) physical coordinates, outside the contact
    name : of the new load, whose static amplitude is the height [m]
    support : springs that hold each about the prescribed position, which are in the stiffness for the sake of the other
        harmonics and carry no force at that position [N/m]
    Returns the model, whose harmonic 0 sees another system, and whose `info.reaction` gives the force
    Raises  ValueError where a coordinate belongs to the contact, where the name is taken, or where the part can still
        move rigidly
    """
    system, B = model.system, np.asarray(model.interface.B)
    free, held = partition(system.n_dof, dofs, "prescribed displacement")
    if len(held) == 0:
        raise Refusal(f"prescribed displacement '{name}' chooses no coordinate; name a node set that is not clamped")
    if name in system.loads:
        raise Refusal(f"prescribed displacement '{name}' has the name of a load; give it another")
    if np.any(B[:, held]):
        raise Refusal(f"prescribed displacement '{name}' acts on contact nodes; choose nodes outside the contact")
    springs = np.empty(len(held))
    springs[np.searchsorted(held, np.asarray(dofs, dtype=int))] = support

    K = np.asarray(system.stiffness)
    try:
        factor = sla.cho_factor(K[np.ix_(free, free)])
    except np.linalg.LinAlgError:
        raise Refusal(
            f"with '{name}' held and the contact open the part can still move rigidly; clamp it or add a spring"
        ) from None
    psi = np.zeros((system.n_dof, len(held)))
    psi[held, np.arange(len(held))] = 1.0
    psi[free] = -sla.cho_solve(factor, K[np.ix_(free, held)])

    loads = {**system.loads, name: np.zeros(system.n_dof)}
    dynamic = replace(system, loads=loads)
    static = _cut(system, free, held, name)
    reaction = StaticReaction(name, held, psi, psi.T @ K @ psi, springs, model)

    def per_harmonic(h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        return (static if h == 0 else dynamic), B

    info = replace(model.info, reaction=reaction)
    return replace(model, system=dynamic, per_harmonic=per_harmonic, info=info)


def _cut(system: SecondOrderSystem, free: np.ndarray, held: np.ndarray, name: str) -> SecondOrderSystem:
    """The system with the held coordinates cut off; the load `name` moves each of them by its amplitude."""
    K, M = np.array(system.stiffness), np.array(system.mass)
    push = np.zeros(system.n_dof)
    push[free] = -K[np.ix_(free, held)].sum(axis=1)
    push[held] = np.diag(K)[held]
    damping = None if system.damping is None else np.array(system.damping)
    for matrix in (K, M, damping):
        if matrix is not None:
            matrix[np.ix_(free, held)] = 0.0
            matrix[np.ix_(held, free)] = 0.0
            matrix[np.ix_(held, held)] = np.diag(np.diag(matrix)[held])
    loads = {other: np.where(np.isin(np.arange(system.n_dof), held), 0.0, load) for other, load in system.loads.items()}
    return SecondOrderSystem(M, K, damping, {**loads, name: push}, system.outputs)


def hold(model: ReducedModel, rows: np.ndarray) -> ReducedModel:
    """The model without the motions that break rows @ q_full = 0.

    rows : (k, n_full), such as Part.held; none leaves the model as it is
    Returns the model in coordinates p, q = N p with N an orthonormal basis of what is allowed; they are no longer the
        displacements of single DOFs, but the contact map, loads, outputs and the way back know that
    Raises  ValueError for a model without a full field, or one whose harmonics see different systems
    """
    if len(rows) == 0:
        return model
    if model.basis is None or model.per_harmonic is not None:
        raise Refusal("motions can be held only in a model that was reduced from one mesh for all harmonics")
    held = rows @ model.basis
    N = null_space(held / np.linalg.norm(held, axis=1, keepdims=True))
    held_model = model.projected(N)
    frequency, _ = linear_modes(held_model, n=min(LIMITS.reported_modes, N.shape[1]))
    return replace(held_model, info=replace(held_model.info, free_frequency=frequency))
