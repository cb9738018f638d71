"""Refine a resonance peak: the zero of the slope of the amplitude, by secants and Hermite cubics, one solve a step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import SolveEnd
from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.resonance_peak import AtPeak

MAX_SOLVES = 60


class NoPeak(Refusal):
    """The response has no maximum inside its range; the message says where it rises, `branch` is what was scanned."""

    def __init__(self, sentence: str, branch: Branch | None = None) -> None:
        super().__init__(sentence)
        self.branch = branch

    def spread(self, balance: HarmonicBalance) -> dict[float, np.ndarray]:
        """Frequency -> x at the ends and in the middle of the response of a balance [rad/s, m]; empty without one."""
        branch = self.branch
        if branch is None or branch.harmonics != balance.basis.harmonics or not branch.converged.any():
            return {}
        omega, x = branch.omega[branch.converged], branch.contact[branch.converged]
        nearest = {int(np.argmin(np.abs(omega - place))): None for place in np.linspace(omega[0], omega[-1], 3)}
        return {float(omega[i]): balance.shaped(x[i]) for i in nearest}


class PeakRefinement:
    """The search from one frequency [rad/s].

    known : x by frequency, of the start and of points that are solved already, no fold among them
    stride : first step [rad/s], by default the condition's; limits : of the frequency [rad/s]"""

    def __init__(
        self,
        condition: AtPeak,
        balance: HarmonicBalance,
        omega: float,
        solved_x: dict[float, np.ndarray],
        stride: float | None = None,
        limits: tuple[float, float] = (0.0, np.inf),
    ):
        self._condition, self._balance, self._solved_x = condition, balance, solved_x
        self._solves = 0
        self._point = self._best = self._solve(omega, solved_x[omega])
        self._previous: AmplitudeSlope | None = None
        self._bracket: tuple[AmplitudeSlope, AmplitudeSlope] | None = None  # the curve rises from both to the other
        self._share = 1.0  # of the way to the peak in the bracket, halved where a solve fails
        self._limits = max(1e-3 * omega, limits[0]), min(balance.omega_max, limits[1])
        self._bounds = limits
        self._stride = condition.first_stride * self._point.width if stride is None else stride
        self._resolution = condition.resolution(self._point)

    def run(self) -> OperatingPoint:
        """The peak, or the point where the search ended, marked as not found.

        Raises  NoPeak where the response still rises at the highest frequency that is modelled"""
        if not self._point.solution.converged:
            return self._result(self._point.solution)
        while self._solves < MAX_SOLVES and abs(self._best.distance) > self._resolution:
            target = self._target()
            if target is None or abs(target - self._best.omega) <= self._resolution:
                break
            guess = self._bracket[0].between(self._bracket[1], target) if self._bracket else self._point.predict(target)
            following = self._solve(target, self._solved_x.get(target, guess))
            rises_on = target in self._solved_x and following.slope * self._point.slope > 0
            if following.solution.converged and not rises_on:
                self._advance(following)
            elif not self._shorten(target):
                break
        return self._result(self._checked())

    def _solve(self, omega: float, guess: np.ndarray) -> AmplitudeSlope:
        self._solves += 1
        solution = newton.solve(self._balance, omega, guess, self._condition.newton)
        return AmplitudeSlope.of(self._balance, solution, self._condition.output)

    def _target(self) -> float | None:
        """Frequency of the next solve; None where the bracket is as narrow as the resolution."""
        point, previous = self._point, self._previous
        side = float(np.sign(point.slope))
        bound = self._bounds[int(side > 0)]
        if self._bracket:
            low, high = sorted(end.omega for end in self._bracket)
            if high - low <= self._resolution:  # as at a kink, where no slope vanishes
                return None
            peak = self._bracket[0].peak_before(self._bracket[1])
            if previous is not None and abs(previous.omega - point.omega) < high - low:  # the last two are closer
                zero = previous.zero_with(point)
                peak = zero if low < zero < high else peak
            target = point.omega + self._share * (peak - point.omega)
        elif previous is None and bound in self._solved_x:
            target = bound
        elif previous is None:
            target = point.omega + (point.distance if abs(point.distance) < 20 * self._stride else side * self._stride)
        else:  # extrapolate the slope, never further than a few strides and always uphill
            reach = abs(point.omega - previous.omega)
            zero = (previous.zero_with(point) - point.omega) * side
            target = point.omega + side * (min(zero, 8 * reach) if zero > 0 else 3 * reach)
        return float(np.clip(target, *self._limits))

    def _advance(self, following: AmplitudeSlope) -> None:
        """Continue from a solved point."""
        self._share = 1.0
        if self._bracket:
            low, high = self._bracket
            self._bracket = (following, high) if following.slope * low.slope > 0 else (low, following)
        elif following.slope * self._point.slope <= 0:
            self._bracket = self._point, following
        self._previous, self._point = self._point, following
        if following.miss <= self._best.miss:
            self._best, self._resolution = following, self._condition.resolution(following)

    def _shorten(self, target: float) -> bool:
        """Shorten the next step after a solve that failed or lies on another branch; False where it is short enough."""
        self._solved_x = {}
        if self._bracket:
            self._share *= 0.5
            return self._miss > self._condition.near_peak
        self._stride, self._previous = 0.25 * min(self._stride, abs(target - self._point.omega)), None
        return self._stride >= self._resolution

    @property
    def _miss(self) -> float:
        """Distance of the best point to the peak in widths, or the width of the bracket."""
        between = abs(self._bracket[0].omega - self._bracket[1].omega) if self._bracket else np.inf
        return min(self._best.miss, between / self._best.width)

    def _checked(self) -> Solution:
        """The best point, with the outcome of the search."""
        best, omega_max = self._best, self._balance.omega_max
        if self._bracket is None and best.slope > 0 and best.omega >= (1 - 1e-9) * omega_max:
            raise NoPeak(
                f"the resonance peak of {self._condition.output} has moved beyond {omega_max / (2 * np.pi):.5g} Hz, "
                "the highest frequency that is modelled: extend response.frequency"
            )
        hertz, rises = best.omega / (2 * np.pi), "rises" if best.slope > 0 else "falls"
        if best.omega > self._condition.max_growth * best.width and best.miss > self._condition.tolerance:
            return replace(best.solution, outcome=SolveEnd.UNLIMITED.say(f" {hertz:.5g} Hz"))
        if self._miss <= self._condition.near_peak:  # sampled forces have kinks, where the slope jumps
            return best.solution
        detail = f" {self._solves} solves: the curve ends at {hertz:.5g} Hz, where it still {rises}"
        return replace(best.solution, outcome=SolveEnd.SITE_NOT_FOUND.say(detail))

    def _result(self, solution: Solution) -> OperatingPoint:
        return OperatingPoint.of(self._balance, solution, self._condition.output, self._solves)
