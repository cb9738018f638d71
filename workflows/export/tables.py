"""Every curve of a result as tables of named columns, each name with its unit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tribodyn.workflows.result.result import Result

Table = Mapping[str, np.ndarray]
"""column name -> (n,) values; the name ends with the unit, as in "frequency_Hz"."""


def tables(result: Result) -> dict[str, Table]:
    """The tables that a result has data for, by name; columns of a table have one length."""
    found: dict[str, Table] = {}
    if result.response is not None:
        found["response"] = response(result)
    if result.references is not None:
        r = result.references
        found["references"] = {"frequency_Hz": r.omega / (2 * np.pi), "free_m": r.free, "stuck_m": r.stuck}
    if result.stability is not None:
        s = result.stability
        found["bifurcations"] = {
            "frequency_Hz": s.omega / (2 * np.pi),
            "position": s.position,
            "kind": np.array(s.kinds, dtype=str),
        }
    found["pairs"] = pairs(result)
    if result.wear is not None and len(result.wear.cycles):
        found["wear"] = wear(result)
        found["wear_of_pairs"] = wear_of_pairs(result)
    if result.worn is not None:
        count = result.worn.omega.shape[1]
        flat = {
            "row": np.repeat(result.worn.row, count),
            "frequency_Hz": result.worn.omega.ravel() / (2 * np.pi),
            "amplitude_m": result.worn.amplitude.ravel(),
        }
        there = np.isfinite(flat["frequency_Hz"])
        found["worn_responses"] = {name: column[there] for name, column in flat.items()}
    if result.loops is not None:
        found["loops"] = loops(result)
    return found


def response(result: Result) -> Table:
    """The response curve point by point: amplitude and Fourier coefficients of every output."""
    frf = result.response
    assert frf is not None
    columns: dict[str, np.ndarray] = {"frequency_Hz": frf.frequency}
    if frf.parameter_name != "frequency":
        columns[frf.parameter_name.replace(" ", "_")] = frf.parameter
    for position, name in enumerate(frf.output_names):
        columns[f"{name}_amplitude_m"] = frf.amplitude(name)
        for k, term in enumerate(terms(result.harmonics)):
            columns[f"{name}_{term}_m"] = frf.response[:, position, k]
    columns |= {"load_factor": frf.load_factor}
    if result.driving_force is not None:
        columns |= {"force_N": abs(result.driving_force) * frf.load_factor}
        for name in frf.output_names if 1 in result.harmonics else ():
            columns[f"{name}_phase_rad"] = np.angle(frf.fundamental(name) / result.driving_force)
    columns |= {"energy_J": frf.energy, "newton_steps": frf.newton_steps, "converged": frf.converged}
    if result.stability is not None:
        columns |= {"stable": result.stability.stable, "growth_1_per_s": result.stability.growth}
    if result.bounds is not None:
        columns |= {
            "amplitude_low_m": result.bounds.amplitude_low,
            "amplitude_high_m": result.bounds.amplitude_high,
            "energy_low_J": result.bounds.energy_low,
            "energy_high_J": result.bounds.energy_high,
        }
    return columns


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


def wear(result: Result) -> Table:
    """The wear history row by row, each row the state that a wear step starts from."""
    history, patch = result.wear, result.patch
    assert history is not None
    columns = {
        "row": np.arange(len(history.cycles)),
        "cycles": history.cycles,
        "cycles_in_step": history.cycles_in_step,
        "frequency_Hz": history.omega / (2 * np.pi),
        "amplitude_m": history.amplitude,
        "preload_N": history.preload,
        "energy_per_cycle_J": history.energy.sum(axis=1),
        "friction_work_in_step_J": history.work.sum(axis=1),
        "depth_largest_m": history.depth.max(axis=1),
        "depth_mean_m": history.depth @ patch.area / patch.area.sum(),
        "depth_smallest_m": history.depth.min(axis=1),
        "volume_m3": history.depth @ patch.area,
        "solves": history.solves,
        "step_error": history.step_error,
    }
    names = [] if result.response is None else list(result.response.output_names)
    for position, name in enumerate(names[: history.response.shape[1]]):
        for k, term in enumerate(terms(result.harmonics)):
            columns[f"{name}_{term}_m"] = history.response[:, position, k]
    return columns


def wear_of_pairs(result: Result) -> Table:
    """The wear history pair by pair, one line for each row and pair."""
    history, patch = result.wear, result.patch
    assert history is not None
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


def loops(result: Result) -> Table:
    """Hysteresis loops, one line for each kept state, pair, component and instant."""
    kept, patch = result.loops, result.patch
    assert kept is not None
    shape = kept.displacement.shape
    at, pair, component, sample = (index.ravel() for index in np.indices(shape))
    return {
        "row": kept.row[at],
        "pair": pair,
        "component": np.array(patch.components, dtype=str)[component],
        "phase_rad": 2 * np.pi * sample / shape[-1],
        "displacement_m": kept.displacement.ravel(),
        "force_N": kept.force.ravel(),
    }
