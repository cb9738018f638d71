"""Work and precision of the motion itself: more harmonics, or more time steps, at one place and over a whole life.

At the place where a scene wears, at the highest point of its response, or at a given frequency, every candidate starts
from the same solution: that with the harmonics of the scene at a frequency STRIDE beside it. A balance that does not
converge from there goes through those with fewer harmonics, and time integration starts from the balance with harmonics
up to one of BEFORE_TIME: this counts as their work.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from proof.time_limit import TimeUp, processor_seconds
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import law
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import IntegrationFailed, Options
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.wear.history import LIFE_SHARE, cycles_to_share
from tribodyn.workflows.errors import states
from tribodyn.workflows.errors.limit import Limit, limit_of
from tribodyn.workflows.run import curve, modelling, settings, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.content import code, digests
from tribodyn.workflows.scene.scene_file import SceneFile

TOPS = (1, 3, 5, 7, 9, 15, 31, 63)  # highest harmonic
STEPS = (64, 128, 256, 512, 1024)  # per period
LOCATED, SAMPLED, IN_TIME, LIFE = "located transitions", "sampled transitions", "time integration", "life"
BEFORE_TIME = (7, 15, 31)  # highest harmonics of balances that time integration starts from, until it succeeds
DENSE = 2.2  # time samples over the highest harmonic that located transitions need at the least
PER_HARMONIC, FEWEST = 8, 256  # time samples of sampled transitions: of each period of the highest harmonic; least
STRIDE = 5e-3  # of the frequency, from the solution that all start from
PERIODS, DRIFT = 150, 1e-6  # of time integration: at most; over a period, that counts as none
REPEATS, ENOUGH = 3, 2.0  # solves of which the fastest counts; processor seconds after which none is repeated
TICKS = 0.1  # seconds that the clock of the processor, which may tick every few milliseconds, knows well enough
MOTION_SECONDS, LIFE_SECONDS = 120.0, 600.0  # of the processor, for one motion and for one life
FOUND, BEYOND = "found", "beyond reach: not there within"


@dataclass(frozen=True)
class Candidate:
    """One way to a number and what it cost.

    kind : LOCATED, SAMPLED, IN_TIME or LIFE; size : highest harmonic, or time steps per period
    values : by name in SI units, empty where there is none, for the reason `outcome`; seconds : of the processor
    """

    kind: str
    size: int
    values: dict[str, float]
    seconds: float
    outcome: str


@dataclass(frozen=True)
class WorkPrecision:
    """All candidates of a scene.

    key : of the scene, the frequency asked for and the program; place : frequency [Hz]
    names : quantities of a motion in SI units, friction work per cycle first where there is any
    life_share : of the preload, that a life ends at; None of a scene that does not wear
    """

    scene: str
    overrides: tuple[str, ...]
    key: str
    place: float
    names: tuple[str, ...]
    life_share: float | None
    rows: tuple[Candidate, ...] = ()

    @property
    def drawn(self) -> tuple[str, str]:
        """The two quantities that tell most: a motion's, and life where the scene wears."""
        return self.names[0], self.names[1] if self.life_share is None else LIFE

    def of(self, kind: str) -> tuple[Candidate, ...]:
        """Candidates of one kind, the finest last."""
        return tuple(row for row in self.rows if row.kind == kind)

    def limit(self, kind: str, name: str) -> Limit | None:
        """Where a quantity tends to by candidates of one kind; None where none has found it."""
        known = [(row.size, row.values[name]) for row in self.of(kind) if row.values.get(name)]
        return limit_of(*zip(*known, strict=True)) if known else None

    def reference(self, name: str) -> Limit | None:
        """What errors are relative to: of a motion the limit of the balance, located where the law has that."""
        kinds = (LIFE,) if name == LIFE else (LOCATED, SAMPLED)
        return next((limit for kind in kinds if (limit := self.limit(kind, name)) is not None), None)

    def error(self, row: Candidate, name: str) -> float | None:
        """Relative error of a candidate; None where it has none."""
        limit, value = self.reference(name), row.values.get(name)
        return None if limit is None or value is None else value / limit.value - 1


