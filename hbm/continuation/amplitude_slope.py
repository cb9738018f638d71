"""Slope of the vibration amplitude along a response curve, and what it tells of the peak nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.bordered import Direction
from tribodyn.hbm.harmonics import amplitude, amplitude_slope
from tribodyn.hbm.linearisation import Linearisation
from tribodyn.hbm.newton import Solution


@dataclass(frozen=True)
class AmplitudeSlope:
    """A solved point with d A^2 / d omega and d x / d omega, or along another tangent of its curve.

    height : of the output [m]
    distance : to the peak [rad/s], were the response that of one mode, y = R / (p - omega)
    width : half width of the resonance at its peak, abs(p - omega) elsewhere [rad/s]"""

    solution: Solution
    omega: float
    slope: float
    height: float
    distance: float
    width: float
    dx: np.ndarray

    @property
    def miss(self) -> float:
        """Distance to the peak in widths: the cosine between the response and its derivative, 0 at the peak."""
        return abs(self.distance) / self.width

    @classmethod
    def of(cls, balance: HarmonicBalance, solution: Solution, output: str) -> AmplitudeSlope:
        """The slope over the frequency."""
        slope_r, _ = balance.frequency_slope(solution.state)
        linear = balance.linearise(solution.state)
        tangent = Direction(linear.solve_refined(-slope_r, 1e-8), 1.0)
        return cls.on_tangent(balance, linear, solution, output, tangent)

    @classmethod
    def on_tangent(
        cls, balance: HarmonicBalance, linear: Linearisation, solution: Solution, output: str, tangent: Direction
    ) -> AmplitudeSlope:
        """The slope along a tangent of the curve; distance and width in lengths of that."""
        state, dx = solution.state, tangent.x
        _, slope_y = balance.frequency_slope(state)
        dy = tangent.p * slope_y + balance.at(state.omega).outputs(linear.departure_slope(dx))
        row = balance.compliance.output_names.index(output)
        y = balance.outputs(state)[row]
        turn, harmonics = dy[row][balance.basis.order > 0], balance.basis.harmonics
        height, steepness = float(amplitude(y, harmonics)), turn @ turn
        product = height * float(amplitude_slope(y, harmonics) @ dy[row])
        distance = product / steepness if steepness > 0 else 0.0
        width = height / np.sqrt(steepness) if steepness > 0 else state.omega
        move = dx.reshape(state.x.shape)
        return cls(solution, state.omega, float(2 * product), height, float(distance), float(width), move)

    def predict(self, omega: float) -> np.ndarray:
        """x at a frequency, along the tangent."""
        return self.solution.state.x + (omega - self.omega) * self.dx

    def zero_with(self, other: AmplitudeSlope) -> float:
        """Where a straight line through the distances of two points vanishes [rad/s].

        Distances of one mode lie on a line, slopes do not"""
        fa, fb = self.distance, other.distance
        return (self.omega * fb - other.omega * fa) / (fb - fa) if fa != fb else 0.5 * (self.omega + other.omega)
