"""Every curve of a result as a table of named columns, and as files: CSV, MATLAB, universal files (dataset 58)."""

from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.hbm.continuation.branch import Branch, unit_of
from tribodyn.hbm.quantity import StatedQuantity
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.result.answers import histories_of
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.result.result import Loops, Patch, Result

Table = Mapping[str, np.ndarray]
"""column name -> (n,) values; the name ends with the unit, as in "frequency_Hz"."""


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
    changes = () if result.verdict is None else result.verdict.changes
    facts["changes"] = [{k: np.nan if v is None else v for k, v in vars(change).items()} for change in changes]
    content |= {"facts": facts, "provenance": dict(result.provenance), "state": result.state}
    path = folder / "result.mat"
    savemat(path, content, long_field_names=True, oned_as="column")
    return [path]


def _plain(column: np.ndarray) -> np.ndarray:
    return column.astype(object) if column.dtype.kind == "U" else column


def write_uff(result: Result, folder: Path) -> list[Path]:
    """result.uff: complex response of every output and harmonic, as datasets 58.

    Of a displacement a cos(hwt) + b sin(hwt) the complex value a - ib is written, with exp(+ihwt) understood. Where the
    scene is driven by one force in harmonic 1, harmonic 1 is a frequency response function, displacement over force.
    The format has abscissas in single precision.
    Raises  ValueError where pyuff is missing"""
    pyuff = package("pyuff")
    path = folder / "result.uff"
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    units = {"type": 164, "units_code": 1, "units_description": "SI", "length": 1.0, "force": 1.0, "temp": 1.0}
    for entry in (units | {"temp_offset": 0.0}, *_spectra(result)):
        file.write_sets(entry, "add")
    return [path]


def _spectra(result: Result) -> list[dict[str, Any]]:
    frf = result.response
    if frf is None:
        return []
    names, force = terms(result.harmonics), result.driving_force
    datasets = []
    for position, output in enumerate(frf.output_names):
        for h in (h for h in result.harmonics if h):
            a, b = (frf.response[:, position, names.index(f"{letter}{h}")] for letter in "ab")
            value, kind, text = a - 1j * b, Function.GENERAL, f"{output}, harmonic {h}"
            if h == 1 and force is not None:
                value, kind, text = value / force, Function.FRF, f"{output} over force, harmonic 1"
            entry = function(
                kind, text, "frequency", DataKind.FREQUENCY, "Hz", frf.frequency, DataKind.DISPLACEMENT, "m", value
            )
            if kind == Function.FRF:
                entry |= {"orddenom_spec_data_type": DataKind.EXCITATION, "orddenom_axis_lab": "force"}
                entry |= {"orddenom_axis_units_lab": "N"}
            datasets.append(entry)
    return datasets


