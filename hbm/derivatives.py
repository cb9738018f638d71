"""Exact derivatives at a frequency, and along a resonance peak, a fold and a nonlinear mode.

At a peak of A(w, p), where the slope a_w of a = ln A vanishes, dw/dp = - a_wp / a_ww, and dq/dp has q_w dw/dp
besides. a_wp and a_ww are differences along the curve of the exact gradient, of all parameters together. A peak that is
a corner of the curve, where a contact transition begins, stays where both sides meet: dw/dp = - [A_p] / [A_w], with
the jumps of both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.hbm.continuation.folds import FoldOptions
from tribodyn.hbm.continuation.free_vibration import FreeVibration, Point
from tribodyn.hbm.continuation.nonlinear_modes import newton_on
from tribodyn.hbm.continuation.operating_point import Slope
from tribodyn.hbm.gradient import RULES as GRADIENT, Change, Gradient, NoDerivative, Posed, Quantity, quantities
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class Rules:
    """How exactly is solved, and what counts as a corner."""

    newton: float = 1e-12  # relative residual of the states that derivatives are taken at
    of_mode: float = 1e-10
    along: float = 2e-4  # half widths of the resonance from a peak to the two points of the gradient along the curve
    at_fold: float = 1e-5  # arc length to the fold; tangents are known to a tenth of it
    most_steps: int = 12  # to a peak, and the first of them over the frequency
    first_step: float = 1e-5
    at_peak: float = 1e-7  # half widths between a peak and where it is foreseen
    at_corner: float = 1e-8  # half widths between both sides of a corner, and the first of four points beside it
    sides: tuple[float, float] = (-3e-4, 3e-4)
    # difference of one-sided derivatives over their size from which on they are two, and size over the largest of all
    # parameters by one step that counts
    corner: float = 1e-2
    seen: float = 1e-3
    # of a wear law: step of its numbers, and along the gap, where a slope that is another one than by the step of a gap
    # says that the law counts samples of a force with jumps
    of_law: float = 1e-3


RULES = Rules()


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of some quantities by some parameters.

    names, values : (n_quantity,) what they are; parameters : (n_parameter,) names
    slopes : (n_quantity, n_parameter) dq / dp; corner : (n_parameter,) whether p is at a corner of the contact forces,
        such as grazing or first slip: one-sided derivatives differ, and `slopes` is their mean
    above, below : (n_quantity, n_parameter) one-sided derivatives at a fixed frequency
    by_frequency : (n_quantity,) dq / d omega at fixed parameters [1/(rad/s)], zero along a peak
    by_gap : (n_quantity, n_pair) dq / d gap of each pair [1/m]
    state : solved, along a peak beside it
    follows_corner : whether the peak is a corner of the curve, at which a contact transition begins
    """

    names: tuple[str, ...]
    values: np.ndarray
    parameters: tuple[str, ...]
    slopes: np.ndarray
    corner: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_frequency: np.ndarray
    by_gap: np.ndarray
    state: State
    follows_corner: bool = False


@dataclass(frozen=True)
class _Fixed:
    """At one solution: values and dq / d omega (n_quantity,) of its quantities, and derivatives at a fixed frequency.

    above, below : (n_quantity, n_change) one-sided, by the changes; by_gap : (n_quantity, n_pair)
    """

    values: np.ndarray
    by_frequency: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_gap: np.ndarray

    @property
    def columns(self) -> np.ndarray:
        """(n_quantity, n_change + n_pair) by the changes and by the gap of every pair."""
        return np.concatenate([(self.above + self.below) / 2, self.by_gap], axis=1)

    @classmethod
    def limit(cls, points: Sequence[_Fixed]) -> _Fixed:
        """What points at 1, 4, 9 and 16 times a distance tend to, by a cubic over its root: slip begins by a root."""
        return cls(*(np.tensordot((4, -6, 4, -1), [getattr(p, f.name) for p in points], 1) for f in fields(cls)))


def _fixed(gradients: Sequence[Gradient], changes: Iterable[Change]) -> tuple[list[str], np.ndarray, list[_Fixed]]:
    """Names and steps of the changes, and what each gradient has; one change is there at a time."""
    names, steps = list[str](), list[float]()
    sides: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in gradients]
    for change in changes:
        names.append(change.name)
        steps.append(change.step)
        for found, gradient in zip(sides, gradients, strict=True):
            found.append(gradient.by(change))
    points = []
    for found, gradient in zip(sides, gradients, strict=True):
        values = np.array([q.value for q in gradient.quantities])
        both = np.reshape(found, (len(found), 2, len(values)))
        points.append(_Fixed(values, gradient.by_frequency(), both[:, 0].T, both[:, 1].T, gradient.by_gap()))
    return names, np.array(steps), points


