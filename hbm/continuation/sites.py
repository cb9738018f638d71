"""Places of a response where cycles are taken: a frequency, the resonance peak, or a fixed ratio to its frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.operating_point import AtFrequency, AtPeak, Correction, OperatingPoint, Overtaking
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class BesidePeak:
    """The cycle at a fixed ratio to the frequency of the resonance peak, which is tracked as `AtPeak` does."""

    peak: AtPeak
    ratio: float

    @property
    def output(self) -> str:
        """Name of the output whose peak is tracked."""
        return self.peak.output

    @property
    def newton(self) -> NewtonOptions:
        """How exactly and how long Newton works."""
        return self.peak.newton

    @single
    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Find the peak, then go to the ratio."""
        return self._beside(balance, self.peak.first(balance))

    @single
    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """From a neighbouring x at the ratio: back to the peak, refine it, and to the ratio again."""
        return self._beside(balance, self.at_peak(balance, omega, x))

    @single
    def overtaken(self, balance: HarmonicBalance, point: OperatingPoint) -> Overtaking:
        """The cycle at the ratio to a peak that has overtaken the tracked one, None where none has."""
        tracked = self.at_peak(balance, point.state.omega, point.state.x)
        higher = self.peak.overtaken(balance, tracked)
        spent = tracked.solves + higher.solves
        if higher.point is None:
            return replace(higher, solves=spent)
        found = self._beside(balance, higher.point)
        return Overtaking(found, spent - higher.point.solves + found.solves, higher.nearness)

    @single
    def correct(self, balance: HarmonicBalance, state: State) -> Correction:
        """The distance of a state to the ratio times the frequency of the peak, which is found from it."""
        at_peak = self.at_peak(balance, state.omega, state.x)
        distance = self.ratio * at_peak.state.omega - state.omega
        accuracy = self.ratio * self.peak.correct(balance, at_peak.state).accuracy
        return Correction(distance, at_peak.solves, accuracy)

    def at_peak(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The peak itself, from an x at the ratio to it."""
        solution, solves = self._walk(balance, omega, omega / self.ratio, x)
        found = self.peak.next(balance, omega / self.ratio, solution.state.x)
        return replace(found, solves=found.solves + solves)

    def _beside(self, balance: HarmonicBalance, peak: OperatingPoint) -> OperatingPoint:
        omega = peak.state.omega
        solution, solves = self._walk(balance, omega, self.ratio * omega, peak.state.x)
        return OperatingPoint.of(balance, solution, self.peak.output, peak.solves + solves)

    def _walk(self, balance: HarmonicBalance, start: float, stop: float, x: np.ndarray) -> tuple[Solution, int]:
        """Natural steps of half a per cent from one frequency to another."""
        count = max(1, int(np.ceil(abs(stop / start - 1) / 5e-3)))
        for omega in np.linspace(start, stop, count + 1):
            solution = newton.solve(balance, omega, x, self.peak.newton)
            if solution.converged:
                x = solution.state.x
        return solution, count + 1


Site = AtFrequency | AtPeak | BesidePeak
