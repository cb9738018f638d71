"""What a verdict states: for every quantity its value, its total error, what dominates it, and whether it is stated.

Data and its words alone: a reader of results needs no solver. `tribodyn.workflows.accuracy.verdict` measures them.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

QUANTITIES = ("peak_frequency", "amplitude", "energy", "preload", "depth", "life")
NAMES = {"peak_frequency": "peak frequency"}
UNITS = {"peak_frequency": "Hz", "amplitude": "m", "energy": "J", "preload": "N", "depth": "m", "life": "cycles"}
LARGEST = 0.5  # relative error above which a number is no statement


@dataclass(frozen=True)
class Contribution:
    """What one discretisation adds to the error of one quantity; error None where nobody measured it."""

    source: str
    quantity: str
    error: float | None
    how: str


@dataclass(frozen=True)
class Statement:
    """One quantity of a verdict.

    value : in UNITS, None where there is none; error : total and relative, None where a part of it is not known
    dominated_by : the largest contribution; stated : whether the value may be stated; reason : why, or what is lacking
    """

    value: float | None
    error: float | None
    dominated_by: str | None
    stated: bool
    reason: str


@dataclass(frozen=True)
class Verdict:
    """statements : by QUANTITIES; contributions : what they were added up from; seconds : of one processor, spent."""

    statements: dict[str, Statement]
    contributions: tuple[Contribution, ...]
    seconds: float

    def dumped(self) -> str:
        """The verdict as JSON text."""
        return json.dumps(asdict(self))


def loaded(text: str) -> Verdict:
    """A verdict from its JSON text."""
    data: dict[str, Any] = json.loads(text)
    statements = {name: Statement(**item) for name, item in data["statements"].items()}
    return Verdict(statements, tuple(Contribution(**item) for item in data["contributions"]), data["seconds"])


def record(text: str) -> dict[str, dict[str, Any]] | None:
    """Statements by quantity for machines, None without a verdict."""
    return {name: asdict(said) for name, said in loaded(text).statements.items()} if text else None


def lines(verdict: Verdict) -> list[tuple[str, str]]:
    """The verdict as pairs of a name and a readable value."""
    shown = [("verdict", "")]
    for name, said in verdict.statements.items():
        label = f"  {NAMES.get(name, name)}"
        if said.value is None:
            shown.append((label, f"none: {said.reason}"))
            continue
        number = f"{said.value:.4g} {UNITS[name]}"
        if not said.stated:
            shown.append((label, f"not stated: {said.reason}"))
        elif said.error is None:
            shown.append((label, f"{number}, {said.reason}"))
        else:
            by = f", most of it {said.dominated_by}" if said.dominated_by else ""
            shown.append((label, f"{number}, error {percent(said.error)}{by}"))
    return shown


def percent(error: float) -> str:
    """A relative error for people."""
    return f"{100 * error:.2g} %" if error >= 1e-4 else "below 0.01 %"
