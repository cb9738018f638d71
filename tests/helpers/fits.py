"""What a scene says to measured numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.fits.curve_target import CurveTarget
from tribodyn.workflows.studies.fits.fit_file import Answers, Asked


def plain(file: SceneFile) -> ReducedModel:
    """The reduction of a scene, not damped, with nothing prescribed."""
    part, _ = modelling.with_surfaces(file, modelling.part_of(file, Progress()))
    return modelling.plain_of(file, part)


def predict(file: SceneFile, measured: Mapping[str, Asked | CurveTarget]) -> np.ndarray:
    """(n_measured,) what a scene says to each measured number, to a curve at each of its points."""
    return Answers(file, modelling.build(file, Progress())).all_to(measured)
