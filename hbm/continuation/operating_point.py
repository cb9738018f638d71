"""Where the cycle is taken: at a fixed frequency, or at the resonance peak, which is tracked directly.

The peak is the zero of d A^2 / d omega along the branch, with dx/d omega from the linearised balance; no sweep is
needed once a neighbouring peak is known.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, Linearisation, State
from tribodyn.hbm.continuation.bordered import Direction
from tribodyn.hbm.continuation.branch import Branch, amplitude
from tribodyn.hbm.continuation.methods import adaptive, arc_length
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


class NoPeak(Refusal):
    """The response has no maximum inside the range that is searched; the message says where it still rises."""


@dataclass(frozen=True)
class OperatingPoint:
    """A solution that the vibration cycle is taken from.

    amplitude : of the response output [m]; response : (n_output, n_coeff) [m]; solves : balance solves spent
    """

    solution: Solution
    amplitude: float
    response: np.ndarray
    solves: int

    @classmethod
    def of(cls, balance: HarmonicBalance, solution: Solution, output: str, solves: int) -> OperatingPoint:
        """A solution with the amplitude of an output."""
        response = balance.outputs(solution.state)
        row = balance.compliance.output_names.index(output)
        return cls(solution, float(amplitude(response[row])), response, solves)

    @property
    def state(self) -> State:
        """The solved state."""
        return self.solution.state


@dataclass(frozen=True)
class Correction:
    """How far a solved cycle is from where it is to be taken.

    distance : to the right frequency [rad/s]; solves : spent
    accuracy : that the frequency is wanted with [rad/s]
    """

    distance: float
    solves: int
    accuracy: float = 0.0


@dataclass(frozen=True)
class Overtaking:
    """What a search for a higher peak than the tracked one has found.

    point : the higher peak, None where the tracked one is the highest; solves : balance solves spent
    nearness : height of the highest other maximum over that which overtakes; 0 where none was found
    """

    point: OperatingPoint | None = None
    solves: int = 0
    nearness: float = 0.0


@dataclass(frozen=True)
class AtFrequency:
    """The cycle at a fixed frequency [rad/s]."""

    output: str
    omega: float
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    @single
    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Solve without a neighbour, where need be along the folded curve of solutions over the load."""
        return OperatingPoint.of(balance, arc_length.solve_along_load(balance, self.omega, self.newton), self.output, 1)

    @single
    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Solve from a neighbouring x; `omega` is the neighbour's and ignored here.

        Where the neighbour's branch has ended in a fold, the response jumps to the one that a rising load leads to.
        """
        solution, solves = newton.solve(balance, self.omega, x, self.newton), 1
        if not solution.converged:
            solution, solves = arc_length.solve_along_load(balance, self.omega, self.newton), 2
        return OperatingPoint.of(balance, solution, self.output, solves)

    def overtaken(self, balance: HarmonicBalance, point: OperatingPoint) -> Overtaking:
        """None, without a solve: the frequency is given."""
        return Overtaking()

    def correct(self, balance: HarmonicBalance, state: State) -> Correction:
        """The distance of a state to the fixed frequency."""
        return Correction(self.omega - state.omega, 0)


@dataclass(frozen=True)
class AtPeak:
    """The cycle at the resonance peak of an output.

    start, stop : range that the first search scans [rad/s], from `start` on; n_scan : its steps where nothing bends are
        up to five times as long as of so many points
    tolerance : of the frequency of the peak, in half widths of the resonance: its height misses by half the square
    widest : half width over the frequency, above which resonances are found as those of this width
    highest : amplitude that no linear response inside the range passes, with the contact free or stuck, at load factor
        1 [m]: a tracked peak as high stays the highest, and none is looked for
    scanned : highest harmonic of the scans for peaks: a contact that lifts drives higher modes by harmonics of the
        load, and such a superharmonic resonance may be the highest. With more of them a scan takes longer than
        a wear step; a peak that is found is solved with all
    scanned_above : the same above a tracked peak, where a sweep with rising frequency arrives last
    scan_tolerance : of the response between the points of the first search
    scan_misses : of a peak's height, at most, between two points of the first search: five times their tolerance
    coarsest : longest step of the first search, share of its range
    overtakes : amplitude over that of the tracked peak, from which on another resonance dominates: what fewer harmonics
        miss of a peak is less, and a peak that emerges passes this at once
    same_peak : share of the tracked peak's frequency within which a maximum of a scan is taken for it
    near : half widths from the peak within which a point beside failed solves is taken for it
    stride : first step from a neighbouring peak, in half widths of the resonance
    reach : half widths between the points beside a maximum of a scan, by which its peak may lie outside them
    tried : maxima of a scan that are refined in turn, the highest first
    Those from `scanned_above` on: see docs/accuracy/ablations.md
    """

    output: str
    start: float
    stop: float
    n_scan: int = 60
    tolerance: float = 1e-3
    widest: float = 0.01
    highest: float = np.inf
    scanned: int = 7
    scanned_above: int = 3
    scan_tolerance: float = 0.03
    scan_misses: float = 0.15
    coarsest: float = 0.05
    overtakes: float = 1.2
    same_peak: float = 0.1
    near: float = 0.1
    stride: float = 0.02
    reach: float = 2.0
    tried: int = 3
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    @single
    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Scan the range, points dense where the response bends, then refine its highest maximum.

        The scan has few harmonics where the balance has more, unless what it finds is no peak with all of them.
        Where no maximum that may be the highest can be refined, as at a fold, none of the lower ones is taken for it. A
        scan that ends on its way, at a fold behind which no solution is found, is begun at the other end, too
        Raises  NoPeak where no maximum lies inside the range: an end of it is no resonance
        """
        few = self._few(balance, self.scanned)
        if few.basis != balance.basis:
            branch = self._scan(few)
            with suppress(NoPeak):
                scanned = self._highest(few, branch, self._candidates(branch))
                found = self._raised(few, balance, scanned)
                if found.solution.converged:
                    return replace(found, solves=found.solves + scanned.solves)
        branch = self._scan(balance)
        if branch.end.kind is BranchEnd.ENDED:
            back = replace(self, start=self.stop, stop=self.start)._scan(balance)
            branch = max(
                branch, back, key=lambda scan: float(scan.amplitude(self.output)[scan.converged].max(initial=0.0))
            )
        return self._highest(balance, branch, self._candidates(branch))

    def _is_rough(self, balance: HarmonicBalance) -> bool:
        """Whether a response may have micro-folds with so many harmonics: many jumps, slopes that say little."""
        return balance.basis.harmonics[-1] > self.scanned_above

    def _candidates(self, branch: Branch) -> np.ndarray:
        """Maxima of a branch that may be its highest."""
        maxima = self._maxima(branch)
        height = branch.amplitude(self.output)[maxima]
        return maxima[height >= (1 - self.scan_misses) * height[0]]

    def _few(self, balance: HarmonicBalance, highest: int) -> HarmonicBalance:
        """The balance with its harmonics up to one, and those that the loads need."""
        needed = max((h for h, _ in balance.excitation.loads), default=0)
        kept = tuple(h for h in balance.basis.harmonics if h <= max(highest, needed))
        return balance if kept == balance.basis.harmonics else balance.with_harmonics(kept)

    def _raised(
        self, few: HarmonicBalance, balance: HarmonicBalance, scanned: OperatingPoint, far_enough: bool = False
    ) -> OperatingPoint:
        """A peak that few harmonics found with all those of the balance, twice as many at a time.

        far_enough : where no solution with more is found, that with the most harmonics counts, the others at zero
        """
        known, point = few, replace(scanned, solves=0)
        while True:
            kept = balance.basis.harmonics[: 2 * len(known.basis.harmonics)]
            more = balance if kept == balance.basis.harmonics else balance.with_harmonics(kept)
            x, omega = _carried(known, point, more), point.state.omega
            found = self.next(more, omega, x)
            if not found.solution.converged:
                found = self._at(more, omega, x, found.solves)
            found = replace(found, solves=found.solves + point.solves)
            if far_enough and not found.solution.converged:
                state = balance.evaluate(omega, _carried(known, point, balance))
                return OperatingPoint.of(balance, replace(point.solution, state=state), self.output, found.solves)
            if more is balance or not found.solution.converged:
                return found
            known, point = more, found

    def _scan(self, balance: HarmonicBalance, guess: np.ndarray | None = None) -> Branch:
        step = min(1 / self.n_scan, self.coarsest)
        scan = adaptive.Options(
            tolerance=self.scan_tolerance,
            step=step,
            max_step=min(5 * step, self.coarsest),
            min_step=1e-3 * step,
            newton=self.newton,
            load_paths=not self._is_rough(balance),
            guess=guess,
        )
        return adaptive.follow(balance, self.start, self.stop, scan)

    def _highest(self, balance: HarmonicBalance, branch: Branch, maxima: np.ndarray) -> OperatingPoint:
        """The first of a branch's maxima that can be refined between the points beside it, or little outside them.

        Its solves count those of the branch
        """
        solves = len(branch.omega)
        for best in maxima[: self.tried]:
            beside = branch.omega[best - 1 : best + 2]
            width = float(np.ptp(beside)) / 2
            within = float(beside.min()) - self.reach * width, float(beside.max()) + self.reach * width
            omega = float(branch.omega[best])
            found = self._refine(balance, omega, {omega: balance.shaped(branch.contact[best])}, 0.5 * width, within)
            solves += found.solves
            if found.solution.converged:
                break
        return replace(found, solves=solves)

    def _at(self, balance: HarmonicBalance, omega: float, x: np.ndarray, solves: int) -> OperatingPoint:
        """The solution at one frequency beside x; solves : spent before."""
        return OperatingPoint.of(balance, newton.solve(balance, omega, x, self.newton), self.output, solves + 1)

    def within(
        self, balance: HarmonicBalance, omega: float, known: dict[float, np.ndarray], low: float, high: float
    ) -> OperatingPoint:
        """Refine a maximum of a curve between two frequencies [rad/s]; known : x by frequency, of no fold beside it."""
        return self._refine(balance, omega, known, 0.25 * (high - low), (low, high))

    @single
    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Refine from a neighbouring peak."""
        return self._refine(balance, omega, {omega: x}, None)

    @single
    def overtaken(self, balance: HarmonicBalance, point: OperatingPoint) -> Overtaking:
        """The higher peak that a sweep with rising frequency meets, None where the tracked one is the highest.

        point : the tracked peak
        Where pairs impact and no solution with all harmonics is found beside that with fewer, the peak has fewer, and
        zeros in the others
        """
        if self.overtakes * point.amplitude >= self.highest * balance.load_factor:
            return Overtaking()
        low, high = sorted((self.start, self.stop))
        tracked = float(np.clip(point.state.omega, low, high))
        few, fewer = (self._few(balance, top) for top in (self.scanned, min(self.scanned_above, self.scanned)))
        parts = [(low, tracked, few), (tracked, high, fewer)] if few.basis != fewer.basis else [(low, high, few)]
        known = Overtaking()
        for start, stop, scanned in parts:
            if known.point is None and stop > start:
                part = replace(self, start=start, stop=stop)
                found = part._higher(scanned, balance, point)
                known = Overtaking(found.point, known.solves + found.solves, max(known.nearness, found.nearness))
        return known

    def _higher(self, few: HarmonicBalance, balance: HarmonicBalance, point: OperatingPoint) -> Overtaking:
        """The same by one sweep of this range with few harmonics."""
        guess = _carried(balance, point, few)
        if self.start != point.state.omega:  # the contact has about the mean that it has at the peak
            mean, guess = guess[..., :1], few.stuck(self.start)
            guess = np.concatenate([mean, guess[..., 1:]], axis=-1) if few.basis.has_static else guess
        branch = self._scan(few, guess)
        solves = len(branch.omega)
        try:
            maxima = self._maxima(branch)
        except NoPeak:
            return Overtaking(None, solves)
        wanted = self.overtakes * point.amplitude
        height = branch.amplitude(self.output)[maxima]
        others = height[np.abs(branch.omega[maxima] / point.state.omega - 1) > self.same_peak]
        nearness = float(others.max(initial=0.0)) / wanted
        might = height > (1 - self.scan_misses) * wanted
        if not might.any():
            return Overtaking(None, solves, nearness)
        scanned = self._highest(few, branch, maxima[might])
        if self._is_rough(few) and not scanned.solution.converged:  # no slope vanishes: the highest point of the sweep
            best = maxima[might][0]
            scanned = self._at(few, branch.omega[best], few.shaped(branch.contact[best]), scanned.solves)
        if not self._is_higher(scanned, point):
            return Overtaking(None, scanned.solves, nearness)
        found = self._raised(few, balance, scanned, far_enough=True)
        solves = found.solves + scanned.solves
        if not self._is_higher(found, point):
            return Overtaking(None, solves, nearness)
        return Overtaking(found, solves, found.amplitude / wanted)

    def _is_higher(self, found: OperatingPoint, point: OperatingPoint) -> bool:
        inside = min(self.start, self.stop) <= found.state.omega <= max(self.start, self.stop)
        return inside and found.solution.converged and found.amplitude > self.overtakes * point.amplitude

    @single
    def correct(self, balance: HarmonicBalance, state: State) -> Correction:
        """The distance of a state to the peak, by its slope and as though one mode responded."""
        here = Slope.of(balance, Solution(state, CONVERGED, 0, 0, ()), self.output)
        return Correction(here.distance, 0, self._resolution(here))

    def _resolution(self, here: Slope) -> float:
        """How exactly the frequency of a peak beside a point is wanted [rad/s]."""
        return self.tolerance * min(here.width, self.widest * here.omega)

    def _maxima(self, branch: Branch) -> np.ndarray:
        """Points of a branch that are higher than both their neighbours, the highest first."""
        good = branch.converged
        height = np.where(good, branch.amplitude(self.output), -1.0)
        inner = np.flatnonzero(
            good[1:-1] & (height[1:-1] > 0) & (height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])
        )
        if len(inner):
            return inner[np.argsort(-height[inner + 1], kind="stable")] + 1
        if height.max(initial=0.0) <= 0.0:
            raise NoPeak(f"no resonance peak of {self.output}: it does not vibrate between {_range(branch)}")
        end = float(branch.omega[int(np.argmax(height))] / (2 * np.pi))
        which = "lower" if end == branch.omega.min() / (2 * np.pi) else "upper"
        raise NoPeak(
            f"no resonance peak of {self.output} lies between {_range(branch)}: the response still rises towards the "
            f"{which} end at {end:.5g} Hz; extend response.frequency beyond it, or name a frequency in wear.at"
        )

    def _refine(
        self,
        balance: HarmonicBalance,
        omega: float,
        known: dict[float, np.ndarray],
        stride: float | None,
        within: tuple[float, float] = (0.0, np.inf),
    ) -> OperatingPoint:
        def solve(w: float, guess: np.ndarray) -> Slope:
            solution = newton.solve(balance, w, guess, self.newton)
            return Slope.of(balance, solution, self.output)

        here = solve(omega, known[omega])
        solves = 1
        if not here.solution.converged:
            return OperatingPoint.of(balance, here.solution, self.output, solves)
        resolution = self._resolution(here)
        stride = self.stride * here.width if stride is None else stride
        bracket: tuple[Slope, Slope] | None = None  # the latest points from both of which it rises towards the other
        before: Slope | None = None
        share = 1.0  # of the way to the peak in the bracket, halved where a solve fails
        best = here
        while solves < 60 and abs(best.distance) > resolution:
            side = float(np.sign(here.slope))
            if bracket:
                ends = sorted(end.omega for end in bracket)
                if ends[1] - ends[0] <= resolution:  # as about a kink, where no slope vanishes
                    break
                peak = bracket[0].peak_before(bracket[1])
                if before is not None and abs(before.omega - here.omega) < ends[1] - ends[0]:  # the last two are nearer
                    zero = _zero(before, here)
                    peak = zero if ends[0] < zero < ends[1] else peak
                target = here.omega + share * (peak - here.omega)
            elif before is None and within[int(side > 0)] in known:
                target = within[int(side > 0)]
            elif before is None:
                target = here.omega + (here.distance if abs(here.distance) < 20 * stride else side * stride)
            else:  # extrapolate the slope, never further than a few strides and always uphill
                reach = abs(here.omega - before.omega)
                zero = (_zero(before, here) - here.omega) * side
                target = here.omega + side * (min(zero, 8 * reach) if zero > 0 else 3 * reach)
            target = float(np.clip(target, max(1e-3 * omega, within[0]), min(balance.omega_max, within[1])))
            if abs(target - best.omega) <= resolution:
                break
            guess = bracket[0].between(bracket[1], target) if bracket else here.predict(target)
            there = solve(target, known.get(target, guess))
            solves += 1
            if not there.solution.converged or (target in known and there.slope * here.slope > 0):
                known = {}
                if bracket:
                    if min(best.miss, abs(bracket[0].omega - bracket[1].omega) / best.width) <= self.near:
                        break
                    share *= 0.5
                    continue
                stride, before = 0.25 * min(stride, abs(target - here.omega)), None
                if stride < resolution:
                    break
                continue
            share = 1.0
            if bracket:
                bracket = (there, bracket[1]) if there.slope * bracket[0].slope > 0 else (bracket[0], there)
            elif there.slope * here.slope <= 0:
                bracket = here, there
            before, here = here, there
            if there.miss <= best.miss:
                best, resolution = there, self._resolution(there)
        if bracket is None and best.slope > 0 and best.omega >= (1 - 1e-9) * balance.omega_max:
            hertz = balance.omega_max / (2 * np.pi)
            raise NoPeak(
                f"the resonance peak of {self.output} has moved beyond {hertz:.5g} Hz, the highest frequency that is "
                "modelled: extend response.frequency"
            )
        found = best.solution
        between = abs(bracket[0].omega - bracket[1].omega) if bracket else np.inf
        if min(best.miss, between / best.width) > self.near:  # sampled forces have kinks, where the slope jumps
            hertz, rises = best.omega / (2 * np.pi), "rises" if best.slope > 0 else "falls"
            lost = SolveEnd.SITE_NOT_FOUND.say(
                f" {solves} solves: the curve ends at {hertz:.5g} Hz, where it still {rises}"
            )
            found = replace(found, outcome=lost)
        return OperatingPoint.of(balance, found, self.output, solves)


def _carried(known: HarmonicBalance, point: OperatingPoint, to: HarmonicBalance) -> np.ndarray:
    """x of a point of one balance in the harmonics of another."""
    return known.basis.transfer(point.state.x, to.basis)


def _range(branch: Branch) -> str:
    low, high = branch.omega.min() / (2 * np.pi), branch.omega.max() / (2 * np.pi)
    return f"{low:.5g} and {high:.5g} Hz"


def _zero(a: Slope, b: Slope) -> float:
    """Where the straight line through two distances vanishes [rad/s]; of one mode they lie on a line, slopes do not."""
    fa, fb = a.distance, b.distance
    return (a.omega * fb - b.omega * fa) / (fb - fa) if fa != fb else 0.5 * (a.omega + b.omega)


@dataclass(frozen=True)
class Slope:
    """A solved point with d A^2 / d omega and d x / d omega, or along another tangent of its curve.

    height : of the output [m]
    distance : to the peak [rad/s], were the response that of one mode, y = R / (p - omega)
    width : half width of the resonance at its peak, abs(p - omega) elsewhere [rad/s]
    """

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
    def of(cls, balance: HarmonicBalance, solution: Solution, output: str) -> Slope:
        """The slope over the frequency."""
        slope_r, _ = balance.frequency_slope(solution.state)
        linear = balance.linearise(solution.state)
        way = Direction(linear.solve_refined(-slope_r, 1e-8), 1.0)
        return cls.along(balance, linear, solution, output, way)

    @classmethod
    def along(
        cls, balance: HarmonicBalance, linear: Linearisation, solution: Solution, output: str, way: Direction
    ) -> Slope:
        """The slope along a tangent of the curve, `way`; distance and width in lengths of that."""
        state, dx = solution.state, way.x
        _, slope_y = balance.frequency_slope(state)
        dy = way.p * slope_y + balance.at(state.omega).outputs(linear.departure_slope(dx))
        row = balance.compliance.output_names.index(output)
        y = balance.outputs(state)[row]
        dynamic = balance.basis.order > 0
        along, steepness = y[dynamic] @ dy[row][dynamic], dy[row][dynamic] @ dy[row][dynamic]
        distance = along / steepness if steepness > 0 else 0.0
        width = np.sqrt(y[dynamic] @ y[dynamic] / steepness) if steepness > 0 else state.omega
        height, dx = float(amplitude(y)), dx.reshape(state.x.shape)
        return cls(solution, state.omega, float(2 * along), height, float(distance), float(width), dx)

    def predict(self, omega: float) -> np.ndarray:
        return self.solution.state.x + (omega - self.omega) * self.dx

    def between(self, other: Slope, omega: float) -> np.ndarray:
        """x of the Hermite cubic between two points."""
        t = (omega - self.omega) / (other.omega - self.omega)
        return (1 - t) ** 2 * ((1 + 2 * t) * self.solution.state.x + (omega - self.omega) * self.dx) + t**2 * (
            (3 - 2 * t) * other.solution.state.x + (omega - other.omega) * other.dx
        )

    def peak_before(self, other: Slope) -> float:
        """Frequency of the peak between two points from both of which the curve rises towards the other [rad/s].

        By the Hermite cubic of 1 / height^2, which of one mode is a parabola
        """
        h, ratio = other.omega - self.omega, (self.height / other.height) ** 2
        a, b = -h * self.slope / self.height**2, -h * other.slope / other.height**2 * ratio
        square, cubic = 3 * (ratio - 1) - 2 * a - b, 3 * (a + b - 2 * (ratio - 1))
        root = np.sqrt(square**2 - a * cubic)
        return self.omega + h * float(-a / (square + root) if square > 0 else (root - square) / cubic)
