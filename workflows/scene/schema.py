"""The scene: what one TOML file asks for, checked and in SI units.

Every key of the file is a field below, or of a table in the modules beside this one; a key that is not there is an
error. What a scene leaves out is not modelled."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeGuard

from pydantic import Field, ValidationError, ValidationInfo, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import ContactTable, FaceContact, Surfaces
from tribodyn.workflows.scene.contact_numbers import (
    is_by_temperature,
    needs_asperities,
    with_asperities,
    with_temperature,
)
from tribodyn.workflows.scene.fields import DRAW, REDUCTION, SceneStage, Table, unknown_key
from tribodyn.workflows.scene.load_tables import HarmonicLoad, Loads, Motion, Prescribed, SpringTable, StaticLoad
from tribodyn.workflows.scene.part_tables import Geometry, SolidMaterial
from tribodyn.workflows.scene.solution_tables import (
    Damping,
    Harmonics,
    NonlinearMode,
    PartResponse,
    Pictures,
    Preload,
    Reduction,
    Response,
    Solver,
    VerdictOptions,
)
from tribodyn.workflows.scene.stress_tables import FatigueTable, GaugeTable, StressPlaceTable, StressTable
from tribodyn.workflows.scene.structure_tables import (
    GROUND,
    BodyTable,
    BoltTable,
    CouplingTable,
    DeckTable,
    LinkTable,
    NamedContact,
    PointMassTable,
    TieTable,
)
from tribodyn.workflows.scene.user_files import folder_of
from tribodyn.workflows.scene.wear import Wear, WearTestTable

if TYPE_CHECKING:
    from tribodyn.workflows.scene.wheel_scene import WheelScene
    from tribodyn.workflows.scene.wheel_tables import FlowTable, Mistuning, WheelTable
else:  # a scene without a wheel has none of them: see WheelScene in wheel_scene
    FlowTable = Mistuning = WheelTable = NoneType

CENTRIFUGAL = "centrifugal"
MODES = 20  # of a scene that says nothing of its reduction


class Heading(Table, stage=DRAW):
    """What the scene is and where its numbers come from."""

    title: str = ""
    """What the scene is, in one line; `tribodyn cases` and the report show it, the name of the file by default."""
    source: str = ""
    """Where its numbers come from."""
    notes: str = ""
    """Remarks for the reader."""


class Scene(Table, ABC):
    """What every scene has, whatever its model is made from; see MeshScene, and MatrixScene in matrix_scene."""

    scene: Heading = Heading()
    """Title and source."""
    loads: Loads[Any, Any]
    """The loads."""
    response: Response
    """The response that is computed."""
    harmonics: Harmonics = Harmonics()
    """Harmonics and time samples."""
    damping: Damping = Damping()
    """Structural damping."""
    preload: Preload = Preload()
    """How the contact comes to its preload."""
    backbone: NonlinearMode | None = None
    """The nonlinear mode that `tribodyn curve backbone` follows by itself."""
    wear: Wear | None = None
    """Wear; left out, nothing wears."""
    test: WearTestTable | None = None
    """The test plan that `tribodyn study test` replays."""
    pictures: Pictures = Pictures()
    """What is drawn."""
    solver: Solver = Solver()
    """Tolerances and threads."""
    verdict: VerdictOptions = VerdictOptions()
    """How the finished result is judged."""

    @property
    @abstractmethod
    def joints(self) -> Mapping[str, ContactTable]:
        """The contacts by name."""

    @property
    def wear_table(self) -> Wear:
        """[wear], of a scene that has it."""
        if self.wear is None:
            raise RuntimeError("the scene has no [wear]")
        return self.wear

    @property
    def wears(self) -> bool:
        """Whether wear steps are asked for."""
        return self.wear is not None and self.wear.max_steps > 0


def has_wheel(scene: MeshScene) -> TypeGuard[WheelScene]:
    """Whether the part of a scene is one sector of a wheel."""
    return scene.wheel is not None


class MeshScene(Scene):
    """A scene with a mesh: one part in [geometry], or bodies and what joins them, with loads, response and wear."""

    springs: dict[str, SpringTable] = Field(default_factory=dict)
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
    reduction: Reduction = Reduction(modes=MODES)
    """The reduction."""
    wheel: WheelTable | None = None
    """The wheel of which the part is one sector."""
    mistuning: Mistuning | None = None
    """How far its blades differ."""
    flow: FlowTable | None = None
    """The flow round its blades, for `tribodyn wheel flutter`."""
    bodies: dict[str, BodyTable] = Field(default_factory=dict)
    """Bodies by name."""
    decks: dict[str, DeckTable] = Field(default_factory=dict)
    """Decks of other FE programs by name, which bring bodies and what joins, holds and loads them."""
    materials: dict[str, SolidMaterial] = Field(default_factory=dict)
    """Materials by name."""
    geometry: Geometry | None = None
    """A single part or mesh, instead of bodies."""
    material: SolidMaterial | None = None
    """Its material."""
    contact: FaceContact | None = None
    """A single contact, instead of contacts."""
    contacts: dict[str, NamedContact] = Field(default_factory=dict)
    """Joints by name."""
    ties: dict[str, TieTable] = Field(default_factory=dict)
    """Faces glued together, by name."""
    couplings: dict[str, CouplingTable] = Field(default_factory=dict)
    """Points that carry faces, by name."""
    links: dict[str, LinkTable] = Field(default_factory=dict)
    """Points of couplings that move alike, by name."""
    masses: dict[str, PointMassTable] = Field(default_factory=dict)
    """Lumped masses by name."""
    bolts: dict[str, BoltTable] = Field(default_factory=dict)
    """Bolts by name."""
    stress: StressTable | None = None
    """Stress: places where it is observed, and hot spots; left out, it is not computed."""
    gauges: dict[str, GaugeTable] = Field(default_factory=dict)
    """Strain gauges by name."""
    fatigue: dict[str, FatigueTable] = Field(default_factory=dict)
    """What the materials endure, by the name of the material, "material" where there is one; or of a body."""

    @property
    def joints(self) -> dict[str, FaceContact]:
        return {**({} if self.contact is None else {"contact": self.contact}), **self.contacts}

    @model_validator(mode="before")
    @classmethod
    def _seen_where_it_is_shaken(cls, data: Any) -> Any:
        """A response without group and direction is that of the first harmonic load."""
        loads = data.get("loads") if isinstance(data, dict) else None
        harmonic = loads.get("harmonic") if isinstance(loads, dict) else None
        first = next(iter(harmonic.values()), None) if isinstance(harmonic, dict) else None
        if not isinstance(first, dict) or not isinstance(response := data.get("response"), dict):
            return data
        return {**data, "response": {key: first[key] for key in ("group", "direction") if key in first} | response}

    @model_validator(mode="before")
    @classmethod
    def _numbers_of_its_contacts(cls, data: Any, info: ValidationInfo) -> Any:
        """A contact has the numbers of its temperature, and the asperities of the measured faces that its law wants."""
        if not isinstance(data, dict):
            return data
        loads, named_contacts, folder = data.get("loads"), data.get("contacts") or None, folder_of(info)
        contacts: dict[str, Any] = (
            named_contacts if isinstance(named_contacts, dict) else {"contact": data.get("contact")}
        )
        prefix = "contacts." if named_contacts is contacts else ""
        static = loads.get("static") if isinstance(loads, dict) else None
        completed = {
            name: with_temperature(prefix + name, contact, static)
            for name, contact in contacts.items()
            if is_by_temperature(contact)
        }
        lacking = [name for name, contact in contacts.items() if needs_asperities(contact)]
        if lacking and folder is not None and isinstance(data.get("surfaces"), dict):
            try:
                surfaces = Surfaces.model_validate(data["surfaces"])
            except ValidationError:  # reported where the table itself is read
                return data
            completed |= {
                name: with_asperities({**contacts[name], **completed.get(name, {})}, surfaces, folder)
                for name in lacking
            }
        if not completed:
            return data
        return {**data, **({"contacts": {**contacts, **completed}} if named_contacts is contacts else completed)}

    @property
    def stress_places(self) -> dict[str, StressPlaceTable]:
        """The places whose stress is observed, by name."""
        return {} if self.stress is None else self.stress.places

    @property
    def other_speeds(self) -> tuple[float, ...]:
        """Speeds of the wheel [Hz] in duties of the mission, without that of the wheel itself."""
        return ()

    @property
    def reduced_through(self) -> SceneStage:
        """The last stage whose fields the reduced model depends on."""
        return REDUCTION

    @property
    def operating_range(self) -> tuple[float, float]:
        """Lowest and highest frequency of the response and of the duties of the wear [Hz]."""
        duties = () if self.wear is None else self.wear.duties
        frequencies = [*self.response.range, *(duty.at.frequency for duty in duties if duty.at.frequency)]
        return min(frequencies), max(frequencies)

    @model_validator(mode="after")
    def _sectors_are_of_a_wheel(self) -> MeshScene:
        """Refuse keys that mean something in a wheel alone."""
        if self.wheel is not None:
            return self
        for name, contact in self.joints.items():
            if contact.sector is not None:
                raise Refusal(f"{name}: sector is for a [wheel], and the scene has none: leave it out")
        if self.wear is not None and any(duty.speed is not None for duty in self.wear.mission):
            raise Refusal("wear.mission has a speed: give the speed of the wheel too, in wheel.speed")
        return self

    @model_validator(mode="after")
    def _one_prescribed(self) -> MeshScene:
        if len(self.prescribed) > 1:
            raise Refusal(f"expected one table under prescribed, got {', '.join(self.prescribed)}")
        for name, table in self.prescribed.items():
            if name in (*self.loads.static, *self.loads.harmonic):
                raise Refusal(f"prescribed.{name} has the name of a load: give it another")
            for spring in table.springs:
                if spring not in self.springs:
                    raise Refusal(unknown_key(f"springs.{spring}", [f"springs.{other}" for other in self.springs]))
                if self.springs[spring].group != table.group or self.springs[spring].opposite is not None:
                    raise Refusal(f"prescribed.{name}: springs.{spring} must hold {table.group} to the ground")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> MeshScene:
        has_bodies = bool(self.bodies or self.decks)
        if not has_bodies and (self.geometry is None) != (self.material is None):
            raise Refusal(f"{'geometry' if self.geometry is None else 'material'} is missing")
        if has_bodies == (self.geometry is not None) or (self.geometry is None) != (self.material is None):
            raise Refusal("expected either [bodies.NAME] with [materials.NAME], or [geometry] with [material]")
        if self.wear is not None and not self.joints:
            raise Refusal("contact is missing: [wear] needs [contact] or [contacts.NAME]")
        if not self.joints and self.response.method != "natural":
            raise Refusal('response.method: without contact the response is linear: give "natural"')
        if self.contact is not None and self.contacts:
            raise Refusal("expected either [contact] or [contacts.NAME], and not both")
        for name in self.bodies:
            if "." in name or name == GROUND:
                raise Refusal(f'bodies.{name}: give a name without a dot that is not "{GROUND}"')
        made_of = [(f"bodies.{name}", one) for name, body in self.bodies.items() for one in body.materials]
        made_of += [(f"decks.{name}", deck.material) for name, deck in self.decks.items() if deck.material is not None]
        made_of += [(f"bolts.{name}", bolt.material) for name, bolt in self.bolts.items() if bolt.material is not None]
        for where, material in made_of:
            if material not in self.materials:
                raise Refusal(f"{where}: {unknown_key(f'materials.{material}', [*self.materials])}")
        solids = [*self.materials, *self.bodies] if has_bodies else ["material"]
        for name in self.fatigue:
            if name not in solids and not self.decks:
                raise Refusal(unknown_key(f"fatigue.{name}", [f"fatigue.{solid}" for solid in solids]))
        load_names = [*self.loads.static, *self.loads.harmonic]
        for name in self.bolts:
            if name in load_names or name == CENTRIFUGAL:
                raise Refusal(f"bolts.{name} has the name of a load: give it another")
        for name in self.couplings:
            if name in self.bodies:
                raise Refusal(f"couplings.{name} has the name of a body: give it another")
        for name, link in self.links.items():
            for coupling in (link.first, link.second):
                if coupling not in self.couplings:
                    raise Refusal(f"links.{name}: {unknown_key(f'couplings.{coupling}', [*self.couplings])}")
        for name, tie in self.ties.items():
            if tie.first == tie.second:
                raise Refusal(f"ties.{name}: first and second are one face: give the face that it is glued to")
        for name, contact in self.contacts.items():
            if contact.opposite in contact.groups:
                raise Refusal(f"contacts.{name}: first and second are one face: give the face that it touches")
            for tied, tie in self.ties.items():
                if {tie.first, tie.second} == {*contact.groups, contact.opposite}:
                    raise Refusal(f"contacts.{name} and ties.{tied} join the same two faces: take one of them out")
            if contact.wear is not None and self.wear is None:
                raise Refusal(f"contacts.{name}.wear needs [wear], which sets how far the wear goes")
        return self
