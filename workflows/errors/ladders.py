"""Settings of a scene that trade speed for accuracy, ladders from coarse to fine, and where their answers tend to."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.optimize import brentq

from tribodyn.hbm.contact import contact_law
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number, Table
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene, Scene

TOPS = (1, 3, 5, 7, 9, 13)  # highest harmonic kept
WORN_TOP = 5  # more harmonics take minutes to wear
SAMPLES = (32, 64, 256)
NEWTON = (1e-4, 1e-6, 1e-8)
CUTOFFS = (0.25, 0.5, 1, 2)  # over that of the scene
RANKS = (3, 6, 12, 24)
WEAR_TOLERANCES = (0.3, 0.1, 0.03, 0.01, 0.003)
EXACT = float("nan")  # size of a setting that leaves no error
ORDERS = (0.5, 4.0)  # slower is not taken for settling; faster is not relied on
SAFETY = 0.25  # of the extrapolated remainder that stays in doubt (Roache: a factor of 1.25 on three grids)
SMALLEST = 1e-3  # size of a setting that leaves all out
ROUNDING = 1e-9  # relative difference that means nothing
STIFFER = tuple(4.0**power for power in range(6))  # springs over those of the scene, towards rigid
SPRINGS = "contact_stiffness"


@dataclass(frozen=True)
class Setting:
    """Overrides of a scene, and how fine they are: errors fall with a power of size; name : None for the overrides."""

    size: float
    overrides: tuple[str, ...]
    name: str | None = None

    @property
    def label(self) -> str:
        """The name, or the overrides without their sections."""
        if self.name is not None:
            return self.name
        parts = [text.partition("=") for text in self.overrides]
        return ", ".join(f"{key.rpartition('.')[2]}={value}" for key, _, value in parts)


@dataclass(frozen=True)
class Ladder:
    """Settings of one thing, from coarse to fine; equal sizes are other placements of the nodes.

    base : overrides under which it is measured, None for those of the study
    worn_up_to : size up to which depth and life are measured too"""

    name: str
    settings: tuple[Setting, ...]
    base: tuple[str, ...] | None = None
    worn_up_to: float = math.inf

    def wears(self, setting: Setting) -> bool:
        """Whether depth and life of a setting are measured."""
        return self.worn_up_to > 0 and not setting.size > self.worn_up_to


class LadderInput(Table):
    """A ladder as a study has it: sizes, and as many lists of overrides."""

    sizes: Annotated[tuple[Number, ...], Field(min_length=1)]
    set: tuple[tuple[str, ...], ...]
    base: tuple[str, ...] | None = None
    worn_up_to: Number = math.inf

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        if len(self.sizes) != len(self.set):
            raise Refusal('a ladder needs sizes = [1, 2] and as many set = [["section.key=value"], []]')
        return self


class Study(Table):
    """How a scene is refined.

    base : overrides that make it affordable; ladders : that only its geometry has, or with settings of its own
    unworn : ladders whose depth and life are not measured, because that takes too long"""

    base: tuple[str, ...] = ()
    ladders: dict[str, LadderInput] = Field(default_factory=dict)
    unworn: tuple[str, ...] = ()


def study_of(file: SceneFile) -> Study:
    """The study beside a scene, an empty one where there is none; raises SceneError for a file that is no study."""
    path = file.folder / f"{file.name}.study.toml"
    return scene_file.checked(Study, scene_file.tables(path, "study"), path.name) if path.is_file() else Study()


def ladders_of(scene: Scene, study: Study, names: Sequence[str] = ()) -> tuple[Ladder, ...]:
    """The ladders of a scene by name, all where none is named: those of its study, then what any scene has.

    Raises  ValueError for one that the scene does not have"""
    available = dict[str, Ladder]()
    for name, table in study.ladders.items():
        settings = [Setting(size, overrides) for size, overrides in zip(table.sizes, table.set, strict=True)]
        available[name] = Ladder(name, tuple(settings), table.base, table.worn_up_to)
    for name, settings in _of_any(scene):
        if len(settings) > 1:
            up_to = {"harmonics": WORN_TOP, SPRINGS: 0.0}.get(name, math.inf)
            available.setdefault(name, Ladder(name, tuple(settings), worn_up_to=up_to))
    missing = [name for name in names if name not in available]
    if missing:
        raise Refusal(f"--setting {missing[0]}: the scene has {', '.join(available)}")
    closed = any(contact.springs == "closed" for contact in scene.joints.values())
    chosen = [available[name] for name in names or available if names or closed or name != SPRINGS]
    return tuple(replace(ladder, worn_up_to=0.0) if ladder.name in study.unworn else ladder for ladder in chosen)


def _of_any(scene: Scene) -> Iterator[tuple[str, list[Setting]]]:
    """Names and settings of what scenes have without a study."""
    if isinstance(scene, MeshScene) and scene.geometry is not None:
        modes = scene.reduction.modes
        if modes:
            yield "modes", _numbers("reduction.modes", sorted({0, modes // 3, modes, 3 * modes}))
        elif scene.reduction.cutoff:
            yield "modes", _numbers("reduction.cutoff", [factor * scene.reduction.cutoff for factor in CUTOFFS])
        if scene.wheel is None:
            exact = Setting(EXACT, ("reduction.interface_modes=",))
            yield "interface_rank", [*_numbers("reduction.interface_modes", RANKS), exact]
    yield from _of_harmonics(scene)
    yield SPRINGS, _of_stiffness(scene)
    yield "newton", [Setting(1 / value, (f"solver.tolerance={value:g}",)) for value in NEWTON]
    if scene.wears:
        rule = 'wear.rule="error_controlled"'
        yield "wear", [Setting(1 / t, (rule, f"wear.tolerance={t:g}")) for t in WEAR_TOLERANCES]


def _of_harmonics(scene: Scene) -> Iterator[tuple[str, list[Setting]]]:
    needed = {load.harmonic for load in scene.loads.harmonic.values()} | set(scene.harmonics.kept[:1]) & {0}
    first = 0 if 0 in needed or scene.harmonics.automatic else 1
    sampling = ("harmonics.samples=128",) if scene.harmonics.samples < 128 else ()
    tops = [top for top in TOPS if top >= max(needed, default=1)]
    yield "harmonics", [Setting(top, (f"harmonics.kept={list(range(first, top + 1))}", *sampling)) for top in tops]
    if all(hasattr(contact_law.load(contact.law_name), "event_based_cycle") for contact in scene.joints.values()):
        top = max(scene.harmonics.kept, default=1)
        sampled = [
            Setting(n, (f"harmonics.samples={n}", 'harmonics.transitions="sampled"')) for n in SAMPLES if n > 2 * top
        ]
        located = ("harmonics.samples=128", 'harmonics.transitions="located"')
        yield "samples", [*sampled, Setting(EXACT, located)]


def _of_stiffness(scene: Scene) -> list[Setting]:
    """Stiffer springs, of contacts that give a number for them, with the harmonics that they require."""
    keys = {
        f"{f'contacts.{name}' if name in getattr(scene, 'contacts', ()) else 'contact'}.{key}": value
        for name, contact in scene.joints.items()
        for key in ("tangential_stiffness", "normal_stiffness")
        if (value := getattr(contact, key)) is not None and key not in contact.by_state
    }
    if not keys:
        return []
    settings, harmonics = [Setting(1.0, (), "1 x")], scene.harmonics
    for factor in STIFFER[1:]:
        top = harmonic_with_springs(harmonics.top, factor)
        highest = f"highest={top}" if harmonics.automatic else f"kept={list(range(harmonics.kept[0], top + 1))}"
        finer = (f"harmonics.{highest}", f"harmonics.samples={max(harmonics.samples, 16 * top)}")
        springs = tuple(f"{key}={factor * value!r}" for key, value in keys.items())
        settings.append(Setting(math.sqrt(factor), (*springs, *finer), f"{factor:g} x"))
    return settings


def harmonic_with_springs(highest: int, factor: float) -> int:
    """Highest harmonic with springs so many times as stiff: a mass turns on them in a time that falls with the root."""
    return math.ceil((max(highest, 3) + 1) * math.sqrt(factor)) - 1


def _numbers(key: str, values: Sequence[float]) -> list[Setting]:
    return [Setting(value, (f"{key}={value:g}",)) for value in values]


@dataclass(frozen=True)
class Limit:
    """Where values tend to.

    order : observed, nan where they do not settle monotonically or are too few
    doubt : how far off the limit itself may be, relative to it"""

    value: float
    order: float
    doubt: float


def limit_of(size: Sequence[float], value: Sequence[float]) -> Limit:
    """The limit of values whose error falls with a power of the size, judged by the three finest sizes.

    size : rising, nan at the end where that setting is exact; equal ones are other placements of the same nodes, of
        which the first counts
    value : the last one not 0
    Three that settle monotonically are extrapolated with their observed order, if the last step is above the scatter of
    the finest size with several placements. Three that alternate and come closer have their limit between the last two.
    Else the last one stands, with the spread of all values on the three as its doubt. Two are taken to be of first
    order; one says nothing about itself, which is an infinite doubt.
    Source  Roache, J. Fluids Eng. 116, 1994"""
    last = value[-1]
    if not np.isfinite(size[-1]):
        return Limit(last, float("nan"), 0.0)
    sizes = list(dict.fromkeys(size))[-3:]
    groups = [[v for s, v in zip(size, value, strict=True) if s == group_size] for group_size in sizes]
    scatter = next((float(np.ptp(group)) for group in reversed(groups) if len(group) > 1), 0.0)
    v = np.array([group[0] for group in groups])
    last = float(v[-1])
    if len(v) == 1:
        return Limit(last, float("nan"), float("inf"))
    h = 1 / np.maximum(sizes, SMALLEST)
    steps = np.diff(v)
    is_constant = np.abs(steps) <= ROUNDING * abs(last)
    if is_constant[-1] and (is_constant.all() or len(v) == 3) and not scatter:
        return Limit(last, float("nan"), float(abs(steps[-1] / last)))
    if len(v) == 2:
        return Limit(last, float("nan"), float(abs(steps[0] / last) * h[1] / (h[0] - h[1])))
    if abs(steps[1]) > scatter:
        ratio = steps[0] / steps[1]
        if ratio > 0 and (order := _order(h, ratio)) >= ORDERS[0]:
            p = min(order, ORDERS[1])
            remainder = steps[1] * h[2] ** p / (h[1] ** p - h[2] ** p)
            return Limit(float(last + remainder), order, float(SAFETY * abs(remainder / (last + remainder))))
        if ratio < -1:
            return Limit(last, float("nan"), float(abs(steps[1] / last)))
    return Limit(last, float("nan"), float(np.ptp(np.concatenate(groups)) / abs(last)))


def springs_limit(factors: Sequence[float], values: Sequence[float], least: float) -> Limit | None:
    """The limit without springs; None where the changes do not shrink, to 0.6 at most, or are below `least`.

    A slider that turns with a mass halves them: the springs' error falls with their root, and with it the harmonics'"""
    steps = np.abs(np.diff(values[-3:]))
    if len(steps) < 2 or (steps[1] > 0.6 * steps[0] and steps[1] > least * abs(values[-1])):
        return None
    return limit_of([math.sqrt(factor) for factor in factors], values) if values[-1] else Limit(0.0, math.nan, 0.0)


def _order(h: np.ndarray, ratio: float) -> float:
    """p with (h0^p - h1^p) / (h1^p - h2^p) = ratio, nan below 0.01."""
    low, high = 0.01, 60.0

    def excess(p: float) -> float:
        # in powers of h0, so that fine tolerances do not underflow
        a, b = (h[1] / h[0]) ** p, (h[2] / h[0]) ** p
        return float((1 - a) / max(a - b, 1e-300) - ratio)

    if excess(low) > 0:
        return float("nan")
    return high if excess(high) < 0 else float(brentq(excess, low, high, xtol=1e-14))
