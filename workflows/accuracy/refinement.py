"""From a wanted accuracy to settings that meet it, measured on the scene itself: run, read the verdict, refine, repeat.

Every round is a whole run with its verdict. What contributes much to the error of a quantity that was asked for is made
finer, all such settings at once, until the verdict's total error is small enough. No table is needed, and nothing is
promised that the last round has not measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil

from tribodyn.geometry import parts
from tribodyn.workflows.accuracy import at_once
from tribodyn.workflows.accuracy.accuracy import OF_WEAR, parsed
from tribodyn.workflows.accuracy.statement import NAMES, QUANTITIES, Contribution, Verdict, loaded
from tribodyn.workflows.accuracy.trade_table import QUANTITIES as TRADED
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.scene.afterwards import VERDICT_SECONDS
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene

ROUNDS = 8
SHARE = 0.2  # of the wanted error: what contributes less is left as it is
FINER = 1.5  # elements along every edge, and modes, of the next round over those of this one
TOPS = (1, 3, 5, 9, 15, 25, 31)  # highest harmonic of one round after the other
LARGEST_SAMPLES = 65536
GIVEN = {"mesh": "mesh and contact grid", "contact_grid": "mesh and contact grid", "wear_step": "wear steps"}
"""Names of knobs as `given` has them, where they differ from the verdict's sources."""

Runner = Callable[[SceneFile, int], Result]
Setting = Callable[[SceneFile, Result], tuple[str, ...]]


@dataclass(frozen=True)
class Promise:
    """What was asked for and what the last round measured.

    wanted : relative error; errors : by quantity, None where a part is not known; reasons : by quantity, why it is not
    promised, empty where it is; overrides : that the rounds have added; given : sources whose error is not counted
    left : sources that contribute and could not be made finer; rounds : runs that were made
    alone : sources that contribute too little to be made finer: the scene's own settings
    """

    wanted: float
    errors: dict[str, float | None]
    reasons: dict[str, str]
    overrides: tuple[str, ...]
    given: tuple[str, ...]
    left: tuple[str, ...]
    rounds: int
    alone: tuple[str, ...] = ()

    @property
    def kept(self) -> bool:
        """Whether every quantity that was asked for has an error below the wanted one."""
        return not any(self.reasons.values())

    @property
    def sentence(self) -> str:
        """What is promised, by which settings, and what is not."""
        good = [f"{_name(q)} {self.errors[q]:.2g}" for q, why in self.reasons.items() if not why]
        bad = [f"{_name(q)} ({why})" for q, why in self.reasons.items() if why]
        settings = f"with {', '.join(self.overrides)}" if self.overrides else "with the scene as it is"
        said = f"accuracy {self.wanted:g} {settings}, after {self.rounds} runs"
        said += f"; total errors measured on this scene: {', '.join(good)}" if good else ""
        said += f"; not promised: {', '.join(bad)}" if bad else ""
        said += f"; not counted: {', '.join(self.given)}" if self.given else ""
        said += f"; could not be made finer: {', '.join(self.left)}" if self.left else ""
        return said + (f"; left as the scene has them: {', '.join(self.alone)}" if self.alone else "")


def to_accuracy(file: SceneFile, accuracy: str, run: Runner, say: Callable[[str], None]) -> tuple[Result, Promise]:
    """Run a scene with finer and finer settings until its verdict's errors are below the wanted one.

    accuracy : as accuracy.parsed reads it, such as "1 % of energy given harmonics"; of all quantities that the scene
        has where none is named, and without wear where neither depth nor life is
    run : does the run of a round, counted from 1, and keeps it; say : called with a sentence on every round
    Returns the result of the last round, and what may be promised of it
    Raises  ValueError for an accuracy that means nothing, and what the runs raise
    """
    wanted, named, knobs = parsed(accuracy)
    given = tuple(GIVEN.get(knob, knob.replace("_", " ")) for knob in knobs)
    asked = tuple(QUANTITIES[TRADED.index(name)] for name in named)
    always = {"verdict.enabled": "true"}
    if file.scene.verdict.seconds is None:
        always["verdict.seconds"] = f"{VERDICT_SECONDS[1]:g}"
    if named and not any(name in OF_WEAR for name in named):
        always["wear"] = ""
    added: dict[str, str] = {}
    refined: set[str] = set()
    for number in range(1, ROUNDS + 1):
        more = (f"{key}={value}" for key, value in (always | added).items())
        current = file.changed(*more)
        result = run(current, number)
        found = loaded(result.verdict)
        of = asked or tuple(name for name, said in found.statements.items() if said.value is not None)
        promise = _promise(found, wanted, of, given, added, number)
        promise = replace(promise, alone=_alone(found, of, given, refined))
        if not of:
            raise RuntimeError(f"nothing of {file.name} can be promised: {found.statements['peak_frequency'].reason}")
        say(f"round {number}: {promise.sentence}")
        if promise.kept:
            break
        finer = {s: SETTINGS[s](current, result) if s in SETTINGS else () for s in _large(found, wanted, of, given)}
        left = tuple(source for source, texts in finer.items() if not texts)
        promise = replace(promise, left=left, alone=_alone(found, of, given, refined | set(left)))
        refined |= {source for source, texts in finer.items() if texts}
        if number == ROUNDS or not any(finer.values()):
            break
        added |= dict(text.split("=", 1) for texts in finer.values() for text in texts)
    return result, promise


