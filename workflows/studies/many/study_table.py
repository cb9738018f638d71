"""The table of a study, one row a run, and the journal that writes each finished row to disk."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np
from scipy import stats

from tribodyn.hbm.quantity import StatedQuantity, names_with_error, quantities_of
from tribodyn.output_file import cell, replacing, set_aside
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.studies.many import study_pictures
from tribodyn.workflows.studies.many.distributions import si
from tribodyn.workflows.studies.many.run_task import RUN, RunRow, Status
from tribodyn.workflows.studies.study_result import StudyResult

if TYPE_CHECKING:
    import pandas as pd

STATUS, SENTENCE = "status", "sentence"
LIFE = "life"
FEWEST = 5  # complete runs that a correlation needs
JOURNAL = "rows.jsonl"


@dataclass(frozen=True, repr=False)
class StudyTable(StudyResult):
    """Table of a study.

    columns : name -> (n_run,) of numbers in SI units, nan where there is none, or of texts; run, status and sentence,
        then the keys that vary, then what was computed
    varied : names of the keys; folder : of its files, None where there are none"""

    name: str
    columns: Mapping[str, np.ndarray]
    varied: tuple[str, ...]
    folder: Path | None = None

    @property
    def computed(self) -> tuple[str, ...]:
        """Names of the numbers that were computed."""
        return tuple(name for name in self.columns if name not in (RUN, STATUS, SENTENCE, *self.varied))

    def count(self, status: str) -> int:
        """Runs of a status."""
        return int(np.count_nonzero(self.columns[STATUS] == status))

    def bounded(self, number: str) -> tuple[np.ndarray, np.ndarray]:
        """A number of the runs, nan where there is none; and that of runs where it is a lower bound only.

        Both (n_run,). A life that did not end within its run counts as the cycles that the run came to"""
        lived = number == LIFE and "cycles" in self.columns
        if number not in self.computed and not lived:
            raise Refusal(f'{self.name} has no number "{number}": there are {", ".join(self.computed) or "none"}')
        values = np.asarray(self.columns.get(number, np.full(len(self.columns[RUN]), np.nan)), float)
        bounds = np.full(len(values), np.nan)
        if lived:
            ended = np.asarray(self.columns["cycles"], float)
            open_ = np.isnan(values) & (ended > 0) & (self.columns[STATUS] == "complete")
            values, bounds = np.where(open_, ended, values), np.where(open_, ended, bounds)
        return values, bounds

    def values_of(self, number: str) -> tuple[np.ndarray, np.ndarray]:
        """A number of the runs (n_run,), nan where there is none, and where only a lower bound of it is known.

        A contact that survives, because its wear fades out or it never slips, lives as long as the longest of all runs
        """
        if number in self.varied:
            return np.asarray(self.columns[number], float), np.zeros(len(self.columns[RUN]), bool)
        values, bounds = self.bounded(number)
        least = np.isfinite(bounds)
        if number == LIFE and "survives" in self.columns and np.isfinite(values).any():
            survives = self.columns["survives"] == 1.0
            values, least = np.where(survives, np.nanmax(values), values), least | survives
        return values, least

    def influence(self) -> dict[str, dict[str, float]]:
        """Spearman's rank correlation of computed numbers with the keys that vary, over the complete runs.

        Number -> key -> correlation; what does not vary or has fewer than FEWEST values is left out"""
        correlations: dict[str, dict[str, float]] = {}
        for number in self.computed:
            for key in self.varied if not number.startswith("d ") else ():
                x, y = self.columns[key], self.columns[number]
                if x.dtype.kind != "f":
                    continue
                finite = np.isfinite(x) & np.isfinite(y)
                if finite.sum() >= FEWEST and np.ptp(x[finite]) > 0 and np.ptp(y[finite]) > 0:
                    correlations.setdefault(number, {})[key] = float(stats.spearmanr(x[finite], y[finite]).statistic)
        return correlations

    @property
    def files(self) -> list[Path]:
        """The table as a file."""
        return [] if self.folder is None else [self.folder / "study.csv"]

    def record(self) -> dict[str, Any]:
        """Counts of the runs and their rank correlations, for machines."""
        counts = {status: self.count(status) for status in get_args(Status)}
        return {"study": self.name, "runs": counts, "influence": self.influence()}

    def lines(self) -> list[str]:
        """For people: how runs ended, and what the first and the lives depend on."""
        counts = self.record()["runs"].items()
        lines = ["runs: " + ", ".join(f"{count} {status}" for status, count in counts if count), *self.troubles()]
        for number, by_key in self.influence().items():
            if number.removesuffix("_first") in names_with_error():
                ranks = sorted(by_key.items(), key=lambda item: -abs(item[1]))
                lines.append(f"{number:14} rank correlation with {', '.join(f'{k} {rank:+.2f}' for k, rank in ranks)}")
        return lines

    def troubles(self, max_lines: int = 5) -> list[str]:
        """The first runs that are not complete, with their sentences."""
        columns = self.columns
        bad = [i for i, status in enumerate(columns[STATUS]) if status != "complete"]
        lines = [f"run {columns[RUN][i]} {columns[STATUS][i]}: {columns[SENTENCE][i]}" for i in bad[:max_lines]]
        return lines + ([f"... and {len(bad) - max_lines} more, in the table"] if len(bad) > max_lines else [])

    @property
    def defects(self) -> list[str]:
        stopped = np.flatnonzero(self.columns[STATUS] == "defect")
        return [f"run {self.columns[RUN][i]}: {self.columns[SENTENCE][i]}" for i in stopped]

    def to_pandas(self) -> pd.DataFrame:
        """The table as a DataFrame with the runs as its index."""
        import pandas

        return pandas.DataFrame(dict(self.columns)).set_index(RUN)

    def plot(self) -> Figure:
        """Response against each of the keys that vary, see `many.pictures`."""
        return study_pictures.panes(self)


class RunsResult(StudyResult):
    """Result that is made of the runs of a study. STEM : name of its files beside those of the study"""

    table: StudyTable
    STEM: ClassVar[str]

    @property
    def defects(self) -> list[str]:
        return self.table.defects

    @property
    def files(self) -> list[Path]:
        """What it left beside the study's tables."""
        folder = self.table.folder
        return [] if folder is None else [folder / f"{self.STEM}.json", folder / f"{self.STEM}.png"]


