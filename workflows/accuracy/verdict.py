"""The verdict on a result: for every quantity its value, its total error, what dominates it, and whether it is stated.

What a reader bets on is the total error, which `at_once` makes of what contributes to it. A quantity with a part that
nobody measured has none; one whose total is above LARGEST, or that belongs to a motion that does not stay or that time
integration contradicts, is not stated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from time import process_time

import numpy as np

from tribodyn.hbm.continuation.operating_point import AtFrequency, NoPeak
from tribodyn.hbm.outcome import SolveEnd
from tribodyn.hbm.stability.stays import MULTIPLIERS
from tribodyn.hbm.wear.error_controlled_rule import jumps
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.accuracy import at_once, jump_probe, mesh_probe, motion_probe, probes, time_probe
from tribodyn.workflows.accuracy.mesh_probe import Probe
from tribodyn.workflows.accuracy.other_meshes import with_more_modes
from tribodyn.workflows.accuracy.probes import Answers, Climbed, State, relative
from tribodyn.workflows.accuracy.statement import LARGEST, QUANTITIES, Contribution, Statement, Verdict
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.accuracy.time_probe import Checked, InTime
from tribodyn.workflows.result import summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

MOST = 0.5  # of the seconds, for more harmonics, which matter most; a mesh needs what is left
FOR_JUMP = 0.5  # of the seconds, for the instant of a jump to another peak, where there is one
FOR_MOTIONS = 0.25  # of the seconds that are left then, for other motions at a given frequency
HALF = 0.5  # of the seconds that are left, for one measurement of several
FOR_MESH = 0.85  # of the seconds that are left then
FOR_ALL = 0.75  # of the seconds that are left then, for all knobs at once
LEAST_FOR_ALL = 0.5  # of the seconds that other meshes took, without which all knobs at once are not tried
CONTRADICTION = 3.0  # times the estimated error, from which on time integration contradicts the balance
LEAST_OWN_ERROR = 1e-3  # of a time integration: how far it is from periodic adds to what its steps make
AT_A_GIVEN_FREQUENCY = ("peak_frequency",)  # a motion at a given frequency tells nothing about it
OF_WEAR = ("depth", "life")  # belong to all states: where a worn motion does not stay, the contact may survive
RESPONSE = ("amplitude", "energy", "preload")
OF_FIRST = ("peak_frequency", *RESPONSE)
MUCH = 0.1  # of the amplitude, from which on more harmonics may make another peak the highest
MOVED = 0.01  # of a quantity of the first state by more harmonics, above which other meshes are solved with them, too


def judge(file: SceneFile, model: Model, result: Result, progress: Progress, spent: float) -> Verdict:
    """Measure the errors of a finished result on its own scene and state what may be stated.

    The scene's [verdict] says which measurements are made and limits their processor seconds
    spent : processor seconds that the run has taken, which limit the measurements where the scene does not
    """
    wanted, clock = file.scene.verdict, process_time()
    allowed = wanted.limit(spent)
    skipped = f"the {allowed:.3g} s of verdict.seconds are used up"

    def left() -> float:
        return allowed - (process_time() - clock)

    try:
        with processor_seconds(HALF * left()):
            seen = probes.states(file, model.balance, result)
    except (NoPeak, TimeUp) as missing:
        why = skipped if isinstance(missing, TimeUp) else str(missing)
        return Verdict(_nothing(why), (), process_time() - clock)
    values = values_of(result, seen)
    parts: list[Contribution] = list(_of_budget(result))
    with progress.stage("verdict: jump"):
        parts += _of_jump(file, model, result, values["life"], FOR_JUMP * left(), skipped)
    with progress.stage("verdict: harmonics"):
        climbed = list(probes.each(seen, probes.with_more_harmonics, MOST * left()))
        lost = f"lost with more harmonics, or beyond the {allowed:.3g} s of verdict.seconds"
        parts += _of_harmonics(result, seen, climbed, values["life"], lost)
    moved = any(
        (part.error or 0.0) > MOVED for part in parts if part.source == "harmonics" and part.quantity in OF_FIRST
    )
    if seen:
        with progress.stage("verdict: other motions"):
            parts += motion_probe.contributions(seen[0], FOR_MOTIONS * left(), skipped)
    more_modes = with_more_modes(file) if wanted.mesh and seen else None  # another model, too
    if more_modes is not None:
        with progress.stage("verdict: modes"):
            parts += Probe(result, seen[0], HALF * left(), skipped).of_modes(more_modes)
    before = left()
    with progress.stage("verdict: mesh"):
        if not wanted.mesh:
            parts += mesh_probe.unknown(at_once.MESH, "verdict.mesh is false")
        elif not seen:
            parts += mesh_probe.unknown(at_once.MESH, "no state was solved")
        else:
            parts += Probe(result, seen[0], FOR_MESH * left(), skipped, moved).of_mesh(file)
    if wanted.mesh and seen and left() > LEAST_FOR_ALL * (before - left()):
        with progress.stage("verdict: all at once"):
            parts += at_once.contributions(file, result.facts.full_dofs, seen[0], FOR_ALL * left())
    with progress.stage("verdict: time integration"):
        checked = time_probe.check(seen, wanted.in_time, left(), skipped)
    with progress.stage("verdict: higher peak"):
        much = any(
            (one.error or 0.0) > MUCH
            for one in parts
            if one.source == at_once.HARMONICS and one.quantity == "amplitude"
        )
        staying, note = _of_staying(file, model, result, values["life"], left() if much else 0.0)
        parts += staying
    parts += _of_mission(file, result)
    statements = {name: _statement(name, values[name], parts, checked, result) for name in QUANTITIES}
    if note and statements["life"].stated:
        statements["life"] = replace(statements["life"], reason=f"{statements['life'].reason}; {note}")
    return Verdict(statements, tuple(parts), process_time() - clock)


def values_of(result: Result, seen: Sequence[State]) -> dict[str, float | None]:
    """The quantities of a result: of its first state, and of its whole wear."""
    values: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    if seen:
        first = Answers.of(seen[0].balance, seen[0].here)
        values |= {"peak_frequency": first.hertz, "amplitude": first.amplitude, "energy": first.energy}
        values["preload"] = first.preload
    if result.wear is not None and result.wear_steps:
        values["depth"] = float(result.depth_after(-1).max())
        values["life"] = summary.life(result)
    return values


def _of_budget(result: Result) -> Iterator[Contribution]:
    """What the error budget has estimated: Newton, samples, wear steps; the peak is refined, whatever the points."""
    for entry in result.budget:
        source, error, how = entry.source, entry.error, entry.by
        if error is None or not how.startswith("estimate") or source == "harmonics":
            continue
        if entry.quantity == "response at the peak":
            for quantity in (*RESPONSE, "life"):
                yield Contribution(source, quantity, error, how)
        elif entry.quantity in ("life", "depth"):
            yield Contribution(source, entry.quantity, error, how)


def _of_harmonics(
    result: Result, seen: Sequence[State], climbed: Sequence[Climbed | None], life: float | None, lost: str
) -> Iterator[Contribution]:
    """The first state, and energies of all states carried to life, with more harmonics.

    Where the first state is lost on the way, what the last of them changed is added: changes that fall by half from one
    to the next sum to it. One change alone tells nothing of those to come
    """
    if not seen:
        yield from mesh_probe.unknown("harmonics", "no state was solved")
        return
    first = climbed[0]
    if first is None:
        yield from mesh_probe.unknown("harmonics", lost)
        return
    ours, how = seen[0].answers, "more harmonics at the same states"
    before = first.before or first.answers
    changes = {name: relative(a, b) for name, a, b in probes.compared(before, first.answers)}
    for quantity, a, b in probes.compared(ours, first.answers):
        further = changes[quantity] if first.cut else 0.0
        yield Contribution("harmonics", quantity, relative(a, b) + further, how)
    if first.cut and first.before is None:
        given = AT_A_GIVEN_FREQUENCY if isinstance(seen[0].site, AtFrequency) else ()
        yield from (one for one in mesh_probe.unknown("harmonics", first.cut) if one.quantity not in given)
    finer = [None if one is None else one.answers for one in climbed]
    if life is not None:
        error = probes.carried_to_life(list(seen), list(finer), life)
        yield Contribution("harmonics", "life", error, how if error is not None else lost)
    if result.wear is not None and result.wear_steps and len(seen) > 1:
        yield Contribution("harmonics", "depth", _depth_error(result, seen, finer), "preload with more harmonics")


def _of_jump(
    file: SceneFile, model: Model, result: Result, life: float | None, seconds: float, skipped: str
) -> list[Contribution]:
    """What more harmonics change in the instant at which the run goes on at another peak; nothing where it does not."""
    wear, scene = result.wear, file.scene
    if wear is None or life is None or scene.wear is None or not jumps(wear.rows()):
        return []
    duty = settings.mission(scene)[0]
    try:
        with processor_seconds(seconds):
            error = jump_probe.life_moved(model.balance, wear, duty, life)
    except TimeUp:
        return [Contribution("instant of the jump", "life", None, skipped)]
    except (ValueError, RuntimeError) as refusal:
        return [Contribution("instant of the jump", "life", None, str(refusal))]
    far = f"with more harmonics it moves by more than {jump_probe.SHARES[-1]:.0%} of the life"
    return [Contribution("instant of the jump", "life", error, far if error is None else "more harmonics decide on it")]


def _of_mission(file: SceneFile, result: Result) -> list[Contribution]:
    """What the other parts of a mission add to depth and life: the states that are asked are those of the first."""
    wear = file.scene.wear
    if wear is None or not result.wear_steps or len(wear.duties) == 1:
        return []
    why = f"the states that a verdict asks are those of the first of {len(wear.duties)} parts of the mission"
    return [Contribution("mission", name, None, why) for name in ("depth", "life")]


def _of_staying(
    file: SceneFile, model: Model, result: Result, life: float | None, seconds: float
) -> tuple[list[Contribution], str]:
    """Whether a run that stays at one peak would leave it with more harmonics, and what to say where nobody asked.

    seconds : of the processor, 0 where more harmonics change too little to ask
    """
    wear, scene = result.wear, file.scene
    if wear is None or life is None or scene.wear is None or jumps(wear.rows()):
        return [], ""
    duty = settings.mission(scene)[0]
    if isinstance(duty.site, AtFrequency):
        return [], ""
    if not seconds:
        few = f"they change the unworn amplitude by less than {MUCH:.0%}"
        return [], f"whether more harmonics would leave this peak was not asked: {few}"
    try:
        with processor_seconds(seconds):
            met = jump_probe.peak_above(model.balance, wear, duty, life)
    except TimeUp:
        return [], "whether more harmonics would leave this peak was not asked: a sweep takes more of verdict.seconds"
    except (ValueError, RuntimeError) as refusal:
        return [], f"whether more harmonics would leave this peak is not known: {refusal}"
    return [Contribution("another peak", "life", None, met)] if met else [], ""


def _depth_error(result: Result, seen: Sequence[State], finer: Sequence[Answers | None]) -> float | None:
    """Depth that makes up for the preload that more harmonics change at the last state, over the largest depth."""
    last, wear = finer[-1], result.wear
    row = seen[-1].row
    if last is None or wear is None or not row:
        return None
    fall = float(wear.preload[row - 1] - wear.preload[row])
    deepened = float(wear.depth[row].max() - wear.depth[row - 1].max())
    if fall <= 0 or deepened <= 0:
        return None
    change = abs(seen[-1].balance.preload(seen[-1].here.state) - last.preload)
    return change / fall * deepened / float(result.depth_after(-1).max())


def _nothing(why: str) -> dict[str, Statement]:
    return {name: Statement(None, None, None, False, why) for name in QUANTITIES}


def _statement(
    name: str, value: float | None, parts: Sequence[Contribution], checked: Checked, result: Result
) -> Statement:
    """One quantity, from what contributes to its error and from time integration of the states it belongs to."""
    if value is None:
        return Statement(None, None, None, False, _absent(name, result))
    own = [part for part in parts if part.quantity == name]
    known = [part for part in own if part.error is not None and np.isfinite(part.error)]
    lacking = [part for part in own if part.error is None or not np.isfinite(part.error)]
    known_error = at_once.total(known)
    single = [part for part in known if part.source != at_once.AT_ONCE]
    largest = max(single, key=lambda part: part.error or 0.0, default=None)
    dominated = largest.source if largest is not None else None
    concerned = () if name in AT_A_GIVEN_FREQUENCY else checked.found if name in OF_WEAR else checked.found[:1]
    wanted = 0 if name in AT_A_GIVEN_FREQUENCY else checked.wanted if name in OF_WEAR else min(checked.wanted, 1)
    if name == "depth":  # what the energy of a cycle is off by moves the cycles, not the depth
        of_life = at_once.total(part for part in parts if part.quantity == "life")
        miss, trouble = 0.0, _in_time("life", concerned, of_life)[1]
    else:
        miss, trouble = _in_time(name, concerned, known_error)
    total = None if lacking else max(known_error, miss)
    if miss > known_error:
        dominated = "harmonics, by time integration"
    if trouble:
        return Statement(value, total, dominated, False, trouble)
    if total is None:
        missing = "; ".join(sorted({f"{part.source}: {part.how}" for part in lacking}))
        large = known_error > LARGEST
        reason = f"total error not known ({missing}); the known parts sum to {known_error:.2g}"
        return Statement(value, None, dominated, not large, reason)
    if total > LARGEST:
        return Statement(value, total, dominated, False, f"its error is above {LARGEST:.0%}")
    reason = "all contributions measured on this scene"
    if wanted and len(concerned) == wanted:
        reason += ", held against time integration"
    elif wanted:
        at = f" at all but {len(concerned)} of {wanted} states" if concerned else ""
        reason += f"; not held against time integration{at}: {checked.refusal}"
    return Statement(value, total, dominated, True, reason)


def _in_time(name: str, concerned: Sequence[tuple[State, InTime]], error: float) -> tuple[float, str]:
    """Largest difference to time integration with its own error, and why the motion cannot be trusted, if it cannot.

    error : that the contributions sum to
    """
    most = 0.0
    for state, check in concerned:
        where = "of the unworn contact" if not state.row else f"after {state.cycles:.3g} cycles"
        miss = abs({"amplitude": check.amplitude, "preload": check.preload}.get(name, check.energy))
        own_error = np.fmax(check.own_error, LEAST_OWN_ERROR)
        if check.outcome.kind is not SolveEnd.CONVERGED and not miss <= CONTRADICTION * (error + own_error):
            return most, f"time integration finds no periodic motion {where}: {check.outcome}"
        if not check.stable and (miss > CONTRADICTION * own_error or check.how == MULTIPLIERS):
            leaves = f"time integration leaves it by {miss:.1%}" if miss > own_error else "no machine shows it"
            return most, f"the motion {where} is unstable by {check.how}: {leaves}"
        if miss > CONTRADICTION * (error + own_error):
            return miss + own_error, f"time integration contradicts the motion {where} by {miss:.1%}"
        if miss > error:
            most = max(most, miss + own_error)
    return most, ""


def _absent(name: str, result: Result) -> str:
    """Why a quantity has no value."""
    if name not in ("depth", "life"):
        return "no state was solved"
    if result.wear is None or not result.wear_steps:
        return "nothing was worn"
    if result.wear.ended.survived and name == "life":
        return f"no life ends here: {result.wear.end}"
    return f"the preload has not fallen to {100 * LIFE_SHARE:g} %: {result.wear.end}"
