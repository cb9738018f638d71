"""The condition of a resonance peak, which is tracked directly.

The peak is the zero of d A^2 / d omega along the branch, with dx/d omega from the linearised balance; no sweep is
needed once a neighbouring peak is known. The first peak, and one that dominates the tracked one, are found by scans."""

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.curve_peaks import peak_on_arc
from tribodyn.hbm.continuation.methods import adaptive, arc_length
from tribodyn.hbm.continuation.operating_point import DominantPeak, FrequencyCorrection, OperatingPoint
from tribodyn.hbm.continuation.peak_refinement import NoPeak, PeakRefinement
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED, SOLVED, BranchEnd, SolveEnd
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class AtPeak:
    """The cycle at the resonance peak of an output.

    start, stop : range that the first search scans [rad/s], from `start` on; n_scan : its steps where the curve is
        straight are up to five times as long as those of so many points
    tolerance : of the frequency of the peak, in half widths of the resonance: its height misses by half the square
    largest_width : half width over the frequency, above which resonances count as of this width
    linear_bound : amplitude that no linear response inside the range exceeds, with the contact free or stuck, at load
        factor 1 [m]: a tracked peak as high remains the highest, and none is searched
    scan_harmonic : highest harmonic of the scans for peaks: a contact that lifts drives higher modes by harmonics of
        the load, and such a superharmonic resonance may be the highest. With more of them a scan takes longer than
        a wear step; a peak that is found is solved with all
    scan_harmonic_above : the same above a tracked peak, where a sweep with rising frequency arrives last
    scan_tolerance : of the response between the points of the first search
    scan_miss : of a peak's height, at most, between two points of the first search: five times their tolerance
    longest_scan_step : of the first search, share of its range
    dominance : amplitude over that of the tracked peak, from which on another resonance dominates: fewer harmonics
        miss less of a peak, and a peak that emerges passes this at once
    same_peak : share of the tracked peak's frequency within which a maximum of a scan is taken for it
    near_peak : half widths from the peak within which a point next to failed solves is taken for it
    first_stride : first step from a neighbouring peak, in half widths of the resonance
    outside_reach : half widths between the points next to a maximum of a scan, by which its peak may lie outside them
    max_refined : maxima of a scan that are refined in turn, the highest first
    max_growth : of a response over that at an end of the range, or a resonance in half widths, that nothing limits
    Those from `scan_harmonic_above` on: see docs/developers/ablations.md"""

    output: str
    start: float
    stop: float
    n_scan: int = 60
    tolerance: float = 1e-3
    largest_width: float = 0.01
    linear_bound: float = np.inf
    scan_harmonic: int = 7
    scan_harmonic_above: int = 3
    scan_tolerance: float = 0.03
    scan_miss: float = 0.15
    longest_scan_step: float = 0.05
    dominance: float = 1.2
    same_peak: float = 0.1
    near_peak: float = 0.1
    first_stride: float = 0.02
    outside_reach: float = 2.0
    max_refined: int = 3
    max_growth: float = 1e5
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    @single
    def solve(self, balance: HarmonicBalance) -> OperatingPoint:
        """Scan the range, points dense where the response bends, then refine its highest maximum.

        The scan has fewer harmonics than the balance, unless its maximum is no peak with all of them.
        Where no maximum that may be the highest can be refined, as at a fold, none of the lower ones is taken for it. A
        scan that ends at a fold behind which no solution is found is repeated from the other end, and where all that
        fails the curve nearby is followed by arc length
        Raises  NoPeak where no maximum lies inside the range: an end of it is no resonance"""
        reduced = self._with_harmonics_to(balance, self.scan_harmonic)
        if reduced.basis != balance.basis:
            branch = self._scan(reduced)
            with suppress(NoPeak):
                scanned = self._highest(reduced, branch, self._candidates(branch))
                peak = self._with_all_harmonics(reduced, balance, scanned)
                if peak.solution.outcome.kind in SOLVED:
                    return replace(peak, solves=peak.solves + scanned.solves)
        branch = self._scan(balance)
        if branch.end.kind is BranchEnd.ENDED:
            backward = replace(self, start=self.stop, stop=self.start)._scan(balance)
            heights = [scan.amplitude(self.output)[scan.converged].max(initial=0.0) for scan in (branch, backward)]
            branch = backward if heights[1] > heights[0] else branch
        peak = self._highest(balance, branch, self._candidates(branch))
        return peak if peak.solution.outcome.kind in SOLVED else self._by_arc_length(balance, peak)

    def _by_arc_length(self, balance: HarmonicBalance, peak: OperatingPoint) -> OperatingPoint:
        """The peak of the curve round a search that has failed, followed round its folds; else the failed one."""
        (start, stop), growth = sorted((self.start, self.stop)), self.max_growth
        near = [peak.state.omega * share for share in (1 - self.same_peak, 1 + self.same_peak)]
        for low, high in ((start, stop), (max(near[0], start), min(near[1], stop))):
            curve = arc_length.follow(balance, low, high, arc_length.Options(max_growth=growth, newton=self.newton))
            if np.linalg.norm(curve.contact[-1]) > growth * np.linalg.norm(curve.contact[0]) > 0:
                outcome = SolveEnd.UNLIMITED.say(f" {curve.omega[-1] / 2 / np.pi:.5g} Hz")
                return replace(peak, solution=replace(peak.solution, outcome=outcome))
            if curve.arrived and not curve.no_peak(self.output):
                on_arc = peak_on_arc(balance, curve, curve.highest(self.output), self)
                lowest = (1 - self.tolerance) * peak.amplitude
                if on_arc is not None and on_arc.solution.converged and on_arc.amplitude > lowest:
                    return replace(on_arc, solves=peak.solves + len(curve.omega) + on_arc.solves)
        detail = f"{peak.solution.outcome.detail}; by arc length the curve {curve.end}, without a peak"
        return replace(peak, solution=replace(peak.solution, outcome=SolveEnd.SITE_NOT_FOUND.say(detail)))

    @single
    def solve_near(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """Refine from a neighbouring peak."""
        return PeakRefinement(self, balance, omega, x).run()

    def solve_between(
        self, balance: HarmonicBalance, omega: float, x: np.ndarray, low: float, high: float
    ) -> OperatingPoint:
        """Refine a maximum of a curve between two frequencies [rad/s]."""
        return PeakRefinement(self, balance, omega, x, 0.25 * (high - low), (low, high)).run()

    @single
    def dominant_peak(self, balance: HarmonicBalance, point: OperatingPoint) -> DominantPeak:
        """The higher peak that a sweep with rising frequency meets, None where the tracked one is the highest.

        point : the tracked peak
        Where pairs impact and no solution with all harmonics is found near that with fewer, the peak has fewer, and
        zeros in the others"""
        if self.dominance * point.amplitude >= self.linear_bound * balance.load_factor:
            return DominantPeak()
        low, high = sorted((self.start, self.stop))
        tracked = float(np.clip(point.state.omega, low, high))
        lower_balance = self._with_harmonics_to(balance, self.scan_harmonic)
        upper_balance = self._with_harmonics_to(balance, min(self.scan_harmonic_above, self.scan_harmonic))
        ranges = [(low, tracked, lower_balance), (tracked, high, upper_balance)]
        if lower_balance.basis == upper_balance.basis:
            ranges = [(low, high, lower_balance)]
        result = DominantPeak()
        for start, stop, reduced in ranges:
            if result.point is None and stop > start:
                peak = replace(self, start=start, stop=stop)._higher_peak(reduced, balance, point)
                result = DominantPeak(peak.point, result.solves + peak.solves, max(result.nearness, peak.nearness))
        return result

    @single
    def correction(self, balance: HarmonicBalance, state: State) -> FrequencyCorrection:
        """The distance of a state to the peak, by its slope and as though one mode responded."""
        slope = AmplitudeSlope.of(balance, Solution(state, CONVERGED, 0, 0, ()), self.output)
        return FrequencyCorrection(slope.distance, 0, self.resolution(slope))

    def resolution(self, point: AmplitudeSlope) -> float:
        """Accuracy that the frequency of a peak near a point needs [rad/s]."""
        return self.tolerance * min(point.width, self.largest_width * point.omega)

    def _higher_peak(self, reduced: HarmonicBalance, balance: HarmonicBalance, point: OperatingPoint) -> DominantPeak:
        """As `dominant_peak`, by one sweep of this range with the harmonics of a reduced balance."""
        guess = _transferred(balance, point, reduced)
        if self.start != point.state.omega:  # the contact has about the mean that it has at the peak
            mean, guess = guess[..., :1], reduced.stuck(self.start)
            guess = np.concatenate([mean, guess[..., 1:]], axis=-1) if reduced.basis.has_static else guess
        branch = self._scan(reduced, guess)
        solves = len(branch.omega)
        try:
            maxima = self._maxima(branch)
        except NoPeak:
            return DominantPeak(None, solves)
        threshold = self.dominance * point.amplitude
        height = branch.amplitude(self.output)[maxima]
        other_heights = height[np.abs(branch.omega[maxima] / point.state.omega - 1) > self.same_peak]
        nearness = float(other_heights.max(initial=0.0)) / threshold
        candidates = maxima[height > (1 - self.scan_miss) * threshold]
        if not len(candidates):
            return DominantPeak(None, solves, nearness)
        scanned = self._highest(reduced, branch, candidates)
        if self._is_rough(reduced) and not scanned.solution.converged:  # no slope vanishes: the sweep's highest point
            x = reduced.shaped(branch.contact[candidates[0]])
            scanned = self._solve_at(reduced, branch.omega[candidates[0]], x, scanned.solves)
        if not self._dominates(scanned, point):
            return DominantPeak(None, scanned.solves, nearness)
        peak = self._with_all_harmonics(reduced, balance, scanned, accept_fewer=True)
        solves = peak.solves + scanned.solves
        if not self._dominates(peak, point):
            return DominantPeak(None, solves, nearness)
        return DominantPeak(peak, solves, peak.amplitude / threshold)

    def _dominates(self, peak: OperatingPoint, tracked: OperatingPoint) -> bool:
        inside = min(self.start, self.stop) <= peak.state.omega <= max(self.start, self.stop)
        return inside and peak.solution.converged and peak.amplitude > self.dominance * tracked.amplitude

    def _is_rough(self, balance: HarmonicBalance) -> bool:
        """Whether a response may have micro-folds with so many harmonics: many jumps, slopes that say little."""
        return balance.basis.harmonics[-1] > self.scan_harmonic_above

    def _with_harmonics_to(self, balance: HarmonicBalance, highest: int) -> HarmonicBalance:
        """The balance with its harmonics up to one, and those that the loads need."""
        needed = max((h for h, _ in balance.excitation.loads), default=0)
        harmonics = tuple(h for h in balance.basis.harmonics if h <= max(highest, needed))
        return balance if harmonics == balance.basis.harmonics else balance.with_harmonics(harmonics)

    def _with_all_harmonics(
        self, reduced: HarmonicBalance, balance: HarmonicBalance, scanned: OperatingPoint, accept_fewer: bool = False
    ) -> OperatingPoint:
        """A peak of a reduced balance with all harmonics, twice as many at a time.

        accept_fewer : where no solution with more is found, that with the most harmonics counts, the others at zero"""
        current, point = reduced, replace(scanned, solves=0)
        while True:
            harmonics = balance.basis.harmonics[: 2 * len(current.basis.harmonics)]
            larger = balance if harmonics == balance.basis.harmonics else balance.with_harmonics(harmonics)
            x, omega = _transferred(current, point, larger), point.state.omega
            peak = self.solve_near(larger, omega, x)
            if peak.solution.outcome.kind not in SOLVED:
                peak = self._solve_at(larger, omega, x, peak.solves)
            peak = replace(peak, solves=peak.solves + point.solves)
            if accept_fewer and not peak.solution.converged:
                state = balance.evaluate(omega, _transferred(current, point, balance))
                return OperatingPoint.of(balance, replace(point.solution, state=state), self.output, peak.solves)
            if larger is balance or not peak.solution.converged:
                return peak
            current, point = larger, peak

    def _scan(self, balance: HarmonicBalance, guess: np.ndarray | None = None) -> Branch:
        step = min(1 / self.n_scan, self.longest_scan_step)
        options = adaptive.Options(
            tolerance=self.scan_tolerance, step=step, max_step=min(5 * step, self.longest_scan_step),
            min_step=1e-3 * step, newton=self.newton, load_paths=not self._is_rough(balance), guess=guess,
        )  # fmt: skip
        return adaptive.follow(balance, self.start, self.stop, options)

    def _highest(self, balance: HarmonicBalance, branch: Branch, maxima: np.ndarray) -> OperatingPoint:
        """The first of a branch's maxima that can be refined between its neighbours, or little outside them.

        Its solves include those of the branch"""
        solves = len(branch.omega)
        for row in maxima[: self.max_refined]:
            neighbours = branch.omega[row - 1 : row + 2]
            width = float(np.ptp(neighbours)) / 2
            reach, omega = self.outside_reach * width, float(branch.omega[row])
            limits = float(neighbours.min()) - reach, float(neighbours.max()) + reach
            x = balance.shaped(branch.contact[row])
            peak = PeakRefinement(self, balance, omega, x, 0.5 * width, limits).run()
            solves += peak.solves
            if peak.solution.outcome.kind in SOLVED:  # no lower one is taken for a resonance that nothing limits
                break
        return replace(peak, solves=solves)

    def _solve_at(self, balance: HarmonicBalance, omega: float, x: np.ndarray, solves: int) -> OperatingPoint:
        """The solution at one frequency from x; solves : spent before."""
        return OperatingPoint.of(balance, newton.solve(balance, omega, x, self.newton), self.output, solves + 1)

    def _candidates(self, branch: Branch) -> np.ndarray:
        """Maxima of a branch that may be its highest."""
        maxima = self._maxima(branch)
        height = branch.amplitude(self.output)[maxima]
        return maxima[height >= (1 - self.scan_miss) * height[0]]

    def _maxima(self, branch: Branch) -> np.ndarray:
        """Points of a branch that are higher than both their neighbours, the highest first."""
        converged = branch.converged
        height = np.where(converged, branch.amplitude(self.output), -1.0)
        inner = np.flatnonzero(
            converged[1:-1] & (height[1:-1] > 0) & (height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])
        )
        if len(inner):
            return inner[np.argsort(-height[inner + 1], kind="stable")] + 1
        low, high = branch.omega.min() / (2 * np.pi), branch.omega.max() / (2 * np.pi)
        span = f"{low:.5g} and {high:.5g} Hz"
        if height.max(initial=0.0) <= 0.0:
            raise NoPeak(f"no resonance peak of {self.output}: it does not vibrate between {span}", branch)
        end = float(branch.omega[int(np.argmax(height))] / (2 * np.pi))
        raise NoPeak(
            f"no resonance peak of {self.output} lies between {span}: the response still rises towards the "
            f"{'lower' if end == low else 'upper'} end at {end:.5g} Hz; extend response.frequency beyond it, "
            "or name a frequency in wear.at", branch,
        )  # fmt: skip


def _transferred(source: HarmonicBalance, point: OperatingPoint, target: HarmonicBalance) -> np.ndarray:
    """x of a point of one balance in the harmonics of another."""
    return source.basis.transfer(point.state.x, target.basis)