def _gathered(
    gradient: Gradient,
    names: list[str],
    steps: np.ndarray,
    own: _Fixed,
    omega: float = 0.0,
    moves: np.ndarray | None = None,
) -> Derivatives:
    """At a fixed frequency, or along a frequency [rad/s] that has a derivative `moves` by every column."""
    values, columns, above, below = own.values, own.columns, own.above, own.below
    quantities, by_frequency = [q.name for q in gradient.quantities], own.by_frequency
    if moves is not None:
        columns = np.concatenate([moves[None] / (2 * np.pi), columns + by_frequency[:, None] * moves])
        values = np.concatenate([[omega / (2 * np.pi)], values])
        quantities, by_frequency = ["frequency", *quantities], np.zeros(len(values))
        above, below = (np.concatenate([np.zeros((1, len(names))), side]) for side in (above, below))
    n = len(names)
    moved = np.abs(above + below) * steps
    seen = np.maximum(moved, RULES.seen * moved.max(axis=1, initial=0.0, keepdims=True))
    corner = (2 * np.abs(above - below) * steps > RULES.corner * seen).any(axis=0)
    return Derivatives(
        tuple(quantities), values, tuple(names), columns[:, :n], corner, above, below,
        by_frequency, columns[:, n:], gradient.state,
    )  # fmt: skip


def _solved(balance: HarmonicBalance, omega: float, x: np.ndarray, options: NewtonOptions | None) -> State:
    solution = newton.solve(balance, omega, x, replace(options or NewtonOptions(), tolerance=RULES.newton))
    if not solution.converged and not solution.history[-1] <= 1e2 * RULES.newton:
        raise NoDerivative(f"the balance at {omega / (2 * np.pi):.6g} Hz is not solved: {solution.outcome}")
    return solution.state


