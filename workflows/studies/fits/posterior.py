"""What measured numbers leave of parameters: samples of their posterior, and of numbers that follow from them.

The model is replaced by Gaussian processes through some of its trials, more of which are made where the posterior lies
until the processes know the measured numbers better than the measurements do. The sampler is emcee's.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import qmc

from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.theme import BLUE, INK, RED, STYLE
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber
from tribodyn.workflows.studies.fits.posterior_sampling import (
    BATCH,
    ModelTrials,
    ParameterBox,
    Trial,
    chains_of,
    spread_points,
    uncertainty_at,
)
from tribodyn.workflows.studies.many.distributions import Marginal
from tribodyn.workflows.studies.study_result import StudyResult

LONG = 10.0  # autocorrelation times that every chain must have
FIRST = 12  # trials for each parameter, spread over the bounds
ENOUGH = 0.3  # standard deviation of a process over that of the measurement, where the posterior lies
NARROWED = 0.8  # width of a posterior over that of its prior, above which the numbers say little


@dataclass(frozen=True)
class Summary:
    """A number of which samples are known: median, and the ends of its central 90 %."""

    name: str
    unit: str
    median: float
    low: float
    high: float


@dataclass(frozen=True, repr=False)
class Posterior(StudyResult):
    """Samples of parameters and of what follows from them.

    samples : (n, n_parameter) values in SI units; predicted : name -> (n,) values of numbers that were not measured
    units : of the predicted ones; trials : of the model, failed : those that ended without numbers
    surrogate : largest standard deviation of a process over that of its measurement, at the samples
    chain : length of the chains in autocorrelation times; narrowed : (n_parameter,) width over that of the prior
    """

    parameters: tuple[FitParameter, ...]
    measured: tuple[MeasuredNumber, ...]
    samples: np.ndarray
    predicted: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    trials: int
    failed: int
    surrogate: float
    chain: float
    narrowed: np.ndarray

    def summaries(self) -> tuple[Summary, ...]:
        """Of parameters and predicted numbers."""
        columns = [(p.name, p.unit, self.samples[:, i]) for i, p in enumerate(self.parameters)]
        columns += [(name, self.units[name], values) for name, values in self.predicted.items()]
        shares = [0.5, 0.05, 0.95]
        return tuple(Summary(n, unit, *map(float, np.quantile(values, shares))) for n, unit, values in columns)

    @property
    def doubts(self) -> list[str]:
        """What stands against believing it, in sentences; empty where nothing does."""
        sentences = []
        if self.chain < LONG:
            sentences.append(f"the chains are {self.chain:.0f} autocorrelation times long, {LONG:.0f} are wanted")
        if self.surrogate > ENOUGH:
            sentences.append(
                f"the surrogate is uncertain by {self.surrogate:.2f} of the measurements' errors: allow more trials"
            )
        sentences += [
            f"{p.name}: the numbers say little, its posterior is {share:.2f} as wide as its prior"
            for p, share in zip(self.parameters, self.narrowed, strict=True)
            if share > NARROWED
        ]
        return sentences

    def lines(self) -> list[str]:
        """For people."""
        failed = f", {self.failed} of them without numbers" if self.failed else ""
        texts = [f"posterior from {self.trials} trials{failed}", f"{'':26}{'median':>12}   90 % credible"]
        texts += [
            f"{summary.name:26}{summary.median:12.4g}   {summary.low:.4g} .. {summary.high:.4g} {summary.unit}".rstrip()
            for summary in self.summaries()
        ]
        for i, j in zip(*np.triu_indices(len(self.parameters), 1), strict=True):
            correlation = np.corrcoef(self.samples[:, i], self.samples[:, j])[0, 1]
            texts.append(f"correlation of {self.parameters[i].name} and {self.parameters[j].name}: {correlation:+.2f}")
        return texts + [f"doubtful: {doubt}" for doubt in self.doubts]

    def record(self) -> dict[str, Any]:
        """Plain data for machines."""
        return {
            "summaries": [vars(summary) for summary in self.summaries()], "trials": self.trials, "failed": self.failed,
            "surrogate": self.surrogate, "chain": self.chain, "doubts": self.doubts,
        }  # fmt: skip

    def plot(self) -> Figure:
        """Every pair of parameters and predicted numbers."""
        return _picture(self)

    def write(self, folder: Path) -> list[Path]:
        """Write posterior.png."""
        return write_files(folder, {}, {"posterior": self.plot()})


def sample(
    parameters: Sequence[FitParameter],
    measured: Sequence[MeasuredNumber],
    trial: Trial,
    predicted: Mapping[str, str] | None = None,
    priors: Mapping[str, Marginal] | None = None,
    max_trials: int = 100,
    seed: int = 0,
) -> Posterior:
    """Sample the posterior of parameters within their bounds.

    measured : with `error`, the standard deviation of ln(measured), normally distributed
    trial : parameters by name -> (n_measured + n_predicted,) values above 0; SolveFailed where there are none
    predicted : name -> unit of the numbers that follow; priors : of some parameters, the others are spread evenly over
        the bounds of their unknowns; most : trials
    Raises  Refusal without an error of a measured number, or without emcee; SolveFailed where more than half of the
        trials fail
    Source  ensemble sampler with the stretch move: Goodman and Weare 2010, doi 10.2140/camcos.2010.5.65; Gaussian
        process in place of the model, its variance added to that of the errors: Kennedy and O'Hagan 2001, doi
        10.1111/1467-9868.00294
    """
    errors = np.array([m.error or 0.0 for m in measured])
    if not (errors > 0).all():
        missing = next(m.name for m in measured if not m.error)
        raise Refusal(f'measured.{missing}.error: a posterior needs the error of every measured number, such as "5 %"')
    box = ParameterBox(tuple(parameters), dict(priors or {}))
    names = dict(predicted or {})
    target = np.log([m.value for m in measured])
    trials = ModelTrials(box, trial, len(target) + len(names))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)  # as many as there may be
        first = qmc.Sobol(len(parameters), seed=np.random.default_rng(seed)).random(
            min(FIRST * len(parameters), max_trials)
        )
    trials.make(first)
    while True:
        levels = trials.levels()
        chain, length = chains_of(box, levels[: len(target)], target, errors, seed)
        spread = chain[:: max(len(chain) // 400, 1)]
        sure = uncertainty_at(levels[: len(target)], errors, box.coordinates(spread))
        if sure.max() <= ENOUGH or trials.count + BATCH > max_trials:
            break
        trials.make(spread_points(spread, sure, np.array(trials.shares)))
    thin = chain[:: max(len(chain) // 4000, 1)]
    draw = np.random.default_rng(seed)
    coordinates = box.coordinates(thin)
    follow = {}
    for name, level in zip(names, levels[len(target) :], strict=True):
        mean, deviation = level.mean_and_deviation(coordinates)
        follow[name] = np.exp(mean + deviation * draw.standard_normal(len(mean)))
    return Posterior(
        tuple(parameters), tuple(measured), np.array([box.values(share) for share in thin]), follow, names,
        trials.count, trials.failed, float(sure.max()), length, thin.std(axis=0) / box.width_of_prior(seed),
    )  # fmt: skip


def _picture(posterior: Posterior) -> Figure:
    """The parameters and the numbers that follow from them; red: medians and the ends of their central 90 %."""
    shown_numbers = posterior.summaries()
    columns = np.column_stack([posterior.samples, *posterior.predicted.values()])
    n = len(shown_numbers)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.3 * n + 0.8, 2.1 * n + 0.5), layout="constrained")
        panes = figure.subplots(n, n, squeeze=False, sharex="col")
        for i in range(n):
            for j in range(n):
                pane = panes[i, j]
                if j > i:
                    pane.set_axis_off()
                    continue
                if i == j:
                    pane.hist(columns[:, i], bins=40, color=BLUE, alpha=0.7)
                    for end in (shown_numbers[i].low, shown_numbers[i].median, shown_numbers[i].high):
                        pane.axvline(end, color=RED, lw=1)
                    pane.set_yticks([])
                    pane.set_title(shown_numbers[i].name, fontsize=9, color=INK)
                else:
                    shown = columns[:: max(len(columns) // 1000, 1)]
                    pane.plot(shown[:, j], shown[:, i], ".", color=BLUE, ms=2, alpha=0.4)
                    if j == 0:
                        pane.set_ylabel(_label(shown_numbers[i]), fontsize=8)
                pane.xaxis.set_major_locator(MaxNLocator(3))
                pane.tick_params(labelsize=7)
        for j, pane in enumerate(panes[-1]):
            pane.set_xlabel(_label(shown_numbers[j]), fontsize=8)
    return figure


def _label(summary: Summary) -> str:
    return f"{summary.name} / {summary.unit}" if summary.unit else summary.name
