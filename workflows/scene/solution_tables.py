"""Tables of a scene about how it is solved, judged and drawn: outputs, response, reduction, harmonics, damping."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

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

from tribodyn.declarations import read
from tribodyn.hbm import continuation
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    DRAW,
    PART,
    REDUCTION,
    RESUMABLE,
    SMOOTH,
    SOLVE,
    STUDY,
    Direction,
    Frequency,
    Number,
    Table,
    UsualRange,
    quantity,
)
from tribodyn.workflows.scene.user_files import folder_of, is_user_file, numbers, optional_user_file, user_file

HIGHEST = 15  # harmonic that kept = "auto" may keep, where the scene does not name one


class Pictures(Table, stage=DRAW):
    """What is drawn after a run."""

    plots: StrictBool = True
    """Draw curves and maps."""
    renders: StrictBool = True
    """Draw the part in 3-D."""
    deformation_scale: Annotated[Number, Field(gt=0)] | None = None
    """Factor on displacements in renders; chosen by size by default."""
    wear_scale: Annotated[Number, Field(gt=0)] | None = None
    """Factor on wear depth in renders; chosen by size by default."""


class VerdictOptions(Table, stage=STUDY):
    """What is measured to judge a finished result, see `tribodyn.workflows.errors.judgement`."""

    enabled: StrictBool = True
    """Judge the result when the run is done."""
    in_time: StrictBool | None = None
    """Integrate the unworn, the middle and the late state in time; by default where the contact has at most 30
    components."""


class Output(Table, stage=PART):
    """A displacement that is observed, the mean of a group."""

    group: str
    """Group whose mean displacement is observed."""
    direction: Direction
    """Direction in which it is observed."""


class Response(Table, stage=SOLVE):
    """The frequency response that is computed."""

    frequency: tuple[Annotated[Frequency, Field(gt=0)], Annotated[Frequency, Field(gt=0)]] | None = None
    """Range of the response, [low, high]; what only looks at a scene goes without, such as `tribodyn inspect`."""
    references: tuple[Annotated[Frequency, Field(gt=0)], Annotated[Frequency, Field(gt=0)]] | None = None
    """Range in which the linear references are drawn; the same as `frequency` by default."""
    points: Annotated[StrictInt, Field(ge=2, le=20_000)] = 60
    """Number of frequency steps of the continuation."""
    method: str = "natural"
    """Continuation method: natural, arc_length or adaptive."""
    sweep: Literal["up", "down"] = "up"
    """Way of the sweep through `frequency`. A natural or adaptive one jumps where a measured one does."""
    stability: StrictBool = False
    """Mark where the curve is stable and where it bifurcates."""
    options: dict[str, int | float] = Field(default_factory=dict)
    """Numbers that the continuation method declares as its own."""

    _user_file: Path | None = PrivateAttr(None)

    @model_validator(mode="before")
    @classmethod
    def _own_options(cls, table: Any, info: ValidationInfo) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("options", {}), dict):
            return table
        method, folder = table.get("method", cls.model_fields["method"].default), folder_of(info)
        if not isinstance(method, str) or (is_user_file(method) and folder is None):
            return table  # no name of a method, or a file that was checked when the scene was read
        if is_user_file(method):
            assert folder is not None
            declared = read(user_file(folder, method, "response.method"), "Options")
        else:
            declared = continuation.declared(method)
        return table | {"options": numbers("response.options.", declared, table.get("options", {}), ())}

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._user_file = optional_user_file(folder_of(info), self.method, "response.method")
        return self

    @property
    def method_name(self) -> str:
        """The continuation for hbm: its name, or the path of the file beside the scene."""
        return self.method if self._user_file is None else str(self._user_file)

    @model_validator(mode="after")
    def _range(self) -> Response:
        for key, ends in (("frequency", self.frequency), ("references", self.references)):
            if ends is not None and ends[0] >= ends[1]:
                got = f"{ends[0]:g} Hz and {ends[1]:g} Hz"
                raise Refusal(f"expected {key} = [low, high] with low below high, got {got}")
        return self

    @property
    def range(self) -> tuple[float, float]:
        """`frequency` where it is needed [Hz]; raises ValueError where it is missing."""
        if self.frequency is None:
            raise Refusal('response.frequency is missing: give its range, such as ["100 Hz", "200 Hz"]')
        return self.frequency


class PartResponse(Response, Output, stage=SOLVE):
    """The displacement whose response is computed."""

    others: dict[str, Output] = Field(default_factory=dict)
    """Displacements observed besides, by name."""
    speed: tuple[Annotated[Frequency, Field(gt=0)], Annotated[Frequency, Field(gt=0)]] | None = None
    """Range of speeds of a wheel's operating line, such as ["5000 rpm", "7000 rpm"], instead of `frequency`."""


