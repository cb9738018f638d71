"""Faces of a body that a scene picks by rule."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, StrictInt, model_validator

from tribodyn.geometry.sources.picking import Rule
from tribodyn.workflows.scene.fields import Angle, Direction, Length, Table

Point = tuple[Length, Length, Length]


class FaceRule(Table):
    """A face of a body: the facets of its boundary that satisfy all that is given.

    Places are those of the file or part, before the body is moved, in metres unless a unit is given.
    """

    box: tuple[Point, Point] | None = None
    """Two corners of a box within which the whole facets lie."""
    nearest: Point | None = None
    """Point whose nearest smooth face is taken: all that goes on from there without an edge."""
    normal: Direction | None = None
    """Direction in which the facets look, outwards."""
    within: Annotated[Angle, Field(gt=0, le=math.pi)] = math.radians(5.0)
    """How far a facet may look away from `normal`."""
    cad: tuple[StrictInt, ...] = ()
    """Numbers of faces of a CAD file, as `tribodyn inspect` lists them."""

    @model_validator(mode="after")
    def _something(self) -> FaceRule:
        if self.box is None and self.nearest is None and self.normal is None and not self.cad:
            raise ValueError("expected a rule: box, nearest, normal or cad")
        return self

    @property
    def rule(self) -> Rule:
        """The rule for geometry.sources.picking."""
        return Rule(self.box, self.nearest, self.normal, self.within, self.cad)
