"""Curves of a universal file as columns: responses or channels (dataset 58), modes (dataset 55), units (dataset 164).

Source  SDRC I-DEAS Test Data Analysis, datasets 55, 58 and 164, read by pyuff"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tribodyn.extras import package
from tribodyn.refusal import Refusal
from tribodyn.workflows.export.result_tables import DataKind, Function
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.measured.measurement import ORDERS, OUTPUT, ResponseUnit, plain_unit

ORDER_OF = {DataKind.DISPLACEMENT: 0, DataKind.VELOCITY: 1, DataKind.ACCELERATION: 2}
DOMAINS = {**dict.fromkeys((Function.FRF, Function.GENERAL), DataKind.FREQUENCY), Function.TIME: DataKind.TIME}
UNSAID = (0, DataKind.PLAIN)  # kinds of data that say nothing
FORCES = (*UNSAID, DataKind.FORCE, DataKind.EXCITATION)
ENDS = re.compile(rb"    -1(?=[\r\n]| {74}|\Z)")  # of datasets, where they begin too
USED = (55, 58, 164)  # datasets that are read
CURE = 'correct the label, or give --fact unit=UNIT, such as "unit=m/s2/N"'


class _Curve(NamedTuple):
    """A response. place : its node and direction, those of the force; unit : of values, (n,) complex or real"""

    name: str
    place: tuple[int, int, int, int]
    unit: str
    x: np.ndarray
    values: np.ndarray


def read_columns(path: Path, facts: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any], tuple[str, ...]]:
    """Facts that the file has, its columns, and clauses on what of it is not read.

    facts : of the user: node, direction and force_direction choose among curves, unit is that of the response
    Raises  Refusal"""
    sets, unread = _datasets(path)
    length = force = 1.0
    responses: list[tuple[dict[str, Any], float, float]] = []
    for entry in sets:
        if entry["type"] == 164:
            length, force = entry["length"] or 1.0, entry["force"] or 1.0
        elif entry["type"] == 58 and _is_response(entry, facts):
            responses.append((entry, length, force))
    for function in DOMAINS:
        if chosen := [of for of in responses if of[0]["func_type"] == function]:
            axis = "time [s]" if function == Function.TIME else "frequency [Hz]"
            return *_of_one_place(axis, [_curve(*of, facts.get("unit", "")) for of in chosen], facts), unread
    if modes := [entry for entry in sets if entry["type"] == 55 and entry["analysis_type"] in (2, 3)]:
        return {}, _modes(modes), unread
    raise Refusal(
        "it has no response (dataset 58 over frequency or time, of displacement, velocity or acceleration) and no modes"
    )


def read_time_series(path: Path) -> dict[str, dict[str, Any]]:
    """Channels over time (dataset 58) by their names with units; one that begins again begins another run.

    Raises  Refusal"""
    runs: list[dict[str, Any]] = [{}]
    for entry in _datasets(path)[0]:
        if entry["type"] != 58 or entry["func_type"] != Function.TIME:
            continue
        name, label = str(entry["id1"]).strip(), _label(entry, "ordinate")
        column = f"{name} [{label}]" if label else name
        if column in runs[-1]:
            runs.append({})
        runs[-1] |= {f"time [{_label(entry, 'abscissa', 's')}]": np.asarray(entry["x"]), column: entry["data"]}
    if not runs[0]:
        raise Refusal("it has no channel over time (dataset 58)")
    return {str(number) if len(runs) > 1 else "": columns for number, columns in enumerate(runs, 1)}


def _datasets(path: Path) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """The datasets that are used, in order, and clauses on the others."""
    if len(ENDS.findall(path.read_bytes())) % 2:
        raise Refusal("a dataset has no end, a line -1: the file is cut off, write it again")
    pyuff = package("pyuff")
    try:
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in file.get_set_types()]
        sets = [file.read_sets(i) for i, kind in enumerate(kinds) if kind in USED]
    except Exception as error:  # pyuff raises Exception itself, or whatever a damaged line makes
        raise Refusal(f"no universal file ({error}): write it again") from None
    if 0 in kinds:
        raise Refusal("a dataset has no number in its first line: the file is broken, write it again")
    return sets, tuple(f"dataset {kind}" for kind in sorted({*kinds} - {*USED}))


def _is_response(entry: Mapping[str, Any], facts: Mapping[str, str]) -> bool:
    """Whether a dataset 58 is a motion over frequency or time, by what it says or, where it says nothing, the user."""
    function, kind = entry["func_type"], entry["ordinate_spec_data_type"]
    is_motion = kind in ORDER_OF or (kind in UNSAID and (function == Function.FRF or "unit" in facts))
    return is_motion and entry["abscissa_spec_data_type"] in (*UNSAID, DOMAINS.get(function))


def _curve(entry: Mapping[str, Any], length: float, force: float, unit: str) -> _Curve:
    """A dataset 58 in SI units, or in the unit that the user gives.

    length, force : numbers of the file that are 1 m and 1 N, by dataset 164; unit : "" for none
    Labels of axes go before dataset 164, which most programs write for form's sake."""
    name, count, values = str(entry["id1"]).strip(), int(entry["num_pts"]), np.asarray(entry["data"])
    if not len(entry["x"]) == len(values) == count and not (entry["binary"] and len(values) > count):
        raise Refusal(f"dataset '{name}' has {len(values)} of {count} points: it is cut off, write it again")
    is_over_force, order = entry["func_type"] == Function.FRF, ORDER_OF.get(entry["ordinate_spec_data_type"])
    if is_over_force and entry["orddenom_spec_data_type"] not in FORCES:
        raise Refusal(f"dataset '{name}' is no response over a force (record 10): leave it out of the file")
    label, label_of_force = _label(entry, "ordinate"), _label(entry, "orddenom")
    if not unit:
        try:
            of = ResponseUnit.parsed(label) if label or order is None else ResponseUnit(order, 1 / length, False)
        except Refusal as trouble:
            raise Refusal(f"dataset '{name}' has the unit '{label}': {trouble}: {CURE}") from None
        if order not in (None, of.order):
            raise Refusal(f"dataset '{name}' is in {label}, and derivative {order} of a motion by record 9: {CURE}")
        values = of.factor * values
        if is_over_force and not of.per_force:
            values *= 1 / to_si(f"1 {label_of_force}", "N") if label_of_force else force
        unit = ORDERS[of.order] + ("/N" if is_over_force or of.per_force else "")
    x_unit = "s" if entry["func_type"] == Function.TIME else "Hz"
    x = np.asarray(entry["x"]) * to_si(f"1 {_label(entry, 'abscissa', x_unit)}", x_unit)
    place = entry["rsp_node"], entry["rsp_dir"], entry["ref_node"], entry["ref_dir"]
    return _Curve(name, place, unit, x[:count], values[:count])


