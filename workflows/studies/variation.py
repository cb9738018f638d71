"""One thing changed at a time: what each change of a scene does to its answers.

A change is one or several keys of the scene, joined by ";". Where a number of the scene was fitted to a measured one,
such as a preload, it is fitted again for every change, so that changes are compared at the same measured state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from threadpoolctl import threadpool_limits

from tribodyn.hbm.continuation.operating_point import NoPeak
from tribodyn.workflows.errors import cost
from tribodyn.workflows.errors.trade_table import ANSWERED
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.source import AnyPath, Overrides, Source, read_scene
from tribodyn.workflows.studies.fits import fit_file

Answers = Mapping[str, float | None]


@dataclass(frozen=True)
class Varied:
    """A scene with one change.

    change : overrides, joined by ";", empty for the scene itself; values : answers by name, SI units, None where there
    is none; fitted : overrides that a fit found for it; outcome : ANSWERED or why answers are missing
    """

    change: str
    values: Answers
    fitted: tuple[str, ...] = ()
    outcome: str = ANSWERED


@dataclass(frozen=True)
class Variation:
    """A scene and its changes, the scene itself first."""

    rows: tuple[Varied, ...]

    def record(self) -> list[dict[str, Any]]:
        """For machines, SI units."""
        return [
            {"change": row.change, **row.values, "fitted": list(row.fitted), "outcome": row.outcome}
            for row in self.rows
        ]

    def lines(self) -> list[str]:
        """A table: answers in SI units, those of a change with the difference from the scene's."""
        names = list(dict.fromkeys(n for row in self.rows for n, value in row.values.items() if value is not None))
        lines = ["".join(f"{name:>24}" for name in names) + "  change"]
        for row in self.rows:
            own: Answers = {} if row is self.rows[0] else self.rows[0].values
            cells = "".join(f"{_beside(row.values.get(name), own.get(name)):>24}" for name in names)
            why = "" if row.outcome == ANSWERED else f": {row.outcome}"
            fitted = f" (fitted: {'; '.join(row.fitted)})" if row.fitted else ""
            lines.append(f"{cells}  {row.change or 'the scene'}{fitted}{why}")
        return lines


def answers(file: SceneFile) -> tuple[Answers, str]:
    """Peak, energy, preload, depth and life of a scene, as the trade of its settings measures them, and the outcome."""
    found = cost.measure(file)
    return found.values, found.outcome


def vary(
    scene: Source,
    changes: Sequence[str],
    *,
    fit: AnyPath | Mapping[str, Any] | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> Variation:
    """Change one thing of a scene at a time: what each change does to its peak, energy, depth and life.

    A change that cannot be solved has a row that says why; it does not stop the others.

    scene : name of a scene or a .toml file
    changes : key to change, such as "damping.modal=2 %", or several joined by ";"; can be repeated
    fit : file of a fit, as for `identify`, that is done again for every change, such as of a preload
    Raises  SceneError for a change that the scene does not know, before anything is computed
    """
    if not changes:
        raise ValueError('--change: give what is to change, such as --change "damping.modal=2 %"')
    return each(scene, changes, overrides, None if fit is None else fit_file.read(fit), reporter(progress), answers)


def changed(scene: Source, overrides: Overrides, changes: Sequence[str]) -> dict[str, SceneFile]:
    """The scene, and the scene with each of the changes; raises SceneError for one that it does not know."""
    base = read_scene(scene, overrides)
    own = {change: [one.strip() for one in change.split(";") if one.strip()] for change in changes}
    return {"": base} | {change: base.changed(*keys) for change, keys in own.items()}


def each(
    scene: Source,
    changes: Sequence[str],
    overrides: Overrides,
    task: fit_file.Task | None,
    progress: Progress,
    ask: Callable[[SceneFile], tuple[Answers, str]],
) -> Variation:
    """The scene, then the scene with each of the changes alone. ask : what is wanted of a scene"""
    rows = []
    for change, file in changed(scene, overrides, changes).items():
        progress.say(change or "the scene")
        with threadpool_limits(1):
            rows.append(_row(change, file, task, progress, ask))
    return Variation(tuple(rows))


def _row(
    change: str,
    file: SceneFile,
    task: fit_file.Task | None,
    progress: Progress,
    ask: Callable[[SceneFile], tuple[Answers, str]],
) -> Varied:
    fitted: tuple[str, ...] = ()
    try:
        if task is not None:
            fitted = fit_file.best(file, task, progress).changes
            file = file.changed(*fitted)
        values, outcome = ask(file)
    except (RuntimeError, NoPeak) as failure:
        return Varied(change, {}, fitted, str(failure))
    return Varied(change, values, fitted, outcome)


def _beside(value: float | None, own: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.5g}" if not own else f"{value:.5g} ({100 * (value / own - 1):+.2g} %)"
