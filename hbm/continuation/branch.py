"""What a continuation returns: solution points, the outcome of each, and how the curve ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import BranchEnd, Outcome, SolveEnd


@dataclass(frozen=True)
class Branch:
    """Points of a response curve in the order they were found.

    omega : (n_point,) excitation frequency [rad/s]
    output_names : names of the observed outputs
    response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m]
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point CONVERGED, or what went wrong
    newton_steps : (n_point,) Newton steps spent
    end : why and where the branch ends; its text is a sentence
    folds : indices of the points that are folds, where the branch turns back
    parameter_name : what was stepped; parameter : (n_point,) its values, the same as omega where it is the frequency
    """

    omega: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[Outcome[SolveEnd], ...]
    newton_steps: np.ndarray
    end: Outcome[BranchEnd]
    folds: tuple[int, ...] = ()
    parameter_name: str = "frequency"
    parameter: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def ended(self) -> BranchEnd:
        """Why the branch ends."""
        return self.end.kind

    @property
    def converged(self) -> np.ndarray:
        """(n_point,) whether the point is a solution."""
        return np.array([outcome.kind is SolveEnd.CONVERGED for outcome in self.outcome])

    @property
    def frequency(self) -> np.ndarray:
        """(n_point,) excitation frequency [Hz]."""
        return self.omega / (2 * np.pi)

    def amplitude(self, output: str) -> np.ndarray:
        """(n_point,) vibration amplitude of an output, see `amplitude` [m]."""
        return amplitude(self.response[:, self.output_names.index(output)])


def amplitude(coefficients: np.ndarray) -> np.ndarray:
    """Vibration amplitude of Fourier coefficients: square root of the sum over harmonics of a_h^2 + b_h^2.

    coefficients : (..., n_coeff), [x_0, a_1, b_1, ...]; an even number of them is without x_0
    Returns (...) [same unit]; for one harmonic it is the peak value, for several sqrt(2) times the r.m.s.
    """
    dynamic = coefficients[..., coefficients.shape[-1] % 2 :]
    return np.sqrt(np.sum(dynamic**2, axis=-1))


class BranchBuilder:
    """Collects solutions into a Branch.

    parameter : what the continuation steps in
    """

    def __init__(self, parameter: Parameter):
        self._parameter = parameter
        self.value: list[float] = []
        self.x: list[np.ndarray] = []
        self.folds: list[int] = []
        self._rows: list[tuple[float, np.ndarray, float, Outcome[SolveEnd], int]] = []
        self._output_names: tuple[str, ...] = ()

    def add(self, value: float, solution: Solution, fold: bool = False) -> None:
        """Append one solution, converged or not, at a value of the parameter."""
        state = solution.state
        balance, _ = self._parameter.place(value)
        self.value.append(value)
        self.x.append(state.x)
        if fold:
            self.mark_fold()
        self._output_names = balance.compliance.output_names
        energy = float(balance.energy(state).sum())
        self._rows.append((state.omega, balance.outputs(state), energy, solution.outcome, solution.steps))

    def mark_fold(self) -> None:
        """Mark the last point as a fold."""
        if len(self.value) - 1 not in self.folds:
            self.folds.append(len(self.value) - 1)

    def truncate(self, n_point: int) -> None:
        """Keep the first points only."""
        del self.value[n_point:], self.x[n_point:], self._rows[n_point:]
        self.folds = [i for i in self.folds if i < n_point]

    def finish(self, end: Outcome[BranchEnd]) -> Branch:
        """The branch; `end` says why it ends where it ends."""
        omega, response, energy, outcome, steps = zip(*self._rows, strict=True)
        x = np.stack(self.x)
        return Branch(
            omega=np.array(omega),
            output_names=self._output_names,
            response=np.stack(response),
            contact=x.reshape(len(x), -1, x.shape[-1]),
            energy=np.array(energy),
            outcome=outcome,
            newton_steps=np.array(steps),
            end=end,
            folds=tuple(self.folds),
            parameter_name=self._parameter.name,
            parameter=np.array(self.value),
        )
