"""The scene: what one TOML file asks for, checked and in SI units.

Every key of the file is a field below; a key that is not here is an error. What a scene leaves out is not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, Self, TypeVar

from pydantic import (
    Field,
    PrivateAttr,
    StrictBool,
    StrictInt,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_serializer,
    model_validator,
)

from tribodyn.declare import read
from tribodyn.geometry import parts
from tribodyn.workflows.scene.contact import Contact, FaceContact, Surfaces
from tribodyn.workflows.scene.fields import (
    Angle,
    Direction,
    Force,
    Frequency,
    Length,
    Number,
    Pressure,
    Stiffness,
    Table,
    quantity,
)
from tribodyn.workflows.scene.own import beside, folder_of, is_file, numbers, own_file
from tribodyn.workflows.scene.wear import Wear
from tribodyn.workflows.scene.wheel import Wheel
from tribodyn.workflows.scene.words import unknown_key

CENTRIFUGAL = "centrifugal"
HIGHEST = 15  # harmonic that kept = "auto" may keep


class Heading(Table):
    """What the scene is and where its numbers come from."""

    title: str
    """What the scene is, in one line; `tribodyn list` and every picture show it."""
    source: str = ""
    """Where its numbers come from."""
    notes: str = ""
    """Remarks for the reader."""


class Geometry(Table):
    """A part of geometry/ or a mesh file, and the groups that are held fixed.

    All other keys of the table are parameters of the part; those left out have the part's own defaults.
    """

    part: str | None = None
    """Name of a parametric part; its parameters are further keys of this table."""
    mesh: str | None = None
    """Mesh file of second order, relative to the scene file, instead of a part."""
    fixed: tuple[str, ...] = ()
    """Groups of the mesh that are clamped."""
    fixed_axes: dict[str, str] = Field(default_factory=dict)
    """Groups held along some axes only: group = letters out of "xyz"."""
    no_turning: Direction | None = None
    """Axis about which the part as a whole cannot turn."""
    parameters: dict[str, int | float] = Field(default_factory=dict)
    """Parameters of the part, gathered from the other keys of the table."""

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, table: Any, info: ValidationInfo) -> Any:
        if not isinstance(table, dict) or "parameters" in table:
            return table
        own = {key: value for key, value in table.items() if key in cls.model_fields}
        other = {key: value for key, value in table.items() if key not in cls.model_fields}
        if ("part" in own) == ("mesh" in own):
            raise ValueError('expected either part = "name" or mesh = "file.msh", and not both')
        if not isinstance(own.get("part"), str):
            return own | other  # a mesh file has no parameters: the other keys are unknown ones
        return own | {"parameters": part_parameters(own["part"], other, folder_of(info))}

    _own: Path | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._own = own_file(folder_of(info), self.part, "geometry.part")
        return self

    @property
    def part_name(self) -> str | None:
        """The part for geometry.parts: its name, or the path of the file beside the scene."""
        return self.part if self._own is None else str(self._own)


def part_parameters(part: str, given: dict[str, Any], folder: Path | None = None) -> dict[str, int | float]:
    """Parameters of a part in SI units: all of them, or those given to a file of one's own, which is not run here.

    given : key -> number or text with a unit; folder : of the scene
    Raises  ValueError: no such part, unknown key, or a value that the part refuses
    """
    general = [name for name in Geometry.model_fields if name != "parameters"]
    if is_file(part):
        if folder is None:
            raise ValueError(f'geometry.part: "{part}" is a file beside a scene, and this scene has no folder')
        return numbers("geometry", read(beside(folder, part, "geometry.part")), given, general)
    values = numbers("geometry", read(parts.file_of(part)), given, general)
    return asdict(parts.load(part).Parameters(**values))


class Material(Table):
    """Linear isotropic elasticity and density."""

    young: Annotated[float, quantity("Pa"), Field(gt=0)]
    """Young's modulus."""
    density: Annotated[float, quantity("kg/m3"), Field(gt=0)]
    """Density."""
    poisson: Annotated[Number, Field(gt=-1, lt=0.5)]
    """Poisson's ratio."""
    expansion: Annotated[float, quantity("1/K")] = 0.0
    """Coefficient of thermal expansion."""


