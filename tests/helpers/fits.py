"""What a scene says to measured numbers, and fits of models whose derivatives are differences."""

from collections.abc import Mapping, Sequence

import numpy as np

from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.fits.curve_target import CurveTarget
from tribodyn.workflows.studies.fits.fit_file import Target
from tribodyn.workflows.studies.fits.identification import FitParameter, Identification, MeasuredNumber, Prediction, fit
from tribodyn.workflows.studies.fits.scene_answers import SceneAnswers

STEP = 1e-3  # of a parameter, over it or the width of its bounds


def plain(file: SceneFile) -> ReducedModel:
    """The reduction of a scene, not damped, with nothing prescribed."""
    part, _ = modelling.with_surfaces(file, modelling.part_of(file, Progress()))
    return modelling.plain_of(file, part)


def predict(file: SceneFile, measured: Mapping[str, Target | CurveTarget]) -> np.ndarray:
    """(n_measured,) what a scene says to each measured number, to a curve at each of its points."""
    return SceneAnswers(file, modelling.build(file, Progress())).all_to(measured)


def fit_by_differences(
    parameters: Sequence[FitParameter],
    measured: Sequence[MeasuredNumber],
    predict: Prediction,
    before: Mapping[str, float] | None = None,
) -> Identification:
    """A fit whose derivatives are differences within the bounds."""

    def slopes(values: Mapping[str, float]) -> np.ndarray:
        columns = []
        for p in parameters:
            step = STEP * (values[p.name] if p.ratio else p.high - p.low)
            up, down = min(values[p.name] + step, p.high), max(values[p.name] - step, p.low)
            sides = (predict({**values, p.name: side}) for side in (up, down))
            columns.append(np.subtract(*sides) / (up - down))
        return np.stack(columns, axis=1)

    return fit(parameters, measured, predict, slopes, before)
