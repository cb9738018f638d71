"""The runs of a study: which value every key has in every run."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import qmc

from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.studies.many.distributions import Marginal
from tribodyn.workflows.studies.many.study_file import Study

MOST_RUNS = 1_000_000
INSIDE = 1e-12  # shares stay this far from 0 and 1, where a quantile may be infinite


def runs(study: Study) -> list[dict[str, Any]]:
    """The values of the keys, run by run: as the lists have them, drawn ones in SI units.

    A key with a list in a design that draws takes its values with equal chances.
    Raises  SceneError where correlations contradict each other
    """
    keys = list(study.varied)
    lists = [values for values in study.varied.values() if not isinstance(values, Marginal)]
    if study.settings.design == "grid":
        if np.prod([float(len(values)) for values in lists]) > MOST_RUNS:
            raise SceneError(f"{study.name}: a grid of more than {MOST_RUNS} runs, leave out values")
        return [dict(zip(keys, values, strict=True)) for values in itertools.product(*lists)]
    if study.settings.design == "list":
        return [dict(zip(keys, values, strict=True)) for values in zip(*lists, strict=True)]
    share = correlated(study, shares(study))
    columns = [_column(study.varied[key], share[:, i]) for i, key in enumerate(keys)]
    return [dict(zip(keys, values, strict=True)) for values in zip(*columns, strict=True)]


def shares(study: Study) -> np.ndarray:
    """(n_run, n_key) points of the unit cube, by scipy.stats.qmc; scrambled Sobol points or a Latin hypercube."""
    count, width = study.settings.runs or 0, len(study.varied)
    draw = np.random.default_rng(study.settings.seed)
    engine = qmc.Sobol(width, seed=draw) if study.settings.design == "sobol" else qmc.LatinHypercube(width, seed=draw)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)  # the page says it
        return np.clip(engine.random(count), INSIDE, 1 - INSIDE)


def correlated(study: Study, share: np.ndarray) -> np.ndarray:
    """The points under the study's correlations, by a Gaussian copula; raises SceneError where there is none."""
    if not study.correlations:
        return share
    keys, matrix = list(study.varied), np.eye(len(study.varied))
    for correlation in study.correlations:
        i, j = (keys.index(key) for key in correlation.keys)
        matrix[i, j] = matrix[j, i] = correlation.value
    try:
        factor = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise SceneError(f"{study.name}: no variables have all of these correlations at once, lower them") from None
    normal = stats.norm.ppf(share) @ factor.T
    drawn = np.array([isinstance(study.varied[key], Marginal) for key in keys])
    return np.where(drawn, np.clip(stats.norm.cdf(normal), INSIDE, 1 - INSIDE), share)


def _column(varied: tuple[Any, ...] | Marginal, share: np.ndarray) -> list[Any]:
    if isinstance(varied, Marginal):
        return [float(value) for value in varied.at(share)]
    return [varied[int(u * len(varied))] for u in share]
