"""Numbers that a run can state: what one is computed from, what it declares, and how it is found by its name.

A quantity is a file `hbm/quantities/<name>.py` that ends with `QUANTITY = ...`, one of the three classes below. Which
class says what the number belongs to: a solved cycle, a worn contact or a response curve. No other file names a
quantity: summary, JSON, text, report, errors, columns of studies and derivatives are loops over them."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from tribodyn import declarations
from tribodyn.hbm.quantity_sources import (
    MotionInTime as MotionInTime,
    Slopes as Slopes,
    SolvedCurve as SolvedCurve,
    SolvedCycle as SolvedCycle,
    WornContact as WornContact,
)
from tribodyn.plugins import PluginKind
from tribodyn.refusal import Refusal

FILES = PluginKind("quantity", "tribodyn.hbm.quantities", ())


class ErrorKind(StrEnum):
    """Which refinements of a scene say how far a quantity may be off."""

    NONE = "no error is stated"
    CYCLE = "the cycle is solved again with more elements, modes, harmonics and samples"
    UNSAMPLED_CYCLE = "the same; time samples of the contact law do not move it"
    DEPTH = "the wear run is repeated on another mesh with finer steps; error of the steps in depth"
    DURATION = "the same; error of the steps in cycles, and scatter of motions in time"


@dataclass(frozen=True)
class StatedQuantity:
    """What every quantity declares; `name` is that of its file.

    title : for axes and headings; unit : SI, "cycles", or empty
    by_joint, by_place : whether each named contact, or each place of the part, has its own
    relative : whether its changes count over its value
    error : how its error is found; rank : place in tables, ascending
    headline : whether the short summary gives it; digits : significant ones of a value whose error is not known
    where : what the value is of -> node or name of the place of the part whose stress it is, "" or None for none
    order : of its convergence with the element size, where that is not the one of the error rule"""

    title: str
    unit: str
    value: Callable[[Any], float | None]
    by_joint: bool = False
    by_place: bool = False
    relative: bool = True
    error: ErrorKind = ErrorKind.NONE
    rank: int = 99
    headline: bool = True
    digits: int = 3
    where: Callable[[Any], int | str] | None = None
    order: float | None = None
    name: str = ""

    @property
    def label(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class CycleQuantity(StatedQuantity):
    """A number of a solved cycle: a run states it before wear, at the end of wear, at the highest stable point.

    value : SolvedCycle -> number, None where the cycle does not hold it
    slopes : SolvedCycle -> Slopes, for exact derivatives; in_time : MotionInTime -> the number along it, and the least
        one that a difference counts over
    at_rest : whether it has a value without vibration"""

    value: Callable[[SolvedCycle], float | None]
    slopes: Callable[[SolvedCycle], Slopes] | None = None
    in_time: Callable[[MotionInTime], tuple[float, float]] | None = None
    at_rest: bool = False


@dataclass(frozen=True)
class WearQuantity(StatedQuantity):
    """A number of a whole wear run.

    value : WornContact -> number, None where there is none
    grows : whether it has a value at every row of the history, so that it is drawn against the cycles
    remark : WornContact -> what a reader should know of the value, such as where a life ends
    applies : WornContact -> whether its scene gives rise to the number; None: every one that wears"""

    value: Callable[[WornContact], float | None]
    grows: bool = False
    remark: Callable[[WornContact], str] | None = None
    applies: Callable[[WornContact], bool] | None = None


@dataclass(frozen=True)
class CurveQuantity(StatedQuantity):
    """A number of a whole response curve; value : SolvedCurve -> number, None where there is none."""

    value: Callable[[SolvedCurve], float | None]


def largest_of(numbers: Callable[[Any], Mapping[Any, float]]) -> dict[str, Any]:
    """What a quantity declares that is the largest of some numbers, each of a node or of a named place of the part."""

    def where(source: Any) -> int | str:
        values = numbers(source)
        return max(values, key=values.__getitem__, default="")

    return {"value": lambda source: max(numbers(source).values(), default=None), "where": where}


Kinds = TypeVar("Kinds", bound=StatedQuantity)
_files: list[Path] = []


def use(file: Path) -> None:
    """Add a quantity of one's own, a file beside a scene, to those that runs state."""
    _files.append(Path(file))
    load.cache_clear()
    _all.cache_clear()


def forget(file: Path) -> None:
    """Take a quantity of one's own out again."""
    _files.remove(Path(file))
    load.cache_clear()
    _all.cache_clear()


@cache
def load(name: str) -> StatedQuantity:
    """The quantity of this name; raises Refusal with the known names."""
    for file in _files:
        if file.stem == name:
            quantity = getattr(declarations.run_file(file, FILES.title, FILES.functions), "QUANTITY", None)
            break
    else:
        FILES.file_of(name)
        quantity = importlib.import_module(f"{FILES.package}.{name}").QUANTITY
    if not isinstance(quantity, StatedQuantity):
        raise Refusal(f"quantity file '{name}.py' has no QUANTITY = CycleQuantity(...) or another class of its kind")
    return replace(quantity, name=name)


@cache
def _all() -> tuple[StatedQuantity, ...]:
    names = [*FILES.names(), *(file.stem for file in _files)]
    return tuple(sorted(map(load, names), key=lambda q: (q.rank, q.name)))


def quantities_of(kind: type[Kinds]) -> tuple[Kinds, ...]:
    """All quantities of a kind, by rank."""
    return tuple(q for q in _all() if isinstance(q, kind))


def with_error(kind: type[Kinds]) -> tuple[Kinds, ...]:
    """The quantities of a kind whose errors are stated."""
    return tuple(q for q in quantities_of(kind) if q.error is not ErrorKind.NONE)


def of_wear_with_error(worn: WornContact | None) -> tuple[WearQuantity, ...]:
    """The quantities of a whole wear that its scene gives rise to, and whose errors are stated."""
    return tuple(q for q in with_error(WearQuantity) if q.applies is None or (worn is not None and q.applies(worn)))


def names_with_error(*kinds: type[StatedQuantity]) -> tuple[str, ...]:
    """Names of the quantities of some kinds, or of all, whose errors are stated, those of a cycle first."""
    return tuple(q.name for kind in kinds or (CycleQuantity, WearQuantity) for q in with_error(kind))


def quantity_named(name: str) -> StatedQuantity:
    """The quantity of this name; one of a result whose file is not there any more has its name and no unit."""
    return next((q for q in _all() if q.name == name), StatedQuantity(name, "", lambda _: None, name=name))
