"""The distribution of a life, or of another number, over what scatters: runs, quantiles, and what to measure next."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tribodyn.hbm.quantity import names_with_error
from tribodyn.output_file import write_text
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number
from tribodyn.workflows.scene.load_tables import StaticLoad
from tribodyn.workflows.scene.matrix_scene import DofLoad
from tribodyn.workflows.scene.scene_file import AnyPath, SceneError
from tribodyn.workflows.scene.scene_values import smooth_numbers
from tribodyn.workflows.studies.files import write_picture
from tribodyn.workflows.studies.many import quantiles, study_file, study_pictures, study_runs as studies
from tribodyn.workflows.studies.many.life_fit import PROBED, LifeFit, Quantile, half_width, quantile_of
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.quantiles import RARE, Influence, Sample, influences
from tribodyn.workflows.studies.many.run_task import solve
from tribodyn.workflows.studies.many.study_file import LISTED, ParameterStudy
from tribodyn.workflows.studies.many.study_runs import Runner
from tribodyn.workflows.studies.many.study_table import LIFE, Journal, RunsResult, StudyTable

COEFFICIENT = "wear.coefficient"
BATCH = 8  # runs that are added at a time


@dataclass(frozen=True, repr=False)
class LifeDistribution(RunsResult):
    """A number as a distribution.

    table : of the full runs; runs : that have the number; open : of them, those with only a lower bound of it
    missing : runs that lack the number
    scaled : keys whose common factor, one set after the other, a life is in proportion to the reciprocal of
    explained : share of the variance that the surrogate explains where runs are left out
    scatter : standard deviation of the number's logarithm; of the number itself where it is not always above 0
    model_error : relative, None where it is not known; model_error_of : where it is from, or why it is not known
    values, weights : (n,) in order: the expected distribution"""

    STEM: ClassVar[str] = "lives"

    name: str
    number: str
    table: StudyTable
    quantiles: tuple[Quantile, ...]
    influences: tuple[Influence, ...]
    confidence: float
    runs: int
    open: int
    missing: int
    scaled: tuple[tuple[str, ...], ...]
    explained: float
    scatter: float
    logarithmic: bool
    model_error: float | None
    model_error_of: str
    values: np.ndarray
    weights: np.ndarray

    def record(self) -> dict[str, Any]:
        names = ("name", "number", "confidence", "runs", "open", "missing", "scaled", "explained", "scatter",
               "logarithmic", "model_error", "model_error_of")  # fmt: skip
        return {
            **{name: getattr(self, name) for name in names},
            "quantiles": [{"name": q.name, **asdict(q)} for q in self.quantiles],
            "influences": [{**asdict(i), "remaining": i.remaining} for i in self.influences],
        }

    def lines(self) -> list[str]:
        runs = f"{self.runs} runs" + (f" ({self.open} of them survived, or ended before)" if self.open else "")
        source = "not known: " + self.model_error_of if self.model_error is None else self.model_error_of
        error = "" if self.model_error is None else f"{100 * self.model_error:.2g} %, "
        texts = [
            f"{self.number} from {runs}" + (f", {self.missing} more have none" if self.missing else ""),
            *(f"in proportion to the reciprocal of {' and '.join(group)}, by two runs" for group in self.scaled),
            f"surrogate explains {100 * self.explained:.2f} % of the variance of runs that are left out",
            f"error of the model itself: {error}{source}",
            f"{'':8}{'value':>12}   {100 * self.confidence:g} % sure{'':17}with the model's error",
        ]
        for q in self.quantiles:
            ends = f"{q.low:.4g} .. {q.high:.4g}"
            range_in_all = "" if self.model_error is None else f"{q.low_in_all:.4g} .. {q.high_in_all:.4g}"
            least = "  at least: some parts survive, or their runs ended before" if q.at_least else ""
            texts.append(f"{q.name:8}{q.value:12.4g}   {ends:26}{range_in_all}{least}".rstrip())
        scatter = f"{100 * self.scatter:.3g} %" if self.logarithmic else f"{self.scatter:.3g}"
        texts.append(f"scatter {scatter}; measured exactly, a key leaves of it (first and total Sobol index):")
        texts += [f"  {i.key:32}{100 * i.remaining:6.1f} %   ({i.first:.3f}, {i.total:.3f})" for i in self.influences]
        return self.table.troubles() + texts

    def plot(self) -> Figure:
        """The distribution with its quantiles, and what it depends on."""
        return study_pictures.picture_of_lives(self)


def lives(
    study: AnyPath | Mapping[str, Any],
    folder: AnyPath | None = None,
    *,
    rare: Number | None = None,
    workers: int | None = None,
    scheduler: str = "",
    fresh: bool = False,
    progress: Report = None,
) -> LifeDistribution:
    """Life distribution: what life a share of the parts outlives (B10), how sure that is, and what to measure next.

    study : the .toml file of a study that draws from distributions, or its tables; its table [lives] has what is wanted
    folder : folder of lives.json, lives.png and the study's tables; results/NAME by default
    rare : share of the parts whose value is wanted as well, and that runs are added for, such as 1e-4
    workers : processes; as many as there are cores by default
    scheduler : address of a scheduler of dask.distributed, or "local": processes here
    fresh : do again the runs that the folder holds already
    Raises  Refusal: what is asked for cannot be; SolveFailed: no run has the number, a lost scheduler"""
    plan = study_file.read(study)
    runner = Runner(studies.place(plan, folder), reporter(progress), workers, scheduler, fresh)
    return _distribution(plan, runner, rare)


def _distribution(study: ParameterStudy, runner: Runner, rare: float | None) -> LifeDistribution:
    """Runs until the first share is known as well as is wanted, and what they come to."""
    life_settings = study.lives
    if study.settings.design in LISTED:
        raise SceneError(f'{study.name}: lives are drawn, give design = "sobol" and distributions instead of lists')
    if rare is not None and not 0 < rare < 1:
        raise Refusal(f"rare {rare}: give a share between 0 and 1")
    space, groups = ParameterSpace.of(study), _scaling(study)
    shares = life_settings.shares if rare is None else (rare, *life_settings.shares)
    middle = space.run_of(space.values(np.full((1, len(space.keys)), 0.5))[0])
    probes = [{**middle, **{key: PROBED * middle[key] for key in group}} for group in groups]
    added: list[dict[str, Any]] = [middle, *probes] if probes else []
    while True:
        next_runner = replace(runner, fresh=runner.fresh and len(added) <= len(groups) + 1)
        table = studies.run(study, next_runner, added=added, drawn=False)
        life_fit = LifeFit.of(space, table, life_settings.number, study.settings.runs or 0, shares[0], groups)
        sample = Sample.of(life_fit.space, life_fit.surrogate, shares[0] < RARE)
        half = half_width(life_fit, sample, shares[0], life_settings.confidence)
        done = len(table.columns["run"])
        if life_settings.within is None or half <= life_settings.within or done >= life_settings.most:
            break
        runner.progress.say(
            f"after {done} runs P{100 * shares[0]:.6g} is known within {100 * half:.2g} %: runs are added"
        )
        points = quantiles.next_runs(sample, life_fit.surrogate, shares[0], min(BATCH, life_settings.most - done))
        added += [space.run_of(point) for point in points]
    folder = runner.folder
    if study_pictures.shown(table):
        write_picture(table.plot, folder / "study.png")
    error, source = _model_error(study, middle, table, folder, runner.progress)
    distribution = _result(study, table, life_fit, sample, shares, error, source)
    write_text(folder / "lives.json", json.dumps(distribution.record(), indent=2) + "\n")
    write_picture(distribution.plot, folder / "lives.png")
    return distribution


def _scaling(study: ParameterStudy) -> list[tuple[str, ...]]:
    """Keys that vary whose common factor a life may be in proportion to the reciprocal of.

    So the wear coefficient, that rates are in proportion to; and all loads together, of a contact whose forces are in
    proportion to displacements and whose depth counts beside them. Two runs say whether it is so in a scene"""
    if study.lives.number != LIFE or study.correlations:
        return []
    numbers = smooth_numbers(scene_file.read(study.scene, study.settings.set).scene)
    loads = [key for key, number in numbers.items() if isinstance(number.table, (StaticLoad, DofLoad))]
    originals = {**{key: key for key in study.varied}, **study.settings.same}
    groups: list[tuple[str, ...]] = [(COEFFICIENT,)] if COEFFICIENT in study.varied else []
    if loads and all(key in originals for key in loads):
        groups.append(tuple(dict.fromkeys(originals[key] for key in loads)))
    return groups


def _model_error(
    study: ParameterStudy, middle: Mapping[str, float], table: StudyTable, folder: Path, progress: Progress
) -> tuple[float | None, str]:
    """Relative error of the model itself, and where it is from."""
    stated, quantity = study.lives.model_error, study.lives.number.removesuffix("_first")
    if stated is not None:
        return stated, "given"
    if quantity not in names_with_error():
        return None, f"a verdict says nothing about {study.lives.number}"
    errors = np.asarray(table.columns.get(f"{quantity}_error", np.empty(0)), float)
    if np.isfinite(errors).any():
        return float(np.nanmedian(errors)), f"median of the verdicts on {np.isfinite(errors).sum()} runs"
    task, journal = studies.task_at(study, middle), Journal(folder / "medians")
    row = journal.rows().get(task.key)
    if row is None:
        with progress.stage("verdict on the run at the medians"):
            row = solve(task)
        journal.path.parent.mkdir(exist_ok=True)
        journal.begin([row])
    error = row.numbers.get(f"{quantity}_error")
    if error is None:
        return None, f"the verdict on the run at the medians has none ({row.sentence})"
    return error, "verdict on the run at the medians"


def _result(
    study: ParameterStudy, table: StudyTable, life_fit: LifeFit, sample: Sample,
    shares: Sequence[float], error: float | None, source: str,
) -> LifeDistribution:  # fmt: skip
    settings, body = study.lives, sample
    if shares[0] < RARE:
        body = Sample.of(life_fit.space, life_fit.surrogate)
    back = np.exp if life_fit.logarithmic else np.asarray
    quantile_list = []
    for share in sorted(shares):
        of = sample if share < RARE else body
        quantile_list.append(quantile_of(life_fit, of, share, settings.confidence, error))
    middle = float(body.mean @ body.weight)
    scatter = float(np.sqrt((body.mean - middle) ** 2 @ body.weight))
    return LifeDistribution(
        study.name, settings.number, table, tuple(quantile_list), influences(life_fit.space, life_fit.surrogate.mean),
        settings.confidence, life_fit.runs, life_fit.open, len(table.columns["run"]) - life_fit.runs, life_fit.scaled,
        life_fit.surrogate.explained, scatter, life_fit.logarithmic, error, source, back(body.mean), body.weight,
    )  # fmt: skip
