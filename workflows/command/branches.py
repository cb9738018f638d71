"""The word of the command `tribodyn` that follows the curves of random friction problems."""

from __future__ import annotations

import json

from tribodyn.workflows.command.words import Json, aside


def branches(*, problems: int = 20, first: int = 0, as_json: Json = False) -> None:
    """Follow response curves of random friction problems, with lift-off and impacts, from both ends.

    Each is followed to its end with the same folds both ways, its points checked by a march of the friction law, or
    refused with a sentence; exit code 3 where one is wrong.

    Parameters
    ----------
    problems
        How many.
    first
        Number of the first one; problem 7 is the same one always.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.benchmarks import branches as tried

    rows = tried.run(range(first, first + problems), aside)
    print(json.dumps(tried.as_records(rows), indent=2) if as_json else tried.as_text(rows))
    wrong = sum(row.outcome == tried.WRONG for row in rows)
    if wrong:
        raise RuntimeError(f"{wrong} of {len(rows)} curves are wrong, see the table")


COMMANDS = (branches,)
