"""A free decay of a scene in time from its nonlinear mode, and what its output says beside the backbone."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from tribodyn.hbm import rest
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.free_vibration import FreeVibration
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time import ring_down as time_ring_down
from tribodyn.hbm.time.decrement import decrement
from tribodyn.hbm.time.ring_down import RingDown
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.pictures.figures import axes_of, length_unit, log_axis
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, ORANGE
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene.fields import Length, quantity
from tribodyn.workflows.scene.scene_file import Overrides, SceneFile, Source, read_scene
from tribodyn.workflows.studies.curves.backbones import AmplitudeRange, follow_mode, rows_of
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult


@dataclass(frozen=True, repr=False)
class Decay(StudyResult):
    """A free decay and the backbone along which it goes.

    mode : the backbone, converged to its last point; decay : from there
    expected : (n_point,) logarithmic decrement over 2 pi that the backbone says, see `hbm.time.decrement`
    target : amplitude at which the decay shall end [m]"""

    mode: Backbone
    decay: RingDown
    expected: np.ndarray
    target: float

    def at(self, values: np.ndarray) -> np.ndarray:
        """Values (n_point,) along the backbone at the amplitudes of the decay, nan beyond its ends."""
        backbone_mode = PchipInterpolator(np.log(self.mode.amplitude), values, extrapolate=False)
        return np.asarray(backbone_mode(np.log(self.decay.amplitude)))

    @property
    def end(self) -> str:
        """Why the decay ends, as a sentence."""
        last, target = (f"{x:.4g} m" for x in (self.decay.last, self.target))
        if self.decay.last <= self.target:
            return f"fell to the {target} asked for"
        return f"ended at {last} after all its periods, above the {target} asked for: give more with --periods"

    def record(self) -> dict[str, Any]:
        """The decay for machines, with the backbone at its amplitudes (None beyond its ends)."""
        d = self.decay
        columns = {
            "amplitude_m": d.amplitude,
            "frequency_hz": d.omega / (2 * np.pi),
            "damping": d.damping,
            "remainder": d.rest,
            "backbone_frequency_hz": self.at(self.mode.omega) / (2 * np.pi),
            "backbone_decrement": self.at(self.expected),
            "backbone_damping": self.at(self.mode.damping),
        }
        return {
            "rows": plain(rows_of(columns)),
            "largest_frequency_difference": _largest(d.omega, self.at(self.mode.omega)),
            "largest_decrement_difference": _largest(d.damping, self.at(self.expected)),
            "largest_damping_difference": _largest(d.damping, self.at(self.mode.damping)),
            "end": self.end,
        }

    def lines(self) -> list[str]:
        texts = self.record()
        first, last = texts["rows"][0], texts["rows"][-1]
        off = {name: texts[f"largest_{name}_difference"] for name in ("frequency", "decrement", "damping")}
        frequency, of_decrement, damping = (
            "(no common amplitude)" if share is None else f"{100 * share:.3g} %" for share in off.values()
        )
        return named_lines(
            [
                ("amplitude", f"{first['amplitude_m']:.4g} -> {last['amplitude_m']:.4g} m"),
                ("frequency", f"{first['frequency_hz']:.6g} -> {last['frequency_hz']:.6g} Hz"),
                ("damping", f"{100 * first['damping']:.4g} -> {100 * last['damping']:.4g} %"),
                ("remainder", f"{100 * first['remainder']:.3g} -> {100 * last['remainder']:.3g} % of it"),
                ("", "harmonics above 3 and other modes"),
                ("from the backbone", f"frequency at most {frequency} off"),
                ("", f"damping at most {of_decrement} off its decrement"),
                ("", f"and {damping} off its damping ratio, which counts otherwise"),
                ("end", texts["end"]),
            ]
        )

    def write(self, folder: Path) -> list[Path]:
        """Write ring_down.csv, the displacement over time, and ring_down.png."""
        columns = {"time_s": self.decay.time, "displacement_m": self.decay.displacement}
        return write_files(folder, {"ring_down": columns}, lambda: {"ring_down": self.plot()})

    def plot(self) -> Figure:
        """The decay, and frequency and damping from it beside the backbone."""
        d = self.decay
        unit, scale = length_unit(d.amplitude.max())
        with axes_of(7.2, 7.6, rows=3, share=False) as (figure, (top, upper, lower)):
            top.plot(1e3 * d.time, scale * d.displacement, color=BLUE, lw=0.7)
            top.set(xlabel="time / ms", ylabel=f"displacement / {unit}", title="Free decay")
            upper.plot(scale * self.mode.amplitude, self.mode.frequency, color=BLUE, label="backbone")
            upper.plot(scale * d.amplitude, d.omega / (2 * np.pi), ".", color=ORANGE, ms=4, label="free decay")
            upper.set(ylabel="frequency / Hz")
            upper.legend()
            lower.plot(scale * self.mode.amplitude, 100 * self.expected, color=BLUE, label="its decrement")
            curve = 100 * self.mode.damping
            lower.plot(scale * self.mode.amplitude, curve, color=BLUE, ls="--", label="its damping ratio")
            lower.plot(scale * d.amplitude, 100 * d.damping, ".", color=ORANGE, ms=4)
            lower.set(xlabel=f"amplitude / {unit}", ylabel="damping ratio / %")
            lower.set_ylim(bottom=0)
            for axes in (upper, lower):
                log_axis(axes.xaxis, self.mode.amplitude.min(), self.mode.amplitude.max())
            lower.legend()
        return figure


def ring_down(
    scene: Source,
    start: Length | None = None,
    stop: Length | None = None,
    *,
    mode: int | None = None,
    points: int | None = None,
    periods: int = 400,
    steps: int = 256,
    impulse: Annotated[float | None, quantity("N s")] = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> Decay:
    """Let a nonlinear mode decay freely in time: frequency and damping from its output, beside the backbone.

    Where the largest swing leaves a mark on the faces, as asperities that yield do, the backbone beside the decay is
    that of the faces as they are after it.

    scene : name of a scene or a .toml file; its harmonic loads play no part
    start : amplitude of the response at which the decay ends, such as 1um; [backbone] of the scene by default
    stop : amplitude at which it begins, such as 1mm
    mode : number of the mode about the static equilibrium, from 0; 0 or that of [backbone] by default
    points : points of the backbone where it bends little; 40 or those of [backbone] by default
    periods : periods after which the decay ends at the latest
    steps : time steps per period
    impulse : let it begin at rest with a hammer's blow of this size on the harmonic load, such as "0.1 N s", instead of
        in the mode; the amplitude at which it begins then follows, and other modes ring along
    Raises  Refusal for what cannot be; SolveFailed where the backbone ends before the amplitude asked for"""
    file, report = read_scene(scene, overrides), reporter(progress)
    if impulse is not None:
        return _struck(file, start, mode or 0, points or 40, periods, steps, impulse, report)
    range_ = AmplitudeRange.of(file, start, stop, mode, points)
    if not range_.stop > range_.start:
        raise Refusal("a free decay ends at a smaller amplitude than it begins at: give --from below --to")
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, report).balance
        swung = _reached(follow_mode(file, balance, range_, report))
        marked = _marked(balance, swung)
        if marked is not None:
            balance = marked
            swung = _reached(follow_mode(file, balance, range_, report))
        with report.stage("free decay"):
            least = float(swung.amplitude[0])
            swing = time_ring_down.ring_down(balance, swung, periods, steps, least)
            return Decay(swung, swing, decrement(balance, swung), least)


def _struck(
    file: SceneFile,
    least: float | None,
    mode: int,
    points: int,
    periods: int,
    steps: int,
    impulse: float,
    report: Progress,
) -> Decay:
    """The decay after a blow, beside the backbone through its amplitudes."""
    if least is None or not (impulse > 0 and least > 0):
        raise Refusal("a blow needs --impulse above 0 and --from, the amplitude at which its decay ends")
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, report).balance
        with report.stage("free decay"):
            omega = FreeVibration(balance, mode, settings.OUTPUT).reference_omega
            swing = time_ring_down.hammer(balance, impulse, omega, settings.OUTPUT, periods, steps, least)
        ends = float(swing.amplitude.min()), float(swing.amplitude.max())
        swung = _reached(follow_mode(file, balance, AmplitudeRange(*ends, mode, points), report))
        return Decay(swung, swing, decrement(balance, swung), least)


def _reached(mode: Backbone) -> Backbone:
    if not mode.converged.all():
        raise SolveFailed(f"the backbone {mode.end}")
    return mode


def _marked(balance: HarmonicBalance, mode: Backbone) -> HarmonicBalance | None:
    """The balance of faces that have swung as in the last point of a mode, None where that leaves no mark."""
    if balance.at_rest is None or not all(hasattr(joint.module, "memory_at_rest") for joint in balance.contact.joints):
        return None
    x = mode.contact[-1].reshape(*balance.at_rest.shape, -1)
    deepest = balance.at_rest.copy()
    normal = balance.contact.components.index("n")
    deepest[:, normal] = np.maximum(deepest[:, normal], balance.basis.to_time(x[:, normal]).max(axis=1))
    return balance.with_memory(rest.memory(balance, deepest))


def _largest(ours: np.ndarray, reference: np.ndarray) -> float | None:
    """Largest relative difference where both are known."""
    difference = np.abs(ours / reference - 1)
    difference = difference[np.isfinite(difference)]
    return float(difference.max()) if len(difference) else None
