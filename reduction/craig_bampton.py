"""Craig-Bampton reduction: contact and accessory DOFs stay, the rest becomes fixed-interface modes.

Source  Craig and Bampton, AIAA Journal 6(7), 1968; Tamatam 2021, appendix A, whose equation numbers stand as comments
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from threadpoolctl import threadpool_limits

from tribodyn.fem.constraints import partition
from tribodyn.fem.factor import Factor, eigenvalues_below, factorise
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.modes import StaticDivergence, modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.refusal import Refusal


def craig_bampton(
    system: SecondOrderSystem,
    interface: ContactInterface,
    n_modes: int | None = None,
    cutoff: float | None = None,
    extra_masters: Sequence[int] | np.ndarray = (),
    solver: str | None = None,
    attached: Sequence[str] = (),
) -> ReducedModel:
    """Reduce a full system to its contact DOFs, accessory DOFs and fixed-interface modes.

    system : sparse, n_full DOFs; interface : B over the same DOFs
    n_modes : fixed-interface modes kept, or cutoff : all of them up to this frequency [Hz]; give one of the two
    extra_masters : DOFs of the system to keep besides those of the contact and of point loads and outputs
    solver : see fem.factor
    attached : loads whose static response with the masters held joins the modes, so that statics under them are exact
    Returns the model; coordinates are the masters in ascending order, then the modes; loads and outputs are projected.
        its origin is a `ReductionBasis`
    Raises  Refusal where n_modes and cutoff are both or neither given, too many modes are asked, or a body can move
        rigidly with its masters held
    """
    K, M = csr_matrix(system.stiffness), csr_matrix(system.mass)
    s, m = partition(system.n_dof, master_dofs(system, interface, extra_masters), "master")
    if not len(s):
        raise Refusal("Craig-Bampton: every DOF is a master, nothing is left to reduce: use the matrices")
    K_ss, M_ss = K[s][:, s], M[s][:, s]
    factor = factorise(K_ss, solver=solver)
    omega, phi, omitted = fixed_interface_modes(K_ss, M_ss, factor, n_modes, cutoff)
    omega, phi = with_static_shapes([system.loads[name][s] for name in attached], K_ss, M_ss, factor, omega, phi)

    n_m = len(m)
    basis = np.zeros((system.n_dof, n_m + len(omega)))
    basis[m, np.arange(n_m)] = 1.0  # A.5
    basis[s, n_m:] = phi
    stiffness = np.diag(np.concatenate([np.zeros(n_m), omega**2]))
    K_sm, K_ms, K_mm = csc_matrix(K[s][:, m]), K[m][:, s], K[m][:, m]
    for block in _blocks(n_m):
        psi = constraint_modes(factor, K_sm[:, block])
        basis[s, block] = psi
        stiffness[:n_m, block] = K_mm[:, block] + K_ms @ psi  # A.7
    stiffness = _symmetric(stiffness)
    mass = _congruent(basis, M)  # A.6
    mass[n_m:, n_m:] = np.eye(len(omega))
    turning = None
    if system.gyroscopic is not None:
        turning = _congruent(basis, system.gyroscopic, -1.0)

    reduced = SecondOrderSystem(
        mass,
        stiffness,
        None if system.damping is None else _congruent(basis, system.damping),
        {name: basis.T @ load for name, load in system.loads.items()},  # A.8
        {name: basis.T @ row for name, row in system.outputs.items()},
        turning,
    )
    origin = ReductionBasis(basis, m, len(omega), factor.name, omitted / (2 * np.pi))
    model = ReducedModel(reduced, replace(interface, B=np.asarray(interface.B @ basis)), origin)
    try:
        frequency, _ = linear_modes(model, None, min(LIMITS.reported_modes, reduced.n_dof))
    except StaticDivergence:  # rotation carries away what only the contact holds
        if not interface.n_pair:
            raise
        return model
    return replace(model, free_frequency=frequency)


def master_dofs(
    system: SecondOrderSystem, interface: ContactInterface, extra: Sequence[int] | np.ndarray = ()
) -> np.ndarray:
    """DOFs that stay, in any order: those the contact map touches, those of point loads and outputs, and the extra."""
    touched = [np.flatnonzero(v) for v in (*system.loads.values(), *system.outputs.values())]
    points = [dofs for dofs in touched if len(dofs) <= LIMITS.point_load]
    return np.concatenate([csc_matrix(interface.B).nonzero()[1], np.asarray(extra, dtype=int).ravel(), *points])


def constraint_modes(factor: Factor, K_sm: csc_matrix) -> np.ndarray:
    """Static shapes Psi = -K_ss^-1 K_sm (n_slave, n_master) of unit displacements of some masters."""
    with threadpool_limits(1):
        return -factor.solve(K_sm.toarray())


def fixed_interface_modes(
    K_ss: Any, M_ss: Any, factor: Factor, n_modes: int | None, cutoff: float | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Modes with the masters held: omega (k,) [rad/s], phi (n_slave, k), and the first omega left out (inf for none).

    Raises  Refusal where not exactly one of n_modes, cutoff is given, more modes are asked than there are, or the
        cutoff is beyond what the mesh resolves, more modes than half of the slaves, or has too many modes. How
        many there will be is foretold as for a bar in bending, whose number of modes rises as the root of frequency;
        elsewhere it rises faster, and they are counted where there would be too many if it rose as that of a plate, as
        frequency
    """
    n_slave = K_ss.shape[0]
    if (n_modes is None) == (cutoff is None):
        raise Refusal("Craig-Bampton: give the number of modes or the cutoff frequency, one of the two")
    if n_modes is not None and not 0 <= n_modes <= n_slave:
        raise Refusal(f"Craig-Bampton: {n_modes} modes were asked of {n_slave} DOFs that are not masters")
    n_computed, n_below = 16 if n_modes is None else n_modes, None
    while True:
        omega, phi = modes(K_ss, M_ss, min(n_computed + 1, n_slave), factor=factor)
        if cutoff is None or omega[-1] > 2 * np.pi * cutoff or len(omega) == n_slave:
            break
        expected = len(omega) * np.sqrt(2 * np.pi * cutoff / max(omega[-1], 1e-300))
        if 2 * expected > n_slave:
            raise Refusal(
                f"the cutoff of the reduction, {cutoff:g} Hz, is beyond what the mesh resolves: mode {len(omega)} of "
                f"{n_slave} has {omega[-1] / (2 * np.pi):.3g} Hz; lower reduction.cutoff, or look at the material"
            )
        n_max = min(n_slave / 2, LIMITS.most_modes)
        if n_below is None and len(omega) * 2 * np.pi * cutoff > n_max * omega[-1]:
            n_below = eigenvalues_below(K_ss, M_ss, (2 * np.pi * cutoff) ** 2)  # as for a plate there are too many
            if n_below > n_max:
                reason = (
                    "beyond what the mesh resolves" if 2 * n_below > n_slave else f"above {LIMITS.most_modes} modes"
                )
                raise Refusal(
                    f"the cutoff of the reduction, {cutoff:g} Hz, is {reason}: {n_below} of its "
                    f"{n_slave} modes lie below it; lower reduction.cutoff, or look at the material"
                )
        n_computed *= 2
    n_retained = n_computed if cutoff is None else int(np.sum(omega <= 2 * np.pi * cutoff))
    return omega[:n_retained], phi[:, :n_retained], float(omega[n_retained]) if n_retained < len(omega) else np.inf


