"""The model of a result in single numbers, and how far its run came."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from tribodyn.hbm.fatigue import StressPlace
from tribodyn.hbm.outcome import End


class Stage(End):
    """How far a run came; where it failed, the sentence is that of the end of its wear."""

    BUILT = "model built"
    RESPONSE = "response computed"
    WEARING = "unfinished"
    FAILED = "failed"
    COMPLETE = "complete"


TABLES = ("around", "joints", "places")  # facts that are no single numbers


@dataclass(frozen=True)
class Around:
    """The wheel that the part is one sector of: number of sectors, engine order, and (3,) axis."""

    sectors: int
    engine_order: int
    axis: np.ndarray

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) rotation by one pitch, from a sector to the one on its left."""
        from tribodyn.geometry.placement import rotation

        return rotation(self.axis, 2 * np.pi / self.sectors)

    def sector(self, points: np.ndarray, n: int) -> np.ndarray:
        """Points (..., 3) of sector 0 where sector n has them."""
        return points @ np.linalg.matrix_power(self.turn, n).T


@dataclass(frozen=True)
class ModelFacts:
    """What was modelled and how long it took; None is what does not apply to a model.

    full_dofs, model_dofs : before and after the reduction; contact_pairs; unknowns : of a balance solve
    harmonics : of the balance
    open_frequencies, stuck_frequencies : (n,) natural frequencies with the contact absent, and stuck [Hz]
    seconds, processor_seconds : of computing, interrupted runs included: on the wall, and of the processor
    compliance_error : relative, of the dynamic compliance of the contact
    elements, nodes, scaled_jacobian : of the mesh, the last is the smallest one, 1 is best
    retained_modes, first_omitted_frequency, factorisation : of a reduction by Craig and Bampton
    prestress_residual : of a wheel that turns, relative change of its static displacement by its own stress once more
    prestress_rotation : largest of any element in that displacement [rad]
    interface_modes : characteristic constraint modes that stand for the masters
    delta_max : depth at which the static loads can close the contact no longer; wear_split : share of body 1
    around : the wheel of a part that is a sector
    joints : named contact -> its pairs; empty where the scene names none
    places : of the part whose stress is observed
    harmonics_error, harmonics_choice : estimated truncation error of chosen harmonics, and how they were chosen
    notes : what of the scene is to be doubted, sentences"""

    full_dofs: int = 0
    model_dofs: int = 0
    contact_pairs: int = 0
    unknowns: int = 0
    harmonics: tuple[int, ...] = ()
    open_frequencies: np.ndarray = field(default_factory=lambda: np.zeros(0))
    stuck_frequencies: np.ndarray = field(default_factory=lambda: np.zeros(0))
    seconds: float = 0.0
    processor_seconds: float = 0.0
    compliance_error: float | None = None
    elements: int | None = None
    nodes: int | None = None
    scaled_jacobian: float | None = None
    retained_modes: int | None = None
    first_omitted_frequency: float | None = None
    factorisation: str | None = None
    prestress_residual: float | None = None
    prestress_rotation: float | None = None
    interface_modes: int | None = None
    delta_max: float | None = None
    wear_split: float | None = None
    around: Around | None = None
    harmonics_error: float | None = None
    harmonics_choice: str | None = None
    joints: Mapping[str, slice] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    places: tuple[StressPlace, ...] = ()

    @property
    def share_of_body_1(self) -> float:
        """The share of the total depth that is worn off body 1, half by default."""
        return 0.5 if self.wear_split is None else self.wear_split

    def table(self) -> dict[str, Any]:
        """name -> value of all that applies, those of the wheel among them: what a result file and exports keep."""
        values = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in TABLES}
        values["harmonics"] = np.array(self.harmonics, dtype=np.int64)
        values["notes"] = "\n".join(self.notes) or None
        if self.around is not None:
            values |= vars(self.around)
        if self.joints:
            values["joints"] = json.dumps({name: [pairs.start, pairs.stop] for name, pairs in self.joints.items()})
        if self.places:
            values["places"] = json.dumps([asdict(place) for place in self.places])
        return {name: value for name, value in values.items() if value is not None}

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> ModelFacts:
        """The facts in a table as of `table`; others are ignored. Raises TypeError: one is of another kind"""
        plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in table.items()}
        values = {item.name: plain[item.name] for item in fields(cls) if item.name in plain}
        if "harmonics" in values:
            values["harmonics"] = tuple(int(h) for h in np.atleast_1d(values["harmonics"]))
        values["notes"] = tuple(str(plain.get("notes", "")).splitlines())
        if "places" in values:
            values["places"] = tuple(map(StressPlace.of, json.loads(values["places"])))
        for name in {"open_frequencies", "stuck_frequencies"} & values.keys():
            values[name] = np.atleast_1d(values[name]).astype(float)
        for name, kinds in _KINDS.items():
            if name in values and not isinstance(values[name], kinds):
                raise TypeError(f"{name} is {values[name]!r}")
        if "sectors" in plain:
            values["around"] = Around(plain["sectors"], plain["engine_order"], np.asarray(plain["axis"], float))
        return cls(**values)


# fact -> what it may be, of those that are single numbers or texts
_KINDS = {
    item.name: str if "str" in str(item.type) else int | float if "float" in str(item.type) else int
    for item in fields(ModelFacts)
    if str(item.type).removesuffix(" | None") in ("int", "float", "str")
}
