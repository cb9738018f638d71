"""The backbone of a scene: frequency and damping of one nonlinear mode of the unworn contact against its amplitude."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import nonlinear_modes
from tribodyn.hbm.continuation.nonlinear_modes import Backbone, BackboneOptions
from tribodyn.hbm.threads import limited
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.pictures.figures import axes_of, length_unit, named
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, ORANGE
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Length
from tribodyn.workflows.scene.scene_file import Overrides, SceneFile, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult


@dataclass(frozen=True)
class AmplitudeRange:
    """From which amplitude to which, of which mode.

    start, stop : of the observed displacement [m], or where `modal` of the mass-normalised mode [m kg^0.5]
    mode : its number about the static equilibrium, from 0; points : where the backbone bends little"""

    start: float
    stop: float
    mode: int = 0
    points: int = 40
    modal: bool = False

    @classmethod
    def of(
        cls, file: SceneFile, start: float | None, stop: float | None, mode: int | None, points: int | None
    ) -> AmplitudeRange:
        """What is asked for, else what the scene has in [backbone]; raises Refusal where neither has it."""
        table = file.scene.backbone
        mode = mode if mode is not None else table.mode if table else 0
        points = points if points is not None else table.points if table else 40
        if start is not None and stop is not None:
            return cls(start, stop, mode, points)
        if start is not None or stop is not None or table is None:
            raise Refusal(
                f"--{'to' if start is not None else 'from'} is missing: give both ends of the backbone, "
                "or backbone.modal_amplitude in the scene"
            )
        return cls(*table.modal_amplitude, mode, points, modal=True)


@dataclass(frozen=True, repr=False)
class SceneBackbone(StudyResult):
    """The backbone of a scene.

    mode : its points; published : of the same mode by others, None for none"""

    name: str
    mode: Backbone
    published: PublishedBackbone | None = None

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Numbers of the converged points (n,), SI units."""
        mode = self.mode
        columns = {
            "modal_amplitude": mode.modal_amplitude,
            "frequency_hz": mode.frequency,
            "damping": mode.damping,
            "amplitude_m": mode.amplitude,
            "acceleration_m_s2": mode.acceleration,
            "energy_J": mode.energy,
        }
        return {name: values[mode.converged] for name, values in columns.items()}

    def record(self) -> dict[str, Any]:
        """For machines: the converged points, and what is published."""
        rows = {
            "reference_hz": self.mode.reference_omega / (2 * np.pi),
            **{name: values.tolist() for name, values in self.columns.items()},
            "rows": rows_of(self.columns),
            "end": str(self.mode.end),
        }
        if self.published is not None:
            rows["published"] = differences_from(self.mode, self.published)
        return rows

    def lines(self) -> list[str]:
        hertz, damping = self.mode.frequency, 100 * self.mode.damping
        return named_lines(
            [
                ("at rest", f"{self.mode.reference_omega / (2 * np.pi):.6g} Hz"),
                ("frequency", f"{hertz[0]:.6g} -> {hertz[-1]:.6g} Hz"),
                ("damping", f"{damping[0]:.4g} -> {damping[-1]:.4g} %, largest {damping.max():.4g} %"),
                *self._published_lines(),
                ("end", str(self.mode.end)),
            ]
        )

    def _published_lines(self) -> Iterator[tuple[str, str]]:
        """What is published, at three of its amplitudes, ours after it."""
        rows = [] if self.published is None else differences_from(self.mode, self.published)["rows"]
        for row in (rows[0], rows[len(rows) // 2], rows[-1]) if rows else ():
            yield (
                self.published.source if self.published is not None and row is rows[0] else "",
                f"at {row['modal_amplitude']:.3g} m kg^0.5: {row['frequency_hz']:.5g} Hz ({100 * row['shift']:+.2f} "
                f"%), {100 * row['damping']:.3g} %; here {row['our_frequency_hz']:.5g} Hz "
                f"({100 * row['our_shift']:+.2f} %), {100 * row['our_damping']:.3g} %",
            )

    def write(self, folder: Path) -> list[Path]:
        """Write backbone.csv and backbone.png."""
        return write_files(folder, {"backbone": self.columns}, lambda: {"backbone": self.plot()})

    def plot(self) -> Figure:
        """Frequency and damping ratio against amplitude, what is published beside them."""
        mode, published = self.mode, self.published
        good = mode.converged
        unit, scale = length_unit(mode.amplitude[good].max())
        amplitude = scale * mode.amplitude[good]
        with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
            upper.plot(amplitude, mode.omega[good] / (2 * np.pi), ".-", color=BLUE, ms=4)
            upper.axhline(mode.reference_omega / (2 * np.pi), color=GREY, ls="--", label="at rest")
            if published is not None:
                reached = published.modal_amplitude <= mode.modal_amplitude[good].max()
                of_mode = mode.amplitude[good][0] / mode.modal_amplitude[good][0]
                is_defined = scale * of_mode * published.modal_amplitude[reached]
                kind = {"color": GREY, "marker": "o", "ms": 4, "lw": 1, "mfc": "none", "label": published.source}
                upper.plot(is_defined, published.frequency[reached], **kind)
                lower.plot(is_defined, 100 * published.damping[reached], **kind)
            upper.set(ylabel="frequency / Hz", title=named(self.name, "backbone"))
            upper.legend(loc="best")
            lower.plot(amplitude, 100 * mode.damping[good], ".-", color=ORANGE, ms=4)
            lower.set(xscale="log", yscale="log", ylabel="damping ratio / %")
            lower.set(xlabel=f"amplitude in the mode at rest / {unit}")
        return figure


def backbone(
    scene: Source,
    start: Length | None = None,
    stop: Length | None = None,
    *,
    mode: int | None = None,
    points: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> SceneBackbone:
    """Follow a nonlinear mode: frequency and damping against amplitude; harmonic loads play no part.

    Where NAME.published.toml beside the scene has a table [backbone], what it has stands beside it.

    scene : name of a scene or a .toml file
    start : amplitude of the response to begin at, such as 1um; [backbone] of the scene by default
    stop : amplitude to end at, such as 1mm
    mode : number of the mode about the static equilibrium, from 0; 0 or that of [backbone] by default
    points : points where the backbone bends little; there are more elsewhere. 40 or those of [backbone] by default
    Raises  Refusal for what cannot be; SolveFailed where not even the first point is found"""
    file, report = read_scene(scene, overrides), reporter(progress)
    range_ = AmplitudeRange.of(file, start, stop, mode, points)
    published = published_backbone(file)
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, report).balance
        nonlinear_mode = follow_mode(file, balance, range_, report)
    if not nonlinear_mode.converged.any():
        raise SolveFailed(f"the backbone {nonlinear_mode.end}")
    return SceneBackbone(file.name, nonlinear_mode, published)


def follow_mode(
    file: SceneFile, balance: HarmonicBalance, range_: AmplitudeRange, progress: Progress, output: str = settings.OUTPUT
) -> Backbone:
    """The backbone of a scene whose balance is made already; output : whose motion is the amplitude."""
    with progress.stage("backbone"):
        options = BackboneOptions(range_.points, newton=settings.newton_options(file.scene))
        return nonlinear_modes.backbone(balance, range_.start, range_.stop, range_.mode, output, options, range_.modal)


def differences_from(mode: Backbone, published: PublishedBackbone) -> dict[str, Any]:
    """A published backbone for machines, and ours at those of its amplitudes that ours has reached.

    shift : change of the frequency from the first of these amplitudes on, of that frequency"""
    reached = mode.modal_amplitude[mode.converged]
    inside = (published.modal_amplitude >= reached.min()) & (published.modal_amplitude <= reached.max())
    a = published.modal_amplitude[inside]
    ours, theirs = _at(mode, a), (published.frequency[inside], published.damping[inside])
    columns = {
        "modal_amplitude": a,
        "frequency_hz": theirs[0],
        "damping": theirs[1],
        "our_frequency_hz": ours[0],
        "our_damping": ours[1],
        "shift": theirs[0] / theirs[0][:1] - 1,
        "our_shift": ours[0] / ours[0][:1] - 1,
    }
    return {"source": published.source, "rows": rows_of(columns)}


def _at(interpolated: Backbone, modal_amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and damping ratio between the points of a backbone."""
    good = interpolated.converged
    a, order = np.unique(interpolated.modal_amplitude[good], return_index=True)
    values = (interpolated.frequency[good][order], interpolated.damping[good][order])
    return tuple(PchipInterpolator(np.log(a), v)(np.log(modal_amplitude)) for v in values)


def rows_of(columns: Mapping[str, np.ndarray]) -> list[dict[str, float]]:
    """Columns (n,) as rows for machines."""
    return [dict(zip(columns, map(float, row), strict=True)) for row in np.array([*columns.values()]).T]


@dataclass(frozen=True)
class PublishedBackbone:
    """A backbone of the same mode by others.

    source : who, in a few words; modal_amplitude : (n,) [m kg^0.5], rising; frequency : (n,) [Hz]; damping : (n,) ratio
    """

    source: str
    modal_amplitude: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray


def published_backbone(file: SceneFile) -> PublishedBackbone | None:
    """The table [backbone] beside a scene, None where there is none; raises Refusal for one that is incomplete."""
    path = file.folder / f"{file.name}.published.toml"
    table = scene_file.tables(path, "published").get("backbone") if path.is_file() else None
    if table is None:
        return None
    try:
        columns = [np.array(table[name], float) for name in ("modal_amplitude", "frequency_hz", "damping")]
        source = str(table["source"])
    except (KeyError, TypeError, ValueError) as error:
        raise Refusal(f"{path}: [backbone] needs source, modal_amplitude, frequency_hz, damping") from error
    if len({len(c) for c in columns}) > 1 or len(columns[0]) < 2 or (np.diff(columns[0]) <= 0).any():
        raise Refusal(f"{path}: [backbone] needs columns of one length, modal_amplitude rising")
    return PublishedBackbone(source, *columns)
