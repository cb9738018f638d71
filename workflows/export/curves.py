"""Curves as files: CSV, MATLAB and universal files (dataset 58)."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.workflows.export.tables import tables, terms
from tribodyn.workflows.result import verdict
from tribodyn.workflows.result.readable import write_columns
from tribodyn.workflows.result.result import Result


class Function(IntEnum):
    """Function types of dataset 58."""

    GENERAL, TIME, FRF = 0, 1, 4


class DataKind(IntEnum):
    """Kinds of data of datasets 58 and 55."""

    PLAIN, DISPLACEMENT, FORCE, VELOCITY, ACCELERATION, EXCITATION, TIME, FREQUENCY = 1, 8, 9, 11, 12, 13, 17, 18


def write_csv(result: Result, folder: Path) -> list[Path]:
    """One file for each table, numbers with all their digits."""
    written = []
    for name, table in tables(result).items():
        path = folder / f"{name}.csv"
        write_columns(table, path)
        written.append(path)
    return written


def write_mat(result: Result, folder: Path) -> list[Path]:
    """result.mat: a struct for each table, and what the result is of."""
    from scipy.io import savemat

    content: dict[str, Any] = {
        name: {key: _plain(column) for key, column in table.items()} for name, table in tables(result).items()
    }
    facts: dict[str, Any] = {key: value for key, value in result.facts.table().items() if len(key) <= 31}
    facts["changes"] = [
        {k: np.nan if v is None else v for k, v in row.items()} for row in verdict.table(result.verdict)
    ]
    content |= {"facts": facts, "provenance": dict(result.provenance), "state": result.state}
    path = folder / "result.mat"
    savemat(path, content, long_field_names=True, oned_as="column")
    return [path]


def _plain(column: np.ndarray) -> np.ndarray:
    return column.astype(object) if column.dtype.kind == "U" else column


def write_uff(result: Result, folder: Path) -> list[Path]:
    """result.uff: complex response of every output and harmonic, histories under wear, loops, as datasets 58.

    Of a displacement a cos(hwt) + b sin(hwt) the complex value a - ib is written, with exp(+ihwt) understood. Where the
    scene is driven by one force in harmonic 1, harmonic 1 is a frequency response function, displacement over force.
    The format has abscissas in single precision.
    Raises  ValueError where pyuff is missing
    """
    pyuff = package("pyuff")
    path = folder / "result.uff"
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    for entry in (_units(), *_spectra(result), *_histories(result), *_loops(result)):
        file.write_sets(entry, "add")
    return [path]


def _units() -> dict[str, Any]:
    factors = {"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 0.0}
    return {"type": 164, "units_code": 1, "units_description": "SI", "temp_mode": 1, **factors}


def _spectra(result: Result) -> list[dict[str, Any]]:
    frf = result.response
    if frf is None:
        return []
    names, force = terms(result.harmonics), result.driving_force
    found = []
    for position, output in enumerate(frf.output_names):
        for h in (h for h in result.harmonics if h):
            a, b = (frf.response[:, position, names.index(f"{letter}{h}")] for letter in "ab")
            value, kind, text = a - 1j * b, Function.GENERAL, f"{output}, harmonic {h}"
            if h == 1 and force is not None:
                value, kind, text = value / (force * frf.load_factor), Function.FRF, f"{output} over force, harmonic 1"
            entry = function(
                kind, text, "frequency", DataKind.FREQUENCY, "Hz", frf.frequency, DataKind.DISPLACEMENT, "m", value
            )
            if kind == Function.FRF:
                entry |= {"orddenom_spec_data_type": DataKind.EXCITATION, "orddenom_axis_lab": "force"}
                entry |= {"orddenom_axis_units_lab": "N"}
            found.append(entry)
    return found


def _histories(result: Result) -> list[dict[str, Any]]:
    table = tables(result).get("wear")
    if table is None:
        return []
    wanted = {name: unit for name, unit in (
        ("frequency_Hz", "Hz"), ("amplitude_m", "m"), ("preload_N", "N"), ("energy_per_cycle_J", "J"),
        ("depth_largest_m", "m"), ("depth_mean_m", "m"), ("volume_m3", "m3"),
    )}  # fmt: skip
    return [
        function(
            Function.GENERAL, name, "cycles", DataKind.PLAIN, "", table["cycles"], DataKind.PLAIN, unit, table[name]
        )
        for name, unit in wanted.items()
    ]


def _loops(result: Result) -> list[dict[str, Any]]:
    """Displacement and force over a period of the pair that moves most, in each kept state and component."""
    kept, patch = result.loops, result.patch
    if kept is None:
        return []
    found = []
    phase = 2 * np.pi * np.arange(kept.force.shape[-1]) / kept.force.shape[-1]
    for at, row in enumerate(kept.row):
        pair = int(np.argmax(np.ptp(kept.displacement[at], axis=-1).max(axis=-1)))
        for c, component in enumerate(patch.components):
            for what, values, kind, unit in (
                ("displacement", kept.displacement, DataKind.DISPLACEMENT, "m"),
                ("force", kept.force, DataKind.FORCE, "N"),
            ):  # fmt: skip
                text = f"state {row}, pair {pair}, {component}, {what}"
                y = values[at, pair, c]
                found.append(function(Function.TIME, text, "phase", DataKind.TIME, "rad", phase, kind, unit, y, pair))
    return found


def function(
    kind: int, text: str, x_name: str, x_kind: int, x_unit: str, x: np.ndarray,
    y_kind: int, y_unit: str, y: np.ndarray, node: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """A dataset 58 in double precision with its own abscissa values."""
    return {
        "type": 58, "binary": 0, "func_type": kind, "id1": text, "id2": "tribodyn", "id3": "", "id4": "", "id5": "",
        "rsp_node": node, "rsp_dir": 0, "ref_node": 0, "ref_dir": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
        "ver_num": 1, "load_case_id": 0, "x": x, "data": y,
        "ord_data_type": 6 if np.iscomplexobj(y) else 4, "abscissa_spacing": 0,
        "num_pts": len(x), "abscissa_min": 0.0, "abscissa_inc": 0.0, "z_axis_value": 0.0,
        "abscissa_spec_data_type": x_kind, "abscissa_axis_lab": x_name, "abscissa_axis_units_lab": x_unit or "NONE",
        "ordinate_spec_data_type": y_kind, "ordinate_axis_lab": text[:20], "ordinate_axis_units_lab": y_unit,
        "orddenom_spec_data_type": 0, "orddenom_axis_lab": "NONE", "orddenom_axis_units_lab": "NONE",
        "z_axis_spec_data_type": 0, "z_axis_axis_lab": "NONE", "z_axis_axis_units_lab": "NONE",
    }  # fmt: skip
