"""The search for a motion that repeats itself after a period, by marching whole periods.

A plain march follows the transient until it has died away. Mixing the states of past periods (Anderson) is much
shorter, and where it is thrown off a periodic motion that a plain march leaves, Newton's method finds that (shooting).
Source  Newton-Krylov shooting: Sanchez, Net, Garcia-Archilla and Simo 2004
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.hbm.time.time_step import Moving, Record


@dataclass(frozen=True)
class SearchRules:
    """How a periodic motion is searched; see docs/accuracy/ablations.md."""

    thrown_off: float = 4.0  # drift, over the smallest one, from which on past periods no longer tell where to go
    lost: float = 100.0  # ... from which on mixing does not come back by itself: the motion leaves the periodic one
    progress: float = 0.9  # drift, over the smallest one, that counts as a better period
    # share of the change of a force that holds a mean displacement, taken after a period that is not mixed
    slowly: float = 1 / 8
    difference: float = 1e-6  # step of the derivative of a period, relative to the state
    krylov: int = 60  # products at most and relative residual of a linear solve
    forcing: float = 0.05
    shortest: float = 1 / 64  # share of a Newton step
    # push of a periodic motion, relative to its vibration; share of it down to which it must die away; times of it
    # that tell growth at the end; distance, relative to the vibration, at which the motion has left
    push: float = 1e-3
    decayed: float = 0.3
    grown: float = 3.0
    left: float = 0.1


RULES = SearchRules()


@dataclass(frozen=True)
class Period:
    """A period that was marched: state vectors before and after it, what moves after it, its record.

    size : of the vibration, as the root of an energy like the length of a state vector
    drift : change of the state over the period, relative to that
    """

    start: np.ndarray
    image: np.ndarray
    end: Moving
    record: Record
    size: float
    drift: float


class Anderson:
    """Mixing: the next iterate to a fixed point z = P(z) from the last ones; on a linear map it is equivalent to GMRES.

    depth : how many differences are remembered
    Source  Anderson 1965; least-squares form of Walker and Ni 2011
    """

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

    best : the period of least drift so far; periods : marched so far
    """

    def __init__(self, stepper: TimeStepper, options: Options, with_slopes: bool):
        self.stepper, self.options, self.with_slopes = stepper, options, with_slopes
        self.vector = StateVector(stepper)
        self.periods, self._best_at = 0, 0
        self.best: Period
        self._last: Period

    def march(self, motion: Moving) -> Period:
        """Plain periods until one repeats itself, or the last one."""
        try:
            found = self.step(motion)
            while found.drift > self.options.tolerance:
                found = self.step(found.end, self.options.patience)
        except GivenUp:
            return self._last
        return found

    def mix(self, motion: Moving) -> Period:
        """Periods mixed from past ones, then Newton's method where they lead away; the best one where both fail."""
        mixing, tried = Anderson(depth=40), None
        try:
            found = self.step(motion)
            while found.drift > self.options.tolerance:
                if found.drift > RULES.thrown_off * self.best.drift:
                    mixing.forget()
                    if found.drift > RULES.lost * self.best.drift and self.best is not tried:
                        found = self._shoot(self.best)
                        tried = self.best
                        continue
                mixed = self.vector.unpack(mixing.propose(found.start, found.image), found.end)
                found = self.step(mixed, self.options.patience)
        except GivenUp:
            return self.best
        return found

    def step(self, motion: Moving, patience: float = np.inf) -> Period:
        """March one period.

        Raises  GivenUp where no further period is allowed, or the best one was `patience` periods ago
        """
        if self.periods >= self.options.max_periods or self.periods - self._best_at >= patience:
            raise GivenUp
        end, record, _, speed = self.stepper.period(motion, self.with_slopes)
        if self.options.accelerate:
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

    def _shoot(self, here: Period) -> Period:
        """Newton's method on P(z) - z = 0, its linear systems by GMRES on differences of P, as far as drift falls."""
        while here.drift > self.options.tolerance:
            miss = here.image - here.start
            size = RULES.difference * float(np.linalg.norm(here.image))

            def product(v: np.ndarray, here: Period = here, size: float = size) -> np.ndarray:
                length = float(np.linalg.norm(v)) / size
                there = self.step(self.vector.unpack(here.start + v / length, here.end))
                return (there.image - here.image) * length - v

            derivative = LinearOperator((len(miss), len(miss)), product, dtype=float)
            step = gmres(derivative, -miss, rtol=RULES.forcing, restart=RULES.krylov, maxiter=1)[0]
            share = 1.0
            while True:
                there = self.step(self.vector.unpack(here.start + share * step, here.end))
                if there.drift < (1 - 0.1 * share) * here.drift:
                    break
                share *= 0.5
                if share < RULES.shortest:
                    return here
            here = there
        return here


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

    def apart(self, a: np.ndarray, b: np.ndarray) -> float:
        """Distance of two state vectors, what the sliders and a hold keep left out."""
        n = 2 * self._stepper.n_dynamic
        return float(np.linalg.norm((a - b)[:n]))

    def pushed(self, vector: np.ndarray, length: float, along: np.ndarray | None = None) -> np.ndarray:
        """A state vector pushed along another, or in all modes alike, the same each time; length : of its modes."""
        n = 2 * self._stepper.n_dynamic
        if along is None:
            along = np.concatenate([np.random.default_rng(0).normal(size=n), np.zeros(len(vector) - n)])
        moved: np.ndarray = vector + along * (length / np.linalg.norm(along[:n]))
        return moved

    def unpack(self, vector: np.ndarray, near: Moving) -> Moving:
        n = len(self._weight)
        z, memory = np.split(vector[:n] / self._weight, [len(near.z)])
        hold = np.linalg.solve(self._root.T, vector[n:])
        return self._stepper.moving(z, memory.reshape(self._shape), near.x, near.f, hold)


class Pushed(NamedTuple):
    """away : whether the motion has left; motion : after the last period that was marched."""

    away: bool
    motion: Moving


def push(plain: PeriodSearch, found: Period, every: int, along: np.ndarray | None = None) -> Pushed:
    """March on from a periodic motion that is pushed, until it has come back or left, or no more periods are allowed.

    plain : of plain periods; found : the periodic motion; every : periods after which to see whether it came back
    along : direction of the push as a state vector, by default all modes alike
    Sliders that come to rest elsewhere leave a part of the push, which does not count as away
    Raises  IntegrationFailed
    """
    away, motion = 0.0, plain.vector.unpack(plain.vector.pushed(found.image, RULES.push * found.size, along), found.end)
    while plain.periods < plain.options.max_periods:
        later = plain.step(motion)
        motion = later.end
        away = plain.vector.apart(later.image, found.image) / found.size
        if away >= RULES.left:
            return Pushed(True, motion)
        if plain.periods % every == 0 and away <= RULES.decayed * RULES.push:
            break
    return Pushed(away > RULES.grown * RULES.push, motion)
