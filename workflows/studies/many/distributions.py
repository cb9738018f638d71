"""Distributions that a number of a scene is drawn from, in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import stats

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import units
from tribodyn.workflows.scene.fields import Table

NumberWithUnit = float | str

# kind -> numbers that it must have, numbers of which one must be there, numbers that it may have
NUMBERS: dict[str, tuple[set[str], set[str], set[str]]] = {
    "uniform": ({"low", "high"}, set(), set()),
    "loguniform": ({"low", "high"}, set(), set()),
    "triangular": ({"low", "mode", "high"}, set(), set()),
    "normal": ({"mean"}, {"std", "cov"}, {"low", "high"}),
    "lognormal": ({"median", "cov"}, set(), {"low", "high"}),
}


class Distribution(Table):
    """A distribution as a study gives it; numbers have units, or are in SI."""

    distribution: Literal["uniform", "loguniform", "normal", "lognormal", "triangular"]
    low: NumberWithUnit | None = None
    """Smallest value; of a normal or lognormal one, where it is truncated."""
    high: NumberWithUnit | None = None
    """Largest value; of a normal or lognormal one, where it is truncated."""
    mode: NumberWithUnit | None = None
    """Most likely value."""
    mean: NumberWithUnit | None = None
    """Mean, before it is truncated."""
    median: NumberWithUnit | None = None
    """Median, before it is truncated."""
    std: NumberWithUnit | None = None
    """Standard deviation, before it is truncated."""
    cov: NumberWithUnit | None = None
    """Coefficient of variation, standard deviation over mean, before it is truncated, such as "10 %"."""


@dataclass(frozen=True)
class Marginal:
    """A distribution of a number in SI units, truncated to [low, high]; logarithmic : one of its logarithm."""

    law: Any
    low: float = -math.inf
    high: float = math.inf
    logarithmic: bool = False

    @classmethod
    def of(cls, table: Distribution) -> Marginal:
        """The distribution of a table; raises Refusal with a sentence."""
        names = {name for name in table.model_fields_set if name != "distribution"}
        must, one_of, may = NUMBERS[table.distribution]
        wants = ", ".join([*sorted(must), *([" or ".join(sorted(one_of, reverse=True))] if one_of else [])])
        if not must <= names or (one_of and len(names & one_of) != 1) or names - must - one_of - may:
            optional = f", and may have {' and '.join(sorted(may, reverse=True))}" if may else ""
            raise Refusal(f"a {table.distribution} distribution needs {wants}{optional}; this has {_describe(names)}")
        n = _numbers({name: getattr(table, name) for name in names})
        if "low" in n and "high" in n and not n["low"] < n["high"]:
            raise Refusal(f"low {table.low} is not below high {table.high}")
        for name in ("std", "cov"):
            if name in n and not n[name] > 0:
                raise Refusal(f"{name} {getattr(table, name)} is not above 0")
        if table.distribution == "uniform":
            return cls(stats.uniform(n["low"], n["high"] - n["low"]))
        if table.distribution == "loguniform":
            if not n["low"] > 0:
                raise Refusal(f"low {table.low} is not above 0")
            return cls(stats.loguniform(n["low"], n["high"]), logarithmic=True)
        if table.distribution == "triangular":
            width = n["high"] - n["low"]
            if not n["low"] <= n["mode"] <= n["high"]:
                raise Refusal(f"mode {table.mode} is not between low {table.low} and high {table.high}")
            return cls(stats.triang((n["mode"] - n["low"]) / width, n["low"], width))
        ends = n.get("low", -math.inf), n.get("high", math.inf)
        if table.distribution == "normal":
            deviation = n["std"] if "std" in n else n["cov"] * abs(n["mean"])
            if not deviation > 0:
                raise Refusal("a cov of a mean of 0 is no deviation: give std")
            numbers = cls(stats.norm(n["mean"], deviation), *ends)
        else:
            if not n["median"] > 0:
                raise Refusal(f"median {table.median} is not above 0")
            # coefficient of variation v of a lognormal variable: v^2 = exp(s^2) - 1
            numbers = cls(
                stats.lognorm(math.sqrt(math.log1p(n["cov"] ** 2)), scale=n["median"]), *ends, logarithmic=True
            )
        if not numbers.law.cdf(numbers.high) - numbers.law.cdf(numbers.low) > 0:
            raise Refusal("nothing is left of the distribution between low and high")
        return numbers

    def at(self, share: np.ndarray) -> np.ndarray:
        """Quantiles; share : (n,) in (0, 1)."""
        share_below, upto = self.law.cdf(self.low), self.law.cdf(self.high)
        return np.clip(self.law.ppf(share_below + share * (upto - share_below)), self.low, self.high)

    def share(self, values: np.ndarray) -> np.ndarray:
        """Shares (n,) below values (n,); the inverse of `at`."""
        share_below, upto = self.law.cdf(self.low), self.law.cdf(self.high)
        return np.asarray((self.law.cdf(values) - share_below) / (upto - share_below))


def _describe(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none of them"


def _numbers(names: dict[str, NumberWithUnit]) -> dict[str, float]:
    """The numbers in SI units; all but the coefficient of variation in the same one."""
    numbers = {"cov": units.to_si(names["cov"], "")} if "cov" in names else {}
    unit = {name: unit_of(value) for name, value in names.items() if name != "cov"}
    if len(set(unit.values())) > 1:
        raise Refusal("its numbers have different units: " + ", ".join(f"{n} {names[n]}" for n in unit))
    return numbers | {name: units.to_si(names[name], of) for name, of in unit.items()}


def unit_of(value: NumberWithUnit) -> str:
    """The unit that a scene counts a quantity in; raises Refusal where it is no quantity."""
    if not isinstance(value, str):
        return ""
    match = units.NUMBER.match(value)
    if match is None:
        raise Refusal(f'"{value}" is not a number with a unit')
    dimension = units.parse_unit(match[2]).dimension
    for unit in units.EXAMPLES:
        if units.parse_unit(unit).dimension == dimension:
            return unit
    raise Refusal(f'no key of a scene has the unit of "{value}"')


def si(value: Any) -> float | None:
    """A value of a list as a number in SI units, None where it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return units.to_si(value, unit_of(value))
    except Refusal:
        return None
