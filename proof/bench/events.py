"""Truth of piecewise linear problems: exact flow between events, events located, marched until the motion repeats.

Between two events every element is open, closed, stuck or slipping, and the structure with it is linear: matrix
exponentials carry the state over a time step, and to the instant at which a guard changes its sign. Coordinates without
mass follow statically. Elements with infinite stiffness are set-valued; nothing here is shared with any program."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy.optimize import brentq

from proof.bench.problem import Problem
from proof.bench.record import POINT, Row

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
SIDE = {FORWARD: 1.0, BACKWARD: -1.0}
Mode = tuple[int, ...]
STEPS, MOST_EVENTS, MOST_PERIODS = 512, 50, 600  # of a period, within a step, of a march
TINY = 1e-12  # of its terms, that a guard may be below zero
SETTLED, UNSETTLED = 1e-10, 1e-6  # change over a period, relative to the motion


class Linear(NamedTuple):
    """The structure in one mode of its elements, all by the state z = [q, v, w, 1, cos, sin, ...] of its masses.

    flow : z' = flow z; step : over one time step; u, force : (n_element, 2, n_z) of tangent and normal
    guards : (n_guard, n_z) that stay positive in the mode; owner : element of each; output : (n_z,) what is observed"""

    flow: np.ndarray
    step: np.ndarray
    u: np.ndarray
    force: np.ndarray
    guards: np.ndarray
    owner: np.ndarray
    output: np.ndarray


class Place(NamedTuple):
    """A place on the way: its time [s], the mode from there on, and the state."""

    time: float
    mode: Mode
    z: np.ndarray


class Events:
    """A problem at one frequency [rad/s]."""

    def __init__(self, problem: Problem, omega: float):
        self.problem, self.omega, self.h = problem, omega, 2 * np.pi / omega / STEPS
        self.moving = np.flatnonzero(np.abs(problem.mass).sum(axis=1) > 0)
        self.massless = np.setdiff1d(np.arange(len(problem.mass)), self.moving)
        self.n, self.one = len(self.moving), 2 * len(self.moving) + len(problem.elements)
        self.n_z = self.one + 1 + 2 * len(problem.loads)
        self.linear = lru_cache(maxsize=None)(self._linear)

    def _linear(self, mode: Mode) -> Linear:
        p, d, m, n, e = self.problem, self.moving, self.massless, self.n, len(self.problem.elements)
        rows = np.zeros((e, 2, len(p.mass)))  # tangent and normal of each element
        for j, element in enumerate(p.elements):
            for name, row in zip(element.components, element.rows, strict=True):
                rows[j, int(name == "n")] = row
        # unknowns: accelerations, coordinates without mass, forces of tangent and normal of each element
        size, at = n + len(m) + 2 * e, n + len(m)
        left, right = np.zeros((size, size)), np.zeros((size, self.n_z))
        load = np.zeros((len(p.mass), self.n_z))
        load[:, self.one] = p.static
        for k, (cos, sin) in enumerate(p.loads.values()):
            load[:, self.one + 1 + 2 * k], load[:, self.one + 2 + 2 * k] = cos, sin
        order = np.concatenate([d, m])
        left[:n, :n] = p.mass[np.ix_(d, d)]
        left[: n + len(m), n : n + len(m)] = p.stiffness[np.ix_(order, m)]
        left[: n + len(m), at:] = rows.reshape(2 * e, -1)[:, order].T
        right[: n + len(m)] = load[order]
        right[: n + len(m), :n] -= p.stiffness[np.ix_(order, d)]
        right[:n, n : 2 * n] -= p.damping[np.ix_(d, d)]
        for j, (element, state) in enumerate(zip(p.elements, mode, strict=True)):
            for side, stiffness in enumerate((element.numbers["kt"], element.numbers["kn"])):
                i, row, friction = at + 2 * j + side, rows[j, side], element.numbers["friction"]
                anchor = np.zeros(self.n_z)
                anchor[2 * n + j if side == 0 else self.one] = 1.0 if side == 0 else element.numbers["gap"]
                if not row.any() or state == OPEN:
                    left[i, i] = 1.0  # no force
                elif side == 0 and state in SIDE:
                    left[i, i] = 1.0
                    right[i, self.one] = SIDE[state] * element.numbers["limit"]
                    left[i, i + 1] = -SIDE[state] * friction
                elif np.isfinite(stiffness):  # f = k (u - anchor)
                    left[i, i], left[i, n:at] = 1.0, -stiffness * row[m]
                    right[i, :n] = stiffness * row[d]
                    right[i] -= stiffness * anchor
                elif row[m].any():  # u = anchor
                    left[i, n:at] = row[m]
                    right[i, :n] = -row[d]
                    right[i] += anchor
                else:  # a mass that does not move
                    left[i, :n] = row[d]
        solved = np.linalg.solve(left, right)
        flow = np.zeros((self.n_z, self.n_z))
        flow[:n, n : 2 * n], flow[n : 2 * n] = np.eye(n), solved[:n]
        for k, h in enumerate(p.loads):
            c, s = self.one + 1 + 2 * k, self.one + 2 + 2 * k
            flow[c, s], flow[s, c] = -h * self.omega, h * self.omega
        u = np.einsum("jsm,mz->jsz", rows[:, :, m], solved[n:at])
        u[:, :, :n] += rows[:, :, d]
        force = solved[at:].reshape(e, 2, -1)
        output = p.output[m] @ solved[n:at]
        output[:n] += p.output[d]
        guards, owner = self._guards(mode, u, u @ flow, force, force @ flow)
        return Linear(flow, sla.expm(flow * self.h), u, force, guards, owner, output)

    def _guards(
        self, mode: Mode, u: np.ndarray, rate: np.ndarray, force: np.ndarray, force_rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        guards, owner = [], []
        for j, (element, state) in enumerate(zip(self.problem.elements, mode, strict=True)):
            numbers, one = element.numbers, np.eye(self.n_z)[self.one]
            if "n" in element.components:
                guards.append(numbers["gap"] * one - u[j, 1] if state == OPEN else force[j, 1])
                owner.append(j)
            if state == OPEN or element.components == ("n",):
                continue
            if state == STICK:
                limit = numbers["limit"] * one + numbers["friction"] * force[j, 1]
                guards += [limit - force[j, 0], limit + force[j, 0]]
                owner += [j, j]
            else:
                guards.append(SIDE[state] * (rate[j, 0] - numbers["belt"] * one - force_rate[j, 0] / numbers["kt"]))
                owner.append(j)
        return np.array(guards).reshape(-1, self.n_z), np.array(owner, int)

    def changed(self, mode: Mode, z: np.ndarray, guard: int) -> Mode:
        """The mode behind an event; the anchor of what begins to stick is set in z."""
        now = self.linear(mode)
        j = int(now.owner[guard])
        first = int(np.flatnonzero(now.owner == j)[0])
        element, state = self.problem.elements[j], mode[j]
        if "n" in element.components and guard == first:
            z[2 * self.n + j] = now.u[j, 0] @ z
            return (*mode[:j], STICK if state == OPEN else OPEN, *mode[j + 1 :])
        if state == STICK:
            pull = now.force[j, 0] @ (z + TINY * now.flow @ z / self.omega)  # no shear where it has just touched
            return (*mode[:j], FORWARD if pull > 0 else BACKWARD, *mode[j + 1 :])
        z[2 * self.n + j] = (now.u[j, 0] - now.force[j, 0] / element.numbers["kt"]) @ z
        return (*mode[:j], STICK, *mode[j + 1 :])

    def advance(self, place: Place) -> list[Place]:
        """The places of one time step: behind each event, and its end."""
        places, remaining, (begin, mode, z) = list[Place](), self.h, place
        while len(places) < MOST_EVENTS:
            now = self.linear(mode)
            end = (now.step if remaining == self.h else sla.expm(now.flow * remaining)) @ z
            wrong = np.flatnonzero(now.guards @ end < -TINY * (np.abs(now.guards) @ np.abs(end)))
            if not len(wrong):
                return [*places, Place(begin + self.h, mode, end)]
            instants = [self.instant(now, z, now.guards[i], remaining) for i in wrong]
            first = int(np.argmin(instants))
            z = sla.expm(now.flow * instants[first]) @ z
            mode = self.changed(mode, z, int(wrong[first]))
            remaining -= instants[first]
            places.append(Place(begin + self.h - remaining, mode, z))
        raise RuntimeError(f"{self.problem.name}: events without end at {self.omega:g} rad/s")

    @staticmethod
    def instant(now: Linear, z: np.ndarray, guard: np.ndarray, within: float) -> float:
        if guard @ z <= 0:
            return 0.0
        return float(brentq(lambda t: guard @ (sla.expm(now.flow * t) @ z), 0.0, within, xtol=1e-14 * within))


def sweep(problem: Problem) -> list[Row]:
    """Motions at the frequencies asked for, each marched from the last one's state, upwards and downwards."""
    rows = list[Row]()
    for omegas in (sorted(problem.points), sorted(problem.points, reverse=True)):
        last = None
        for omega in omegas:
            row, last = solve(problem, omega, last)
            if row.error < UNSETTLED and not row.is_in(rows):
                rows.append(row)
    return sorted(rows, key=lambda row: (row.frequency, row.amplitude))


