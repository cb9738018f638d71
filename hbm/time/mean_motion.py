"""What a motion does on average over its periods, whether it repeats itself or not.

A plain march goes where a machine goes: to a stable periodic motion, to one that takes several periods, or to one that
never repeats itself. Energy and wear per cycle then are means over periods, and their scatter is given with them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.period_search import Period, PeriodSearch, Pushed, push
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
    contact : of the contact's equations in a step
    """

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
    seen : mean of what was asked of every period; amplitude : (n_output,) [m]
    spread : standard deviation of the work of a period, over its mean; error : standard error of that mean, relative
    settled : whether the motion came to rest in its statistics; periods : marched in all
    """

    energy: np.ndarray
    normal_force: np.ndarray
    seen: np.ndarray
    amplitude: np.ndarray
    spread: float
    error: float
    settled: bool
    periods: int


class Follower:
    """A motion that is followed while gaps and frequency change, and the loads do not.

    A periodic motion is followed as such, as long as a push dies away. Where it does not, or where nothing repeats
    itself, the motion is marched on plainly, until that becomes periodic.
    """

    def __init__(self, options: MeanOptions):
        self.options = options
        self._stepper: TimeStepper | None = None
        self._motion: Moving | None = None
        self._regular, self._passing = True, False

    def start(self, balance: HarmonicBalance, state: State) -> None:
        """Begin at a state of a balance.

        Raises  ValueError for models with no equation of motion in time; IntegrationFailed
        """
        if balance.model.is_wave:
            raise Refusal("means over a motion serve one part or several bodies, not a travelling wave of a wheel")
        self._motion = self._at(balance, state.omega).start_from(state)
        self._regular, self._passing = True, False

    def kept(self) -> np.ndarray:
        """What moves, as one vector whose length depends on the model alone."""
        stepper, motion = self._stepper, self._motion
        assert stepper is not None
        assert motion is not None
        z = np.pad(motion.z, (0, 2 * len(stepper.modes[0]) - len(motion.z)))
        parts = (motion.x, motion.f, motion.memory, motion.bits, motion.hold)
        return np.concatenate([[stepper.omega, self._regular, self._passing], z, *(np.ravel(part) for part in parts)])

    def take_up(self, balance: HarmonicBalance, kept: np.ndarray) -> None:
        """Go on with what `kept` has given, of a balance that differs in its gaps alone."""
        self._regular, self._passing = bool(kept[1]), bool(kept[2])
        stepper = self._stepper = TimeStepper(balance, float(kept[0]), self._march_options())
        pairs, memory = balance.contact.stiffness.shape, balance.memory.shape
        hold = 0 if stepper.hold is None else len(stepper.hold.dofs)
        sizes = [3, 2 * len(stepper.modes[0]), *2 * (pairs[0] * pairs[1],), memory[0] * memory[1], pairs[0], hold]
        _, z, x, f, s, bits, p = np.split(kept, np.cumsum(sizes)[:-1])
        n = 2 * stepper.n_dynamic
        self._motion = Moving(z[:n], x.reshape(pairs), f.reshape(pairs), s.reshape(memory), bits.astype(np.int64), p)

    def mean(
        self,
        balance: HarmonicBalance,
        omega: float,
        see: Callable[[PeriodicMotion], np.ndarray],
        asked: float | None = None,
    ) -> MeanMotion:
        """Follow the motion to a place, until it is periodic or has settled.

        see : what to average besides, of one period
        asked : standard error, relative, of the work and of the normal force as soon as which a motion that does not
            repeat itself, and has settled once, passes to the next place; None: it settles at every place
        Raises  IntegrationFailed
        """
        stepper = self._at(balance, omega)
        spent = 0
        if self._regular:
            one, spent = self._periodic(stepper)
            if one is not None:
                means = one.energy, one.normal_force, see(one), one.amplitude
                return MeanMotion(*means, spread=0.0, error=0.0, settled=True, periods=spent)
        settled = self._settled(stepper, see, asked)
        self._passing = settled.settled and asked is not None
        self._regular = settled.settled and settled.spread <= self.options.accuracy and not self._passing
        return replace(settled, periods=settled.periods + spent)

    def kept_beside(self, balance: HarmonicBalance, state: State) -> float | None:
        """Friction work [J] of a periodic motion beside that of a balance, if a push does not drive it away."""
        try:
            self.start(balance, state)
            one, _ = self._periodic(self._at(balance, state.omega))
        except IntegrationFailed:
            return None
        return None if one is None else float(one.energy.sum())

    def _periodic(self, stepper: TimeStepper) -> tuple[PeriodicMotion | None, int]:
        """A periodic motion that a push does not drive away, and the periods marched; else the motion has left it.

        A push that grows slowly must grow with twice the time steps, too: growth by few steps alone is no motion's own.
        """
        assert self._motion is not None
        found, pushed, search, after = self._pushed(stepper, self._motion)
        spent = search + after
        if found is None:
            return None, spent
        self._motion = found.end
        away = pushed.away
        if away and after > self.options.search:
            options = replace(stepper.options, steps=2 * stepper.options.steps)
            finer = TimeStepper(stepper.balance, stepper.omega, options, stepper.modes)
            again, later, search, after = self._pushed(finer, _carried(found.end, stepper, finer))
            away, spent = again is None or later.away, spent + search + after
        if not away:
            return time_integration.motion_of(stepper, found, spent, CONVERGED), spent
        self._motion = pushed.motion
        return None, spent

    def _pushed(self, stepper: TimeStepper, motion: Moving) -> tuple[Period | None, Pushed, int, int]:
        """A periodic motion, None without one; whether a push drives it away; periods before the push and behind it."""
        o = self.options
        options = replace(
            stepper.options, tolerance=RULES.periodic, max_periods=o.search, patience=o.search // 2, accelerate=True
        )
        search = PeriodSearch(stepper, options, False)
        found = search.mix(motion)
        if found.drift > RULES.periodic:
            return None, Pushed(True, motion), search.periods, 0
        plain = PeriodSearch(stepper, replace(stepper.options, max_periods=o.block * o.most_blocks), False)
        return found, push(plain, found, o.block), search.periods, plain.periods

    def _settled(
        self, stepper: TimeStepper, see: Callable[[PeriodicMotion], np.ndarray], asked: float | None
    ) -> MeanMotion:
        """Means of a plain march, once two blocks of periods show one motion, or of one that is passing."""
        o, motion = self.options, self._motion
        assert motion is not None
        search = PeriodSearch(stepper, replace(stepper.options, max_periods=o.block * o.most_blocks), False)
        rows: list[tuple[Any, ...]] = []
        off: list[np.ndarray] = []
        first: int | None = 0 if self._passing else None
        for block in range(1, o.most_blocks + 1):
            for _ in range(o.block):
                found = search.step(motion)
                one = time_integration.motion_of(stepper, found, search.periods, CONVERGED, motion)
                motion = found.end
                off.append(one.off)
                rows.append((one.energy, one.normal_force, see(one), one.amplitude))
            work, normal = np.array([(row[0].sum(), row[1].sum()) for row in rows]).T
            same = block > 1 and first is None and self._same(work[-2 * o.block :])
            held = self._held(stepper, np.array(off[-o.block :]))
            if same and held:
                first = len(work) - o.block  # in the block before more of the transient is left
            if asked is not None and self._passing:
                known = held and max(_standard_error(work), _standard_error(normal)) <= asked
            else:
                known = first is not None and _standard_error(work[first:]) <= o.accuracy
            if known:
                break
        self._motion = motion
        kept = slice(len(rows) // 2 if first is None else first, None)
        late = work[kept]
        energy, normal, seen, amplitude = (np.mean(column, axis=0) for column in zip(*rows[kept], strict=True))
        whole, error = float(late.mean()), _standard_error(late)
        spread = float(late.std() / whole) if whole > 0 else 0.0
        return MeanMotion(energy, normal, seen, amplitude, spread, error, settled=first is not None, periods=len(work))

    def _same(self, work: np.ndarray) -> bool:
        """Whether two blocks of periods show one motion."""
        before, after = np.split(work, 2)
        chance = RULES.same_scatter * float(np.hypot(before.std(), after.std())) / np.sqrt(len(after))
        return bool(abs(after.mean() - before.mean()) <= self.options.accuracy * work.mean() + chance)

    def _held(self, stepper: TimeStepper, off: np.ndarray) -> bool:
        """Whether a block of periods has the mean displacement that is prescribed; off : (n_period, k)."""
        if stepper.hold is None:
            return True
        chance = RULES.same_scatter * off.std(axis=0) / np.sqrt(len(off))
        return bool((np.abs(off.mean(axis=0)) <= self.options.accuracy * abs(stepper.hold.height) + chance).all())

    def _march_options(self) -> Options:
        return Options(self.options.steps, accelerate=False, contact=self.options.contact)

    def _at(self, balance: HarmonicBalance, omega: float) -> TimeStepper:
        """The stepper at a place; what moves is taken along."""
        before = self._stepper
        if before is not None and before.omega == omega:
            self._stepper = before.worn(balance)
            return self._stepper
        options = self._march_options()
        stepper = TimeStepper(balance, omega, options, None if before is None else before.modes)
        if before is not None and self._motion is not None:
            self._motion = _carried(self._motion, before, stepper)
        self._stepper = stepper
        return stepper


def _standard_error(work: np.ndarray) -> float:
    """Of the mean, relative: the largest by means of ever longer blocks, since periods that follow are not independent.

    Source  Flyvbjerg and Petersen 1989
    """
    whole, found = float(work.mean()), 0.0
    if not whole > 0:
        return found
    while len(work) >= RULES.fewest_blocks:
        found = max(found, float(work.std(ddof=1)) / np.sqrt(len(work)) / whole)
        work = work[len(work) % 2 :].reshape(-1, 2).mean(axis=1)
    return found


def _carried(motion: Moving, before: TimeStepper, after: TimeStepper) -> Moving:
    """What moves, at another frequency: modes that no longer move, or move now, stand still."""
    old, new = before.n_dynamic, after.n_dynamic
    z, common = np.zeros(2 * new), min(old, new)
    z[:common] = motion.z[:common]
    z[new : new + common] = motion.z[old : old + common] * (after.h / before.h)
    return after.moving(z, motion.memory, motion.x, motion.f, motion.hold)
