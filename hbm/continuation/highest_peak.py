"""The highest peak of several outputs of a response that was scanned, such as the tips of all blades of a wheel.

Through three points around a maximum 1 / amplitude^2 is a parabola over the frequency where one resonance acts, since
its amplitude is R / |p - omega| with a complex p. The vertex is solved and taken up until it is met; the peaks of other
outputs are left out where they are foreseen lower by some times what the first was missed by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch, amplitude
from tribodyn.hbm.continuation.methods.natural import extrapolate
from tribodyn.hbm.continuation.operating_point import AtPeak, OperatingPoint


@dataclass(frozen=True)
class PeakRules:
    """Which peaks are refined, and when one is met."""

    tried: int = 3  # peaks that are refined, the highest first
    nearly: float = 0.9  # of the highest peak foreseen, from which on a peak may be the highest
    # errors of the heights foreseen, as the first peak has it, by which another must be lower to be left out
    sure: float = 3.0
    least_doubt: float = 5e-3  # of a height foreseen
    level: float = 3e-5  # of the height of a peak, by which a parabola may miss it
    closings: int = 5  # parabolas that are tried


RULES = PeakRules()


@dataclass(frozen=True)
class Sample:
    """Of a response: frequency [rad/s], relative displacement (n_contact, n_coeff) [m], amplitude of an output [m]."""

    omega: float
    x: np.ndarray
    height: float


def vertex(points: Sequence[Sample]) -> tuple[float, float]:
    """Frequency [rad/s] and height [m] of the peak through three points whose middle one is the highest."""
    middle = points[1]
    unit = abs(points[2].omega - points[0].omega)
    w = np.array([point.omega - middle.omega for point in points]) / (unit or 1.0)
    if unit == 0 or np.linalg.matrix_rank(np.vander(w)) < 3:  # no parabola where a curve stands or turns back on itself
        return middle.omega, middle.height
    ratio = np.array([middle.height / max(point.height, 1e-6 * middle.height) for point in points])
    bend, slope, least = np.polyfit(w, ratio**2, 2)
    at = float(np.clip(-0.5 * slope / bend, *sorted((w[0], w[2])))) if bend > 0 else 0.0
    level = least + slope * at + bend * at**2
    if level <= 0:  # no such resonance
        return middle.omega, middle.height
    return middle.omega + unit * at, middle.height / float(np.sqrt(level))


def candidates(omega: np.ndarray, heights: np.ndarray) -> list[tuple[int, int]]:
    """Points and outputs of the peaks that may be the highest, the highest foreseen first; at most RULES.tried.

    omega : (n_point,) [rad/s]; heights : (n_point, n_output) [m]
    """
    inner, none = heights[1:-1], np.empty(0)
    found = []
    for i, output in np.argwhere((inner >= heights[:-2]) & (inner >= heights[2:]) & (inner > 0)):
        three = [Sample(omega[i + k], none, heights[i + k, output]) for k in range(3)]
        found.append((vertex(three)[1], int(i) + 1, int(output)))
    found.sort(reverse=True)
    return [(point, output) for height, point, output in found[: RULES.tried] if height > RULES.nearly * found[0][0]]


def highest(
    balance: HarmonicBalance, branch: Branch, outputs: Sequence[str], site: AtPeak
) -> tuple[OperatingPoint | None, int]:
    """The highest peak of any of the outputs, and which of them; None where no candidate is found.

    branch : the response, points on both sides of its peaks; site : how a peak is searched, whatever its output
    Solves are those of the whole search, points of the branch among them
    """
    heights = amplitude(branch.response[:, [branch.output_names.index(name) for name in outputs]])
    best: OperatingPoint | None = None
    solves, doubt, which = len(heights), RULES.least_doubt, 0
    for point, output in candidates(branch.omega, heights):
        near = slice(point - 1, point + 2)
        points = [
            Sample(*three)
            for three in zip(branch.omega[near], branch.contact[near], heights[near, output], strict=True)
        ]
        height = vertex(points)[1]
        if best is not None and (1 + doubt) * height < best.amplitude:
            continue
        found = refined(balance, points, replace(site, output=outputs[output]))
        solves += found.solves
        if not found.solution.converged:
            continue
        doubt = max(doubt, RULES.sure * abs(height / found.amplitude - 1))
        if best is None or found.amplitude > best.amplitude:
            best, which = found, output
    return None if best is None else replace(best, solves=solves), which


def refined(balance: HarmonicBalance, points: Sequence[Sample], site: AtPeak) -> OperatingPoint:
    """The peak within three points, by parabolas through the nearest ones; by its slope where these do not close in."""
    solves = 0
    shape = (balance.contact.n_pair, -1, balance.basis.n_coeff)
    for _ in range(RULES.closings):
        omega, height = vertex(points)
        if any(abs(omega - point.omega) <= site.tolerance * omega for point in points):  # no vertex of its own
            break
        guess = extrapolate(np.array([p.omega for p in points]), [p.x for p in points], omega)
        solution = newton.solve(balance, omega, guess.reshape(shape), site.newton)
        found = OperatingPoint.of(balance, solution, site.output, solves := solves + 1)
        if not solution.converged:
            break
        if abs(height / found.amplitude - 1) < RULES.level:
            return found
        ordered = sorted((*points, Sample(omega, solution.state.flat, found.amplitude)), key=lambda p: p.omega)
        top = min(max(int(np.argmax([p.height for p in ordered])), 1), len(ordered) - 2)
        points = ordered[top - 1 : top + 2]
    best = max(points, key=lambda point: point.height)
    found = site.next(balance, best.omega, best.x.reshape(shape))
    return replace(found, solves=found.solves + solves)
