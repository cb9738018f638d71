"""Quantities with units: converted to SI once, where a scene is read.

A quantity is a bare number in the SI unit of its key, or a text such as "470 N/um", "2e3 um3/J", "1 %".
Angles are a dimension of their own, so that "400 Hz" and "2513 rad/s" are the same frequency and neither is 1/s.
Factors are exact fractions, so that "2e3 um3/J" is 2e-15 to the last bit."""

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from tribodyn.refusal import Refusal

Dimension = tuple[int, int, int, int, int]  # exponents of kg, m, s, turn, K

PREFIXES = {name: Fraction(10) ** power for name, power in dict(n=-9, u=-6, m=-3, c=-2, k=3, M=6, G=9).items()}

# name -> (SI factor, dimension, prefixes that may stand before it)
UNITS: dict[str, tuple[Fraction, Dimension, str]] = {
    "m": (Fraction(1), (0, 1, 0, 0, 0), "numck"),
    "in": (Fraction("0.0254"), (0, 1, 0, 0, 0), ""),
    "ft": (Fraction("0.3048"), (0, 1, 0, 0, 0), ""),
    "g": (Fraction(1, 1000), (1, 0, 0, 0, 0), "umk"),
    "t": (Fraction(1000), (1, 0, 0, 0, 0), ""),
    "s": (Fraction(1), (0, 0, 1, 0, 0), "num"),
    "min": (Fraction(60), (0, 0, 1, 0, 0), ""),
    "h": (Fraction(3600), (0, 0, 1, 0, 0), ""),
    "N": (Fraction(1), (1, 1, -2, 0, 0), "numkMG"),
    "lbf": (Fraction("4.4482216152605"), (1, 1, -2, 0, 0), ""),
    "gn": (Fraction("9.80665"), (0, 1, -2, 0, 0), ""),  # standard gravity; g is a gram
    "Pa": (Fraction(1), (1, -1, -2, 0, 0), "kMG"),
    "J": (Fraction(1), (1, 2, -2, 0, 0), "numkM"),
    "Hz": (Fraction(1), (0, 0, -1, 1, 0), "mkM"),
    "rpm": (Fraction(1, 60), (0, 0, -1, 1, 0), ""),
    "rad": (Fraction(1 / (2 * math.pi)), (0, 0, 0, 1, 0), "m"),
    "deg": (Fraction(1, 360), (0, 0, 0, 1, 0), ""),
    "K": (Fraction(1), (0, 0, 0, 0, 1), "mk"),
    "%": (Fraction(1, 100), (0, 0, 0, 0, 0), ""),
}

NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*$")
LARGEST = 1e25  # in SI units: above it products of quantities overflow, and no structure has it
SMALLEST = 1e-60  # and what is meant to be zero: its square, or another number over it, leaves the range of numbers
CACHE_SIZE = 4096  # texts that were converted: a study reads its scene thousands of times
OUTSIDE = r"(?![^()]*\))"  # of brackets
FACTOR = re.compile(r"(%|[A-Za-z]+|\([^()]+\))(?:\^?(-?\d))?$")


@dataclass(frozen=True)
class Unit:
    """SI factor and dimension of a unit expression."""

    factor: Fraction
    dimension: Dimension


@lru_cache(maxsize=CACHE_SIZE)
def parse_unit(text: str) -> Unit:
    """Read a unit expression such as "N/um", "um3/J", "kg/m^3" or "" (dimensionless).

    Factors are separated by "*", "·" or a blank; everything after a "/" up to the next "/" divides; a factor may stand
    in brackets.
    Raises  ValueError: a factor is not a known unit"""
    factor, dimension = Fraction(1), [0, 0, 0, 0, 0]
    plain = text.replace("µ", "u").replace("μ", "u").replace("³", "3").replace("²", "2")
    for position, group in enumerate(re.split(rf"/{OUTSIDE}", plain)):
        sign = -1 if position else 1
        for item in re.split(rf"[*·\s]+{OUTSIDE}", group.strip()):
            if item in ("", "1"):
                continue
            match = FACTOR.match(item)
            if match is None:
                raise Refusal(f'"{item}" is not a unit')
            unit_of_item = parse_unit(match[1][1:-1]) if match[1].startswith("(") else _lookup(match[1])
            power = sign * int(match[2] or 1)
            factor *= unit_of_item.factor**power
            dimension = [d + power * e for d, e in zip(dimension, unit_of_item.dimension, strict=True)]
    return Unit(factor, (dimension[0], dimension[1], dimension[2], dimension[3], dimension[4]))


