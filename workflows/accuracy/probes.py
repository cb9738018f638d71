"""Errors measured on the very scene: its states, the same with more harmonics, and the unworn one of another mesh.

A run is one set of settings. What another set would say of the first, the middle and the last state of its contact
tells how far off it is; energy per cycle is carried to life, because wear is in proportion to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import process_time

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.operating_point import AtFrequency, AtPeak, NoPeak, OperatingPoint
from tribodyn.hbm.continuation.sites import Site
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.wear.even_wear import depth_to_loss
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import curve, modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.references import delta_max, free_deflection
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene

# shares of the life at which states are looked at: more of the late ones, where the peak moves fast
STATES = (0.0, 0.25, 0.5, 0.65, 0.8, 0.9)
LOW = 0.5  # of the highest point of a curve: where it stays below, no other discretisation has its highest point
OF_CURVES = 2  # times that a curve is followed with more harmonics
BEYOND = 1.2  # times the last frequency at which it is higher: as far as another discretisation may move it
FOR_FIRST = 0.75  # of the seconds for more harmonics, to the unworn state: all but depth and life are its own


@dataclass(frozen=True)
class Answers:
    """What one solved cycle says: frequency [Hz], amplitude of the response [m], friction work [J], preload [N]."""

    hertz: float
    amplitude: float
    energy: float
    preload: float

    @classmethod
    def of(cls, balance: HarmonicBalance, point: OperatingPoint) -> Answers:
        """The answers of a solved operating point."""
        state = point.state
        energy = float(balance.energy(state).sum())
        return cls(state.omega / (2 * np.pi), point.amplitude, energy, balance.preload(state))


@dataclass(frozen=True)
class State:
    """A state of the contact that errors are measured at.

    row : of the wear history, None for the peak of the response of a scene that does not wear
    cycles : passed; depth : (n_pair,) [m]; balance : at that depth; here : its solution
    """

    row: int | None
    cycles: float
    depth: np.ndarray
    balance: HarmonicBalance
    site: Site | OnCurve
    here: OperatingPoint

    @property
    def answers(self) -> Answers:
        """What it says."""
        return Answers.of(self.balance, self.here)


@dataclass(frozen=True)
class OnCurve:
    """The highest point of a response curve that turns back.

    It may be a fold, whose neighbours a search at given frequencies does not see: the curve is followed again.
    highest : frequency [rad/s] up to which it is followed: what lies beyond takes solves and tells nothing
    """

    scene: Scene
    highest: float

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """Follow the curve of a contact as the run does. Raises NoPeak, SolveFailed."""
        branch = curve.follow_response(self.scene, balance, lambda share, note: None, self.highest)
        if not branch.converged[-1]:
            raise SolveFailed(f"the frequency response {branch.end}")
        return highest_of(branch, balance)

    def next(self, balance: HarmonicBalance, omega: float, x: np.ndarray) -> OperatingPoint:
        """The same: a neighbouring solution may lie beyond a fold."""
        return self.first(balance)


def highest_of(branch: Branch, balance: HarmonicBalance) -> OperatingPoint:
    """The highest point of a response curve, as it is; raises NoPeak where that is an end of it."""
    height = np.where(branch.converged, branch.amplitude(branch.output_names[0]), -1.0)
    best = int(np.argmax(height))
    if best in (0, len(height) - 1):
        raise NoPeak("the response is highest at an end of response.frequency, which is no peak: widen the range")
    x = branch.contact[best].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    state = balance.evaluate(float(branch.omega[best]), x)
    return OperatingPoint.of(balance, Solution(state, CONVERGED, 0, 0, ()), branch.output_names[0], len(height))


def _end_of_peak(branch: Branch) -> float:
    """Frequency [rad/s] beyond which a curve is low, with a margin for what another discretisation moves."""
    height = np.where(branch.converged, branch.amplitude(branch.output_names[0]), 0.0)
    return BEYOND * float(branch.omega[height >= LOW * height.max()].max())


def turns_back(branch: Branch) -> bool:
    """Whether a response curve has folds."""
    forward = np.diff(branch.omega) > 0
    return bool(forward.any() and not forward.all())


def states(file: SceneFile, balance: HarmonicBalance, result: Result) -> list[State]:
    """States of a wear run, from unworn to late; the peak of the response where nothing wears."""
    scene = file.scene
    basis = HarmonicBasis(result.harmonics, balance.basis.n_samples)
    wear = result.wear
    if wear is None or not len(wear.cycles) or scene.wear is None:
        if result.response is not None and turns_back(result.response) and balance.contact.n_pair:
            here = highest_of(result.response, balance)
            site = OnCurve(scene, _end_of_peak(result.response))
            return [State(None, 0.0, np.zeros(balance.contact.n_pair), balance, site, here)]
        return [state] if (state := _at_response_peak(scene_peak(file), balance, result)) is not None else []
    left = np.flatnonzero(wear.preload > LIFE_SHARE * wear.preload[0]) if wear.preload[0] > 0 else np.arange(1)
    last = int(left[-1]) if len(left) else 0
    life = float(wear.cycles[min(last + 1, len(wear.cycles) - 1)])
    rows = sorted({int(np.searchsorted(wear.cycles[: last + 1], share * life, "right")) - 1 for share in STATES})
    duty = settings.mission(scene)[0]
    found = []
    for row in rows:
        worn = balance.with_gap(balance.contact.gap + wear.depth[row]).with_load(duty.load)
        flat = basis.transfer(wear.displacement[row], balance.basis)
        x = flat.reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
        point = duty.site.next(worn, float(wear.omega[row]), x)
        if point.solution.converged:
            found.append(State(row, float(wear.cycles[row]), wear.depth[row], worn, duty.site, point))
    return found


def scene_peak(file: SceneFile) -> Site:
    """The resonance peak within the range of the scene's response."""
    return settings.peak_of(file.scene)


