"""Results of the bench: rows of numbers under a head of facts, one file for a problem and a program; see README.md."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from proof.bench.problem import FOLDER

POINT, CURVE, TRUTH = "point", "curve", "truth"
SAME = 1e-6  # relative distance within which two numbers are one


@dataclass(frozen=True)
class Row:
    """One motion; what a program does not give is nan. The columns are described in README.md."""

    kind: str
    frequency: float
    amplitude: float
    mean: float = np.nan
    phase: float = np.nan
    energy: float = np.nan
    open: float = np.nan
    stick: float = np.nan
    slip: float = np.nan
    stable: float = np.nan
    error: float = np.nan

    def is_in(self, rows: list[Row]) -> bool:
        """Whether a motion of this frequency and amplitude is among some."""
        return any(
            r.frequency == self.frequency and abs(r.amplitude - self.amplitude) <= SAME * self.amplitude for r in rows
        )


@dataclass(frozen=True)
class Record:
    """What one program gives for one problem; head : problem, program, settings, seconds, source, note -> text."""

    head: Mapping[str, str]
    rows: tuple[Row, ...]

    @property
    def points(self) -> list[Row]:
        """The motions at frequencies that are asked for."""
        return [row for row in self.rows if row.kind == POINT]

    def write(self, column: str) -> None:
        """Write the file of a column, such as "nlvib"."""
        lines = [f"# {key}: {text}" for key, text in self.head.items() if text]
        lines.append(",".join(field.name for field in fields(Row)))
        for row in self.rows:
            kind, *numbers = astuple(row)
            lines.append(",".join([kind, *("" if np.isnan(x) else f"{x:.8g}" for x in numbers)]))
        path = FOLDER / "results" / self.head["problem"] / f"{column}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def columns(problem: str) -> dict[str, Record]:
    """Column -> record, those that there are for a problem."""
    return {path.stem: _read(path) for path in sorted((FOLDER / "results" / problem).glob("*.csv"))}


def _read(path: Path) -> Record:
    lines = path.read_text(encoding="utf-8").splitlines()
    head = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    table = csv.DictReader(line for line in lines if not line.startswith("#"))
    rows = [Row(row.pop("kind"), **{key: float(text or "nan") for key, text in row.items()}) for row in table]
    return Record(head, tuple(rows))


@dataclass(frozen=True)
class Score:
    """A record beside the truth: largest relative errors, the energy's over the largest; motions that are missing."""

    amplitude: float
    energy: float
    missing: int


def score(record: Record, truth: Record) -> Score:
    """Each motion of the truth beside the one of nearest amplitude at its frequency."""
    pairs = []
    for row in truth.points:
        near = [r for r in record.points if abs(r.frequency / row.frequency - 1) < SAME]
        if near:
            pairs.append((row, min(near, key=lambda r: abs(r.amplitude - row.amplitude))))
    largest = max(row.energy for row in truth.points) or np.nan
    return Score(
        max((abs(r.amplitude / row.amplitude - 1) for row, r in pairs), default=np.nan),
        max((abs(r.energy - row.energy) / largest for row, r in pairs), default=np.nan),
        len(truth.points) - len(pairs),
    )
