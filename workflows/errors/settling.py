"""How the answers of a scene settle along its ladders of settings, with what each setting costs; which to take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from threadpoolctl import threadpool_limits

from tribodyn.refusal import Refusal
from tribodyn.workflows.errors import states
from tribodyn.workflows.errors.ladders import Ladder, Setting, ladders_of, study_of
from tribodyn.workflows.errors.limit import Limit, limit_of
from tribodyn.workflows.errors.measure import OF_WEAR, REFUSALS, worn_through
from tribodyn.workflows.errors.states import State
from tribodyn.workflows.result.verdict import NAMES, QUANTITIES
from tribodyn.workflows.run import curve, memory, modelling
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile

ANSWERED = "converged"  # every answer that was asked for is there


@dataclass(frozen=True)
class Measured:
    """Answers by QUANTITIES, None where the scene does not ask or the solve failed, as `outcome` says.

    patch : (n_pair, 2) contact nodes in their plane [m]; work : (n_pair,) of friction per cycle and area [J/m2]
    area : (n_pair,) [m2]
    seconds : of one processor, of which `wearing` went into wear; memory : its peak [bytes]
    """

    values: dict[str, float | None]
    patch: np.ndarray
    area: np.ndarray
    work: np.ndarray
    seconds: float
    wearing: float
    memory: float
    outcome: str


@dataclass(frozen=True)
class Row:
    """One setting of a ladder, measured; share : of the base's seconds, asked for the same answers."""

    setting: Setting
    measured: Measured
    share: float


@dataclass(frozen=True)
class Settling:
    """The rows of a ladder, from coarse to fine, and where each quantity tends to.

    own : label of the scene's own setting, empty where it is none of them
    """

    ladder: Ladder
    rows: tuple[Row, ...]
    limits: dict[str, Limit]
    own: str

    def error(self, row: Row, quantity: str) -> float | None:
        """Relative error of a setting against the limit, with its sign."""
        value, limit = row.measured.values[quantity], self.limits.get(quantity)
        return None if value is None or limit is None else value / limit.value - 1

    def bound(self, row: Row, quantity: str) -> float | None:
        """Size of that error with the doubt in the limit."""
        error = self.error(row, quantity)
        return None if error is None else abs(error) + self.limits[quantity].doubt

    def needed(self, quantity: str, wanted: float) -> Row | None:
        """The coarsest row from which on every one is within the wanted error."""
        found = None
        for row in reversed(self.rows):
            bound = self.bound(row, quantity)
            if bound is not None and bound > wanted:
                break
            found = found if bound is None else row
        return found


@dataclass(frozen=True)
class Settlings:
    """All ladders of a scene under base; seconds : of the scene with it."""

    scene: str
    base: tuple[str, ...]
    seconds: float
    ladders: tuple[Settling, ...]

    def choose(self, wanted: float, quantity: str) -> tuple[tuple[Row, ...], float, float]:
        """The cheapest setting of each ladder such that their errors add up to at most the wanted one.

        Errors of different ladders are added without their signs, times multiply, each over the base's: an integer
        linear program of one choice a ladder. Of a ladder that was not worn, the energy stands for depth and life:
        these go with the work. Ladders with a base of their own are left out.
        Returns the rows, the sum of their errors and the seconds to expect
        Raises  ValueError where no settings meet it
        """
        tables = [table for one in self.ladders if (table := _bounds(one, quantity))]
        flat = [(i, row, error) for i, table in enumerate(tables) for row, error in table]
        if not flat:
            raise Refusal(f"no setting of {self.scene} changes {NAMES[quantity]}")
        one_each = np.array([[float(at == i) for at, _, _ in flat] for i in range(len(tables))])
        errors = np.array([error for _, _, error in flat])
        found = milp(
            np.log([row.share for _, row, _ in flat]),
            constraints=[LinearConstraint(one_each, 1, 1), LinearConstraint(errors[None], 0, wanted)],
            bounds=Bounds(0, 1),
            integrality=1,
        )
        if found.x is None:
            least = sum(min(error for _, error in table) for table in tables)
            raise Refusal(f"{NAMES[quantity]} is known to {least:.2g} at best: it needs finer settings")
        taken = [k for k, used in enumerate(found.x) if used > 0.5]
        rows = tuple(flat[k][1] for k in taken)
        return rows, float(errors[taken].sum()), self.seconds * float(np.prod([row.share for row in rows]))


