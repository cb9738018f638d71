"""What a motion does on average over its periods, whether it repeats itself or not.

A plain march goes where a machine goes: to a stable periodic motion, to one that takes several periods, or to one that
never repeats itself. Energy and wear per cycle then are means over periods, and their scatter is given with them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.period_search import Period, PeriodSearch, PerturbedMotion, perturb
from tribodyn.hbm.time.stepper import IntegrationFailed, Options, TimeStepper
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.time.time_step import Moving
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class MeanRules:
    """When a motion counts as the same, or as periodic."""

    periodic: float = 1e-5  # drift over a period, relative, of a motion that counts as periodic
    # standard errors by which the means of two blocks may differ and still be those of one motion
    same_scatter: float = 2.0
    fewest_blocks: int = 4  # whose means give a standard error


RULES = MeanRules()


@dataclass(frozen=True)
class MeanOptions:
    """How long to march.

    steps : per period; block : periods whose means are compared; most_blocks : after which to give up
    search : periods in which a periodic motion is looked for
    accuracy : relative difference of the energy of two blocks below which the motion has settled, and standard error of
        the mean that is asked for
    contact : of the contact's equations in a step"""

    steps: int = 256
    block: int = 8
    most_blocks: int = 40
    search: int = 60
    accuracy: float = 5e-3
    contact: float = 1e-7


@dataclass(frozen=True)
class MeanMotion:
    """Means over the periods of a motion that has settled.

    energy : (n_pair,) friction work per period [J]; normal_force : (n_pair,) [N], zero where the law has none
    observed : mean of what a caller observes in every period; amplitude : (n_output,) [m]
    spread : standard deviation of the work of a period, over its mean; error : standard error of that mean, relative
    is_stationary : whether the motion came to rest in its statistics; periods : marched in all"""

    energy: np.ndarray
    normal_force: np.ndarray
    observed: np.ndarray
    amplitude: np.ndarray
    spread: float
    error: float
    is_stationary: bool
    periods: int


