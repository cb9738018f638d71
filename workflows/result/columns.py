"""Named columns of numbers as a file of comma-separated values, and names with values as lines."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np


def write_columns(columns: Mapping[str, Any], path: Path) -> None:
    """Write columns (n,) of the same length under their names, numbers with all their digits."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True))


def named_lines(values: Iterable[tuple[str, str]], width: int = 14) -> list[str]:
    """Names and values in two columns."""
    return [f"{name:{width}} {value}" for name, value in values]
