"""Where the cycle is taken: at a fixed frequency, or at the resonance peak, which is tracked directly.

The peak is the zero of d A^2 / d omega along the branch, with dx/d omega from the linearised balance; no sweep is needed
once a neighbouring peak is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hbm import newton
from hbm.balance import HarmonicBalance, State
from hbm.branch import CONVERGED, amplitude
from hbm.continuation import natural
from hbm.newton import NewtonOptions, Solution


@dataclass(frozen=True)
class OperatingPoint:
    """A solution that the vibration cycle is taken from.

    amplitude : of the response output [m]; response : (n_output, n_coeff) [m]; solves : balance solves spent
    """

    solution: Solution
    amplitude: float
    response: np.ndarray
    solves: int

    @property
    def state(self) -> State:
        """The solved state."""
        return self.solution.state


@dataclass(frozen=True)
class AtFrequency:
    """The cycle at a fixed frequency [rad/s]."""

    output: str
    omega: float
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Solve without a neighbour."""
        return _point(balance, newton.solve_from_rest(balance, self.omega, self.newton), self.output, 1)

    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Solve from a neighbouring x; `omega` is the neighbour's and ignored here."""
        solution, solves = newton.solve(balance, self.omega, x, self.newton), 1
        if not solution.converged:
            solution, solves = newton.solve_from_rest(balance, self.omega, self.newton), 2
        return _point(balance, solution, self.output, solves)


@dataclass(frozen=True)
class AtPeak:
    """The cycle at the resonance peak of an output.

    start, stop : range that the first search scans [rad/s], n_scan : its points; it starts at `start`
    tolerance : relative, on the frequency of the peak
    """

    output: str
    start: float
    stop: float
    n_scan: int = 60
    tolerance: float = 1e-6
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Scan the range, then refine its highest point."""
        branch = natural.follow(balance, self.start, self.stop, natural.Options(self.n_scan, newton=self.newton))
        height = branch.amplitude(self.output, balance.basis.has_static)
        best = int(np.argmax(np.where([o == CONVERGED for o in branch.outcome], height, -1.0)))
        x = branch.contact[best].reshape(balance.parameters.n_pair, -1, balance.basis.n_coeff)
        width = abs(self.stop - self.start) / (self.n_scan - 1)
        found = self._refine(balance, branch.omega[best], x, 0.5 * width)
        return OperatingPoint(found.solution, found.amplitude, found.response, found.solves + len(branch.omega))

    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Refine from a neighbouring peak."""
        return self._refine(balance, omega, x, 1e-3 * omega)

    def _refine(self, balance: HarmonicBalance, omega: float, x: np.ndarray, stride: float) -> OperatingPoint:
        def solve(w: float, guess: np.ndarray) -> _Slope:
            solution = newton.solve(balance, w, guess, self.newton)
            return _Slope.of(balance, solution, self.output)

        here = solve(omega, x)
        solves = 1
        if not here.solution.converged:
            return _point(balance, here.solution, self.output, solves)
        side = np.sign(here.slope)
        low_bound, high_bound = 1e-3 * omega, balance.omega_max
        while True:  # walk uphill until the slope changes sign
            target = float(np.clip(here.omega + side * stride, low_bound, high_bound))
            there = solve(target, here.predict(target))
            solves += 1
            if not there.solution.converged:
                stride *= 0.25
                if stride < self.tolerance * omega:
                    return _point(balance, here.solution, self.output, solves)
                continue
            if there.slope * side <= 0 or target in (low_bound, high_bound):
                break
            here, stride = there, 2.0 * stride
        a, b = here, there
        best = a if abs(a.slope) < abs(b.slope) else b
        weight_a = weight_b = 1.0
        while abs(b.omega - a.omega) > self.tolerance * omega and solves < 60:
            share = weight_a * a.slope / (weight_a * a.slope - weight_b * b.slope)
            w = a.omega + min(max(share, 0.02), 0.98) * (b.omega - a.omega)
            nearest = a if abs(w - a.omega) < abs(w - b.omega) else b
            c = solve(w, nearest.predict(w))
            solves += 1
            if not c.solution.converged:
                break
            moved = abs(c.omega - best.omega)
            best = c
            if c.slope * side > 0:  # Illinois: halve the weight of an end that stays
                a, weight_a, weight_b = c, 1.0, 0.5 * weight_b
            else:
                b, weight_b, weight_a = c, 1.0, 0.5 * weight_a
            if moved <= self.tolerance * omega:
                break
        return _point(balance, best.solution, self.output, solves)


@dataclass(frozen=True)
class _Slope:
    """A solved point with d A^2 / d omega and d x / d omega."""

    solution: Solution
    omega: float
    slope: float
    dx: np.ndarray

    @classmethod
    def of(cls, balance: HarmonicBalance, solution: Solution, output: str) -> _Slope:
        state = solution.state
        slope_r, slope_y = balance.frequency_slope(state)
        linear = balance.linearise(state)
        dx = linear.solve(-slope_r, 1e-8)[0]
        dy = slope_y + balance.at(state.omega).outputs(linear.departure_slope(dx))
        row = balance.compliance.output_names.index(output)
        y = balance.outputs(state)[row]
        dynamic = balance.basis.order > 0
        return cls(solution, state.omega, float(2 * y[dynamic] @ dy[row][dynamic]), dx.reshape(state.x.shape))

    def predict(self, omega: float) -> np.ndarray:
        return self.solution.state.x + (omega - self.omega) * self.dx


def _point(balance: HarmonicBalance, solution: Solution, output: str, solves: int) -> OperatingPoint:
    response = balance.outputs(solution.state)
    row = balance.compliance.output_names.index(output)
    return OperatingPoint(solution, float(amplitude(response[row], balance.basis.has_static)), response, solves)


Site = AtFrequency | AtPeak
