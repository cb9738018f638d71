"""A surrogate of a life over what scatters: quantiles with the ends of their confidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from tribodyn.refusal import SolveFailed
from tribodyn.workflows.studies.many import quantiles
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.quantiles import Sample
from tribodyn.workflows.studies.many.study_table import StudyTable
from tribodyn.workflows.studies.many.surrogate import Law, Surrogate

PROBED, TOLERANCE = 1.1, 1e-3  # factor on keys that may scale it, and how far its logarithm may be off from that

RATIOS = 64  # equally likely values of a key that scales a life


@dataclass(frozen=True)
class Quantile:
    """The value that a share of the parts falls below.

    low, high : of the wanted confidence, from the surrogate and the runs that are missing
    low_in_all, high_in_all : with the model's own error as well; the same where that is not known
    at_least : runs ended before what they were to tell, or survived, and the quantile may be one of theirs"""

    share: float
    value: float
    low: float
    high: float
    low_in_all: float
    high_in_all: float
    at_least: bool

    @property
    def name(self) -> str:
        """Such as P10."""
        return f"P{100 * self.share:.6g}"


@dataclass(frozen=True)
class LifeFit:
    """A surrogate of a number, over a space.

    drawn : (n,) whether a run was drawn from the distribution, not added where it says most about a quantile
    share_sought : the share that runs were added for; None where none were
    logarithmic : of its logarithm; open : runs of which only a lower bound is known, bound : the lowest of them
    failed : share of runs without
    scaled : keys whose common factor a life is in proportion to the reciprocal of, one set after the other
    by_ratio : (n,) what a key that scales by itself adds to each run; ratios : (m,) what it adds to equally likely ones
    """

    space: ParameterSpace
    surrogate: Surrogate
    drawn: np.ndarray
    share_sought: float | None
    logarithmic: bool
    bound: float
    open: int
    runs: int
    failed: float
    scaled: tuple[tuple[str, ...], ...]
    by_ratio: np.ndarray
    ratios: np.ndarray

    def ends(
        self, sample: Sample, share: float, at: float, draws: np.ndarray, confidence: float
    ) -> tuple[float, float]:
        """Ends of the quantile of a share: the outer ones by the surrogate and by counting runs.

        Where runs were added about a quantile, the surrogate's ends stand alone: those runs have shown it how the
        number varies there, and counting would take hundreds of drawn runs to be as sure.
        at : the share among runs that have the number; draws : of the quantile, by the surrogate"""
        low, high = np.quantile(draws, [0.5 - confidence / 2, 0.5 + confidence / 2])
        if share == self.share_sought:
            return float(low), float(high)
        of = self.surrogate
        values, predictions = ((x - self.by_ratio)[self.drawn, None] + self.ratios for x in (of.values, of.left_out))
        lowest, highest = quantiles.counted(sample, values, predictions, at, confidence)
        return float(min(low, lowest)), float(max(high, highest))

    def at_least(self, share: float, high: float, confidence: float) -> bool:
        """Whether a quantile may belong to values of which only a lower bound is known.

        So where its upper end reaches one of them, and where as many parts as its share leaves may have such values:
        the surrogate is smooth, and a part that survives is not a part that lives a little longer"""
        if not self.open:
            return False
        # Clopper and Pearson 1934
        share_open = stats.beta.ppf(0.5 + confidence / 2, self.open + 1, self.runs - self.open)
        return bool(high >= self.bound or share >= 1 - share_open)

    @classmethod
    def of(
        cls, space: ParameterSpace, table: StudyTable, number: str, drawn: int, share_sought: float,
        groups: Sequence[tuple[str, ...]],
    ) -> LifeFit:  # fmt: skip
        values, bounds = table.bounded(number)
        open_ = np.isfinite(bounds)
        good = np.isfinite(values)
        if not good.any():
            raise SolveFailed(f"no run has a {number}; the first: {table.columns['sentence'][0]}")
        logarithmic = bool((values[good] > 0).all())
        probed = np.log(PROBED * values[drawn + 1 : drawn + 1 + len(groups)] / values[drawn]) if groups else ()
        scaled = tuple(group for group, off in zip(groups, probed, strict=True) if abs(off) < TOLERANCE)
        space = replace(space, ratios=tuple(key for group in scaled for key in group))
        laws = [Law(np.isin(space.keys, group) / space.widths, -1.0) for group in scaled]
        numbers, points = values[good], space.coordinates(space.points_of(table.columns)[good])
        slopes = space.slopes_of(table.columns, number)[good]
        if logarithmic:
            numbers, slopes = np.log(numbers), slopes / numbers[:, None]
        surrogate = Surrogate.fitted(points, numbers, None if laws else slopes, tuple(laws))
        single_law = [law for group, law in zip(scaled, laws, strict=True) if len(group) == 1][:1]
        share = np.repeat(((np.arange(RATIOS) + 0.5) / RATIOS)[:, None], len(space.keys), axis=1)
        likely, runs = space.coordinates(space.values(share)), table.columns["run"][good]
        by_ratio = (single_law[0].values(each) if single_law else np.zeros(1) for each in (points, likely))
        return cls(
            space, surrogate, runs <= drawn, share_sought if runs.max() > drawn + len(groups) + 1 else None,
            logarithmic, float(np.min(bounds, initial=np.inf, where=open_)), int(open_.sum()), int(good.sum()),
            1 - float(np.mean(good)), scaled, *by_ratio,
        )  # fmt: skip


def half_width(life_fit: LifeFit, sample: Sample, share: float, confidence: float) -> float:
    """Half the confidence interval of a quantile, relative."""
    low, high = life_fit.ends(sample, share, share, quantiles.drawn(sample, life_fit.surrogate, share), confidence)
    if life_fit.logarithmic:
        return float(np.exp(0.5 * (high - low)) - 1)
    return float(0.5 * (high - low) / max(abs(sample.quantile(share)), 1e-300))


def quantile_of(life_fit: LifeFit, sample: Sample, share: float, confidence: float, error: float | None) -> Quantile:
    """One quantile; runs that are missing may all lie below it or all above it."""
    lowest_share = max((share - life_fit.failed) / (1 - life_fit.failed), 0.0)
    highest_share = min(share / (1 - life_fit.failed), 1.0)
    ends = []
    for at, side in ((lowest_share, 0), (highest_share, 1)):
        draws = quantiles.drawn(sample, life_fit.surrogate, at)
        end = life_fit.ends(sample, share, at, draws, confidence)[side]
        tails = 0.5 - confidence / 2, 0.5 + confidence / 2
        shift = np.quantile(_shifted(draws, error, life_fit.logarithmic), tails[side]) - np.quantile(draws, tails[side])
        ends.append((end, end + float(shift)))
    back = np.exp if life_fit.logarithmic else float
    (own_low, all_low), (own_high, all_high) = ([float(back(end)) for end in side] for side in ends)
    if lowest_share == 0 and life_fit.failed:
        own_low = all_low = 0.0 if life_fit.logarithmic else -np.inf
    # the median of the draws: the expected function is smoother than what it stands for, and its own quantiles too near
    value = float(back(np.median(quantiles.drawn(sample, life_fit.surrogate, share))))
    least = life_fit.at_least(share, own_high, confidence)
    return Quantile(share, value, own_low, own_high, all_low, all_high, least)


def _shifted(draws: np.ndarray, error: float | None, logarithmic: bool) -> np.ndarray:
    """Draws of a quantile with the model's own error as well: one unknown factor for all of them.

    Its size is evenly distributed, as a verdict's error is a sum of parts without their signs: between 1 - error and
    1 + error, or, where draws are logarithms, between 1 and 1 + error or the reciprocal of that, which stays positive
    """
    if not error:
        return draws
    off = np.random.default_rng(1).uniform(-1, 1, len(draws))
    return draws + (np.sign(off) * np.log1p(error * np.abs(off)) if logarithmic else error * off * np.abs(draws))
