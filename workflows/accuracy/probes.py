"""Errors measured on the very scene: the same states solved with more harmonics, on a coarser mesh, and in time.

A run is one set of settings. What another set would say of the first, the middle and the last state of its contact
tells how far off it is; energy per cycle is carried to life, because wear is in proportion to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

from tribodyn.geometry import parts
from tribodyn.geometry.sources import cad
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.operating_point import NoPeak, OperatingPoint, Site
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import Outcome, SolveEnd
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.time.time_integration import IntegrationFailed, Options
from tribodyn.hbm.time.verify import verify
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import delta_max, free_deflection
from tribodyn.workflows.scene.body import Geometry
from tribodyn.workflows.scene.decks import Deck
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene
from tribodyn.workflows.scene.structure import Body, StructureScene

CLIMB = (3, 5, 7, 9)  # highest harmonics that the estimate climbs through: each start is near enough for Newton
FURTHER = 6  # harmonics beyond the kept ones that it looks at, where more than CLIMB are kept
# elements along every edge of a part; the error is taken to fall in proportion to their size, as at corners and at the
# borders of contacts, and the second mesh is there in case the difference to the first vanishes by chance
COARSER = (2 / 3, 1 / 2)
OF_HALVED = 2.0  # times the difference to elements of half the size bounds the error of a mesh from first order on
OF_MODES = 4 / 3  # times the difference to twice as many modes, whose error falls with their number squared
MOST_HALVED = 200_000  # DOFs of a mesh of halved elements that a verdict solves
# shares of the life at which states are looked at: more of the late ones, where the peak moves fast
STATES = (0.0, 0.25, 0.5, 0.65, 0.8, 0.9)
STEPS, STEPS_PER_HARMONIC = 256, 32  # time steps per period; per period of the highest harmonic kept
PERIODS = 60
DRIFT = 1e-4  # of the vibration over one period: periodic enough for differences above a tenth of a per cent


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
    site: Site
    here: OperatingPoint


@dataclass(frozen=True)
class InTime:
    """The same cycle by direct time integration; differences relative to it.

    own_error : of the integration itself; stable : of the balance solution by Hill's method
    outcome : CONVERGED, or why there is no periodic motion to compare with
    """

    amplitude: float
    energy: float
    preload: float
    own_error: float
    stable: bool
    outcome: Outcome[SolveEnd]


def states(file: SceneFile, balance: HarmonicBalance, result: Result) -> list[State]:
    """States of a wear run, from unworn to late; the peak of the response where nothing wears."""
    scene = file.scene
    basis = HarmonicBasis(result.harmonics, balance.basis.n_samples)
    wear = result.wear
    if wear is None or not len(wear.cycles) or scene.wear is None:
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
    curve = result.response
    if curve is None:
        return None
    height = np.where(curve.converged, curve.amplitude(curve.output_names[0]), -1.0)
    best = int(np.argmax(height))
    if height[best] <= 0 or balance.contact.n_pair == 0:
        return None
    if best in (0, len(height) - 1):
        raise NoPeak("the response is highest at an end of response.frequency, which is no peak: widen the range")
    x = curve.contact[best].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    point = site.next(balance, float(curve.omega[best]), x)
    return State(None, 0.0, np.zeros(len(x)), balance, site, point) if point.solution.converged else None


def with_more_harmonics(state: State) -> Answers | None:
    """The same state with more and more harmonics, its place followed, as far as it is found within the seconds.

    None where it is lost at once
    """
    top = state.balance.basis.harmonics[-1]
    basis, x, omega = state.balance.basis, state.here.state.x, state.here.state.omega
    wide = harmonic_choice.widened(state.balance, max(CLIMB[-1], top + FURTHER))
    answers = None
    for highest in [h for h in CLIMB if h > top + 1] or [top + FURTHER // 2, top + FURTHER]:
        finer = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= highest))
        try:
            point = state.site.next(finer, omega, basis.transfer(x, finer.basis))
            if not point.solution.converged:  # no solution is near: the place is looked for as at the start
                point = state.site.first(finer)
        except (TimeUp, NoPeak):
            return answers
        if not point.solution.converged:
            return answers
        basis, x, omega = finer.basis, point.state.x, point.state.omega
        answers = Answers.of(finer, point)
    return answers


def in_time(state: State) -> InTime:
    """The same state by time integration of the reduced model; raises ValueError where that has no equation in time."""
    harmonics = state.balance.basis.harmonics
    options = Options(max(STEPS, STEPS_PER_HARMONIC * harmonics[-1]), tolerance=DRIFT, max_periods=PERIODS)
    stable = exponents.stability(state.balance, state.here.state).stable
    try:
        found = verify(state.balance, state.here.state, options)
    except IntegrationFailed as failure:
        return InTime(np.nan, np.nan, np.nan, np.nan, stable, SolveEnd.INTEGRATION_FAILED.say(f" {failure}"))
    output = next(iter(found.amplitude.values()), 0.0)
    return InTime(output, found.energy, found.preload, found.step_error, stable, found.outcome)


class Given(ValueError):
    """A mesh that cannot be made again."""


@dataclass(frozen=True)
class Other:
    """The scene with another mesh or reduction, and what differences to it are multiplied by to bound the error.

    how : what it is; along : what of the discretisation it changes: errors of one kind are the same error seen twice
    """

    file: SceneFile
    factor: float
    how: str
    along: str


def on_other_meshes(file: SceneFile, n_dof: int) -> list[Other]:
    """The scene on coarser meshes, or with elements of half the size where its mesh is given.

    A difference can vanish by chance where an answer does not settle from one side: two coarser meshes tell. Edges of a
    part with a single element, which no mesh has fewer of, get more of them. The factors are those of first order, as
    corners and the borders of contacts leave no better one to elements of any order.
    n_dof : of the scene's own mesh
    Raises  ValueError where there is no other mesh, or halved elements are too many for a verdict
    """
    tables, found = _meshed(file), dict[tuple[str, ...], Other]()
    try:
        for share in COARSER:
            fewer = [_fewer_elements(key, table, file.folder, share) for key, table in tables.items()]
            ratio = float(np.mean([ratio for _, ratio in fewer]))
            texts = tuple(text for more, _ in fewer for text in more)
            found[texts] = Other(file.changed(*texts), 1 / (ratio - 1), "a coarser mesh", "most edges")
    except Given:
        if 8 * n_dof > MOST_HALVED:
            raise ValueError(
                f"the mesh is given, and its elements halved would have some {8 * n_dof:.2g} DOFs, beyond the "
                f"{MOST_HALVED:.2g} that a verdict solves: compare with a run on another mesh"
            ) from None
        texts = tuple(f"{key}.halved={table.halved + 1}" for key, table in tables.items())
        return [Other(file.changed(*texts), OF_HALVED, "halved elements", "most edges")]
    single = tuple(text for key, table in tables.items() for text in _more_of_single_ones(key, table))
    if single:
        found[single] = Other(file.changed(*single), OF_HALVED, "more elements along short edges", "short edges")
    return list(found.values())


def with_more_modes(file: SceneFile) -> Other | None:
    """The scene with twice as many modes retained, None where it has no such number."""
    reduction = getattr(file.scene, "reduction", None)
    if reduction is None or not (reduction.modes or reduction.cutoff):
        return None
    key, value = ("modes", reduction.modes) if reduction.modes else ("cutoff", reduction.cutoff)
    return Other(file.changed(f"reduction.{key}={2 * value!r}"), OF_MODES, "twice as many modes", "modes")


def _meshed(file: SceneFile) -> dict[str, Geometry | Body | Deck]:
    """The tables of a scene that give a mesh, by their keys; raises ValueError without one."""
    scene = file.scene
    if isinstance(scene, PartScene | StructureScene) and scene.geometry is not None:
        return {"geometry": scene.geometry}
    if not isinstance(scene, StructureScene):
        raise ValueError("matrices come without a mesh")
    tables: dict[str, Geometry | Body | Deck] = {f"bodies.{name}": body for name, body in scene.bodies.items()}
    return tables | {f"decks.{name}": deck for name, deck in scene.decks.items()}


def _fewer_elements(key: str, table: Geometry | Body | Deck, folder: Path, share: float) -> tuple[list[str], float]:
    """Overrides that give a body a share of its elements along every edge, and by how much fewer they are.

    Raises  Given where there are none
    """
    if not isinstance(table, Deck) and table.part_name is not None:
        part = parts.load(table.part_name)
        own = part.Parameters(**table.parameters)
        fewer = parts.rescaled(part, own, share)
        if not fewer:
            raise Given(f"the part of [{key}] lists no counts of elements in MESH")
        ratio = float(np.mean([getattr(own, name) / count for name, count in fewer.items()]))
        return [f"{key}.{name}={count}" for name, count in fewer.items()], ratio
    if not isinstance(table, Body) or Path(str(table.mesh)).suffix.lower() not in cad.ENDINGS:
        raise Given(f"the mesh of [{key}] is given")
    size = table.size or table.unit * cad.default_size(folder / str(table.mesh))
    faces = ", ".join(f'"{name}" = {face / share:.6g}' for name, face in table.face_sizes.items())
    return [f"{key}.size={size / share:.6g}", *([f"{key}.face_sizes={{{faces}}}"] if faces else [])], 1 / share


def _more_of_single_ones(key: str, table: Geometry | Body | Deck) -> list[str]:
    """Overrides that give a part more elements where no mesh of it has fewer."""
    if isinstance(table, Deck) or table.part_name is None:
        return []
    part = parts.load(table.part_name)
    own = part.Parameters(**table.parameters)
    fewer, more = (parts.rescaled(part, own, share) for share in (COARSER[0], 1 / COARSER[0]))
    return [f"{key}.{name}={count}" for name, count in more.items() if name not in fewer]


def unworn(other: SceneFile, harmonics: tuple[int, ...]) -> tuple[Answers, float]:
    """Answers of the unworn contact of a scene on another mesh, and its delta_max [m].

    Raises  ValueError where it has no peak; RuntimeError where it has no solution
    """
    model = modelling.build(other, None, Progress(), harmonics)
    scene, balance = other.scene, model.balance
    site, load = scene_peak(other), 1.0
    if scene.wear is not None:
        duty = settings.mission(scene)[0]
        site, load = duty.site, duty.load
    point = site.first(balance.with_load(load))
    if not point.solution.converged:
        raise RuntimeError(f"{point.solution.outcome}")
    area = balance.model.interface.area
    deepest = delta_max(scene, free_deflection(balance), area) if scene.wear is not None else float("nan")
    return Answers.of(balance.with_load(load), point), deepest


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


def relative(ours: float, theirs: float) -> float:
    """Difference over the better value; where that vanishes, 0 if both do and 1 if not."""
    if theirs == 0:
        return 0.0 if ours == 0 else 1.0
    return abs(ours - theirs) / abs(theirs)


def each(seen: list[State], look: Callable[[State], Answers | None], seconds: float) -> Iterator[Answers | None]:
    """What a look says of every state; None where it fails, or the processor seconds for all of them are spent."""
    end = process_time() + seconds
    for done, state in enumerate(seen):
        try:
            left = end - process_time()  # half of it for the first state: all quantities but depth and life are its own
            with processor_seconds(left / (len(seen) - done) if done else 0.5 * left):
                answers = look(state)
            yield answers
        except (ValueError, RuntimeError, TimeUp):
            yield None
