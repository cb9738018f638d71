"""The rows of a study as they are finished, a line each, on disk before the next one is told of."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from tribodyn.workflows.result import store
from tribodyn.workflows.studies.many.task import Row

NAME = "rows.jsonl"


class Journal:
    """Rows in a folder."""

    def __init__(self, folder: Path):
        self.path = folder / NAME

    def rows(self) -> dict[str, Row]:
        """Rows by their keys; a last line that was torn when the study was killed is left out."""
        found: dict[str, Row] = {}
        if self.path.exists():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                try:
                    row = Row(**json.loads(line))
                except (ValueError, TypeError):
                    continue
                found[row.key] = row
        return found

    def begin(self, rows: Iterable[Row], resume: bool) -> Path | None:
        """Begin with rows that are there already; returns where an earlier journal is now, None if none was."""
        previous = None if resume else store.set_aside(self.path)
        fresh = self.path.with_suffix(".new")
        with fresh.open("w", encoding="utf-8") as file:
            file.writelines(f"{json.dumps(row.record())}\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(fresh, self.path)
        return previous

    def add(self, row: Row) -> None:
        """Append a row and wait until the disk has it."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps(row.record())}\n")
            file.flush()
            os.fsync(file.fileno())