def table(
    name: str, varied: Sequence[Mapping[str, Any]], rows: Mapping[int, RunRow], folder: Path | None = None
) -> StudyTable:
    """The table of the runs that are finished.

    varied : values of the keys, run by run; rows : by the number of the run, from 1"""
    numbers = sorted(rows)
    columns = {RUN: np.array(numbers, int)}
    for column, of in ((STATUS, "status"), (SENTENCE, "sentence")):
        columns[column] = np.array([getattr(rows[n], of) for n in numbers], dtype=object)
    keys = tuple(varied[0])
    for key in keys:
        columns[key] = _values([run[key] for run in varied], [n - 1 for n in numbers])
    names = dict.fromkeys(name for n in numbers for name in rows[n].numbers)
    for column in _ordered(names):
        columns[column] = np.array([rows[n].numbers.get(column, np.nan) for n in numbers])
    return StudyTable(name, columns, keys, folder)


def _ordered(names: Mapping[str, None]) -> list[str]:
    """Names of numbers in an order that does not depend on which run came first."""
    first = [column for q in quantities_of(StatedQuantity) for column in (f"{q.name}_first", f"{q.name}_last", q.name)]
    first.append("peak_at_end")
    return [name for name in first if name in names] + sorted(name for name in names if name not in first)


def _values(values: Sequence[Any], chosen: Sequence[int]) -> np.ndarray:
    """Values of a key: numbers in SI units where all of the study's are, else texts."""
    numbers = [si(value) for value in values]
    if all(number is not None for number in numbers):
        return np.array([numbers[i] for i in chosen], float)
    return np.array([str(values[i]) for i in chosen], dtype=object)


def write(study: StudyTable, folder: Path) -> None:
    """Write study.csv; the same table gives the same bytes."""
    with replacing(folder / "study.csv") as path, path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(map(cell, study.columns))
        for i in range(len(study.columns[RUN])):
            writer.writerow([_cell(column[i]) for column in study.columns.values()])


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else repr(float(value))
    return str(cell(value) if isinstance(value, str) else value)


class Journal:
    """Rows in a folder."""

    def __init__(self, folder: Path):
        self.path = folder / JOURNAL

    def rows(self) -> dict[str, RunRow]:
        """Rows by their keys; a last line that was torn when the study was killed is left out."""
        rows_by_key: dict[str, RunRow] = {}
        if self.path.exists():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                try:
                    row = RunRow(**json.loads(line))
                except (json.JSONDecodeError, TypeError):
                    continue
                rows_by_key[row.key] = row
        return rows_by_key

    def begin(self, rows: Iterable[RunRow], fresh: bool = False) -> Path | None:
        """Begin with rows that are there already; returns where an earlier journal is now, None if none was."""
        previous = set_aside(self.path) if fresh else None
        started = self.path.with_suffix(".new")
        with started.open("w", encoding="utf-8") as file:
            file.writelines(f"{json.dumps(vars(row))}\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())
        os.replace(started, self.path)
        return previous

    def add(self, row: RunRow) -> None:
        """Append a row and wait until the disk has it."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps(vars(row))}\n")
            file.flush()
            os.fsync(file.fileno())