def _label(entry: Mapping[str, Any], axis: str, missing: str = "") -> str:
    """Unit of an axis, `missing` where it has none."""
    label = plain_unit(str(entry[f"{axis}_axis_units_lab"]))
    return missing if label.upper() in ("", "NONE") else label


def _of_one_place(axis: str, curves: list[_Curve], facts: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    """Directions and columns of curves of one node; those that name an output of ours are taken by its name."""
    output = facts.get("output", OUTPUT)
    named = [curve for curve in curves if curve.name in (f"{output} over force, harmonic 1", f"{output}, harmonic 1")]
    curves = named or [curve for curve in curves if facts.get("node", str(curve.place[0])) == str(curve.place[0])]
    for key, at in (("direction", 1), ("force_direction", 3)):
        curves = [curve for curve in curves if _axis(curve.place[at]) == facts.get(key)] or curves
    places = sorted({(*curve.place, curve.unit) for curve in curves})
    if len(places) != 1:
        nodes = ", ".join(sorted({str(place[0]) for place in places})) or "no such"
        cure = "give node = NUMBER, and direction and force_direction where it has several"
        raise Refusal(f"it has {len(places)} measured places, of {nodes} node: {cure}")
    directions = {"direction": _axis(places[0][1]), "force_direction": _axis(places[0][3])}
    sizes = [len(curve.x) for curve in curves]
    table: dict[str, Any] = {
        axis: np.concatenate([curve.x for curve in curves]),
        "run": np.repeat([curve.name for curve in curves], sizes),
        "repeat": np.repeat(np.arange(len(curves)), sizes),
        f"response [{curves[0].unit}]": np.concatenate([curve.values for curve in curves]),
    }
    return {name: axis for name, axis in directions.items() if axis}, table


def _axis(number: int) -> str:
    """Direction by its number, "" for none."""
    return ("-" if number < 0 else "") + " xyz"[abs(number)].strip() if abs(number) <= 3 else f"about {number}"


def _modes(modes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Natural frequencies and damping of modes, real or complex, one in each set."""
    eig = [s["eig"] if s["analysis_type"] == 3 else 2j * np.pi * s["freq"] for s in modes]
    damping = [
        -e.real / (abs(e) or 1) if s["analysis_type"] == 3 else s["modal_damp_vis"] + s["modal_damp_his"] / 2
        for s, e in zip(modes, eig, strict=True)
    ]
    return {"frequency [Hz]": np.abs(eig) / (2 * np.pi), "damping": np.array(damping)}
