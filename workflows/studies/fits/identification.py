"""Fit named parameters to measured numbers, within bounds, and say how well the numbers determine them.

Nothing is tuned in silence: a fit keeps the predictions before and after it, which parameters ended at a bound, how
each number depends on each parameter, and how far the numbers leave the parameters open."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from tribodyn.refusal import Refusal, SolverFailure

AT_BOUND = 1e-3  # of the width of the bounds: nearer than this counts as at the bound
OPEN = 0.3  # relative standard error beyond which a parameter counts as not determined

Prediction = Callable[[Mapping[str, float]], np.ndarray]


@dataclass(frozen=True)
class FitParameter:
    """A number that is fitted. low, high : bounds; starts : one or several; unit : of all of them, for the report.

    ratio : the unknown is its logarithm, for positive numbers known to their order only; else it counts in `high - low`
    """

    name: str
    low: float
    high: float
    starts: tuple[float, ...]
    unit: str = ""
    ratio: bool = True

    def __post_init__(self) -> None:
        if not (self.low < self.high and all(self.low <= start <= self.high for start in self.starts) and self.starts):
            raise Refusal(f"parameter {self.name}: give bounds low < high and starts between them")
        if self.ratio and self.low <= 0:
            raise Refusal(f"parameter {self.name}: a ratio needs bounds above 0, not {self.low}")

    def scaled(self, value: float) -> float:
        """Its unknown."""
        return float(np.log(value)) if self.ratio else value / (self.high - self.low)

    def value(self, unknown: float) -> float:
        """The parameter of an unknown."""
        return float(np.clip(np.exp(unknown) if self.ratio else unknown * (self.high - self.low), self.low, self.high))


@dataclass(frozen=True)
class MeasuredNumber:
    """A measured number, above 0.

    weight : of its logarithmic residual ln(predicted / measured)"""

    name: str
    value: float
    unit: str = ""
    weight: float = 1.0


@dataclass(frozen=True)
class Identification:
    """Result of a fit.

    origin, values : (n_parameter,) before and after; before, after : (n_measured,) predictions there
    sensitivity : (n_measured, n_parameter) d ln(predicted) / d ln(parameter), or / d parameter in widths of its bounds
    deviation : (n_parameter,) standard error in the same units, from what the fit leaves; inf where nothing tells
    roughness : how many times wider these are than the curvature of the sum of squares at the best fit says"""

    parameters: tuple[FitParameter, ...]
    measured: tuple[MeasuredNumber, ...]
    values: np.ndarray
    before: np.ndarray
    after: np.ndarray
    sensitivity: np.ndarray
    deviation: np.ndarray
    evaluations: int
    origin: np.ndarray
    roughness: float = 1.0

    @property
    def rms(self) -> float:
        """Root mean square of the relative errors that are left."""
        return float(np.sqrt(np.mean(np.log(self.after / [m.value for m in self.measured]) ** 2)))

    def named(self) -> dict[str, float]:
        """The parameters found."""
        return {p.name: float(v) for p, v in zip(self.parameters, self.values, strict=True)}

    def verdict(self, i: int) -> str:
        """What can be said about a parameter, in words."""
        p, value = self.parameters[i], self.values[i]
        width = p.scaled(p.high) - p.scaled(p.low)
        bounds = (("lower", p.low), ("upper", p.high))
        bound = next((w for w, b in bounds if abs(p.scaled(value) - p.scaled(b)) < AT_BOUND * width), None)
        if bound is not None:
            return f"at its {bound} bound"
        if self.deviation[i] > OPEN:
            return "not determined by these numbers"
        if len(self.measured) <= len(self.parameters):
            return "as many numbers as parameters: no error to tell its own from"
        return f"+- {100 * self.deviation[i]:.2g} %" + ("" if p.ratio else " of the bounds' width")

    def record(self) -> dict[str, object]:
        """The same as the report, for machines; what is open is None."""
        return {
            "parameters": [
                {
                    "name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "before": float(self.origin[i]),
                    "found": float(self.values[i]), "verdict": self.verdict(i),
                    "deviation": float(self.deviation[i]) if np.isfinite(self.deviation[i]) else None,
                }
                for i, p in enumerate(self.parameters)
            ],
            "numbers": [
                {
                    "name": m.name, "unit": m.unit, "measured": m.value, "before": float(self.before[i]),
                    "after": float(self.after[i]), "sensitivity": [float(s) for s in self.sensitivity[i]],
                }
                for i, m in enumerate(self.measured)
            ],
            "rms": self.rms, "evaluations": self.evaluations, "roughness": self.roughness,
        }  # fmt: skip

    def report(self) -> str:
        """Tables of parameters, of numbers before and after, and of sensitivities."""
        wide = max(24, *(len(p.name) + 2 for p in self.parameters))
        lines = [f"{'parameter':{wide}}{'before':>12}{'found':>12}  {'unit':8} verdict"]
        for i, p in enumerate(self.parameters):
            lines.append(f"{p.name:{wide}}{self.origin[i]:12.4g}{self.values[i]:12.4g}  {p.unit:8} {self.verdict(i)}")
        names = "".join(f"{p.name:>{max(14, len(p.name) + 2)}}" for p in self.parameters)
        called = [f"{m.name} [{m.unit}]" if m.unit else m.name for m in self.measured]
        wide = max(30, *(len(name) + 2 for name in called))
        head = "".join(f"{name:>11}" for name in ("measured", "before", "after"))
        lines += ["", f"{'number':{wide}}{head}{'error':>10}   sensitivity to{names}"]
        for i, m in enumerate(self.measured):
            error = f"{100 * (self.after[i] / m.value - 1):+.1f} %"
            slopes = "".join(
                f"{self.sensitivity[i, j]:{max(14, len(p.name) + 2)}.3f}" for j, p in enumerate(self.parameters)
            )
            numbers = "".join(f"{value:11.4g}" for value in (m.value, self.before[i], self.after[i]))
            lines.append(f"{called[i]:{wide}}{numbers}{error:>10}   {'':14}{slopes}")
        lines.append(f"root mean square of the errors: {100 * self.rms:.2f} %; {self.evaluations} evaluations")
        if round(self.roughness, 1) > 1:
            text = f"the sum of squares is bumpy or bent beside the best fit: the errors are {self.roughness:.2g} times"
            lines.append(f'{text} those of its curvature; harmonics.transitions = "located" makes it smooth')
        return "\n".join(lines)


def fit(
    parameters: Sequence[FitParameter],
    measured: Sequence[MeasuredNumber],
    predict: Prediction,
    slopes: Prediction,
    before: Mapping[str, float] | None = None,
) -> Identification:
    """Least squares of logarithmic residuals, from every combination of starts; the best is kept.

    What is not fitted to rounding is fitted from one and two thirds of the way between the bounds too, and tried along
    the axes of its error ellipsoid up to eight standard errors away: what is better there is where a fit starts
    anew, and the errors are those of the flattest parabola from the best fit to one of these points.

    predict : parameters by name -> (n_measured,) predictions, above 0
    slopes : parameters by name -> (n_measured, n_parameter) derivatives of the predictions made last
    before : the parameters as they were, for the report; the first starts by default
    Raises  Refusal where a prediction at a start is not a positive number, or a measured number is not
    Source  bounded trust region: Branch, Coleman, Li 1999, as in scipy.optimize.least_squares"""
    parameters, measured = tuple(parameters), tuple(measured)
    target, weight = np.array([[m.value, m.weight] for m in measured]).T
    if not (target > 0).all():
        raise Refusal("an identification needs measured numbers above 0")
    count = 0

    def named(unknowns: np.ndarray) -> dict[str, float]:
        return {p.name: p.value(float(u)) for p, u in zip(parameters, unknowns, strict=True)}

    def predicted(unknowns: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        numbers = np.asarray(predict(named(unknowns)), dtype=float)
        if numbers.shape != target.shape or not (numbers > 0).all():
            raise Refusal(
                f"the model predicts {numbers.tolist()} instead of {len(target)} numbers above 0: narrow the bounds"
            )
        return numbers

    first_values = {p.name: p.starts[0] for p in parameters} if before is None else before
    origin = np.array([p.scaled(first_values[p.name]) for p in parameters])
    predicted_first = predicted(origin)
    last = origin, predicted_first  # where, and what was predicted there

    def residual(unknowns: np.ndarray) -> np.ndarray:
        nonlocal last
        if not np.array_equal(last[0], unknowns):
            last = unknowns.copy(), predicted(unknowns)
        return weight * np.log(last[1] / target)

    def slope(unknowns: np.ndarray) -> np.ndarray:
        """(n_measured, n_parameter) derivatives of the residuals by the unknowns."""
        residual(unknowns)
        values = named(unknowns)
        scale = [values[p.name] if p.ratio else p.high - p.low for p in parameters]
        return np.asarray(slopes(values) * scale * (weight / last[1])[:, None])

    low, high = np.array([p.scaled(p.low) for p in parameters]), np.array([p.scaled(p.high) for p in parameters])
    within = low + 1e-6 * (high - low), high - 1e-6 * (high - low)

    def end(start: np.ndarray) -> OptimizeResult:
        return least_squares(residual, np.clip(start, *within), slope, (low, high), xtol=1e-6)

    starts = product(*([p.scaled(value) for value in p.starts] for p in parameters))
    best, roughness = min((end(np.array(x)) for x in starts), key=_squares), 1.0
    if len(target) > len(parameters) and _squares(best) > 1e-8 * len(target):  # else it fits to rounding
        for share in (1 / 3, 2 / 3):
            with suppress(SolverFailure):
                best = min(best, end(low + share * (high - low)), key=_squares)
        for _ in range(2 * len(parameters)):
            lowest, at, curvature = _squares(best), best.x, 1.0
            for way, parabola in _ways(best, low, high):
                with suppress(SolverFailure):
                    squares = float(np.sum(residual(best.x + way) ** 2))
                    rise = max(squares - _squares(best), 0.0)
                    curvature = min(curvature, rise / parabola if parabola > 0 else 1.0)
                    lowest, at = min((lowest, at), (squares, best.x + way), key=lambda trial: trial[0])
            if at is best.x:
                break
            best = min(best, end(at), key=_squares)
        roughness = float(np.sqrt(1 / curvature)) if curvature > 0 else np.inf
    return Identification(
        parameters,
        measured,
        np.array(list(named(best.x).values())),
        predicted_first,
        target * np.exp(best.fun / weight),
        best.jac / weight[:, None],
        roughness * _deviation(best.jac, _squares(best)),
        count,
        np.array([first_values[p.name] for p in parameters]),
        roughness,
    )


def _squares(solution: OptimizeResult) -> float:
    return float(np.sum(solution.fun**2))


def _ways(best: OptimizeResult, low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Steps (n_parameter,) of 2, 4 and 8 standard errors within the bounds, the others following along their
    correlations, and the rise of a sum of squares that is a parabola."""
    n, k = best.jac.shape
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * _squares(best) / (n - k)
    ways = []
    for i, row in enumerate(covariance):
        for errors in (-8, -4, -2, 2, 4, 8):
            way = np.clip(best.x + errors * row / max(np.sqrt(row[i]), 1e-300), low, high) - best.x
            ways.append((way, float(np.sum((best.jac @ way) ** 2))))
    return ways


def _deviation(slope: np.ndarray, squares: float) -> np.ndarray:
    """Standard errors of the parameters: the residual's variance carried through the linearised problem."""
    n, k = slope.shape
    values, vectors = np.linalg.eigh(slope.T @ slope)
    variance = squares / max(n - k, 1)
    weak = values <= 1e-12 * max(values.max(), 1e-300)
    spread = np.where(weak, np.inf, variance / np.where(weak, 1.0, values))
    share = vectors**2
    return np.sqrt(np.sum(np.where(share > 1e-12, share, 0.0) * np.where(share > 1e-12, spread, 0.0), axis=1))
