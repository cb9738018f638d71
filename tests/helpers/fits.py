"""What a scene says to measured numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tribodyn.workflows.run.reuse import Bench
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.fits.curve_target import CurveTarget
from tribodyn.workflows.studies.fits.fit_file import Answers, Asked


def predict(bench: Bench, file: SceneFile, measured: Mapping[str, Asked | CurveTarget]) -> np.ndarray:
    """(n_measured,) what a scene says to each measured number, to a curve at each of its points."""
    return Answers(file, bench.model(file)).all_to(measured)