def _promise(
    found: Verdict,
    wanted: float,
    of: Sequence[str],
    given: tuple[str, ...],
    added: dict[str, str],
    rounds: int,
) -> Promise:
    errors, reasons = {}, {}
    for name in of:
        errors[name], reasons[name] = _error(found, name, given)
        if not reasons[name]:
            error = errors[name]
            assert error is not None
            reasons[name] = "" if error <= wanted else f"its error is {error:.2g}"
    overrides = tuple(f"{key}={value}" for key, value in added.items())
    return Promise(wanted, errors, reasons, overrides, given, (), rounds)


def _error(found: Verdict, name: str, given: Sequence[str]) -> tuple[float | None, str]:
    """Total error of a quantity without what is given, and why it cannot be promised."""
    said = found.statements[name]
    if said.value is None or (not given and (said.error is None or not said.stated)):
        return None, said.reason
    if not given:
        return said.error, ""
    own = [part for part in found.contributions if part.quantity == name and part.source not in given]
    lacking = [part for part in own if part.error is None]
    if lacking:
        return None, "; ".join(f"{part.source}: {part.how}" for part in lacking)
    return at_once.total(part for part in own if part.source != at_once.AT_ONCE), ""


def _large(found: Verdict, wanted: float, of: Sequence[str], given: Sequence[str]) -> list[str]:
    """Sources whose contribution to a quantity that is asked for matters, the largest first."""

    def size(part: Contribution) -> float:
        return float("inf") if part.error is None else part.error

    parts = [part for part in found.contributions if part.quantity in of and part.source not in given]
    parts = sorted((part for part in parts if size(part) > SHARE * wanted), key=size, reverse=True)
    sources = (at_once.KNOBS if part.source == at_once.AT_ONCE else (part.source,) for part in parts)
    return list(dict.fromkeys(source for several in sources for source in several))


def _alone(found: Verdict, of: Sequence[str], given: Sequence[str], others: set[str]) -> tuple[str, ...]:
    """Sources of errors of what is asked for that are neither given nor among others."""
    sources = dict.fromkeys(part.source for part in found.contributions if part.quantity in of)
    settled = (*given, *others, at_once.AT_ONCE)
    return tuple(source for source in sources if source not in settled)


def _harmonics(file: SceneFile, result: Result) -> Iterator[str]:
    top = max(result.harmonics)
    higher = [one for one in TOPS if one > top]
    if higher:
        yield f"harmonics.kept={list(range(higher[0] + 1))}"
        if file.scene.harmonics.samples < 8 * higher[0]:
            yield f"harmonics.samples={8 * higher[0]}"


def _mesh(file: SceneFile, result: Result) -> Iterator[str]:
    scene = file.scene
    if isinstance(scene, PartScene) and scene.geometry.part is not None:
        part = parts.load(scene.geometry.part)
        counts = parts.rescaled(part, part.Parameters(**scene.geometry.parameters), FINER)
        yield from (f"geometry.{name}={count}" for name, count in counts.items())


def _modes(file: SceneFile, result: Result) -> Iterator[str]:
    reduction = getattr(file.scene, "reduction", None)
    if reduction is not None and reduction.modes is not None:
        yield f"reduction.modes={ceil(FINER * reduction.modes)}"


def _samples(file: SceneFile, result: Result) -> Iterator[str]:
    if file.scene.harmonics.samples * 2 <= LARGEST_SAMPLES:
        yield f"harmonics.samples={2 * file.scene.harmonics.samples}"


def _wear(file: SceneFile, result: Result) -> Iterator[str]:
    wear = file.scene.wear
    if wear is None:
        return
    step = wear.step
    if wear.rule == "error_controlled":
        if wear.tolerance is not None:
            yield f"wear.tolerance={wear.tolerance / 3!r}"
    elif step is not None:
        yield f"wear.step={step.share / 3!r}" if step.share is not None else f"wear.step={(step.depth or 0.0) / 3!r} m"


def _points(file: SceneFile, result: Result) -> Iterator[str]:
    if file.scene.response.points:
        yield f"response.points={2 * file.scene.response.points}"


def _setting(texts: Callable[[SceneFile, Result], Iterator[str]]) -> Setting:
    return lambda file, result: tuple(texts(file, result))


SETTINGS: dict[str, Setting] = {
    "harmonics": _setting(_harmonics), "mesh and contact grid": _setting(_mesh), "modes": _setting(_modes),
    "samples": _setting(_samples), "wear steps": _setting(_wear), "points": _setting(_points),
}  # fmt: skip
"""Overrides that make what the verdict calls a source finer; empty where it cannot be."""


def _name(quantity: str) -> str:
    return NAMES.get(quantity, quantity)
