"""The search for a motion that repeats itself after a period, by marching whole periods.

A plain march follows the transient until it has died grows. Mixing the states of past periods (Anderson) is much
shorter, and where it is thrown off a periodic motion that a plain march leaves, Newton's method finds that (shooting).
Source  Newton-Krylov shooting: Sanchez, Net, Garcia-Archilla and Simo 2004"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.hbm.time.time_step import Moving, Record


@dataclass(frozen=True)
class SearchRules:
    """How a periodic motion is searched; see docs/developers/ablations.md."""

    thrown_off: float = 4.0  # drift, over the smallest one, from which on past periods no longer tell where to go
    lost: float = 100.0  # ... from which on mixing does not come back by itself: the motion leaves the periodic one
    progress: float = 0.9  # drift, over the smallest one, that counts as a better period
    # share of the change of a force that holds a mean displacement, taken after a period that is not mixed
    slowly: float = 1 / 8
    difference: float = 1e-6  # step of the derivative of a period, relative to the state
    krylov: int = 60  # products at most and relative residual of a linear solve
    forcing: float = 0.05
    shortest: float = 1 / 64  # share of a Newton step
    # perturbation of a periodic motion, relative to its vibration; share of it down to which it must decay; times of it
    # that mean growth at the end; distance, relative to the vibration, at which the motion has left
    perturbation: float = 1e-3
    decayed: float = 0.3
    grown: float = 3.0
    left: float = 0.1


RULES = SearchRules()


@dataclass(frozen=True)
class Period:
    """A period that was marched: state vectors before and after it, what moves after it, its record.

    size : of the vibration, as the root of an energy like the length of a state vector
    drift : change of the state over the period, relative to that"""

    start: np.ndarray
    image: np.ndarray
    end: Moving
    record: Record
    size: float
    drift: float


class Anderson:
    """Mixing: the next iterate to a fixed point z = P(z) from the last ones; on a linear map it is equivalent to GMRES.

    depth : how many differences are remembered
    Source  Anderson 1965; least-squares form of Walker and Ni 2011"""

    def __init__(self, depth: int):
        self._depth = depth
        self.forget()

    def forget(self) -> None:
        """Start anew, as after a proposal that made things worse."""
        self._z: list[np.ndarray] = []
        self._r: list[np.ndarray] = []

    def propose(self, z: np.ndarray, image: np.ndarray) -> np.ndarray:
        """Next iterate from z and its image P(z), both (n,) in units whose Euclidean norm means something."""
        self._z = [*self._z[-self._depth :], z]
        self._r = [*self._r[-self._depth :], image - z]
        if len(self._z) == 1:
            return image
        dz = np.diff(np.array(self._z), axis=0)
        dr = np.diff(np.array(self._r), axis=0)
        size = np.linalg.norm(dr, axis=1)
        size[size == 0] = 1.0
        gamma = np.linalg.lstsq((dr / size[:, None]).T, self._r[-1], rcond=1e-10)[0] / size
        return image - gamma @ (dz + dr)


class GivenUp(Exception):
    """No periodic motion within the periods allowed."""


class PeriodSearch:
    """Counts the periods marched and keeps the one that repeats itself best.

    best : the period of least drift so far; periods : marched so far"""

    def __init__(self, stepper: TimeStepper, options: Options, with_slopes: bool):
        self.stepper, self.options, self.with_slopes = stepper, options, with_slopes
        self.vector = StateVector(stepper)
        self.periods, self._best_at = 0, 0
        self.best: Period
        self._last: Period

    def march(self, motion: Moving) -> Period:
        """Plain periods until one repeats itself, or the last one."""
        try:
            period = self.step(motion)
            while period.drift > self.options.tolerance:
                period = self.step(period.end, self.options.patience)
        except GivenUp:
            return self._last
        return period

    def mix(self, motion: Moving) -> Period:
        """Periods mixed from past ones, then Newton's method where they lead grows; the best one where both fail."""
        mixing, trial = Anderson(depth=40), None
        try:
            mixture = self.step(motion)
            while mixture.drift > self.options.tolerance:
                if mixture.drift > RULES.thrown_off * self.best.drift:
                    mixing.forget()
                    if mixture.drift > RULES.lost * self.best.drift and self.best is not trial:
                        mixture = self._shoot(self.best)
                        trial = self.best
                        continue
                mixed = self.vector.unpack(mixing.propose(mixture.start, mixture.image), mixture.end)
                mixture = self.step(mixed, self.options.patience)
        except GivenUp:
            return self.best
        return mixture

    def step(self, motion: Moving, patience: float = np.inf) -> Period:
        """March one period.

        Raises  GivenUp where no further period is allowed, or the best one was `patience` periods ago"""
        if self.periods >= self.options.max_periods or self.periods - self._best_at >= patience:
            raise GivenUp
        end, record, _, speed = self.stepper.period(motion, self.with_slopes)
        if self.options.accelerate and not self.options.rigid and not self.stepper.is_timed:
            end = end._replace(memory=self.stepper.memory_of(record.x))
        if self.stepper.hold is not None:
            end = end._replace(hold=self.stepper.hold.after(record))
        z, image = self.vector.pack(motion), self.vector.pack(end)
        if not self.options.accelerate:
            end = end._replace(hold=motion.hold + RULES.slowly * (end.hold - motion.hold))
        change = float(np.linalg.norm(image - z))
        self._last = Period(z, image, end, record, speed, change / speed if speed > 0 else change)
        self.periods += 1
        if self.periods == 1 or self._last.drift < RULES.progress * self.best.drift:
            self.best, self._best_at = self._last, self.periods
        return self._last

    def _shoot(self, state: Period) -> Period:
        """Newton's method on P(z) - z = 0, its linear systems by GMRES on differences of P, as far as drift falls."""
        while state.drift > self.options.tolerance:
            miss = state.image - state.start
            size = RULES.difference * float(np.linalg.norm(state.image))

            def product(v: np.ndarray, state: Period = state, size: float = size) -> np.ndarray:
                length = float(np.linalg.norm(v)) / size
                trial = self.step(self.vector.unpack(state.start + v / length, state.end))
                return (trial.image - state.image) * length - v

            derivative = LinearOperator((len(miss), len(miss)), product, dtype=float)
            step = gmres(derivative, -miss, rtol=RULES.forcing, restart=RULES.krylov, maxiter=1)[0]
            share = 1.0
            while True:
                trial = self.step(self.vector.unpack(state.start + share * step, state.end))
                if trial.drift < (1 - 0.1 * share) * state.drift:
                    break
                share *= 0.5
                if share < RULES.shortest:
                    return state
            state = trial
        return state


