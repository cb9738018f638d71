"""From a requested accuracy to settings that satisfy it: run, read the verdict, refine what changes most, repeat."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tribodyn.hbm.quantity import WearQuantity, load, names_with_error, quantity_named, with_error
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import refine
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Refinement, Verdict
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.units import to_si

PER_CENT = re.compile(r" ?\bper ?cent\b")

Runner = Callable[[SceneFile, int], Result]


@dataclass(frozen=True)
class Rounds:
    """How a scene is refined.

    max_runs : after which to stop; share : of the requested error, below which a refinement is not made
    finer : elements along every edge of the next round over those of this one
    """

    max_runs: int = 8
    share: float = 0.2
    finer: float = 1.5


@dataclass(frozen=True)
class AccuracyRequest:
    """error : relative; quantities : that are named, none for all that the scene has."""

    error: float
    quantities: tuple[str, ...]


@dataclass(frozen=True)
class ErrorBound:
    """What was requested and what the last round measured.

    errors : by quantity, None where not known; reasons : by quantity, why the bound is not met, empty where it is
    overrides : that the rounds have added; unrefined : refinements that contribute and could not be made
    rounds : runs made
    """

    request: AccuracyRequest
    errors: dict[str, float | None]
    reasons: dict[str, str]
    overrides: tuple[str, ...]
    unrefined: tuple[str, ...]
    rounds: int

    @property
    def is_satisfied(self) -> bool:
        """Whether every requested quantity has an error below the requested one."""
        return not any(self.reasons.values())

    @property
    def sentence(self) -> str:
        """Errors, the settings that gave them, and what is not satisfied."""
        good = [f"{quantity_named(q).label} {self.errors[q]:.2g}" for q, reason in self.reasons.items() if not reason]
        bad = [f"{quantity_named(q).label} ({reason})" for q, reason in self.reasons.items() if reason]
        settings = f"with {', '.join(self.overrides)}" if self.overrides else "with the scene as it is"
        text = f"error bound {self.request.error:g} {settings}, after {self.rounds} runs"
        text += f"; satisfied: {', '.join(good)}" if good else ""
        text += f"; not satisfied: {', '.join(bad)}" if bad else ""
        return text + (f"; could not be refined: {', '.join(self.unrefined)}" if self.unrefined else "")


def parsed(text: str) -> AccuracyRequest:
    """A requested accuracy such as "1 %" or "1 % of life and peak frequency". Raises Refusal."""
    number, _, names = " ".join(text.lower().split()).rstrip(".").partition(" of ")
    try:
        error = to_si(PER_CENT.sub("%", number), "")
    except Refusal as wrong:
        raise Refusal(f'--accuracy "{text}": {wrong}') from None
    if not 0 < error < 1:
        raise Refusal(f'--accuracy "{text}": give an error above 0 and below 100 %, such as "1 %"')
    labels = {load(name).label: name for name in names_with_error()}
    labels_given = tuple(re.split(r", and |, | and ", names)) if names else ()
    for name in labels_given:
        if name not in labels:
            raise Refusal(f'--accuracy "{text}": after "of" expected one of {", ".join(labels)}, got "{name}"')
    return AccuracyRequest(error, tuple(labels[name] for name in dict.fromkeys(labels_given)))


def to_accuracy(
    file: SceneFile, accuracy: str, run: Runner, say: Callable[[str], None], rounds: Rounds | None = None
) -> tuple[Result, ErrorBound]:
    """Run a scene with finer and finer settings until the errors of its verdict are below the requested one.

    accuracy : as `parsed` reads it; nothing is worn where quantities are named and none of them is of the wear
    run : does the run of a round, counted from 1, and keeps it; say : called with a sentence on every round
    Returns the result of the last round, and whether the bound is met
    Raises  Refusal for an accuracy that means nothing, and what the runs raise
    """
    request, rounds = parsed(accuracy), rounds or Rounds()
    always = {"verdict.enabled": "true"}
    if request.quantities and not set(request.quantities) & {q.name for q in with_error(WearQuantity)}:
        always["wear"] = ""
    added: dict[str, str] = {}
    for number in range(1, rounds.max_runs + 1):
        current = file.changed(*(f"{key}={value}" for key, value in (always | added).items()))
        result = run(current, number)
        measured = result.verdict
        assert measured is not None
        quantities = request.quantities or tuple(
            name for name, statement in measured.statements.items() if statement.value is not None
        )
        if not quantities:
            raise SolverFailure(f"{file.name} has no error: {next(iter(measured.statements.values())).reason}")
        finer = {
            name: refine.overrides_of(current, name, rounds.finer)
            for name in _large(measured, request, quantities, rounds.share)
        }
        unrefined = tuple(name for name, texts in finer.items() if not texts)
        bound = _bound(measured, request, quantities, added, unrefined, number)
        say(f"round {number}: {bound.sentence}")
        if bound.is_satisfied or not any(finer.values()):
            break
        added |= dict(text.split("=", 1) for texts in finer.values() for text in texts)
    return result, bound


def _bound(
    verdict: Verdict, request: AccuracyRequest, quantities: Sequence[str], added: dict[str, str],
    unrefined: tuple[str, ...], number: int,
) -> ErrorBound:  # fmt: skip
    errors, reasons = dict[str, float | None](), dict[str, str]()
    for name in quantities:
        statement = verdict.statements[name]
        errors[name], reasons[name] = (
            (statement.error, "") if statement.stated else (None, statement.reason or statement.status)
        )
        error = errors[name]
        if error is not None and error > request.error:
            reasons[name] = f"its error is {error:.2g}"
    return ErrorBound(request, errors, reasons, tuple(f"{k}={v}" for k, v in added.items()), unrefined, number)


def _large(verdict: Verdict, request: AccuracyRequest, quantities: Sequence[str], share: float) -> list[str]:
    """Refinements that change a requested quantity much, the largest first."""
    rows = [row for row in verdict.changes if row.quantity in quantities and row.refinement != Refinement.COMBINED]
    sizes = [(float("inf") if row.relative is None else row.relative, row.refinement) for row in rows]
    large = [change for change in sizes if DEFAULT.factor(verdict.ratio) * change[0] > share * request.error]
    return list(dict.fromkeys(refinement for _, refinement in sorted(large, key=lambda change: -change[0])))
