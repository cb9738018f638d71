"""What the words of `prove` share beyond those of the command `tribodyn`."""

import sys

PICTURE = (".png", ".pdf", ".svg")


def report_progress(sentence: str, share: float | None = None) -> None:
    """Progress of a proof, beside what it prints; shares of a stage are not shown."""
    if share is None:
        print(sentence, file=sys.stderr, flush=True)
