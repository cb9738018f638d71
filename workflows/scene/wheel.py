"""Table of a scene about the wheel that its part is one sector of."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictBool, StrictInt

from tribodyn.workflows.scene.fields import Direction, Frequency, Table


class Wheel(Table):
    """Identical sectors about an axis through the origin, under a wave that travels round.

    A contact with the next sector has the right face as its first one, the left one as its second. Static loads act on
    every sector alike, harmonic loads on each sector one phase later than on its right neighbour.
    """

    sectors: Annotated[StrictInt, Field(ge=2)]
    """Number of sectors."""
    engine_order: StrictInt
    """Waves round the wheel; the phase from sector to sector is 2 pi engine_order / sectors. Above 0 they run in the
    sense of the rotation, below 0 against it, as those of a disturbance that stands still in space do."""
    axis: Direction = (1.0, 0.0, 0.0)
    """Axis of the wheel; positive rotation leads to the left."""
    seam: tuple[str, str] | None = None
    """Right and left face where sectors are one piece; left out where only the contact couples them."""
    speed: Annotated[Frequency, Field(ge=0)] = 0.0
    """Speed of rotation: its centrifugal force is a static load, its stress stiffens, its frame softens and turns."""
    coriolis: StrictBool = True
    """Whether the Coriolis forces of the turning frame act: they part waves with the rotation from those against."""
