"""Read measured curves: columns of CSV files, MATLAB files and universal files (datasets 58 and 55).

A column is named with its unit, `frequency_Hz`, `acceleration [m/s2]`, `phase_deg`. What columns do not say, such as
the direction, is in a line `# direction = z` of a CSV file, in a text of that name in a MATLAB file, or given."""

import csv
import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.sources import foreign_process
from tribodyn.hbm.time.ring_down import from_decay
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.refusal import Refusal
from tribodyn.text_file import numbers_of, text_of
from tribodyn.workflows.scene.fields import parsed_direction, unknown_key
from tribodyn.workflows.scene.units import LARGEST, SMALLEST, to_si
from tribodyn.workflows.studies.measured import universal_file
from tribodyn.workflows.studies.measured.measurement import OUTPUT, Kind, Measurement, ResponseUnit, Run

FACTS = {
    "output": "name of the scene's output that was measured",
    "direction": "of the response, such as -z",
    "force_direction": "of the force",
    "position": "x, y, z of the sensor, each with its unit",
    "phase": '"response over force", or "force over response"',
    "control": '"force" or "response", what was held constant',
    "unit": "of the response, such as m/s2/N, where its column or axis has none or a wrong one",
    "node": "number of the measured node in a universal file",
    "table": "name of the struct in a MATLAB file",
}
RESPONSES = ("acceleration", "velocity", "displacement", "response", "real", "amplitude")  # the first that is there
COLUMNS = ("frequency", "time", "force", "phase", "damping", "frequency_error", "damping_error", "imag", *RESPONSES)

Columns = dict[str, tuple[np.ndarray, str]]
"""word -> values and their unit"""
_Raw = tuple[dict[str, str], dict[str, Any], tuple[str, ...]]
"""Facts that a file has, its columns by their names, clauses on what of it is not read."""


def read(path: str | Path, facts: Mapping[str, str] | None = None) -> Measurement:
    """The measurement in a file .csv, .mat, .uff or .unv.

    facts : what the file does not say, or says otherwise, see FACTS
    Raises  Refusal: one sentence that names file, key and cure"""
    path = Path(path)
    readers = {".csv": _of_csv, ".mat": _of_mat, **dict.fromkeys((".uff", ".unv"), universal_file.read_columns)}
    if path.suffix.lower() not in readers:
        raise Refusal(f"{path}: measurements are read from files {', '.join(readers)}")
    if not path.is_file():
        raise Refusal(f"there is no file of a measurement {path}")
    try:
        facts_given = {name: str(text) for name, text in (facts or {}).items()}
        for name in facts_given:
            if name not in FACTS:
                raise Refusal(unknown_key(name, [*FACTS]))
        file_facts, raw, unread = readers[path.suffix.lower()](path, facts_given)
        measurement = _measurement(raw, {**file_facts, **facts_given}, path.name)
        return replace(measurement, unused=(*measurement.unused, *unread))
    except (Refusal, OSError) as trouble:
        raise Refusal(f"{path.name}: {trouble}") from None


def _of_csv(path: Path, facts_given: Mapping[str, str]) -> _Raw:
    return *csv_columns(path, FACTS), ()