def _at_response_peak(site: Site, balance: HarmonicBalance, result: Result) -> State | None:
    branch = result.response
    if branch is None:
        return None
    height = np.where(branch.converged, branch.amplitude(branch.output_names[0]), -1.0)
    best = int(np.argmax(height))
    if height[best] <= 0 or balance.contact.n_pair == 0:
        return None
    if best in (0, len(height) - 1):
        raise NoPeak("the response is highest at an end of response.frequency, which is no peak: widen the range")
    x = branch.contact[best].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    point = site.next(balance, float(branch.omega[best]), x)
    return State(None, 0.0, np.zeros(len(x)), balance, site, point) if point.solution.converged else None


@dataclass(frozen=True)
class Climbed:
    """Answers with more and more harmonics, as far as they were found.

    answers : with the most; before : with the most but one, None where there is but one
    cut : why there are no more, empty where all were found
    """

    answers: Answers
    before: Answers | None
    cut: str


def with_more_harmonics(state: State, steps: int | None = None) -> Climbed | None:
    """The same state with more and more harmonics, its place followed, as far as it is found within the seconds.

    steps : how many times more of them are taken, None: as often as `harmonic_choice.climb` says, on a curve, of which
        each takes all points, OF_CURVES times at most
    None where it is lost at once
    """
    top = state.balance.basis.harmonics[-1]
    basis, x, omega = state.balance.basis, state.here.state.x, state.here.state.omega
    wide = harmonic_choice.widened(state.balance, harmonic_choice.highest_looked_at(top), harmonic_choice.ROUGH)
    found: list[Answers] = []
    climb, cut = harmonic_choice.climb(top)[:steps], ""
    if isinstance(state.site, OnCurve) and len(climb) > OF_CURVES:
        climb, cut = climb[:OF_CURVES], f"a curve is followed with more harmonics {OF_CURVES} times"
    for highest in climb:
        finer = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= highest))
        try:
            point = state.site.next(finer, omega, basis.transfer(x, finer.basis))
            if not point.solution.converged:  # no solution is near: the place is looked for as at the start
                point = state.site.first(finer)
        except (TimeUp, NoPeak) as reason:
            cut = f"harmonics 0 to {highest}: {'beyond the seconds' if isinstance(reason, TimeUp) else reason}"
            break
        if not point.solution.converged:
            cut = f"harmonics 0 to {highest}: {point.solution.outcome}"
            break
        basis, x, omega = finer.basis, point.state.x, point.state.omega
        found.append(Answers.of(finer, point))
    return Climbed(found[-1], found[-2] if len(found) > 1 else None, cut) if found else None


