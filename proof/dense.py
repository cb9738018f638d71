"""The dense algorithm of the thesis and of public codes, kept as the reference that the compliance form must equal.

Unknowns are all reduced coordinates times all harmonic coefficients; each Newton step assembles the full Jacobian,
contact tangent included, and factorises it.
Source  Tamatam 2021, eq. 3.6-3.7, 3.23 and figure 7.3."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, kron

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactCycle
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd


@dataclass(frozen=True)
class DenseSolution:
    """q : (n, n_coeff) reduced coordinates [m]; x : (n_pair, n_component, n_coeff) contact displacement [m]."""

    omega: float
    q: np.ndarray
    x: np.ndarray
    outcome: Outcome[SolveEnd]
    steps: int

    @property
    def converged(self) -> bool:
        """Whether the residual is below the tolerance."""
        return self.outcome.kind is SolveEnd.CONVERGED


@dataclass
class DenseBalance:
    """The same problem as a HarmonicBalance, solved the dense way; real models whose harmonics share one system."""

    problem: HarmonicBalance

    def __post_init__(self) -> None:
        self.problem.model.require_masters("the dense reference")
        if not self.problem.model.has_one_system:
            raise ValueError("the dense reference serves models whose harmonics share one real system")
        system, b = self.problem.model.at_harmonic(0)
        basis, excitation = self.problem.basis, self.problem.excitation
        self._b = b
        self._spread = csr_matrix(kron(csr_matrix(b), np.eye(basis.n_coeff)))  # x = spread . q, coefficients innermost
        amplitudes = np.zeros((system.n_dof, len(basis.harmonics)), complex)
        for (h, name), value in excitation.loads.items():
            if h in basis.harmonics:
                amplitudes[:, basis.harmonics.index(h)] += system.loads[name] * value
        self.force = self.problem.loaded(basis.to_real(amplitudes))

    def dynamic_stiffness(self, omega: float) -> np.ndarray:
        """(n n_coeff, n n_coeff) linear part, coefficients innermost."""
        system, basis = self.problem.model.system, self.problem.basis
        n, m = system.n_dof, basis.n_coeff
        damping = np.zeros_like(system.mass) if system.velocity_matrix is None else system.velocity_matrix
        z = np.zeros((n, m, n, m))
        for a in range(m):
            h = basis.order[a]
            z[:, a, :, a] = system.stiffness - (h * omega) ** 2 * system.mass
        # velocity of a cos + b sin has cosine coefficient h w b and sine coefficient -h w a
        for a in range(int(basis.has_static), m, 2):
            h = basis.order[a]
            z[:, a, :, a + 1] = h * omega * damping
            z[:, a + 1, :, a] = -h * omega * damping
        return z.reshape(n * m, n * m)

    def solve(self, omega: float, start: np.ndarray, tolerance: float = 1e-8, max_steps: int = 40) -> DenseSolution:
        """Full Newton from reduced coordinates `start` (n, n_coeff), residual relative to the excitation."""
        linear = self.dynamic_stiffness(omega)
        scale = np.linalg.norm(self.force)
        q = start.ravel().copy()
        outcome = SolveEnd.STEPS_SPENT.say(f" {max_steps} steps")
        steps = 0
        while True:
            x, cycle, residual = self.residual(linear, q)
            if np.linalg.norm(residual) <= tolerance * scale:
                outcome = CONVERGED
                break
            if steps == max_steps:
                break
            steps += 1
            q -= np.linalg.solve(self.jacobian(linear, cycle), residual)
        return DenseSolution(omega, q.reshape(-1, self.problem.basis.n_coeff), x, outcome, steps)

    def residual(self, linear: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, ContactCycle, np.ndarray]:
        """Contact displacement (n_pair, n_component, n_coeff) [m], its cycle, and the residual (n n_coeff,) [N].

        linear : of `dynamic_stiffness`; q : (n n_coeff,) reduced coordinates [m]"""
        p = self.problem
        x = (self._spread @ q).reshape(p.contact.n_pair, -1, p.basis.n_coeff)
        cycle = p.contact.cycle(x, p.basis, p.memory)
        residual = linear @ q - self.force.ravel() + self._spread.T @ cycle.force.ravel()
        return x, cycle, residual

    def jacobian(self, linear: np.ndarray, cycle: ContactCycle) -> np.ndarray:
        """(n n_coeff, n n_coeff) derivative of the residual."""
        return linear + (self._spread.T @ _block_diagonal(cycle.slope) @ self._spread).toarray()

    def onto_contact(self, matrix: np.ndarray) -> np.ndarray:
        """Contact displacements (n_contact n_coeff, ...) that belong to columns of coordinates (n n_coeff, ...)."""
        return np.asarray(self._spread @ matrix)

    def coordinates_of(self, omega: float, x: np.ndarray) -> np.ndarray:
        """Reduced coordinates (n, n_coeff) in balance with the contact forces at x, to start or to check from."""
        cycle = self.problem.contact.cycle(x, self.problem.basis, self.problem.memory)
        force = self.force.ravel() - self._spread.T @ cycle.force.ravel()
        return np.linalg.solve(self.dynamic_stiffness(omega), force).reshape(-1, self.problem.basis.n_coeff)


def _block_diagonal(blocks: np.ndarray) -> csr_matrix:
    n, m, _ = blocks.shape
    columns = (np.arange(n)[:, None, None] * m + np.arange(m)[None, None, :]).repeat(m, axis=1)
    return csr_matrix((blocks.ravel(), columns.ravel(), np.arange(0, n * m * m + 1, m)), shape=(n * m, n * m))
