"""Cards of Nastran bulk data that others refer to: grid points, systems, stiffnesses of springs, sums of sets."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources.directions import System
from tribodyn.geometry.sources.nastran_text import (
    expand_list,
    to_float,
    to_int,
)
from tribodyn.geometry.sources.raw_mesh import LabelledMesh
from tribodyn.refusal import Refusal

KINDS = {"R": "rectangular", "C": "cylindrical", "S": "nastran spherical"}


@dataclass
class ReferenceCards:
    """Cards by their number, before the others are read.

    chosen : kind of set -> numbers that the case control selects, None where there is no case control
    systems : cards of coordinate systems; built : those that are built; scales : of load sets
    unselected : a clause for each set that is not in force; common : fields of GRDSET
    """

    path: Path
    mesh: LabelledMesh
    chosen: dict[str, set[int]] | None
    grids: dict[int, list[str]] = field(default_factory=dict)
    systems: dict[int, tuple[str, list[str]]] = field(default_factory=dict)
    built: dict[int, System] = field(default_factory=dict)
    springs: dict[int, float] = field(default_factory=dict)
    scales: dict[int, float] = field(default_factory=dict)
    unselected: set[str] = field(default_factory=set)
    common: list[str] = field(default_factory=lambda: [""] * 8)

    def system(self, text: str) -> System | None:
        """A system by its number, None for the basic one."""
        number = to_int(text or "0", "a system")
        if number and number not in self.built:
            if number not in self.systems:
                raise Refusal(f"'{self.path}' names the system {number}, which it has not: add its CORD card")
            name, fields = self.systems.pop(number)  # gone while it is built: one that refers to itself ends there
            if name[4] == "1":
                three = np.array([self.place(to_int(label, name)) for label in fields[:3]])
            else:
                of = self.system(fields[0])
                three = np.array([to_float(text, name) for text in fields[1:10]]).reshape(3, 3)
                three = three if of is None else of.places(three)
            self.built[number] = System.of_points(KINDS[name[5]], *three)
        return self.built.get(number)

    def place(self, label: int) -> np.ndarray:
        """A grid point (3,) in the basic system."""
        if label not in self.grids:
            raise Refusal(f"'{self.path}' names the grid point {label}, which it has not: the file is cut off")
        fields = self.grids[label]
        local, of = np.array([[to_float(text, "GRID") for text in fields[2:5]]]), self.system(fields[1])
        return np.asarray(local if of is None else of.places(local))[0]

    def selected(self, kind: str, text: str) -> bool:
        """Whether a set of supports, equations or loads is in force."""
        if self.chosen is None or to_int(text, kind) in self.chosen[kind]:
            return True
        self.unselected.add(f"set {kind} {text}, which the case control does not select")
        return False

    def keep(self, card: str, fields: list[str]) -> None:
        """A grid point, systems, stiffnesses of springs."""
        if card == "GRID":
            self.grids[to_int(fields[0], card)] = fields
            fields[1:8] = [text or preset for text, preset in zip(fields[1:8], self.common[1:8], strict=True)]
        elif card.startswith("CORD2"):
            self.systems[to_int(fields[0], card)] = card, [*fields[1:], *[""] * 9]
        else:
            for start in (start for start in (0, 4) if fields[start]):
                number = to_int(fields[start], card)
                if card == "PELAS":
                    self.springs[number] = to_float(fields[start + 1], card)
                else:
                    self.systems[number] = card, fields[start + 1 : start + 4]

    def add(self, card: str, fields: list[str]) -> None:
        """A sum of sets."""
        number = to_int(fields[0], card)
        if card == "LOAD":
            if self.chosen is None or number in self.chosen[card]:
                total_scale, parts = to_float(fields[1], card), [text for text in fields[2:] if text]
                for scale, of in zip(parts[::2], parts[1::2], strict=False):
                    self.scales[to_int(of, card)] = total_scale * to_float(scale, card)
                    if self.chosen is not None:
                        self.chosen[card].add(to_int(of, card))
        elif self.chosen is not None and number in self.chosen[card[:3]]:
            self.chosen[card[:3]].update(expand_list(fields[1:]))
