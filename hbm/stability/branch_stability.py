"""Stability of the points of a branch, and the bifurcations between them."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.stability.exponents import CLEAR, FOLD, Stability, remembers, stability
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal

TRIALS = 12  # of a bifurcation between two points
ACCURACY = 1e-6  # of the share of the way between the points


@dataclass(frozen=True)
class Bifurcation:
    """A change of stability between two points of a branch.

    position : between the points, counted from 0: 3.4 is 40 % of the way from point 3 to point 4
    value : of the parameter there: [rad/s] where the branch was followed in frequency; solved for where the kind is not
        a fold, else interpolated: the branch lists its folds
    kind : "fold" (multiplier +1), "flip" (-1) or "Neimark-Sacker" (a complex pair)"""

    position: float
    value: float
    kind: str

    @property
    def frequency(self) -> float:
        """Frequency [Hz], of a branch that was followed in frequency."""
        return self.value / (2 * np.pi)


@dataclass(frozen=True)
class BranchStability:
    """Stability of a branch, point by point, and its bifurcations in the order of the branch.

    stable : (n_point,) bool, False also where the point did not converge, or where it is not known
    growth : (n_point,) largest growth rate of a perturbation [1/s], nan where the point did not converge, or where
        neither Hill's method nor time integration decides
    omega, position, kinds : value, position and kind of every bifurcation, see Bifurcation"""

    stable: np.ndarray
    growth: np.ndarray
    omega: np.ndarray
    position: np.ndarray
    kinds: tuple[str, ...]

    @property
    def known(self) -> np.ndarray:
        """(n_point,) whether Hill's method or time integration decides."""
        return np.isfinite(self.growth)

    @property
    def bifurcations(self) -> tuple[Bifurcation, ...]:
        """The bifurcations one by one."""
        return tuple(map(Bifurcation, self.position.tolist(), self.omega.tolist(), self.kinds))


@single
def stability_along(
    problem: HarmonicBalance | Parameter, branch: Branch, on_point: Callable[[int, int], None] | None = None
) -> BranchStability:
    """Stability of every converged point of a branch, and the bifurcations between neighbouring points.

    problem : what the branch was followed with: the balance, or the parameter it was stepped in
    on_point : called with points done and points in all"""
    path = parameter.of(problem)
    if path.name != branch.parameter_name:
        raise Refusal(f"the branch was followed in the {branch.parameter_name}, not in the {path.name}")
    results: list[Stability | None] = []
    for value, flat, converged in zip(branch.parameter, branch.contact, branch.converged, strict=True):
        result = None
        if converged:
            balance, omega = path.place(float(value))
            state = balance.evaluate(omega, balance.shaped(flat))
            result = stability(balance, state)
        results.append(result)
        if on_point is not None:
            on_point(len(results), len(branch.outcome))
    places = [Direction(x, float(value)) for x, value in zip(branch.contact, branch.parameter, strict=True)]
    changes = [
        _locate(path, i, (before, now), (places[i], places[i + 1]))
        for i, (before, now) in enumerate(itertools.pairwise(results))
        if before is not None and now is not None and before.n_unstable != now.n_unstable
    ]
    stable = np.array([s is not None and s.stable for s in results])
    growth = np.array([np.nan if s is None else s.exponents[0].real for s in results])
    for change in [b for b in changes if b.kind != FOLD]:
        decided = _decide_in_time(path, branch, int(change.position), stable, growth)
        if decided is not None:
            changes = [b for b in changes if b is not change and int(b.position) not in decided]
            changes += [replace(change, position=i + 0.5, value=0.5 * (places[i].p + places[i + 1].p)) for i in decided]
    changes.sort(key=lambda b: b.position)
    return BranchStability(
        stable=stable,
        growth=growth,
        omega=np.array([b.value for b in changes]),
        position=np.array([b.position for b in changes]),
        kinds=tuple(b.kind for b in changes),
    )


