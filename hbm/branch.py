"""What a continuation returns: solution points, and for each an outcome that is a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hbm.balance import HarmonicBalance
    from hbm.newton import Solution

CONVERGED = "converged"


@dataclass(frozen=True)
class Branch:
    """Points of a response curve in the order they were found.

    omega : (n_point,) excitation frequency [rad/s]
    output_names : names of the observed outputs
    response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m]
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point "converged" or a sentence that says what went wrong
    newton_steps : (n_point,) Newton steps spent
    end : sentence that says where and why the branch ends
    """

    omega: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[str, ...]
    newton_steps: np.ndarray
    end: str

    @property
    def frequency(self) -> np.ndarray:
        """(n_point,) excitation frequency [Hz]."""
        return self.omega / (2 * np.pi)

    def amplitude(self, output: str, has_static: bool = True) -> np.ndarray:
        """(n_point,) vibration amplitude of an output, see `amplitude` [m]."""
        return amplitude(self.response[:, self.output_names.index(output)], has_static)


def amplitude(coefficients: np.ndarray, has_static: bool = True) -> np.ndarray:
    """Vibration amplitude of Fourier coefficients: square root of the sum over harmonics of a_h^2 + b_h^2.

    coefficients : (..., n_coeff), [x_0, a_1, b_1, ...], without x_0 where has_static is False
    Returns (...) [same unit]; for one harmonic it is the peak value, for several sqrt(2) times the r.m.s.
    """
    dynamic = coefficients[..., 1:] if has_static else coefficients
    return np.sqrt(np.sum(dynamic**2, axis=-1))


class BranchBuilder:
    """Collects solutions into a Branch."""

    def __init__(self, balance: HarmonicBalance):
        self._balance = balance
        self.omega: list[float] = []
        self.x: list[np.ndarray] = []
        self._rows: list[tuple[np.ndarray, float, str, int]] = []

    def add(self, solution: Solution) -> None:
        """Append one solution, converged or not."""
        state = solution.state
        self.omega.append(state.omega)
        self.x.append(state.x)
        energy = float(self._balance.energy(state).sum())
        self._rows.append((self._balance.outputs(state), energy, solution.outcome, solution.steps))

    def finish(self, end: str) -> Branch:
        """The branch; `end` says why it ends where it ends."""
        response, energy, outcome, steps = zip(*self._rows, strict=True)
        x = np.stack(self.x)
        return Branch(
            omega=np.array(self.omega),
            output_names=self._balance.compliance.output_names,
            response=np.stack(response),
            contact=x.reshape(len(x), -1, x.shape[-1]),
            energy=np.array(energy),
            outcome=outcome,
            newton_steps=np.array(steps),
            end=end,
        )