def _lookup(name: str) -> Unit:
    if name in UNITS:
        return Unit(*UNITS[name][:2])
    prefix, base = name[:1], name[1:]
    if base in UNITS and prefix in UNITS[base][2]:
        return Unit(PREFIXES[prefix] * UNITS[base][0], UNITS[base][1])
    raise Refusal(f'"{name}" is not a unit')


def to_si(value: object, unit: str) -> float:
    """Convert a number or a text with a unit to a number in `unit`.

    value : int or float, taken to be in `unit`, or a text "number unit"
    unit : the unit the receiver counts in, e.g. "N/m"; "" for a pure number
    Returns a finite float
    Raises  ValueError: not a number, unknown unit, or another dimension; the message reads after "key: "
    """
    if isinstance(value, str):
        return _text_to_si(value, unit)
    parse_unit(unit)  # a unit of a file of one's own may be none
    expected = f"expected {_describe(unit)}"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Refusal(f"{expected}, got {value!r}")
    if not abs(value) < LARGEST:
        raise Refusal(f"{expected}, got {value}, beyond what a structure has")
    if 0 < abs(value) < SMALLEST:
        raise Refusal(f"{expected}, got {value}: give 0, or more than {SMALLEST:g}")
    return float(value)


@lru_cache(maxsize=CACHE_SIZE)
def _text_to_si(value: str, unit: str) -> float:
    target_unit, expected = parse_unit(unit), f"expected {_describe(unit)}"
    match = NUMBER.match(value)
    if match is None:
        raise Refusal(f'{expected}, got "{value}"')
    if not match[2] and target_unit.dimension != (0, 0, 0, 0, 0):
        raise Refusal(f'{expected}, got "{value}" without a unit')
    try:
        source_unit = parse_unit(match[2])
    except Refusal as error:
        raise Refusal(f'{expected}, got "{value}" in which {error}') from None
    if source_unit.dimension != target_unit.dimension:
        raise Refusal(f'{expected}, got "{value}" which is {_name(source_unit.dimension)}')
    exact = Fraction(match[1]) * source_unit.factor / target_unit.factor
    if not abs(exact) < LARGEST:
        raise Refusal(f'{expected}, got "{value}", beyond what a structure has')
    if 0 < abs(exact) < SMALLEST:
        raise Refusal(f'{expected}, got "{value}": give 0, or more than {SMALLEST:g}')
    return float(exact)


EXAMPLES = {
    "m": ("a length", "20 mm"),
    "N": ("a force", "20 kN"),
    "N/m": ("a stiffness", "470 N/um"),
    "Pa": ("a pressure", "210 GPa"),
    "kg/m3": ("a density", "7860 kg/m3"),
    "m3/J": ("a wear coefficient", "2e3 um3/J"),
    "Hz": ("a frequency", "410 Hz"),
    "rad": ("an angle", "90 deg"),
    "s": ("a time", "2 ms"),
    "1/s": ("a rate", "5 1/s"),
    "J": ("an energy", "3 J"),
    "kg": ("a mass", "3 kg"),
    "kg m2": ("a moment of inertia", "2e-4 kg m2"),
    "m/s2": ("an acceleration", "9.81 m/s2"),
    "N m": ("a moment", "12 N m"),
    "K": ("a temperature difference", "80 K"),
    "1/K": ("a coefficient of expansion", "12e-6 1/K"),
    "": ("a number", "0.5"),
}


def _describe(unit: str) -> str:
    name, example = EXAMPLES.get(unit, (f"a quantity in {unit}", f"1 {unit}"))
    if not unit:
        return f'{name} such as {example} or "{float(example):.0%}"'.replace("%", " %")
    return f'{name} such as "{example}" or a bare number in {unit}'


def _name(dimension: Dimension) -> str:
    for unit, (name, _) in EXAMPLES.items():
        if parse_unit(unit).dimension == dimension:
            return name
    symbols = zip(("kg", "m", "s", "turn", "K"), dimension, strict=True)
    return "in " + " ".join(f"{symbol}^{power}" for symbol, power in symbols if power)
