"""Table of a scene about the wheel that its part is one sector of."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictInt

from tribodyn.workflows.scene.fields import Direction, Frequency, Table


class Wheel(Table):
    """Identical sectors about an axis through the origin, under a wave that travels round.

    The contact meets the next sector: its group is the right face, its opposite the left one. Static loads act on every
    sector alike, harmonic loads on each sector one phase later than on its right neighbour.
    """

    sectors: Annotated[StrictInt, Field(ge=2)]
    """Number of sectors."""
    engine_order: Annotated[StrictInt, Field(ge=0)]
    """Waves round the wheel; the phase from sector to sector is 2 pi engine_order / sectors."""
    axis: Direction = (1.0, 0.0, 0.0)
    """Axis of the wheel; positive rotation leads to the left."""
    seam: tuple[str, str] | None = None
    """Right and left face where sectors are one piece; left out where only the contact couples them."""
    speed: Annotated[Frequency, Field(ge=0)] = 0.0
    """Speed of rotation: its centrifugal force is a static load, its stress stiffens, its frame softens."""
