"""Numbers for readers, with a prefix and as many digits as their error allows; columns with all digits, as a file."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.output_file import cell, replacing

PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}
COUNTED = {9: " billion", 6: " million", 0: ""}
BLOCKS = "▁▂▃▄▅▆▇█"
# digits of a value whose error was looked for in vain, of one without, at the most
UNKNOWN, DEFAULT_DIGITS, LARGEST_DIGITS = 2, 3, 6


def write_columns(columns: Mapping[str, Any], path: Path) -> None:
    """Write columns (n,) of the same length under their names, numbers with all their digits."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(map(cell, columns))
        table.writerows(zip(*(map(cell, np.asarray(column).tolist()) for column in columns.values()), strict=True))


def named_lines(values: Iterable[tuple[str, str]], width: int = 14) -> list[str]:
    """Names and values in two columns."""
    return [f"{name:{width}} {value}" for name, value in values]


def digits(error: float | None, default: int = DEFAULT_DIGITS) -> int:
    """Significant digits of a value with a relative error: the last one is about as uncertain as the error says."""
    if error is None or not np.isfinite(error):
        return default
    return LARGEST_DIGITS if error <= 0 else int(np.clip(1 + np.ceil(-np.log10(error)), UNKNOWN, LARGEST_DIGITS))


def rounded(value: float, count: int = DEFAULT_DIGITS) -> str:
    """A number with so many significant digits and no exponent; thousands apart from 10 000 on."""
    if not np.isfinite(value) or value == 0:
        return f"{value:g}"
    places = count - 1 - int(np.floor(np.log10(float(f"{abs(value):.{count - 1}e}"))))
    shown = round(value, places)
    return f"{shown:,.{max(places, 0)}f}".replace(",", " " if abs(shown) >= 1e4 else "")


def measured(value: float, unit: str, count: int = DEFAULT_DIGITS) -> str:
    """A quantity in SI with a prefix: 0.951 mm, 796 Hz, 7.38 kN, 2240 mm³, 22 million cycles.

    unit : m, m2 and m3 are given in mm, mm² and mm³, small lengths in µm; Hz without a prefix below 10 kHz"""
    if unit == "cycles":
        power = next((power for power in COUNTED if abs(value) >= 10.0**power), 0)
        return f"{rounded(value / 10.0**power, count)}{COUNTED[power]} cycles"
    if unit in ("m2", "m3"):
        return f"{rounded(value * 1e3 ** int(unit[1]), count)} mm{'²' if unit == 'm2' else '³'}"
    if unit == "m" and 1e-4 <= abs(value) < 10:
        return f"{rounded(1e3 * value, count)} mm"
    size = abs(value) / 10 if unit == "Hz" else abs(value)
    power = next((power for power in PREFIXES if size >= 10.0**power), 0)
    return f"{rounded(value / 10.0**power, count)} {PREFIXES[power]}{unit}"


def axis_unit(unit: str) -> tuple[str, float]:
    """The unit that an axis has for one in SI, and the factor on its values: lengths in mm."""
    return {"m": ("mm", 1e3), "m3": ("mm³", 1e9)}.get(unit, (unit or "1", 1.0))


def sparkline(x: np.ndarray, y: np.ndarray, width: int = 20) -> str:
    """A curve in one line of blocks: the largest y in each of `width` parts of x, from the left, on a log scale."""
    part = np.minimum((width * (x - x.min()) / max(np.ptp(x), 1e-300)).astype(int), width - 1)
    level = np.full(width, -np.inf)
    np.maximum.at(level, part, np.log(np.maximum(y, 1e-300)))
    low, high = level[np.isfinite(level)].min(), level.max()
    marks = [
        " " if not np.isfinite(v) else BLOCKS[int((len(BLOCKS) - 1) * (v - low) / max(high - low, 1e-300))]
        for v in level
    ]
    return "".join(marks)
