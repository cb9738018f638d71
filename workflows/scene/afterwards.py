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


VERDICT_SECONDS = (10.0, 60.0)  # bounds where the scene gives none
# of the seconds of the run: what a verdict needs besides its measurements keeps both below twice the run
VERDICT_SHARE = 0.9


class VerdictOptions(Table):
    """What is measured to judge a finished result, see `tribodyn.workflows.accuracy.verdict`."""

    enabled: StrictBool = True
    """Judge the result when the run is done."""
    seconds: Annotated[Number, Field(gt=0)] | None = None
    """Processor seconds that the measurements may take together; what they do not reach is not known. By default nine
    tenths of those of the run, but 10 at least and 60 at most."""
    mesh: StrictBool = True
    """Solve the unworn contact on other meshes, and with more modes."""
    in_time: StrictBool | None = None
    """Integrate the unworn, the middle and the late state in time; by default where the contact has at most 60
    components and the seconds last."""

    def limit(self, spent: float) -> float:
        """Processor seconds that the measurements may take after a run that took `spent` of them."""
        return self.seconds or min(max(VERDICT_SHARE * spent, VERDICT_SECONDS[0]), VERDICT_SECONDS[1])