class Reduction(Table, stage=REDUCTION):
    """How many modes, or up to which frequency: fixed-interface modes of Craig-Bampton, or those of the stuck part."""

    method: Literal["auto", "craig_bampton", "residual_flexibility"] = "auto"
    """Reduction method: Craig-Bampton keeps every contact DOF; residual_flexibility keeps modes of the stuck structure
    and leaves its static rest to a sparse factor, for thousands of contact DOFs. "auto" takes the latter above 3000
    contact DOFs, where no key of the scene needs the former."""
    relative: StrictBool = False
    """Keep the relative displacement of node pairs instead of both nodes."""
    modes: Annotated[StrictInt, Field(ge=0)] | None = None
    """Number of modes."""
    cutoff: Annotated[Frequency, Field(gt=0)] | None = None
    """Frequency up to which modes are kept, instead of their number."""
    solver: Literal["direct", "mumps"] = "direct"
    """How the part's equations are solved: by a factor in this process, or by one of MUMPS in MPI processes."""
    interface_modes: Annotated[StrictInt, Field(ge=1)] | None = None
    """Replace the masters by this number of characteristic constraint modes."""
    interface_keep: tuple[str, ...] | None = None
    """Groups whose masters stay physical all the same, [] for none (SCC); by default every master that does not belong
    to the contact stays (SCCe)."""

    @model_validator(mode="after")
    def _consistent(self) -> Reduction:
        if self.interface_modes is None and self.interface_keep is not None:
            raise Refusal("expected interface_keep only with interface_modes")
        if (self.modes is None) == (self.cutoff is None):
            raise Refusal("expected either modes = number or cutoff = frequency, and not both")
        if self.method == "residual_flexibility" and self.needs_masters:
            raise Refusal('expected method = "craig_bampton" with relative = true or interface_modes')
        return self

    @property
    def needs_masters(self) -> bool:
        """Whether another key makes sense with contact DOFs as masters alone."""
        return self.relative or self.interface_modes is not None


def _kept(value: object, check: ValidatorFunctionWrapHandler) -> tuple[int, ...]:
    if value == "auto":
        return ()
    kept: tuple[int, ...] = check(value)
    if not kept or list(kept) != sorted(set(kept)) or max(kept) < 1:
        raise Refusal(f'expected kept as rising harmonic numbers up to 1 or more, or "auto", got {list(kept)}')
    return kept


