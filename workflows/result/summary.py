"""The numbers of a result as plain data: for `tribodyn show --json`, for machines and for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tribodyn.hbm.continuation.branch import amplitude as vibration
from tribodyn.hbm.continuation.parameter import FREQUENCY
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.wear.history import LIFE_SHARE, cycles_to_preload, cycles_to_share, events, first
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.wear import Place

if TYPE_CHECKING:
    from tribodyn.workflows.result.result import Result

EVENT_SAMPLES = 256  # of a cycle, to see whether a pair opens
LARGEST_BEND = 0.1  # amplitude over the size of the part that a linear model describes


def summary(result: Result) -> dict[str, Any]:
    """The numbers of a result; what was not computed is None.

    depth_max_m, depth_mean_m : largest, and mean over the area of, the total wear depth
    cycles : vibration cycles so far; separated_cycles : the same if the last touch has ended, else None
    first_lift_cycles, first_loss_cycles : until a closed pair first opens in the cycle, until a pair touches no more
    surface_volumes_m3 : worn off the scene's own part or first face, and off the other one
    life_cycles : until the preload had fallen to a share of its first value, None if it has not; see `life`
    energy_J, volume_m3 : friction work and worn volume, accumulated
    wear_steps, hbm_solves : steps taken and balance solves spent on wear
    peak_hz, peak_m, preload_N : [first, last] of the wear run, or the peak of the response curve without one; the peak
        is that of the balance, also where a machine leaves it
    unstable_cycles : share of the cycles worn along an unstable motion of the balance, None where it is not known
    peak_at_end : whether that peak is no peak, but an end of the response curve or a point whose peak was not found
    load_factor : [least, largest] factor on the vibrating loads, where it was found under control, else None; the peak
        is then where it takes least per amplitude
    jumped : whether the response is a sweep that jumped at a fold, so that the curve may have a higher peak
    peak_is_stable : whether that peak of the curve is stable, None where this was not asked for
    stable_peak_hz, stable_peak_m : the highest point of the curve that is
    seconds : of computing, interrupted runs included
    joints : named contact -> pairs, area_m2, and with wear preload_N [first, last], life_cycles until its preload has
        fallen to `wear.lost_below` (LIFE_SHARE where that is 0), None if it has not, depth_max_m, depth_mean_m,
        volume_m3, energy_J of that joint; empty where the scene names none
    verdict : quantity -> value, error, dominated_by, status, reason, stated, see result.verdict.Statement; None without
    changes : what each refinement changed, see result.verdict.Change
    """
    return {name: plain(value) for name, value in numbers(result).items()}


def numbers(result: Result) -> dict[str, Any]:
    """The same as `summary`, with nan and inf where they are."""
    found: dict[str, Any] = {"state": result.state, "finished": result.finished}
    found |= {"seconds": result.facts.seconds, "wear_steps": result.wear_steps}
    found |= _wear(result) | _peak(result) | _stable_peak(result)
    for name in ("full_dofs", "model_dofs", "contact_pairs", "unknowns", "delta_max_m"):
        found[name] = getattr(result.facts, name)
    found |= _curve(result)
    found["joints"] = by_joint(result)
    found |= {"free_hz": result.facts.free_hz.tolist(), "stuck_hz": result.facts.stuck_hz.tolist()}
    verdict = result.verdict
    statements = {} if verdict is None else verdict.statements
    found["verdict"] = {name: asdict(s) | {"stated": s.stated} for name, s in statements.items()} or None
    found["changes"] = [] if verdict is None else [asdict(change) for change in verdict.changes]
    return found


def size_of(result: Result) -> float:
    """Diagonal of the box round the part [m], infinite without a mesh."""
    return float("inf") if result.part is None else float(np.linalg.norm(np.ptp(result.part.points, axis=0)))


def by_joint(result: Result) -> dict[str, dict[str, Any]]:
    """What each named contact carries and loses; see `summary`."""
    patch, wear = result.patch, result.wear
    found: dict[str, dict[str, Any]] = {}
    for name, pairs in result.facts.joints.items():
        area = patch.area[pairs]
        found[name] = {"pairs": len(area), "area_m2": float(area.sum())}
        if wear is None or not len(wear.cycles) or not len(area):
            continue
        depth = result.depth_after(-1)[pairs]
        found[name] |= {
            "preload_N": [float(wear.normal_force[row, pairs].sum()) for row in (0, -1)],
            "life_cycles": cycles_to_share(wear.cycles, wear.normal_force[:, pairs].sum(axis=1), _life_share(result)),
            "depth_max_m": float(depth.max()),
            "depth_mean_m": float(depth @ area / area.sum()),
            "volume_m3": float(depth @ area),
            "energy_J": float(wear.work[:, pairs].sum()),
        }
    return found


def life(result: Result) -> float | None:
    """Cycles until the preload had fallen as `life_ends` says; with `wear.lost_of` "any" that of the first joint."""
    if result.wear is None:
        return None
    if not _ends_with_any_joint(result):
        return cycles_to_preload(result.wear, life_ends(result)[0])
    return min(_lives(result).values(), default=None)


def first_lost(result: Result) -> str | None:
    """The joint whose life is that of a run with `wear.lost_of` "any"; None where none has ended, or all count."""
    if result.wear is None or not _ends_with_any_joint(result):
        return None
    lives = _lives(result)
    return min(lives, key=lives.__getitem__, default=None)


def _ends_with_any_joint(result: Result) -> bool:
    return result.scene.wear is not None and result.scene.wear.lost_of == "any"


def _lives(result: Result) -> dict[str, float]:
    """Cycles of the joints that have lost their preload."""
    lives = {name: joint.get("life_cycles") for name, joint in by_joint(result).items()}
    return {name: life for name, life in lives.items() if life is not None}


def order_of_line(result: Result) -> int | None:
    """Engine order of an operating line, along which the frequency is that many times the speed; None for no line."""
    wheel = result.scene.wheel if isinstance(result.scene, MeshScene) else None
    return abs(wheel.engine_order) if wheel is not None and wheel.along_speed else None


def worn_at_peak(result: Result) -> bool:
    """Whether a result wears at a peak, not at a frequency that its scene gives."""
    wear = result.scene.wear
    return wear is None or not isinstance(wear.at, Place) or wear.at.frequency is None


def _life_share(result: Result) -> float:
    """Share of the first preload where a life ends: the scene's `wear.lost_below`, else LIFE_SHARE."""
    wear = result.scene.wear
    return (wear.lost_below if wear is not None else 0.0) or LIFE_SHARE


