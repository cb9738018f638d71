"""Tables of a scene about stress: places and gauges where it is observed, and what the materials endure."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, StrictInt, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    DRAW,
    PART,
    STUDY,
    Direction,
    Length,
    Number,
    Pressure,
    Table,
    TemperatureChange,
)

Strength = Annotated[Pressure, Field(gt=0)]
Factor = Annotated[Number, Field(gt=0, le=1)]


class StressPlaceTable(Table, stage=PART):
    """A place whose stress is observed."""

    point: tuple[Length, Length, Length]
    """The point; the nearest one of the part is taken."""
    body: str | None = None
    """Body that it belongs to, where several meet there."""


class StressTable(Table, stage=PART):
    """Stress of the part."""

    places: dict[str, StressPlaceTable] = Field(default_factory=dict)
    """Places by name, whose stress is a number of the run like its amplitude, with its error and derivatives."""
    hot_spots: Annotated[StrictInt, Field(ge=0, le=20), DRAW] = 3
    """How many places of the largest stress the program looks for in the states that pictures show, apart from each
    other; with 0 the largest stress and utilisation of the part are not stated."""


class GaugeTable(Table, stage=PART):
    """A strain gauge: the mean strain along a line on the part, observed as an output."""

    point: tuple[Length, Length, Length]
    """Its middle."""
    direction: Direction
    """Direction along which it measures."""
    length: Annotated[Length, Field(gt=0)]
    """Its length."""


class FatigueTable(Table, stage=STUDY):
    """What a material endures: a Haigh diagram of high-cycle fatigue, and the S-N line beyond it."""

    endurance_limit: Strength
    """Amplitude of fully reversed stress that is endured for ever."""
    strength: Strength
    """Tensile strength."""
    yield_strength: Strength | None = None
    """Yield strength, for the diagram of Soderberg."""
    diagram: Literal["goodman", "gerber", "soderberg"] | tuple[tuple[Pressure, Pressure], ...] = "goodman"
    """How the amplitude that is endured falls with the mean stress: one of the three, or points [mean, amplitude] of a
    Haigh diagram by rising mean, which hold the factors already."""
    torsion_limit: Strength | None = None
    """Amplitude of fully reversed shear that is endured: with it the criterion of Crossland judges, without it the
    diagram with the octahedral amplitude and the mean of the sum of normal stresses."""
    surface_factor: Factor = 1.0
    """Factor of the surface on the endurance limits."""
    size_factor: Factor = 1.0
    """Factor of the size on the endurance limits."""
    temperatures: tuple[tuple[TemperatureChange, Factor], ...] = ()
    """Points [change of temperature, factor] by rising change: what static loads that heat the part leave of all its
    limits and strengths, straight between the points."""
    knee: Annotated[Number, Field(gt=0)] | None = None
    """Cycles at the knee of the S-N line, cycles = knee / utilisation ^ exponent."""
    exponent: Annotated[Number, Field(gt=0)] | None = None
    """Exponent of the S-N line."""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.diagram == "soderberg" and self.yield_strength is None:
            raise Refusal('expected yield_strength with diagram = "soderberg"')
        if not isinstance(self.diagram, str):
            means = [mean for mean, _ in self.diagram]
            if len(means) < 2 or means != sorted(set(means)) or min(a for _, a in self.diagram) < 0:
                raise Refusal("expected at least two points [mean, amplitude] by rising mean, amplitudes not negative")
        changes = [change for change, _ in self.temperatures]
        if changes != sorted(set(changes)):
            raise Refusal("expected temperatures as points [change of temperature, factor] by rising change")
        if (self.knee is None) != (self.exponent is None):
            raise Refusal("expected both knee and exponent of the S-N line, or none")
        if self.endurance_limit >= self.strength:
            raise Refusal("expected an endurance_limit below the strength")
        return self
