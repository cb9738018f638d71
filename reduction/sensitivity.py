"""How the matrices of a Craig-Bampton model move with those of the full system: exact, without another reduction.

The shapes T = [[I, 0, 0], [Psi, Phi, X]] follow the system, Psi = -K_ss^-1 K_sm and the static shapes S = K_ss^-1 F
under loads and outputs F and S' = K_ss^-1 M_ss (S - Phi C), of which X = ([S, S'] - Phi C) Z with C and Z kept, by

    dPsi = -K_ss^-1 (dK T_m)_s,    dS = K_ss^-1 (dF - dK_ss S),
    dS' = K_ss^-1 (dM_ss (S - Phi C) + M_ss (dS - dPhi C) - dK_ss S'),

and the fixed-interface modes Phi by what leaves their own span, which alone changes what the model can do:

    (K_ss - w_j^2 M_ss) dphi_j = -(dK_ss - w_j^2 dM_ss) phi_j,    Phi^T M_ss dPhi = 0.

K T_m vanishes on the slaves and dT on the masters, so that the reduced stiffness moves by T^T dK T, without the blocks
between masters and the rest, W = [Phi, X], which stay zero, and by 2 sym(W^T K_ss dW). The reduced mass moves by
T^T dM T + 2 sym(dT^T M T). All that is needed of dT is what F, M_ss (S - Phi C) and (M T)_s see of it: K_ss^-1 of
these is solved once for all changes. They see dPhi through Galerkin's method on K_ss^-1 of these, K_ss^-1 M_ss of that,
and so on, which serves all modes and all changes: none of them needs a solution of its own.
Source  modes: Nelson, AIAA Journal 14(9), 1976; by the transpose on one space for all modes: ours"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from threadpoolctl import threadpool_limits

from tribodyn.fem.constraints import partition
from tribodyn.fem.factor import factorise
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel, ReductionBasis

# Of the space that changes of modes are seen from: motions of a chain are right to 3e-4, 2e-5, 1e-6 with 2, 3, 4
BLOCKS = 4
# square of a vector's part outside of a space, over the largest, below which it is left out: peaks of beam and blade
# move by lengths to 1e-6 as with 1e-12, in a third of the time; a chain to 1e-7, and with 1e-6 to 5e-4
DEPENDENT = 1e-7


class Sensitivity:
    """Of a model whose coordinates are masters, fixed-interface modes, then static shapes of loads and outputs.

    system : sparse, n_full DOFs; model : its Craig-Bampton reduction; shapes : T (n_full, n) over the same DOFs"""

    def __init__(self, system: SecondOrderSystem, model: ReducedModel, shapes: np.ndarray):
        assert isinstance(model.origin, ReductionBasis)
        self.model, self.shapes, self.system = model, shapes, system
        masters = model.origin.masters
        self._s, _ = partition(system.n_dof, masters, "master")
        self._n, self._k = len(masters), model.origin.n_modes
        self._M = csr_matrix(system.mass)
        self._M_ss = self._M[self._s][:, self._s]
        self._K_ss = csr_matrix(system.stiffness)[self._s][:, self._s]
        self._factor = factorise(self._K_ss)
        self._squares = np.diag(model.system.stiffness)[self._n : self._n + self._k].copy()

    def _solve(self, force: np.ndarray) -> np.ndarray:
        with threadpool_limits(1):
            return np.asarray(self._factor.solve(force))

    def _full(self, slaves: np.ndarray) -> np.ndarray:
        """Values at the slaves, zero at the masters."""
        values = np.zeros((len(self.shapes), slaves.shape[1]))
        values[self._s] = slaves
        return values

    @property
    def _phi(self) -> np.ndarray:
        """(n_slave, k) fixed-interface modes."""
        return self.shapes[self._s, self._n : self._n + self._k]

    @cached_property
    def _observers(self) -> tuple[np.ndarray, list[tuple[str, str]]]:
        """What sees changes of the shapes: (M T)_s, the loads and outputs F on the slaves, M_ss (S - Phi C)."""
        vectors = {
            (kind, name): v[self._s]
            for kind in ("loads", "outputs")
            for name, v in getattr(self.system, kind).items()
            if v[self._s].any()
        }
        masses = np.asarray((self._M @ self.shapes)[self._s])
        forces = np.column_stack([masses[:, :0], *vectors.values()])
        phi, static = self._phi, self._solve(forces) if vectors else forces
        beyond = static - phi @ (phi.T @ (self._M_ss @ static))
        return np.column_stack([masses, forces, self._M_ss @ beyond]), list(vectors)

    @cached_property
    def _following(self) -> np.ndarray:
        """K_ss^-1 of what is seen."""
        return self._solve(self._observers[0])

    @cached_property
    def _following_inertia(self) -> np.ndarray:
        """K_ss^-1 M_ss of that."""
        return self._solve(self._M_ss @ self._following)

    @cached_property
    def _space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ritz vectors V (n_full, q), their squares of frequencies (q,) and V^T of what is seen (q, ...).

        They are orthogonal to the kept modes and span what is seen after 1, 2, ... solutions"""
        phi, block = self._phi, np.delete(self._following, np.s_[self._n : self._n + self._k], axis=1)
        block = block / np.linalg.norm(block, axis=0)
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
        seen = np.hstack([self._observers[0], self._M_ss @ self._following])
        return self._full(vectors), squares, vectors.T @ seen

    @cached_property
    def _static(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """[S, S'] (n_slave, j) of loads and outputs, and C (k, j), Z (j, ...) of X = ([S, S'] - Phi C) Z."""
        static = self._following[:, self.shapes.shape[1] :]
        inertia = self.shapes[self._s, self._n :].T @ (self._M_ss @ static)
        return static, inertia[: self._k], np.linalg.pinv(inertia[self._k :])

    def towards(self, change: SecondOrderSystem) -> SecondOrderSystem:
        """What the reduced matrices, loads and outputs move by where those of the full system move by `change`.

        To first order; without damping, which a reduced model gets after this"""
        T, n, k, (S, C, Z) = self.shapes, self._n, self._k, self._static
        dK, dM = csr_matrix(change.stiffness), csr_matrix(change.mass)
        rows = np.flatnonzero(np.diff(dK.indptr))
        pushed = np.asarray(dK[rows] @ T)
        stiffness, mass = T[rows].T @ pushed, np.zeros((T.shape[1], T.shape[1]))
        stiffness[:n, n:], stiffness[n:, :n] = 0.0, 0.0
        V, squares, projected = self._space
        right = V[rows].T @ pushed[:, n : n + k]
        if dM.nnz:
            inertia = dM @ T
            mass += T.T @ inertia
            right -= V.T @ inertia[:, n : n + k] * self._squares
        names, following = self._observers[1], self._following
        modes, inertia_of_modes = np.split(-projected.T @ (right / (squares[:, None] - self._squares)), 2)
        moved = np.column_stack([S[:, :0], *(getattr(change, kind)[name][self._s] for kind, name in names)])
        j = len(names)
        beyond = S[:, :j] - self._phi @ C[:, :j]
        bent, heavier = np.asarray(dK @ self._full(S))[self._s], np.asarray(dM @ self._full(beyond))[self._s]
        moved = moved - bent[:, :j]
        later = self._following_inertia.T @ moved + following.T @ (heavier - bent[:, j:]) - inertia_of_modes @ C[:, :j]
        static = np.hstack([following.T @ moved, later])  # what the observers see of dS, dS'
        seen = np.hstack([-self._full(following)[rows].T @ pushed[:, :n], modes, (static - modes @ C) @ Z])
        # a change of X within the span of W is one of coordinates, and large where X is small beside S: none is made
        at = slice(n, T.shape[1])
        seen[:, n + k :] -= (self._observers[0].T @ self.shapes[self._s, n:]) @ seen[at, n + k :]
        mass += seen[: T.shape[1]] + seen[: T.shape[1]].T
        # K_ss W = [M_ss Phi w^2, [F, M_ss (S - Phi C)] Z - M_ss Phi w^2 C Z]
        by_modes = self._squares[:, None] * seen[n : n + k, n:]
        resisted = np.vstack([by_modes, Z.T @ (seen[T.shape[1] :, n:] - C.T @ by_modes)])
        stiffness[n:, n:] += resisted + resisted.T
        observed = dict(zip(names, seen[T.shape[1] :], strict=False))

        def vectors(kind: str) -> dict[str, np.ndarray]:
            """T^T of loads or outputs, and what the shapes that follow add."""
            moves = getattr(change, kind)
            return {
                name: T.T @ moves[name] + observed.get((kind, name), 0.0) for name in getattr(self.model.system, kind)
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
