"""A scene whose part is one sector of a wheel."""

from __future__ import annotations

from typing import Any

from pydantic import model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import LOADS, REDUCTION, SceneStage
from tribodyn.workflows.scene.schema import CENTRIFUGAL, MeshScene
from tribodyn.workflows.scene.wheel_tables import FlowTable, Mistuning, WheelTable, operating_line


class WheelScene(MeshScene):
    """A scene with a mesh of one sector, and the wheel that its sectors make."""

    wheel: WheelTable
    """The wheel of which the part is one sector."""
    mistuning: Mistuning | None = None
    """How far its blades differ."""
    flow: FlowTable | None = None
    """The flow round its blades, for `tribodyn wheel flutter`."""

    @model_validator(mode="before")
    @classmethod
    def _operating_line(cls, data: Any) -> Any:
        """A wheel whose speed goes with the frequency has the speed in the middle for its own."""
        wheel, response = (data.get(name) if isinstance(data, dict) else None for name in ("wheel", "response"))
        if not isinstance(wheel, dict) or not isinstance(response, dict):
            return data
        return {**data, **operating_line(wheel, response)}

    @property
    def other_speeds(self) -> tuple[float, ...]:
        mission = () if self.wear is None else self.wear.mission
        return tuple(sorted({duty.speed for duty in mission if duty.speed is not None} - {self.wheel.speed}))

    @property
    def reduced_through(self) -> SceneStage:
        """The last stage whose fields the reduced model depends on: the stress of a wheel that turns is that of its
        contact at rest under the loads."""
        return LOADS if self.wheel.speed > 0 else REDUCTION

    @model_validator(mode="after")
    def _speeds_of_a_wheel(self) -> WheelScene:
        if self.other_speeds and not self.wheel.speed:
            raise Refusal("wear.mission has a speed: give the speed of the wheel too, in wheel.speed")
        if self.other_speeds and self.wheel.along_speed:
            raise Refusal(
                "wear.mission has a speed, but along an operating line the speed follows from the frequency of the "
                'duty: leave it out, or set wheel.sweep = "frequency"'
            )
        return self

    @model_validator(mode="after")
    def _what_a_sector_is(self) -> WheelScene:
        if self.flow is not None:
            self.flow.coefficients(self.wheel.sectors)
        for contact in self.joints.values():
            outward = contact.meets_next or self.geometry is not None
            if outward and (contact.opposite is None or not isinstance(contact.group, str)):
                raise Refusal("wheel: the contact needs one group, the right face, and its opposite, the left one")
        for key, has in (
            ("contact.plane", any(contact.plane is not None for contact in self.joints.values())),
            ("motion", bool(self.motion)),
            ("geometry.no_turning", self.geometry is not None and self.geometry.no_turning is not None),
            ("prescribed", bool(self.prescribed)),
            ("reduction.relative", self.reduction.relative),
            ("reduction.solver", self.reduction.solver != "direct"),
            ("reduction.interface_modes", self.reduction.interface_modes is not None),
        ):
            if has:
                raise Refusal(f"{key} has no meaning for a sector of a wheel: leave it out")
        if CENTRIFUGAL in (*self.loads.static, *self.loads.harmonic):
            raise Refusal(f"loads: {CENTRIFUGAL} is the load that wheel.speed makes: give yours another name")
        for kind, loads in (("static", self.loads.static), ("harmonic", self.loads.harmonic)):
            for name, load in loads.items():
                if fault := load.fault_in_wheel(self.wheel.axis):
                    raise Refusal(f"loads.{kind}.{name}: {fault}")
        return self
