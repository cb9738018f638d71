"""Conditions of a cycle: a frequency, the resonance peak, or a fixed ratio to the frequency of the peak."""

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.operating_point import AtFrequency, DominantPeak, FrequencyCorrection, OperatingPoint
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class AtPeakRatio:
    """The cycle at a fixed ratio to the frequency of the resonance peak, which is tracked as `AtPeak` does."""

    peak: AtPeak
    ratio: float

    @property
    def output(self) -> str:
        """Name of the output whose peak is tracked."""
        return self.peak.output

    @property
    def newton(self) -> NewtonOptions:
        """Accuracy and limits of Newton's method."""
        return self.peak.newton

    @single
    def solve(self, balance: HarmonicBalance) -> OperatingPoint:
        """Find the peak, then go to the ratio."""
        return self._at_ratio(balance, self.peak.solve(balance))

    @single
    def solve_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """From a neighbouring x at the ratio: back to the peak, refine it, and to the ratio again."""
        return self._at_ratio(balance, self.peak_near(balance, omega, x))

    @single
    def dominant_peak(self, balance: HarmonicBalance, point: OperatingPoint) -> DominantPeak:
        """The cycle at the ratio to a peak that dominates the tracked one, None where none does."""
        tracked = self.peak_near(balance, point.state.omega, point.state.x)
        higher = self.peak.dominant_peak(balance, tracked)
        solves = tracked.solves + higher.solves
        if higher.point is None:
            return replace(higher, solves=solves)
        cycle = self._at_ratio(balance, higher.point)
        return DominantPeak(cycle, solves - higher.point.solves + cycle.solves, higher.nearness)

    @single
    def correction(self, balance: HarmonicBalance, state: State) -> FrequencyCorrection:
        """The distance of a state to the ratio times the frequency of the peak, which is found from it."""
        peak = self.peak_near(balance, state.omega, state.x)
        distance = self.ratio * peak.state.omega - state.omega
        accuracy = self.ratio * self.peak.correction(balance, peak.state).accuracy
        return FrequencyCorrection(distance, peak.solves, accuracy)

    def peak_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The peak itself, from an x at the ratio to it."""
        solution, solves = self._step_to(balance, omega, omega / self.ratio, x)
        peak = self.peak.solve_near(balance, omega / self.ratio, solution.state.x)
        return replace(peak, solves=peak.solves + solves)

    def _at_ratio(self, balance: HarmonicBalance, peak: OperatingPoint) -> OperatingPoint:
        omega = peak.state.omega
        solution, solves = self._step_to(balance, omega, self.ratio * omega, peak.state.x)
        return OperatingPoint.of(balance, solution, self.peak.output, peak.solves + solves)

    def _step_to(self, balance: HarmonicBalance, start: float, stop: float, x: np.ndarray) -> tuple[Solution, int]:
        """Natural steps of half a per cent from one frequency to another."""
        count = max(1, int(np.ceil(abs(stop / start - 1) / 5e-3)))
        for omega in np.linspace(start, stop, count + 1):
            solution = newton.solve(balance, omega, x, self.peak.newton)
            if solution.converged:
                x = solution.state.x
        return solution, count + 1


OperatingCondition = AtFrequency | AtPeak | AtPeakRatio
