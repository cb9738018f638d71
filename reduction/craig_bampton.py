"""Craig-Bampton reduction: contact and accessory DOFs stay, the rest becomes fixed-interface modes.

Source  Craig and Bampton, AIAA Journal 6(7), 1968; Tamatam 2021, appendix A, whose equation numbers stand as comments
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg as sla
from scipy.sparse import csc_matrix, csr_matrix, hstack
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
    system: SecondOrderSystem, interface: ContactInterface, n_modes: int | None = None, cutoff: float | None = None,
    extra_masters: Sequence[int] | np.ndarray = (), solver: str | None = None, held_rows: np.ndarray | None = None,
) -> ReducedModel:  # fmt: skip
    """Reduce a full system to its contact DOFs, accessory DOFs, fixed-interface modes and static shapes.

    system : sparse, n_full DOFs; interface : B over the same DOFs
    n_modes : fixed-interface modes kept, or cutoff : all of them up to this frequency [Hz]; give one of the two
    extra_masters : DOFs of the system to keep besides those of the contact and of point loads and outputs
    solver : see fem.factor
    held_rows : (k, n_full) motions that are to be held afterwards, see `reduction.prescribed.hold`
    The static response, masters held, to every load, to a unit force at every output and to the force of every held
    row, and to the inertia of these responses, joins the modes, as far as these lack it: displacements of outputs are
    exact at rest, whatever the contact does, and right to second order in the square of the frequency beside it
    Returns the model; coordinates are the masters in ascending order, then the modes, then the static shapes; loads and
        outputs are projected.
        its origin is a `ReductionBasis`
    Raises  Refusal where n_modes and cutoff are both or neither given, too many modes are asked, or a body can move
        rigidly with its masters held"""
    K, M = csr_matrix(system.stiffness), csr_matrix(system.mass)
    s, m = partition(system.n_dof, master_dofs(system, interface, extra_masters), "master")
    if not len(s):
        raise Refusal("Craig-Bampton: every DOF is a master, nothing is left to reduce: use the matrices")
    K_ss, M_ss = K[s][:, s], M[s][:, s]
    factor = factorise(K_ss, solver=solver)
    omega, phi, omitted = fixed_interface_modes(K_ss, M_ss, factor, n_modes, cutoff)
    n_modes = len(omega)
    rows = () if held_rows is None else held_rows
    forces = [v[s] for v in (*system.loads.values(), *system.outputs.values(), *rows) if v[s].any()]
    static = [factor.solve(force) for force in forces]
    inertia = [M_ss @ (shape - phi @ (phi.T @ (M_ss @ shape))) for shape in static]
    columns = [csc_matrix(force[:, None]) for force in (*forces, *inertia)]
    phi, squares = with_static_shapes(omega, phi, columns, factor, M_ss)

    n_m = len(m)
    basis = np.zeros((system.n_dof, n_m + len(squares)))
    basis[m, np.arange(n_m)] = 1.0  # A.5
    basis[s, n_m:] = phi
    stiffness = np.diag(np.concatenate([np.zeros(n_m), squares]))
    K_sm, K_ms, K_mm = csc_matrix(K[s][:, m]), K[m][:, s], K[m][:, m]
    for block in _blocks(n_m):
        with threadpool_limits(1):
            psi = -factor.solve(K_sm[:, block].toarray())
        basis[s, block] = psi
        stiffness[:n_m, block] = K_mm[:, block] + K_ms @ psi  # A.7
    stiffness = _symmetric(stiffness)
    mass = _congruent(basis, M)  # A.6
    mass[n_m:, n_m:] = np.eye(len(squares))
    turning = None if system.gyroscopic is None else _congruent(basis, system.gyroscopic, -1.0)

    reduced = SecondOrderSystem(
        mass,
        stiffness,
        None if system.damping is None else _congruent(basis, system.damping),
        {name: basis.T @ load for name, load in system.loads.items()},  # A.8
        {name: basis.T @ row for name, row in system.outputs.items()},
        turning,
    )
    origin = ReductionBasis(basis, m, n_modes, factor.name, omitted / (2 * np.pi))
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


def fixed_interface_modes(
    K_ss: Any, M_ss: Any, factor: Factor, n_modes: int | None, cutoff: float | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Modes with the masters held: omega (k,) [rad/s], phi (n_slave, k), and the first omega left out (inf for none).

    Raises  Refusal where not exactly one of n_modes, cutoff is given, more modes are asked than there are, or the
        cutoff is beyond what the mesh resolves, more modes than half of the slaves, or has too many modes. How
        many there will be is foretold as for a bar in bending, whose number of modes rises as the root of frequency;
        elsewhere it rises faster, and they are counted where there would be too many if it rose as that of a plate, as
        frequency"""
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
    omega: np.ndarray, phi: np.ndarray, forces: Sequence[csc_matrix], factor: Factor, M: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Modes joined by the static shapes of forces, as far as they lack these, by the method of Rayleigh and Ritz.

    omega (k,) [rad/s], phi (n_full, k) : modes of K, M; forces : each (n_full, j), columns of zero add nothing
    factor : of K; K itself is not asked for: K times a static shape is its force, and times a mode M phi omega^2
    Returns shapes (n_full, n) of unit modal mass, orthogonal in mass and stiffness, and squares of frequencies (n,)
        ascending: the modes come first"""
    pushed = csc_matrix(hstack([csc_matrix((len(phi), 0)), *forces]))
    pushed = pushed[:, np.flatnonzero(abs(pushed).sum(axis=0))]
    if not pushed.shape[1]:
        return phi, omega**2
    k, n, step = len(omega), len(omega) + pushed.shape[1], LIMITS.static_at_once
    shapes = np.empty((len(phi), n), order="F")
    shapes[:, :k] = phi
    weighted, energy = M @ phi, np.empty(n - k)
    with threadpool_limits(1):
        for at in range(0, n - k, step):
            forces_at_once = pushed[:, at : at + step].toarray(order="F")
            static = factor.solve(forces_at_once)
            energy[at : at + step] = np.einsum("ij,ij->j", forces_at_once, static)
            for _ in range(2):
                static -= phi @ (weighted.T @ static)
            shapes[:, k + at : k + at + step] = static
    lacking, scale = shapes[:, k:], np.sqrt(energy)
    inertia = np.concatenate([lacking.T @ (M @ lacking[:, at : at + step]) for at in range(0, n - k, step)], axis=1)
    size, turn = sla.eigh(_symmetric(pushed.T @ lacking) / np.outer(scale, scale))
    independent = size > LIMITS.dependent
    basis = turn[:, independent] / np.sqrt(size[independent]) / scale[:, None]  # of unit energy
    nu, y = sla.eigh(_symmetric(basis.T @ inertia @ basis))
    nu, turned = nu[::-1], basis @ (y / np.sqrt(nu))[:, ::-1]
    for at in range(0, len(shapes), LIMITS.turned_at_once):  # in place: they are the largest array but the factor
        lacking[at : at + LIMITS.turned_at_once, : len(nu)] = lacking[at : at + LIMITS.turned_at_once] @ turned
    return shapes[:, : k + len(nu)], np.concatenate([omega**2, 1.0 / nu])


def _congruent(basis: np.ndarray, matrix: Any, sign: float = 1.0) -> np.ndarray:
    """basis^T A basis (k, k) of a sparse A (n, n) with A^T = sign A, block by block: no second array as large as the
    basis."""
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
