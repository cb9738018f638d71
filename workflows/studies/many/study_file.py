"""The file of a study: which scene, which of its keys vary and how, and what is asked of every run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool, StrictInt, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number, Table
from tribodyn.workflows.scene.scene_file import AnyPath, SceneError
from tribodyn.workflows.studies.many.distributions import Distribution, Marginal, NumberWithUnit, si

LISTED = ("grid", "list")
"""Designs made of listed values; the others draw."""


class StudySettings(Table):
    """The table [study]."""

    scene: str
    """Name of a scene, or the path of a .toml file, from the folder of the study."""
    design: Literal["grid", "list", "sobol", "latin_hypercube"]
    """Every combination of the lists, the lists side by side, or points that are drawn."""
    runs: Annotated[StrictInt, Field(ge=1)] | None = None
    """Number of runs that are drawn; a grid and a list have as many as their values make."""
    seed: StrictInt = 0
    """Of what is drawn: the same seed gives the same runs."""
    verdict: StrictBool = False
    """Measure the errors of every run, which costs more than most runs do."""
    derivatives: StrictBool = False
    """Add the exact derivatives of every run's first peak and life by the keys, as columns "d NUMBER / d KEY"."""
    set: tuple[str, ...] = ()
    """Keys that every run changes, as "section.key=value"."""
    same: dict[str, str] = Field(default_factory=dict)
    """Keys that take the value of one that varies, such as those of two contacts that are made alike."""

    @model_validator(mode="after")
    def _runs_are_drawn(self) -> StudySettings:
        if self.design in LISTED and self.runs is not None:
            raise Refusal(f"study.runs: a {self.design} has as many runs as its values make, leave it out")
        if self.design not in LISTED and self.runs is None:
            raise Refusal(f'study.runs: design = "{self.design}" draws, say how many runs')
        return self


class Correlation(Table):
    """One entry of [[correlations]]."""

    keys: tuple[str, str]
    """Two keys that vary by distributions."""
    value: Annotated[float, Field(gt=-1, lt=1)]
    """Correlation of the normal variables behind both, Gaussian copula; Spearman's is 6/pi asin(value/2)."""


Share = Annotated[Number, Field(gt=0, lt=1)]


class LifeSettings(Table):
    """The table [lives]: what `tribodyn study lives` asks of the runs."""

    number: str = "life"
    """Column of the study's table whose distribution is wanted."""
    shares: Annotated[tuple[Share, ...], Field(min_length=1)] = (0.1, 0.5, 0.9)
    """Shares of the parts that fall below the wanted values: 0.1 gives P10, which 90 % of the parts outlive."""
    confidence: Share = 0.9
    """Chance that a true quantile lies between the ends that are given."""
    within: Annotated[Number, Field(gt=0)] | None = None
    """Runs are added near the first share until its ends are within this of it, such as "5 %"; none are by default."""
    most: Annotated[StrictInt, Field(ge=1)] = 200
    """Largest number of full runs, those of the design and those that are added."""
    model_error: Annotated[Number, Field(ge=0)] | None = None
    """Relative error of the model itself; by default that of the verdict on a run at the medians."""


class Aim(Table):
    """One entry of optimise.aims."""

    number: str
    """Column of the study's table."""
    want: Literal["low", "high"]
    """Which of its values are better."""


class OptimumLimit(Table):
    """One entry of optimise.limits."""

    number: str
    """Column of the study's table."""
    low: NumberWithUnit | None = None
    """Least value that may be."""
    high: NumberWithUnit | None = None
    """Largest value that may be."""

    @model_validator(mode="after")
    def _has_an_end(self) -> OptimumLimit:
        if self.low is None and self.high is None:
            raise Refusal(f"a limit of {self.number} needs low or high")
        for end in (self.low, self.high):
            if end is not None and si(end) is None:
                raise Refusal(f'"{end}" is not a number with a unit')
        return self


AIMS = (Aim(number="amplitude_first", want="low"), Aim(number="life", want="high"))


class OptimiseSettings(Table):
    """The table [optimise]: what `tribodyn study optimise` asks of the runs."""

    aims: Annotated[tuple[Aim, ...], Field(min_length=1, max_length=3)] = AIMS
    """What is wanted; of several aims the best trades are looked for."""
    limits: tuple[OptimumLimit, ...] = ()
    """What a run must keep to."""
    evaluations: Annotated[StrictInt, Field(ge=2)] = 40
    """Most runs, those of the design among them."""