def _bounds(one: Settling, quantity: str) -> list[tuple[Row, float]]:
    """Rows of a ladder with their errors, where it says anything of a quantity."""
    if one.ladder.base is not None:
        return []
    known = quantity if quantity in one.limits or quantity not in OF_WEAR else "energy"
    return [(row, b) for row in one.rows if (b := one.bound(row, known)) is not None and np.isfinite(b)]


def measure(file: SceneFile, wears: bool = True) -> Measured:
    """Solve a scene's unworn state, and wear it where that is wanted; raises ValueError for what it cannot be."""
    values: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    outcome, clock = ANSWERED, process_time()
    memory.forget_peak()
    with threadpool_limits(1):
        model = modelling.build(file, Progress())
        contact = model.reduced.interface
        work, solved = np.zeros(contact.n_pair), clock
        try:
            state = _state(file, model)
            values |= state.answers
            work = state.balance.energy(state.here.state) / contact.area
            solved = process_time()
            if wears and file.scene.wears:
                values |= dict(zip(OF_WEAR, worn_through(file, model), strict=True))
        except REFUSALS as failure:
            outcome = str(failure)
    end = process_time()
    flat = (contact.points - contact.points.mean(axis=0)) @ contact.frames.mean(axis=0)[:2].T
    return Measured(values, flat, contact.area, work, end - clock, end - solved, memory.peak(), outcome)


def _state(file: SceneFile, model: Model) -> State:
    """Where the scene wears, or the peak of its response, looked for as a run does."""
    if file.scene.wear is not None:
        return states.unworn(file, model)
    branch = curve.follow_response(file.scene, model.balance)
    return states.at_highest(file.scene, model.balance, branch)


def settle(
    scene: str, names: Sequence[str], overrides: Sequence[str], say: Callable[[str], None], most: int
) -> Settlings:
    """Measure ladders of a scene, all that it has where none is named.

    overrides : of the scene, on top of its study's base; most : settings of each ladder, the coarsest ones
    Raises  ValueError for a ladder that the scene does not have
    """
    plain = scene_file.read(scene, overrides)
    study = study_of(plain)
    base = scene_file.read(scene, (*study.base, *overrides))
    ladders = ladders_of(base.scene, study, names)
    known: dict[tuple[str, bool], Measured] = {}

    def of(file: SceneFile, wears: bool) -> Measured:
        key = file.scene.model_dump_json(), wears and file.scene.wears
        if key not in known:
            known[key] = measure(file, wears)
        return known[key]

    measure(base, wears=False)  # compiles what the others only use
    once = of(base, any(one.wears(setting) for one in ladders for setting in one.settings))
    say(f"base: {once.seconds:.1f} s, {once.outcome}")

    def rows(ladder: Ladder) -> list[Row]:
        found = []
        for setting in ladder.settings[:most]:
            given = study.base if ladder.base is None else ladder.base
            try:
                one = of(scene_file.read(scene, (*given, *overrides, *setting.overrides)), ladder.wears(setting))
            except ValueError as refusal:  # such as more interface modes than there are contact DOFs
                say(f"{ladder.name}: {setting.label}: left out: {refusal}")
                continue
            say(f"{ladder.name}: {setting.label}: {one.seconds:.1f} s, {one.outcome}")
            less = 0.0 if one.values["life"] is not None else once.wearing
            found.append(Row(setting, one, (one.seconds + less) / once.seconds))
        return found

    def own(ladder: Ladder) -> str:
        given = study.base if ladder.base is None else ladder.base
        whole = scene_file.read(scene, (*given, *overrides)).scene
        same = (s for s in ladder.settings if whole == scene_file.read(scene, (*given, *overrides, *s.overrides)).scene)
        return next((setting.label for setting in same), "")

    found = tuple(judged(ladder, rows(ladder), own(ladder)) for ladder in ladders)
    return Settlings(plain.name, (*study.base, *overrides), once.seconds, found)


def judged(ladder: Ladder, rows: Sequence[Row], own: str = "") -> Settling:
    """Rows of a ladder with the limit of each quantity that the finest of them answer."""
    limits = {}
    for quantity in QUANTITIES:
        known = [(row.setting.size, v) for row in rows if (v := row.measured.values[quantity]) is not None]
        if known and known[-1][1]:
            limits[quantity] = limit_of(*zip(*known, strict=True))
    return Settling(ladder, tuple(rows), limits, own)