class Spring(Table):
    """A spring from a group to the ground, or to the matching nodes of another group, that acts in one direction."""

    group: str
    """Group of nodes that the spring holds; on a face each node has a share by its tributary area."""
    direction: Direction
    """Direction in which it acts."""
    stiffness: Annotated[Stiffness, Field(ge=0)]
    """Stiffness of all nodes together."""
    opposite: str | None = None
    """Group whose matching nodes it connects to, instead of the ground."""


class Prescribed(Table):
    """Nodes whose static displacement along an axis is given; its force is a result, vibration is free."""

    group: str
    """Group of nodes."""
    axis: Literal["x", "y", "z"]
    """Axis of the displacement."""
    displacement: Length
    """The static displacement."""
    springs: tuple[str, ...] = ()
    """Names of springs between these nodes and the ground that act about the prescribed position."""


KINDS = ("value", "pressure", "moment", "acceleration", "base_acceleration", "speed", "temperature")


class StaticLoad(Table):
    """A load that does not change: a force on a group, a pressure into a face, a moment on the point of a coupling, an
    acceleration, a rotation, or a change of temperature."""

    group: str = ""
    """Group that is loaded by a force, a pressure or a moment; a force on a face is shared by area."""
    direction: Direction | None = None
    """Direction of the force."""
    value: Force | None = None
    """The whole force on the group."""
    pressure: Pressure | None = None
    """Pressure into the face, instead of a force."""
    opposite: str | None = None
    """Group on which the same force acts the other way: a couple."""
    shared: Literal["area", "nodes"] = "area"
    """How a force is shared on a face: "area" by tributary area, "nodes" equally by its nodes."""
    moment: Annotated[float, quantity("N m")] | None = None
    """Moment about the direction, on the point of a coupling."""
    acceleration: Annotated[float, quantity("m/s2")] | None = None
    """Gravity or another acceleration field along the direction, on all mass."""
    base_acceleration: Annotated[float, quantity("m/s2")] | None = None
    """Acceleration of the ground along the direction; displacements are then those relative to the ground."""
    speed: Frequency | None = None
    """Speed of rotation about an axis along the direction through `point`, whose centrifugal force acts."""
    point: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Point on the axis of rotation."""
    temperature: Annotated[float, quantity("K")] | None = None
    """Change of temperature."""
    bodies: tuple[str, ...] = ()
    """Bodies that are heated; all by default."""
    field: str | None = None
    """File with columns x, y, z and change of temperature, comma-separated, in metres and kelvin; its values times
    `temperature`, which is 1 K by default."""

    @model_validator(mode="after")
    def _one_kind(self) -> StaticLoad:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if self.field is not None and "temperature" not in given:
            given.append("temperature")
        if len(given) != 1:
            raise ValueError(f"expected one out of {', '.join(KINDS)}, got {', '.join(given) or 'none'}")
        directed = given[0] not in ("pressure", "temperature")
        if directed != (self.direction is not None):
            raise ValueError(f"expected {'a' if directed else 'no'} direction with {given[0]}")
        if bool(self.group) != (given[0] in ("value", "pressure", "moment")):
            raise ValueError(f"expected {'no ' if self.group else ''}group with {given[0]}")
        if self.opposite is not None and given[0] != "value":
            raise ValueError("expected opposite only with value and direction, for a couple of forces")
        if self.bodies and given[0] != "temperature":
            raise ValueError("expected bodies only with temperature")
        return self

    @property
    def amplitude(self) -> float:
        """Its size [N], [Pa], [N m], [m/s2], [rad2/s2] or [K]."""
        if self.speed is not None:
            return (2 * math.pi * self.speed) ** 2
        if self.field is not None and self.temperature is None:
            return 1.0
        return next((size for kind in KINDS if (size := getattr(self, kind)) is not None), 0.0)


class HarmonicLoad(StaticLoad):
    """A load that goes as cos(harmonic * w t + phase)."""

    phase: Angle = 0.0
    """Phase of the load."""
    harmonic: Annotated[StrictInt, Field(ge=1)] = 1
    """Multiple of the excitation frequency."""


class Motion(Table):
    """The ground of a contact face moves: static + harmonic * cos(w t + phase), along a direction."""

    direction: Direction
    """Direction of the motion."""
    static: Length = 0.0
    """Its static part."""
    harmonic: Length = 0.0
    """Its amplitude."""
    phase: Angle = 0.0
    """Its phase."""


Static = TypeVar("Static")
Harmonic = TypeVar("Harmonic")


class Loads(Table, Generic[Static, Harmonic]):
    """Named loads."""

    static: dict[str, Static] = Field(default_factory=dict)
    """Static loads by name."""
    harmonic: dict[str, Harmonic] = Field(default_factory=dict)
    """Harmonic loads by name; at least one."""

    @model_validator(mode="after")
    def _distinct(self) -> Loads[Static, Harmonic]:
        both = sorted(set(self.static) & set(self.harmonic))
        if both:
            raise ValueError(f'expected one load named "{both[0]}", found it under static and under harmonic')
        if not self.harmonic:
            raise ValueError("expected at least one harmonic load, for example [loads.harmonic.drive]")
        return self


class Output(Table):
    """A displacement that is observed, the mean of a group."""

    group: str
    """Group whose mean displacement is observed."""
    direction: Direction
    """Direction in which it is observed."""


class Response(Table):
    """The frequency response that is computed."""

    frequency: tuple[Annotated[Frequency, Field(gt=0)], Annotated[Frequency, Field(gt=0)]]
    """Range of the response, [low, high]."""
    references: tuple[Annotated[Frequency, Field(gt=0)], Annotated[Frequency, Field(gt=0)]] | None = None
    """Range in which the linear references are drawn; the same as `frequency` by default."""
    points: Annotated[StrictInt, Field(ge=2)] = 60
    """Number of frequency steps of the continuation."""
    method: str = "natural"
    """Continuation method: natural, arc_length or adaptive."""
    stability: StrictBool = False
    """Mark where the curve is stable and where it bifurcates."""
    bounds: StrictBool = False
    """At every point, how far the response depends on the load path of pairs that always stick."""
    options: dict[str, Any] = Field(default_factory=dict)
    """Options of the continuation method."""

    _own: Path | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._own = own_file(folder_of(info), self.method, "response.method")
        return self

    @property
    def method_name(self) -> str:
        """The continuation for hbm: its name, or the path of the file beside the scene."""
        return self.method if self._own is None else str(self._own)

    @model_validator(mode="after")
    def _range(self) -> Response:
        for key, (low, high) in (("frequency", self.frequency), ("references", self.references or self.frequency)):
            if low >= high:
                raise ValueError(f"expected {key} = [low, high] with low below high, got {low:g} Hz and {high:g} Hz")
        return self


class PartResponse(Response, Output):
    """The displacement whose response is computed."""

    others: dict[str, Output] = Field(default_factory=dict)
    """Displacements observed besides, by name."""


class Reduction(Table):
    """Craig-Bampton: how many fixed-interface modes, or up to which frequency."""

    method: Literal["craig_bampton"] = "craig_bampton"
    """Reduction method."""
    relative: StrictBool = False
    """Keep the relative displacement of node pairs instead of both nodes."""
    modes: Annotated[StrictInt, Field(ge=0)] | None = None
    """Number of fixed-interface modes."""
    cutoff: Annotated[Frequency, Field(gt=0)] | None = None
    """Frequency up to which fixed-interface modes are kept, instead of their number."""
    interface_modes: Annotated[StrictInt, Field(ge=1)] | None = None
    """Replace the masters by this number of characteristic constraint modes."""
    interface_keep: tuple[str, ...] | None = None
    """Groups whose masters stay physical all the same, [] for none (SCC); by default every master that does not belong
    to the contact stays (SCCe)."""

    @model_validator(mode="after")
    def _interface(self) -> Reduction:
        if self.interface_modes is None and self.interface_keep is not None:
            raise ValueError("expected interface_keep only with interface_modes")
        return self

    @model_validator(mode="after")
    def _one_truncation(self) -> Reduction:
        if (self.modes is None) == (self.cutoff is None):
            raise ValueError("expected either modes = number or cutoff = frequency, and not both")
        return self


def _kept(value: object, check: ValidatorFunctionWrapHandler) -> tuple[int, ...]:
    if value == "auto":
        return ()
    kept: tuple[int, ...] = check(value)
    if not kept or list(kept) != sorted(set(kept)) or max(kept) < 1:
        raise ValueError(f'expected kept as rising harmonic numbers up to 1 or more, or "auto", got {list(kept)}')
    return kept


class Harmonics(Table):
    """Harmonics of the response that are kept, and time samples of one cycle."""

    kept: Annotated[tuple[Annotated[StrictInt, Field(ge=0)], ...], WrapValidator(_kept)] = (0, 1)
    """Rising harmonic numbers, or "auto": as many as the response needs at the peak of the unworn contact, so that
    what is left out changes it by less than `tolerance`, up to `highest`."""
    tolerance: Annotated[Number, Field(gt=0, ge=1e-10, lt=1)] | None = None
    """Relative change allowed by kept = "auto"."""
    highest: Annotated[StrictInt, Field(ge=1)] | None = None
    """Highest harmonic that kept = "auto" may keep; 15 by default."""
    samples: Annotated[StrictInt, Field(ge=4, le=65536)] = 128
    """Time samples of one cycle."""
    transitions: Literal["sampled", "located"] = "sampled"
    """"sampled" takes contact forces at equidistant samples; "located" finds the instants of stick, slip, contact and
    separation."""

    @property
    def automatic(self) -> bool:
        """Whether harmonics are chosen."""
        return not self.kept

    @field_serializer("kept")
    def _auto(self, kept: tuple[int, ...]) -> tuple[int, ...] | str:
        return kept or "auto"

    @model_validator(mode="after")
    def _resolved(self) -> Harmonics:
        for name in ("tolerance", "highest"):
            if not self.automatic and getattr(self, name) is not None:
                raise ValueError(f'expected {name} only with kept = "auto"')
        top = 3 * ((self.highest or HIGHEST) + 1) // 2 if self.automatic else max(self.kept)
        if self.samples <= 2 * top:
            raise ValueError(f"expected more than {2 * top} samples for harmonic {top}, got {self.samples}")
        return self


class Damping(Table):
    """Structural damping: a ratio for every mode, or Rayleigh's two coefficients."""

    modal: Annotated[Number, Field(ge=0, lt=1)] | None = None
    """Damping ratio of every mode."""
    state: Literal["free", "stuck"] = "free"
    """Whose modes these are: "free" without the contact, or "stuck" with every pair closed."""
    mass: Annotated[float, quantity("1/s"), Field(ge=0)] | None = None
    """Rayleigh's coefficient of the mass matrix."""
    stiffness: Annotated[float, quantity("s"), Field(ge=0)] | None = None
    """Rayleigh's coefficient of the stiffness matrix."""

    @model_validator(mode="after")
    def _one_kind(self) -> Damping:
        if self.modal is not None and (self.mass is not None or self.stiffness is not None):
            raise ValueError("expected either modal, or mass and stiffness, and not both")
        return self

    @property
    def given(self) -> bool:
        """Whether there is any."""
        return not (self.modal is None and self.mass is None and self.stiffness is None)


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


