"""How the matrices of a Craig-Bampton model move with those of the full system: exact, without another reduction.

The shapes T = [[I, 0], [Psi, Phi]] follow the system, Psi = -K_ss^-1 K_sm by

    dPsi = -K_ss^-1 (dK T_m)_s,

and the fixed-interface modes Phi by what leaves their own span, which alone changes what the model can do:

    (K_ss - w_j^2 M_ss) dphi_j = -(dK_ss - w_j^2 dM_ss) phi_j,    Phi^T M_ss dPhi = 0.

K T_m vanishes on the slaves and dT on the masters, so that the reduced stiffness needs neither: it moves by T^T dK T,
without the blocks between masters and modes, which stay zero. The reduced mass moves by T^T dM T + 2 sym(dT^T M T), for
which K_ss^-1 (M T_m)_s is solved once for all changes.
Source  modes: Nelson, AIAA Journal 14(9), 1976; as a system on the complement of the kept modes: ours
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from threadpoolctl import threadpool_limits

from tribodyn.fem.constraints import partition
from tribodyn.fem.factor import factorise
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel

SOLVED = 1e-6  # relative residual of the change of a mode
MOST = 60  # steps of conjugate gradients for it


class Sensitivity:
    """Of a model whose coordinates are masters, then fixed-interface modes.

    system : sparse, n_full DOFs; model : its Craig-Bampton reduction; shapes : T (n_full, n) over the same DOFs
    """

    def __init__(self, system: SecondOrderSystem, model: ReducedModel, shapes: np.ndarray):
        self.model, self._T, self.system = model, shapes, system
        masters = model.info.master_dofs
        self._s, _ = partition(system.n_dof, masters, "master")
        self._n = len(masters)
        self._M = csr_matrix(system.mass)
        self._K_ss, self._M_ss = (csr_matrix(A)[self._s][:, self._s] for A in (system.stiffness, system.mass))
        self._factor = factorise(self._K_ss)
        self._phi = self._T[self._s, self._n :]
        self._squares = np.diag(model.system.stiffness)[self._n :].copy()

    @cached_property
    def _masses(self) -> np.ndarray:
        """(M T_m)_s."""
        return np.asarray((self._M @ self._T[:, : self._n])[self._s])

    @cached_property
    def _following(self) -> np.ndarray:
        """K_ss^-1 (M T_m)_s."""
        return self._solve(self._masses)

    def _solve(self, force: np.ndarray) -> np.ndarray:
        with threadpool_limits(1):
            return np.asarray(self._factor.solve(force))

    def towards(self, other: SecondOrderSystem) -> SecondOrderSystem:
        """What the reduced matrices, loads and outputs move by on the way to another system of the same DOFs.

        To first order in their difference; without damping, which a reduced model gets after this
        """
        T, n, s, reduced = self._T, self._n, self._s, self.model.system
        dK, dM = (csr_matrix(getattr(other, name) - getattr(self.system, name)) for name in ("stiffness", "mass"))
        pushed = np.asarray(dK @ T)
        stiffness = T.T @ pushed
        stiffness[:n, n:], stiffness[n:, :n] = 0.0, 0.0
        mass = T.T @ (dM @ T)
        own = pushed[s, :n]
        from_masters = -own.T @ self._following if dK.nnz else np.zeros((n, n))
        modes = self._modes(pushed[s, n:] - np.asarray(dM @ T[:, n:])[s] * self._squares)
        between = -own.T @ (self._phi / self._squares) + self._masses.T @ modes  # K_ss^-1 M_ss Phi = Phi / w^2
        mass[:n, :n] += from_masters + from_masters.T
        mass[:n, n:] += between
        mass[n:, :n] += between.T

        def vector(new: np.ndarray, old: np.ndarray) -> np.ndarray:
            """T^T of a load or an output, and what the shapes that follow add."""
            found = T.T @ (new - old)
            if old[s].any():
                found[:n] -= own.T @ self._solve(old[s])
                found[n:] += modes.T @ old[s]
            return np.asarray(found)

        return SecondOrderSystem(
            (mass + mass.T) / 2,
            stiffness,
            None,
            {name: vector(other.loads[name], self.system.loads[name]) for name in reduced.loads},
            {name: vector(other.outputs[name], self.system.outputs[name]) for name in reduced.outputs},
        )

    def moved(self, way: SecondOrderSystem, share: float) -> ReducedModel:
        """The model at a share of such a way."""
        own = self.model.system
        vectors = {
            kind: {name: v + share * getattr(way, kind)[name] for name, v in getattr(own, kind).items()}
            for kind in ("loads", "outputs")
        }
        matrices = {name: getattr(own, name) + share * getattr(way, name) for name in ("mass", "stiffness")}
        return replace(self.model, system=replace(own, **matrices, **vectors))

    def _modes(self, pushed: np.ndarray) -> np.ndarray:
        """dPhi (n_slave, k) that (dK_ss - w^2 dM_ss) Phi (n_slave, k) causes, without what stays in the span of Phi.

        By conjugate gradients on the complement of the kept modes, where K_ss - w^2 M_ss is positive, with K_ss as
        preconditioner
        """
        M_phi = np.asarray(self._M_ss @ self._phi)

        def outside(force: np.ndarray) -> np.ndarray:
            return np.asarray(force - M_phi @ (self._phi.T @ force))

        right = -outside(pushed)
        found, left = np.zeros_like(right), right
        size = np.linalg.norm(right, axis=0)
        moves = size > 1e-9 * np.linalg.norm(pushed, axis=0).max(initial=0.0)
        if not moves.any():
            return found
        squares, left, part = self._squares[moves], right[:, moves], np.zeros((len(right), int(moves.sum())))
        along, before = np.zeros_like(part), np.ones(part.shape[1])
        for _ in range(MOST):
            raised = self._solve(left)
            raised -= self._phi @ (M_phi.T @ raised)
            now = np.einsum("nk,nk->k", left, raised)
            along = raised + along * (now / before if along.any() else 0.0)
            image = outside(np.asarray(self._K_ss @ along - (self._M_ss @ along) * squares))
            step = now / np.einsum("nk,nk->k", along, image)
            part, left, before = part + step * along, left - step * image, now
            if (np.linalg.norm(left, axis=0) <= SOLVED * size[moves]).all():
                break
        found[:, moves] = part
        return found
