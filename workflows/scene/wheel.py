"""Table of a scene about the wheel that its part is one sector of."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictInt

from tribodyn.workflows.scene.fields import Direction, Frequency, Table


class Wheel(Table):
    """Identical sectors about an axis through the origin, under a wave that travels round.

    The contact meets the next sector: its group is the right face, its opposite the left one. Static loads act on every
    sector alike, harmonic loads on each sector one phase later than on its right neighbour.
    sectors : of the wheel; engine_order : waves round the wheel, phase = 2 pi engine_order / sectors
    axis : of the wheel, positive rotation leads to the left
    seam : right and left face where sectors are one piece; left out where only the contact couples them
    speed : of rotation; its centrifugal force is a static load, its stress stiffens, its frame softens
    """

    sectors: Annotated[StrictInt, Field(ge=2)]
    engine_order: Annotated[StrictInt, Field(ge=0)]
    axis: Direction = (1.0, 0.0, 0.0)
    seam: tuple[str, str] | None = None
    speed: Annotated[Frequency, Field(ge=0)] = 0.0
