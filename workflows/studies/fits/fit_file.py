"""A fit that a file asks for: which numbers of a scene are looked for, and what was measured (tribodyn study identify).

The file names keys of the scene with bounds, and measured frequencies, preload, energies, amplitudes, life or work with
their values. A scene is built anew for every trial, as far as the trial changes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, StrictInt, model_validator
from threadpoolctl import threadpool_limits

from tribodyn.hbm import newton
from tribodyn.hbm.balance import State
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.derivatives import cycle_derivatives
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_preload
from tribodyn.reduction.linear import linear_modes
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, kept, modelling, settings, wear_run
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number, Table
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.source import AnyPath, Overrides, Source, read_scene
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.scene.wear import At, Place
from tribodyn.workflows.studies.fits import posterior as posteriors
from tribodyn.workflows.studies.fits.curve_target import Curve, CurveTarget
from tribodyn.workflows.studies.fits.identification import FitParameter, Identification, MeasuredNumber, fit
from tribodyn.workflows.studies.fits.posterior import Posterior
from tribodyn.workflows.studies.many.distributions import Distribution, Marginal
from tribodyn.workflows.studies.study_result import StudyResult

UNITS = ("m", "N", "N/m", "Pa", "kg/m3", "m3/J", "Hz", "rad", "s", "1/s", "")  # of keys of a scene
MEASURED_IN = {
    "open frequency": "Hz", "stuck frequency": "Hz", "preload": "N", "energy": "J", "amplitude": "m",
    "peak frequency": "Hz", "life": "", "work": "J",
}  # fmt: skip
DIFFERENCE = 1e-3  # step of a parameter, over it or the width of its bounds
Quantity = float | str


class ParameterTable(Table):
    """A number that is looked for.

    keys : of the scene, section.key; several get the same value
    low, high : bounds, with a unit or in SI; start : one or more to begin from, the scene's own value by default
    ratio : count in ratios, for a positive number known to its order only; by default where both bounds are above 0
    prior : distribution that was known before, for a posterior; evenly between the bounds by default, of its logarithm
        where it counts in ratios
    """

    keys: Annotated[tuple[str, ...], Field(min_length=1)]
    low: Quantity
    high: Quantity
    start: tuple[Quantity, ...] = ()
    ratio: StrictBool | None = None
    prior: Distribution | None = None


class Target(Table):
    """A number that a scene answers.

    of : what it is
    mode : number of a frequency, from 1
    at : of energy, amplitude and preload: a frequency, "peak" or a share of it; a preload without it is that at rest
    load : factor on the harmonic loads of the scene
    left : share of the first preload at which a life and its work end
    """

    of: Literal["open frequency", "stuck frequency", "preload", "energy", "amplitude", "peak frequency", "life", "work"]
    mode: Annotated[StrictInt, Field(ge=1)] | None = None
    at: At | None = None
    load: Annotated[Number, Field(gt=0)] = 1.0
    left: Annotated[Number, Field(gt=0, lt=1)] = LIFE_SHARE

    @model_validator(mode="after")
    def _only_what_it_needs(self) -> Self:
        cycle = self.of in ("energy", "amplitude") or (self.of == "preload" and self.at is not None)
        mode = self.of in ("open frequency", "stuck frequency")
        for name, may, must in (
            ("mode", mode, mode),
            ("at", cycle, cycle),
            ("load", cycle or self.of == "peak frequency", False),
            ("left", self.of in ("life", "work"), False),
        ):
            is_given = name in self.model_fields_set
            if (is_given and not may) or (must and not is_given):
                raise Refusal(f'expected {"" if may else "no "}{name} for of = "{self.of}"')
        return self


class MeasuredTarget(Target):
    """A measured number.

    value : with a unit or in SI; weight : of its relative error in a fit
    error : its standard deviation, relative, for a posterior
    """

    value: Quantity
    weight: Annotated[Number, Field(gt=0)] = 1.0
    error: Annotated[Number, Field(gt=0)] | None = None


class FitTables(Table):
    """What is looked for, what is known, and what is to follow from it, by names of one's own.

    curves : measured curves, which may take the place of measured numbers
    """

    parameters: Annotated[dict[str, ParameterTable], Field(min_length=1)]
    measured: dict[str, MeasuredTarget]
    curves: dict[str, Curve] = Field(default_factory=dict)
    predict: dict[str, Target] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _numbers_or_curves(cls, table: Any) -> Any:
        if isinstance(table, dict) and table.get("curves"):
            return {"measured": {}, **table}
        if isinstance(table, dict) and table.get("measured") == {}:
            raise Refusal("measured: give numbers, or curves")
        return table


def read(task: AnyPath | Mapping[str, Any]) -> FitTables:
    """Read and check the file of a fit, or its tables; raises SceneError with one sentence."""
    if isinstance(task, Mapping):
        return scene_file.checked(FitTables, dict(task), "fit", Path())
    path = Path(task)
    return scene_file.checked(FitTables, scene_file.tables(path, "fit"), path.name, path.parent)


@dataclass(frozen=True, repr=False)
class Fit(StudyResult):
    """The numbers of a scene that fit the measured ones best.

    identification : with their errors; changes : overrides "section.key=value" that put them into the scene
    """

    identification: Identification
    changes: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        """For machines."""
        return {**self.identification.record(), "set": list(self.changes)}

    def lines(self) -> list[str]:
        """For people."""
        return [
            self.identification.report(),
            "",
            "to continue with what was found:",
            *(f'  --set "{c}"' for c in self.changes),
        ]


def identify(
    scene: Source, task: AnyPath | Mapping[str, Any], *, overrides: Overrides = (), progress: Report = None
) -> Fit:
    """Fit named numbers of a scene to measured ones, within bounds, and say how well these determine them.

    scene : name of a scene or a .toml file; nothing is written into it
    task : file with the numbers that are looked for and those that were measured, as cases/rig/rig.fit.toml
    Raises  SceneError for a key that is no number of the scene, ValueError for bounds that cannot be, SolveFailed
    """
    return best(read_scene(scene, overrides), read(task), reporter(progress))


def best(file: SceneFile, task: FitTables, progress: Progress) -> Fit:
    """The fit of a scene that was read."""
    scene_fit = SceneFit(file, task, progress)
    scene_values = {name: value_of(file.mesh_scene, table.keys[0]) for name, table in task.parameters.items()}
    defined = {name: value for name, value in scene_values.items() if value is not None}
    initial = defined if len(defined) == len(scene_fit.parameters) else None
    with threadpool_limits(1), kept.at_hand():
        identification = fit(
            scene_fit.parameters,
            scene_fit.measured,
            lambda values: scene_fit.trial(values, scene_fit.targets, nearby=True),
            lambda values: scene_fit.slopes(values, scene_fit.targets),
            initial,
        )
    return Fit(identification, tuple(scene_fit.changes(identification.named(), digits=6)))


def posterior(
    scene: Source,
    task: AnyPath | Mapping[str, Any],
    *,
    trials: int = 100,
    seed: int = 0,
    overrides: Overrides = (),
    progress: Report = None,
) -> Posterior:
    """Sample what measured numbers, each with its error, leave of the numbers of a scene, and what follows from them.

    scene : name of a scene or a .toml file; nothing is written into it
    task : file with the numbers that are looked for and those that were measured, as for `identify`
    trials : runs of the scene that it may take
    seed : seed of the samples
    Raises  SceneError, ValueError: what is asked for cannot be; SolveFailed: most trials fail
    """
    tables = read(task)
    scene_fit = SceneFit(read_scene(scene, overrides), tables, reporter(progress))
    all_targets = {**scene_fit.targets, **tables.predict}
    units = {name: MEASURED_IN[target.of] for name, target in tables.predict.items()}
    priors = {
        name: scene_fit.prior(name, target.prior)
        for name, target in tables.parameters.items()
        if target.prior is not None
    }
    with threadpool_limits(1), kept.at_hand():
        return posteriors.sample(
            scene_fit.parameters,
            scene_fit.measured,
            lambda values: scene_fit.trial(values, all_targets),
            units,
            priors,
            trials,
            seed,
        )


class SceneFit:
    """A scene whose numbers are looked for."""

    def __init__(self, file: SceneFile, task: FitTables, progress: Progress):
        doubled = set(task.measured) & set(task.predict)
        if doubled:
            raise SceneError(f"predict.{min(doubled)}: a measured number has this name, give another one")
        self.file, self._task, self._progress = file, task, progress
        self.parameters = [parameter(name, table, self.file.mesh_scene) for name, table in task.parameters.items()]
        self.measured = [
            MeasuredNumber(name, _si(f"measured.{name}.value", table.value, (MEASURED_IN[table.of],))[0],
                     MEASURED_IN[table.of], table.weight, table.error)
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
        """What the scene says with values; nearby : its cycles are found from those of the trial before."""
        self._count += 1
        trial = self.file.changed(*self.changes(values))
        self._last = SceneAnswers(trial, modelling.build(trial, Progress()), self._last if nearby else None)
        numbers = self._last.all_to(targets)
        self._progress.say(
            f"trial {self._count}: " + ", ".join(f"{name} {value:.6g}" for name, value in values.items())
        )
        return numbers

    def slopes(self, values: Mapping[str, float], targets: Mapping[str, Target | CurveTarget]) -> np.ndarray:
        """(n_measured, n_parameter) derivatives of what the last trial said; values : its own."""
        base = self._last
        assert base is not None
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
            neighbours = [[scene.all_to({name: target}) for scene in scenes] for _, _, *scenes in sides]
            rows += list(
                np.transpose([(up - down) / (2 * s[1]) for (up, down), s in zip(neighbours, sides, strict=True)])
            )
        return np.array(rows)

    def _neighbour(self, values: Mapping[str, float]) -> SceneAnswers:
        """The scene with values near those of the last trial, of which nothing is solved yet."""
        file = self.file.changed(*self.changes(values))
        return SceneAnswers(file, modelling.build(file, Progress()), self._last)

    @staticmethod
    def prior(name: str, table: Distribution) -> Marginal:
        """A distribution that was known before."""
        try:
            return Marginal.of(table)
        except Refusal as error:
            raise SceneError(f"parameters.{name}.prior: {error}") from None


def parameter(name: str, table: ParameterTable, scene: MeshScene) -> FitParameter:
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


def value_of(scene: MeshScene, key: str) -> float | None:
    """The number of a scene at a key "section.key" in SI units; None for a key that is left out.

    Raises  SceneError for a key that is not a number
    """
    table: Any = scene.model_dump()
    for part in filter(None, (table.get("geometry"), *table.get("bodies", {}).values())):
        part |= part["parameters"]
    for word in key.split("."):
        table = table.get(word) if isinstance(table, dict) else None
    if table is not None and (isinstance(table, bool) or not isinstance(table, (int, float))):
        raise SceneError(f"{key} is not a number that can be looked for")
    return None if table is None else float(table)


def _si(key: str, value: Quantity, units: tuple[str, ...]) -> tuple[float, str]:
    """A quantity in the first of the units that it can be counted in; a bare number in the last one."""
    problem = ValueError()
    for unit in units if isinstance(value, str) else units[-1:]:
        try:
            return to_si(value, unit), unit
        except Refusal as error:
            problem = error
    raise SceneError(f"{key}: {problem}")


Side = tuple[str, float, "SceneAnswers", "SceneAnswers"]


class SceneAnswers:
    """What one scene says; cycles and wear runs that several numbers share are solved once.

    near : a scene that differs little, from whose cycles those of this one are found
    """

    def __init__(self, file: SceneFile, model: modelling.Model, neighbour: SceneAnswers | None = None):
        self.file, self.model, self._near_points = file, model, {} if neighbour is None else neighbour._points
        self._points: dict[tuple[Place, float], OperatingPoint] = {}
        self._derived: dict[tuple[Place | None, float], Derivatives] = {}
        self._runs: dict[float, WearHistory] = {}

    def all_to(self, targets: Mapping[str, Target | CurveTarget]) -> np.ndarray:
        """(n_measured,) its numbers, of a curve one for each point."""
        parts = (
            target.values(self.file, self.model) if isinstance(target, CurveTarget) else [self.to(name, target)]
            for name, target in targets.items()
        )
        return np.concatenate([np.asarray(part, float) for part in parts])

    def slopes(self, target: Target, sides: Sequence[Side]) -> Sequence[float]:
        """Derivatives of a number by parameters.

        sides : name of each, step, and the scene a step above and a step below
        Raises  NoDerivative where a number has none, or none but by running again
        """
        if target.mode is not None:
            pairs = [[scene._frequency(target.of == "stuck frequency", target.mode) for scene in s[2:]] for s in sides]
            return [(up - down) / (2 * side[1]) for (up, down), side in zip(pairs, sides, strict=True)]
        if target.of in ("life", "work"):
            raise NoDerivative("a life is followed again")
        place = target.at or (None if target.of == "preload" else Place(peak=1.0))
        if (place, target.load) not in self._derived:
            self._derived[place, target.load] = self._derivatives(place, target.load, sides)
        derivatives_at = self._derived[place, target.load]
        name = target.of.replace(" ", "_")
        if name not in derivatives_at.names:
            return [0.0] * len(sides)
        return [float(slope) for slope in derivatives_at.slopes[derivatives_at.names.index(name)]]

    def _derivatives(self, place: Place | None, load: float, sides: Sequence[Side]) -> Derivatives:
        """Of a cycle at a place, at rest where there is none; raises NoDerivative."""
        balance, options = self.model.balance, settings.newton_options(self.file.scene)
        changes = [
            ParameterChange(name, step, BalanceInputs.of(upper.model.balance), BalanceInputs.of(lower.model.balance))
            for name, step, upper, lower in sides
        ]
        if place is None:
            return cycle_derivatives.at_frequency(
                balance.with_load(0.0), self._state_at_rest, settings.OUTPUT, changes, options=options
            )
        balance, state = balance.with_load(load), self._point(place, load).state
        if place.peak == 1.0:
            return cycle_derivatives.at_peak(balance, state, settings.OUTPUT, changes, options=options)
        derivatives_at = cycle_derivatives.at_frequency(balance, state, settings.OUTPUT, changes, options=options)
        if place.peak is not None:  # beside a peak, and moves with it
            peak = self._point(Place(peak=1.0), load).state
            moves = cycle_derivatives.at_peak(balance, peak, settings.OUTPUT, changes, options=options).slopes[0]
            ride = np.outer(derivatives_at.by_frequency, 2 * np.pi * place.peak * moves)
            derivatives_at = replace(derivatives_at, slopes=derivatives_at.slopes + ride)
        return derivatives_at

    def to(self, name: str, target: Target) -> float:
        """The scene's number beside a measured one; raises SolveFailed, naming it, where there is none."""
        try:
            if target.mode is not None:
                return self._frequency(target.of == "stuck frequency", target.mode)
            if target.of in ("life", "work"):
                return self._wear(target)
            if target.of == "preload" and target.at is None:
                return self.model.balance.preload(self._state_at_rest)
            point = self._point(target.at or Place(peak=1.0), target.load)
        except SolveFailed as failure:
            raise SolveFailed(f"measured.{name}: {failure}") from None
        balance = self.model.balance
        return {
            "peak frequency": point.state.omega / (2 * np.pi),
            "amplitude": point.amplitude,
            "preload": balance.preload(point.state),
            "energy": float(balance.energy(point.state).sum()),
        }[target.of]

    def _frequency(self, stuck: bool, mode: int) -> float:
        reduced = self.model.reduced
        if mode > reduced.system.n_dof:
            raise Refusal(f"there is no mode {mode}: the model has {reduced.system.n_dof}")
        springs = joints.contact_stiffness(self.file.scene, reduced) if stuck else None
        return float(linear_modes(reduced, springs, mode)[0][mode - 1])

    @cached_property
    def _state_at_rest(self) -> State:
        still = self.model.balance.with_load(0.0)
        solution = newton.solve_from_rest(still, still.omega_max, settings.newton_options(self.file.scene))
        if not solution.converged:
            raise SolveFailed(f"the contact at rest: {solution.outcome}")
        return solution.state

    def _point(self, where: Place, load: float) -> OperatingPoint:
        if (where, load) not in self._points:
            site = settings.site_of(self.file.scene, where)
            balance, previous, point = self.model.balance.with_load(load), self._near_points.get((where, load)), None
            if previous is not None and previous.state.x.shape == (balance.contact.n_pair, *previous.state.x.shape[1:]):
                point = site.solve_near(balance, previous.state.omega, previous.state.x)
            if point is None or not point.solution.converged:
                point = site.solve(balance)
            if not point.solution.converged:
                raise SolveFailed(point.solution.outcome)
            self._points[where, load] = point
        return self._points[where, load]

    def _wear(self, target: Target) -> float:
        if self.file.scene.wear is None:
            raise SceneError("a life or its work is measured, but the scene has no [wear]")
        if target.left not in self._runs:
            self._runs[target.left] = wear_run.worn_out(self.file, self.model, target.left)
        run = self._runs[target.left]
        life = cycles_to_preload(run, target.left)
        if life is None:
            raise SolveFailed(f"the preload did not fall to {target.left:.3g} of its start: {run.end}")
        spent = np.concatenate([[0.0], np.cumsum(run.work.sum(axis=1))[:-1]])
        return life if target.of == "life" else float(np.interp(life, run.cycles, spent))
