"""The highest peak of several outputs of a response that was scanned, such as the tips of all blades of a wheel.

Through three points around a maximum 1 / amplitude^2 is a parabola over the frequency where one resonance acts, since
its amplitude is R / |p - omega| with a complex p. Its vertex foresees the peak; the peaks of other outputs are left out
where they are foreseen lower by some times what the first was missed by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.harmonics import amplitude

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.resonance_peak import AtPeak


@dataclass(frozen=True)
class HighestPeakRules:
    """Which peaks are refined, and when one is met."""

    max_refined: int = 3  # peaks that are refined, the highest first
    candidate_share: float = 0.9  # of the highest peak foreseen, from which on a peak may be the highest
    # errors of the heights foreseen, as the first peak has it, by which another must be lower to be left out
    error_margin: float = 3.0
    least_doubt: float = 5e-3  # of a height foreseen


RULES = HighestPeakRules()


def vertex(omega: np.ndarray, heights: np.ndarray) -> tuple[float, float]:
    """Frequency [rad/s] and height [m] of the peak through three points whose middle one is the highest."""
    top, highest = float(omega[1]), float(heights[1])
    unit = float(abs(omega[2] - omega[0]))
    w = (omega - top) / (unit or 1.0)
    if unit == 0 or np.linalg.matrix_rank(np.vander(w)) < 3:  # no parabola where a curve stands or turns back on itself
        return top, highest
    bend, slope, least = np.polyfit(w, (highest / np.maximum(heights, 1e-6 * highest)) ** 2, 2)
    at = float(np.clip(-0.5 * slope / bend, *sorted((w[0], w[2])))) if bend > 0 else 0.0
    level = least + slope * at + bend * at**2
    if level <= 0:  # no such resonance
        return top, highest
    return top + unit * at, highest / float(np.sqrt(level))


def candidates(omega: np.ndarray, heights: np.ndarray) -> list[tuple[int, int]]:
    """Points and outputs of the peaks that may be the highest, the highest foreseen first; at most RULES.max_refined.

    omega : (n_point,) [rad/s]; heights : (n_point, n_output) [m]"""
    inner, peaks = heights[1:-1], []
    for i, output in np.argwhere((inner >= heights[:-2]) & (inner >= heights[2:]) & (inner > 0)):
        peaks.append((vertex(omega[i : i + 3], heights[i : i + 3, output])[1], int(i) + 1, int(output)))
    peaks.sort(reverse=True)
    return [
        (point, output)
        for height, point, output in peaks[: RULES.max_refined]
        if height > RULES.candidate_share * peaks[0][0]
    ]


def highest(
    balance: HarmonicBalance, branch: Branch, outputs: Sequence[str], site: AtPeak
) -> tuple[OperatingPoint | None, int]:
    """The highest peak of any of the outputs, and which of them; None where no candidate is found.

    branch : the response, points on both sides of its peaks; site : how a peak is searched, whatever its output
    Solves are those of the whole search, points of the branch among them"""
    heights = amplitude(branch.response[:, [*map(branch.output_names.index, outputs)]], branch.harmonics)
    best: OperatingPoint | None = None
    solves, doubt, row = len(heights), RULES.least_doubt, 0
    for point, output in candidates(branch.omega, heights):
        neighbours = slice(point - 1, point + 2)
        omega = branch.omega[neighbours].tolist()
        height = vertex(branch.omega[neighbours], heights[neighbours, output])[1]
        if best is not None and (1 + doubt) * height < best.amplitude:
            continue
        x, site = balance.shaped(branch.contact[point]), replace(site, output=outputs[output])
        peak = site.solve_between(balance, omega[1], x, min(omega), max(omega))
        solves += peak.solves
        if not peak.solution.converged:
            continue
        doubt = max(doubt, RULES.error_margin * abs(height / peak.amplitude - 1))
        if best is None or peak.amplitude > best.amplitude:
            best, row = peak, output
    return None if best is None else replace(best, solves=solves), row
