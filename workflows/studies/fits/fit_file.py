"""The file of a fit: which numbers of a scene are sought, within bounds, and what was measured.

A measured number is the frequency of a linear mode, or any quantity of a cycle or of the wear, by its name."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, StrictBool, StrictInt, model_validator

from tribodyn.hbm import quantity
from tribodyn.hbm.quantity import StatedQuantity
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number, Table
from tribodyn.workflows.scene.scene_file import AnyPath
from tribodyn.workflows.scene.wear import At
from tribodyn.workflows.studies.fits.curve_target import Curve

LINEAR_MODES = ("open frequency", "stuck frequency")  # natural frequencies, contact absent or closed and stuck
NumberText = float | str


class ParameterTable(Table):
    """A number of the scene that is sought.

    keys : of the scene, section.key; several get the same value
    low, high : bounds, with a unit or in SI; start : one or more to begin from, the scene's own value by default
    ratio : count in ratios, for a positive number known to its order only; by default where both bounds are above 0"""

    keys: Annotated[tuple[str, ...], Field(min_length=1)]
    low: NumberText
    high: NumberText
    start: tuple[NumberText, ...] = ()
    ratio: StrictBool | None = None


class Target(Table):
    """A number that a scene answers.

    of : "open frequency" or "stuck frequency" of a mode, or the name of a quantity of a cycle or of the wear
    mode : number of a frequency, from 1
    at : of a quantity of a cycle: a frequency, "peak" or a ratio to it; left out, the contact is at rest
    load : factor on the harmonic loads of the scene
    left : share of the first preload at which the wear ends"""

    of: str
    mode: Annotated[StrictInt, Field(ge=1)] | None = None
    at: At | None = None
    load: Annotated[Number, Field(gt=0)] = 1.0
    left: Annotated[Number, Field(gt=0, lt=1)] = LIFE_SHARE

    @property
    def quantity(self) -> StatedQuantity | None:
        """The quantity, None for the frequency of a linear mode."""
        return None if self.of in LINEAR_MODES else quantity.load(self.of)

    @property
    def unit(self) -> str:
        """The unit that its value counts in."""
        if self.quantity is None:
            return "Hz"
        return "" if self.quantity.unit == "cycles" else self.quantity.unit

    @model_validator(mode="after")
    def _only_what_it_needs(self) -> Self:
        kinds = (quantity.CycleQuantity, quantity.WearQuantity)
        names = [q.name for kind in kinds for q in quantity.quantities_of(kind)]
        if self.of not in (*LINEAR_MODES, *names):
            raise Refusal(f"of: expected one of {', '.join((*LINEAR_MODES, *names))}")
        of_cycle = isinstance(self.quantity, quantity.CycleQuantity)
        is_mode = self.quantity is None
        for name, may, must in (
            ("mode", is_mode, is_mode),
            ("at", of_cycle, isinstance(self.quantity, quantity.CycleQuantity) and not self.quantity.at_rest),
            ("load", of_cycle and self.at is not None, False),
            ("left", isinstance(self.quantity, quantity.WearQuantity), False),
        ):
            is_given = name in self.model_fields_set
            if (is_given and not may) or (must and not is_given):
                raise Refusal(f'expected {"" if may else "no "}{name} for of = "{self.of}"')
        return self


class MeasuredTarget(Target):
    """A measured number.

    value : with a unit or in SI; weight : of its relative error in a fit"""

    value: NumberText
    weight: Annotated[Number, Field(gt=0)] = 1.0


class FitTables(Table):
    """What is sought and what was measured, by names of the user's choice.

    curves : measured curves, which may take the place of measured numbers"""

    parameters: Annotated[dict[str, ParameterTable], Field(min_length=1)]
    measured: dict[str, MeasuredTarget]
    curves: dict[str, Curve] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _numbers_or_curves(cls, table: Any) -> Any:
        if isinstance(table, dict) and table.get("curves"):
            return {"measured": {}, **table}
        if isinstance(table, dict) and table.get("measured") == {}:
            raise Refusal("measured: give numbers, or curves")
        return table


def read(task: AnyPath | Mapping[str, Any]) -> FitTables:
    """Read and check the file of a fit, or its tables; raises SceneError with one sentence."""
    if isinstance(task, Mapping):
        return scene_file.checked(FitTables, dict(task), "fit", Path())
    path = Path(task)
    return scene_file.checked(FitTables, scene_file.tables(path, "fit"), path.name, path.parent)
