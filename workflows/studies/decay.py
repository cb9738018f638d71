"""A free decay of a scene in time from its nonlinear mode, and what its peaks say beside the backbone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.ring_down import RingDown, ring_down
from tribodyn.workflows.pictures.plots import axes_of, length_unit
from tribodyn.workflows.pictures.style import BLUE, ORANGE
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies import modes


@dataclass(frozen=True)
class Decay:
    """mode : the backbone, converged to its last point; decay : from there."""

    mode: Backbone
    decay: RingDown

    def at(self, values: np.ndarray) -> np.ndarray:
        """Values (n_point,) along the backbone at the amplitudes of the decay, nan beyond its ends."""
        inside = np.interp(np.log(self.decay.amplitude), np.log(self.mode.first_harmonic), values, np.nan, np.nan)
        return np.asarray(inside)


def follow(file: SceneFile, asked: modes.Way, periods: int, steps: int, progress: Progress) -> Decay:
    """Follow the backbone, then let the structure swing freely from its last point down to the first amplitude.

    Raises  ValueError for what cannot be; SolveFailed where the backbone ends before the amplitude asked for
    """
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, None, progress).balance
        mode = modes.along(file, balance, asked, progress)
        if not mode.converged.all():
            raise SolveFailed(f"the backbone {mode.end}")
        with progress.stage("free decay"):
            return Decay(mode, ring_down(balance, mode, periods, steps, least=float(mode.first_harmonic[0])))


def record(found: Decay) -> dict[str, Any]:
    """The decay for machines, with the backbone at its amplitudes (None beyond its ends)."""
    d = found.decay
    columns = {
        "amplitude_m": d.amplitude,
        "frequency_hz": d.omega / (2 * np.pi),
        "damping": d.damping,
        "backbone_frequency_hz": found.at(found.mode.omega) / (2 * np.pi),
        "backbone_damping": found.at(found.mode.damping),
    }
    rows = np.array([*columns.values()]).T
    return {
        "rows": [{n: float(v) if np.isfinite(v) else None for n, v in zip(columns, row, strict=True)} for row in rows],
        "largest_frequency_difference": _largest(d.omega, found.at(found.mode.omega)),
        "largest_damping_difference": _largest(d.damping, found.at(found.mode.damping)),
    }


def _largest(ours: np.ndarray, reference: np.ndarray) -> float | None:
    """Largest relative difference where both are known."""
    apart = np.abs(ours / reference - 1)
    apart = apart[np.isfinite(apart)]
    return float(apart.max()) if len(apart) else None


def write(found: Decay, path: Path) -> None:
    """The displacement of the decay as comma-separated values."""
    write_columns({"time_s": found.decay.time.tolist(), "displacement_m": found.decay.displacement.tolist()}, path)


def picture(found: Decay) -> Figure:
    """The decay, and frequency and damping from its peaks beside the backbone."""
    d = found.decay
    unit, scale = length_unit(d.amplitude.max())
    with axes_of(7.2, 7.6, rows=3, share=False) as (figure, (top, upper, lower)):
        top.plot(1e3 * d.time, scale * d.displacement, color=BLUE, lw=0.7)
        top.set(xlabel="time / ms", ylabel=f"displacement / {unit}", title="Free decay")
        upper.semilogx(scale * found.mode.first_harmonic, found.mode.frequency, color=BLUE, label="backbone")
        upper.semilogx(scale * d.amplitude, d.omega / (2 * np.pi), ".", color=ORANGE, ms=4, label="peaks of the decay")
        upper.set(ylabel="frequency / Hz")
        upper.legend(fontsize=9)
        lower.semilogx(scale * found.mode.first_harmonic, 100 * found.mode.damping, color=BLUE)
        lower.semilogx(scale * d.amplitude, 100 * d.damping, ".", color=ORANGE, ms=4)
        lower.set(xlabel=f"amplitude / {unit}", ylabel="damping ratio / %")
        lower.set_ylim(bottom=0)
    return figure
