"""The explicit effects of a parameter on a solved balance: nothing is solved again.

At the solution, effects are the change of the contact forces at the same x, and that of x and of the outputs at the
same contact forces. They are central differences of two balances, by a step so small that their error is rounding.
Where a parameter changes the coordinates of the model, such as the shapes of a reduction, x and outputs are compared at
the same g, which needs no common coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.derivatives.derivative_rules import RULES
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.reduction.linear import stuck_dynamic_stiffness
from tribodyn.reduction.residual_flexibility import FlexibleModel


@dataclass(frozen=True)
class HarmonicSystem:
    """Linear system of one harmonic: contact map B (n_contact, n), outputs C (n_output, n), and LU factors of D_s."""

    system: SecondOrderSystem
    B: np.ndarray
    C: np.ndarray
    factor: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(cls, inputs: BalanceInputs, balance: HarmonicBalance, h: int, omega: float) -> HarmonicSystem:
        """That of harmonic h at a frequency [rad/s]."""
        system, B, C = _maps(inputs, balance, h)
        stiffness = stuck_dynamic_stiffness(system, B, balance.reference_stiffness, 1j * h * omega)
        factor = sla.lu_factor(stiffness if h or np.iscomplexobj(B) else stiffness.real, overwrite_a=True)
        return cls(system, B, C, factor)

    def solve(self, force: np.ndarray) -> np.ndarray:
        """D_s^-1 force."""
        return np.asarray(sla.lu_solve(self.factor, force))

    def adjoint(self, force: np.ndarray) -> np.ndarray:
        """D_s^-H force."""
        return np.asarray(sla.lu_solve(self.factor, force, trans=2))


def _maps(inputs: BalanceInputs, balance: HarmonicBalance, h: int) -> tuple[SecondOrderSystem, np.ndarray, np.ndarray]:
    """System, contact map and outputs of a harmonic."""
    system, B = inputs.model.at_harmonic(h)
    return system, np.asarray(B), np.stack([system.outputs[name] for name in balance.compliance.output_names])


@dataclass(frozen=True, eq=False)
class ParameterEffects:
    """The effects of parameters at one solution."""

    balance: HarmonicBalance
    state: State

    @cached_property
    def inputs(self) -> BalanceInputs:
        """Those of the solved balance."""
        return BalanceInputs.of(self.balance)

    @cached_property
    def systems(self) -> list[HarmonicSystem]:
        """Of each harmonic."""
        return self._systems(self.inputs)

    @cached_property
    def coordinates(self) -> list[np.ndarray]:
        """u (n,) of each harmonic."""
        return self._coordinates(self.inputs, self.systems)

    def of_change(self, change: ParameterChange) -> tuple[np.ndarray, np.ndarray]:
        """One-sided slopes above and below a parameter.

        Each is one vector: contact forces at the same x, then x and outputs at the same contact forces"""
        up, down = self._differences(change.above, change.below)
        if change.double_step:
            far = self._differences(*change.double_step)
            mean, jump = (8 * (up - down) - (far[0] - far[1])) / 12, 2 * (up + down) - (far[0] + far[1]) / 2
            up, down = mean + jump / 2, jump / 2 - mean
        elif change.double_step is not None:
            up, down = (up - down) / 2, (down - up) / 2
        upper, lower = up / change.step, -down / change.step
        if change.contact_part is None:
            return upper, lower
        contact_above, contact_below = self.of_change(change.contact_part)
        return upper + contact_above, lower + contact_below

    def of_gap(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, n_component, n_coeff) d force / d gap of each pair at the same x, above and below it [N/m]."""
        balance = self.balance
        if "n" not in balance.contact.components or not balance.basis.has_static:
            return np.zeros_like(self.state.x), np.zeros_like(self.state.x)
        step, gap = RULES.gap_step * float(np.abs(self.state.x).max()), balance.contact.gap
        upper, lower = (
            self._force_change(balance.contact.with_gap(gap + side), balance.memory) / side for side in (step, -step)
        )
        return upper, lower

    def _differences(self, upper: BalanceInputs, lower: BalanceInputs) -> list[np.ndarray]:
        """Vectors of `of_change` for the inputs on both sides, without the step."""
        sides = ((self._force_change(i.contact, i.memory), *self._linear_change(i)) for i in (upper, lower))
        return [np.concatenate([part.ravel() for part in side]) for side in sides]

    def _force_change(self, contact: JointSet, memory: np.ndarray) -> np.ndarray:
        """(n_pair, n_component, n_coeff) difference of the forces of another contact at the same x [N]."""
        if contact is self.balance.contact and memory is self.balance.memory:
            return np.zeros_like(self.state.x)
        cycle = contact.cycle(self.state.x, self.balance.basis, memory, jacobian=False, omega=self.state.omega)
        return np.asarray(cycle.force - self.state.cycle.force)

    def _linear_change(self, inputs: BalanceInputs) -> tuple[np.ndarray, np.ndarray]:
        """Difference of x and outputs by model and loads at the same u and contact forces."""
        balance, base = self.balance, self.inputs
        if inputs.model is base.model and inputs.excitation is base.excitation:
            return np.zeros_like(self.state.flat), np.zeros((len(self.systems[0].C), balance.basis.n_coeff))
        if not inputs.same_coordinates and inputs.model.interface.B is not base.model.interface.B:
            x, y = self._motion(inputs, self._systems(inputs))
            x_base, y_base = self._motion(base, self.systems)
            return x - x_base, y - y_base
        motions, pulls = [], zip(self._pulls(inputs), self._pulls(base), strict=True)
        harmonics = zip(balance.basis.harmonics, self.systems, self.coordinates, pulls, strict=True)
        for h, linear, u, (pull, pull_base) in harmonics:
            system, B, C = _maps(inputs, balance, h)  # in the same coordinates
            force = B.conj().T @ pull - linear.B.conj().T @ pull_base
            force = force + self._loads(inputs, system, h) - self._loads(base, linear.system, h)
            if system is not linear.system:
                force = force - _stiffness_change(system, linear.system, 1j * h * self.state.omega, u)
            du = linear.solve(force) if force.any() else force
            motions.append((linear.B @ du + (B - linear.B) @ u, linear.C @ du + (C - linear.C) @ u))
        x, y = self._coefficients(motions)
        return x + self._direct_motion(inputs) - self._direct_motion(base), y

    def _motion(self, inputs: BalanceInputs, systems: list[HarmonicSystem]) -> tuple[np.ndarray, np.ndarray]:
        """x and outputs of other inputs under this g."""
        coordinates = zip(systems, self._coordinates(inputs, systems), strict=True)
        x, y = self._coefficients([(s.B @ u, s.C @ u) for s, u in coordinates])
        return x + self._direct_motion(inputs), y

    def _systems(self, inputs: BalanceInputs) -> list[HarmonicSystem]:
        omega = self.state.omega
        return [HarmonicSystem.of(inputs, self.balance, h, omega) for h in self.balance.basis.harmonics]

    def _coordinates(self, inputs: BalanceInputs, systems: list[HarmonicSystem]) -> list[np.ndarray]:
        """u (n,) of each harmonic under the loads of some inputs and this g."""
        harmonics = zip(self.balance.basis.harmonics, systems, self._pulls(inputs), strict=True)
        return [s.solve(s.B.conj().T @ g + self._loads(inputs, s.system, h)) for h, s, g in harmonics]

    def _pull(self, inputs: BalanceInputs) -> np.ndarray:
        """g (n_contact, n_coeff) of other inputs at this state."""
        k, base = self.balance.reference_stiffness[:, None], inputs.excitation.base
        relative = self.state.flat if base is None else self.state.flat + self.balance.loaded(base)
        return k * relative - self.state.cycle.force.reshape(relative.shape)

    def _pulls(self, inputs: BalanceInputs) -> np.ndarray:
        """g of each harmonic (n_harmonic, n_contact)."""
        return np.asarray(self.balance.basis.to_complex(self._pull(inputs)).T)

    def _direct_motion(self, inputs: BalanceInputs) -> np.ndarray | float:
        """The part of x that is no motion of the coordinates: residual flexibility and moving ground."""
        base, model = inputs.excitation.base, inputs.model
        x = model.residual.apply(self._pull(inputs)) if isinstance(model, FlexibleModel) else 0.0
        return x if base is None else x - self.balance.loaded(base)

    def _loads(self, inputs: BalanceInputs, system: SecondOrderSystem, h: int) -> np.ndarray:
        """(n,) loads of a harmonic."""
        factor = self.balance.load_factor if h else 1.0
        return factor * inputs.excitation.force(h, system.loads, system.n_dof)

    def _coefficients(self, motions: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
        """Real coefficients of x and outputs from the complex ones of each harmonic."""
        x, y = (self.balance.basis.to_real(np.stack(part, axis=-1)) for part in zip(*motions, strict=True))
        return x, y


def _stiffness_change(
    system: SecondOrderSystem, base: SecondOrderSystem, s: complex, u: np.ndarray
) -> np.ndarray | float:
    """Difference of the dynamic stiffness of two systems times u."""
    total: np.ndarray | float = 0.0
    for factor, name in ((1.0, "stiffness"), (s, "velocity_matrix"), (s**2, "mass")):
        matrix, base_matrix = getattr(system, name), getattr(base, name)
        if matrix is not base_matrix and matrix is not None and base_matrix is not None:
            total = total + factor * ((matrix - base_matrix) @ u)
    return total