def _decide_in_time(
    path: Parameter, branch: Branch, i: int, stable: np.ndarray, growth: np.ndarray
) -> list[int] | None:
    """Points on either side of a change of stability by Hill's method, decided in time until both agree.

    i : the point before the change; stable, growth : are overwritten, growth with nan where time does not decide
    Returns the points before the changes between the points decided, None where Hill's method is right"""
    from tribodyn.hbm.stability.floquet import grows_in_time  # time integration, which a stored result does not need

    decided: list[int] = []
    for ahead in (range(i, -1, -1), range(i + 1, len(stable))):
        for j in ahead:
            balance, omega = path.place(float(branch.parameter[j]))
            state = balance.evaluate(omega, balance.shaped(branch.contact[j]))
            if not branch.converged[j] or abs(growth[j]) > CLEAR * omega or not remembers(balance, state):
                break
            grows = grows_in_time(balance, state)
            if grows is not None and grows != stable[j]:
                break
            stable[j], growth[j] = grows is False, np.nan if grows is None else -growth[j]
            decided.append(j)
            if grows is None:
                break
    if not decided:
        return None
    low, high = max(min(decided) - 1, 0), min(max(decided) + 1, len(stable) - 1)
    return [k for k in range(low, high) if stable[k] != stable[k + 1]]


def _locate(
    path: Parameter, i: int, sides: tuple[Stability, Stability], ends: tuple[Direction, Direction]
) -> Bifurcation:
    """Where the exponents that change sides have, on average, a real part of zero.

    A flip or Neimark-Sacker bifurcation is solved for; a fold, which the curve itself locates, is interpolated."""
    before, after = sides
    low, high = sorted((before.n_unstable, after.n_unstable))
    r0, r1 = (float(s.exponents.real[low:high].mean()) for s in sides)
    share = float(np.clip(r0 / (r0 - r1), 0.0, 1.0)) if r0 != r1 else 0.5
    unstable = before if before.n_unstable > after.n_unstable else after
    kind = replace(unstable, exponents=unstable.exponents[low:]).crossing
    value = ends[0].p + share * (ends[1].p - ends[0].p)
    if kind != FOLD and r0 * r1 < 0:

        def growth(balance: HarmonicBalance, state: State) -> float:
            return float(stability(balance, state).exponents.real[low:high].mean())

        share, value = _zero_of_growth(path, *ends, growth, (r0, r1)) or (share, value)
    return Bifurcation(i + share, value, kind)


def _zero_of_growth(
    path: Parameter,
    start: Direction,
    stop: Direction,
    growth: Callable[[HarmonicBalance, State], float],
    rates: tuple[float, float],
) -> tuple[float, float] | None:
    """The share of the way from start to stop at which the growth rate is zero, and the parameter there.

    start, stop : neighbouring points of the curve; growth : of a motion [1/s]; rates : it at both, of different sign
    Returns None where no motion is found between them
    Source  regula falsi, Illinois; each trial is solved in the hyperplane normal to the chord"""
    chord = stop - start
    metric = Metric(float(np.linalg.norm(chord.x)) or 1.0, abs(chord.p) or 1.0)
    low, high, weights = (0.0, rates[0]), (1.0, rates[1]), [1.0, 1.0]
    share, value = 0.0, start.p
    for _ in range(TRIALS):
        a, b = weights[0] * low[1], weights[1] * high[1]
        share = low[0] + (high[0] - low[0]) * a / (a - b)
        solution, value = bordered.correct(path, start + chord * share, chord, metric, NewtonOptions())
        if not solution.converged:
            return None
        rate = growth(path.place(value)[0], solution.state)
        if rate * low[1] > 0:
            low, weights = (share, rate), [1.0, 0.5 * weights[1]]
        else:
            high, weights = (share, rate), [0.5 * weights[0], 1.0]
        is_small = abs(rate) <= ACCURACY * max(abs(rates[0]), abs(rates[1]))
        if is_small or high[0] - low[0] <= ACCURACY:
            break
    return share, value