def life_ends(result: Result) -> tuple[float, str]:
    """Share of the first preload where the life of a whole contact ends, and which preload that is."""
    at_rest = result.scene.wear is not None and result.scene.wear.end_at == "at_rest"
    return _life_share(result), "preload at rest" if at_rest else "preload"


def _wear(result: Result) -> dict[str, Any]:
    names = [
        "depth_max_m", "depth_mean_m", "cycles", "separated_cycles", "life_cycles", "unstable_cycles",
        "first_lift_cycles", "first_loss_cycles", "energy_J", "volume_m3", "surface_volumes_m3", "hbm_solves",
    ]  # fmt: skip
    wear, patch = result.wear, result.patch
    if wear is None or not len(wear.cycles):
        return dict.fromkeys(names)
    depth, cycles = result.depth_after(-1), float(wear.cycles[-1] + wear.cycles_in_step[-1])
    volume, split = float(depth @ patch.area), result.facts.share_of_body_1
    basis = HarmonicBasis(result.harmonics, max(EVENT_SAMPLES, 2 * result.harmonics[-1] + 1))
    lifts, lost = events(wear, patch.components, patch.gap, basis)
    return {
        "first_lift_cycles": first(lifts),
        "first_loss_cycles": first(lost),
        "surface_volumes_m3": [split * volume, (1 - split) * volume],
        "depth_max_m": float(depth.max()),
        "depth_mean_m": float(depth @ patch.area / patch.area.sum()),
        "cycles": cycles,
        "separated_cycles": cycles if result.contact_lost else None,
        "life_cycles": life(result),
        "energy_J": float(wear.work.sum()),
        "volume_m3": volume,
        "hbm_solves": int(wear.solves.sum()),
        "unstable_cycles": wear.unstable_share,
        "wear_end": str(wear.end),
    }


