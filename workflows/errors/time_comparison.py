"""Steady states of the balance compared with integration in time, which follows them until they are stationary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, MotionInTime, SolvedCycle, of_wear_with_error, quantities_of
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanMotion, MeanOptions
from tribodyn.hbm.time.stepper import Options as TimeOptions
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.time.verify import energy_floor
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import operating_states
from tribodyn.workflows.errors.operating_states import OperatingState, Values, with_harmonics
from tribodyn.workflows.errors.refinement_limits import RefinementLimits
from tribodyn.workflows.result.answers import worn_contact
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement, Status
from tribodyn.workflows.run import settings
from tribodyn.workflows.scene.scene_file import SceneFile

STEPS = 256  # per period at least
STEPS_PER_HARMONIC = 32
NEGLIGIBLE = 1e-12  # share of a work that counts as none


@dataclass(frozen=True)
class MotionDifference:
    """A state of the balance compared with the motion in time.

    cycles : of the state; balance, in_time : (n_pair,) friction work of either motion per period [J]
    differences : relative ones of the values of the balance, by quantity; values : those in time
    error : standard error of the whole work in time, relative; spread : standard deviation of the work of a period"""

    cycles: float
    balance: np.ndarray
    in_time: np.ndarray
    differences: Values
    error: float
    spread: float
    values: Values = field(default_factory=dict)

    def contradicts(self, errors: Mapping[str, float | None]) -> float:
        """By how much a quantity of the contact before wear is further off than its error, if that is known; else 0."""
        bounds = {name: error for name, error in errors.items() if error is not None}
        sizes = {name: self.differences.get(name, 0.0) + self.error for name in bounds}
        return max((size for name, size in sizes.items() if size > bounds[name]), default=0.0)

    @property
    def status(self) -> Status:
        """Of a quantity that is contradicted and has no value in its place."""
        return Status.UNSTABLE if self.spread > 0 else Status.CONTRADICTED


def is_checked(state: OperatingState, requested: bool | None, limits: RefinementLimits) -> bool:
    """Whether states are integrated in time; requested : by the scene, None: where it takes little work."""
    if requested is not None:
        return requested
    size = state.balance.contact.stiffness.size * state.balance.model.sectors_in_time
    return size**2 * steps_of(state.balance) <= limits.max_time


def steps_of(balance: HarmonicBalance) -> int:
    """Time steps per period that suit the harmonics of a balance."""
    return max(STEPS, STEPS_PER_HARMONIC * balance.basis.harmonics[-1])


def changes_along_wear(
    file: SceneFile, balance: HarmonicBalance, result: Result, harmonics: tuple[int, ...]
) -> list[MeasuredChange]:
    """What the quantities of the wear of a result would change along motions in time.

    Those before wear, halfway through the life and near its end, but for rows that were worn in time. Each is compared
    with the balance with the harmonics of the refined wear run, so that none counts in both rows"""
    wear = result.wear
    assert wear is not None
    text = "motions in time compared with those of the balance"
    rows = [row for row in (0, *operating_states.later_rows(result)) if not wear.in_time[row]]
    if not rows or operating_states.worn_values(worn_contact(result)) is None:
        return []
    differences: tuple[float, float] | None = None
    try:
        states = [operating_states.worn_state(file, balance, result, row) for row in rows]
        refined = [with_harmonics(state, (*state.balance.basis.harmonics, *harmonics)) for state in states]
        differences = wear_differences([compare(state) for state in refined], result)
    except (Refusal, SolverFailure) as failure:  # a motion that is not stationary, a row that is not solved again
        text += f": {failure}"
    changes = []
    for quantity in of_wear_with_error(worn_contact(result)):
        relative = None if differences is None else differences[quantity.error is not ErrorKind.DURATION]
        changes.append(MeasuredChange(Refinement.OTHER_MOTION, quantity.name, None, None, relative, text))
    return changes


def wear_differences(comparisons: Sequence[MotionDifference], result: Result) -> tuple[float, float]:
    """How far the work of motions in time changes durations and depths of a wear run, relative.

    A depth takes more / less cycles in the ratio of both works, so that a life is off by the mean over its cycles; a
    depth goes with the share of the work that the deepest pair has. A state stands for the rows nearest to it, wear in
    time needs none. So few do not show that they cancel: their amounts are taken."""
    wear = result.wear
    assert wear is not None
    counted = slice(0, max(operating_states.later_rows(result), default=0) + 1)
    cycles, deepest = wear.cycles_in_step[counted], int(wear.depth[-1].argmax())
    distance = np.abs(np.subtract.outer(wear.cycles[counted] + cycles / 2, [c.cycles for c in comparisons]))
    works = [(float(c.balance.sum()), float(c.in_time.sum())) for c in comparisons]
    longer = np.array([b / max(t, NEGLIGIBLE * b) if b or t else 1.0 for b, t in works])  # 1 where both motions rest
    shares = [[w[deepest] / w.sum() if w.sum() > 0 else 0.0 for w in (c.balance, c.in_time)] for c in comparisons]
    deeper = np.array([in_time / (balance or np.inf) for balance, in_time in shares])
    chance = np.array([c.error for c in comparisons])
    nearest, by_balance = distance.argmin(axis=1), ~wear.in_time[counted]

    def mean_difference(weight: np.ndarray, ratio: np.ndarray) -> float:
        ratios = np.where(by_balance, ratio[nearest], 1.0)
        return float(weight @ np.abs(ratios - 1) / (weight @ ratios)) if weight @ ratios > 0 else 0.0

    scatter = float(cycles @ (by_balance * chance[nearest]) / (cycles.sum() or 1.0))
    return mean_difference(cycles, longer) + scatter, mean_difference(wear.worn[counted, deepest], deeper)


def compare(state: OperatingState, finer: int = 1, shift: float = 0.0) -> MotionDifference:
    """Follow a state in time until it is stationary, a wave in all sectors, and compare the values of its quantities.

    finer : times the steps per period; shift : by which the frequency of the state may be off, relative
    Steps of a finite length shift resonances by the square of their angle at most: a periodic motion is compared at the
    phase of the balance where that lies within so much, or within `shift`. Values are compared above what is rounding
    Raises  Refusal where the model has no equation in time; SolverFailure where the motion is not stationary"""
    balance, solved = state.balance, state.point.state
    steps, omega = finer * steps_of(balance), solved.omega
    follower, row = Follower(MeanOptions(steps)), balance.compliance.output_names.index(settings.OUTPUT)
    spanned, start = time_integration.in_time(balance, omega, solved, TimeOptions(steps))
    assert start is not None
    follower.start(spanned, start)
    driven = replace(balance.basis, harmonics=(SolvedCycle.of(balance, solved, settings.OUTPUT).driven or 1,))

    def observe(motion: PeriodicMotion) -> np.ndarray:
        return np.array([energy_floor(motion), *motion.coefficients(motion.outputs[row], driven)])

    def marched(omega: float) -> tuple[MeanMotion, complex]:
        """Means at a frequency, and how the balance's vibration is to that in time."""
        means = follower.mean(spanned, omega, observe)
        if not means.is_stationary:
            raise SolverFailure(f"the motion is not stationary after {means.periods} periods")
        vibration = complex(*means.observed[1:])
        return means, complex(*balance.basis.transfer(response, driven)) / vibration if vibration else 1.0

    response = balance.outputs(solved)[row]
    means, ratio = marched(omega)
    step_shift = (2 * np.pi / steps) ** 2
    if abs(ratio.imag) > step_shift and means.spread == 0:
        nearby, slope = step_shift * omega, (marched(omega * (1 + step_shift))[1] - ratio).imag
        same_phase = omega - nearby * ratio.imag / slope if slope else np.inf
        if abs(same_phase / omega - 1) <= max(step_shift, shift):
            shifted, nearer = marched(same_phase)  # beyond a fold there is another motion
            means = shifted if shifted.spread == 0 and abs(nearer - 1) < abs(ratio - 1) else means
    sectors = len(means.energy) // balance.contact.n_pair
    energy = means.energy.reshape(sectors, -1).mean(axis=0)
    motion = MotionInTime(means, sectors, energy, float(means.observed[0]) / sectors)
    cycle, differences, values = SolvedCycle.of(balance, solved, settings.OUTPUT), {}, {}
    for quantity in quantities_of(CycleQuantity):
        value = quantity.value(cycle)
        if quantity.in_time is not None and value is not None:
            values[quantity.name], least = quantity.in_time(motion)
            excess = max(abs(value - values[quantity.name]) - least, 0.0)
            differences[quantity.name] = excess / (abs(values[quantity.name]) or abs(value) or 1.0)
    work = np.maximum(balance.energy(solved), 0.0), np.maximum(energy, 0.0)
    error = means.error if means.error * work[1].sum() > motion.least_energy else 0.0
    return MotionDifference(state.cycles, *work, differences, error, means.spread, values)
