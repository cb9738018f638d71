"""Nonlinear modes: backbone of frequency and damping against amplitude, by the extended periodic motion concept.

    M q'' + (C - 2 zeta w M) q' + K q + B^T f_c(x) = F_0

is periodic for the pair (w, zeta) at which the added, mass-proportional term balances what the contact and C dissipate.
The backbone is followed by its arc length, since with friction it may turn back in amplitude; see `free_vibration`
for the equations and how they are solved.
Source  Krack 2015, Computers & Structures 154"""

from dataclasses import dataclass, field

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.free_vibration import FreeVibration, ModePoint
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class BackboneOptions:
    """n_points : amplitudes on an easy way, equidistant in the logarithm: this sets the longest step

    between : what a straight line between neighbouring points may miss, of the frequency (relative) and of the damping
        ratio: steps get shorter where slip begins
    min_step : shortest step, as a fraction of the longest; max_points : points after which to end
    few_steps, many_steps : Newton steps up to which the next step grows, and from which it shrinks
    frequency_weight : of log frequency and of the damping ratio in the arc length, beside that of log amplitude: they
        change by a few per cent where the amplitude changes by decades
    corner_step : share of the longest step below which any turn is taken as a corner of the curve
    misses : by how much a step may miss its prediction, over `between`: eight on a curve of constant curvature, four at
        a kink in the middle"""

    n_points: int = 40
    between: float = 1e-3
    min_step: float = 1e-4
    max_points: int = 400
    few_steps: int = 3
    many_steps: int = 7
    frequency_weight: float = 5.0
    corner_step: float = 1e-2
    misses: float = 5.0
    newton: NewtonOptions = field(default_factory=NewtonOptions)