def run(
    scene: str,
    at: float | None,
    overrides: Sequence[str],
    say: Callable[[str], None],
    keep: Callable[[WorkPrecision], None] = lambda found: None,
    earlier: WorkPrecision | None = None,
) -> WorkPrecision:
    """Measure all candidates of a scene.

    at : frequency [rad/s]; where the scene wears, or the highest point of its response, where None
    overrides : of the scene; keep : called with what is there after each candidate
    earlier : what was kept of the same scene, whose candidates are taken over
    Raises  ValueError for a scene whose motion cannot be, RuntimeError where no solution is there to start from
    """
    file = scene_file.read(scene, overrides)
    wear, start = file.scene.wear if file.scene.wears else None, _start(file, at)
    friction = bool(start.own.contact.tangential) and start.own.energy(start.state).any()
    found = WorkPrecision(
        scene=file.name,
        overrides=tuple(overrides),
        key=key_of(file, at),
        place=start.omega / (2 * np.pi),
        names=("energy", "amplitude") if friction else ("amplitude", "preload"),
        life_share=None if wear is None else max(wear.lost_below, LIFE_SHARE),
    )
    same = earlier is not None and earlier.key == found.key
    known = {(row.kind, row.size): row for row in earlier.rows} if earlier is not None and same else {}
    for kind, sizes in _trials(file).items():
        if kind != LIFE and (kind, sizes[0]) not in known:
            _candidate(start, kind, sizes[0], found.names)  # compiles what the others only use
        for size in sizes:
            row = known.get((kind, size)) or (
                _life(file, size) if kind == LIFE else _cheapest(start, kind, size, found.names)
            )
            say(told(row))
            found = replace(found, rows=(*found.rows, row))
            keep(found)
            if row.outcome.startswith(BEYOND):  # what is finer takes longer
                break
    return found


