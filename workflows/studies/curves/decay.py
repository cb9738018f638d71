"""A free decay of a scene in time from its nonlinear mode, and what its output says beside the backbone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from tribodyn.hbm import rest
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.decrement import decrement
from tribodyn.hbm.time.ring_down import RingDown, ring_down
from tribodyn.workflows.pictures.figures import axes_of, length_unit, log_axis
from tribodyn.workflows.pictures.style import BLUE, ORANGE
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.curves import backbones as modes

TOLD = 4  # digits of amplitudes in sentences


@dataclass(frozen=True)
class Decay:
    """A free decay and the backbone along which it goes.

    mode : the backbone, converged to its last point; decay : from there
    expected : (n_point,) logarithmic decrement over 2 pi that the backbone says, see `hbm.time.decrement`
    asked : amplitude at which the decay was to end [m]
    """

    mode: Backbone
    decay: RingDown
    expected: np.ndarray
    asked: float

    def at(self, values: np.ndarray) -> np.ndarray:
        """Values (n_point,) along the backbone at the amplitudes of the decay, nan beyond its ends."""
        along = PchipInterpolator(np.log(self.mode.first_harmonic), values, extrapolate=False)
        return np.asarray(along(np.log(self.decay.amplitude)))

    @property
    def end(self) -> str:
        """Why the decay ends, as a sentence."""
        last, asked = (f"{x:.{TOLD}g} m" for x in (self.decay.last, self.asked))
        if self.decay.last <= self.asked:
            return f"fell to the {asked} asked for"
        return f"ended at {last} after all its periods, above the {asked} asked for: give more with --periods"


def follow(file: SceneFile, asked: modes.Way, periods: int, steps: int, progress: Progress) -> Decay:
    """Follow the backbone up, then let the structure swing freely from its last point down to the first amplitude.

    Where the largest swing leaves a mark on the faces, as asperities that yield do, the backbone beside the decay is
    that of the faces as they are after it.
    Raises  ValueError for what cannot be; SolveFailed where the backbone ends before the amplitude asked for
    """
    if not asked.stop > asked.start:
        raise ValueError("a free decay ends at a smaller amplitude than it begins at: give --from below --to")
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, None, progress).balance
        mode = _reached(modes.along(file, balance, asked, progress))
        marked = _marked(balance, mode)
        if marked is not None:
            balance = marked
            mode = _reached(modes.along(file, balance, asked, progress))
        with progress.stage("free decay"):
            least = float(mode.first_harmonic[0])
            return Decay(mode, ring_down(balance, mode, periods, steps, least), decrement(balance, mode), least)


def _reached(mode: Backbone) -> Backbone:
    if not mode.converged.all():
        raise SolveFailed(f"the backbone {mode.end}")
    return mode


def _marked(balance: HarmonicBalance, mode: Backbone) -> HarmonicBalance | None:
    """The balance of faces that have swung as in the last point of a mode, None where that leaves no mark."""
    if balance.at_rest is None or not all(hasattr(joint.module, "rested") for joint in balance.contact.joints):
        return None
    x = mode.contact[-1].reshape(*balance.at_rest.shape, -1)
    deepest = balance.at_rest.copy()
    normal = balance.contact.components.index("n")
    deepest[:, normal] = np.maximum(deepest[:, normal], balance.basis.to_time(x[:, normal]).max(axis=1))
    return balance.with_memory(rest.memory(balance, deepest))


def record(found: Decay) -> dict[str, Any]:
    """The decay for machines, with the backbone at its amplitudes (None beyond its ends)."""
    d = found.decay
    columns = {
        "amplitude_m": d.amplitude,
        "frequency_hz": d.omega / (2 * np.pi),
        "damping": d.damping,
        "backbone_frequency_hz": found.at(found.mode.omega) / (2 * np.pi),
        "backbone_decrement": found.at(found.expected),
        "backbone_damping": found.at(found.mode.damping),
    }
    rows = np.array([*columns.values()]).T
    return {
        "rows": [{n: float(v) if np.isfinite(v) else None for n, v in zip(columns, row, strict=True)} for row in rows],
        "largest_frequency_difference": _largest(d.omega, found.at(found.mode.omega)),
        "largest_decrement_difference": _largest(d.damping, found.at(found.expected)),
        "largest_damping_difference": _largest(d.damping, found.at(found.mode.damping)),
        "end": found.end,
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
    """The decay, and frequency and damping from it beside the backbone."""
    d = found.decay
    unit, scale = length_unit(d.amplitude.max())
    with axes_of(7.2, 7.6, rows=3, share=False) as (figure, (top, upper, lower)):
        top.plot(1e3 * d.time, scale * d.displacement, color=BLUE, lw=0.7)
        top.set(xlabel="time / ms", ylabel=f"displacement / {unit}", title="Free decay")
        upper.plot(scale * found.mode.first_harmonic, found.mode.frequency, color=BLUE, label="backbone")
        upper.plot(scale * d.amplitude, d.omega / (2 * np.pi), ".", color=ORANGE, ms=4, label="free decay")
        upper.set(ylabel="frequency / Hz")
        upper.legend(fontsize=9)
        lower.plot(scale * found.mode.first_harmonic, 100 * found.expected, color=BLUE, label="its decrement")
        given = 100 * found.mode.damping
        lower.plot(scale * found.mode.first_harmonic, given, color=BLUE, ls="--", lw=1, label="its damping ratio")
        lower.plot(scale * d.amplitude, 100 * d.damping, ".", color=ORANGE, ms=4)
        lower.set(xlabel=f"amplitude / {unit}", ylabel="damping ratio / %")
        lower.set_ylim(bottom=0)
        for axes in (upper, lower):
            log_axis(axes.xaxis, found.mode.first_harmonic.min(), found.mode.first_harmonic.max())
        lower.legend(fontsize=9)
    return figure
