"""Numerical extremes as a table: every cell solved and checked independently, or refused with a sentence."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from proof.hard_settings import extremes_wear
from proof.hard_settings.extremes_judge import CONVERGED, REFUSED, WRONG, Verdict, sampled_honestly, solve_and_judge
from proof.hard_settings.extremes_models import Body, beam, lattice, rigid, scaled

QUICK = 8  # the quick table has every eighth cell
SOFT = 7  # and these stiffnesses, up to 1e9 N/m: stiffer contacts take a minute of processor each
STIFFNESS = tuple(10.0**p for p in range(3, 16))  # N/m
FRICTION = (0.0, 1e-6, 1e-3, 1e-2, 0.1, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0)
PRELOAD = (0.0, 1e-3, *(10.0**p for p in range(7)))  # N
DAMPING = (0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.1, 0.9)
FORCE = (0.0, 1e-9, 1e-3, 1.0, 1e3, 1e6, 1e9)  # N
FREQUENCY = (1e-6, 1e-3, 0.1, 0.5, 1.0, 2.0, 10.0)  # of the ordinary one
GAP = (-1e-1, -1e-3, -1e-6, 1e-6, 1e-3, 1.0)  # m, negative is interference
HARMONICS = ((1,), (0, 1), (0, 2), (0, 1, 3), (0, 1, 2, 3), tuple(range(8)), tuple(range(16)), tuple(range(32)))
SAMPLES = tuple(2**p for p in range(3, 13))
NODES = (1, 2, 3, 10, 30, 100, 300, 1000, 2000)
UNITS = (1e-6, 1e-3, 1e3, 1e6)


@dataclass(frozen=True)
class Trial:
    """One cell: what was varied on which model, at which setting, and what came out.

    outcome : "converged", "refused" or "wrong"; reason : the check, the refusal or what is wrong
    deviation : largest relative difference found by the checks, nan where refused; seconds : of one processor"""

    model: str
    varied: str
    setting: str
    outcome: str
    reason: str
    deviation: float
    seconds: float


Cell = tuple[str, str, str, Callable[[], Verdict]]  # model, what is varied, setting, how to judge it


def run(quick: bool, say: Callable[[str], None]) -> tuple[Trial, ...]:
    """Every cell of the table; quick: smaller models and every eighth cell."""
    rows = []
    with threadpool_limits(1):
        for position, (model, varied, setting, judge) in enumerate(cells(quick)):
            if quick and position % QUICK:
                continue
            clock = process_time()
            verdict = outcome_of(judge)
            spent = process_time() - clock
            rows.append(Trial(model, varied, setting, verdict.outcome, verdict.reason, verdict.deviation, spent))
            if len(rows) % 50 == 0:
                say(f"{len(rows)} cells, {Counter(row.outcome for row in rows)[WRONG]} wrong")
    return tuple(rows)


def outcome_of(judge: Callable[[], Verdict]) -> Verdict:
    """The verdict of a cell; what the program declares as an error is a refusal, anything else is wrong."""
    try:
        return judge()
    except (ValueError, RuntimeError) as refusal:
        return Verdict(REFUSED, str(refusal))
    except Exception as surprise:  # what nobody declared is a finding, whatever it is
        return Verdict(WRONG, f"{type(surprise).__name__}: {surprise}")


def cells(quick: bool) -> Iterator[Cell]:
    """All cells in turn."""
    small, large = lattice(3, 3), beam(3 if quick else 7)
    for body in (small, large):
        yield from _balances(body, STIFFNESS[:SOFT] if quick else STIFFNESS)
    for body in (lattice(2, 2),) if quick else (lattice(2, 2), beam(3)):
        yield from _bases(body)
    loose = lattice(3, 3, suspended=False)
    for preload in PRELOAD:
        for force in (0.0, 1.0, 80.0):
            label = f"preload {preload:g} N, force {force:g} N"
            yield _cell(loose, "rigid-body modes", label, preload=preload, force=force)
    yield from _node_counts(NODES[:-2] if quick else NODES)
    for body in (small, lattice(2, 2)):
        for length in UNITS:
            for force in UNITS:
                label = f"length x {length:g}, force x {force:g}"
                yield body.name, "units", label, partial(_in_units, body, length, force)
    yield from _nonsense(lattice(2, 2))
    yield from extremes_wear.cells(rigid(4), beam(3))


def _cell(body: Body, varied: str, label: str, **changes: Any) -> Cell:
    setting = replace(body.ordinary, **changes)
    return body.name, varied, label, lambda: solve_and_judge(body.balance(setting), setting.omega)[0]


def _balances(body: Body, stiffness: Sequence[float]) -> Iterator[Cell]:
    o = body.ordinary
    varied: tuple[tuple[str, tuple[str, ...], Sequence[float], str], ...] = (
        ("stiffness", ("tangential", "normal"), stiffness, "N/m"),
        ("friction", ("friction",), FRICTION, ""),
        ("preload", ("preload",), PRELOAD, "N"),
        ("vibration force", ("force",), FORCE, "N"),
        ("gap", ("gap",), GAP, "m"),
    )
    for transitions in ("located", "sampled"):
        for name, keys, values, unit in varied:
            for value in values:
                label = f"{value:g} {unit}".strip() + f", {transitions}"
                yield _cell(body, name, label, **dict.fromkeys(keys, value), transitions=transitions)
    for value in stiffness[::2]:
        yield _cell(body, "tangential stiffness alone", f"{value:g} N/m", tangential=value)
        yield _cell(body, "normal stiffness alone", f"{value:g} N/m", normal=value)
    resonance = _stuck_resonance(body)
    for value in DAMPING:
        yield _cell(body, "damping", f"{value:g}", damping=value)
        yield _cell(body, "damping, in the stuck resonance", f"{value:g}", damping=value, omega=resonance)
    for value in FREQUENCY:
        yield _cell(body, "frequency", f"{value * o.omega / (2 * np.pi):.4g} Hz", omega=value * o.omega)
    for value in (1e-3, 1.0, 1e3):
        yield _cell(body, "everything separated", f"pulled off by {value:g} N", preload=-value, gap=1.0)
        yield _cell(body, "everything separated", f"gap 1 m, force {value:g} N", force=value, gap=1.0)


def _stuck_resonance(body: Body) -> float:
    b, system = np.asarray(body.model.interface.B), body.model.system
    k = body.model.interface.stiffness(body.ordinary.tangential, body.ordinary.normal).ravel()
    lam = np.linalg.eigvals(np.linalg.solve(system.mass, system.stiffness + b.T @ (k[:, None] * b))).real
    return float(np.sqrt(lam.min()))


def _bases(body: Body) -> Iterator[Cell]:
    for harmonics in HARMONICS:
        label = f"0..{harmonics[-1]}" if len(harmonics) > 4 else ", ".join(map(str, harmonics))
        for transitions in ("located", "sampled"):
            text = f"harmonics {label}, {transitions}"
            samples = 128 if transitions == "located" else max(128, 16 * harmonics[-1])
            changes = {"harmonics": harmonics, "transitions": transitions, "samples": samples}
            yield _cell(body, "harmonics", text, **changes)
            yield _cell(body, "harmonics", f"{text}, no preload", **changes, preload=0.0)
    for harmonics in ((0, 1), (0, 1, 2, 3)):
        for samples in SAMPLES:
            setting = replace(body.ordinary, harmonics=harmonics, samples=samples)
            text = f"{samples} samples, harmonics 0..{harmonics[-1]}"
            yield _cell(body, "samples", f"{text}, located", harmonics=harmonics, samples=samples)
            coarse = replace(setting, transitions="sampled")
            yield body.name, "samples", f"{text}, sampled", partial(_sampled, body, coarse)


def _sampled(body: Body, setting: Any) -> Verdict:
    balance = body.balance(setting)
    verdict, solution = solve_and_judge(balance, setting.omega)
    if verdict.outcome != CONVERGED:
        return verdict
    return sampled_honestly(balance, solution.state)


def _node_counts(counts: tuple[int, ...]) -> Iterator[Cell]:
    for n in counts:
        for transitions in ("located", "sampled"):
            yield "rigid mass", "nodes", f"{n} nodes, {transitions}", partial(_like_one_node, n, transitions)


def _like_one_node(n: int, transitions: str) -> Verdict:
    """A rigid mass on n equal nodes moves as on one, by the dense reference."""
    single, n_nodes = rigid(1), rigid(n)
    setting = replace(single.ordinary, transitions=transitions)
    reference, on_one_node = solve_and_judge(single.balance(setting), setting.omega)
    balance = n_nodes.balance(setting)
    verdict, solution = solve_and_judge(balance, setting.omega)
    if verdict.outcome != CONVERGED or reference.outcome != CONVERGED:
        return verdict if verdict.outcome != CONVERGED else reference
    off = np.abs(solution.state.x - on_one_node.state.x).max() / np.abs(on_one_node.state.x).max()
    outcome = CONVERGED if off < 1e-6 else WRONG
    return Verdict(outcome, f"the motion on one node; {verdict.reason}", max(float(off), verdict.deviation))


def _in_units(body: Body, length: float, force: float) -> Verdict:
    """The same problem in other units: the same numbers, scaled."""
    first, ours = solve_and_judge(body.balance(body.ordinary), body.ordinary.omega)
    other = scaled(body, length, force)
    verdict, theirs = solve_and_judge(other.balance(other.ordinary), body.ordinary.omega)
    if CONVERGED not in (first.outcome, verdict.outcome) or first.outcome != verdict.outcome:
        return Verdict(WRONG, f"{first.outcome} in SI, {verdict.outcome} in other units: {verdict.reason}")
    off = float(np.linalg.norm(theirs.state.x / length - ours.state.x) / np.linalg.norm(ours.state.x))
    return Verdict(CONVERGED if off < 1e-6 else WRONG, "the same motion in SI", max(off, verdict.deviation))


def _nonsense(body: Body) -> Iterator[Cell]:
    """What no problem can have; an answer would be wrong."""
    wrong: tuple[tuple[str, dict[str, Any]], ...] = (
        ("friction not a number", {"friction": np.nan}),
        ("friction below zero", {"friction": -0.1}),
        ("friction infinite", {"friction": np.inf}),
        ("stiffness below zero", {"tangential": -1e6}),
        ("stiffness not a number", {"normal": np.nan}),
        ("stiffness infinite", {"normal": np.inf}),
        ("gap not a number", {"gap": np.nan}),
        ("gap infinite", {"gap": np.inf}),
        ("damping below zero", {"damping": -0.01}),
        ("damping not a number", {"damping": np.nan}),
        ("preload not a number", {"preload": np.nan}),
        ("preload infinite", {"preload": np.inf}),
        ("force not a number", {"force": np.nan}),
        ("force infinite", {"force": np.inf}),
        ("frequency not a number", {"omega": np.nan}),
        ("frequency infinite", {"omega": np.inf}),
        ("frequency below zero", {"omega": -100.0}),
        ("frequency zero", {"omega": 0.0}),
        ("no harmonic but 0", {"harmonics": (0,)}),
        ("no harmonic", {"harmonics": ()}),
        ("harmonics falling", {"harmonics": (1, 0)}),
        ("harmonic below zero", {"harmonics": (-1, 1)}),
        ("preload without harmonic 0", {"harmonics": (1,)}),
        ("load without its harmonic", {"harmonics": (0, 2)}),
        ("samples too few", {"samples": 4, "harmonics": (0, 1, 2, 3)}),
        ("no samples", {"samples": 0}),
        ("unknown treatment of transitions", {"transitions": "guessed"}),
    )
    for label, changes in wrong:
        yield body.name, "no possible problem", label, partial(_must_refuse, body, changes)


def _must_refuse(body: Body, changes: dict[str, Any]) -> Verdict:
    setting = replace(body.ordinary, **changes)
    verdict, _ = solve_and_judge(body.balance(setting), setting.omega)
    if verdict.outcome == CONVERGED:
        return Verdict(WRONG, "an answer to a problem that cannot be")
    return verdict


def counts(rows: tuple[Trial, ...]) -> dict[str, int]:
    """Cells by outcome."""
    outcomes = Counter(row.outcome for row in rows)
    return {outcome: outcomes[outcome] for outcome in (CONVERGED, REFUSED, WRONG)}


def as_records(rows: tuple[Trial, ...]) -> list[dict[str, object]]:
    """The rows for JSON; what is not a number is None."""
    return [
        {
            "model": row.model,
            "setting": f"{row.varied}: {row.setting}",
            "outcome": row.outcome,
            "reason": row.reason,
            "deviation": row.deviation if np.isfinite(row.deviation) else None,
            "seconds": row.seconds,
        }
        for row in rows
    ]


def as_text(rows: tuple[Trial, ...]) -> str:
    """One line for each model and thing varied, the refusals with their sentences, and what is wrong."""
    lines = [f"{'model':38} {'varied':32} {'cells':>5} {'converged':>9} {'refused':>7} {'wrong':>5}  largest deviation"]
    for model, varied in dict.fromkeys((row.model, row.varied) for row in rows):
        group = tuple(row for row in rows if (row.model, row.varied) == (model, varied))
        count = counts(group)
        off = max((row.deviation for row in group if np.isfinite(row.deviation)), default=float("nan"))
        lines.append(
            f"{model:38} {varied:32} {len(group):5d} {count[CONVERGED]:9d} {count[REFUSED]:7d} {count[WRONG]:5d}"
            + ("" if np.isnan(off) else f"  {off:.1e}")
        )
    for outcome in (REFUSED, WRONG):
        reasons = Counter(row.reason for row in rows if row.outcome == outcome)
        lines += [f"{outcome}, {count} x: {reason}" for reason, count in reasons.most_common()]
    total = counts(rows)
    lines.append(f"{len(rows)} cells: {', '.join(f'{count} {outcome}' for outcome, count in total.items())}")
    return "\n".join(lines)