class Follower:
    """A motion that is followed while gaps and frequency change, and the loads do not.

    A periodic motion is followed as such, as long as a perturbation decays. Where it does not, or where nothing repeats
    itself, the motion is marched on plainly, until that becomes periodic."""

    def __init__(self, options: MeanOptions):
        self.options = options
        self._stepper: TimeStepper | None = None
        self._motion: Moving | None = None
        self._regular, self._passing = True, False

    def start(self, balance: HarmonicBalance, state: State) -> None:
        """Begin at a state of a balance.

        Raises  Refusal for models with no equation of motion in time; IntegrationFailed"""
        if balance.model.is_wave:
            raise Refusal("means over a motion serve one part or several bodies, not a travelling wave of a wheel")
        self._motion = self._stepper_at(balance, state.omega).start_from(state)
        self._regular, self._passing = True, False

    @property
    def _begun(self) -> Moving:
        if self._motion is None:
            raise RuntimeError("the motion was not begun")
        return self._motion

    def stored_state(self) -> np.ndarray:
        """What moves, as one vector whose length depends on the model alone."""
        stepper, motion = self._stepper, self._begun
        assert stepper is not None
        z = np.pad(motion.z, (0, 2 * len(stepper.modes[0]) - len(motion.z)))
        parts = (motion.x, motion.f, motion.memory, motion.bits, motion.hold)
        return np.concatenate([[stepper.omega, self._regular, self._passing], z, *(np.ravel(part) for part in parts)])

    def restore(self, balance: HarmonicBalance, stored: np.ndarray) -> None:
        """Go on with what `stored_state` returned, of a balance that differs in its gaps alone."""
        self._regular, self._passing = bool(stored[1]), bool(stored[2])
        stepper = self._stepper = TimeStepper(balance, float(stored[0]), self._march_options())
        pairs, memory = balance.contact.stiffness.shape, stepper.balance.memory.shape
        hold = 0 if stepper.hold is None else len(stepper.hold.dofs)
        sizes = [3, 2 * len(stepper.modes[0]), *2 * (pairs[0] * pairs[1],), memory[0] * memory[1], pairs[0], hold]
        _, z, x, f, s, bits, p = np.split(stored, np.cumsum(sizes)[:-1])
        n = 2 * stepper.n_dynamic
        self._motion = Moving(z[:n], x.reshape(pairs), f.reshape(pairs), s.reshape(memory), bits.astype(np.int64), p)

    def mean(
        self,
        balance: HarmonicBalance,
        omega: float,
        observe: Callable[[PeriodicMotion], np.ndarray],
        mean_accuracy: float | None = None,
    ) -> MeanMotion:
        """Follow the motion to a place, until it is periodic or has settled.

        observe : what to average besides, of one period
        mean_accuracy : relative standard error of the work and of the normal force at which a motion that is not
            periodic, and has been stationary once, passes to the next place; None: it is stationary at every place
        Raises  IntegrationFailed"""
        stepper = self._stepper_at(balance, omega)
        spent = 0
        if self._regular:
            period, spent = self._periodic(stepper)
            if period is not None:
                means = period.energy, period.normal_force, observe(period), period.amplitude
                return MeanMotion(*means, spread=0.0, error=0.0, is_stationary=True, periods=spent)
        marched = self._stationary_means(stepper, observe, mean_accuracy)
        self._passing = marched.is_stationary and mean_accuracy is not None
        self._regular = marched.is_stationary and marched.spread <= self.options.accuracy and not self._passing
        return replace(marched, periods=marched.periods + spent)

    def periodic_work_near(self, balance: HarmonicBalance, state: State) -> float | None:
        """Friction work [J] of a periodic motion near that of a balance, if it is stable."""
        try:
            self.start(balance, state)
            period, _ = self._periodic(self._stepper_at(balance, state.omega))
        except IntegrationFailed:
            return None
        return None if period is None else float(period.energy.sum())

    def _periodic(self, stepper: TimeStepper) -> tuple[PeriodicMotion | None, int]:
        """A stable periodic motion, and the periods marched; else the motion has left it.

        A perturbation that grows slowly must grow with twice the time steps, too: growth by too few steps is
        numerical."""
        period, perturbed, search, after = self._perturbed(stepper, self._begun)
        spent = search + after
        if period is None:
            return None, spent
        self._motion = period.end
        distance = perturbed.grows
        if distance and after > self.options.search:
            options = replace(stepper.options, steps=2 * stepper.options.steps)
            finer = TimeStepper(stepper.balance, stepper.omega, options, stepper.modes)
            repeated, later, search, after = self._perturbed(finer, _converted(period.end, stepper, finer))
            distance, spent = repeated is None or later.grows, spent + search + after
        if not distance:
            return time_integration.motion_of(stepper, period, spent, CONVERGED), spent
        self._motion = perturbed.motion
        return None, spent

    def _perturbed(self, stepper: TimeStepper, motion: Moving) -> tuple[Period | None, PerturbedMotion, int, int]:
        """A periodic motion, None without one; whether a perturbation grows; periods before it and behind it."""
        o = self.options
        options = replace(
            stepper.options, tolerance=RULES.periodic, max_periods=o.search, patience=o.search // 2, accelerate=True
        )
        search = PeriodSearch(stepper, options, False)
        period = search.mix(motion)
        if period.drift > RULES.periodic:
            return None, PerturbedMotion(True, motion), search.periods, 0
        plain = PeriodSearch(stepper, replace(stepper.options, max_periods=o.block * o.most_blocks), False)
        return period, perturb(plain, period, o.block), search.periods, plain.periods

    def _stationary_means(
        self, stepper: TimeStepper, observe: Callable[[PeriodicMotion], np.ndarray], mean_accuracy: float | None
    ) -> MeanMotion:
        """Means of a plain march, once two blocks of periods show one motion, or of one that is passing."""
        o, motion = self.options, self._begun
        search = PeriodSearch(stepper, replace(stepper.options, max_periods=o.block * o.most_blocks), False)
        rows: list[tuple[Any, ...]] = []
        hold_error: list[np.ndarray] = []
        first: int | None = 0 if self._passing else None
        for block in range(1, o.most_blocks + 1):
            for _ in range(o.block):
                means = search.step(motion)
                period = time_integration.motion_of(stepper, means, search.periods, CONVERGED, motion)
                motion = means.end
                hold_error.append(period.hold_error)
                rows.append((period.energy, period.normal_force, observe(period), period.amplitude))
            work, normal = np.array([(row[0].sum(), row[1].sum()) for row in rows]).T
            is_same = block > 1 and first is None and self._is_same_motion(work[-2 * o.block :])
            is_held = self._has_mean(stepper, np.array(hold_error[-o.block :]))
            if is_same and is_held:
                first = len(work) - o.block  # in the block before more of the transient is left
            if mean_accuracy is not None and self._passing:
                estimate = is_held and max(_standard_error(work), _standard_error(normal)) <= mean_accuracy
            else:
                estimate = first is not None and _standard_error(work[first:]) <= o.accuracy
            if estimate:
                break
        self._motion = motion
        history = slice(len(rows) // 2 if first is None else first, None)
        late = work[history]
        energy, normal, observed, amplitude = (np.mean(column, axis=0) for column in zip(*rows[history], strict=True))
        total, error = float(late.mean()), _standard_error(late)
        spread = float(late.std() / total) if total > 0 else 0.0
        is_stationary = first is not None
        return MeanMotion(energy, normal, observed, amplitude, spread, error, is_stationary, periods=len(work))

    def _is_same_motion(self, work: np.ndarray) -> bool:
        """Whether two blocks of periods show one motion."""
        before, after = np.split(work, 2)
        chance = RULES.same_scatter * float(np.hypot(before.std(), after.std())) / np.sqrt(len(after))
        return bool(abs(after.mean() - before.mean()) <= self.options.accuracy * work.mean() + chance)

    def _has_mean(self, stepper: TimeStepper, hold_error: np.ndarray) -> bool:
        """Whether a block of periods has the mean displacement that is prescribed; hold_error : (n_period, k)."""
        if stepper.hold is None:
            return True
        chance = RULES.same_scatter * hold_error.std(axis=0) / np.sqrt(len(hold_error))
        limit = self.options.accuracy * abs(stepper.hold.height) + chance
        return bool((np.abs(hold_error.mean(axis=0)) <= limit).all())

    def _march_options(self) -> Options:
        return Options(self.options.steps, accelerate=False, contact=self.options.contact)

    def _stepper_at(self, balance: HarmonicBalance, omega: float) -> TimeStepper:
        """The stepper at a place; what moves is taken along."""
        before = self._stepper
        if before is not None and before.omega == omega:
            self._stepper = before.worn(balance)
            return self._stepper
        options = self._march_options()
        stepper = TimeStepper(balance, omega, options, None if before is None else before.modes)
        if before is not None and self._motion is not None:
            self._motion = _converted(self._motion, before, stepper)
        self._stepper = stepper
        return stepper


def _standard_error(work: np.ndarray) -> float:
    """Of the mean, relative: the largest by means of ever longer blocks, since periods that follow are not independent.

    Source  Flyvbjerg and Petersen 1989"""
    total, estimates = float(work.mean()), 0.0
    if not total > 0:
        return estimates
    while len(work) >= RULES.fewest_blocks:
        estimates = max(estimates, float(work.std(ddof=1)) / np.sqrt(len(work)) / total)
        work = work[len(work) % 2 :].reshape(-1, 2).mean(axis=1)
    return estimates


def _converted(motion: Moving, before: TimeStepper, after: TimeStepper) -> Moving:
    """What moves, at another frequency: modes that no longer move, or move now, stand still."""
    source, target = before.n_dynamic, after.n_dynamic
    z, common = np.zeros(2 * target), min(source, target)
    z[:common] = motion.z[:common]
    z[target : target + common] = motion.z[source : source + common] * (after.h / before.h)
    return after.moving(z, motion.memory, motion.x, motion.f, motion.hold)
