"""A response curve followed from both ends at once, by two processes, until they meet.

Steps of a curve follow from each other and are too small to be shared; the ways from its two ends are not. One process
follows the curve from the start, a fork of it from the stop, by the same method. They have met where a step of the one
passes through a point of the other against its sense: on a curve with tangents by `Segment.passes`, on a sweep where
both have the same solution at the same value. What both have is cut there, so that the branch runs from start to stop.

Only a branch that has no memory may be followed so: a harmonic balance over the frequency, from rest at both ends. The
way from the stop is therefore used up to its first jump, gap or step that does not lead back; from there on the way
from the start goes on alone until it comes to it, so that a sweep jumps where it does in its own sense. Not followed so
are paths over other parameters, whose far end nobody knows, curves with a start or bounds of their own, and searches of
peaks, which end where they find one.

Both processes run freely, but what they find is put in order by the evaluations of the balance that it took: where they
meet does not depend on the time that each took. The fork shares the memory of the problem; its own are its points and
what it caches.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from types import ModuleType
from typing import Any

import numpy as np

from tribodyn.hbm import newton, processes
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.branch import Branch, BranchBuilder, BranchPoint, Walk
from tribodyn.hbm.continuation.curve import CurvePoint, Segment
from tribodyn.hbm.continuation.methods.natural import EXTRAPOLATION_DEGREE, extrapolate
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, Outcome
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class MeetingRules:
    """When two solutions are one, and when a step of a sweep is tried backwards."""

    same_share: float = 1e-3  # distance of two solutions that are one, in steps of the curve
    same_error: float = 1e3  # the same where the curve hardly moves, in Newton's tolerances of the solution
    sent_every: int = 16  # evaluations after which the other process sends how far it is
    abrupt: float = 1.0  # miss of the extrapolation, in steps, from which on a step of a sweep is tried backwards


RULES = MeetingRules()


@single
def follow(
    method: ModuleType,
    balance: HarmonicBalance,
    start: float,
    stop: float,
    options: Any = None,
    on_point: Callable[[int, int], None] | None = None,
) -> Branch:
    """Follow a response by a continuation method: from both ends where two threads may work, else from the start.

    method : module with `follow`, and with `begin` where it can be followed from both ends; options : its Options
    start, stop : [rad/s], either order; on_point : called with points done and points expected at the present pace
    Returns  the branch from start to stop. Where the two ways do not meet it is the one from the start, and its end
        says what the other one found besides
    """
    options = method.Options() if options is None else options
    if start == stop or not _may_share(method, options):
        branch: Branch = method.follow(balance, start, stop, options, on_point)
        return branch
    counted = _Counted.of_balance(balance)
    path, work = parameter.of(counted), counted.work
    meeting = _Meeting(parameter.of(balance), options)
    own, theirs = deque[_Stride](), deque[_Stride]()

    def from_stop(writer: Connection) -> None:
        _send(_way_back(lambda: method.begin(path, stop, start, options), path, options.newton, work), work, writer)

    with processes.forked(from_stop) as reader:
        other = _Other(reader)
        walk = method.begin(path, start, stop, options)
        strides = _strides(walk, work)
        while meeting.goes_on:
            stride = next(strides, None)
            if stride is not None:
                own.append(stride)
            theirs.extend(other.arrived(wait=stride is None))
            while meeting.goes_on and (side := _next_side(own, theirs, other.work)) is not None:
                meeting.take(side, (own, theirs)[side].popleft())
            if on_point is not None and meeting.sides[0].points:
                _tell(on_point, meeting, start, stop)
    return meeting.joined(stop) or walk.builder.finish(meeting.alone(stop))


def _may_share(method: ModuleType, options: Any) -> bool:
    """Whether two processes may work here, and nothing in the options asks for one way."""
    free = all(getattr(options, name, None) is None for name in ("guess", "bounds", "patience"))
    return processes.two() and hasattr(method, "begin") and free


class _Work:
    """Evaluations of the balance so far, in all that a walk does. tell : called with them from time to time"""

    def __init__(self) -> None:
        self.done, self.tell = 0, lambda done: None

    def count(self) -> None:
        self.done += 1
        if self.done % RULES.sent_every == 0:
            self.tell(self.done)


@dataclass(frozen=True, eq=False)
class _Counted(HarmonicBalance):
    """A balance that counts how often it is evaluated; those made of it count on."""

    work: _Work = field(default_factory=_Work)

    @classmethod
    def of_balance(cls, balance: HarmonicBalance) -> _Counted:
        return cls(**{own.name: getattr(balance, own.name) for own in fields(balance)})

    def evaluate(self, omega: float, x: np.ndarray, jacobian: bool = True) -> State:
        self.work.count()
        return super().evaluate(omega, x, jacobian)


@dataclass(frozen=True, eq=False)
class _Stride:
    """What one step did to a branch.

    kept : points from before that stay; points : new ones; parts : of the walk
    folds : indices of all that are folds; notes, end : of the walk; work : evaluations of the balance on the whole way
    """

    kept: int
    points: list[BranchPoint]
    parts: list[Segment] | None
    folds: tuple[int, ...]
    notes: str
    end: Outcome[BranchEnd] | None
    work: int


def _strides(walk: Walk, work: _Work) -> Iterator[_Stride]:
    """The first point of a walk and all that its steps do."""
    builder = walk.builder
    end = None
    yield _Stride(0, builder.points[:], walk.parts, (), "", None, work.done)
    while end is None:
        before = len(builder.points)
        end = walk.advance()
        kept = min(before, len(builder.points))
        yield _Stride(kept, builder.points[kept:], walk.parts, tuple(builder.folds), walk.notes, end, work.done)


def _next_side(own: deque[_Stride], theirs: deque[_Stride], their_work: float) -> int | None:
    """Whose stride took less work, 0 from the start or 1 from the stop; None where that is not known yet."""
    if not own:
        return None
    if theirs and theirs[0].work < own[0].work:
        return 1
    return 0 if own[0].work <= their_work else None


@dataclass(eq=False)
class _Side:
    """One of the two ways: its points, their places with tangents where the method has them, and how it ended."""

    points: list[BranchPoint] = field(default_factory=list)
    places: list[CurvePoint | None] = field(default_factory=list)
    folds: tuple[int, ...] = ()
    notes: str = ""
    end: Outcome[BranchEnd] | None = None

    def take(self, stride: _Stride) -> None:
        places = [part.end for part in stride.parts or ()]
        del self.points[stride.kept :], self.places[stride.kept :]
        self.points += stride.points
        self.places += [*places, *[None] * (len(stride.points) - len(places))]
        self.folds, self.notes, self.end = stride.folds, stride.notes, stride.end


class _Meeting:
    """The two ways as far as they are known, in the order of their work, and where they meet."""

    def __init__(self, path: Parameter, options: Any):
        self._path, self._newton = path, options.newton
        self._most = getattr(options, "max_points", np.inf)
        self.sides = (_Side(), _Side())
        self._cut: tuple[int, int] | None = None  # points of either side that the joined branch has
        self._over = False  # nothing more is taken from the stop

    @property
    def goes_on(self) -> bool:
        return self._cut is None and self.sides[0].end is None

    def take(self, side: int, stride: _Stride) -> None:
        """One stride more; of the way from the stop none from its first jump or gap on."""
        if side == 1:
            if self._over or stride.notes:
                self._over = True
                return
            self._over = stride.end is not None
        mine, other = self.sides[side], self.sides[1 - side]
        mine.take(stride)
        found = self._met(mine, other, stride) if stride.kept else None
        if found is not None and sum(found) <= self._most:
            self._cut = found if side == 0 else found[::-1]

    def _met(self, mine: _Side, other: _Side, stride: _Stride) -> tuple[int, int] | None:
        """Points before the meeting, of this side and of the other one."""
        if stride.parts is None:
            return self._met_sweep(mine, other, stride.kept)
        for i, part in enumerate(stride.parts, stride.kept):
            low, high = sorted((part.start.value, part.end.value))
            for j, place in enumerate(other.places):
                if place is None or not low <= place.value <= high:
                    continue
                if part.passes(self._path, place, -1.0, self._newton):
                    return i, j + 1
        return None

    def _met_sweep(self, mine: _Side, other: _Side, new: int) -> tuple[int, int] | None:
        for i in range(new, len(mine.points)):
            before, here = mine.points[i - 1], mine.points[i]
            between = [
                j
                for j, point in enumerate(other.points)
                if point.outcome == CONVERGED
                and point.value != before.value
                and (point.value - before.value) * (point.value - here.value) <= 0
            ]
            if between and here.outcome == CONVERGED and self._has(before, here, other.points[between[-1]]):
                return i, between[-1] + 1
        return None

    def _has(self, before: BranchPoint, here: BranchPoint, point: BranchPoint) -> bool:
        """Whether a step of a sweep has a point between its ends."""
        if point.value == here.value:
            return _same(here.x, point.x, before.x, self._newton)
        share = (point.value - before.value) / (here.value - before.value)
        guess = (1 - share) * before.x + share * here.x
        solution = newton.solve(*self._path.place(point.value), guess, self._newton)
        return solution.converged and _same(solution.state.x, point.x, before.x, self._newton)

    def joined(self, stop: float) -> Branch | None:
        """The branch from start to stop, its double part cut; None where the ways did not meet."""
        if self._cut is None:
            return None
        builder = BranchBuilder(self._path)
        first, second = self.sides
        for i in range(self._cut[0]):
            builder.append(first.points[i], i in first.folds)
        for i in reversed(range(self._cut[1])):
            builder.append(second.points[i], i in second.folds)
        end = BranchEnd.JUMPED if first.notes else BranchEnd.REACHED
        return builder.finish(end.say(f" {self._path.say(stop)}{first.notes}"))

    def alone(self, stop: float) -> Outcome[BranchEnd]:
        """How the way from the start ended, and what the other one found that it has not."""
        (first, second), end = self.sides, self.sides[0].end
        assert end is not None
        found = [point for point in second.points if point.outcome == CONVERGED]
        if len(found) < 2:
            return end
        last = first.points[-1]
        if last.value == stop and _same(last.x, found[0].x, found[1].x, self._newton):
            return end
        there = self._path.say(found[-1].value)
        return end.kind.say(f"{end.detail}; followed from {self._path.say(stop)} the response comes to {there}")


def _same(x: np.ndarray, y: np.ndarray, before: np.ndarray, options: NewtonOptions) -> bool:
    """Whether two solutions at one value are one, on a curve that comes from the solution before."""
    step, size = float(np.linalg.norm(x - before)), float(np.linalg.norm(x))
    near = max(RULES.same_share * step, RULES.same_error * options.tolerance * size)
    return float(np.linalg.norm(x - y)) <= near


def _leads_back(path: Parameter, builder: BranchBuilder, new: int, options: NewtonOptions) -> bool:
    """Whether the last points of a sweep, from a new one on, come from each other both ways: over a jump they do not.

    Tried is what is far from the extrapolation only
    """
    for i in range(new, len(builder.points)):
        before, here = builder.points[i - 1], builder.points[i]
        known = slice(max(0, i - EXTRAPOLATION_DEGREE - 1), i)
        miss = here.x - extrapolate(np.array(builder.value[known]), builder.x[known], here.value)
        if i > 1 and np.linalg.norm(miss) <= RULES.abrupt * np.linalg.norm(here.x - before.x):
            continue
        back = newton.solve(*path.place(before.value), here.x, options)
        if not back.converged or not _same(back.state.x, before.x, here.x, options):
            return False
    return True


class _Other:
    """Strides of the other process as they come. work : that no stride to come has less than"""

    def __init__(self, strides: Connection):
        self._strides = strides
        self.work = 0.0

    def arrived(self, wait: bool) -> Iterator[_Stride]:
        """Strides that are there; where to wait, after one message more. None once the process has ended."""
        while self.work < np.inf and (wait or self._strides.poll()):
            try:
                message = self._strides.recv()
            except EOFError:
                self.work = np.inf
                return
            wait = False
            if isinstance(message, _Stride):
                self.work = message.work if message.end is None else np.inf
                yield message
            else:
                self.work = message


def _send(strides: Iterator[_Stride], work: _Work, writer: Connection) -> None:
    """Send strides and the work so far as they come; the walk does not wait until they are read."""
    waiting: SimpleQueue[_Stride | int | None] = SimpleQueue()
    work.tell = waiting.put
    feeder = Thread(target=_feed, args=(waiting, writer), daemon=True)
    feeder.start()
    for stride in strides:
        waiting.put(stride)
    waiting.put(None)
    feeder.join()


def _way_back(begin: Callable[[], Walk], path: Parameter, options: NewtonOptions, work: _Work) -> Iterator[_Stride]:
    """The way from the stop; of a sweep, up to a step that does not lead back."""
    walk = begin()
    for stride in _strides(walk, work):
        if stride.parts is None and not _leads_back(path, walk.builder, max(stride.kept, 1), options):
            return
        yield stride


def _feed(waiting: SimpleQueue[_Stride | int | None], writer: Connection) -> None:
    while (message := waiting.get()) is not None:
        try:
            writer.send(message)
        except OSError:  # nobody reads any more
            os._exit(0)


def _tell(on_point: Callable[[int, int], None], meeting: _Meeting, start: float, stop: float) -> None:
    ways = [abs(side.points[-1].value - side.points[0].value) for side in meeting.sides if side.points]
    done = sum(len(side.points) for side in meeting.sides)
    on_point(done, max(done, round(done / max(sum(ways) / abs(stop - start), 1e-3))))