def with_static_shapes(
    forces: Sequence[np.ndarray], K_ss: Any, M_ss: Any, factor: Factor, omega: np.ndarray, phi: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Modes joined by the static shapes of forces (n_slave,) on the slaves, by the method of Rayleigh and Ritz.

    K_ss, M_ss : (n_slave, n_slave) [N/m], [kg]; factor : of K_ss; omega (k,) [rad/s], phi (n_slave, k) : the modes
    Returns omega (k + j,) [rad/s], ascending, and phi (n_slave, k + j) of unit modal mass, orthogonal in mass and
        stiffness; j <= number of forces, as a shape that the modes hold already adds nothing
    """
    for force in forces:
        if not force.any():
            continue
        shape = factor.solve(force)
        size = np.sqrt(shape @ (M_ss @ shape))
        for _ in range(2):
            shape = shape - phi @ (phi.T @ (M_ss @ shape))
        norm = np.sqrt(shape @ (M_ss @ shape))
        if norm <= 1e-9 * size:  # the modes hold it already
            continue
        phi = np.column_stack([phi, shape / norm])
        coupling = phi.T @ (K_ss @ phi)
        squares, turn = np.linalg.eigh((coupling + coupling.T) / 2)
        omega, phi = np.sqrt(squares), phi @ turn
    return omega, phi


def _congruent(basis: np.ndarray, matrix: Any, sign: float = 1.0) -> np.ndarray:
    """basis^T A basis (k, k) of a sparse A (n, n) with A^T = sign A, block by block: no second array as large as the
    basis.
    """
    product = np.empty((basis.shape[1],) * 2)
    for block in _blocks(basis.shape[1]):
        product[: block.stop, block] = basis[:, : block.stop].T @ (matrix @ basis[:, block])
        product[block, : block.start] = sign * product[: block.start, block].T
    return (product + sign * product.T) / 2


def _blocks(n: int) -> list[slice]:
    return [slice(start, min(start + LIMITS.solved_at_once, n)) for start in range(0, n, LIMITS.solved_at_once)]


def _symmetric(matrix: Any) -> np.ndarray:
    matrix = np.asarray(matrix)
    return (matrix + matrix.T) / 2