def solve(problem: Problem, omega: float, start: Place | None = None) -> tuple[Row, Place]:
    """The periodic motion that a march leads to, from rest or from a state, and its state."""
    events, drift = Events(problem, omega), np.inf
    rest = (OPEN if "n" in e.components else BACKWARD if e.numbers["belt"] else STICK for e in problem.elements)
    place = start or Place(0.0, tuple(rest), np.zeros(events.n_z))
    for _ in range(MOST_PERIODS):
        z = place.z.copy()
        z[events.one :] = [1.0, *np.tile([1.0, 0.0], len(problem.loads))]
        places = [Place(0.0, place.mode, z)]
        for _ in range(STEPS):
            places += events.advance(places[-1])
        place = places[-1]
        size = max(np.abs(other.z[: events.n]).max() for other in places)
        drift = float(np.abs(place.z[: events.n] - z[: events.n]).max() / size) if size > 0 else 0.0
        if drift < SETTLED:
            break
    return _row(events, places, drift), place


def _row(events: Events, places: list[Place], drift: float) -> Row:
    energy, occupied = 0.0, np.zeros(4)
    belts = np.array([element.numbers["belt"] for element in events.problem.elements])
    for begin, end in pairwise(places):
        now, span = events.linear(begin.mode), end.time - begin.time
        z = sla.expm(now.flow * span) @ begin.z if end.mode != begin.mode else end.z
        friction = 0.5 * (now.force[:, 0] @ (begin.z + z))  # linear in u between two events, or constant
        energy += float(friction @ (now.u[:, 0] @ (z - begin.z) - belts * span))
        np.add.at(occupied, list(begin.mode), span)
    occupied /= occupied.sum()
    slips, observed = occupied[2:].sum(), np.array([events.linear(place.mode).output @ place.z for place in places])
    amplitude = 0.5 * sum(_top(events, places, sign * observed, sign) for sign in (1.0, -1.0))
    even = np.arange(1, STEPS + 1) * events.h
    series = np.interp(even, [place.time for place in places], observed)
    phase = float(np.angle(np.mean(series * np.exp(-1j * events.omega * even))))
    shares = float(occupied[OPEN]), float(occupied[STICK]), float(slips)
    energy, error = energy * (slips > 0), max(drift, SETTLED)
    return Row(POINT, events.omega, amplitude, float(series.mean()), phase, energy, *shares, 1.0, error)


def _top(events: Events, places: list[Place], observed: np.ndarray, sign: float) -> float:
    """Maximum of an observed series times a sign, located where its rate vanishes beside the highest place."""
    highest = int(observed.argmax())
    top = float(observed[highest])
    for begin, end in pairwise(places[max(highest - 1, 0) : highest + 2]):
        now, span = events.linear(begin.mode), end.time - begin.time
        rate = sign * (now.output @ now.flow)
        if rate @ begin.z > 0 > rate @ (sla.expm(now.flow * span) @ begin.z):
            at = sla.expm(now.flow * events.instant(now, begin.z, rate, span)) @ begin.z
            top = max(top, float(sign * (now.output @ at)))
    return top
