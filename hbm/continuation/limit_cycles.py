"""Limit cycles: free vibrations whose damping, that of flow and friction together, vanishes.

On the backbone of the least damped mode the damping ratio zeta depends on the amplitude. Where it passes zero nothing
needs to be added to sustain the motion: it is a limit cycle. The phase is fixed by the reference mode, as on the
backbone. Whether a machine stays there is asked of time integration: the amplitude may turn back on the backbone, so
that the slope of zeta does not tell it, and sliders that just reach their limit make a kink in what Hill's method
linearises; in time they come to stand inside their limits.
Source  Krack 2015, section 2 (a nonlinear mode with zero damping is a limit cycle)"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.free_vibration import FreeVibration, ModePoint
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions, newton_on, walk
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.outcome import CONVERGED, BranchEnd
from tribodyn.hbm.stability import floquet
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import time_integration, time_step
from tribodyn.hbm.time.period_search import PeriodSearch
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.refusal import Refusal

INSIDE = 1e-4  # of a motion: growth is the same from 1e-6 to 1e-3, see docs/theory/flutter.md


@dataclass(frozen=True)
class LimitCycle:
    """One limit cycle.

    amplitude : of the output [m]; omega : [rad/s]
    response : (n_output, n_coeff) of the outputs [m]; state : of the balance without harmonic loads
    point : where it lies in the coordinates of its problem
    moved, growth : of `in_time`, None before: share by which the amplitude of the output changes there, and share per
        period by which the motion beside it grows that does so fastest, below 0 where all die away"""

    amplitude: float
    omega: float
    response: np.ndarray
    state: State
    point: ModePoint
    moved: float | None = None
    growth: float | None = None

    @property
    def is_stable(self) -> bool | None:
        """Whether nothing beside it grows in time, as far as multipliers tell; None where it is not known."""
        return None if self.growth is None else self.growth < floquet.RULES.growth

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.omega / (2 * np.pi)


@single
def limit_cycles(
    balance: HarmonicBalance, start: float, stop: float, mode: int | None = None, output: str | None = None,
    options: BackboneOptions | None = None,
) -> tuple[list[LimitCycle], str]:  # fmt: skip
    """Limit cycles between two amplitudes [m] of an output, by rising amplitude, and why there may be others, or none.

    mode, output : as for `backbone`; the least damped mode by default
    Raises  ValueError as `backbone` does"""
    options = options or BackboneOptions()
    if not 0 < start < stop:
        raise Refusal(f"limit cycles need two rising amplitudes above 0, not {start} and {stop}")
    problem = FreeVibration(balance, mode, output)
    low, high = np.log(np.array([start, stop]) / problem.per_amplitude)
    solved, end = walk(problem, float(low), float(high), options)
    points = [point for point, outcome, _ in solved if outcome == CONVERGED]
    cycles: list[LimitCycle] = []
    missing: list[str] = []
    for before, after in pairwise(points):
        if np.sign(before.zeta) != np.sign(after.zeta):
            share = before.zeta / (before.zeta - after.zeta)
            between = before.coordinates + share * (after.coordinates - before.coordinates)
            guesses = between, after.coordinates, before.coordinates  # two where friction has a kink between them
            trials = (_without_damping(problem, guess, options) for guess in guesses)
            if (cycle := next((other for other in trials if other is not None), None)) is None:
                missing.append(f"one near {before.a * problem.per_amplitude:.3g} m was not solved")
            elif not any(np.allclose(cycle.point.coordinates, other.point.coordinates, 1e-4, 1e-4) for other in cycles):
                cycles.append(cycle)  # a backbone that turned back may pass it twice
    if end.kind is not BranchEnd.REACHED:
        reached = max((point.a for point in points), default=0.0) * problem.per_amplitude
        missing.append(f"the damping was followed up to {reached:.3g} m only: the backbone {end}")
    elif not cycles and not missing:
        first, last = points[0].zeta, points[-1].zeta
        does, place = ("decays", "below the first") if first > 0 else ("grows", "above the last")
        missing.append(
            f"none between these amplitudes: the motion {does} at all of them (damping {first:+.3%} to {last:+.3%}), "
            f"so that one can only lie {place}"
        )
    return sorted(cycles, key=lambda cycle: cycle.amplitude), "; ".join(missing)


def _without_damping(problem: FreeVibration, guess: np.ndarray, options: BackboneOptions) -> LimitCycle | None:
    """The point of zero damping near a guess, None where Newton's method does not find it."""
    normal = np.zeros(len(guess))
    normal[-2] = 1.0  # the damping among the coordinates of a point
    begin = guess.copy()
    begin[-2] = 0.0
    point, outcome, _ = newton_on(problem, problem.evaluate(begin), normal, options.newton)
    if outcome != CONVERGED:
        return None
    still, response = replace(problem.balance, load_factor=0.0), problem.outputs(point)
    names = still.compliance.output_names
    return LimitCycle(
        amplitude=float(amplitude(response[names.index(problem.output)], problem.basis.harmonics)),
        omega=point.omega,
        response=response,
        state=still.evaluate(point.omega, point.x),
        point=point,
    )


def in_time(balance: HarmonicBalance, cycle: LimitCycle, output: str, options: Options) -> LimitCycle:
    """The limit cycle with what time integration makes of it, on the sectors until its wave repeats itself.

    options : max_periods are marched from its own state
    The multipliers are those of its motion, smaller by INSIDE with the sliders where they are: those that the path of
    the load left just at their limit rest
    Raises  ValueError for problems with no equation of motion in time or too large for multipliers; IntegrationFailed
    """
    wheel, start = time_integration.in_time(replace(balance, load_factor=0.0), cycle.omega, cycle.state, options)
    stepper, state = TimeStepper(wheel, cycle.omega, options), start or cycle.state
    angle = 2 * np.pi * np.arange(1, options.steps + 1) / options.steps
    x = np.ascontiguousarray((state.x @ wheel.basis.functions(angle).T).transpose(2, 0, 1))
    memory, bits = time_step.memory_after(stepper.law, x, stepper.contact, wheel.memory)
    (n_pair, c), n_state = x.shape[1:], memory.shape[1]
    slopes = np.zeros((len(x), n_pair, c + n_state, 2 * c + n_state))
    reduced = (1 - INSIDE) * x + INSIDE * x.mean(axis=0)
    time_step.along(stepper.law, stepper.contact, reduced[-1], reduced, memory, bits, reduced[:0], slopes)
    multipliers = np.linalg.eigvals(floquet.monodromy(stepper, slopes))
    disturbances = np.delete(multipliers, np.abs(multipliers - 1).argmin())  # the phase is free
    marched = PeriodSearch(stepper, options, False).march(stepper.start_from(state)).record.y
    row = balance.compliance.output_names.index(output)
    swing = float(np.sqrt(2 * marched[:, row].var() / (cycle.response[row, 1:] ** 2).sum()))
    return replace(cycle, moved=swing - 1, growth=float(np.abs(disturbances).max()) - 1)