def unworn(file: SceneFile, model: modelling.Model, like: Site | OnCurve | None = None) -> State:
    """The unworn contact of a model.

    like : the place of the scene's own answers: those of the highest point of a curve that turns back are looked for
        on the curve
    Raises  ValueError where it has no peak; RuntimeError where it has no solution
    """
    scene = file.scene
    site: Site | OnCurve = OnCurve(scene, like.highest) if isinstance(like, OnCurve) else scene_peak(file)
    load = 1.0
    if scene.wear is not None:
        duty = settings.mission(scene)[0]
        site, load = duty.site, duty.load
    balance = model.balance.with_load(load)
    point = site.first(balance)
    if not point.solution.converged:
        raise RuntimeError(f"{point.solution.outcome}")
    return State(None, 0.0, np.zeros(balance.contact.n_pair), balance, site, point)


def deepest(file: SceneFile, unworn: State, joint: str | None) -> float:
    """How deep an unworn contact may wear [m], nan where nothing wears.

    That is delta_max; where the part is loose without its contact the depth that takes the preload of a joint, of all
    joints without a name
    """
    if file.scene.wear is None:
        return float("nan")
    balance = unworn.balance
    found = delta_max(file.scene, free_deflection(balance), balance.model.interface.area)
    return depth_to_loss(balance, unworn.here.state, joint) if np.isnan(found) else found


def energy_beside(state: State, reach: float, drop: float) -> float:
    """Largest relative change of the energy at frequencies that the peak might lie at as well.

    reach : relative distance of frequencies from the peak; drop : of the amplitude, relative, within which a frequency
        is as good a peak. On a plateau the energy is another one at each end, and little decides which one is highest
    """
    peak, energy = state.here, float(state.balance.energy(state.here.state).sum())
    if not isinstance(state.site, AtPeak) or energy == 0 or reach == 0:
        return 0.0
    most = 0.0
    for share in (-1.0, -0.5, 0.5, 1.0):
        site = AtFrequency(state.site.output, peak.state.omega * (1 + share * reach), state.site.newton)
        beside = site.next(state.balance, peak.state.omega, peak.state.x)
        if beside.solution.converged and abs(beside.amplitude - peak.amplitude) <= drop * peak.amplitude:
            most = max(most, abs(float(state.balance.energy(beside.state).sum()) - energy) / energy)
    return most


def carried_to_life(seen: list[State], finer: list[Answers | None], cycles: float) -> float | None:
    """Relative error of the cycles from the ratio of energies per cycle at some states, None where one is not known.

    Wear passes a given depth in a number of cycles that is inversely proportional to the energy per cycle; the ratio is
    taken as piecewise linear in the cycles passed.
    """
    if not seen or any(answer is None for answer in finer):
        return None
    at = np.array([state.cycles for state in seen])
    ours = np.array([float(state.balance.energy(state.here.state).sum()) for state in seen])
    theirs = np.array([answer.energy for answer in finer if answer is not None])
    if np.any(ours <= 0) or np.any(theirs <= 0):
        return None
    grid = np.linspace(0.0, cycles, 201)
    ratio = np.interp(grid, at, ours / theirs)
    finer_life = float(np.mean(ratio)) * cycles
    return abs(cycles - finer_life) / finer_life


def compared(a: Answers, b: Answers) -> Iterator[tuple[str, float, float]]:
    """Two answers side by side, by quantity."""
    yield from (
        ("peak_frequency", a.hertz, b.hertz), ("amplitude", a.amplitude, b.amplitude), ("energy", a.energy, b.energy),
        ("preload", a.preload, b.preload),
    )  # fmt: skip


def relative(ours: float, theirs: float) -> float:
    """Difference over the better value; where that vanishes, 0 if both do and 1 if not."""
    if theirs == 0:
        return 0.0 if ours == 0 else 1.0
    return abs(ours - theirs) / abs(theirs)


def each(seen: list[State], look: Callable[[State], Climbed | None], seconds: float) -> Iterator[Climbed | None]:
    """What a look says of every state; None where it fails, or the processor seconds for all of them are spent."""
    end = process_time() + seconds
    for done, state in enumerate(seen):
        try:
            left = end - process_time()
            share = FOR_FIRST if not done and len(seen) > 1 else 1 / (len(seen) - done)
            with processor_seconds(share * left):
                found = look(state)
            yield found
        except (ValueError, RuntimeError, TimeUp):
            yield None
