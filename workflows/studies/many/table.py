"""The table of a study: a row a run, in the order of the design, as CSV, HDF5 and Parquet."""

from __future__ import annotations

import csv
import importlib.util
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from scipy import stats

from tribodyn.workflows.studies.many.distributions import si
from tribodyn.workflows.studies.many.task import Row

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

RUN, STATUS, SENTENCE = "run", "status", "sentence"
LIFE = "life_cycles"
FEWEST = 5  # complete runs that a correlation is told of


@dataclass(frozen=True)
class StudyTable:
    """What came out of a study.

    columns : name -> (n_run,) of numbers in SI units, nan where there is none, or of texts; run, status and sentence,
        then the keys that vary, then what was computed
    varied : names of the keys
    """

    name: str
    columns: Mapping[str, np.ndarray]
    varied: tuple[str, ...]

    @property
    def computed(self) -> tuple[str, ...]:
        """Names of the numbers that were computed."""
        return tuple(name for name in self.columns if name not in (RUN, STATUS, SENTENCE, *self.varied))

    def count(self, status: str) -> int:
        """Runs of a status."""
        return int(np.count_nonzero(self.columns[STATUS] == status))

    def bounded(self, number: str) -> tuple[np.ndarray, np.ndarray]:
        """A number of the runs, nan where there is none; and that of runs where it is a lower bound only.

        Both (n_run,). A life that did not end within its run counts as the cycles that the run came to
        """
        lived = number == LIFE and "cycles" in self.columns
        if number not in self.computed and not lived:
            raise ValueError(f'{self.name} has no number "{number}": there are {", ".join(self.computed) or "none"}')
        values = np.asarray(self.columns.get(number, np.full(len(self.columns[RUN]), np.nan)), float)
        bounds = np.full(len(values), np.nan)
        if lived:
            ended = np.asarray(self.columns["cycles"], float)
            open_ = np.isnan(values) & (ended > 0) & (self.columns[STATUS] == "complete")
            values, bounds = np.where(open_, ended, values), np.where(open_, ended, bounds)
        return values, bounds

    def influence(self) -> dict[str, dict[str, float]]:
        """Spearman's rank correlation of computed numbers with the keys that vary, over the complete runs.

        Number -> key -> correlation; what does not vary or has fewer than FEWEST values is left out
        """
        found: dict[str, dict[str, float]] = {}
        for number in self.computed:
            for key in self.varied:
                x, y = self.columns[key], self.columns[number]
                if x.dtype.kind != "f":
                    continue
                there = np.isfinite(x) & np.isfinite(y)
                if there.sum() >= FEWEST and np.ptp(x[there]) > 0 and np.ptp(y[there]) > 0:
                    found.setdefault(number, {})[key] = float(stats.spearmanr(x[there], y[there]).statistic)
        return found

    def to_pandas(self) -> pd.DataFrame:
        """The table as a DataFrame with the runs as its index."""
        import pandas

        return pandas.DataFrame(dict(self.columns)).set_index(RUN)

    def plot_distribution(self, number: str = "life_cycles") -> Figure:
        """A number of the runs on Weibull paper, see `many.life_picture`; raises ValueError where they are few."""
        from tribodyn.workflows.studies.many import life_picture

        return life_picture.picture(self, number)

    def plot_parallel(self, number: str | None = None) -> Figure:
        """The runs as parallel coordinates, coloured by a number; raises ValueError where they are few."""
        from tribodyn.workflows.studies.many import parallel_picture

        return parallel_picture.picture(self, number)

    def plot(self) -> Figure:
        """Response against each of the keys that vary, see `many.picture`."""
        from tribodyn.workflows.studies.many import picture

        return picture.picture(self)


def table(name: str, varied: Sequence[Mapping[str, Any]], rows: Mapping[int, Row]) -> StudyTable:
    """The table of the runs that are finished.

    varied : values of the keys, run by run; rows : by the number of the run, from 1
    """
    numbers = sorted(rows)
    columns = {RUN: np.array(numbers, int)}
    for column, of in ((STATUS, "status"), (SENTENCE, "sentence")):
        columns[column] = np.array([getattr(rows[n], of) for n in numbers], dtype=object)
    keys = tuple(varied[0])
    for key in keys:
        columns[key] = _values([run[key] for run in varied], [n - 1 for n in numbers])
    known = dict.fromkeys(name for n in numbers for name in rows[n].numbers)
    for column in _ordered(known):
        columns[column] = np.array([rows[n].numbers.get(column, np.nan) for n in numbers])
    return StudyTable(name, columns, keys)


def _ordered(names: Mapping[str, None]) -> list[str]:
    """Names of numbers in an order that does not depend on which run came first."""
    from tribodyn.workflows.studies.many.task import ENDS, SINGLE

    first = [f"{name}_{end}" for name in ENDS for end in ("first", "last")] + [*SINGLE, "peak_at_end"]
    return [name for name in first if name in names] + sorted(name for name in names if name not in first)


def _values(values: Sequence[Any], chosen: Sequence[int]) -> np.ndarray:
    """Values of a key: numbers in SI units where all of the study's are, else texts."""
    numbers = [si(value) for value in values]
    if all(number is not None for number in numbers):
        return np.array([numbers[i] for i in chosen], float)
    return np.array([str(values[i]) for i in chosen], dtype=object)


def write(found: StudyTable, folder: Path) -> tuple[Path, Path]:
    """Write study.csv and study.h5, and study.parquet where pyarrow is installed; the same table gives the same bytes.

    Returns the first two
    """
    paths = folder / "study.csv", folder / "study.h5"
    fresh = [path.with_suffix(f"{path.suffix}.new") for path in paths]
    with fresh[0].open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(found.columns)
        for i in range(len(found.columns[RUN])):
            writer.writerow([_cell(column[i]) for column in found.columns.values()])
    with h5py.File(fresh[1], "w") as hdf:
        hdf.attrs["format"], hdf.attrs["study"] = "tribodyn study 1", found.name
        for name, column in found.columns.items():
            kind = h5py.string_dtype() if column.dtype.kind == "O" else column.dtype
            data = hdf.create_dataset(name, data=column, dtype=kind)
            if name == RUN:
                data.make_scale(RUN)
            else:
                data.dims[0].attach_scale(hdf[RUN])
            if name in found.varied:
                data.attrs["varied"] = 1
    for new, path in zip(fresh, paths, strict=True):
        os.replace(new, path)
    if importlib.util.find_spec("pyarrow") is not None:
        _write_parquet(found, folder / "study.parquet")
    return paths


def _write_parquet(found: StudyTable, path: Path) -> None:
    import pyarrow
    from pyarrow import parquet

    columns = {name: pyarrow.array(column.tolist(), from_pandas=True) for name, column in found.columns.items()}
    fresh = path.with_suffix(".parquet.new")
    parquet.write_table(pyarrow.table(columns), fresh)
    os.replace(fresh, path)


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)
