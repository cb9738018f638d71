"""Table of a scene about the wheel that its part is one sector of."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StrictBool, StrictInt, TypeAdapter, ValidationError, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    PART,
    REDUCTION,
    SMOOTH,
    STUDY,
    Direction,
    Frequency,
    Length,
    Number,
    Table,
    UsualRange,
)


class WheelTable(Table, stage=REDUCTION):
    """Identical sectors about an axis through the origin, under a wave that travels round.

    A contact with the next sector has the right face as its first one, the left one as its second. Static loads act on
    every sector alike, harmonic loads on each sector one phase later than on its right neighbour."""

    sectors: Annotated[StrictInt, Field(ge=2), PART]
    """Number of sectors."""
    engine_order: StrictInt
    """Waves round the wheel; the phase from sector to sector is 2 pi engine_order / sectors. Above 0 they run in the
    sense of the rotation, below 0 against it, as those of a disturbance that stands still in space do."""
    axis: Annotated[Direction, PART] = (1.0, 0.0, 0.0)
    """Axis of the wheel; positive rotation leads to the left."""
    seam: tuple[str, str] | None = None
    """Right and left face where sectors are one piece; left out where only the contact couples them."""
    speed: Annotated[Frequency, Field(ge=0), UsualRange(0.0, 3000.0, "Hz"), PART, SMOOTH] = 0.0
    """Speed of rotation: its centrifugal force is a static load, its stress stiffens, its frame softens and turns."""
    sweep: Literal["speed", "frequency"] | None = None
    """What the response is followed along: "speed", an operating line on which the frequency is the engine order times
    the speed, stress and contact at rest those of every speed; or "frequency", at constant `speed`. "speed" where
    `response.speed` is given, else "frequency"."""
    coriolis: StrictBool = True
    """Whether the Coriolis forces of the turning frame act: they part waves with the rotation from those against."""

    @property
    def along_speed(self) -> bool:
        """Whether the response is followed along an operating line."""
        return self.sweep == "speed"


def operating_line(wheel: dict[str, Any], response: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The tables [wheel] and [response] of a scene, not checked yet, with what an operating line fills in.

    The frequency follows from `response.speed`, or the speeds from the frequency; the wheel's own speed is the one in
    the middle. Raises ValueError where they contradict each other"""
    order, speed, frequency = wheel.get("engine_order"), response.get("speed"), response.get("frequency")
    sweep = wheel.get("sweep") or ("frequency" if speed is None else "speed")
    if sweep != "speed":
        if speed is not None:
            raise Refusal('response.speed is for wheel.sweep = "speed": give response.frequency instead')
        return {}
    if order == 0:
        raise Refusal(
            'wheel.sweep = "speed": the frequency of engine order 0 does not go with the speed; set it to "frequency"'
        )
    try:
        ranges = {"speed": speed, "frequency": frequency}
        parsed = {key: RANGE.validate_python(value) for key, value in ranges.items() if value}
        wheel_speed = FREQUENCY.validate_python(wheel["speed"]) if "speed" in wheel else None
        each = abs(int(order))  # type: ignore[arg-type]
    except (ValidationError, TypeError, ValueError):
        return {}  # reported where the key itself is read
    if not parsed:
        return {}
    speeds = np.array(parsed["speed"] if "speed" in parsed else parsed["frequency"]) / (
        1 if "speed" in parsed else each
    )
    if len(parsed) == 2 and not np.allclose(parsed["frequency"], each * speeds, rtol=1e-9):
        raise Refusal("response.speed and response.frequency are both given: leave one of them out")
    middle = float(speeds.mean())
    if wheel_speed and not np.isclose(wheel_speed, middle, rtol=1e-9):
        raise Refusal('wheel.speed is given, but with wheel.sweep = "speed" it follows from the response: leave it out')
    hertz = parsed.get("frequency") or [float(each * s) for s in speeds]
    return {"wheel": {**wheel, "sweep": "speed", "speed": middle}, "response": {**response, "frequency": hertz}}


FREQUENCY = TypeAdapter(Frequency)
RANGE = TypeAdapter(tuple[Frequency, Frequency])
Spread = Annotated[Number, Field(ge=0, le=0.3)]


class Mistuning(Table, stage=STUDY):
    """Blades that differ: what is drawn for `tribodyn wheel patterns`, blade by blade and pattern by pattern.

    All deviations are normally distributed and cut off at three standard deviations."""

    frequency: Spread = 0.0
    """Standard deviation of the blades' own frequencies at rest, relative; elastic stiffness goes with its square."""
    friction: Spread = 0.0
    """Standard deviation of the coefficient of friction of every blade's contacts, relative."""
    gap: Annotated[Length, Field(ge=0)] = 0.0
    """Standard deviation of the gap of every blade's contacts."""
    body: str | None = None
    """Body whose elastic stiffness deviates; the whole sector by default."""
    families: Annotated[StrictInt, Field(ge=1)] = 2
    """Modes of every nodal diameter in which a deviating stiffness acts, beside the static shapes of the loads."""
    left_out: Annotated[Number, Field(gt=0, lt=1)] = 1e-3
    """Share of strain energy below which one of these shapes counts as made of the others; smaller is more exact."""
    patterns: Annotated[StrictInt, Field(ge=1)] = 100
    """Number of patterns that are drawn."""
    seed: StrictInt = 1
    """Of what is drawn: the same seed and number give the same pattern, however many there are."""
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    """Error of the response between the points at which a pattern is scanned for its highest peak."""


Influence = tuple[StrictInt, Number, Number]


class FlowTable(Table, stage=STUDY):
    """Forces of a flow on the vibrating blades of the wheel, by coefficients of one family of modes; see the theory of
    flutter."""

    influence: tuple[Influence, ...] = ()
    """Rows [k, real, imaginary] of the influence coefficients: of the blade k places to the left on a blade."""
    by_diameter: tuple[Influence, ...] = ()
    """Rows [j, real, imaginary] for every wave of the wheel instead, j > 0 with the rotation: half the imaginary part
    is the aerodynamic damping ratio, half of the real part the relative shift of frequency."""
    mode: Annotated[StrictInt, Field(ge=0)] = 0
    """Number of the family, from 0, among the modes of the stuck wheel."""

    @model_validator(mode="after")
    def _one_kind(self) -> FlowTable:
        if bool(self.influence) == bool(self.by_diameter):
            raise Refusal("flow: give either influence or by_diameter")
        for name, rows in (("influence", self.influence), ("by_diameter", self.by_diameter)):
            if len({row[0] for row in rows}) != len(rows):
                raise Refusal(f"flow.{name}: a row is there twice")
        return self

    def coefficients(self, sectors: int) -> dict[int, complex]:
        """Influence coefficients c_k of a wheel of so many sectors; raises ValueError where waves are missing."""
        if self.influence:
            return {k: complex(real, imaginary) for k, real, imaginary in self.influence}
        waves = {j % sectors: complex(real, imaginary) for j, real, imaginary in self.by_diameter}
        if len(waves) != sectors or len(self.by_diameter) != sectors:
            raise Refusal(
                f"flow.by_diameter: give a row for each of the {sectors} waves, such as j = 0 to {sectors - 1}"
            )
        turns = [np.exp(2j * np.pi * np.arange(sectors) * k / sectors) for k in range(sectors)]
        values = np.array([waves[j] for j in range(sectors)])
        return {k: complex(values @ turn) / sectors for k, turn in enumerate(turns)}
