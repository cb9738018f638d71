"""Refine a resonance peak by secants, one solve each, until the slope changes its sign within twice the resolution."""

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

    x : of a solution there, or near it
    stride : first step [rad/s], by default the condition's; limits : of the frequency [rad/s]"""

    def __init__(
        self,
        condition: AtPeak,
        balance: HarmonicBalance,
        omega: float,
        x: np.ndarray,
        stride: float | None = None,
        limits: tuple[float, float] = (0.0, np.inf),
    ):
        self._condition, self._balance = condition, balance
        self._solves = 0
        self._point = self._best = self._solve(omega, x)
        self._previous: AmplitudeSlope | None = None
        self._bracket: tuple[AmplitudeSlope, AmplitudeSlope] | None = None  # the curve rises from both to the other
        self._widths = [np.inf] * 3  # of the brackets so far [rad/s]
        self._share = 1.0  # of the way to the peak in the bracket, halved where a solve fails
        self._limits = max(1e-3 * omega, limits[0]), min(balance.omega_max, limits[1])
        self._stride = condition.first_stride * self._point.width if stride is None else stride
        self._resolution = condition.resolution(self._point)

    def run(self) -> OperatingPoint:
        """The peak, or the point where the search ended, marked as not found.

        Raises  NoPeak where the response still rises at the highest frequency that is modelled"""
        if not self._point.solution.converged:
            return self._result(self._point.solution)
        while self._solves < MAX_SOLVES and (target := self._target()) is not None:
            near = min(self._bracket or (self._point,), key=lambda point: abs(point.omega - target))
            following = self._solve(target, near.predict(target))
            if following.solution.converged:
                self._advance(following)
            elif not self._shorten(target):
                break
        return self._result(self._checked())

    def _solve(self, omega: float, guess: np.ndarray) -> AmplitudeSlope:
        self._solves += 1
        solution = newton.solve(self._balance, omega, guess, self._condition.newton)
        return AmplitudeSlope.of(self._balance, solution, self._condition.output)

    def _target(self) -> float | None:
        """Frequency of the next solve, at least the resolution away from others; None where it tells nothing more."""
        point, previous, step = self._point, self._previous, self._resolution
        side = float(np.sign(point.slope))
        if self._bracket:
            low, high = sorted(end.omega for end in self._bracket)
            if high - low <= 2 * step:
                return None
            peak = self._bracket[0].zero_with(self._bracket[1])
            if previous is not None and abs(previous.omega - point.omega) < high - low:  # the last two are closer
                peak = previous.zero_with(point)
            if not low < peak < high or self._widths[-1] > 0.5 * self._widths[-4]:  # a kink; brackets do not shrink
                peak = 0.5 * (low + high)
            target = point.omega + self._share * (float(np.clip(peak, low + step, high - step)) - point.omega)
        elif previous is None:
            distance = abs(point.distance)
            target = point.omega + side * max(distance if distance < 20 * self._stride else self._stride, step)
        else:  # extrapolate the slope, never further than a few strides and always uphill
            reach = abs(point.omega - previous.omega)
            zero = (previous.zero_with(point) - point.omega) * side
            target = point.omega + side * (min(max(zero, step), 8 * reach) if zero > 0 else 3 * reach)
        target = float(np.clip(target, *self._limits))
        return None if abs(target - point.omega) < 0.5 * step else target

    def _advance(self, following: AmplitudeSlope) -> None:
        """Continue from a solved point."""
        self._share = 1.0
        if self._bracket:
            low, high = self._bracket
            self._bracket = (following, high) if following.slope * low.slope > 0 else (low, following)
        elif following.slope * self._point.slope <= 0:
            self._bracket = self._point, following
        if self._bracket:
            self._widths.append(abs(self._bracket[0].omega - self._bracket[1].omega))
        self._previous, self._point = self._point, following
        self._best = min(self._bracket or (self._best, following), key=lambda point: abs(point.distance))
        self._resolution = self._condition.resolution(self._best)

    def _shorten(self, target: float) -> bool:
        """Shorten the next step after a solve that failed or lies on another branch; False where it is short enough."""
        if self._bracket:
            self._share *= 0.5
            return self._share * self._widths[-1] > self._condition.near_peak * self._best.width
        self._stride, self._previous = 0.25 * min(self._stride, abs(target - self._point.omega)), None
        return self._stride >= self._resolution

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
        if min(best.miss, self._widths[-1] / best.width) <= self._condition.near_peak:  # sampled forces have kinks
            return best.solution
        detail = f" {self._solves} solves: the curve ends at {hertz:.5g} Hz, where it still {rises}"
        return replace(best.solution, outcome=SolveEnd.SITE_NOT_FOUND.say(detail))

    def _result(self, solution: Solution) -> OperatingPoint:
        return OperatingPoint.of(self._balance, solution, self._condition.output, self._solves)
