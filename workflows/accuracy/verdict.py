"""The verdict on a result: for every quantity its value, its total error, what dominates it, and whether it is stated.

Contributions are added without their signs: what a reader bets on is their sum. A quantity with a part that nobody
measured has no total error; one whose total is above LARGEST, or that belongs to a motion that does not stay or that
time integration contradicts, is not stated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from time import process_time

import numpy as np

from tribodyn.hbm.continuation.operating_point import NoPeak
from tribodyn.hbm.outcome import SolveEnd
from tribodyn.hbm.wear.error_controlled_rule import jumps
from tribodyn.hbm.wear.history import LIFE_SHARE, cycles_to_preload
from tribodyn.workflows.accuracy import jump_probe, probes
from tribodyn.workflows.accuracy.probes import Answers, InTime, Other, State, relative
from tribodyn.workflows.accuracy.statement import LARGEST, QUANTITIES, Contribution, Statement, Verdict
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

MOST = 0.8  # of the seconds, for more harmonics, which matter most
FOR_JUMP = 0.5  # of the seconds, for the instant of a jump to another peak, where there is one
HALF = 0.5  # of the seconds that are left, for one measurement of several
MESH = "mesh and contact grid"
CONTRADICTION = 3.0  # times the estimated error, from which on time integration contradicts the balance
RESPONSE = ("amplitude", "energy", "preload")


def judge(file: SceneFile, model: Model, result: Result, progress: Progress, spent: float) -> Verdict:
    """Measure the errors of a finished result on its own scene and state what may be stated.

    The scene's [verdict] says which measurements are made and limits their processor seconds
    spent : seconds that the run has taken, which limit the measurements where the scene does not
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
        finer = list(probes.each(seen, probes.with_more_harmonics, MOST * left()))
        lost = f"lost with more harmonics, or beyond the {allowed:.3g} s of verdict.seconds"
        parts += _of_harmonics(result, seen, finer, values["life"], lost)
    more_modes = probes.with_more_modes(file) if wanted.mesh else None  # another model, too
    if more_modes is not None:
        with progress.stage("verdict: modes"):
            parts += _of_others("modes", lambda: [more_modes], result, seen, HALF * left(), skipped)
    with progress.stage("verdict: mesh"):
        meshes = partial(probes.on_other_meshes, file, result.facts.full_dofs)
        parts += (
            list(_of_others(MESH, meshes, result, seen, HALF * left() if wanted.in_time else left(), skipped))
            if wanted.mesh
            else _unknown(MESH, "verdict.mesh is false")
        )
    checks: list[tuple[State, InTime]] = []
    refusal = "" if wanted.in_time else "verdict.in_time is false"
    if wanted.in_time:
        with progress.stage("verdict: time integration"):
            for state in [seen[i] for i in sorted({0, len(seen) // 2, len(seen) - 1})] if seen else []:
                try:
                    with processor_seconds(left()):
                        checks.append((state, probes.in_time(state)))
                except (ValueError, TimeUp) as reason:
                    refusal = skipped if isinstance(reason, TimeUp) else str(reason)
                    break
    statements = {name: _statement(name, values[name], parts, checks, refusal, result) for name in QUANTITIES}
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
        values["life"] = cycles_to_preload(result.wear)
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
    result: Result, seen: Sequence[State], finer: Sequence[Answers | None], life: float | None, lost: str
) -> Iterator[Contribution]:
    """The first state, and energies of all states carried to life, with more harmonics."""
    if not seen:
        yield from _unknown("harmonics", "no state was solved")
        return
    first = finer[0]
    if first is None:
        yield from _unknown("harmonics", lost)
        return
    ours = Answers.of(seen[0].balance, seen[0].here)
    how = "more harmonics at the same states"
    for quantity, a, b in _pairs(ours, first):
        yield Contribution("harmonics", quantity, relative(a, b), how)
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


def _of_others(
    source: str,
    others: Callable[[], Sequence[Other]],
    result: Result,
    seen: Sequence[State],
    seconds: float,
    skipped: str,
) -> Iterator[Contribution]:
    """The first state with other meshes, or another reduction: the largest of those that change the same, all summed.

    Of several meshes that change the same one is enough where the others have no solution or the seconds are used up
    """
    if not seen:
        yield from _unknown(source, "no state was solved")
        return
    errors: dict[str, dict[str, float]] = {}  # by what is changed, by quantity
    refused: dict[str, str] = {}  # by what is changed
    ours, said, end = Answers.of(seen[0].balance, seen[0].here), list[str](), process_time() + seconds
    try:
        wanted = others()
    except (ValueError, RuntimeError) as refusal:
        yield from _unknown(source, str(refusal))
        return
    for other in wanted:
        try:
            with processor_seconds(end - process_time()):
                there, deepest = probes.unworn(other.file, result.harmonics)
        except (TimeUp, ValueError, RuntimeError) as refusal:
            refused[other.along] = skipped if isinstance(refusal, TimeUp) else f"{other.how}: {refusal}"
            continue
        said.append(other.how)
        largest = errors.setdefault(other.along, {})
        for quantity, error in _differences(there, deepest, ours, result):
            largest[quantity] = float(np.maximum(largest.get(quantity, 0.0), other.factor * error))
    lacking = [why for along, why in refused.items() if along not in errors]
    if lacking:
        yield from _unknown(source, lacking[0])
        return
    how = ", ".join(dict.fromkeys(said))
    for quantity in dict.fromkeys(name for largest in errors.values() for name in largest):
        error = sum(largest[quantity] for largest in errors.values())
        if np.isfinite(error):
            yield Contribution(source, quantity, error, how)
        else:
            why = "the free body does not say how deep the contact can wear"
            yield Contribution(source, quantity, None, why)


def _differences(there: Answers, deepest: float, ours: Answers, result: Result) -> Iterator[tuple[str, float]]:
    """Relative differences of all quantities; those of depth and life nan where the free body does not tell them."""
    for quantity, a, b in _pairs(there, ours):
        yield quantity, relative(a, b)
    if result.wear_steps:
        reach = result.facts.delta_max_m
        depth = relative(deepest, reach) if reach and np.isfinite([reach, deepest]).all() else float("nan")
        yield "depth", depth
        yield "life", depth + relative(there.energy, ours.energy)


def _pairs(a: Answers, b: Answers) -> Iterator[tuple[str, float, float]]:
    yield from (
        ("peak_frequency", a.hertz, b.hertz), ("amplitude", a.amplitude, b.amplitude), ("energy", a.energy, b.energy),
        ("preload", a.preload, b.preload),
    )  # fmt: skip


def _unknown(source: str, why: str) -> Iterator[Contribution]:
    for quantity in QUANTITIES:
        yield Contribution(source, quantity, None, why)


def _nothing(why: str) -> dict[str, Statement]:
    return {name: Statement(None, None, None, False, why) for name in QUANTITIES}


def _statement(
    name: str,
    value: float | None,
    parts: Sequence[Contribution],
    checks: Sequence[tuple[State, InTime]],
    refusal: str,
    result: Result,
) -> Statement:
    """One quantity, from what contributes to its error and from time integration of the states it belongs to."""
    if value is None:
        return Statement(None, None, None, False, _absent(name, result))
    own = [part for part in parts if part.quantity == name]
    known = [part for part in own if part.error is not None and np.isfinite(part.error)]
    lacking = [part for part in own if part.error is None or not np.isfinite(part.error)]
    total: float | None = float(sum(part.error or 0.0 for part in known)) if not lacking else None
    largest = max(known, key=lambda part: part.error or 0.0, default=None)
    dominated = largest.source if largest is not None else None
    if name in ("peak_frequency", "depth"):
        concerned: Sequence[tuple[State, InTime]] = ()  # a motion at a given frequency tells nothing about these
    else:
        concerned = checks if name == "life" else checks[:1]
    trouble = ""
    for state, check in concerned:
        where = "of the unworn contact" if not state.row else f"after {state.cycles:.3g} cycles"
        if check.outcome.kind is not SolveEnd.CONVERGED:
            trouble = f"time integration finds no periodic motion {where}: {check.outcome}"
            break
        miss = abs({"amplitude": check.amplitude, "preload": check.preload}.get(name, check.energy))
        if not check.stable and miss > CONTRADICTION * max(check.own_error, 1e-3):
            trouble = f"the balance solution {where} is unstable, and time integration leaves it by {miss:.1%}"
            break
        if total is not None and miss > total:
            if miss > CONTRADICTION * (total + check.own_error):
                dominated = "harmonics, by time integration"
            total = miss + check.own_error
    if trouble:
        return Statement(value, total, dominated, False, trouble)
    if total is None:
        missing = "; ".join(sorted({f"{part.source}: {part.how}" for part in lacking}))
        at_least = sum(part.error or 0.0 for part in known)
        large = at_least > LARGEST
        reason = f"total error not known ({missing}); the known parts sum to {at_least:.2g}"
        return Statement(value, None, dominated, not large, reason)
    if total > LARGEST:
        return Statement(value, total, dominated, False, f"its error is above {LARGEST:.0%}")
    checked = "" if concerned else f"; not held against time integration: {refusal}" if refusal else ""
    return Statement(value, total, dominated, True, f"all contributions measured on this scene{checked}")


def _absent(name: str, result: Result) -> str:
    """Why a quantity has no value."""
    if name not in ("depth", "life"):
        return "no state was solved"
    if result.wear is None or not result.wear_steps:
        return "nothing was worn"
    if result.wear.ended.survived and name == "life":
        return f"no life ends here: {result.wear.end}"
    return f"the preload has not fallen to {100 * LIFE_SHARE:g} %: {result.wear.end}"
