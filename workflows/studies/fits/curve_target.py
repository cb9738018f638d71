"""Measured curves as numbers of a fit: every point of a response or backbone is one, weighted by its scatter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, StrictBool, ValidationInfo, model_validator

from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.fields import Number, Table
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.user_files import folder_of
from tribodyn.workflows.studies.fits.identification import MeasuredNumber
from tribodyn.workflows.studies.measured.computed_runs import compare_runs
from tribodyn.workflows.studies.measured.measurement import Measurement, Run, prepared
from tribodyn.workflows.studies.measured.reading import read

FULL = 0.01  # relative standard deviation whose residual has the weight 1


class Curve(Table):
    """A measured curve.

    file : beside the file of the fit; facts : what it does not say, as for `compare`
    resonance : take each run of a response as a point of a backbone; control : the runs that are meant, all by default
    error, frequency_error : relative standard deviations of damping or of a response's amplitude, and of the frequency
        of a backbone; where they are given they go before those of the file or of the fit of a resonance
    weight : of all its points together with the other numbers"""

    file: str
    facts: dict[str, str] = Field(default_factory=dict)
    resonance: StrictBool = False
    control: Literal["force", "response"] | None = None
    error: Annotated[Number, Field(gt=0)] = 0.1
    frequency_error: Annotated[Number, Field(gt=0)] = 1e-3
    weight: Annotated[Number, Field(gt=0)] = 1.0

    _folder: Path = PrivateAttr(Path())

    @model_validator(mode="after")
    def _remember_the_folder(self, info: ValidationInfo) -> Self:
        self._folder = folder_of(info) or Path()
        return self


@dataclass(frozen=True)
class CurveTarget:
    """A measured curve in the directions of a scene, and how its points count."""

    name: str
    table: Curve
    measured: Measurement

    @classmethod
    def of(cls, name: str, table: Curve, file: SceneFile) -> CurveTarget:
        """Read a curve; raises SceneError where it does not fit the scene or has no such runs."""
        try:
            measurement = read(table._folder / table.file, table.facts)
            chosen_runs = tuple(run for run in measurement.runs if table.control in (None, run.control))
            if not chosen_runs:
                raise Refusal(f"no run has control = {table.control}")
            return cls(name, table, prepared(replace(measurement, runs=chosen_runs), file.scene, table.resonance))
        except Refusal as trouble:
            raise SceneError(f"curves.{name}: {trouble}") from None

    def numbers(self) -> list[MeasuredNumber]:
        """Every point as a measured number, see `values`."""
        points = []
        for run in self.measured.runs:
            measured_errors = np.isfinite(run.errors) & [
                k not in self.table.model_fields_set for k in ("frequency_error", "error")
            ]
            errors = np.where(measured_errors, run.errors, [self.table.frequency_error, self.table.error])
            for kind, (values, column, unit) in self._columns(run, run).items():
                for x, value, error in zip(self._places(run), values, errors[:, column], strict=True):
                    weight = self.table.weight * FULL / float(error)
                    points.append(MeasuredNumber(f"{self.name} {x} {kind}", float(value), unit, weight))
        return points

    def _places(self, run: Run) -> list[str]:
        if self.measured.kind == "backbone":
            return [f"{1e6 * a:.3g} um" for a in run.amplitude]
        return [f"{f:.5g} Hz" for f in run.frequency]

    def _columns(self, run: Run, measured: Run) -> dict[str, tuple[np.ndarray, int, str]]:
        if self.measured.kind == "response":
            turned = np.angle(run.displacement / measured.displacement) if self.measured.phased else np.zeros(0)
            phase = {"e^phase": (np.exp(turned), 1, "")} if self.measured.phased else {}
            return {"amplitude": (run.amplitude, 1, "m"), **phase}
        return {"frequency": (run.frequency, 0, "Hz"), "damping": (run.damping, 1, "")}

    def values(self, file: SceneFile, model: modelling.Model) -> np.ndarray:
        """(n,) what a scene says to the numbers; raises SolveFailed where it does not reach a point."""
        pairs = compare_runs(file, model, self.measured, Progress())
        numbers = np.concatenate([v for run in pairs for v, *_ in self._columns(run.computed, run.measured).values()])
        if missing := np.sum(~np.isfinite(numbers)):
            raise SolveFailed(f"curves.{self.name}: the scene does not reach {missing} of its points")
        return numbers
