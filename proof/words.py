"""What the words of `prove` share beyond those of the command `tribodyn`."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

Changes = Annotated[tuple[str, ...], Parameter(name="--change", negative=(), consume_multiple=False)]
PICTURE = (".png", ".pdf", ".svg")


def report_progress(sentence: str, share: float | None = None) -> None:
    """Progress of a proof, beside what it prints; shares of a stage are not shown."""
    if share is None:
        print(sentence, file=sys.stderr, flush=True)
