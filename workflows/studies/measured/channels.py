"""Channels of a time series, and linear combinations of them: displacement and forces over a contact.

A channel is named with its unit, `F1 [N]` or `F1_N`; one without a unit counts volts or whatever else the instrument
gives. A combination is a sum of products such as

    cos(45 deg)*F1 - cos(45 deg)*F2        25 N*U1 + 24 N*U2        31 N

whose factors may have units: so a raw channel is calibrated, and the forces on both limbs of an L-shaped separator
become those along and across the contact.
Source  Tamatam 2021, eq. 5.1"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.sources import foreign_process
from tribodyn.hdf5_file import opened_hdf5
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import unknown_key
from tribodyn.workflows.scene.units import NUMBER, Unit, parse_unit, to_si
from tribodyn.workflows.studies.measured import universal_file
from tribodyn.workflows.studies.measured.reading import column_numbers, csv_columns

NONE = parse_unit("")
SUM = re.compile(r"(?<!\d[eE])([+-])(?![^(]*\))")  # between terms, outside brackets and exponents


@dataclass(frozen=True)
class Channels:
    """Time series of one run. values : by name, (n,) in the unit of the channel; none for that of an instrument"""

    run: str
    values: Mapping[str, tuple[np.ndarray, Unit]]

    def combined(self, text: str, unit: str) -> np.ndarray:
        """(n,) a combination in a unit. Raises  Refusal: an unknown channel, or a sum of other units"""
        target = parse_unit(unit)
        n = max(len(values) for values, _ in self.values.values())
        total = np.zeros(n)
        for sign, term in _terms(text.strip(), self.values):
            values, dimension = self._product(term)
            if dimension != target.dimension:
                cure = f"name the channel with its unit, or give a factor with one, such as 1 {unit}*U1"
                raise Refusal(f"{term} in {text} is not in {unit} or alike: {cure}")
            total = total + sign * values / float(target.factor)
        return total

    def _product(self, term: str) -> tuple[Any, tuple[int, ...]]:
        value: Any = 1.0
        dimension: tuple[int, ...] = (0,) * 5
        for factor in [term] if term in self.values else (part.strip() for part in term.split("*")):
            numbers: Any
            if factor in self.values:
                numbers, unit = self.values[factor]
            elif (turn := re.fullmatch(r"(cos|sin)\((.*)\)", factor)) is not None:
                numbers, unit = (cos if turn[1] == "cos" else sin)(to_si(turn[2], "rad")), NONE
            elif (number := NUMBER.fullmatch(factor)) is not None:
                numbers, unit = float(number[1]), parse_unit(number[2])
            else:
                raise Refusal(unknown_key(factor, [*self.values]))
            value = value * numbers * float(unit.factor)
            dimension = tuple(a + b for a, b in zip(dimension, unit.dimension, strict=True))
        return value, dimension


def _terms(text: str, names: Mapping[str, Any]) -> list[tuple[float, str]]:
    """Signs and terms of a sum."""
    if text in names:
        return [(1.0, text)]
    first, *others = SUM.split(text)
    pieces = ["+", first, *others] if first.strip() else others
    return [(-1.0 if sign == "-" else 1.0, term.strip()) for sign, term in zip(pieces[::2], pieces[1::2], strict=True)]


def read_channels(path: Path, names: tuple[str, ...]) -> tuple[dict[str, str], list[Channels]]:
    """Facts of a file .csv, .mat, .uff, .unv, .h5 or .hdf5, and the channels of each of its runs.

    names : of facts, lines `# name = value` of a CSV file
    Rows of a CSV file with another `run`, structs of a MATLAB file, groups of an HDF5 file and channels of a universal
    file that begin again are other runs.
    Raises  Refusal"""
    readers = {
        ".mat": _of_mat, ".uff": universal_file.read_time_series, ".h5": _of_hdf5
    }  # fmt: skip
    readers |= {".unv": readers[".uff"], ".hdf5": readers[".h5"]}
    ending = path.suffix.lower()
    if ending != ".csv" and ending not in readers:
        raise Refusal(f"{path}: time series are read from files .csv, {', '.join(readers)}")
    if not path.is_file():
        raise Refusal(f"there is no file of a measurement {path}")
    try:
        facts, tables = _of_csv(path, names) if ending == ".csv" else ({}, readers[ending](path))
        runs = [Channels(run, _channels(columns)) for run, columns in tables.items()]
    except (Refusal, OSError) as trouble:
        raise Refusal(f"{path.name}: {trouble}") from None
    return facts, [run for run in runs if run.values]


def _channels(columns: Mapping[str, Any]) -> dict[str, tuple[np.ndarray, Unit]]:
    """Columns of numbers by their names without units."""
    channels = {}
    for name, column in columns.items():
        values = np.asarray(column)
        if values.dtype.kind not in "biuf" or values.ndim != 1 or len(values) < 2:
            continue
        if not np.isfinite(values).all():
            raise Refusal(f"channel {name} has values that are no numbers: leave their rows out")
        channels[_named(name)[0]] = values.astype(float), _named(name)[1]
    return channels


def _named(name: str) -> tuple[str, Unit]:
    """Name and unit of `F1 [N]` or `F1_N`."""
    bracket = re.fullmatch(r"(.*?)\s*\[(.*)\]", name.strip())
    base, _, unit = name.strip().rpartition("_") if bracket is None else (bracket[1], "", bracket[2])
    try:
        return (base, parse_unit(unit)) if base and unit else (name.strip(), NONE)
    except Refusal:  # of an instrument, or no unit at all
        return (name.strip() if bracket is None else base), NONE


def _of_csv(path: Path, names: tuple[str, ...]) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    facts, texts = csv_columns(path, names)
    labels = texts.pop("run", np.zeros(len(next(iter(texts.values()))), "U1"))
    columns = {name: column_numbers(name, column) for name, column in texts.items()}
    runs = dict.fromkeys(labels.tolist())
    return facts, {run: {name: column[labels == run] for name, column in columns.items()} for run in runs}


def _of_mat(path: Path) -> dict[str, dict[str, Any]]:
    content = foreign_process.call("tribodyn.workflows.studies.measured.matlab_file", "content", path)
    structs = {name: table for name, table in content.items() if isinstance(table, dict)}
    return structs or {"": content}


def _of_hdf5(path: Path) -> dict[str, dict[str, Any]]:
    with opened_hdf5(path) as file:
        groups = {name: item for name, item in file.items() if hasattr(item, "items")} or {"": file}
        return {run: {_with_unit(name, item): item[()] for name, item in group.items() if hasattr(item, "shape")}
                for run, group in groups.items()}  # fmt: skip


def _with_unit(name: str, item: Any) -> str:
    unit = next((item.attrs[key] for key in ("unit", "units") if key in item.attrs), "")
    text = unit.decode() if isinstance(unit, bytes) else str(unit)
    return f"{name} [{text}]" if text else name