@dataclass(frozen=True)
class Backbone:
    """One nonlinear mode.

    number : of its reference mode, from 0; None for the least damped
    modal_amplitude : (n_point,) a of the mass-normalised reference mode [m kg^0.5]
    reference_amplitude : (n_point,) of the chosen output as the reference mode alone would move it [m]
    output : the chosen one
    omega : (n_point,) natural frequency [rad/s]; damping : (n_point,) modal damping ratio, structure and contact
    order : (n_coeff,) harmonic of each coefficient
    output_names, response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m]
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point CONVERGED, or what went wrong; newton_steps : (n_point,)
    reference_omega : of the mode at rest, stuck where the static load keeps the contact closed [rad/s]
    end : why the backbone ends; its text is a sentence"""

    number: int | None
    modal_amplitude: np.ndarray
    reference_amplitude: np.ndarray
    output: str
    omega: np.ndarray
    damping: np.ndarray
    order: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[Outcome[SolveEnd], ...]
    newton_steps: np.ndarray
    reference_omega: float
    end: Outcome[BranchEnd]

    @property
    def converged(self) -> np.ndarray:
        """(n_point,) whether the point is a solution."""
        return np.array([outcome.kind is SolveEnd.CONVERGED for outcome in self.outcome])

    @property
    def frequency(self) -> np.ndarray:
        """(n_point,) natural frequency [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def amplitude(self) -> np.ndarray:
        """(n_point,) vibration amplitude of the chosen output [m]."""
        return amplitude(self.response[:, self.output_names.index(self.output)], tuple(np.unique(self.order).tolist()))

    @property
    def first_harmonic(self) -> np.ndarray:
        """(n_point,) amplitude of the chosen output in the first harmonic [m]."""
        row = self.response[:, self.output_names.index(self.output)]
        magnitudes: np.ndarray = np.linalg.norm(row[:, self.order == 1], axis=1)
        return magnitudes

    @property
    def acceleration(self) -> np.ndarray:
        """(n_point,) largest acceleration of the chosen output in the first harmonic [m/s2]."""
        return self.omega**2 * self.first_harmonic


_Solved = tuple[ModePoint, Outcome[SolveEnd], int]


@single
def backbone(
    balance: HarmonicBalance,
    start: float,
    stop: float,
    mode: int | None = 0,
    output: str | None = None,
    options: BackboneOptions | None = None,
    modal: bool = False,
) -> Backbone:
    """Follow one nonlinear mode from a small to a large amplitude (or back).

    balance : its vibration load plays no part, its static load does
    start, stop : amplitudes [m] of `output` (the first by default) in the reference mode; where `modal`, those of the
        mass-normalised mode itself [m kg^0.5]
    mode : number of the reference mode, from 0, among the modes about the static equilibrium; None for the least damped
    Raises  ValueError for models whose harmonics see different systems, unknown outputs, no static equilibrium"""
    options = options or BackboneOptions()
    if not (start > 0 and stop > 0 and start != stop):
        raise Refusal(f"the amplitudes of a backbone must be > 0 and differ, not {start} and {stop}")
    problem = FreeVibration(balance, mode, output)
    a, goal = np.log(np.array([start, stop]) / (1.0 if modal else problem.per_amplitude))
    solved, end = walk(problem, float(a), float(goal), options)
    return result(problem, mode, solved, end)


def walk(
    problem: FreeVibration, start: float, goal: float, options: BackboneOptions, decades: int = 4
) -> tuple[list[_Solved], Outcome[BranchEnd]]:
    """Points from the logarithm of the amplitude `start` to `goal`, and how the walk ends.

    decades : under `start` from which it is walked to, one after another, where the reference mode is too far off
    """
    first = problem.first_guess(np.exp(start))
    fixed = np.zeros(len(first.coordinates))
    fixed[-1] = 1.0
    solved = [newton_on(problem, first, fixed, options.newton)]
    if solved[0][1] != CONVERGED:
        reason = BranchEnd.ENDED.say(f" the start: {solved[0][1]}")
        if decades == 0:
            return solved, reason
        lower, end = walk(problem, start - np.log(10.0), start, options, decades - 1)
        if end.kind is not BranchEnd.REACHED:
            return solved, reason
        solved = lower[-1:]
    longest = abs(goal - start) / max(options.n_points - 1, 1)
    step, tangent = longest, np.sign(goal - start) * fixed
    weight = np.ones(len(fixed))
    weight[-3:-1] = options.frequency_weight**2
    while len(solved) < options.max_points:
        origin = solved[-1][0].coordinates
        weight[:-3] = problem.weights(solved[-1][0].a)
        ahead = origin + step * tangent
        last = (ahead[-1] - goal) * (start - goal) <= 0
        if last:
            ahead = origin + (goal - origin[-1]) / tangent[-1] * tangent
        trial = newton_on(problem, problem.evaluate(ahead), fixed if last else weight * tangent, options.newton)
        corner = step < options.corner_step * longest
        if trial[1] != CONVERGED and corner:
            trial, last = _turned_back(problem, origin, step * tangent, weight * tangent, trial, options.newton), False
        turned = trial[0].coordinates - origin
        size = np.sqrt(turned @ (weight * turned))
        smooth = turned @ (weight * tangent) > 0.5 * size or corner
        if trial[1] != CONVERGED or not smooth:
            step *= 0.5
            if step < options.min_step * longest:
                return [*solved, trial], BranchEnd.ENDED.say(f" its last point: {trial[1]}")
            continue
        missed = np.abs(trial[0].coordinates - ahead)[-3:-1].max()
        if missed > options.misses * options.between and not corner:
            step *= 0.5
            continue
        solved.append(trial)
        if last:
            return solved, BranchEnd.REACHED.say(" the amplitude asked for")
        if (trial[0].coordinates[-1] - start) * (goal - start) < 0:
            return solved, BranchEnd.TURNED_BACK.say(" where it began")
        tangent = turned / size
        if trial[2] <= options.few_steps:
            step = min(longest, 1.6 * step)
        elif trial[2] >= options.many_steps:
            step *= 0.6
    return solved, BranchEnd.POINTS_DONE.say(f" {options.max_points} points")


def _turned_back(
    problem: FreeVibration,
    origin: np.ndarray,
    move: np.ndarray,
    normal: np.ndarray,
    missed: _Solved,
    options: NewtonOptions,
) -> _Solved:
    """The point behind a corner at which the curve leaves by more than a right angle, `missed` where there is none.

    Where a pair begins to slip or to part, the other branch is that of the contact state just beyond: its straight line
    is followed to as far behind the corner as `move` goes beyond it."""
    overshoot = problem.evaluate(origin + move)
    jump = problem.correction(overshoot, normal, 1e-8, options.max_products, -2 * (normal @ move))
    trial = newton_on(problem, problem.evaluate(overshoot.coordinates + jump), normal, options)
    return_way = np.linalg.norm(trial[0].coordinates - origin + move) < 0.5 * np.linalg.norm(move)
    return missed if return_way else trial


def newton_on(problem: FreeVibration, point: ModePoint, normal: np.ndarray, options: NewtonOptions) -> _Solved:
    """The point of the curve in the hyperplane through a guess."""
    error = float(np.linalg.norm(point.residual))
    for step in range(options.max_steps):
        if error <= options.tolerance:
            return point, CONVERGED, step
        direction = problem.correction(point, normal, float(np.clip(error, 1e-10, 1e-3)), options.max_products)
        best, best_error, length = point, error, 1.0
        for _ in range(8):
            trial = problem.evaluate(point.coordinates + length * direction)
            trial_error = float(np.linalg.norm(trial.residual))
            if trial_error < best_error:
                best, best_error = trial, trial_error
            if trial_error <= (1 - 0.1 * length) * error:
                break
            length *= 0.5
        if best is point:
            return point, SolveEnd.NO_DESCENT.say(f" {error:.1e}"), step + 1
        point, error = best, best_error
    if error <= options.tolerance:
        return point, CONVERGED, options.max_steps
    return point, SolveEnd.STEPS_SPENT.say(f" {options.max_steps} steps: {error:.1e}"), options.max_steps


def result(problem: FreeVibration, number: int | None, solved: list[_Solved], end: Outcome[BranchEnd]) -> Backbone:
    points = [p for p, _, _ in solved]
    basis = problem.basis
    t = problem.balance.contact.tangential
    work = [float(basis.work_per_cycle(p.cycle.force[:, t], p.x[:, t]).sum()) for p in points]
    return Backbone(
        number=number,
        modal_amplitude=np.array([p.a for p in points]),
        reference_amplitude=np.array([p.a for p in points]) * problem.per_amplitude,
        output=problem.output,
        omega=np.array([p.omega for p in points]),
        damping=np.array([p.zeta for p in points]),
        order=basis.order,
        output_names=problem.balance.compliance.output_names,
        response=np.stack([problem.outputs(p) for p in points]),
        contact=np.stack([p.x.reshape(-1, basis.n_coeff) for p in points]),
        energy=np.array(work),
        outcome=tuple(outcome for _, outcome, _ in solved),
        newton_steps=np.array([steps for _, _, steps in solved]),
        reference_omega=problem.reference_omega,
        end=end,
    )