class Solver(Table):
    """Tolerances of the solver, and threads of the linear algebra."""

    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 1e-8
    """Newton's tolerance on the contact displacement, relative to its size."""
    krylov: Annotated[Number, Field(gt=0, lt=1)] = 0.1
    """How exactly each Newton direction is solved, at the least."""
    threads: Annotated[StrictInt, Field(ge=1)] = 1
    """Threads of the linear algebra."""


class VerdictOptions(Table):
    """What is measured to judge a finished result, see `tribodyn.workflows.accuracy.verdict`."""

    enabled: StrictBool = True
    """Judge the result when the run is done."""
    seconds: Annotated[Number, Field(gt=0)] = 120.0
    """Processor seconds after which no further measurement is begun."""
    mesh: StrictBool = True
    """Solve the unworn contact on a coarser mesh."""
    in_time: StrictBool = False
    """Integrate the unworn, the middle and the late state in time, which takes longest."""


class Scene(Table):
    """What every scene says, whatever its model is made from; see PartScene, and MatrixScene in matrix_scene."""

    scene: Heading
    """Title and source."""
    loads: Loads[Any, Any]
    """The loads."""
    response: Response
    """The response that is computed."""
    harmonics: Harmonics = Harmonics()
    """Harmonics and time samples."""
    damping: Damping = Damping()
    """Structural damping."""
    wear: Wear | None = None
    """Wear; left out, nothing wears."""
    pictures: Pictures = Pictures()
    """What is drawn."""
    solver: Solver = Solver()
    verdict: VerdictOptions = VerdictOptions()
    """Tolerances and threads."""

    @property
    def joints(self) -> Mapping[str, Contact]:
        """The contacts by name."""
        raise NotImplementedError

    @property
    def wears(self) -> bool:
        """Whether wear steps are asked for."""
        return self.wear is not None and self.wear.max_steps > 0


