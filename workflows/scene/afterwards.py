"""Tables of a scene about what is done with a finished run: pictures and verdict."""

from __future__ import annotations

from typing import Annotated

from pydantic import (
    Field,
    StrictBool,
)

from tribodyn.workflows.scene.fields import (
    Number,
    Table,
)


class Pictures(Table):
    """What is drawn after a run."""

    plots: StrictBool = True
    """Draw curves and maps."""
    renders: StrictBool = True
    """Draw the part in 3-D."""
    deformation_scale: Annotated[Number, Field(gt=0)] | None = None
    """Factor on displacements in renders; chosen by size by default."""
    wear_scale: Annotated[Number, Field(gt=0)] | None = None
    """Factor on wear depth in renders; chosen by size by default."""


class VerdictOptions(Table):
    """What is measured to judge a finished result, see `tribodyn.workflows.errors.verdict`."""

    enabled: StrictBool = True
    """Judge the result when the run is done."""
    in_time: StrictBool | None = None
    """Integrate the unworn, the middle and the late state in time; by default where the contact has at most 30
    components."""
