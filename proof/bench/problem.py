"""A problem of the bench, read from its file; the format stands in README.md."""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

FOLDER = Path(__file__).parent
COMPONENTS = ("t1", "t2", "n")


@dataclass(frozen=True)
class Element:
    """Its force f acts on the structure as - rows^T f, with u = rows q, (n_component, n); numbers not given are 0."""

    law: str
    components: tuple[str, ...]
    rows: np.ndarray
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class Problem:
    """Matrices (n, n), vectors (n,), loads : order -> (cos, sin), and what is asked, see README.md; SI, rad/s."""

    name: str
    title: str
    about: str
    source: str
    truth: str
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    output: np.ndarray
    static: np.ndarray
    loads: Mapping[int, tuple[np.ndarray, np.ndarray]]
    elements: tuple[Element, ...]
    orders: tuple[int, ...]
    samples: int
    curve: tuple[float, float]
    points: tuple[float, ...]
    start: tuple[float, np.ndarray, np.ndarray] | None

    @property
    def is_rigid(self) -> bool:
        """Whether an element is set-valued."""
        return any(np.isinf(list(element.numbers.values())).any() for element in self.elements)


def names() -> list[str]:
    """Names of all problems."""
    return sorted(path.stem for path in (FOLDER / "problems").glob("*.toml"))


def read(name: str) -> Problem:
    """The problem of a name."""
    table = tomllib.loads((FOLDER / "problems" / f"{name}.toml").read_text(encoding="utf-8"))
    n = len(_matrix(table["stiffness"]))

    def vector(value: Any) -> np.ndarray:
        """From all n numbers, or DOF -> number."""
        if isinstance(value, list):
            return np.array(value, float)
        full = np.zeros(n)
        full[[int(dof) for dof in value]] = list(value.values())
        return full

    def element(entry: dict[str, Any]) -> Element:
        components = tuple(component for component in COMPONENTS if component in entry)
        numbers = {key: float(value) for key, value in entry.items() if key not in (*COMPONENTS, "law")}
        rows = np.array([vector(entry[component]) for component in components])
        return Element(entry["law"], components, rows, defaultdict(float, numbers))

    ask, start = table["ask"], table.get("start")
    return Problem(
        name, table["title"], table["about"], table["source"], ask["truth"],
        *(_matrix(table.get(key, np.zeros((n, n)))) for key in ("mass", "damping", "stiffness")),
        vector(table["output"]), vector(table.get("static", {})),
        {load["order"]: (vector(load.get("cos", {})), vector(load.get("sin", {}))) for load in table["load"]},
        tuple(map(element, table["element"])),
        tuple(ask["orders"]), ask["samples"], tuple(ask["curve"]), tuple(ask["points"]),
        start and (start["frequency"], vector(start["cos"]), vector(start["sin"])),
    )  # fmt: skip


def _matrix(value: Any) -> np.ndarray:
    """From rows, or the name of a Matrix Market file."""
    if isinstance(value, str):
        value = scipy.io.mmread(FOLDER / "problems" / value).toarray()
    return np.array(value, float)
