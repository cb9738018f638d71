"""The values of a scene one by one, each with its key and the stage that reads it first."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo

from tribodyn.workflows.scene.fields import (
    PARAMETERS,
    RESUMABLE,
    SMOOTH,
    SOLVE,
    SceneStage,
    Table,
    UsualRange,
    marks_of,
    stage_of,
)


@dataclass(frozen=True)
class SceneValue:
    """A value that is no table.

    path : names of the tables that lead to it, then its own
    table : that it stands in
    stage : that reads it first
    is_resumable, is_smooth : see `stages.Mark`
    usual : range in which its numbers usually lie, None where its field declares none"""

    path: tuple[str, ...]
    value: Any
    table: Table
    stage: SceneStage
    is_resumable: bool = False
    is_smooth: bool = False
    usual: UsualRange | None = None

    @property
    def key(self) -> str:
        """Its key, such as "contact.friction"."""
        return ".".join(self.path)

    @property
    def name(self) -> str:
        """Its name in its table."""
        return self.path[-1]


def scene_values(table: Table, path: tuple[str, ...] = ()) -> Iterator[SceneValue]:
    """All values of a table and of those inside it, in the order of the scene classes."""
    for name, field in type(table).model_fields.items():
        if name == PARAMETERS:
            continue
        value, stage = getattr(table, name), stage_of(field)
        inner = list(_tables_inside(value, (*path, name)))
        if stage is not None and not inner:
            marks = marks_of(field)
            smooth, usual = SMOOTH in marks, usual_range(field)
            inner = [SceneValue((*path, name), value, table, stage, RESUMABLE in marks, smooth, usual)]
        yield from inner
    for name, number in (getattr(table, PARAMETERS, {}) | table.numbers).items():
        yield SceneValue((*path, name), number, table, table.NUMBERS_STAGE, is_smooth=isinstance(number, float))


def _tables_inside(value: Any, path: tuple[str, ...]) -> Iterator[SceneValue]:
    """The values of a table, or of the tables in a dict or a list."""
    if isinstance(value, Table):
        yield from scene_values(value, path)
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from _tables_inside(item, (*path, name))
    elif isinstance(value, tuple):
        for position, item in enumerate(value):
            yield from _tables_inside(item, (*path, str(position)))


def values_through(table: Table, last: SceneStage) -> dict[str, Any]:
    """Key -> value of all that is read up to a stage: scenes with equal ones have the same outcome of that stage."""
    return {entry.key: entry.value for entry in scene_values(table) if entry.stage <= last}


def smooth_numbers(scene: Table) -> dict[str, SceneValue]:
    """The numbers of a scene that its response depends on smoothly, by their keys; zeros are left out."""
    return {
        entry.key: entry
        for entry in scene_values(scene)
        if entry.is_smooth and entry.stage <= SOLVE and isinstance(entry.value, float) and entry.value != 0.0
    }


def usual_range(field: FieldInfo) -> UsualRange | None:
    """The range in which the numbers of a field usually lie, the outermost of several, None where it declares none."""
    return next((mark for mark in reversed(marks_of(field)) if isinstance(mark, UsualRange)), None)


def unusual_values(table: Table) -> list[str]:
    """A sentence on each number of a scene that lies outside its usual range."""
    return [
        remark
        for entry in scene_values(table)
        if (usual := entry.usual or entry.table.usual_ranges.get(entry.name)) is not None
        for remark in usual.remarks(entry.key, entry.value)
    ]
