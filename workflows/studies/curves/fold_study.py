"""Folds of a scene's response curve, by harmonic balance and in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.outcome import SolveEnd
from tribodyn.hbm.stability.folds_in_time import FoldInTime, fold_in_time
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.fields import Number
from tribodyn.workflows.scene.source import Overrides, Source, read_scene
from tribodyn.workflows.studies.study_result import StudyResult


@dataclass(frozen=True, repr=False)
class FoldStudy(StudyResult):
    """The response curve of a scene, by arc length, and its folds in the order of the curve."""

    branch: Branch
    folds: tuple[FoldInTime, ...]

    def record(self) -> list[dict[str, Any]]:
        """For machines."""
        return [
            {
                "balance_hz": fold.omega / (2 * np.pi),
                "time_hz": fold.in_time / (2 * np.pi) if fold.is_located else None,
                "difference": fold.omega / fold.in_time - 1 if fold.is_located else None,
                "resolution": fold.resolution,
                "amplitude_m": fold.amplitude,
                "outcome": str(fold.outcome),
            }
            for fold in self.folds
        ]

    def lines(self) -> list[str]:
        """For people."""
        texts = [] if self.folds else [f"no folds: the response {self.branch.end}"]
        for fold in self.folds:
            hertz, in_time = fold.omega / (2 * np.pi), fold.in_time / (2 * np.pi)
            fold_in_time = f": {fold.outcome}"
            if fold.is_located:
                fold_in_time = f", in time {in_time:.6g} Hz (known to {100 * fold.resolution:.2g} %): the balance is "
                fold_in_time += f"{100 * (hertz / in_time - 1):+.3g} % off"
            texts.append(f"balance {hertz:.6g} Hz{fold_in_time}")
        return texts


def folds(scene: Source, within: Number = 0.02, *, overrides: Overrides = (), progress: Report = None) -> FoldStudy:
    """Find the folds of the response by harmonic balance, and where the same branches end in time integration.

    scene : name of a scene or a .toml file
    within : relative distance to the fold of the balance within which its end in time is looked for, such as "2 %"
    Raises  SolveFailed where the curve has no first point; Refusal for a sector of a wheel, whose perturbations are
    other waves than its motion
    """
    if not 0 < within < 1:
        raise Refusal(f"--within {within:g}: give a share between 0 and 100 %")
    file, report = read_scene(scene, overrides), reporter(progress)
    if getattr(file.scene, "wheel", None):
        raise Refusal(f"{file.name} has a [wheel]: its folds cannot be looked for in time")
    low, high = settings.response_range(file.scene)
    with limited(file.scene.solver.threads):
        balance = modelling.build(file, report).balance
        with report.stage("frequency response"):
            options = arc_length.Options(newton=settings.newton_options(file.scene))
            branch = arc_length.follow(balance, low, high, options)
        if not branch.converged[0]:
            raise SolveFailed(f"the frequency response {branch.end}")
        folds_in_time = []
        for fold in branch.folds:
            with report.stage(f"fold at {branch.frequency[fold]:.6g} Hz in time"):
                try:
                    folds_in_time.append(fold_in_time(balance, branch, fold, settings.OUTPUT, bracket=within))
                except IntegrationFailed as failure:
                    omega = float(branch.omega[fold])
                    reason = SolveEnd.INTEGRATION_FAILED.say(f" {failure}")
                    folds_in_time.append(FoldInTime(fold, omega, omega, float("nan"), within, reason))
    return FoldStudy(branch, tuple(folds_in_time))
