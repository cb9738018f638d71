"""The gradient of a solved balance by any parameter: one adjoint solve for each number, however many parameters.

At a solution x = B u, D_s(w) u = F + B^H g, g = k x - f(x), f the contact forces. A number q(x, f, y, w) of these, of
the outputs y = C u and of the frequency w changes, at a fixed frequency, with a parameter p by

    dq/dp = (q_f - B v) . f_p + v . (F_p - D_p u),    v = D_s^-H (C^H q_y + B^H l),
    (I - G dg/dx)^T l = q_x + (df/dx)^T q_f + (dg/dx)^T B D_s^-H C^H q_y

f_p is the change of the contact forces at the same x, F_p - D_p u that of the loads and the dynamic stiffness at the
same u: both are explicit (`parameter_effects`), so that the balance is solved again for no parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.derivatives.parameter_effects import ParameterEffects
from tribodyn.hbm.krylov import gmres
from tribodyn.hbm.quantity import CycleQuantity, SolvedCycle, quantities_of


@dataclass(frozen=True)
class CycleNumber:
    """A number of a cycle with its slopes by x and by the contact forces (n_contact, n_coeff), by the outputs
    (n_output, n_coeff), each with the others fixed, and by the frequency [rad/s].

    quantity : that it is of, None for none"""

    name: str
    value: float
    by_x: np.ndarray
    by_force: np.ndarray
    by_response: np.ndarray
    by_omega: float = 0.0
    quantity: CycleQuantity | None = None

    @property
    def moves_with_state(self) -> bool:
        """Whether it depends on more than the frequency."""
        return bool(self.by_x.any() or self.by_force.any() or self.by_response.any())


def cycle_numbers(
    balance: HarmonicBalance, state: State, output: str, wear: Mapping[str, float] | None = None
) -> list[CycleNumber]:
    """Every quantity with slopes at a solved state, of the whole contact and of each joint of several.

    output : the observed one; wear : joint -> wear coefficient [m3/J]
    A number that is zero, such as the work where all pairs stick, is left out: it has no relative derivative"""
    cycle = SolvedCycle.of(balance, state, output, wear)
    at_contact, at_outputs = np.zeros_like(state.flat), np.zeros_like(balance.outputs(state))
    joints = [joint.name for joint in balance.contact.joints] if len(balance.contact.joints) > 1 else []
    numbers = []
    for quantity in quantities_of(CycleQuantity):
        for joint in ("", *joints) if quantity.by_joint else ("",):
            part = cycle.of_joint(joint) if joint else cycle
            value = quantity.value(part) if quantity.slopes else None
            if quantity.slopes and value:
                slopes, name = quantity.slopes(part), f"{quantity.name} of {joint}" if joint else quantity.name
                by_x, by_force, by_response = (
                    default if slope is None else slope.reshape(default.shape)
                    for slope, default in (
                        (slopes.by_x, at_contact),
                        (slopes.by_force, at_contact),
                        (slopes.by_response, at_outputs),
                    )
                )
                numbers.append(CycleNumber(name, float(value), by_x, by_force, by_response, slopes.by_omega, quantity))
    return numbers


@dataclass(frozen=True, eq=False)
class Gradient:
    """The derivatives of some numbers at one solution."""

    balance: HarmonicBalance
    state: State
    numbers: tuple[CycleNumber, ...]

    @cached_property
    def effects(self) -> ParameterEffects:
        """Explicit effects of parameters."""
        return ParameterEffects(self.balance, self.state)

    def by(self, change: ParameterChange) -> tuple[np.ndarray, np.ndarray]:
        """One-sided derivatives of the numbers above and below a parameter, both (n_number,)."""
        above, below = self.effects.of_change(change)
        return self._rows @ above, self._rows @ below

    def by_frequency(self) -> np.ndarray:
        """(n_number,) dq / d omega at fixed parameters."""
        total, effects = np.array([q.by_omega for q in self.numbers]), self.effects
        harmonics = self.balance.basis.harmonics
        for h, linear, u, v in zip(harmonics, effects.systems, effects.coordinates, self._adjoints[1], strict=True):
            system = linear.system
            slope = -2 * h**2 * self.state.omega * (system.mass @ u)
            if system.velocity_matrix is not None:
                slope = slope + 1j * h * (system.velocity_matrix @ u)
            total -= np.real(v.conj().T @ slope)
        return total

    def by_gap(self) -> np.ndarray:
        """(n_number, n_pair) dq / d gap of each pair [1/m]."""
        slope = np.mean(self.effects.of_gap(), axis=0)
        return np.einsum("qpch,pch->qp", self._adjoints[2].reshape(-1, *slope.shape), slope)

    @cached_property
    def _rows(self) -> np.ndarray:
        """(n_number, n) derivatives by a vector of effects."""
        l, _, weights = self._adjoints
        n, by_response = len(self.numbers), np.stack([q.by_response for q in self.numbers])
        return np.concatenate([weights.reshape(n, -1), l.reshape(n, -1), by_response.reshape(n, -1)], axis=1)

    @cached_property
    def _adjoints(self) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        """l (n_number, n_contact, n_coeff), v of each harmonic (n, n_number), and q_f - B v."""
        basis, shape, systems = self.balance.basis, self.state.flat.shape, self.effects.systems
        point = self.balance.at(self.state.omega)
        by_response = basis.to_complex(np.stack([q.by_response for q in self.numbers]))
        observed = [s.adjoint(s.C.conj().T @ by_response[:, :, i].T) for i, s in enumerate(systems)]
        at_contact = np.stack([s.B @ v for s, v in zip(systems, observed, strict=True)], axis=-1)
        solutions, weights = [], []
        for q, through in zip(self.numbers, basis.to_real(at_contact.transpose(1, 0, 2)), strict=True):
            right = q.by_x + self._force_transposed(q.by_force) + self._departure_transposed(through)
            solutions.append(self._solve_transposed(right))
            weights.append(q.by_force - through - point.transposed(solutions[-1]))
        l = basis.to_complex(np.array(solutions))
        harmonics = enumerate(zip(systems, observed, strict=True))
        v = [output_part + s.adjoint(s.B.conj().T @ l[:, :, i].T) for i, (s, output_part) in harmonics]
        return np.reshape(solutions, (-1, *shape)), v, np.reshape(weights, (-1, *shape))

    def _force_transposed(self, v: np.ndarray) -> np.ndarray:
        """(df/dx)^T v."""
        jacobian = self.state.cycle.slope
        return np.matmul(jacobian.transpose(0, 2, 1), v.reshape(len(jacobian), -1, 1)).reshape(v.shape)

    def _departure_transposed(self, v: np.ndarray) -> np.ndarray:
        """(dg/dx)^T v."""
        return self.balance.reference_stiffness[:, None] * v - self._force_transposed(v)

    def _residual_transposed(self, v: np.ndarray) -> np.ndarray:
        """(I - G dg/dx)^T v."""
        return v - self._departure_transposed(self.balance.at(self.state.omega).transposed(v))

    def _solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """l of a right-hand side: by GMRES, refined."""
        solution, residual = np.zeros_like(right), right
        size = float(np.linalg.norm(right))
        error = 1.0 if size > 0 else 0.0
        for _ in range(3):
            if error <= RULES.adjoint_tolerance:
                break
            correction, _, _ = gmres(
                lambda v: self._residual_transposed(v.reshape(right.shape)).ravel(),
                residual.ravel(),
                RULES.adjoint_tolerance / error,
                RULES.adjoint_products,
            )
            solution = solution + correction.reshape(right.shape)
            residual = right - self._residual_transposed(solution)
            error = float(np.linalg.norm(residual)) / size
        if not error <= RULES.adjoint_limit:
            raise NoDerivative(f"the adjoint is not solved: its relative residual is {error:.0e}, as at a fold")
        return solution
