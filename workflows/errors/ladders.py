"""The settings of a scene that trade speed for accuracy: ladders of overrides from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

from pydantic import Field, model_validator

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


@dataclass(frozen=True)
class Setting:
    """Overrides of a scene, and how fine they are: errors fall with a power of size."""

    size: float
    overrides: tuple[str, ...]

    @property
    def label(self) -> str:
        """The overrides without their sections."""
        parts = [text.partition("=") for text in self.overrides]
        return ", ".join(f"{key.rpartition('.')[2]}={value}" for key, _, value in parts)


@dataclass(frozen=True)
class Ladder:
    """Settings of one thing, from coarse to fine; equal sizes are other placements of the nodes.

    base : overrides under which it is measured, None for those of the study
    worn_up_to : size up to which depth and life are measured too
    """

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

    def named(self, name: str) -> Ladder:
        """The ladder with its name."""
        settings = (Setting(size, overrides) for size, overrides in zip(self.sizes, self.set, strict=True))
        return Ladder(name, tuple(settings), self.base, self.worn_up_to)


class Study(Table):
    """How a scene is refined.

    base : overrides that make it affordable; ladders : that only its geometry has, or with settings of its own
    unworn : ladders whose depth and life are not measured, because that takes too long
    """

    base: tuple[str, ...] = ()
    ladders: dict[str, LadderInput] = Field(default_factory=dict)
    unworn: tuple[str, ...] = ()


def study_of(file: SceneFile) -> Study:
    """The study beside a scene, an empty one where there is none; raises SceneError for a file that is no study."""
    path = file.folder / f"{file.name}.study.toml"
    return scene_file.checked(Study, scene_file.tables(path, "study"), path.name) if path.is_file() else Study()


def ladders_of(scene: Scene, study: Study, names: Sequence[str] = ()) -> tuple[Ladder, ...]:
    """The ladders of a scene by name, all where none is named: those of its study, then what any scene has.

    Raises  ValueError for one that the scene does not have
    """
    available = {name: table.named(name) for name, table in study.ladders.items()}
    for name, settings in _of_any(scene):
        if len(settings) > 1:
            up_to = WORN_TOP if name == "harmonics" else math.inf
            available.setdefault(name, Ladder(name, tuple(settings), worn_up_to=up_to))
    missing = [name for name in names if name not in available]
    if missing:
        raise Refusal(f"--setting {missing[0]}: the scene has {', '.join(available)}")
    chosen = [available[name] for name in names or available]
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


def _numbers(key: str, values: Sequence[float]) -> list[Setting]:
    return [Setting(value, (f"{key}={value:g}",)) for value in values]
