"""What the words of the command `tribodyn` share: common options, quantities on the command line, room for output."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Overrides = Annotated[
    tuple[str, ...],
    Parameter(name="--set", negative=(), consume_multiple=False, help="Change a key of the scene: section.key=value."),
]
Json = Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON for machines.")]
Flag = Annotated[bool, Parameter(negative=())]


def quantity(name: str, text: str, unit: str) -> float:
    """The value of an option in SI units; raises ValueError that names the option."""
    from tribodyn.workflows.scene.units import to_si

    try:
        return to_si(text, unit)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def make_room(out: Path | None, endings: Sequence[str] = ()) -> None:
    """Make sure, before long work, that its outcome can be written to --out: to a folder, or a file of these endings.

    Raises  ValueError with one sentence
    """
    if out is None:
        return
    if endings and out.suffix.lower() not in endings:
        raise ValueError(f"--out {out}: give a file that ends with {' or '.join(endings)}")
    if endings and out.is_dir():
        raise ValueError(f"--out {out}: a folder is there, give a file")
    folder = out.parent if endings else out
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {out}: no folder can be made at {folder}, {str(error.strerror).lower()}") from None
