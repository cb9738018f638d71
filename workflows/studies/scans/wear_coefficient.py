"""The wear coefficient of tests: worn volume over friction work, by regression."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, ORANGE
from tribodyn.workflows.result.number_format import named_lines


@dataclass(frozen=True)
class WearCoefficient:
    """Slope of worn volume over friction work through zero, as the wear law `energy` has it.

    work, volume, deviation : (n,) of the tests [J], [m3], [m3]
    value, error, factor : slope and its standard deviation [m3/J]; of the 95 % interval over that deviation
    offset, offset_error, slope : of the line that need not go through zero [m3], [m3/J]; nan below three tests"""

    work: np.ndarray
    volume: np.ndarray
    deviation: np.ndarray
    value: float
    error: float
    factor: float
    offset: float
    offset_error: float
    slope: float

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval [m3/J]."""
        return self.value - self.factor * self.error, self.value + self.factor * self.error

    def record(self) -> dict[str, Any]:
        low, high = self.interval
        numbers = {
            "value_m3_per_J": self.value, "error_m3_per_J": self.error, "low_m3_per_J": low, "high_m3_per_J": high,
            "offset_m3": self.offset, "offset_error_m3": self.offset_error, "slope_m3_per_J": self.slope,
        }  # fmt: skip
        return {"tests": len(self.work), **{name: None if np.isnan(x) else x for name, x in numbers.items()}}

    def _range(self) -> str:
        low, high = (1e18 * end for end in self.interval)
        n = len(self.work)
        of = f"{n} tests" if n > 1 else "one test, the scatter between tests is not in it"
        return f"95 %: {low:.4g} to {high:.4g}, of {of}"

    def lines(self) -> list[str]:
        rows = [("coefficient", f"{1e18 * self.value:.4g} um3/J, {self._range()}")]
        if np.isfinite(self.slope) and abs(self.offset) > self.factor * self.offset_error:
            note = f"{1e9 * self.offset:.3g} mm³ at no work, slope {1e18 * self.slope:.4g} um3/J: running-in?"
            rows.append(("not through 0", note))
        return named_lines(rows)

    def keys(self) -> list[str]:
        """Table of a scene."""
        return ["[wear]", 'law = "energy"', f'coefficient = "{1e18 * self.value:.5g} um3/J"  # {self._range()}']

    def plot(self) -> Figure:
        """Worn volume of every test over its friction work, with the line through zero and its 95 % interval."""
        work = np.array([0.0, 1.05 * self.work.max()])
        with axes_of() as (figure, axes):
            error = 1.96e9 * self.deviation if self.deviation.any() else None
            axes.errorbar(self.work, 1e9 * self.volume, error, fmt="o", color=ORANGE, capsize=3, label="tests, 95 %")
            axes.plot(work, 1e9 * self.value * work, color=BLUE, label=f"{1e18 * self.value:.4g} µm³/J")
            low, high = self.interval
            label = "95 % of the slope" if len(self.work) > 1 else "95 %, without the scatter between tests"
            axes.fill_between(work, 1e9 * low * work, 1e9 * high * work, color=BLUE, alpha=0.15, lw=0, label=label)
            axes.set(xlabel="friction work / J", ylabel="worn volume / mm³", xlim=(0, None), title="Wear coefficient")
            axes.legend()
        return figure


def regression(work: np.ndarray, volume: np.ndarray, deviation: np.ndarray) -> WearCoefficient:
    """Weighted least squares through zero; what the tests scatter beyond their own deviations widens the interval.

    deviation : (n,) standard deviations of the volumes [m3]; tests count alike where one has none
    Source  Birge, Phys. Rev. 40 (1932) 207, for the scatter; Student's factor of n - 1
    Raises  Refusal: a single volume of unknown deviation"""
    known = bool((deviation > 0).all())
    if len(work) < 2 and not known:
        raise Refusal("a wear coefficient needs two tests, or one whose volume has an error")
    weight = 1 / deviation**2 if known else np.ones(len(work))
    value = float((weight * volume * work).sum() / (weight * work**2).sum())
    n = len(work)
    scatter = float((weight * (volume - value * work) ** 2).sum() / max(n - 1, 1))
    scatter = max(scatter, 1.0) if known else scatter
    error = float(np.sqrt(scatter / (weight * work**2).sum()))
    offset = offset_error = slope = np.nan
    if n > 2 and np.ptp(work) > 0:
        (slope, offset), covariance = np.polyfit(work, volume, 1, w=np.sqrt(weight), cov="unscaled")
        rest = (weight * (volume - offset - slope * work) ** 2).sum() / (n - 2)
        offset_error = float(np.sqrt((max(rest, 1.0) if known else rest) * covariance[1, 1]))
    factor = float(student.ppf(0.975, n - 1)) if n > 1 else 1.96
    return WearCoefficient(work, volume, deviation, value, error, factor, float(offset), offset_error, float(slope))
