"""What the words of the command `tribodyn` share: common options, quantities on the command line, lines of output."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

Overrides = Annotated[
    tuple[str, ...],
    Parameter(name="--set", negative=(), consume_multiple=False, help="Change a key of the scene: section.key=value."),
]
Changes = Annotated[tuple[str, ...], Parameter(name="--change", negative=(), consume_multiple=False)]
Json = Annotated[bool, Parameter(name="--json", negative=())]
Flag = Annotated[bool, Parameter(negative=())]


def aside(sentence: str) -> None:
    """Progress of a study, beside what it prints."""
    print(sentence, file=sys.stderr, flush=True)


def quantity(name: str, text: str, unit: str) -> float:
    """The value of an option in SI units; raises ValueError that names the option."""
    from workflows.units import to_si

    try:
        return to_si(text, unit)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def print_lines(lines: list[tuple[str, str]]) -> None:
    """Names and values in two columns."""
    for name, value in lines:
        print(f"{name:14} {value}")
