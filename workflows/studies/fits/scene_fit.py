"""Fit the numbers of a scene to measured ones."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import model_cache, modelling
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, SceneError, SceneFile, Source, read_scene
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.fits.curve_target import CurveTarget
from tribodyn.workflows.studies.fits.fit_file import FitTables, NumberText, ParameterTable, Target, read
from tribodyn.workflows.studies.fits.identification import FitParameter, Identification, MeasuredNumber, fit
from tribodyn.workflows.studies.fits.scene_answers import SceneAnswers, Side
from tribodyn.workflows.studies.study_result import StudyResult

UNITS = ("m", "N", "N/m", "Pa", "kg/m3", "m3/J", "Hz", "rad", "s", "1/s", "")  # of keys of a scene
DIFFERENCE = 1e-3  # step of a parameter, over it or the width of its bounds


@dataclass(frozen=True, repr=False)
class Fit(StudyResult):
    """The numbers of a scene that fit the measured ones best.

    identification : with their errors; changes : overrides "section.key=value" that put them into the scene"""

    identification: Identification
    changes: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        return {**self.identification.record(), "set": list(self.changes)}

    def lines(self) -> list[str]:
        sets = [f'  --set "{change}"' for change in self.changes]
        return [self.identification.report(), "", "to continue with what was found:", *sets]


def identify(
    scene: Source, task: AnyPath | Mapping[str, Any], *, overrides: Overrides = (), progress: Report = None
) -> Fit:
    """Fit named numbers of a scene to measured ones, within bounds, and say how well these determine them.

    scene : name of a scene or a .toml file; nothing is written into it
    task : file with the numbers that are looked for and those that were measured, as cases/rig/rig.fit.toml
    Raises  SceneError for a key that is no number of the scene, Refusal for bounds that cannot be, SolveFailed"""
    return best(read_scene(scene, overrides), read(task), reporter(progress))


def best(file: SceneFile, task: FitTables, progress: Progress) -> Fit:
    """The fit of a scene that was read."""
    scene_fit = SceneFit(file, task, progress)
    scene_values = {name: value_of(file.scene, table.keys[0]) for name, table in task.parameters.items()}
    defined = {name: value for name, value in scene_values.items() if value is not None}
    initial = defined if len(defined) == len(scene_fit.parameters) else None
    with threadpool_limits(1), model_cache.memory_cache():
        identification = fit(
            scene_fit.parameters,
            scene_fit.measured,
            lambda values: scene_fit.trial(values, scene_fit.targets, nearby=True),
            lambda values: scene_fit.slopes(values, scene_fit.targets),
            initial,
        )
    return Fit(identification, tuple(scene_fit.changes(identification.named(), digits=6)))


class SceneFit:
    """A scene whose numbers are fitted: its trials and their derivatives."""

    def __init__(self, file: SceneFile, task: FitTables, progress: Progress):
        self.file, self._task, self._progress = file, task, progress
        self.parameters = [parameter(name, table, self.file.scene) for name, table in task.parameters.items()]
        self.measured = [
            MeasuredNumber(name, _si(f"measured.{name}.value", table.value, (table.unit,))[0],
                     table.unit, table.weight)
            for name, table in task.measured.items()
        ]  # fmt: skip
        curves = {f"curves.{name}": CurveTarget.of(name, table, file) for name, table in task.curves.items()}
        self.measured += [number for table in curves.values() for number in table.numbers()]
        self.targets: Mapping[str, Target | CurveTarget] = {**task.measured, **curves}
        self._count = 0
        self._last: SceneAnswers | None = None

    def changes(self, values: Mapping[str, float], digits: int = 17) -> list[str]:
        """Overrides that put values into the scene."""
        texts = {p.name: f"{values[p.name]:.{digits}g} {p.unit}".rstrip() for p in self.parameters}
        return [f"{key}={text}" for name, text in texts.items() for key in self._task.parameters[name].keys]

    def trial(
        self, values: Mapping[str, float], targets: Mapping[str, Target | CurveTarget], nearby: bool = False
    ) -> np.ndarray:
        """Answers of the scene with values; nearby : start its cycles from those of the previous trial."""
        self._count += 1
        trial = self.file.changed(*self.changes(values))
        self._last = SceneAnswers(trial, modelling.build(trial, Progress()), self._last if nearby else None)
        numbers = self._last.all_to(targets)
        self._progress.say(f"trial {self._count}: " + ", ".join(f"{name} {v:.6g}" for name, v in values.items()))
        return numbers

    def slopes(self, values: Mapping[str, float], targets: Mapping[str, Target | CurveTarget]) -> np.ndarray:
        """(n_measured, n_parameter) derivatives of what the last trial said; values : its own."""
        base = self._last
        if base is None:
            raise ValueError("derivatives are those of a trial: make one first")
        sides: list[Side] = []
        for p in self.parameters:
            step = DIFFERENCE * (values[p.name] if p.ratio else p.high - p.low)
            middle = float(np.clip(values[p.name], p.low + step, p.high - step))
            upper, lower = (self._neighbour({**values, p.name: middle + s}) for s in (step, -step))
            sides.append((p.name, step, upper, lower))
        rows: list[Sequence[float]] = []
        for name, target in targets.items():
            with suppress(NoDerivative):
                if not isinstance(target, CurveTarget):
                    rows.append(base.slopes(target, sides))
                    continue
            answers = [[scene.all_to({name: target}) for scene in scenes] for _, _, *scenes in sides]
            rows += list(np.transpose([(up - down) / (2 * s[1]) for (up, down), s in zip(answers, sides, strict=True)]))
        return np.array(rows)

    def _neighbour(self, values: Mapping[str, float]) -> SceneAnswers:
        """The scene with values near those of the last trial, of which nothing is solved yet."""
        file = self.file.changed(*self.changes(values))
        return SceneAnswers(file, modelling.build(file, Progress()), self._last)


def parameter(name: str, table: ParameterTable, scene: Scene) -> FitParameter:
    """A number that is looked for, in SI units."""
    low, unit = _si(f"parameters.{name}.low", table.low, UNITS)
    units = (unit,) if isinstance(table.low, str) else UNITS
    high, unit = _si(f"parameters.{name}.high", table.high, units)
    starts = tuple(_si(f"parameters.{name}.start", start, (unit,))[0] for start in table.start)
    ratio = min(low, high) > 0 if table.ratio is None else table.ratio
    scene_value = value_of(scene, table.keys[0])
    if not starts:
        problem = f"parameters.{name}: the scene has no {table.keys[0]}"
        if scene_value is None:
            raise SceneError(f"{problem}: give start")
        if not low <= scene_value <= high:
            raise SceneError(
                f"{problem} between {low:g} and {high:g} but {scene_value:g}: give start, or other bounds low < high"
            )
        starts = (scene_value,)
    return FitParameter(name, low, high, starts, unit, ratio)


def value_of(scene: Scene, key: str) -> float | None:
    """The number of a scene at a key "section.key" in SI units; None for a key that is left out.

    Raises  SceneError for a key that is not a number"""
    table: Any = scene.model_dump()
    for part in filter(None, (table.get("geometry"), *table.get("bodies", {}).values())):
        part |= part["parameters"]
    for word in key.split("."):
        table = table.get(word) if isinstance(table, dict) else None
    if table is not None and (isinstance(table, bool) or not isinstance(table, (int, float))):
        raise SceneError(f"{key} is not a number that can be looked for")
    return None if table is None else float(table)


def _si(key: str, value: NumberText, units: tuple[str, ...]) -> tuple[float, str]:
    """A quantity in the first of the units that it can be counted in; a bare number in the last one."""
    problem: Refusal
    for unit in units if isinstance(value, str) else units[-1:]:
        try:
            return to_si(value, unit), unit
        except Refusal as error:
            problem = error
    raise SceneError(f"{key}: {problem}")
