"""The wear of a run: from the unworn problem until contact is lost, every step kept as soon as it is done."""

from dataclasses import replace
from time import process_time

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.wear import wear_rule
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, WearRow, history, rows_to_resume
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.hbm.wear.wear_rule import RuleSettings, WearRule
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.result.model_facts import Stage
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import references, settings
from tribodyn.workflows.run.checkpoint import Keeper
from tribodyn.workflows.run.full_fields import with_shown
from tribodyn.workflows.run.joints import wear_of, wear_table_of
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Advance
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.structure_tables import NamedContact
from tribodyn.workflows.scene.wear import JointWearTable

KEEPING = 0.01  # share of the time that goes into writing steps: a kill loses as many as take 100 times one writing


def wear_down(file: SceneFile, model: Model, result: Result, keep: Keeper, advance: Advance) -> Result:
    """Wear until contact is lost; steps are kept as they are done, as far as that takes little of the time."""
    scene = file.scene
    patch, wear = result.patch, scene.wear_table
    rows = rows_to_resume(result.wear)
    to_wear = float(patch.area @ patch.free_deflection)

    due = 0.0

    def keep_rows() -> None:
        keep(replace(result, wear=history(rows, WearEnd.UNFINISHED.say(), rule.SCHEME), stage=Stage.WEARING))

    def on_row(row: WearRow) -> None:
        nonlocal due
        rows.append(row)
        if (begun := process_time()) >= due:
            keep_rows()
            due = begun + (process_time() - begun) / KEEPING
        done = float(patch.area @ (row.depth + row.worn)) / to_wear if to_wear > 0 else 0.0
        deepest, hertz = 1e3 * float((row.depth + row.worn).max()), row.omega / (2 * np.pi)
        state = f"{row.cycles + row.cycles_in_step:.3g} cycles, {hertz:.4g} Hz and {1e3 * row.amplitude:.3g} mm"
        note = f"step {len(rows)}, {state}, preload {row.preload:.4g} N, depth {deepest:.3g} mm"
        advance(done, note, (row.cycles + row.cycles_in_step, row.preload))

    problem = wear_problem(scene, model.balance, wear.lost_below, wear.end_at == "at_rest")
    response = result.response
    if response is not None and (peak := response.peak(settings.OUTPUT)) is not None:
        problem = _start(problem, (float(response.omega[peak]), model.balance.shaped(response.contact[peak])))
    scale = settings.depth_scale(scene, patch.free_deflection, patch.area)
    rule = rule_of(scene, problem, scale)
    try:
        worn = evolve(rule, wear.max_steps, on_row, result.wear)
    finally:
        if rows:
            keep_rows()
    result = with_shown(scene, replace(result, wear=worn), model.balance.with_load(problem.mission[0].load), model.part)
    if worn.ended.failed:
        keep(replace(result, stage=Stage.FAILED))
        raise SolveFailed(f"wear step {len(worn.cycles)}: {worn.end}")
    return result


def _start(problem: WearProblem, start: tuple[float, np.ndarray] | None) -> WearProblem:
    """The problem with the known peak as the start of its duties at a peak, see `Duty.start`."""
    at_peak = [duty.load == 1 and duty.balance is None and isinstance(duty.site, AtPeak) for duty in problem.mission]
    mission = (replace(duty, start=start) if at else duty for duty, at in zip(problem.mission, at_peak, strict=True))
    return replace(problem, mission=tuple(mission))


def worn_out(
    file: SceneFile, model: Model, left: float = LIFE_SHARE, start: tuple[float, np.ndarray] | None = None
) -> WearHistory:
    """Wear by the scene's rule until a share `left` of the preload is left; nothing is stored.

    start : peak that its duties there begin at, as `Duty.start` has it"""
    wear, balance = file.scene.wear_table, model.balance
    problem = _start(wear_problem(file.scene, balance, left, wear.end_at == "at_rest"), start)
    scale = settings.depth_scale(file.scene, references.free_deflection(balance), problem.area)
    return evolve(rule_of(file.scene, problem, scale, with_growth=False), wear.max_steps)


def wear_problem(scene: Scene, balance: HarmonicBalance, lost_below: float = 0.0, at_rest: bool = False) -> WearProblem:
    """What a scene wears, by its law and mission.

    lost_below : share of the first preload at which the run ends, of that at rest where `at_rest`"""
    table = scene.wear_table
    own = any(wear_table_of(scene, name) is not table for name in scene.joints)
    wear = {name: wear_of(scene, name) for name in scene.joints} if own else wear_of(scene)
    area = balance.model.interface.area
    vibrating, resting = (0.0, lost_below) if at_rest else (lost_below, None)
    any_joint = table.lost_of == "any"
    return WearProblem(balance, _mission(scene, balance), wear, area, vibrating, resting, any_joint)


def coefficients(scene: Scene) -> dict[str, float]:
    """Wear coefficient [m3/J] of every joint whose volume goes with the friction work; none where a scene wears not."""
    numbers = law_numbers(scene).values()
    return {joint: value for value, _, joints, law in numbers if law == "energy" for joint in joints}


def law_numbers(scene: Scene) -> dict[str, tuple[float, str, tuple[str, ...], str]]:
    """Numbers of wear laws by the keys of the scene: value, name in its law, joints that wear by it, and the law."""
    if scene.wear is None:
        return {}
    own = {name: c.wear for name, c in scene.joints.items() if isinstance(c, NamedContact) and c.wear is not None}
    rest = tuple(name for name in scene.joints if name not in own)
    tables: list[tuple[str, JointWearTable, tuple[str, ...]]] = [("wear", scene.wear, rest)]
    tables += [(f"contacts.{name}.wear", table, (name,)) for name, table in own.items()]
    return {
        f"{key}.{name}": (value, name, joints, table.law)
        for key, table, joints in tables
        for name, value in table.numbers.items()
        if joints and isinstance(value, float) and value
    }


def _mission(scene: Scene, balance: HarmonicBalance) -> tuple[Duty, ...]:
    """The duties of a scene, those at another speed of the wheel with the problem there."""

    def highest(balance_at_speed: HarmonicBalance) -> float:
        return references.highest_linear(balance_at_speed, settings.OUTPUT, *settings.response_range(scene))

    duties = settings.mission(scene, highest(balance))
    if not balance.at_speed:
        return duties
    mission = []
    for duty, table in zip(duties, scene.wear_table.duties, strict=True):
        balance_at_speed = None if table.speed is None else balance.at_speed.get(table.speed)
        if balance_at_speed is not None:
            site = settings.site_of(scene, table.at, highest(balance_at_speed))
            duty = replace(duty, site=site, balance=balance_at_speed)
        mission.append(duty)
    return tuple(mission)


def rule_of(scene: Scene, problem: WearProblem, scale: float, with_growth: bool = True) -> WearRule:
    """The wear rule of a scene, at work on a problem; scale : of `settings.depth_scale` [m]."""
    return wear_rule.build(scene.wear_table.rule_name, problem, rule_settings(scene, scale, with_growth))


def rule_settings(scene: Scene, scale: float, with_growth: bool = True) -> RuleSettings:
    """What the wear rule of a scene is built from; scale : delta_max [m], nan where unknown."""
    wear = scene.wear_table
    return RuleSettings(wear.rule_numbers(scale), scale, wear.motion, with_growth)