def function(
    kind: int, text: str, x_name: str, x_kind: int, x_unit: str, x: np.ndarray,
    y_kind: int, y_unit: str, y: np.ndarray, node: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """A dataset 58 in double precision with its own abscissa values."""
    return {
        "type": 58, "func_type": kind, "id1": text, "id2": "tribodyn", "ver_num": 1, "x": x, "data": y,
        "rsp_node": node, "rsp_dir": 0, "ref_node": 0, "ref_dir": 0, "orddenom_spec_data_type": 0,
        "abscissa_spec_data_type": x_kind, "abscissa_axis_lab": x_name, "abscissa_axis_units_lab": x_unit or "NONE",
        "ordinate_spec_data_type": y_kind, "ordinate_axis_lab": text[:20], "ordinate_axis_units_lab": y_unit,
    }  # fmt: skip


def tables(result: Result) -> dict[str, Table]:
    """The tables that a result has data for, by name; columns of a table have one length."""
    tables_by_name: dict[str, Table] = {}
    if result.response is not None:
        tables_by_name["response"] = response(result, result.response)
    if result.references is not None:
        r = result.references
        tables_by_name["references"] = {"frequency_Hz": r.omega / (2 * np.pi), "free_m": r.free, "stuck_m": r.stuck}
    if result.stability is not None:
        s = result.stability
        tables_by_name["bifurcations"] = {
            "frequency_Hz": s.omega / (2 * np.pi),
            "position": s.position,
            "kind": np.array(s.kinds, dtype=str),
        }
    tables_by_name["pairs"] = pairs(result)
    if result.wear is not None and len(result.wear.cycles):
        tables_by_name["wear"] = wear(result, result.wear)
        tables_by_name["wear_of_pairs"] = wear_of_pairs(result.wear, result.patch)
    if result.loops is not None:
        tables_by_name["loops"] = loops(result.loops, result.patch)
    return tables_by_name


def response(result: Result, frf: Branch) -> Table:
    """The response curve point by point: amplitude and Fourier coefficients of every output."""
    columns: dict[str, np.ndarray] = {"frequency_Hz": frf.frequency}
    if frf.parameter_name != "frequency":
        columns[frf.parameter_name.replace(" ", "_")] = frf.parameter
    for position, name in enumerate(frf.output_names):
        unit = unit_of(name) or "1"
        columns[f"{name}_amplitude_{unit}"] = frf.amplitude(name)
        for k, term in enumerate(terms(result.harmonics)):
            columns[f"{name}_{term}_{unit}"] = frf.response[:, position, k]
    if result.driving_force is not None:
        columns |= {"force_N": np.full(len(frf.omega), abs(result.driving_force))}
        for name in frf.output_names if 1 in result.harmonics else ():
            columns[f"{name}_phase_rad"] = np.angle(frf.fundamental(name) / result.driving_force)
    columns |= {"energy_J": frf.energy, "newton_steps": frf.newton_steps, "converged": frf.converged}
    if result.stability is not None:
        columns |= {"stable": result.stability.stable, "growth_1_per_s": result.stability.growth}
    return columns


def header(quantity: StatedQuantity) -> str:
    """The column of a quantity: its name and unit."""
    return f"{quantity.name}_{quantity.unit}" if quantity.unit else quantity.name


def terms(harmonics: tuple[int, ...]) -> list[str]:
    """Names of the Fourier coefficients in the order of the last axis: a0, a1, b1, a2, ..."""
    return [name for h in harmonics for name in ((f"a{h}",) if h == 0 else (f"a{h}", f"b{h}"))]


def pairs(result: Result) -> Table:
    """The contact pairs: where they are, their area, gap and normal."""
    patch = result.patch
    columns = {"pair": np.arange(len(patch.area)), "node": patch.nodes}
    for axis, name in enumerate("xyz"):
        columns[f"{name}_m"] = patch.points[:, axis]
    for axis, name in enumerate("xyz"):
        columns[f"normal_{name}"] = patch.frames[:, 2, axis]
    return columns | {"area_m2": patch.area, "gap_m": patch.gap, "free_deflection_m": patch.free_deflection}


def wear(result: Result, history: WearHistory) -> Table:
    """The wear history row by row, each row the state that a wear step starts from."""
    columns = {
        "row": np.arange(len(history.cycles)),
        "cycles": history.cycles,
        "cycles_in_step": history.cycles_in_step,
        **{header(quantity): values for quantity, values in histories_of(result).items()},
        "friction_work_in_step_J": history.work.sum(axis=1),
        "smallest_depth_m": history.depth.min(axis=1),
        "solves": history.solves,
        "step_error": history.step_error,
    }
    names = [] if result.response is None else list(result.response.output_names)
    for position, name in enumerate(names[: history.response.shape[1]]):
        for k, term in enumerate(terms(result.harmonics)):
            columns[f"{name}_{term}_{unit_of(name) or '1'}"] = history.response[:, position, k]
    return columns


def wear_of_pairs(history: WearHistory, patch: Patch) -> Table:
    """The wear history pair by pair, one line for each row and pair."""
    n_row, n_pair = history.depth.shape
    return {
        "row": np.repeat(np.arange(n_row), n_pair),
        "cycles": np.repeat(history.cycles, n_pair),
        "pair": np.tile(np.arange(n_pair), n_row),
        "depth_m": history.depth.ravel(),
        "worn_in_step_m": history.worn.ravel(),
        "energy_per_cycle_J": history.energy.ravel(),
        "normal_force_N": history.normal_force.ravel(),
        "pressure_Pa": (history.normal_force / patch.area).ravel(),
        "status": history.status.ravel(),
    }


def loops(stored: Loops, patch: Patch) -> Table:
    """Hysteresis loops, one line for each kept state, pair, component and instant."""
    shape = stored.displacement.shape
    at, pair, component, sample = (index.ravel() for index in np.indices(shape))
    return {
        "row": stored.row[at],
        "pair": pair,
        "component": np.array(patch.components, dtype=str)[component],
        "phase_rad": 2 * np.pi * sample / shape[-1],
        "displacement_m": stored.displacement.ravel(),
        "force_N": stored.force.ravel(),
    }
