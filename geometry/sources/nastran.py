"""Nastran bulk data: grid points, systems, solids, materials, sets, supports, loads, equations, rigid elements.

Free, small and large fields. meshio reads neither sets nor what is fixed, and loses second-order solids.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.card_table import CardTable, SkippedCards
from tribodyn.geometry.sources.directions import System
from tribodyn.geometry.sources.raw_mesh import LabelledMesh, RawMesh
from tribodyn.refusal import Refusal

# card -> (kind of first order, kind of second order, where meshio's nodes stand)
SOLIDS = {
    "CTETRA": ("tetra", "tetra10", list(range(10))),
    "CPYRAM": ("pyramid", "pyramid13", list(range(13))),
    "CPENTA": ("wedge", "wedge15", [*range(9), 12, 13, 14, 9, 10, 11]),
    "CHEXA": ("hexahedron", "hexahedron20", [*range(12), 16, 17, 18, 19, 12, 13, 14, 15]),
}
CORNERS = {"CTETRA": 4, "CPYRAM": 5, "CPENTA": 6, "CHEXA": 8}
KINDS = {"R": "rectangular", "C": "cylindrical", "S": "nastran spherical"}
STRESSES = (0, 1, 2, 4, 5, 3)  # of ours, where they stand among x, y, z, xy, yz, zx
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def read(path: Path) -> RawMesh:
    """Read bulk data. Raises ValueError: one sentence that names the card and the cure."""
    lines = list(lines_of(path))
    start = next((i + 1 for i, line in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]), 0)
    control = "\n".join(lines[:start])
    parameters = [line.strip() for line in lines[:start] if line.strip().upper().startswith("PARAM")]
    cards = list(cards_of([*parameters, *lines[start:]]))
    reader = _Bulk(path, LabelledMesh(SkippedCards(TABLE)), _chosen(control) if start else None)
    reader.common = next((fields for name, fields in cards if name == "GRDSET"), reader.common)
    for name, fields in cards:
        if name in FIRST:
            FIRST[name](reader, name, fields)
    for name, fields in cards:
        if name in READ:
            READ[name](reader, name, fields)
        elif name not in TABLE.reads:
            reader.mesh.met.other(name)
    return reader.finished(control)


@dataclass
class _Bulk:
    """Cards of a file taken one after the other.

    chosen : kind of set -> numbers that the case control selects, None where there is no case control
    grids, systems, springs, scales : cards that others refer to, by their number; weight : PARAM WTMASS
    """

    path: Path
    mesh: LabelledMesh
    chosen: dict[str, set[int]] | None
    grids: dict[int, list[str]] = field(default_factory=dict)
    systems: dict[int, tuple[str, list[str]]] = field(default_factory=dict)
    built: dict[int, System] = field(default_factory=dict)
    springs: dict[int, float] = field(default_factory=dict)
    scales: dict[int, float] = field(default_factory=dict)
    sets: dict[int, list[int]] = field(default_factory=dict)
    properties: dict[int, tuple[int, int]] = field(default_factory=dict)
    materials: dict[int, deck.DeckMaterial] = field(default_factory=dict)
    unselected: set[str] = field(default_factory=set)
    common: list[str] = field(default_factory=lambda: [""] * 8)
    weight: float = 1.0

    def system(self, text: str) -> System | None:
        """A system by its number, None for the basic one."""
        number = _int(text or "0", "a system")
        if number and number not in self.built:
            if number not in self.systems:
                raise Refusal(f"'{self.path}' names the system {number}, which it has not: add its CORD card")
            name, fields = self.systems.pop(number)  # gone while it is built: one that refers to itself ends there
            if name[4] == "1":
                three = np.array([self.place(_int(label, name)) for label in fields[:3]])
            else:
                of = self.system(fields[0])
                three = np.array([_float(text, name) for text in fields[1:10]]).reshape(3, 3)
                three = three if of is None else of.places(three)
            self.built[number] = System.of_points(KINDS[name[5]], *three)
        return self.built.get(number)

    def place(self, label: int) -> np.ndarray:
        """A grid point (3,) in the basic system."""
        if label not in self.grids:
            raise Refusal(f"'{self.path}' names the grid point {label}, which it has not: the file is cut off")
        fields = self.grids[label]
        own, of = np.array([[_float(text, "GRID") for text in fields[2:5]]]), self.system(fields[1])
        return np.asarray(own if of is None else of.places(own))[0]

    def selected(self, kind: str, text: str) -> bool:
        """Whether a set of supports, equations or loads is in force."""
        if self.chosen is None or _int(text, kind) in self.chosen[kind]:
            return True
        self.unselected.add(f"set {kind} {text}, which the case control does not select")
        return False

    # cards that others refer to

    def keep(self, card: str, fields: list[str]) -> None:
        """A grid point, systems, stiffnesses of springs."""
        if card == "GRID":
            self.grids[_int(fields[0], card)] = fields
            fields[1:8] = [own or preset for own, preset in zip(fields[1:8], self.common[1:8], strict=True)]
        elif card.startswith("CORD2"):
            self.systems[_int(fields[0], card)] = card, [*fields[1:], *[""] * 9]
        else:
            for start in (start for start in (0, 4) if fields[start]):
                number = _int(fields[start], card)
                if card == "PELAS":
                    self.springs[number] = _float(fields[start + 1], card)
                else:
                    self.systems[number] = card, fields[start + 1 : start + 4]

    def add(self, card: str, fields: list[str]) -> None:
        """A sum of sets."""
        number = _int(fields[0], card)
        if card == "LOAD":
            if self.chosen is None or number in self.chosen[card]:
                whole, parts = _float(fields[1], card), [text for text in fields[2:] if text]
                for scale, of in zip(parts[::2], parts[1::2], strict=False):
                    self.scales[_int(of, card)] = whole * _float(scale, card)
                    if self.chosen is not None:
                        self.chosen[card].add(_int(of, card))
        elif self.chosen is not None and number in self.chosen[card[:3]]:
            self.chosen[card[:3]].update(_thru(fields[1:]))

    # mesh and materials

    def grid(self, card: str, fields: list[str]) -> None:
        """A grid point, the system of its displacements, and its permanent supports."""
        label = _int(fields[0], card)
        self.mesh.points[label] = self.place(label).tolist()
        if (frame := self.system(fields[5])) is not None:
            self.mesh.frames[label] = frame
        self.mesh.hold(label, _axes(fields[6], card))

    def solid(self, card: str, fields: list[str]) -> None:
        """A solid element."""
        nodes = [_int(x, card) for x in fields[2:] if x]
        low, high, order = SOLIDS[card]
        if len(nodes) < CORNERS[card]:
            raise Refusal(f"{card} {fields[0]} of '{self.path}' has {len(nodes)} nodes: the file is cut off or broken")
        whole = len(nodes) >= len(order)
        kept = [nodes[i] for i in order] if whole else nodes[: CORNERS[card]]
        self.mesh.solid(high if whole else low, _int(fields[0], card), kept, f"PSOLID {_int(fields[1], card)}")

    def psolid(self, card: str, fields: list[str]) -> None:
        """Material of solids, and its system."""
        self.properties[_int(fields[0], card)] = (_int(fields[1], card), _int(fields[2] or "0", card))
        if fields[6] not in ("", "SMECH"):
            self.mesh.met.refuse(f"PSOLID, {fields[6]}")

    def material(self, card: str, fields: list[str]) -> None:
        """An isotropic, orthotropic or anisotropic material."""
        number = _int(fields[0], card)
        one = deck.DeckMaterial(f"{card} {number}")
        given = [_float(x, card) if x else None for x in (*fields[1:], *[""] * 28)]
        filled = [value or 0.0 for value in given]
        if card == "MAT1":
            young, shear, poisson = given[:3]
            if poisson is None and young and shear:
                poisson = young / (2 * shear) - 1
            elif young is None and poisson is not None and shear:
                young = 2 * shear * (1 + poisson)
            one, after = replace(one, young=young, poisson=poisson), given[3:5]
        elif card == "MAT11":
            one, after = replace(one, engineering=tuple(filled[:9])), given[9:13]
        else:  # MAT9
            one, after = replace(one, stiffness=deck.stiffness(filled[:21], STRESSES)), given[21:28]
        density, *expansions = after
        if set(expansions[3:]) - {0.0, None} or len(set(expansions[:3])) > 1:
            self.mesh.met.refuse(f"{card}, an expansion that depends on direction")
        self.materials[number] = replace(one, density=density, expansion=expansions[0])

    def set1(self, card: str, fields: list[str]) -> None:
        """A set of grid points or elements."""
        self.sets[_int(fields[0], card)] = _thru(fields[1:])

    def param(self, card: str, fields: list[str]) -> None:
        """A parameter: the weight of a unit of mass, or one that is told by its name."""
        if fields[0].upper() == "WTMASS":
            self.weight = _float(fields[1], card)
        else:
            self.mesh.met.other(f"{card} {fields[0].upper()}")

    # supports and loads

    def spc(self, card: str, fields: list[str]) -> None:
        """Supports."""
        if not self.selected("SPC", fields[0]):
            return
        if card == "SPC1":
            for label in _thru(fields[2:]):
                self.mesh.hold(label, _axes(fields[1], card))
        for point, axes, value in (fields[1:4], fields[4:7]) if card == "SPC" else ():
            if point:
                self.mesh.hold(_int(point, card), _axes(axes, card), _float(value, card))

    def force(self, card: str, fields: list[str]) -> None:
        """A force or a moment, along a system of its own."""
        if not self.selected("LOAD", fields[0]):
            return
        label, frame = _int(fields[1], card), self.system(fields[2])
        scale = _float(fields[3], card) * self.scales.get(_int(fields[0], card), 1.0)
        vector = scale * np.array([_float(x, card) for x in fields[4:7]])
        if frame is not None:
            vector = vector @ frame.at(self.place(label)[None])[0]
        for axis in np.flatnonzero(vector).tolist():
            turned = 3 if card == "MOMENT" else 0
            self.mesh.forces.append(deck.Force(self.mesh.at(label), axis + turned, float(vector[axis])))

    # equations, springs, masses, rigid elements

    def mpc(self, card: str, fields: list[str]) -> None:
        """An equation between displacements."""
        if self.selected("MPC", fields[0]):
            starts = [8 * line + at for line in range(len(fields) // 8) for at in (1, 4)]
            terms = [fields[start : start + 3] for start in starts if fields[start]]
            self.mesh.equations.append([(_int(g, card), _axes(c, card)[0], _float(a, card)) for g, c, a in terms])

    def spring(self, card: str, fields: list[str]) -> None:
        """A spring between two displacements, or to the ground."""
        if card == "CELAS1" and _int(fields[1] or fields[0], card) not in self.springs:
            raise Refusal(f"CELAS1 {fields[0]} of '{self.path}' names a PELAS that it has not: add it")
        value = _float(fields[1], card) if card == "CELAS2" else self.springs[_int(fields[1] or fields[0], card)]
        ends = zip(fields[2:6:2], fields[3:6:2], (1.0, -1.0), strict=True)
        terms = [(_int(g, card), _axes(c, card)[0], f) for g, c, f in ends if g not in ("", "0")]
        self.mesh.springs.append((terms, value))

    def rbe2(self, card: str, fields: list[str]) -> None:
        """Grid points that move as a rigid body with one of them."""
        members = _thru([text for text in fields[3:] if "." not in text])
        self.mesh.couple(card, "kinematic", _int(fields[1], card), members, _axes(fields[2], card))

    def rbe3(self, card: str, fields: list[str]) -> None:
        """A grid point that moves as the mean of others."""
        weights: set[str] = set()
        members, axes = [], "123"
        words = iter(fields[4:])
        for word in words:
            if word in ("UM", "ALPHA"):
                break
            if "." in word:
                weights.add(word)
                axes = "".join(sorted({*axes} & {*next(words, "")}))
            elif word:
                members.append(_int(word, card))
        if len(weights) > 1 or axes != "123" or not set("123") <= set(fields[3]):
            self.mesh.met.refuse("RBE3, unequal weights or some directions")
        self.mesh.couple(card, "distributing", _int(fields[2], card), members)

    def conm2(self, card: str, fields: list[str]) -> None:
        """A mass."""
        inertia = [_float(text, card) for text in fields[8:14]]
        if any(_float(text, card) for text in fields[4:7]) or any(inertia[k] for k in (1, 3, 4)):
            self.mesh.met.refuse("CONM2, an offset or products of inertia")
        about = inertia[0], inertia[2], inertia[5]
        self.mesh.masses.append(deck.PointMass(self.mesh.at(_int(fields[1], card)), _float(fields[3], card), about))

    def finished(self, control: str) -> RawMesh:
        """The mesh with everything that the cards give."""
        mesh = self.mesh
        labels = {label for elements in mesh.solids.values() for label, _ in elements}
        for number, members in {**dict(_case_sets(control)), **self.sets}.items():
            if all(label in mesh.points for label in members):
                mesh.node_sets[f"SET {number}"] = members
            elif labels.issuperset(members):
                mesh.volumes[f"SET {number}"] = members
            else:
                mesh.met.ignored[f"SET {number}, whose members are neither grid points nor solids"] += 1
        groups: dict[int, dict[str, System | None]] = {}
        for number, (material, system) in self.properties.items():
            if (name := f"PSOLID {number}") in mesh.volumes:
                if system < 0 and material in self.materials and self.materials[material].young is None:
                    mesh.met.refuse(f"{name}, the material's axes along those of the elements")
                groups.setdefault(material, {})[name] = self.system(str(max(system, 0)))
        materials = []
        for number, one in self.materials.items():
            mine = groups.get(number, {})
            axes = {name: system for name, system in mine.items() if system is not None}
            density = None if one.density is None else self.weight * one.density
            materials.append(replace(one, density=density, groups=tuple(mine), directions=axes))
        mesh.masses = [one.times(self.weight) for one in mesh.masses]
        raw = mesh.raw(self.path, tuple(materials))
        count = len(re.findall(r"(?im)^\s*SUBCASE", control))
        notes = [f"the loads and supports of {count} subcases are taken together"] if count > 1 else []
        return replace(raw, unused=[*raw.unused, *sorted(self.unselected)], notes=notes)


Taking = Callable[[_Bulk, str, list[str]], None]
FIRST: dict[str, Taking] = {
    **dict.fromkeys(("GRID", "PELAS", *(f"CORD{n}{kind}" for n in "12" for kind in "RCS")), _Bulk.keep),
    **dict.fromkeys(("LOAD", "SPCADD", "MPCADD"), _Bulk.add),
}
READ: dict[str, Taking] = {
    "GRID": _Bulk.grid,
    **dict.fromkeys(SOLIDS, _Bulk.solid),
    "PSOLID": _Bulk.psolid,
    **dict.fromkeys(("MAT1", "MAT9", "MAT11"), _Bulk.material),
    "SET1": _Bulk.set1,
    "PARAM": _Bulk.param,
    **dict.fromkeys(("SPC", "SPC1"), _Bulk.spc),
    **dict.fromkeys(("FORCE", "MOMENT"), _Bulk.force),
    "MPC": _Bulk.mpc,
    **dict.fromkeys(("CELAS1", "CELAS2"), _Bulk.spring),
    "RBE2": _Bulk.rbe2,
    "RBE3": _Bulk.rbe3,
    "CONM2": _Bulk.conm2,
}
TABLE = CardTable(
    read=", ".join([*FIRST, *READ, "GRDSET, INCLUDE, PARAM WTMASS"]),
    silent="ENDDATA, BEGIN, PLOTEL",
    harmless={
        "the step is the scene's": """EIGR, EIGRL, EIGB, EIGC, EIGP, FREQ, FREQ1, FREQ2, FREQ3, FREQ4, FREQ5, TSTEP,
            TSTEPNL, NLPARM, NLSTEP, RLOAD1, RLOAD2, TLOAD1, TLOAD2, DLOAD, DAREA, DPHASE, DELAY, TABLED1, TABLED2,
            RANDPS, TABRND1, SUPORT, SUPORT1, ASET, ASET1, QSET, QSET1, BSET, BSET1, USET, USET1, DTI, ECHOON,
            ECHOOFF""",
        "damping is the scene's": "TABDMP1, PARAM G, PARAM W3, PARAM W4, PARAM KDAMP",
        "bodies are elastic": "MATS1, TABLES1, MAT4, CREEP",
        "contact is the scene's": "BCPROP, BCPROPS, BCTSET, BCTPARM, BCTPARA, BCONP, BSURF, BSURFS, BCRPARA, BCTADD",
        "a choice of solution or output": """PARAM POST, PARAM AUTOSPC, PARAM GRDPNT, PARAM COUPMASS, PARAM PRGPST,
            PARAM BAILOUT, PARAM K6ROT, PARAM MAXRATIO, PARAM NOCOMPS, PARAM OGEOM, PARAM OUGCORD, PARAM SNORM,
            PARAM TINY, PARAM USETPRT, PARAM RESVEC, PARAM EXTOUT, PARAM PATVER, PARAM DBALL, PARAM LGDISP,
            PARAM PRTMAXIM, PARAM OIBULK, PARAM OMACHPR""",
    },
)


def lines_of(path: Path, within: tuple[Path, ...] = ()) -> Iterator[str]:
    """Lines of a file without comments, those of included files in their place."""
    if path.resolve() in within:
        raise Refusal(f"'{path}' includes itself: take the INCLUDE out")
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        text = line.split("$")[0].rstrip()
        if text.upper().startswith("INCLUDE"):
            other = path.parent / text[7:].strip().strip("\"'")
            if not other.is_file():
                raise Refusal(f"INCLUDE of '{path}' names '{other.name}', which does not exist: put it there")
            yield from lines_of(other, (*within, path.resolve()))
        elif text:
            yield text


def cards_of(lines: Iterable[str]) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card of the bulk data, continuation lines joined."""
    name, fields = "", []
    for line in lines:
        head, more = _fields(line)
        if head in ("", "+", "*") or head[0] in "+*":
            fields += more
            continue
        if name:
            yield name, fields + [""] * 8
        name, fields = head.rstrip("*").upper(), more
    if name:
        yield name, fields + [""] * 8