class MeshScene(Scene):
    """What every scene with a mesh says; see PartScene for one part, StructureScene in structure for several bodies."""

    springs: dict[str, Spring] = Field(default_factory=dict)
    """Springs by name."""
    prescribed: dict[str, Prescribed] = Field(default_factory=dict)
    """A prescribed static displacement, by name; at most one."""
    surfaces: Surfaces | None = None
    """Measured surfaces of the contact."""
    motion: dict[str, Motion] = Field(default_factory=dict)
    """Motion of the ground of a contact face, by the name of the face."""
    loads: Loads[StaticLoad, HarmonicLoad]
    """The loads."""
    response: PartResponse
    """The response that is computed."""
    reduction: Reduction
    """The reduction."""
    wheel: Wheel | None = None
    """The wheel of which the part is one sector."""

    @property
    def joints(self) -> Mapping[str, FaceContact]:
        """The contacts by name."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _what_a_sector_is(self) -> MeshScene:
        if self.wheel is None:
            return self
        for contact in self.joints.values():
            if contact.opposite is None or not isinstance(contact.group, str):
                raise ValueError("wheel: the contact needs one group, the right face, and its opposite, the left one")
        for key, has in (
            ("contact.plane", any(contact.plane is not None for contact in self.joints.values())),
            ("motion", bool(self.motion)),
            ("prescribed", bool(self.prescribed)),
            ("reduction.relative", self.reduction.relative),
            ("reduction.interface_modes", self.reduction.interface_modes is not None),
            ("response.stability", self.response.stability),  # perturbations see other waves than the solution does
        ):
            if has:
                raise ValueError(f"{key} has no meaning for a sector of a wheel: leave it out")
        if CENTRIFUGAL in (*self.loads.static, *self.loads.harmonic):
            raise ValueError(f"loads: {CENTRIFUGAL} is the load that wheel.speed makes: give yours another name")
        return self

    @model_validator(mode="after")
    def _one_prescribed(self) -> MeshScene:
        if len(self.prescribed) > 1:
            raise ValueError(f"expected one table under prescribed, got {', '.join(self.prescribed)}")
        for name, held in self.prescribed.items():
            if name in (*self.loads.static, *self.loads.harmonic):
                raise ValueError(f"prescribed.{name} has the name of a load: give it another")
            for spring in held.springs:
                if spring not in self.springs:
                    raise ValueError(unknown_key(f"springs.{spring}", [f"springs.{known}" for known in self.springs]))
                if self.springs[spring].group != held.group or self.springs[spring].opposite is not None:
                    raise ValueError(f"prescribed.{name}: springs.{spring} must hold {held.group} to the ground")
        return self


class PartScene(MeshScene):
    """Which geometry, material, contact, loads, reduction, response and wear are modelled."""

    geometry: Geometry
    """Part or mesh."""
    material: Material
    """Material."""
    contact: FaceContact
    """The contact faces and their law."""

    @property
    def joints(self) -> dict[str, FaceContact]:
        """The one contact by its name."""
        return {"contact": self.contact}

    @model_validator(mode="after")
    def _turns(self) -> PartScene:
        if self.wheel is not None and self.geometry.no_turning is not None:
            raise ValueError("geometry.no_turning has no meaning for a sector of a wheel: leave it out")
        return self