@single
def at_frequency(
    balance: HarmonicBalance,
    state: State,
    output: str,
    changes: Iterable[Change],
    worn: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:
    """Derivatives at the fixed frequency of a state, from which it is solved more exactly.

    output : whose amplitude and phase are quantities; changes : the parameters; worn : see `quantities`
    Raises  NoDerivative at a fold, or where the state is not solved
    """
    state = _solved(balance, state.omega, state.x, options)
    gradient = Gradient(balance, state, tuple(quantities(balance, state, output, worn)))
    names, steps, (own,) = _fixed([gradient], changes)
    return _gathered(gradient, names, steps, own)


@single
def at_peak(
    balance: HarmonicBalance,
    state: State,
    output: str,
    changes: Iterable[Change],
    worn: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:
    """Derivatives along the resonance peak beside a state, its frequency [Hz] the first quantity; see `at_frequency`.

    Values are those of the peak itself: one Newton step on its condition from the state, which is `RULES.at_peak` away.
    A peak that is a corner of the curve stays where the curve has its corner
    Raises  NoDerivative where no peak lies beside the state, as at a fold
    """
    ends, width = _peak(balance, state, output, options)

    def beside(end: Slope, widths: float) -> Gradient:
        omega = end.omega + widths * width
        near = _solved(balance, omega, end.predict(omega), options)
        return Gradient(balance, near, tuple(quantities(balance, near, output, worn)))

    if len(ends) == 2:
        low, high = (
            [beside(end, side * n**2) for n in (1, 2, 3, 4)] for end, side in zip(ends, RULES.sides, strict=True)
        )
        return _at_corner(low, high, changes)
    gradient, *near = (beside(ends[0], side) for side in (0.0, -RULES.along, RULES.along))
    near = [replace(one, quantities=one.quantities[:1]) for one in near]
    names, steps, (own, *points) = _fixed([gradient, *near], changes)
    curvature, moves = _bend(points, width, float(own.by_frequency[0] / own.values[0]))
    left = -own.by_frequency[0] / own.values[0] / curvature
    own = replace(own, values=own.values + left * own.by_frequency)
    return _gathered(gradient, names, steps, own, gradient.state.omega + left, moves)


def _bend(points: Sequence[_Fixed], width: float, between: float) -> tuple[float, np.ndarray]:
    """(ln A)_ww of two points beside a peak, with the slope halfway `between` them, and the d omega by every column."""
    slopes = [np.concatenate([p.by_frequency[:1], p.columns[0]]) / p.values[0] for p in points]
    curvature, *mixed = (slopes[1] - slopes[0]) / (2 * RULES.along * width)
    if not curvature < 0:
        raise NoDerivative("the response has no maximum beside this point")
    if abs(slopes[0][0] + slopes[1][0] - 2 * between) > RULES.corner * abs(slopes[1][0] - slopes[0][0]):
        raise NoDerivative("the curve has a corner beside the peak, where a contact transition begins")
    return float(curvature), -np.asarray(mixed) / curvature


def peak_moves(
    balance: HarmonicBalance,
    state: State,
    output: str,
    changes: Iterable[Change],
    options: NewtonOptions | None = None,
) -> np.ndarray:
    """(n_change + n_pair,) d omega of the peak that a state is at, by the changes and by the gap of every pair."""
    here, near = _slope(balance, _solved(balance, state.omega, state.x, options), output), []
    if here.miss > RULES.along:  # one that a run ended at for another reason than a slope that vanishes
        (here, *other), _ = _peak(balance, state, output, options)
        if other:
            raise NoDerivative("the peak is a corner of the curve, where a contact transition begins")
    for side in (-RULES.along, RULES.along):
        omega = here.omega + side * here.width
        beside = _solved(balance, omega, here.predict(omega), options)
        near.append(Gradient(balance, beside, tuple(quantities(balance, beside, output)[:1])))
    return _bend(_fixed(near, changes)[2], here.width, here.distance / here.width**2)[1]


def _at_corner(low: Sequence[Gradient], high: Sequence[Gradient], changes: Iterable[Change]) -> Derivatives:
    """Along a corner of the curve, from what tends to it below and above it: both are one curve there."""
    both = set.intersection(*({q.name for q in one.quantities} for one in (*low, *high)))
    gradients = [replace(g, quantities=tuple(q for q in g.quantities if q.name in both)) for g in (*low, *high)]
    names, steps, points = _fixed(gradients, changes)
    below, above = _Fixed.limit(points[:4]), _Fixed.limit(points[4:])
    moves = (above.columns[0] - below.columns[0]) / (below.by_frequency[0] - above.by_frequency[0])
    along = [side.columns + side.by_frequency[:, None] * moves for side in (below, above)]
    size = np.abs(along).max(axis=(0, 2), keepdims=True)[0]
    if (np.abs(along[1] - along[0]) > RULES.corner * size).any():
        raise NoDerivative("the peak is a corner of the curve where more than one contact transition begins")
    omega = (low[0].state.omega + high[0].state.omega) / 2
    return replace(_gathered(gradients[0], names, steps, below, omega, moves), follows_corner=True)


@single
def at_fold(
    balance: HarmonicBalance, state: State, changes: Iterable[Change], options: NewtonOptions | None = None
) -> Derivatives:
    """Derivatives of the frequency [Hz] of the fold beside a state; see `at_frequency`.

    The transpose of the balance R(x, w, p) = 0 has a solution l without a right-hand side there, so that along the fold
    l . (R_w dw + R_p dp) = 0
    Raises  NoDerivative where no fold lies beside the state
    """
    state = _fold(balance, state, options)
    none = np.zeros_like(state.flat)
    hertz = Quantity("frequency", state.omega / (2 * np.pi), none, none, np.zeros_like(balance.outputs(state)))
    gradient = Gradient(balance, state, (hertz,), at_fold=True)
    names, steps, (own,) = _fixed([gradient], changes)
    to_hertz = -1 / (2 * np.pi * own.by_frequency[0])
    sides = (to_hertz * side for side in (own.above, own.below, own.by_gap))
    return _gathered(gradient, names, steps, _Fixed(own.values, np.zeros(1), *sides))


def _fold(balance: HarmonicBalance, state: State, options: NewtonOptions | None) -> State:
    """The fold beside a state, by secants of the share of the frequency in the tangent."""
    how, path = replace(options or NewtonOptions(), tolerance=RULES.newton), parameter.of(balance)
    vibration = np.where(balance.basis.order > 0, state.flat, 0.0)
    metric = Metric(float(np.linalg.norm(vibration)), FoldOptions.frequency_scale * state.omega)

    def at(guess: Direction, along: Direction) -> tuple[State, Direction]:
        found = bordered.correct(path, guess, along, metric, how)[0].state
        return found, bordered.tangent(path, found.omega, found, along, metric, how, GRADIENT.adjoint)

    try:
        here, along = at(Direction(state.flat, state.omega), metric.unit(Direction(vibration, 0.0)))
        step = RULES.along
        there, tangent = at(Direction(here.flat, here.omega) + along * step, along)
        bend = (tangent.p - along.p) / step
        for _ in range(RULES.most_steps):
            here, along, step = there, tangent, -tangent.p / bend if bend else np.inf
            if not abs(step) <= 1.0 or abs(step) <= RULES.at_fold:
                break
            there, tangent = at(Direction(here.flat, here.omega) + along * step, along)
        if abs(step) <= RULES.at_fold:
            return here
    except bordered.BorderFailed:
        pass
    raise NoDerivative(f"no fold lies beside {state.omega / (2 * np.pi):.6g} Hz")


@single
def at_mode(
    problem: FreeVibration,
    point: Point,
    changes: Iterable[Change],
    options: NewtonOptions | None = None,
    modal: bool = True,
) -> Derivatives:
    """Derivatives of frequency [Hz] and damping ratio of a nonlinear mode at an amplitude that stays.

    modal : the amplitude is that of the mass-normalised mode, else the motion of the output in it
    One solution of the linearised problem for each parameter, whose residual is differenced at the same motion.
    Raises  NoDerivative where the mode is not solved
    """
    balance, how = problem.balance, replace(options or NewtonOptions(), tolerance=RULES.of_mode)
    normal = np.zeros(len(point.coordinates))
    normal[-1] = 1.0
    point, outcome, _ = newton_on(problem, point, normal, how)
    if outcome != CONVERGED:
        raise NoDerivative(f"the mode is not solved: {outcome}")

    def residual(posed: Posed) -> np.ndarray:
        made = posed.balance or HarmonicBalance.of(
            posed.model, posed.contact.joints, balance.basis, posed.excitation, balance.omega_max, posed.memory
        )
        there = FreeVibration(made, problem.mode, problem.output)
        a = point.a if modal else point.a * problem.per_amplitude / there.per_amplitude
        return there.at(point.x, point.omega, point.zeta, a).residual

    def by(change: Change) -> np.ndarray:
        up, down, *far = (residual(one) for one in (change.above, change.below, *(change.twice or ())))
        moved = ((8 * (up - down) - (far[0] - far[1])) / 12 if far else (up - down) / 2) / change.step
        return moved if change.touching is None else moved + by(change.touching)

    names, columns = list[str](), []
    for change in changes:
        moved = problem.correction(replace(point, residual=by(change)), normal, GRADIENT.adjoint, how.max_products)
        names.append(change.name)
        columns.append(np.array([point.omega / (2 * np.pi) * moved[-3], moved[-2]]))
    slopes = np.reshape(columns, (-1, 2)).T
    values, none = np.array([point.omega / (2 * np.pi), point.zeta]), np.zeros(2)
    state = balance.evaluate(point.omega, point.x)
    return Derivatives(
        ("frequency", "damping"), values, tuple(names), slopes, np.zeros(len(names), bool), slopes, slopes, none,
        np.zeros((2, balance.contact.n_pair)), state,
    )  # fmt: skip


def _slope(balance: HarmonicBalance, state: State, output: str) -> Slope:
    return Slope.of(balance, Solution(state, CONVERGED, 0, 0, ()), output)


def _peak(
    balance: HarmonicBalance, state: State, output: str, options: NewtonOptions | None
) -> tuple[tuple[Slope, ...], float]:
    """The peak beside a state, by secants of the slope; half width of the resonance.

    Two points where the slope does not vanish but jumps: those on both sides of the corner
    """

    def at(omega: float, beside: Slope) -> Slope:
        return _slope(balance, _solved(balance, omega, beside.predict(omega), options), output)

    row = balance.compliance.output_names.index(output)
    first = before = _slope(balance, _solved(balance, state.omega, state.x, options), output)
    longest = RULES.first_step * before.omega
    step = float(np.clip(before.distance, -longest, longest))
    for _ in range(2, RULES.most_steps):
        here = at(before.omega + step, before)
        curvature = (here.slope - before.slope) / step if step else 0.0
        if not curvature < 0:
            break
        width = float(np.sqrt(-2 / curvature) * amplitude(balance.outputs(here.solution.state))[row])
        before, step = here, float(np.clip(-here.slope / curvature, -width / 2, width / 2))
        if abs(step) <= RULES.at_peak * width:
            return (here,), width
    low = high = first
    for _ in range(RULES.most_steps):
        if low.slope > 0 > high.slope:
            break
        longest *= 2
        low, high = (high, at(high.omega + longest, high)) if high.slope > 0 else (at(low.omega - longest, low), low)
    hertz = f"{state.omega / (2 * np.pi):.6g} Hz"
    if not low.slope > 0 > high.slope:
        raise NoDerivative(f"no peak of {output} lies beside {hertz}")
    width = min(low.width, high.width)
    while high.omega - low.omega > RULES.at_corner * width:
        middle = at((low.omega + high.omega) / 2, low)
        low, high = (middle, high) if middle.slope > 0 else (low, middle)
    if max(low.miss, high.miss) <= RULES.at_peak:
        return (low,), width
    if balance.basis.transitions != "located":
        raise NoDerivative(
            f"the peak of {output} at {hertz} is a corner of the curve, as forces at samples have many: "
            'harmonics.transitions = "located" has none but where a contact transition begins'
        )
    return (low, high), width
