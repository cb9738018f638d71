"""Interface reduction: the contact DOFs of a Craig-Bampton model become a few characteristic constraint modes.

SCC: modes of the boundary block (K_mm, M_mm) of the reduced model replace all masters. SCCe: chosen physical DOFs stay,
the other masters become static shapes of those, and modes with those held; it is Craig and Bampton once more, on the
boundary block. With all modes kept both are a change of variables and lose nothing. Contact forces act through the
modes, so that the contact is too stiff for displacements they lack. Modes of the free boundary serve best: with those
of the stuck one, which rest where the contact is stiff, the beam scene needs ten times as many (measured).
Source  SCC: Castanier, Tan and Pierre, AIAA Journal 39(6), 2001; SCCe as in Tamatam 2021, appendix A"""

from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.modes import modes
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.refusal import Refusal


def interface_modes(
    model: ReducedModel, n_modes: int, keep: np.ndarray | None = None, separate: np.ndarray | None = None
) -> ReducedModel:
    """Reduce the masters of a Craig-Bampton model to n_modes characteristic constraint modes.

    model : from reduction.craig_bampton, masters first; n_modes : at most the number of masters that do not stay
    keep : DOFs of the full system, masters all of them, that stay physical (SCCe); none for SCC
    separate : those of `keep` that must not move the contact by themselves, as a displacement that is to be prescribed
        must not: the static shapes that belong to them are coordinates of their own, as far as the modes lack them
    Returns the model in coordinates: kept masters in ascending order, interface modes, static shapes, fixed-interface
        modes
    Raises  Refusal for a model that differs from harmonic to harmonic, DOFs that are no masters, too many modes, or
        a boundary that can move rigidly with the kept DOFs held"""
    if not model.has_one_system:
        raise Refusal("interface modes need a model that is the same for all harmonics: leave interface_modes out")
    masters = model.origin.masters
    retained = np.unique(np.asarray([] if keep is None else keep, dtype=int))
    if not np.all(np.isin(retained, masters)):
        raise Refusal("interface modes: only DOFs that are masters of the reduction can be kept")
    n_m, n = len(masters), model.system.n_dof
    a, b = np.flatnonzero(np.isin(masters, retained)), np.flatnonzero(~np.isin(masters, retained))
    if not 0 < n_modes <= len(b):
        raise Refusal(f"interface modes: {n_modes} were asked of {len(b)} contact DOFs; ask for 1 to {len(b)}")
    K = np.asarray(model.system.stiffness)
    omega, phi = modes(K[np.ix_(b, b)], model.system.mass[np.ix_(b, b)], min(n_modes + 1, len(b)))

    contact = phi[:, :n_modes]
    following = _static_shapes(K, a, b) if len(a) else np.zeros((len(b), 0))
    is_separate = np.isin(masters[a], np.asarray([] if separate is None else separate, dtype=int))
    if is_separate.any():
        contact = np.hstack([contact, _lacking(contact, following[:, is_separate], model.system.mass[np.ix_(b, b)])])
        following = np.where(is_separate, 0.0, following)

    n_contact = contact.shape[1]
    basis = np.zeros((n, len(a) + n_contact + n - n_m))
    basis[a, np.arange(len(a))] = 1.0
    basis[np.ix_(b, np.arange(len(a)))] = following
    basis[np.ix_(b, len(a) + np.arange(n_contact))] = contact
    basis[np.arange(n_m, n), np.arange(len(a) + n_contact, basis.shape[1])] = 1.0
    omitted = float(omega[n_modes]) / (2 * np.pi) if n_modes < len(b) else np.inf
    reduced = model.projected(basis)
    assert isinstance(reduced.origin, ReductionBasis)
    origin = replace(
        reduced.origin, master_dofs=masters[a], n_interface_modes=n_modes, interface_omitted_frequency=omitted
    )
    return replace(reduced, origin=origin)


def _static_shapes(K: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """-K_bb^-1 K_ba, static shapes of the boundary for unit displacements of what is kept."""
    try:
        return -sla.cho_solve(sla.cho_factor(K[np.ix_(b, b)]), K[np.ix_(b, a)])
    except np.linalg.LinAlgError:
        raise Refusal(
            "interface modes: the contact can move rigidly with the kept DOFs held; keep more, or none"
        ) from None


def _lacking(phi: np.ndarray, shapes: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """What of some shapes no combination of modes is, as independent columns.

    phi : (n, n_modes) modes, orthonormal in the mass; shapes : (n, k)"""
    remainder = shapes - phi @ (phi.T @ mass @ shapes)
    remainder -= phi @ (phi.T @ mass @ remainder)
    directions, size, _ = np.linalg.svd(remainder, full_matrices=False)
    return directions[:, size > LIMITS.new_direction * np.linalg.norm(shapes, 2)]
