"""From a requested accuracy to settings that satisfy it: run, read the verdict, refine what changes most, repeat."""

import re
from collections.abc import Callable
from dataclasses import dataclass

from tribodyn.hbm.quantity import WearQuantity, load, names_with_error, quantity_named
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import refine
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Refinement
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.units import to_si


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
    rounds : runs made"""

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
        error = to_si(re.sub(r" ?\bper ?cent\b", "%", number), "")
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
    file: SceneFile, accuracy: str, run: Callable[[SceneFile, int], Result], say: Callable[[str], None]
) -> tuple[Result, ErrorBound]:
    """Run a scene with finer and finer settings until the errors of its verdict are below the requested one.

    accuracy : as `parsed` reads it; nothing is worn where quantities are named and none of them is of the wear
    run : does the run of a round, counted from 1, and keeps it; say : called with a sentence on every round
    Returns the result of the last round, and whether the bound is met
    Raises  Refusal for an accuracy that means nothing, and what the runs raise"""
    request = parsed(accuracy)
    always = {"verdict.enabled": "true"}
    if request.quantities and not set(request.quantities) & set(names_with_error(WearQuantity)):
        always["wear"] = ""
    added: dict[str, str] = {}
    for number in range(1, DEFAULT.max_runs + 1):
        current = file.changed(*(f"{key}={value}" for key, value in (always | added).items()))
        result = run(current, number)
        measured = result.verdict
        assert measured is not None
        stated = measured.statements
        quantities = request.quantities or tuple(name for name, of in stated.items() if of.value is not None)
        if not quantities:
            raise SolverFailure(f"{file.name} has no error: {next(iter(stated.values())).reason}")
        rows = [row for row in measured.changes if row.quantity in quantities and row.refinement != Refinement.COMBINED]
        sizes = [(float("inf") if row.relative is None else row.relative, row.refinement) for row in rows]
        least = DEFAULT.share * request.error / DEFAULT.factor(measured.ratio)
        finer = {
            name: refine.overrides_of(current, name, DEFAULT.finer)
            for size, name in sorted(sizes, key=lambda change: -change[0])
            if size > least
        }
        errors = {name: stated[name].error if stated[name].stated else None for name in quantities}
        reasons = {name: "" if stated[name].stated else stated[name].reason or stated[name].status for name in errors}
        reasons |= {name: f"its error is {x:.2g}" for name, x in errors.items() if x and x > request.error}
        unrefined = tuple(name for name, texts in finer.items() if not texts)
        overrides = tuple(f"{key}={value}" for key, value in added.items())
        bound = ErrorBound(request, errors, reasons, overrides, unrefined, number)
        say(f"round {number}: {bound.sentence}")
        if bound.is_satisfied or not any(finer.values()):
            break
        added |= dict(text.split("=", 1) for texts in finer.values() for text in texts)
    return result, bound