class Harmonics(Table, stage=SOLVE):
    """Harmonics of the response that are kept, and time samples of one cycle."""

    kept: Annotated[tuple[Annotated[StrictInt, Field(ge=0)], ...], WrapValidator(_kept)] = ()
    """Rising harmonic numbers; by default, "auto", those that the contact force requires at the peak of the unworn
    contact and where it wears, so that what is left out changes the response by less than `tolerance`, up to
    `highest`."""
    tolerance: Annotated[Number, Field(gt=0, ge=1e-10, lt=1)] | None = None
    """Relative change allowed by kept = "auto"."""
    highest: Annotated[StrictInt, Field(ge=1)] | None = None
    """Highest harmonic that kept = "auto" may keep; 15 by default, or what the samples allow."""
    samples: Annotated[StrictInt, Field(ge=4, le=65536)] = 128
    """Time samples of one cycle."""
    transitions: Literal["auto", "sampled", "located"] = "auto"
    """"sampled" takes contact forces at equidistant samples; "located" finds the instants of stick, slip, contact and
    separation; "auto" locates them where every contact law of the scene can. A contact that touches for less than the
    time between two samples is lost on sampled forces."""

    @property
    def automatic(self) -> bool:
        """Whether harmonics are chosen."""
        return not self.kept

    @property
    def top(self) -> int:
        """Highest harmonic that may be kept; the choice looks at half as many again."""
        return max(self.kept, default=self.highest or min(HIGHEST, max((self.samples - 1) // 3 - 1, 1)))

    @field_serializer("kept")
    def _auto(self, kept: tuple[int, ...]) -> tuple[int, ...] | str:
        return kept or "auto"

    @model_validator(mode="after")
    def _resolved(self) -> Harmonics:
        for name in ("tolerance", "highest"):
            if not self.automatic and getattr(self, name) is not None:
                raise Refusal(f'expected {name} only with kept = "auto"')
        top = 3 * (self.top + 1) // 2 if self.automatic else self.top
        if self.samples <= 2 * top:
            raise Refusal(f"expected more than {2 * top} samples for harmonic {top}, got {self.samples}")
        return self


class Damping(Table, stage=SOLVE):
    """Structural damping: a ratio for every mode, or Rayleigh's two coefficients."""

    modal: (
        Annotated[Number, Field(ge=0, lt=1), UsualRange(0.0, 0.2), SMOOTH]
        | Annotated[tuple[Annotated[Number, Field(ge=0, lt=1)], ...], Field(min_length=1)]
        | None
    ) = None
    """Damping ratio of every mode; a list is that of the modes that vibrate in their order, its last of all further."""
    state: Literal["free", "stuck"] = "free"
    """Whose modes these are: "free" without the contact, or "stuck" with every pair closed."""
    ratios: tuple[Annotated[Number, Field(ge=0, lt=1)], Annotated[Number, Field(ge=0, lt=1)]] | None = None
    """Damping ratios of two modes, from which Rayleigh's two coefficients follow."""
    modes: tuple[Annotated[StrictInt, Field(ge=0)], Annotated[StrictInt, Field(ge=0)]] | None = None
    """Numbers of these two modes, from 0; motions of a free structure as a rigid body count."""
    mass: Annotated[float, quantity("1/s"), Field(ge=0), SMOOTH] | None = None
    """Rayleigh's coefficient of the mass matrix."""
    stiffness: Annotated[float, quantity("s"), Field(ge=0), SMOOTH] | None = None
    """Rayleigh's coefficient of the stiffness matrix."""

    @model_validator(mode="after")
    def _one_kind(self) -> Damping:
        rayleigh = self.mass is not None or self.stiffness is not None
        if sum((self.modal is not None, rayleigh, self.ratios is not None)) > 1:
            raise Refusal("expected either modal, or mass and stiffness, or ratios, and only one of them")
        if (self.ratios is None) != (self.modes is None) or (self.modes and self.modes[0] == self.modes[1]):
            raise Refusal("expected ratios together with the numbers of two different modes")
        return self

    @property
    def given(self) -> bool:
        """Whether there is any."""
        return any(v is not None for v in (self.modal, self.mass, self.stiffness, self.ratios))


class Preload(Table, stage=SOLVE):
    """How the contact comes to its preload."""

    frictionless: StrictBool = False
    """Let the static loads act without friction; then friction is on, and all sliders rest where the contact stands."""


class NonlinearMode(Table, stage=STUDY):
    """The nonlinear mode that `tribodyn curve backbone` follows where its options are not given."""

    modal_amplitude: tuple[Annotated[Number, Field(gt=0)], Annotated[Number, Field(gt=0)]]
    """First and last amplitude of the mass-normalised mode, in m kg^0.5."""
    mode: Annotated[StrictInt, Field(ge=0)] = 0
    """Number of the mode about the static equilibrium, from 0; motions of a free structure as a rigid body count."""
    points: Annotated[StrictInt, Field(ge=2)] = 40
    """Points on an easy way; there are more where the backbone bends."""

    @model_validator(mode="after")
    def _goes_somewhere(self) -> NonlinearMode:
        if self.modal_amplitude[0] == self.modal_amplitude[1]:
            raise Refusal("modal_amplitude: expected two amplitudes that differ")
        return self


class Solver(Table, stage=SOLVE):
    """Tolerances of the solver, and how many threads may work."""

    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 1e-8
    """Newton's tolerance on the contact displacement, relative to its size."""
    threads: Annotated[StrictInt, Field(ge=1), PART, RESUMABLE] = 1
    """Threads of the linear algebra while the model is made; all that is solved takes one."""
