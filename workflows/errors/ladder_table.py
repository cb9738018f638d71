"""How the values of quantities converge along ladders of settings, and what each setting costs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

from threadpoolctl import threadpool_limits

from tribodyn.hbm.quantity import names_with_error
from tribodyn.refusal import Refusal
from tribodyn.workflows.errors import contact_springs, operating_states
from tribodyn.workflows.errors.change_table import NOT_SOLVED
from tribodyn.workflows.errors.ladders import Ladder, Limit, Setting, ladders_of, limit_of, study_of
from tribodyn.workflows.run import memory, modelling, response_curve
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile

SOLVED = "converged"  # every value that was asked for is there


@dataclass(frozen=True)
class SolvedSetting:
    """Values by quantity, None where the scene does not ask or the solve failed, as `outcome` says.

    pairs : of contact nodes
    seconds : of one processor, of which `wear_seconds` went into wear; memory : its peak [bytes]
    shares : of open, stick and slip in the cycle, over pairs and instants"""

    values: dict[str, float | None]
    pairs: int
    seconds: float
    wear_seconds: float
    memory: float
    outcome: str
    shares: tuple[float, ...] | None = None


@dataclass(frozen=True)
class LadderRow:
    """One setting of a ladder."""

    setting: Setting
    solved: SolvedSetting


@dataclass(frozen=True)
class LadderTable:
    """The rows of a ladder, from coarse to fine, and the limit of each quantity.

    scene_setting : label of the setting of the scene, empty where it is none of them"""

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


@dataclass(frozen=True)
class LadderTables:
    """All ladders of a scene under base."""

    scene: str
    base: tuple[str, ...]
    ladders: tuple[LadderTable, ...]


def solve_setting(file: SceneFile, wears: bool = True) -> SolvedSetting:
    """Solve a scene before wear, and wear it where that is wanted; raises Refusal for what it cannot be."""
    values: dict[str, float | None] = dict.fromkeys(names_with_error())
    outcome, shares, clock = SOLVED, None, process_time()
    memory.forget_peak()
    with threadpool_limits(1):
        model = modelling.build(file, Progress())
        solved = clock
        try:
            if file.scene.wear is not None:
                state = operating_states.unworn_state(file, model)
            else:  # the peak of its response as a run finds it
                branch = response_curve.follow_response(file.scene, model.balance)
                state = operating_states.state_at_peak(file.scene, model.balance, branch)
            values |= state.values
            shares = contact_springs.contact_shares(state.balance, state.point.state)
            solved = process_time()
            if wears and file.scene.wears:
                values |= operating_states.values_through(operating_states.worn_by(file, model))
        except NOT_SOLVED as failure:
            outcome = str(failure)
    end = process_time()
    pairs = model.reduced.interface.n_pair
    return SolvedSetting(values, pairs, end - clock, end - solved, memory.peak(), outcome, shares)


def measure_ladders(
    scene: str, names: Sequence[str], overrides: Sequence[str], say: Callable[[str], None], n_settings: int
) -> LadderTables:
    """Measure ladders of a scene, all that it has where none is named.

    overrides : of the scene, on top of the base of its study; n_settings : settings of each ladder, the coarsest ones
    Raises  Refusal for a ladder that the scene does not have"""
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
            rows.append(LadderRow(setting, row))
        return rows

    def scene_setting(ladder: Ladder) -> str:
        table = with_setting(ladder, None).scene
        matches = (setting for setting in ladder.settings if with_setting(ladder, setting).scene == table)
        return next((setting.label for setting in matches), "")

    tables = tuple(table_of(ladder, rows(ladder), scene_setting(ladder)) for ladder in ladders)
    return LadderTables(plain.name, (*study.base, *overrides), tables)


def table_of(ladder: Ladder, rows: Sequence[LadderRow], scene_setting: str = "") -> LadderTable:
    """Rows of a ladder with the limit of each quantity that the finest of them has."""
    limits = {}
    for quantity in names_with_error():
        points = [(row.setting.size, v) for row in rows if (v := row.solved.values[quantity]) is not None]
        if points and points[-1][1]:
            limits[quantity] = limit_of(*zip(*points, strict=True))
    return LadderTable(ladder, tuple(rows), limits, scene_setting)
