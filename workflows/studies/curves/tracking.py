"""The resonance peak of a scene, or a fold of its response, followed while a second number changes.

The peak is found by a scan of the response range once, then each value starts from its neighbour's; a fold is found by
arc length once, then followed along its own line (hbm.continuation.fold_curve), round the cusps where two folds meet.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.fold_curve import FoldOptions, track_fold
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.outcome import BranchEnd, Outcome
from tribodyn.hbm.threads import limited
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.theme import BLUE, ORANGE
from tribodyn.workflows.result import store
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.source import AnyPath, Overrides, Source, read_scene
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

LIMIT = 1e-6  # distance, relative, from an end of the response range that is none


@dataclass(frozen=True, repr=False)
class Track(StudyResult):
    """A line of peaks or folds.

    kind : "peak" or "fold"; name, unit : of the number that changes; value : (n,) of it
    frequency : (n,) [Hz]; amplitude : (n,) of the response [m]; cusps : indices of points where a line of folds turns
    end : why and where it ends; its text is a sentence"""

    kind: str
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
            "kind": self.kind,
            "against": self.name,
            "value": self.value.tolist(),
            "frequency_hz": self.frequency.tolist(),
            "amplitude_m": self.amplitude.tolist(),
            "cusps": list(self.cusps),
            "end": str(self.end),
        }

    def lines(self) -> list[str]:
        """For people."""
        rows = zip(self.value, self.frequency, self.amplitude, strict=True)
        texts = [f"{self.name} {f'{v:.6g} {self.unit}':14} {f:12.6g} Hz {height:12.6g} m" for v, f, height in rows]
        return [*texts, f"{self.kind}: {self.end}"]

    def write(self, folder: Path) -> list[Path]:
        """Write track.csv and track.png."""
        columns = {"value": self.value, "frequency_hz": self.frequency, "amplitude_m": self.amplitude}
        return write_files(folder, {"track": columns}, {"track": self.plot()})

    def plot(self) -> Figure:
        """Frequency and amplitude against what changes."""
        unit, scale = length_unit(self.amplitude.max())
        with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
            upper.plot(self.value, self.frequency, ".-", color=BLUE, ms=4)
            title = f"{self.kind.capitalize()} against {self.name}"
            upper.set(ylabel=f"frequency of the {self.kind} / Hz", title=title)
            lower.plot(self.value, scale * self.amplitude, ".-", color=ORANGE, ms=4)
            lower.set(xlabel=f"{self.name} / {self.unit}" if self.unit else self.name, ylabel=f"amplitude / {unit}")
        return figure


def track(
    scene: Source,
    against: Literal["load", "gap", "stiffness", "friction", "wear"],
    start: float | str,
    stop: float | str,
    *,
    fold: int | None = None,
    points: int | None = None,
    worn: AnyPath | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> Track:
    """Follow the resonance peak, or a fold of the response, while load, gap, stiffness, friction or wear changes.

    scene : name of a scene or a .toml file
    against : what changes: a factor on the harmonic loads, an opening added to every gap, a factor on the contact
        springs or on the friction coefficients, or the share of the depth of a worn result
    start : value to begin at, such as 1 or, for the gap, 0um
    stop : value to end at
    fold : number of the fold to follow, 1 for that of the highest frequency; the peak by default
    points : values of the peak (21), or the most that a line of folds may have (500)
    worn : folder of the result whose last depth is a wear of one
    Raises  Refusal for what cannot be; SolveFailed where not even the first point is found"""
    ends = [_end(option, value, against) for option, value in (("--from", start), ("--to", stop))]
    if ends[0] == ends[1]:
        raise Refusal("--from and --to are the same: give two values to go from and to")
    count = points if points is not None else (21 if fold is None else 500)
    if count < 2:
        raise Refusal(f"--points: a line needs at least 2, not {count}")
    if (against == "wear") != (worn is not None):
        raise Refusal('--worn: give the folder of a worn result with --against "wear", and only there')
    file, report = read_scene(scene, overrides), reporter(progress)
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, report).balance
        path = _path(balance, against, None if worn is None else _depth(worn, balance))
        if fold is None:
            with report.track("peaks") as advance:
                return _peaks(file, path, ends[0], ends[1], count, lambda done: advance(done / count, ""))
        with report.stage("fold"):
            return _fold(file, path, ends[0], ends[1], fold, count)


def _end(option: str, value: float | str, against: str) -> float:
    try:
        return to_si(value, "m" if against == "gap" else "")
    except Refusal as error:
        raise Refusal(f"{option}: {error}") from None


def _path(balance: HarmonicBalance, against: str, depth: np.ndarray | None) -> Parameter:
    omega = balance.omega_max
    if depth is not None:
        return parameter.wear(balance, omega, depth)
    problem: Parameter = getattr(parameter, against)(balance, omega)
    return problem


def _depth(worn: AnyPath, balance: HarmonicBalance) -> np.ndarray:
    """(n_pair,) depth [m] at the end of a result."""
    wear = store.load(worn).wear
    if wear is None or wear.depth.shape[1] != balance.contact.n_pair:
        raise Refusal(f"--worn: {worn} holds no worn contact of this scene's {balance.contact.n_pair} node pairs")
    return wear.depth[-1]


def _peaks(
    file: SceneFile, path: Parameter, start: float, stop: float, points: int, on_point: Callable[[int], None]
) -> Track:
    site = settings.peak_of(file.scene)
    peaks: list[tuple[float, OperatingPoint]] = []
    end = BranchEnd.REACHED.say(f" {path.say(stop)}")
    for done, value in enumerate(np.linspace(start, stop, points), start=1):
        balance = path.make(value)
        if peaks:
            last = peaks[-1][1]
            point = site.solve_near(balance, last.state.omega, last.state.x)
        if not peaks or not point.solution.converged:  # the peak has left its branch: looked for afresh
            point = site.solve(balance)
        if not point.solution.converged:
            end = BranchEnd.ENDED.say(f" {path.say(value)}: {point.solution.outcome}")
            break
        peaks.append((value, point))
        on_point(done)
    if not peaks:
        raise SolveFailed(f"the peak {end}")
    rows = [(value, point.state.omega / (2 * np.pi), point.amplitude) for value, point in peaks]
    values, frequency, amplitude = np.array(rows).T
    at_limit = np.flatnonzero(np.min(np.abs(frequency[:, None] / file.scene.response.range - 1), axis=1) < LIMIT)
    if len(at_limit):
        where = path.say(values[at_limit[0]])
        is_outside = f"; from {where} on some are no peaks but ends of response.frequency: widen it"
        end = end.kind.say(end.detail + is_outside)
    return Track("peak", path.name, path.unit, values, frequency, amplitude, (), end)


def _fold(file: SceneFile, path: Parameter, start: float, stop: float, number: int, points: int) -> Track:
    low, high = settings.response_range(file.scene)
    newton = settings.newton_options(file.scene)
    branch = arc_length.follow(path.make(start), high, low, arc_length.Options(newton=newton))
    if not 1 <= number <= len(branch.folds):
        raise Refusal(
            f"--fold: there are {len(branch.folds)} folds at {path.say(start)}, not {number}; the response {branch.end}"
        )
    at = sorted(branch.folds, key=lambda i: -branch.omega[i])[number - 1]
    balance = path.make(start)
    x = balance.shaped(branch.contact[at])
    line = track_fold(path, start, stop, branch.omega[at], x, FoldOptions(max_points=points, newton=newton))
    amplitude = line.amplitude(settings.OUTPUT)
    frequency = line.omega / (2 * np.pi)
    return Track("fold", path.name, path.unit, line.parameter, frequency, amplitude, line.cusps, line.end)
