"""Compute the response of a scene at the points of a measurement."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.free_vibration import FreeVibration
from tribodyn.hbm.time.decrement import decrement
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import modelling, response_curve
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.curves.backbones import AmplitudeRange, follow_mode
from tribodyn.workflows.studies.measured.measurement import Measurement, Run, driving_load

SAME_FREQUENCY = 1e-5  # relative difference of frequencies that a universal file, with six digits, may make


@dataclass(frozen=True)
class ComparedRun:
    """A measured run, and what a scene computes beside it.

    computed : at the points of the run, nan where the scene does not reach; curve : all that was computed"""

    measured: Run
    computed: Run
    curve: Run


def compare_runs(
    file: SceneFile, model: modelling.Model, measured: Measurement, progress: Progress
) -> tuple[ComparedRun, ...]:
    """The scene beside every run. measured : in the directions of the scene, see `Measurement.on`

    Of a response each run is computed with the force that it has at its largest amplitude, where contacts slip most;
    the measured amplitude is taken in proportion to it.
    Raises  Refusal, SolveFailed: what the scene cannot compute"""
    if measured.kind == "modes":
        table = file.scene.backbone
        omega, ratio = FreeVibration(model.balance, table.mode if table else 0, measured.output).about_rest()
        computed = _run(omega / (2 * np.pi), np.full(len(omega), np.nan), ratio)
        return tuple(ComparedRun(run, _nearest(computed, run), computed) for run in measured.runs)
    if measured.kind == "backbone":
        computed = _backbone(file, model, measured, progress)
        return tuple(ComparedRun(run, _at_amplitude(computed, run), computed) for run in measured.runs)
    return tuple(_response(file, model, measured.output, run, progress) for run in measured.runs)


def _run(hertz: np.ndarray, x: np.ndarray, damping: np.ndarray, force: np.ndarray | None = None) -> Run:
    none = np.full((len(hertz), 2), np.nan)
    return Run("", "", hertz, x.astype(complex), none[:, 0] if force is None else force, damping, none)


def _backbone(file: SceneFile, model: modelling.Model, measured: Measurement, progress: Progress) -> Run:
    """The backbone of the scene by the first harmonic of the output, with the force of phase resonance there."""
    range_ = AmplitudeRange.of(file, None, None, None, None)
    mode = follow_mode(file, model.balance, range_, progress, measured.output)
    good = mode.converged
    if good.sum() < 2 or (measured.decay and not good.all()):
        raise SolveFailed(f"the backbone {mode.end}")
    damping = decrement(model.balance, mode) if measured.decay else mode.damping
    force = np.full(len(mode.omega), np.nan)
    if measured.force_at_output(file.scene):
        force = 2 * damping * mode.omega**2 * mode.modal_amplitude**2 / mode.reference_amplitude
    return _run(mode.frequency[good], mode.first_harmonic[good], damping[good], force[good])


def _at_amplitude(mode: Run, run: Run) -> Run:
    a, order = np.unique(np.log(mode.amplitude), return_index=True)
    at = np.log(run.amplitude)
    for end in (a[0], a[-1]):
        at = np.where(np.abs(at - end) < SAME_FREQUENCY, end, at)
    hertz, damping, force = (
        PchipInterpolator(a, values[order], extrapolate=False)(at)
        if np.isfinite(values).all()
        else np.full(len(at), np.nan)
        for values in (mode.frequency, mode.damping, mode.force)
    )
    return replace(run, frequency=hertz, damping=damping, force=force)


def _nearest(modes_of_scene: Run, run: Run) -> Run:
    at = np.abs(modes_of_scene.frequency[None] - run.frequency[:, None]).argmin(axis=1)
    return replace(run, frequency=modes_of_scene.frequency[at], damping=modes_of_scene.damping[at])


def _response(file: SceneFile, model: modelling.Model, output: str, run: Run, progress: Progress) -> ComparedRun:
    _, scale = driving_load(file.scene)
    level = float(run.force[run.amplitude.argmax()])
    with progress.track(f"response, {run.name}") as advance:
        branch = response_curve.follow_response(file.scene, model.balance.with_load(level / abs(scale)), advance)
    if branch.converged.sum() < 2:
        raise SolveFailed(f"the response beside {run.name} {branch.end}")
    at_level = replace(run, displacement=run.displacement * (level / run.force))
    curve_run = _first_harmonic(branch, output, model.balance.basis.order, scale, level)
    computed = replace(at_level, displacement=_at_frequency(curve_run, at_level), force=np.full(len(run.force), level))
    return ComparedRun(at_level, computed, curve_run)


def _first_harmonic(branch: Branch, output: str, order: np.ndarray, force: complex, level: float) -> Run:
    """Complex displacement against the phase of the force along a curve of constant force, `level`."""
    good = branch.converged
    cosine, sine = branch.response[good, branch.output_names.index(output)][:, order == 1].T
    x = (cosine - 1j * sine) * abs(force) / force
    return replace(_run(branch.frequency[good], x, np.full(len(x), np.nan)), force=np.full(len(x), level))


def _at_frequency(curve_run: Run, run: Run) -> np.ndarray:
    """(n,) complex displacement at the frequencies of a run, nan beyond the ends.

    Between computed points 1 / x goes straight: that of one mode is a parabola in frequency. Where a curve with folds
    has several values, the one nearest to the measured amplitude is taken."""
    hertz, inverse = curve_run.frequency, 1 / curve_run.displacement
    best = np.full(len(run.frequency), np.nan, complex)
    for i, (f, measured) in enumerate(zip(run.frequency, run.amplitude, strict=True)):
        matches = np.flatnonzero(np.abs(hertz / f - 1) < SAME_FREQUENCY)
        segments = np.flatnonzero((hertz[:-1] - f) * (hertz[1:] - f) < 0)
        share = (f - hertz[segments]) / (hertz[segments + 1] - hertz[segments])
        values = list(
            curve_run.displacement[matches]
            if len(matches)
            else 1 / (inverse[segments] * (1 - share) + inverse[segments + 1] * share)
        )
        if len(values):
            best[i] = min(values, key=lambda x: abs(np.log(abs(x) / measured)))
    return best