def csv_columns(path: Path, known: Collection[str]) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Facts and columns of texts of a CSV file. known : names of facts. Raises  Refusal"""
    lines = text_of(path).splitlines()
    facts = {}
    for line in lines:
        if line.startswith("#") and (fact := re.match(r"#\s*(\w+)\s*=\s*(.*?)\s*$", line)):
            if fact[1] not in known:
                raise Refusal(unknown_key(fact[1], [*known]))
            facts[fact[1]] = fact[2].strip('"')
    table = [line for line in lines if line.strip() and not line.startswith("#")]
    separator = max(",;\t", key=(table or [""])[0].count)
    point = "," if separator == "," else "."  # beside another separator a comma is that of a decimal number
    try:
        rows = list(csv.reader((line.replace(",", point) for line in table), delimiter=separator))
    except csv.Error as error:
        raise Refusal(f"no table of values between commas ({error}): write it again") from None
    if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
        raise Refusal("expected a line of column names and rows of as many values below it")
    names = [name.strip() for name in rows[0]]
    if twice := {name for name in names if names.count(name) > 1}:
        raise Refusal(f"two columns have the name {min(twice)}: rename them")
    return facts, dict(zip(names, map(np.array, zip(*rows[1:], strict=True)), strict=True))


def _of_mat(path: Path, facts_given: Mapping[str, str]) -> _Raw:
    content = foreign_process.call("tribodyn.workflows.studies.measured.matlab_file", "content", path)
    facts = {name: str(content[name]) for name in FACTS if isinstance(content.get(name), str)}
    structs = {name: table for name, table in content.items() if isinstance(table, dict)}
    if "table" in facts_given:
        if facts_given["table"] not in structs:
            raise Refusal(f"table = {facts_given['table']}: there is {', '.join(structs) or 'no struct'}")
        return facts, structs[facts_given["table"]], ()
    plain = {name: v for name, v in content.items() if not isinstance(v, dict)}
    tables = [
        plain,
        *(structs[name] for name in ("response", "backbone", "ring_down") if name in structs),
        *structs.values(),
    ]
    words = [{word for word in (_word(name)[0] for name in table)} for table in tables]
    for table, words_of_table in zip(tables, words, strict=True):
        if words_of_table & {"frequency", "time"}:
            return facts, table, ()
    raise Refusal(f"no struct has a column frequency or time: there is {', '.join([*plain, *structs])}")


def _word(name: str) -> tuple[str, str]:
    """The word and the unit in the name of a column."""
    for word in sorted(COLUMNS, key=len, reverse=True):
        match = re.match(rf"{word}(?:\s*\[(.*)\]|_(.*))?$", name.strip(), re.IGNORECASE)
        if match:
            unit = match[1] if match[1] is not None else (match[2] or "").replace("_per_", "/").replace("_", "/")
            return word, re.sub(r"\bhz\b", "Hz", unit)
    return name, ""


def _measurement(raw: Mapping[str, Any], facts: Mapping[str, str], source: str) -> Measurement:
    """Columns as a measurement."""
    output = facts.get("output", OUTPUT)
    exports = {name: raw.get(f"{output}_{name}_m") for name in ("a1", "b1")}
    timed = all(column is not None for column in exports.values())
    if timed:  # an export of ours: x = a cos + b sin
        frequency_columns = {name: column for name, column in raw.items() if _word(name)[0] == "frequency"}
        raw = {**frequency_columns, "real [m]": exports["a1"], "imag [m]": -column_numbers("b1", exports["b1"])}
    columns: Columns = {}
    for name, column in raw.items():
        word, unit = _word(name)
        if word in COLUMNS and word not in columns:
            columns[word] = column_numbers(name, column, word in RESPONSES), unit
    response = next((word for word in RESPONSES if word in columns), None)
    if "frequency" not in columns and "time" not in columns:
        raise Refusal(f"no column frequency or time among {', '.join(raw)}")
    if response is None and "damping" not in columns:
        raise Refusal(f"no column {' or '.join(RESPONSES)}, with its unit, among {', '.join(raw)}")
    n = len(columns["frequency" if "frequency" in columns else "time"][0])
    for word, (column, _) in columns.items():
        if len(column) != n:
            raise Refusal(f"column {word} has {len(column)} values, frequency or time {n}: give one for each")
    frequency = _si(columns, "frequency", "Hz", n)
    of = ResponseUnit(0, 1.0, False) if response is None else _unit_of(response, columns[response][1], facts)
    values = np.full(n, np.nan, complex) if response is None else of.factor * columns[response][0].astype(complex)
    phased = "imag" in columns or "phase" in columns or (response in columns and np.iscomplexobj(columns[response][0]))
    if "imag" in columns:
        values = values + 1j * _unit_of("imag", columns["imag"][1], facts).factor * columns["imag"][0]
    elif "phase" in columns:
        values = np.abs(values) * np.exp(1j * _si(columns, "phase", "rad", n))
    reference = facts.get("phase", "response over force")
    if reference not in ("response over force", "force over response"):
        raise Refusal(f'phase = "{reference}": expected "response over force" or "force over response"')
    if reference == "force over response":
        values = values.conj()
    damping, force = _si(columns, "damping", "", n), np.abs(_si(columns, "force", "N", n))
    errors = np.stack([_si(columns, f"{name}_error", "", n) for name in ("frequency", "damping")], axis=1)
    kind: Kind = "modes" if response is None else "backbone" if "damping" in columns else "response"
    names, controls = (_texts(raw, key, n, facts.get(key, "")) for key in ("run", "control"))
    labels, runs = list(zip(controls, names, _texts(raw, "repeat", n, ""), strict=True)), []
    if "time" in columns:
        kind, time = "backbone", _si(columns, "time", "s", n)
    kept = (frequency != 0) | (kind != "response")
    for label in dict.fromkeys(labels):
        at = np.array([label_of_row == label for label_of_row in labels]) & kept
        name = " ".join(word for word in label[:2] if word) or source
        if "time" in columns:
            runs.append(_decayed(name, label[0], time[at], values[at].real, of.order))
            continue
        spin = 2j * np.pi * frequency[at]
        x = np.abs(values[at]) / np.abs(spin) ** of.order if kind == "backbone" else values[at] / spin**of.order
        runs.append(Run(name, label[0], frequency[at], x.astype(complex), force[at], damping[at], errors[at]))
    positive = [run.frequency for run in runs] if response is None else [run.frequency * run.amplitude for run in runs]
    if not all(len(k) and np.isfinite(k).all() and (k > 0).all() for k in positive):
        raise Refusal("frequency and response must be numbers above 0 in every row")
    if "force" in columns and kind == "response" and not (force[kept] > 0).all():
        raise Refusal("column force: expected numbers other than 0 in every row")
    unused = () if kept.all() else (f"{n - kept.sum()} lines at 0 Hz, where nothing vibrates",)
    directions = _direction(facts, "direction"), _direction(facts, "force_direction")
    return Measurement(
        kind, tuple(runs), source, output, of.order, *directions, _position(facts), of.per_force, phased, timed,
        "time" in columns, unused,
    )  # fmt: skip


def _decayed(name: str, control: str, time: np.ndarray, values: np.ndarray, order: int) -> Run:
    """A free decay as the backbone that it follows."""
    step = np.diff(time)
    if len(time) < 8 or np.ptp(step) > 1e-3 * abs(step.mean()):
        raise Refusal("time: a free decay needs equal steps of time")
    even = time[0] + step.mean() * np.arange(len(time))
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values))))
    guess = 2 * np.pi * max(int(spectrum.argmax()), 1) / (step.mean() * len(values))
    try:
        decay = from_decay(even, values, guess)
    except IntegrationFailed as failure:
        raise Refusal(str(failure)) from None
    none = np.full((len(decay.omega), 2), np.nan)
    x = (decay.amplitude / decay.omega**order).astype(complex)
    return Run(name, control, decay.omega / (2 * np.pi), x, none[:, 0], decay.damping, none)


def _unit_of(word: str, unit: str, facts: Mapping[str, str]) -> ResponseUnit:
    """The unit of a column of the response."""
    if not (unit := facts.get("unit", unit)):
        raise Refusal(f"column {word}: give its unit, such as {word} [m/s2]")
    try:
        of = ResponseUnit.parsed(unit)
    except Refusal as trouble:
        raise Refusal(f"column {word}: {trouble}") from None
    if word in RESPONSES[:3] and word != ("displacement", "velocity", "acceleration")[of.order]:
        raise Refusal(f"column {word}: {unit} is no unit of it")
    return of


def _si(columns: Columns, word: str, unit: str, n: int) -> np.ndarray:
    """A column in a unit; nan where it is not there."""
    if word not in columns:
        return np.full(n, np.nan)
    values, unit_of_column = columns[word]
    try:
        return values * to_si(f"1 {unit_of_column}".strip(), unit)
    except Refusal as trouble:
        raise Refusal(f"column {word}: {trouble}") from None


def _texts(raw: Mapping[str, Any], key: str, n: int, missing: str) -> list[str]:
    texts = [str(text) for text in np.atleast_1d(raw[key])] if key in raw else [missing] * n
    if len(texts) != n:
        raise Refusal(f"column {key} has {len(texts)} values, frequency or time {n}: give one for each")
    return texts


def _direction(facts: Mapping[str, str], key: str) -> tuple[float, float, float] | None:
    if key not in facts:
        return None
    text = facts[key].strip().strip("()[]")
    try:
        return parsed_direction(text if "," not in text else column_numbers(key, text.split(",")).tolist())
    except Refusal as trouble:
        raise Refusal(f"{key}: {trouble}") from None


def _position(facts: Mapping[str, str]) -> tuple[float, float, float] | None:
    if "position" not in facts:
        return None
    texts = facts["position"].strip("()[]").split(",")
    try:
        lengths = tuple(to_si(text.strip().strip('"'), "m") for text in texts)
    except Refusal:
        lengths = ()
    if len(lengths) != 3:
        raise Refusal('position: expected three lengths such as "-0.3 m, 0 m, 6 mm"')
    return lengths


def column_numbers(name: str, column: Any, may_be_complex: bool = False) -> np.ndarray:
    """A column as numbers (n,); raises Refusal."""
    try:
        values = np.atleast_1d(np.asarray(column))
        values = values if may_be_complex and np.iscomplexobj(values) else values.astype(float)
    except (ValueError, TypeError):
        wrong = next((text for text in np.ravel(column).tolist() if numbers_of([f"{text}"]) is None), column)
        raise Refusal(f"column {name} has '{wrong}', which is no number: correct it") from None
    if values.ndim > 1:
        raise Refusal(f"column {name} has the shape {values.shape}: give one column")
    size = np.abs(values)
    if (size > LARGEST).any() or ((size > 0) & (size < SMALLEST)).any():
        raise Refusal(f"column {name} has numbers that nothing measures, {size.max():.3g}: correct them")
    return values