class StudyFile(Table):
    """A study as its file has it."""

    study: StudySettings
    vary: dict[str, Any]
    correlations: tuple[Correlation, ...] = ()
    lives: LifeSettings = LifeSettings()
    optimise: OptimiseSettings = OptimiseSettings()


@dataclass(frozen=True)
class ParameterStudy:
    """A study that was read and checked.

    varied : key of the scene -> values, or the distribution that they are drawn from
    folder : where the path of its scene begins"""

    name: str
    settings: StudySettings
    varied: Mapping[str, tuple[Any, ...] | Marginal]
    correlations: tuple[Correlation, ...]
    folder: Path
    lives: LifeSettings
    optimise: OptimiseSettings

    @property
    def scene(self) -> str:
        """Name or path of the scene."""
        path = self.folder / self.settings.scene
        return str(path) if path.suffix == ".toml" and path.is_file() else self.settings.scene


def read(study: AnyPath | Mapping[str, Any]) -> ParameterStudy:
    """Read and check the file of a study, or its tables; raises SceneError that names the file and the key."""
    if isinstance(study, Mapping):
        return parse(study, "study", Path().resolve())
    path = Path(study)
    return parse(scene_file.tables(path, "study"), path.name, path.resolve().parent)


def parse(data: Mapping[str, Any], label: str, folder: Path) -> ParameterStudy:
    """Check the tables of a study; label names it in errors. Raises SceneError."""
    file = scene_file.checked(StudyFile, dict(data), label)
    leaves = dict(_leaves(file.vary))
    if not leaves:
        raise SceneError(f'{label}: vary is empty, give keys of the scene such as "contact.friction" = [0.3, 0.5]')
    changed_keys = (*leaves, *file.study.set, *file.study.same)
    if any(key.partition("=")[0].strip() == "solver.threads" for key in changed_keys):
        raise SceneError(f"{label}: solver.threads: every run has one thread, say by --workers how many run at a time")
    varied = {key: _read(key, value, file.study.design, label) for key, value in leaves.items()}
    design, lengths = file.study.design, {key: len(v) for key, v in varied.items() if isinstance(v, tuple)}
    if design == "list" and len(set(lengths.values())) > 1:
        have = ", ".join(f"{key} {count}" for key, count in lengths.items())
        raise SceneError(f"{label}: lists side by side need one length, but have {have}")
    for at, correlation in enumerate(file.correlations):
        for key in correlation.keys:
            if not isinstance(varied.get(key), Marginal):
                raise SceneError(f'{label}: correlations[{at}]: "{key}" does not vary by a distribution')
        if correlation.keys[0] == correlation.keys[1]:
            raise SceneError(f'{label}: correlations[{at}]: give two keys, not "{correlation.keys[0]}" twice')
    for copy, original in file.study.same.items():
        if original not in varied or copy in varied:
            raise SceneError(
                f'{label}: study.same: "{copy}" = "{original}": give a key that does not vary, and one that does'
            )
    name = Path(label).name.removesuffix(".toml")
    return ParameterStudy(name, file.study, varied, file.correlations, folder, file.lives, file.optimise)


def _leaves(table: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """Dotted keys with their values: `contact.friction = ...` and `"contact.friction" = ...` are the same."""
    leaves = []
    for name, value in table.items():
        inner = isinstance(value, Mapping) and "distribution" not in value
        leaves += _leaves(value, f"{before}{name}.") if inner else [(f"{before}{name}", value)]
    return leaves


def _read(key: str, value: Any, design: str, label: str) -> tuple[Any, ...] | Marginal:
    if isinstance(value, Mapping):
        if design in LISTED:
            raise SceneError(f'{label}: vary.{key}: a {design} has lists of values, draw with design = "sobol"')
        table = scene_file.checked(Distribution, dict(value), f"{label}: vary.{key}")
        try:
            return Marginal.of(table)
        except Refusal as error:
            raise SceneError(f"{label}: vary.{key}: {error}") from None
    if not isinstance(value, list) or not value:
        raise SceneError(f"{label}: vary.{key}: expected a list of values or a distribution, got {value!r}")
    return tuple(value)
