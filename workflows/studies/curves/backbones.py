"""The backbone of a scene: frequency and damping of one nonlinear mode of the unworn contact against its amplitude."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone, BackboneOptions, backbone
from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.figures import axes_of, length_unit, named
from tribodyn.workflows.pictures.style import BLUE, GREY, ORANGE
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.published import PublishedBackbone


@dataclass(frozen=True)
class Way:
    """From which amplitude to which, of which mode.

    start, stop : of the observed displacement [m], or where `modal` of the mass-normalised mode [m kg^0.5]
    mode : its number about the static equilibrium, from 0; points : on an easy way
    """

    start: float
    stop: float
    mode: int = 0
    points: int = 40
    modal: bool = False


def way(file: SceneFile, start: float | None, stop: float | None, mode: int | None, points: int | None) -> Way:
    """What is asked for, else what the scene says in [backbone]; raises ValueError where neither says it."""
    said = file.scene.backbone
    mode = mode if mode is not None else said.mode if said else 0
    points = points if points is not None else said.points if said else 40
    if start is not None and stop is not None:
        return Way(start, stop, mode, points)
    if start is not None or stop is not None or said is None:
        raise ValueError(
            f"--{'to' if start is not None else 'from'} is missing: give both ends of the backbone, "
            "or backbone.modal_amplitude in the scene"
        )
    return Way(*said.modal_amplitude, mode, points, modal=True)


def follow(file: SceneFile, asked: Way, progress: Progress) -> Backbone:
    """The backbone of a scene.

    Raises  ValueError for what cannot be; SolveFailed where not even the first point is found
    """
    return follow_with_model(file, asked, progress)[1]


def follow_with_model(file: SceneFile, asked: Way, progress: Progress) -> tuple[modelling.Model, Backbone]:
    """The same with the model that it was followed in, for what the contact does."""
    with limited(file.scene.solver.threads):
        model = modelling.build(file, None, progress)
        found = along(file, model.balance, asked, progress)
    if not found.converged.any():
        raise SolveFailed(f"the backbone {found.end}")
    return model, found


def along(file: SceneFile, balance: HarmonicBalance, asked: Way, progress: Progress) -> Backbone:
    """The backbone of a scene whose balance is made already."""
    with progress.stage("backbone"):
        options = BackboneOptions(asked.points, newton=settings.newton_options(file.scene))
        return backbone(balance, asked.start, asked.stop, asked.mode, settings.OUTPUT, options, asked.modal)


def follow_backbone(file: SceneFile, start: float, stop: float, *, mode: int = 0, points: int = 40) -> Backbone:
    """The backbone of a scene between two amplitudes [m], without telling what goes on, see `follow`."""
    return follow(file, Way(start, stop, mode, points), Progress())


def record(found: Backbone) -> dict[str, Any]:
    """The converged points for machines."""
    good = found.converged
    columns = {
        "modal_amplitude": found.modal_amplitude,
        "frequency_hz": found.frequency,
        "damping": found.damping,
        "amplitude_m": found.amplitude,
        "acceleration_m_s2": found.acceleration,
        "energy_J": found.energy,
    }
    return {
        "reference_hz": found.reference_omega / (2 * np.pi),
        **{name: values[good].tolist() for name, values in columns.items()},
        "rows": [dict(zip(columns, map(float, row), strict=True)) for row in np.array([*columns.values()]).T[good]],
        "end": str(found.end),
    }


def beside(found: Backbone, published: PublishedBackbone) -> dict[str, Any]:
    """A published backbone for machines, and ours at those of its amplitudes that ours has reached.

    shift : change of the frequency from the first of these amplitudes on, of that frequency
    """
    reached = found.modal_amplitude[found.converged]
    inside = (published.modal_amplitude >= reached.min()) & (published.modal_amplitude <= reached.max())
    a = published.modal_amplitude[inside]
    ours, theirs = at(found, a), (published.frequency[inside], published.damping[inside])
    columns = {
        "modal_amplitude": a,
        "frequency_hz": theirs[0],
        "damping": theirs[1],
        "our_frequency_hz": ours[0],
        "our_damping": ours[1],
        "shift": theirs[0] / theirs[0][:1] - 1,
        "our_shift": ours[0] / ours[0][:1] - 1,
    }
    return {"source": published.source, "rows": rows(columns)}


def at(found: Backbone, modal_amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and damping ratio between the points of a backbone."""
    good = found.converged
    a, order = np.unique(found.modal_amplitude[good], return_index=True)
    values = (found.frequency[good][order], found.damping[good][order])
    return tuple(PchipInterpolator(np.log(a), v)(np.log(modal_amplitude)) for v in values)


def rows(columns: dict[str, np.ndarray]) -> list[dict[str, float]]:
    """Columns (n,) as rows for machines."""
    return [dict(zip(columns, map(float, row), strict=True)) for row in np.array([*columns.values()]).T]


def write(found: Backbone, path: Path) -> None:
    """The converged points as comma-separated values."""
    columns = {name: value for name, value in record(found).items() if isinstance(value, list) and name != "rows"}
    write_columns(columns, path)


def picture(found: Backbone, scene: str = "", published: PublishedBackbone | None = None) -> Figure:
    """Frequency and damping ratio against amplitude; scene : its name, for the title; published : drawn beside."""
    good = found.converged
    unit, scale = length_unit(found.amplitude[good].max())
    amplitude = scale * found.amplitude[good]
    with axes_of(7.2, 5.6, rows=2) as (figure, (upper, lower)):
        upper.plot(amplitude, found.omega[good] / (2 * np.pi), ".-", color=BLUE, ms=4)
        upper.axhline(found.reference_omega / (2 * np.pi), color=GREY, ls="--", lw=1.2, label="at rest")
        if published is not None:
            reached = published.modal_amplitude <= found.modal_amplitude[good].max()
            of_mode = found.amplitude[good][0] / found.modal_amplitude[good][0]
            there = scale * of_mode * published.modal_amplitude[reached]
            kind = {"color": GREY, "marker": "o", "ms": 4, "lw": 1, "mfc": "none", "label": published.source}
            upper.plot(there, published.frequency[reached], **kind)
            lower.plot(there, 100 * published.damping[reached], **kind)
        upper.set(ylabel="frequency / Hz", title=named(scene, "backbone"))
        upper.legend(loc="best", fontsize=9)
        lower.plot(amplitude, 100 * found.damping[good], ".-", color=ORANGE, ms=4)
        lower.set(xscale="log", xlabel=f"amplitude in the mode at rest / {unit}", ylabel="damping ratio / %")
        lower.set_ylim(bottom=0)
    return figure