def _fields(line: str) -> tuple[str, list[str]]:
    """Name and fields of a line: eight, or the four of a name with a star, in free and in fixed format."""
    if "," in line:
        head, *more = [item.strip() for item in line.split(",")]
        if "*" in head and any(item and item[0] not in "+*" for item in more[4:]):
            raise Refusal(f"the line '{line[:40]}' has more than the four fields of a star: take the star out")
        count = 4 if "*" in head else 8
        return head, (more + [""] * count)[:count]
    line = line.expandtabs(8)
    head = line[:8].strip()
    width, count = (16, 4) if "*" in head else (8, 8)
    return head, [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]


def _chosen(control: str) -> dict[str, set[int]]:
    """Sets of supports, equations and loads that the case control selects."""
    found: dict[str, set[int]] = {"SPC": set(), "MPC": set(), "LOAD": set()}
    for kind, number in re.findall(r"(?im)^\s*(SPC|MPC|LOAD)\s*=\s*(\d+)", control):
        found[kind.upper()].add(int(number))
    return found


def _case_sets(control: str) -> Iterator[tuple[int, list[int]]]:
    """SET n = 1, 5 THRU 9 of the case control, with lines that a comma continues."""
    for number, items in re.findall(r"(?im)^\s*SET\s+(\d+)\s*=\s*((?:[^\n]*,[ \t]*\n)*[^\n]*)", control):
        words = items.replace(",", " ").split()
        if all(word.isdigit() or word.upper() == "THRU" for word in words):
            yield int(number), _thru(words)


def _thru(words: list[str]) -> list[int]:
    found: list[int] = []
    words = [word for word in words if word]
    i = 0
    while i < len(words):
        if words[i].upper() == "THRU":
            found += range(found[-1] + 1, _int(words[i + 1], "a list with THRU") + 1)
            i += 1
        else:
            found.append(_int(words[i], "a list"))
        i += 1
    return found


def _axes(text: str, card: str) -> tuple[int, ...]:
    """Axes 0..5 of digits 1 to 6."""
    if set(text) - set("123456"):
        raise Refusal(f"{card} names the directions '{text}': write digits from 1 to 6")
    return tuple(int(digit) - 1 for digit in text)


def _int(text: str, card: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise Refusal(f"{card} expects a whole number, got '{text}': correct the card") from None


def _float(text: str, card: str) -> float:
    """A number as Nastran writes it, such as 1.-3, 0 for none."""
    try:
        return float(_EXPONENT.sub(r"e\1", text.upper().replace("D", "E")) or 0.0)
    except ValueError:
        raise Refusal(f"{card} expects a number, got '{text}': correct the card") from None
