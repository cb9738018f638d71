"""The resonance peak of a scene, or a fold of its response, followed while a second number changes.

The peak is found by a scan of the response range once, then each value starts from its neighbour's; a fold is found by
arc length once, then followed along its own line (hbm.continuation.folds), round the cusps where two folds meet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.folds import FoldOptions, track_fold
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.outcome import BranchEnd, Outcome
from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.plots import axes_of, length_unit
from tribodyn.workflows.pictures.style import BLUE, ORANGE
from tribodyn.workflows.result import store
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

UNITS = {"load": "", "gap": "m", "stiffness": "", "friction": "", "wear": ""}  # what may change, and its unit

LIMIT = 1e-6  # distance, relative, from an end of the response range that is none


@dataclass(frozen=True)
class Track:
    """A line of peaks or folds.

    what : "peak" or "fold"; name, unit : of the number that changes; value : (n,) of it
    frequency : (n,) [Hz]; amplitude : (n,) of the response [m]; cusps : indices of points where a line of folds turns
    end : why and where it ends; its text is a sentence
    """

    what: str
    name: str
    unit: str
    value: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    cusps: tuple[int, ...]
    end: Outcome[BranchEnd]

    def record(self) -> dict[str, Any]:
        """For machines."""
        return {
            "what": self.what,
            "against": self.name,
            "value": self.value.tolist(),
            "frequency_hz": self.frequency.tolist(),
            "amplitude_m": self.amplitude.tolist(),
            "cusps": list(self.cusps),
            "end": str(self.end),
        }


def follow(
    file: SceneFile,
    against: str,
    start: float,
    stop: float,
    fold: int | None,
    points: int,
    worn: Path | None,
    progress: Progress,
) -> Track:
    """The peak, or the fold of this number (from 1, in the order of falling frequency), from one value to another.

    against : a key of UNITS; points : values of the peak, or the most that a line of folds may have
    worn : folder of a result whose last depth is one of "wear"
    Raises  ValueError for what cannot be; SolveFailed where not even the first point is found
    """
    if start == stop:
        raise ValueError("--from and --to are the same: give two values to go from and to")
    if points < 2:
        raise ValueError(f"--points: a line needs at least 2, not {points}")
    if (against == "wear") != (worn is not None):
        raise ValueError('--worn: give the folder of a worn result with --against "wear", and only there')
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, None, progress).balance
        path = _path(balance, against, _depth(worn, balance))
        if fold is None:
            with progress.track("peaks") as advance:
                return _peaks(file, path, start, stop, points, lambda done: advance(done / points, ""))
        with progress.stage("fold"):
            return _fold(file, path, start, stop, fold, points)


def _path(balance: HarmonicBalance, against: str, depth: np.ndarray | None) -> Parameter:
    omega = balance.omega_max
    if depth is not None:
        return parameter.wear(balance, omega, depth)
    made: Parameter = getattr(parameter, against)(balance, omega)
    return made


def _depth(worn: Path | None, balance: HarmonicBalance) -> np.ndarray | None:
    """(n_pair,) depth [m] at the end of a result, None without one."""
    if worn is None:
        return None
    wear = store.load(worn / "result.h5").wear
    if wear is None or wear.depth.shape[1] != balance.contact.n_pair:
        raise ValueError(f"--worn: {worn} holds no worn contact of this scene's {balance.contact.n_pair} node pairs")
    return wear.depth[-1]


def _peaks(
    file: SceneFile, path: Parameter, start: float, stop: float, points: int, on_point: Callable[[int], None]
) -> Track:
    site = settings.peak_of(file.scene)
    found: list[tuple[float, OperatingPoint]] = []
    end = BranchEnd.REACHED.say(f" {path.say(stop)}")
    for done, value in enumerate(np.linspace(start, stop, points), start=1):
        balance = path.make(value)
        if found:
            last = found[-1][1]
            point = site.next(balance, last.state.omega, last.state.x)
        if not found or not point.solution.converged:  # the peak has left its branch: looked for afresh
            point = site.first(balance)
        if not point.solution.converged:
            end = BranchEnd.ENDED.say(f" {path.say(value)}: {point.solution.outcome}")
            break
        found.append((value, point))
        on_point(done)
    if not found:
        raise SolveFailed(f"the peak {end}")
    rows = [(value, point.state.omega / (2 * np.pi), point.amplitude) for value, point in found]
    values, frequency, amplitude = np.array(rows).T
    at_limit = np.flatnonzero(np.min(np.abs(frequency[:, None] / file.scene.response.frequency - 1), axis=1) < LIMIT)
    if len(at_limit):
        where = path.say(values[at_limit[0]])
        beyond = f"; from {where} on some are no peaks but ends of response.frequency: widen it"
        end = end.kind.say(end.detail + beyond)
    return Track("peak", path.name, path.unit, values, frequency, amplitude, (), end)


def _fold(file: SceneFile, path: Parameter, start: float, stop: float, number: int, points: int) -> Track:
    low, high = settings.response_range(file.scene)
    newton = settings.newton_options(file.scene)
    branch = arc_length.follow(path.make(start), high, low, arc_length.Options(newton=newton))
    if not 1 <= number <= len(branch.folds):
        raise ValueError(
            f"--fold: there are {len(branch.folds)} folds at {path.say(start)}, not {number}; the response {branch.end}"
        )
    at = sorted(branch.folds, key=lambda i: -branch.omega[i])[number - 1]
    balance = path.make(start)
    x = branch.contact[at].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    line = track_fold(path, start, stop, branch.omega[at], x, FoldOptions(max_points=points, newton=newton))
    amplitude = line.amplitude(settings.OUTPUT)
    frequency = line.omega / (2 * np.pi)
    return Track("fold", path.name, path.unit, line.parameter, frequency, amplitude, line.cusps, line.end)


def write(track: Track, path: Path) -> None:
    """The line as comma-separated values."""
    write_columns({"value": track.value, "frequency_hz": track.frequency, "amplitude_m": track.amplitude}, path)


def picture(track: Track) -> Figure:
    """Frequency and amplitude against what changes."""
    unit, scale = length_unit(track.amplitude.max())
    with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
        upper.plot(track.value, track.frequency, ".-", color=BLUE, ms=4)
        upper.set(ylabel=f"frequency of the {track.what} / Hz", title=f"{track.what.capitalize()} against {track.name}")
        lower.plot(track.value, scale * track.amplitude, ".-", color=ORANGE, ms=4)
        lower.set(xlabel=f"{track.name} / {track.unit}" if track.unit else track.name, ylabel=f"amplitude / {unit}")
    return figure