def key_of(file: SceneFile, at: float | None) -> str:
    """A short name of all that the candidates depend on."""
    scene = file.scene.model_dump(mode="json")
    told = json.dumps([scene, digests(scene, file.folder), at, code()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()[:16]


def _trials(file: SceneFile) -> dict[str, tuple[int, ...]]:
    """Sizes of the candidates by their kind."""
    tops = tops_of(file)
    trials = {SAMPLED: tops, IN_TIME: STEPS} | ({LIFE: tops} if file.scene.wears else {})
    return {LOCATED: tops, **trials} if _locates(file) else trials


def _locates(file: SceneFile) -> bool:
    return all(hasattr(law.load(contact.law_name), "located") for contact in file.scene.joints.values())


def told(row: Candidate) -> str:
    """One candidate for the log."""
    size = f"{row.size} steps" if row.kind == IN_TIME else f"harmonics to {row.size}"
    values = ", ".join(f"{name} {value:.6g}" for name, value in row.values.items())
    return f"{row.kind}, {size}: {row.seconds:.2f} s, {values or row.outcome}"


def tops_of(file: SceneFile) -> tuple[int, ...]:
    """Highest harmonics that a scene can have."""
    needed = max((load.harmonic for load in file.scene.loads.harmonic.values()), default=1)
    return tuple(top for top in TOPS if top >= needed)


def _with_harmonics(file: SceneFile, top: int) -> SceneFile:
    kept = file.scene.harmonics.kept
    first = 1 if kept and 0 not in kept else 0
    samples = max(file.scene.harmonics.samples, _power_of_two(DENSE * top))
    return file.changed(f"harmonics.kept={list(range(first, top + 1))}", f"harmonics.samples={samples}")


def _power_of_two(least: float) -> int:
    return 1 << int(np.ceil(np.log2(least)))


def _life(file: SceneFile, top: int) -> Candidate:
    """The life of a scene with harmonics up to one."""
    wear = file.scene.wear
    assert wear is not None
    share = max(wear.lost_below, LIFE_SHARE)
    clock, values = process_time(), dict[str, float]()
    try:
        with processor_seconds(LIFE_SECONDS):
            fine = _with_harmonics(file, top)
            worn = wear_run.worn_out(fine, modelling.build(fine, Progress()), share)
        outcome, cycles = str(worn.end), cycles_to_share(worn.cycles, worn.preload, share)
        if cycles is not None:
            values[LIFE] = cycles
    except TimeUp:
        outcome = f"{BEYOND} {LIFE_SECONDS:g} s"
    except (ValueError, RuntimeError) as refusal:
        outcome = str(refusal)
    return Candidate(LIFE, top, values, process_time() - clock, outcome)


@dataclass(frozen=True)
class _Start:
    """What all candidates start from.

    problems : by the highest harmonic; own : that of the scene; state : of the latter, STRIDE beside
    omega : where the motion is wanted [rad/s]; located : whether the laws can locate their transitions
    """

    problems: Mapping[int, HarmonicBalance]
    own: HarmonicBalance
    state: State
    omega: float
    located: bool
    options: NewtonOptions


def _start(file: SceneFile, at: float | None) -> _Start:
    scene, options = file.scene, settings.newton_options(file.scene)
    own = modelling.build(file, Progress()).balance
    problems = {top: modelling.build(_with_harmonics(file, top), Progress()).balance for top in tops_of(file)}
    if at is not None:
        point = AtFrequency(settings.OUTPUT, at, options).first(own)
    elif scene.wears:
        duty = settings.mission(scene)[0]
        own, problems = own.with_load(duty.load), {top: b.with_load(duty.load) for top, b in problems.items()}
        point = duty.site.first(own)
    else:
        point = states.highest_of(curve.follow_response(scene, own), own)
    if not point.solution.converged:
        raise RuntimeError(f"there is no motion to begin with: {point.solution.outcome}")
    omega, x = point.state.omega, point.state.x
    for factor in (1 - STRIDE, 1 + STRIDE):
        beside = newton.solve(own, factor * omega, x, options)
        if beside.converged:
            return _Start(problems, own, beside.state, omega, _locates(file), options)
    raise RuntimeError(f"there is no motion beside {omega / (2 * np.pi):g} Hz to start from: {beside.outcome}")


@single
def _cheapest(start: _Start, kind: str, size: int, names: Sequence[str]) -> Candidate:
    """A candidate with the least of a few times, each the mean of as many solves as the processor's clock needs."""
    once = _candidate(start, kind, size, names)
    times = [once.seconds]
    count = 1 + int(TICKS / max(once.seconds, 1e-3))
    while once.values and len(times) < REPEATS and count * sum(times) < ENOUGH:
        times.append(sum(_candidate(start, kind, size, names).seconds for _ in range(count)) / count)
    return replace(once, seconds=min(times[1:] or times))


def _candidate(start: _Start, kind: str, size: int, names: Sequence[str]) -> Candidate:
    clock, values, outcome = process_time(), dict[str, float](), FOUND
    try:
        with processor_seconds(MOTION_SECONDS):
            if kind == IN_TIME:
                values = _of_motion(_integrated(start, size))
            else:
                values = _of_state(*_balanced(start, kind == LOCATED, size))
    except TimeUp:
        outcome = f"{BEYOND} {MOTION_SECONDS:g} s"
    except (ValueError, RuntimeError) as refusal:
        outcome = str(refusal)
    return Candidate(kind, size, {n: values[n] for n in names if n in values}, process_time() - clock, outcome)


def _balanced(start: _Start, located: bool, size: int) -> tuple[HarmonicBalance, State]:
    """The balance with harmonics up to one and its solution, its linear side made for the frequency; raises."""
    x, basis = start.state.x, start.own.basis
    for top in (size, *(t for t in start.problems if basis.harmonics[-1] < t <= size)):
        problem = start.problems[top]
        samples = problem.basis.n_samples if located else max(FEWEST, PER_HARMONIC * (top + 1))
        # of the same harmonics: no frequency is known yet
        balance = problem.with_harmonics(problem.basis.harmonics).with_samples(samples, located)
        solution = newton.solve(balance, start.omega, basis.transfer(x, balance.basis), start.options)
        if solution.converged:
            if top == size:
                return balance, solution.state
            x, basis = solution.state.x, balance.basis
    raise RuntimeError(str(solution.outcome))


def _integrated(start: _Start, steps: int) -> PeriodicMotion:
    """The periodic motion; raises IntegrationFailed where none is found from any of the starts."""
    options = Options(steps, tolerance=DRIFT, max_periods=PERIODS)
    why = "no balance to start from"
    for top in [top for top in start.problems if top in BEFORE_TIME] or list(start.problems)[-1:]:
        try:
            balance, state = _balanced(start, start.located, top)
        except RuntimeError:
            continue
        motion = time_integration.integrate(balance, start.omega, state, options)
        if motion.periodic:
            return motion
        why = str(motion.outcome)
    raise IntegrationFailed(why)


def _of_state(balance: HarmonicBalance, state: State) -> dict[str, float]:
    swing = float(amplitude(balance.outputs(state)[0]))
    return {"energy": float(balance.energy(state).sum()), "amplitude": swing, "preload": balance.preload(state)}


def _of_motion(motion: PeriodicMotion) -> dict[str, float]:
    swing = float(motion.amplitude[0])
    return {"energy": float(motion.energy.sum()), "amplitude": swing, "preload": motion.preload}
