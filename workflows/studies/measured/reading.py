"""Read measured curves: columns of CSV files, MATLAB files and universal files (datasets 58 and 55).

A column is named with its unit, `frequency_Hz`, `acceleration [m/s2]`, `phase_deg`. What columns do not say, such as
the direction, is in a line `# direction = z` of a CSV file, in a text of that name in a MATLAB file, or given.
Source  universal files: SDRC I-DEAS Test Data Analysis, datasets 55, 58 and 164, read by pyuff
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.hbm.time.ring_down import from_decay
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.refusal import Refusal
from tribodyn.workflows.export.result_tables import DataKind, Function
from tribodyn.workflows.scene.fields import parsed_direction, unknown_key
from tribodyn.workflows.scene.units import parse_unit, to_si
from tribodyn.workflows.studies.measured.measurement import OUTPUT, Kind, Measurement, Run

FACTS = {
    "output": "name of the scene's output that was measured",
    "direction": "of the response, such as -z",
    "force_direction": "of the force",
    "position": "x, y, z of the sensor, each with its unit",
    "phase": '"response over force", or "force over response"',
    "control": '"force" or "response", what was held constant',
    "node": "number of the measured node in a universal file",
    "table": "name of the struct in a MATLAB file",
}
RESPONSES = ("acceleration", "velocity", "displacement", "response", "real", "amplitude")  # the first that is there
COLUMNS = ("frequency", "time", "force", "phase", "damping", "frequency_error", "damping_error", "imag", *RESPONSES)

Columns = dict[str, tuple[np.ndarray, str]]
"""word -> values and their unit"""


def read(path: str | Path, facts: Mapping[str, str] | None = None) -> Measurement:
    """The measurement in a file .csv, .mat, .uff or .unv.

    facts : what the file does not say, or says otherwise, see FACTS
    Raises  Refusal: one sentence that names file, key and cure
    """
    path = Path(path)
    readers = {".csv": _of_csv, ".mat": _of_mat, ".uff": _of_uff, ".unv": _of_uff}
    if path.suffix.lower() not in readers:
        raise Refusal(f"{path}: measurements are read from files {', '.join(readers)}")
    if not path.is_file():
        raise Refusal(f"there is no file of a measurement {path}")
    try:
        facts_given = {name: str(text) for name, text in (facts or {}).items()}
        for name in facts_given:
            if name not in FACTS:
                raise Refusal(unknown_key(name, [*FACTS]))
        file_facts, raw = readers[path.suffix.lower()](path, facts_given)
        return _measurement(raw, {**file_facts, **facts_given}, path.name)
    except (Refusal, OSError, UnicodeDecodeError) as trouble:
        raise Refusal(f"{path.name}: {trouble}") from None


def _of_csv(path: Path, facts_given: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    facts = {}
    for line in lines:
        if line.startswith("#") and (fact := re.match(r"#\s*(\w+)\s*=\s*(.*?)\s*$", line)):
            if fact[1] not in FACTS:
                raise Refusal(unknown_key(fact[1], [*FACTS]))
            facts[fact[1]] = fact[2].strip('"')
    rows = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
        raise Refusal("expected a line of column names and rows of as many values below it")
    return facts, {name.strip(): np.array(c) for name, c in zip(rows[0], zip(*rows[1:], strict=True), strict=True)}


def _of_mat(path: Path, facts_given: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise Refusal("MATLAB files of version 7.3 are not read: save it with -v7") from None
    except (ValueError, TypeError) as error:
        raise Refusal(f"no MATLAB file: {error}") from None
    facts = {name: str(content[name]) for name in FACTS if isinstance(content.get(name), str)}
    structs = {name: table for name, table in content.items() if isinstance(table, dict)}
    if "table" in facts_given:
        if facts_given["table"] not in structs:
            raise Refusal(f"table = {facts_given['table']}: there is {', '.join(structs) or 'no struct'}")
        return facts, structs[facts_given["table"]]
    plain = {name: v for name, v in content.items() if isinstance(v, np.ndarray) and not name.startswith("__")}
    tables = [
        plain,
        *(structs[name] for name in ("response", "backbone", "ring_down") if name in structs),
        *structs.values(),
    ]
    words = [{word for word in (_word(name)[0] for name in table)} for table in tables]
    for table, words_of_table in zip(tables, words, strict=True):
        if words_of_table & {"frequency", "time"}:
            return facts, table
    raise Refusal(f"no struct has a column frequency or time: there is {', '.join([*plain, *structs])}")


def _of_uff(path: Path, facts_given: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    pyuff = package("pyuff")
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except (ValueError, KeyError, IndexError) as error:
        raise Refusal(f"no universal file: {error}") from None
    sets = sets if isinstance(sets, list) else [sets]
    length = next((s["length"] for s in sets if s["type"] == 164), 1.0) or 1.0
    units = {DataKind.DISPLACEMENT: "m", DataKind.VELOCITY: "m/s", DataKind.ACCELERATION: "m/s2"}
    nodal = [s for s in sets if s["type"] == 55]
    curves = [s for s in sets if s["type"] == 58 and s["ordinate_spec_data_type"] in units]
    for function in (Function.FRF, Function.GENERAL, Function.TIME):
        x = DataKind.TIME if function == Function.TIME else DataKind.FREQUENCY
        chosen = [s for s in curves if s["func_type"] == function and s["abscissa_spec_data_type"] == x]
        if chosen:
            return _of_58(chosen, facts_given, length, units)
    if nodal:
        return {}, _of_55(nodal)
    raise Refusal("it has no response (dataset 58 over frequency or time, of displacement, velocity or acceleration)")


def _of_58(
    sets: list[dict[str, Any]], facts_given: Mapping[str, str], length: float, units: Mapping[DataKind, str]
) -> tuple[dict[str, str], dict[str, Any]]:
    """Sets of one node and direction, as columns; those that name an output of ours are taken by its name."""
    output = facts_given.get("output", OUTPUT)
    named = [s for s in sets if s["id1"].startswith((f"{output} over force", f"{output}, harmonic 1"))]
    sets = named or [s for s in sets if "node" not in facts_given or str(s["rsp_node"]) == facts_given["node"]]
    places = sorted({(s["rsp_node"], s["rsp_dir"]) for s in sets})
    if len(places) != 1:
        nodes = ", ".join(sorted({str(s["rsp_node"]) for s in sets})) or "no such"
        raise Refusal(f"it has {len(places)} measured places, of {nodes} node: give node = NUMBER")
    first = sets[0]
    facts = {
        name: f"{'-' if first[key] < 0 else ''}{'xyz'[abs(first[key]) - 1]}"
        for name, key in (("direction", "rsp_dir"), ("force_direction", "ref_dir"))
        if 1 <= abs(first[key]) <= 3
    }
    label = str(first["ordinate_axis_units_lab"]).strip()
    unit = label if label not in ("", "NONE") else units[first["ordinate_spec_data_type"]]
    scale = 1.0 if label not in ("", "NONE") else 1.0 / length
    x = np.concatenate([s["x"] for s in sets])
    data = scale * np.concatenate([s["data"] for s in sets])
    run = np.concatenate([np.full(len(s["x"]), s["id1"]) for s in sets])
    if first["func_type"] == Function.TIME:
        return facts, {"time [s]": x, f"response [{unit}]": data.real, "run": run}
    per = f"{unit}/N" if first["func_type"] == Function.FRF and not unit.endswith("/N") else unit
    return facts, {"frequency [Hz]": x, f"real [{per}]": data.real, f"imag [{per}]": data.imag, "run": run}


def _of_55(sets: list[dict[str, Any]]) -> dict[str, Any]:
    """Natural frequencies and damping of modes, real or complex, one in each set."""
    modes = [s for s in sets if s["analysis_type"] in (2, 3)]
    if not modes:
        raise Refusal("its datasets 55 hold no modes")
    eig = [s["eig"] if s["analysis_type"] == 3 else 2j * np.pi * s["freq"] for s in modes]
    damping = [
        -e.real / abs(e) if s["analysis_type"] == 3 else s["modal_damp_vis"] + s["modal_damp_his"] / 2
        for s, e in zip(modes, eig, strict=True)
    ]
    return {"frequency [Hz]": np.abs(eig) / (2 * np.pi), "damping": np.array(damping)}


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
        raw = {**frequency_columns, "real [m]": exports["a1"], "imag [m]": -np.asarray(exports["b1"], float)}
    columns: Columns = {}
    for name, column in raw.items():
        word, unit = _word(name)
        if word in COLUMNS and word not in columns:
            columns[word] = _numbers(name, column), unit
    response = next((word for word in RESPONSES if word in columns), None)
    if "frequency" not in columns and "time" not in columns:
        raise Refusal(f"no column frequency or time among {', '.join(raw)}")
    if response is None and "damping" not in columns:
        raise Refusal(f"no column {' or '.join(RESPONSES)}, with its unit, among {', '.join(raw)}")
    n = len(columns["frequency" if "frequency" in columns else "time"][0])
    frequency = _si(columns, "frequency", "Hz", n)
    order, factor, per_force = (
        (0, 1.0, False) if response is None else _kind_of_response(response, columns[response][1])
    )
    values = np.full(n, np.nan, complex) if response is None else factor * columns[response][0].astype(complex)
    phased = "imag" in columns or "phase" in columns
    if "imag" in columns:
        values = values + 1j * factor * columns["imag"][0]
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
    for label in dict.fromkeys(labels):
        at = np.array([label_of_row == label for label_of_row in labels])
        name = " ".join(word for word in label[:2] if word) or source
        if "time" in columns:
            runs.append(_decayed(name, label[0], time[at], values[at].real, order))
            continue
        spin = 2j * np.pi * frequency[at]
        x = np.abs(values[at]) / np.abs(spin) ** order if kind == "backbone" else values[at] / spin**order
        runs.append(Run(name, label[0], frequency[at], x.astype(complex), force[at], damping[at], errors[at]))
    positive = [run.frequency for run in runs] if response is None else [run.frequency * run.amplitude for run in runs]
    if not all(np.isfinite(k).all() and (k > 0).all() for k in positive):
        raise Refusal("frequency and response must be numbers above 0 in every row")
    return Measurement(
        kind, tuple(runs), source, output, order, _direction(facts, "direction"), _direction(facts, "force_direction"),
        _position(facts), per_force, phased, timed, "time" in columns,
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


def _kind_of_response(word: str, unit: str) -> tuple[int, float, bool]:
    """Order of the derivative, factor to SI units, and whether it is per force."""
    if not unit:
        raise Refusal(f"column {word}: give its unit, such as {word} [m/s2]")
    unit_of_column = parse_unit(unit)
    for per_force in (False, True):
        for order, base in enumerate(("m", "m/s", "m/s2")):
            target = parse_unit(f"{base}/N" if per_force else base)
            if unit_of_column.dimension == target.dimension:
                if word in RESPONSES[:3] and word != ("displacement", "velocity", "acceleration")[order]:
                    raise Refusal(f"column {word}: {unit} is no unit of it")
                return order, float(unit_of_column.factor / target.factor), per_force
    raise Refusal(f"column {word}: expected a displacement, velocity or acceleration, or one per force, not {unit}")


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
    return [str(text) for text in np.atleast_1d(raw[key])] if key in raw else [missing] * n


def _direction(facts: Mapping[str, str], key: str) -> tuple[float, float, float] | None:
    if key not in facts:
        return None
    text = facts[key].strip().strip("()[]")
    try:
        return parsed_direction(text if "," not in text else _numbers(key, text.split(",")).tolist())
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


def _numbers(name: str, column: Any) -> np.ndarray:
    try:
        return np.atleast_1d(np.asarray(column)).astype(float)
    except (ValueError, TypeError) as error:
        raise Refusal(f"column {name}: {error}") from None
