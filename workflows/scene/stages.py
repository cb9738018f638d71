"""The stage of a run that reads a field of a scene first, and the other marks that a field carries in its metadata.

Cached parts and reductions, resumption, derivatives and parameter variation follow from these marks."""

from enum import Enum, IntEnum
from typing import Any, get_args

from pydantic.fields import FieldInfo


class SceneStage(IntEnum):
    """Stages in the order in which they run; a change of a field leaves the outcome of all earlier ones as it is."""

    PART = 1
    REDUCTION = 2
    CONTACT = 3
    LOADS = 4
    SOLVE = 5
    WEAR = 6
    STUDY = 7  # errors of the finished result, and studies of the same model
    DRAW = 8  # pictures, titles, and how a result is reported


class Mark(Enum):
    """What else a field may say of itself.

    RESUMABLE : a run may be resumed with another value
    SMOOTH : the response depends on it smoothly, so that it has derivatives"""

    RESUMABLE = "resumable"
    SMOOTH = "smooth"


PART, REDUCTION, CONTACT, LOADS, SOLVE, WEAR, STUDY, DRAW = SceneStage
RESUMABLE, SMOOTH = Mark


def stage_of(field: FieldInfo) -> SceneStage | None:
    """The stage in the metadata of a field; None for one that holds tables, whose fields have theirs."""
    return next((mark for mark in marks_of(field) if isinstance(mark, SceneStage)), None)


def marks_of(field: FieldInfo) -> list[Any]:
    """All that a field carries in its metadata."""
    return [*field.metadata, *_inner_metadata(field.annotation)]


def _inner_metadata(annotation: Any) -> list[Any]:
    """Metadata inside a type, as in `Annotated[float, SOLVE] | None`."""
    inner = [mark for part in get_args(annotation) for mark in _inner_metadata(part)]
    return [*getattr(annotation, "__metadata__", ()), *inner]
