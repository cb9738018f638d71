"""The cycle that an operating condition asks for, and the condition of a fixed frequency."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class OperatingPoint:
    """The solution of a vibration cycle.

    amplitude : of the response output [m]; response : (n_output, n_coeff) [m]; solves : balance solves spent"""

    solution: Solution
    amplitude: float
    response: np.ndarray
    solves: int

    @classmethod
    def of(cls, balance: HarmonicBalance, solution: Solution, output: str, solves: int) -> OperatingPoint:
        """A solution with the amplitude of an output."""
        response = balance.outputs(solution.state)
        row = balance.compliance.output_names.index(output)
        return cls(solution, float(amplitude(response[row], balance.basis.harmonics)), response, solves)

    @property
    def state(self) -> State:
        """The solved state."""
        return self.solution.state


@dataclass(frozen=True)
class FrequencyCorrection:
    """How far the frequency of a solved cycle is from that of its condition.

    distance : [rad/s]; solves : spent; accuracy : that the frequency is needed with [rad/s]"""

    distance: float
    solves: int
    accuracy: float = 0.0


@dataclass(frozen=True)
class DominantPeak:
    """Result of a search for a higher peak than the tracked one.

    point : the higher peak, None where the tracked one is the highest; solves : balance solves spent
    nearness : height of the highest other maximum over that of a peak that dominates; 0 where there is none"""

    point: OperatingPoint | None = None
    solves: int = 0
    nearness: float = 0.0


@dataclass(frozen=True)
class AtFrequency:
    """The cycle at a fixed frequency [rad/s]."""

    output: str
    omega: float
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    @single
    def solve(self, balance: HarmonicBalance) -> OperatingPoint:
        """Solve without a neighbour, where necessary along the folded curve of solutions over the load."""
        return OperatingPoint.of(balance, arc_length.solve_along_load(balance, self.omega, self.newton), self.output, 1)

    @single
    def solve_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Solve from a neighbouring x; `omega` is the neighbour's and ignored here.

        Where the neighbour's branch has ended in a fold, the response jumps to the one that a rising load leads to."""
        solution, solves = newton.solve(balance, self.omega, x, self.newton), 1
        if not solution.converged:
            solution, solves = arc_length.solve_along_load(balance, self.omega, self.newton), 2
        return OperatingPoint.of(balance, solution, self.output, solves)

    def dominant_peak(self, balance: HarmonicBalance, point: OperatingPoint) -> DominantPeak:
        """None, without a solve: the frequency is prescribed."""
        return DominantPeak()

    def correction(self, balance: HarmonicBalance, state: State) -> FrequencyCorrection:
        """The distance of a state to the fixed frequency."""
        return FrequencyCorrection(self.omega - state.omega, 0)
