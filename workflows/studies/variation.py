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
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile
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


def changed(scene: str, overrides: Sequence[str], changes: Sequence[str]) -> dict[str, SceneFile]:
    """The scene, and the scene with each of the changes; raises SceneError for one that it does not know."""
    files = {"": scene_file.read(scene, overrides)}
    for change in changes:
        own = [one.strip() for one in change.split(";")]
        files[change] = scene_file.read(scene, (*overrides, *own))
    return files


def answers(file: SceneFile) -> tuple[Answers, str]:
    """Peak, energy, preload, depth and life of a scene, as the trade of its settings measures them, and the outcome."""
    found = cost.measure(file)
    return found.values, found.outcome


def vary(
    scene: str,
    changes: Sequence[str],
    overrides: Sequence[str] = (),
    task: fit_file.Task | None = None,
    tell: Callable[[str], None] = lambda sentence: None,
    ask: Callable[[SceneFile], tuple[Answers, str]] = answers,
) -> list[Varied]:
    """The scene, then the scene with each of the changes alone.

    scene : name or path; task : a fit that is done for each of them first; ask : what is wanted of a scene
    tell : called with a sentence on what is under way
    A change that cannot be solved has a row that says why; it does not stop the others.
    Raises  SceneError for a change that the scene does not know, before anything is computed
    """
    rows = []
    for change, file in changed(scene, overrides, changes).items():
        tell(change or "the scene")
        with threadpool_limits(1):
            rows.append(_row(scene, change, file, task, tell, ask))
    return rows


def _row(
    scene: str,
    change: str,
    file: SceneFile,
    task: fit_file.Task | None,
    tell: Callable[[str], None],
    ask: Callable[[SceneFile], tuple[Answers, str]],
) -> Varied:
    fitted: tuple[str, ...] = ()
    try:
        if task is not None:
            _, found = fit_file.run(scene, file.overrides, task, tell)
            fitted = tuple(found)
            file = scene_file.read(scene, (*file.overrides, *fitted))
        values, outcome = ask(file)
    except (RuntimeError, NoPeak) as failure:
        return Varied(change, {}, fitted, str(failure))
    return Varied(change, values, fitted, outcome)


def as_text(rows: Sequence[Varied]) -> str:
    """A table for people: answers in SI units, those of a change with the difference from the scene's."""
    names = [name for name, value in rows[0].values.items() if value is not None]
    names += [name for row in rows[1:] for name, v in row.values.items() if v is not None and name not in names]
    names = list(dict.fromkeys(names))
    lines = ["".join(f"{name:>24}" for name in names) + "  change"]
    for row in rows:
        own: Answers = {} if row is rows[0] else rows[0].values
        cells = "".join(f"{_beside(row.values.get(name), own.get(name)):>24}" for name in names)
        why = "" if row.outcome == ANSWERED else f": {row.outcome}"
        fitted = f" (fitted: {'; '.join(row.fitted)})" if row.fitted else ""
        lines.append(f"{cells}  {row.change or 'the scene'}{fitted}{why}")
    return "\n".join(lines)


def _beside(value: float | None, own: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.5g}" if not own else f"{value:.5g} ({100 * (value / own - 1):+.2g} %)"


def as_records(rows: Sequence[Varied]) -> list[dict[str, Any]]:
    """For machines, SI units."""
    return [{"change": row.change, **row.values, "fitted": list(row.fitted), "outcome": row.outcome} for row in rows]