def _peak(result: Result) -> dict[str, Any]:
    wear, frf = result.wear, result.response
    if wear is not None and len(wear.omega):
        ends = [0, -1]
        return {
            "peak_hz": [float(w) for w in wear.omega[ends] / (2 * np.pi)],
            "peak_m": [
                float(vibration(wear.response[row, 0]) if wear.in_time[row] else wear.amplitude[row]) for row in ends
            ],
            "preload_N": [float(n) for n in wear.preload[ends]],
            "peak_at_end": None,
        }
    if frf is not None:
        amplitude = frf.amplitude(frf.output_names[0])
        best = int(np.argmax(frf.height(frf.output_names[0])))
        hertz, height = float(frf.frequency[best]), float(amplitude[best])
        at_end = frf.peak(frf.output_names[0]) is None if frf.parameter_name == FREQUENCY else None
        return {"peak_hz": [hertz, hertz], "peak_m": [height, height], "preload_N": None, "peak_at_end": at_end}
    return dict.fromkeys(("peak_hz", "peak_m", "preload_N", "peak_at_end"))


def _stable_peak(result: Result) -> dict[str, Any]:
    """An unstable motion is a solution of the balance that no vibration remains at, however high it is."""
    frf, marks = result.response, result.stability
    if frf is None or marks is None:
        return dict.fromkeys(("peak_is_stable", "stable_peak_hz", "stable_peak_m"))
    height = np.where(frf.converged, frf.amplitude(frf.output_names[0]), -1.0)
    stable = np.where(marks.stable, height, -1.0)
    best, found = int(np.argmax(stable)), bool(stable.max() >= 0)
    return {
        "peak_is_stable": bool(marks.stable[np.argmax(height)]),
        "stable_peak_hz": float(frf.frequency[best]) if found else None,
        "stable_peak_m": float(height[best]) if found else None,
    }


def _curve(result: Result) -> dict[str, Any]:
    frf = result.response
    numbers: dict[str, Any] = {
        "harmonics": list(result.harmonics),
        "harmonics_error": result.facts.harmonics_error,
        "response_end": None if frf is None else str(frf.end),
        "jumped": None if frf is None else frf.ended is BranchEnd.JUMPED,
        "load_factor": None if frf is None or not frf.controlled else _ends(frf.load_factor[frf.converged]),
        "folds_hz": [] if frf is None else [float(frf.frequency[i]) for i in frf.folds],
        "unstable_points": None,
        "bifurcations": None,
        "shear_spread": None,
        "shear_spread_at_peak": None,
    }
    if frf is None:
        return numbers
    good = frf.converged
    if result.stability is not None:
        where = zip(result.stability.omega / (2 * np.pi), result.stability.kinds, strict=True)
        numbers["unstable_points"] = int(np.sum(good & ~result.stability.stable))
        numbers["bifurcations"] = [{"hz": float(hertz), "kind": kind} for hertz, kind in where]
    if result.bounds is not None and good.any():
        best = int(np.argmax(np.where(good, frf.amplitude(frf.output_names[0]), -1.0)))
        numbers["shear_spread"] = float(np.nanmax(result.bounds.spread))
        numbers["shear_spread_at_peak"] = float(result.bounds.spread[best])
    return numbers


def _ends(values: np.ndarray) -> list[float]:
    return [float(values.min()), float(values.max())]


def plain(value: Any) -> Any:
    """A value as JSON has it: nan and inf become None."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