class StateVector:
    """(eta, v, memory, hold) as one vector whose square is an energy, and back."""

    def __init__(self, stepper: TimeStepper):
        rate = np.sqrt(np.maximum(stepper.lam, 0.0) + stepper.omega**2)
        self._stepper = stepper
        self._shape = stepper.balance.memory.shape
        k, n_state = stepper.balance.contact.stiffness, self._shape[1]
        if n_state > k.shape[1]:  # sliders of many springs, which share those of the pair
            k = np.repeat(k.mean(axis=1, keepdims=True) / n_state, n_state, axis=1)
        spring = np.sqrt(k[:, :n_state]).ravel()
        spring[spring == 0] = 1.0
        self._weight = np.concatenate([rate, np.full(len(rate), 1 / stepper.h), spring])
        self._root = np.zeros((0, 0)) if stepper.hold is None else stepper.hold.root

    def pack(self, m: Moving) -> np.ndarray:
        return np.concatenate([self._weight * np.concatenate([m.z, m.memory.ravel()]), self._root.T @ m.hold])

    def distance(self, a: np.ndarray, b: np.ndarray) -> float:
        """Distance of two state vectors in their modes alone, without sliders and hold."""
        n = 2 * self._stepper.n_dynamic
        return float(np.linalg.norm((a - b)[:n]))

    def perturbed(self, vector: np.ndarray, length: float, direction: np.ndarray | None = None) -> np.ndarray:
        """A state vector moved along another, or in all modes alike, the same each time; length : of its modes."""
        n = 2 * self._stepper.n_dynamic
        if direction is None:
            direction = np.concatenate([np.random.default_rng(0).normal(size=n), np.zeros(len(vector) - n)])
        shifted: np.ndarray = vector + direction * (length / np.linalg.norm(direction[:n]))
        return shifted

    def unpack(self, vector: np.ndarray, reference: Moving) -> Moving:
        n = len(self._weight)
        z, memory = np.split(vector[:n] / self._weight, [len(reference.z)])
        hold = np.linalg.solve(self._root.T, vector[n:])
        return self._stepper.moving(z, memory.reshape(self._shape), reference.x, reference.f, hold)


class PerturbedMotion(NamedTuple):
    """grows : whether the perturbation grows; motion : after the last period that was marched."""

    grows: bool
    motion: Moving


def perturb(plain: PeriodSearch, period: Period, interval: int, direction: np.ndarray | None = None) -> PerturbedMotion:
    """March a perturbed periodic motion until the perturbation has decayed or grown, or the periods are spent.

    plain : search that marches plain periods; period : the periodic motion; interval : periods between two checks
    direction : of the perturbation as a state vector, by default all modes alike
    Sliders that stop elsewhere leave a part of the perturbation, which does not count as growth
    Raises  IntegrationFailed"""
    perturbed = plain.vector.perturbed(period.image, RULES.perturbation * period.size, direction)
    distance, motion = 0.0, plain.vector.unpack(perturbed, period.end)
    while plain.periods < plain.options.max_periods:
        later = plain.step(motion)
        motion = later.end
        distance = plain.vector.distance(later.image, period.image) / period.size
        if distance >= RULES.left:
            return PerturbedMotion(True, motion)
        if plain.periods % interval == 0 and distance <= RULES.decayed * RULES.perturbation:
            break
    return PerturbedMotion(distance > RULES.grown * RULES.perturbation, motion)
