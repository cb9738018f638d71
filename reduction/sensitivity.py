"""How the matrices of a Craig-Bampton model move with those of the full system: exact, without another reduction.

The shapes T = [[I, 0], [Psi, Phi]] follow the system, Psi = -K_ss^-1 K_sm by

    dPsi = -K_ss^-1 (dK T_m)_s,

and the fixed-interface modes Phi by what leaves their own span, which alone changes what the model can do:

    (K_ss - w_j^2 M_ss) dphi_j = -(dK_ss - w_j^2 dM_ss) phi_j,    Phi^T M_ss dPhi = 0.

K T_m vanishes on the slaves and dT on the masters, so that the reduced stiffness needs neither: it moves by T^T dK T,
without the blocks between masters and modes, which stay zero. The reduced mass moves by T^T dM T + 2 sym(dT^T M T), for
which F = K_ss^-1 (M T_m)_s is solved once for all changes. It sees dPhi through F alone, so that Galerkin's method on
F, K_ss^-1 M_ss F, ... serves all modes and all changes: none of them needs a solution of its own.
Source  modes: Nelson, AIAA Journal 14(9), 1976; by the transpose on one space for all modes: ours
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from threadpoolctl import threadpool_limits

from tribodyn.fem.constraints import partition
from tribodyn.fem.factor import factorise
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel

# Of the space that changes of modes are seen from: motions of a chain are right to 3e-4, 2e-5, 1e-6 with 2, 3, 4
BLOCKS = 4
# square of a vector's part outside of a space, over the largest, below which it is left out: peaks of beam and blade
# move by lengths to 1e-6 as with 1e-12, in a third of the time; a chain to 1e-7, and with 1e-6 to 5e-4
DEPENDENT = 1e-7


class Sensitivity:
    """Of a model whose coordinates are masters, then fixed-interface modes.

    system : sparse, n_full DOFs; model : its Craig-Bampton reduction; shapes : T (n_full, n) over the same DOFs
    """

    def __init__(self, system: SecondOrderSystem, model: ReducedModel, shapes: np.ndarray):
        self.model, self.shapes, self.system = model, shapes, system
        masters = model.origin.masters
        self._s, _ = partition(system.n_dof, masters, "master")
        self._n = len(masters)
        self._M = csr_matrix(system.mass)
        self._M_ss = self._M[self._s][:, self._s]
        self._K_ss = csr_matrix(system.stiffness)[self._s][:, self._s]
        self._factor = factorise(self._K_ss)
        self._squares = np.diag(model.system.stiffness)[self._n :].copy()

    def _solve(self, force: np.ndarray) -> np.ndarray:
        with threadpool_limits(1):
            return np.asarray(self._factor.solve(force))

    def _full(self, slaves: np.ndarray) -> np.ndarray:
        """Values at the slaves, zero at the masters."""
        values = np.zeros((len(self.shapes), slaves.shape[1]))
        values[self._s] = slaves
        return values

    @cached_property
    def _observers(self) -> tuple[np.ndarray, list[tuple[str, str]]]:
        """What sees changes of the shapes, at the slaves: (M T_m)_s, then loads and outputs that act there."""
        vectors = {
            (kind, name): v[self._s]
            for kind in ("loads", "outputs")
            for name, v in getattr(self.system, kind).items()
            if v[self._s].any()
        }
        masses = np.asarray((self._M @ self.shapes[:, : self._n])[self._s])
        return np.column_stack([masses, *vectors.values()]), list(vectors)

    @cached_property
    def _following(self) -> np.ndarray:
        """K_ss^-1 of what is seen."""
        return self._solve(self._observers[0])

    @cached_property
    def _space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ritz vectors V (n_full, q), their squares of frequencies (q,) and V^T of what is seen (q, ...).

        They are orthogonal to the kept modes and span what is seen after 1, 2, ... solutions
        """
        phi, block = self.shapes[self._s, self._n :], self._following
        basis, weighted = phi, self._M_ss @ phi
        for count in range(BLOCKS):
            for _ in range(2):
                block = block - basis @ (weighted.T @ block)
            image = self._M_ss @ block
            square, axes = np.linalg.eigh(block.T @ image)
            independent = square > DEPENDENT * square[-1]
            turn = axes[:, independent] / np.sqrt(square[independent])
            block, image = block @ turn, image @ turn
            overlap = weighted.T @ block
            basis, weighted = (
                np.column_stack([basis, block - basis @ overlap]),
                np.column_stack([weighted, image - weighted @ overlap]),
            )
            if count < BLOCKS - 1:
                block = self._solve(image)
        vectors = basis[:, phi.shape[1] :]
        squares, axes = np.linalg.eigh(vectors.T @ (self._K_ss @ vectors))
        vectors = vectors @ axes
        return self._full(vectors), squares, vectors.T @ self._observers[0]

    def towards(self, change: SecondOrderSystem) -> SecondOrderSystem:
        """What the reduced matrices, loads and outputs move by where those of the full system move by `change`.

        To first order; without damping, which a reduced model gets after this
        """
        T, n = self.shapes, self._n
        dK, dM = csr_matrix(change.stiffness), csr_matrix(change.mass)
        rows = np.flatnonzero(np.diff(dK.indptr))
        pushed = np.asarray(dK[rows] @ T)
        stiffness, mass = T[rows].T @ pushed, np.zeros((T.shape[1], T.shape[1]))
        stiffness[:n, n:], stiffness[n:, :n] = 0.0, 0.0
        V, squares, projected = self._space
        right = V[rows].T @ pushed[:, n:]
        if dM.nnz:
            inertia = dM @ T
            mass += T.T @ inertia
            right -= V.T @ inertia[:, n:] * self._squares
        modes = -projected.T @ (right / (squares[:, None] - self._squares))
        masters = -self._full(self._following)[rows].T @ pushed[:, :n]
        mass[:n, :n] += masters[:n] + masters[:n].T
        between = modes[:n] - pushed[:, :n].T @ (T[rows, n:] / self._squares)  # K_ss^-1 M_ss Phi = Phi / w^2
        mass[:n, n:] += between
        mass[n:, :n] += between.T
        following = dict(zip(self._observers[1], np.column_stack([masters, modes])[n:], strict=True))

        def vectors(kind: str) -> dict[str, np.ndarray]:
            """T^T of loads or outputs, and what the shapes that follow add."""
            moves = getattr(change, kind)
            return {
                name: T.T @ moves[name] + following.get((kind, name), 0.0) for name in getattr(self.model.system, kind)
            }

        return SecondOrderSystem((mass + mass.T) / 2, stiffness, None, vectors("loads"), vectors("outputs"))

    def model_at(self, ways: Sequence[tuple[SecondOrderSystem, float]], stiffer: float = 0.0) -> ReducedModel:
        """The model at shares of such ways; stiffer : that of all stiffness besides, which changes no shapes."""
        base = self.model.system

        def changed(kind: str, name: str) -> np.ndarray:
            return np.asarray(sum((share * getattr(way, kind)[name] for way, share in ways), getattr(base, kind)[name]))

        vectors = {kind: {name: changed(kind, name) for name in getattr(base, kind)} for kind in ("loads", "outputs")}
        mass = sum((share * way.mass for way, share in ways), base.mass)
        stiffness = sum((share * way.stiffness for way, share in ways), (1 + stiffer) * base.stiffness)
        return replace(self.model, system=replace(base, mass=mass, stiffness=stiffness, **vectors))
