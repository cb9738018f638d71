"""How the values of quantities converge along ladders of settings, what each setting costs, and which to take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from threadpoolctl import threadpool_limits

from tribodyn.hbm.quantity import WearQuantity, load, names_with_error
from tribodyn.refusal import Refusal
from tribodyn.workflows.errors import operating_states
from tribodyn.workflows.errors.change_table import NOT_SOLVED
from tribodyn.workflows.errors.extrapolation import Limit, limit_of
from tribodyn.workflows.errors.ladders import Ladder, Setting, ladders_of, study_of
from tribodyn.workflows.errors.operating_states import OperatingState
from tribodyn.workflows.errors.wear_values import wear_through
from tribodyn.workflows.run import memory, modelling, response_curve
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile

SOLVED = "converged"  # every value that was asked for is there
WORK = "energy"  # the quantity that stands for those of a ladder that was not worn: they go with the work


@dataclass(frozen=True)
class SolvedSetting:
    """Values by quantity, None where the scene does not ask or the solve failed, as `outcome` says.

    patch : (n_pair, 2) contact nodes in their plane [m]; work : (n_pair,) of friction per cycle and area [J/m2]
    area : (n_pair,) [m2]
    seconds : of one processor, of which `wear_seconds` went into wear; memory : its peak [bytes]
    """

    values: dict[str, float | None]
    patch: np.ndarray
    area: np.ndarray
    work: np.ndarray
    seconds: float
    wear_seconds: float
    memory: float
    outcome: str


@dataclass(frozen=True)
class LadderRow:
    """One setting of a ladder; share : of the seconds of the base, asked for the same values."""

    setting: Setting
    solved: SolvedSetting
    share: float


@dataclass(frozen=True)
class LadderTable:
    """The rows of a ladder, from coarse to fine, and the limit of each quantity.

    scene_setting : label of the setting of the scene, empty where it is none of them
    """

    ladder: Ladder
    rows: tuple[LadderRow, ...]
    limits: dict[str, Limit]
    scene_setting: str

    def error(self, row: LadderRow, quantity: str) -> float | None:
        """Relative error of a setting against the limit, with its sign."""
        value, limit = row.solved.values[quantity], self.limits.get(quantity)
        return None if value is None or limit is None else value / limit.value - 1

    def bound(self, row: LadderRow, quantity: str) -> float | None:
        """Size of that error with the doubt in the limit."""
        error = self.error(row, quantity)
        return None if error is None else abs(error) + self.limits[quantity].doubt

    def coarsest(self, quantity: str, error: float) -> LadderRow | None:
        """The coarsest row from which on every one is within an error."""
        coarsest = None
        for row in reversed(self.rows):
            bound = self.bound(row, quantity)
            if bound is not None and bound > error:
                break
            coarsest = coarsest if bound is None else row
        return coarsest

    def bounds(self, quantity: str) -> list[tuple[LadderRow, float]]:
        """Rows with their errors, where the ladder says anything of a quantity; empty for one with its own base."""
        if self.ladder.base is not None:
            return []
        unworn = isinstance(load(quantity), WearQuantity) and quantity not in self.limits
        bounds = [(row, self.bound(row, WORK if unworn else quantity)) for row in self.rows]
        return [(row, bound) for row, bound in bounds if bound is not None and np.isfinite(bound)]


@dataclass(frozen=True)
class LadderTables:
    """All ladders of a scene under base; seconds : of the scene with it."""

    scene: str
    base: tuple[str, ...]
    seconds: float
    ladders: tuple[LadderTable, ...]

    def choose(self, error: float, quantity: str) -> tuple[tuple[LadderRow, ...], float, float]:
        """The cheapest setting of each ladder such that their errors add up to at most one error.

        Errors of different ladders are added without their signs, times multiply, each over that of the base: an
        integer linear program of one choice a ladder. Ladders with a base of their own are left out.
        Returns the rows, the sum of their errors and the seconds to expect
        Raises  Refusal where no settings meet it
        """
        tables = [bounds for table in self.ladders if (bounds := table.bounds(quantity))]
        choices = [(i, row, bound) for i, bounds in enumerate(tables) for row, bound in bounds]
        label = load(quantity).label
        if not choices:
            raise Refusal(f"no setting of {self.scene} changes {label}")
        one_each = np.array([[float(ladder == i) for ladder, _, _ in choices] for i in range(len(tables))])
        errors = np.array([bound for _, _, bound in choices])
        program = milp(
            np.log([row.share for _, row, _ in choices]),
            constraints=[LinearConstraint(one_each, 1, 1), LinearConstraint(errors[None], 0, error)],
            bounds=Bounds(0, 1),
            integrality=1,
        )
        if program.x is None:
            least = sum(min(bound for _, bound in bounds) for bounds in tables)
            raise Refusal(f"{label} is known to {least:.2g} at best: it needs finer settings")
        chosen = [k for k, used in enumerate(program.x) if used > 0.5]
        rows = tuple(choices[k][1] for k in chosen)
        return rows, float(errors[chosen].sum()), self.seconds * float(np.prod([row.share for row in rows]))


def solve_setting(file: SceneFile, wears: bool = True) -> SolvedSetting:
    """Solve a scene before wear, and wear it where that is wanted; raises Refusal for what it cannot be."""
    values: dict[str, float | None] = dict.fromkeys(names_with_error())
    outcome, clock = SOLVED, process_time()
    memory.forget_peak()
    with threadpool_limits(1):
        model = modelling.build(file, Progress())
        contact = model.reduced.interface
        work, solved = np.zeros(contact.n_pair), clock
        try:
            state = _operating_state(file, model)
            values |= state.values
            work = state.balance.energy(state.point.state) / contact.area
            solved = process_time()
            if wears and file.scene.wears:
                values |= wear_through(file, model)
        except NOT_SOLVED as failure:
            outcome = str(failure)
    end = process_time()
    flat = (contact.points - contact.points.mean(axis=0)) @ contact.frames.mean(axis=0)[:2].T
    return SolvedSetting(values, flat, contact.area, work, end - clock, end - solved, memory.peak(), outcome)


def _operating_state(file: SceneFile, model: Model) -> OperatingState:
    """Where the scene wears, or the peak of its response, found as a run finds it."""
    if file.scene.wear is not None:
        return operating_states.unworn_state(file, model)
    branch = response_curve.follow_response(file.scene, model.balance)
    return operating_states.state_at_peak(file.scene, model.balance, branch)


def measure_ladders(
    scene: str, names: Sequence[str], overrides: Sequence[str], say: Callable[[str], None], n_settings: int
) -> LadderTables:
    """Measure ladders of a scene, all that it has where none is named.

    overrides : of the scene, on top of the base of its study; most : settings of each ladder, the coarsest ones
    Raises  Refusal for a ladder that the scene does not have
    """
    plain = scene_file.read(scene, overrides)
    study = study_of(plain)
    base = scene_file.read(scene, (*study.base, *overrides))
    ladders = ladders_of(base.scene, study, names)
    solved: dict[tuple[str, bool], SolvedSetting] = {}

    def solve(file: SceneFile, wears: bool) -> SolvedSetting:
        key = file.scene.model_dump_json(), wears and file.scene.wears
        if key not in solved:
            solved[key] = solve_setting(file, wears)
        return solved[key]

    solve_setting(base, wears=False)  # compiles what the others only use
    reference = solve(base, any(ladder.wears(setting) for ladder in ladders for setting in ladder.settings))
    say(f"base: {reference.seconds:.1f} s, {reference.outcome}")

    def with_setting(ladder: Ladder, setting: Setting | None) -> SceneFile:
        general = study.base if ladder.base is None else ladder.base
        return scene_file.read(scene, (*general, *overrides, *(setting.overrides if setting else ())))

    def rows(ladder: Ladder) -> list[LadderRow]:
        rows = []
        for setting in ladder.settings[:n_settings]:
            try:
                row = solve(with_setting(ladder, setting), ladder.wears(setting))
            except Refusal as refusal:  # such as more interface modes than there are contact DOFs
                say(f"{ladder.name}: {setting.label}: left out: {refusal}")
                continue
            say(f"{ladder.name}: {setting.label}: {row.seconds:.1f} s, {row.outcome}")
            is_worn = all(row.values[name] is not None for name in names_with_error())
            unworn_seconds = 0.0 if is_worn else reference.wear_seconds
            rows.append(LadderRow(setting, row, (row.seconds + unworn_seconds) / reference.seconds))
        return rows

    def scene_setting(ladder: Ladder) -> str:
        table = with_setting(ladder, None).scene
        matches = (setting for setting in ladder.settings if with_setting(ladder, setting).scene == table)
        return next((setting.label for setting in matches), "")

    tables = tuple(table_of(ladder, rows(ladder), scene_setting(ladder)) for ladder in ladders)
    return LadderTables(plain.name, (*study.base, *overrides), reference.seconds, tables)


def table_of(ladder: Ladder, rows: Sequence[LadderRow], scene_setting: str = "") -> LadderTable:
    """Rows of a ladder with the limit of each quantity that the finest of them has."""
    limits = {}
    for quantity in names_with_error():
        points = [(row.setting.size, v) for row in rows if (v := row.solved.values[quantity]) is not None]
        if points and points[-1][1]:
            limits[quantity] = limit_of(*zip(*points, strict=True))
    return LadderTable(ladder, tuple(rows), limits, scene_setting)
