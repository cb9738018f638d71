"""What measured numbers leave of parameters: samples of their posterior, and of numbers that follow from them.

The model is replaced by Gaussian processes through some of its trials, more of which are made where the posterior lies
until the processes know the measured numbers better than the measurements do. The sampler is emcee's.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import qmc

from tribodyn.extras import package
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.theme import BLUE, INK, RED, STYLE
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber
from tribodyn.workflows.studies.many.distributions import Marginal
from tribodyn.workflows.studies.many.surrogate import Surrogate
from tribodyn.workflows.studies.study_result import StudyResult

WALKERS = 96
STEPS = 500  # of every walker, a third of which is left out
LONG = 10.0  # autocorrelation times that every chain must have
FIRST = 12  # trials for each parameter, spread over the bounds
BATCH = 6  # trials that are added at a time
ENOUGH = 0.3  # standard deviation of a process over that of the measurement, where the posterior lies
NARROWED = 0.8  # width of a posterior over that of its prior, above which the numbers say little

Trial = Callable[[Mapping[str, float]], np.ndarray]


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
        return tuple(
            Summary(name, unit, *(float(v) for v in np.quantile(values, [0.5, 0.05, 0.95])))
            for name, unit, values in columns
        )

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
    Raises  ValueError without an error of a measured number, or without emcee; SolveFailed where more than half of the
        trials fail
    Source  ensemble sampler with the stretch move: Goodman and Weare 2010, doi 10.2140/camcos.2010.5.65; Gaussian
        process in place of the model, its variance added to that of the errors: Kennedy and O'Hagan 2001, doi
        10.1111/1467-9868.00294
    """
    errors = np.array([m.error or 0.0 for m in measured])
    if not (errors > 0).all():
        missing = next(m.name for m in measured if not m.error)
        raise Refusal(f'measured.{missing}.error: a posterior needs the error of every measured number, such as "5 %"')
    box = _Box(tuple(parameters), dict(priors or {}))
    names = dict(predicted or {})
    target = np.log([m.value for m in measured])
    trials = _Trials(box, trial, len(target) + len(names))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)  # as many as there may be
        first = qmc.Sobol(len(parameters), seed=np.random.default_rng(seed)).random(
            min(FIRST * len(parameters), max_trials)
        )
    trials.make(first)
    while True:
        levels = trials.levels()
        chain, length = _chains(box, levels[: len(target)], target, errors, seed)
        spread = chain[:: max(len(chain) // 400, 1)]
        sure = _uncertainty(levels[: len(target)], errors, box.coordinates(spread))
        if sure.max() <= ENOUGH or trials.count + BATCH > max_trials:
            break
        trials.make(_spread_points(spread, sure, np.array(trials.shares)))
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


@dataclass(frozen=True)
class _Box:
    """The unknowns between their bounds as shares from 0 to 1."""

    parameters: tuple[FitParameter, ...]
    priors: dict[str, Marginal]

    def values(self, share: np.ndarray) -> list[float]:
        return [
            p.value(p.scaled(p.low) + float(s) * (p.scaled(p.high) - p.scaled(p.low)))
            for p, s in zip(self.parameters, share, strict=True)
        ]

    def coordinates(self, share: np.ndarray) -> np.ndarray:
        """Of order 1, for the processes."""
        return np.asarray(np.sqrt(12) * (share - 0.5))

    def log_prior(self, share: np.ndarray) -> np.ndarray:
        """(n,) of shares (n, k), up to a constant; -inf outside."""
        inside = ((share > 0) & (share < 1)).all(axis=1)
        density_sum = np.where(inside, 0.0, -np.inf)
        for i, p in enumerate(self.parameters):
            if p.name in self.priors and inside.any():
                law = self.priors[p.name]
                values = np.array([self.values(row)[i] for row in share[inside]])
                density = law.law.logpdf(values) + (np.log(values) if p.ratio else 0.0)  # of the unknown
                density_sum[inside] += np.where((values >= law.low) & (values <= law.high), density, -np.inf)
        return density_sum

    def width_of_prior(self, seed: int) -> np.ndarray:
        """(k,) standard deviations of the shares before anything was measured."""
        share = np.random.default_rng(seed).random((4000, len(self.parameters)))
        with np.errstate(invalid="ignore"):
            weight = np.exp(self.log_prior(share) - self.log_prior(share).max())
        mean = weight @ share / weight.sum()
        return np.asarray(np.sqrt(weight @ (share - mean) ** 2 / weight.sum()))


class _Trials:
    """Trials of the model, and the processes through the logarithms of their numbers."""

    def __init__(self, box: _Box, trial: Trial, width: int):
        self.box, self._trial, self._width = box, trial, width
        self.shares: list[np.ndarray] = []
        self._numbers: list[np.ndarray] = []
        self.failed = 0
        self._last_failure = ""

    @property
    def count(self) -> int:
        return len(self._numbers) + self.failed

    def make(self, shares: np.ndarray) -> None:
        for share in shares:
            values = dict(zip((p.name for p in self.box.parameters), self.box.values(share), strict=True))
            try:
                numbers = np.asarray(self._trial(values), float)
            except SolveFailed as failure:
                self.failed, self._last_failure = self.failed + 1, str(failure)
                continue
            if numbers.shape != (self._width,) or not (numbers > 0).all():
                raise Refusal(f"the model predicts {numbers.tolist()} instead of {self._width} numbers above 0")
            self.shares.append(share)
            self._numbers.append(np.log(numbers))
        if 2 * self.failed > self.count:
            raise SolveFailed(
                f"{self.failed} of {self.count} trials fail: narrow the bounds; the last: {self._last_failure}"
            )

    def levels(self) -> list[Surrogate]:
        points, numbers = self.box.coordinates(np.array(self.shares)), np.array(self._numbers)
        return [Surrogate.fitted(points, numbers[:, i]) for i in range(self._width)]


def _chains(
    box: _Box, levels: Sequence[Surrogate], target: np.ndarray, errors: np.ndarray, seed: int
) -> tuple[np.ndarray, float]:
    """Samples (n, k) as shares, and how many autocorrelation times the chains are long."""
    emcee = package("emcee")
    k = len(box.parameters)

    def log_probability(share: np.ndarray) -> np.ndarray:
        log_density = box.log_prior(share)
        good = np.isfinite(log_density)
        if good.any():
            coordinates = box.coordinates(share[good])
            for level, value, error in zip(levels, target, errors, strict=True):
                mean, deviation = level.mean_and_deviation(coordinates)
                variance = error**2 + deviation**2
                log_density[good] -= 0.5 * ((value - mean) ** 2 / variance + np.log(variance))
        return log_density

    draw = np.random.default_rng(seed)
    start = draw.random((4000, k))
    likely = log_probability(start)
    best = start[np.argsort(-likely)[: 2 * WALKERS]]  # the better ones of points all over the bounds
    first = best[draw.choice(len(best), WALKERS, replace=False)]
    sampler = emcee.EnsembleSampler(WALKERS, k, log_probability, vectorize=True)
    sampler.run_mcmc(emcee.State(first, random_state=np.random.RandomState(seed).get_state()), STEPS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        time = float(np.max(sampler.get_autocorr_time(tol=0)))
    chain = sampler.get_chain(discard=STEPS // 3, flat=True)
    chain = draw.permutation(chain)  # in the order of the walkers a stride would take some of them only
    return np.asarray(chain), STEPS / time if np.isfinite(time) else 0.0


def _uncertainty(levels: Sequence[Surrogate], errors: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
    """(n,) largest standard deviation of a process over the error of its measurement."""
    each = [level.mean_and_deviation(coordinates)[1] / error for level, error in zip(levels, errors, strict=True)]
    return np.asarray(np.max(each, axis=0))


def _spread_points(share: np.ndarray, uncertainty: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """(BATCH, k) of the samples: uncertain ones far from each other and from what is known."""
    chosen, taken_points = [], trials
    for _ in range(BATCH):
        distance = np.min(np.linalg.norm(share[:, None] - taken_points[None], axis=2), axis=1)
        best = int(np.argmax(uncertainty * distance))
        chosen.append(share[best])
        taken_points = np.vstack([taken_points, share[best]])
    return np.array(chosen)


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
