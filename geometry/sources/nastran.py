"""Nastran bulk data: grid points, systems, solids, materials, sets, supports, loads, equations, rigid elements.

Free, small and large fields. meshio reads neither sets nor what is fixed, and loses second-order solids."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.card_table import CardTable, SkippedCards, fields_of
from tribodyn.geometry.sources.directions import System
from tribodyn.geometry.sources.nastran_cards import (
    ReferenceCards,
    cards_of,
    case_sets,
    expand_list,
    lines_of,
    selected_sets,
    to_axes,
    to_float,
    to_int,
)
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
STRESSES = (0, 1, 2, 4, 5, 3)  # of ours, where they stand among x, y, z, xy, yz, zx


def read(path: Path) -> RawMesh:
    """Read bulk data. Raises Refusal: one sentence that names the card and the cure."""
    lines = list(lines_of(path))
    start = next((i + 1 for i, line in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]), 0)
    control = "\n".join(lines[:start])
    parameters = [line.strip() for line in lines[:start] if line.strip().upper().startswith("PARAM")]
    cards = list(cards_of([*parameters, *lines[start:]]))
    reader = _Bulk(path, LabelledMesh(SkippedCards(TABLE)), selected_sets(control) if start else None)
    defined: dict[tuple[str, str], list[str]] = {}
    for name, fields in cards:
        reader.mesh.skipped.check_fields(name, fields)
        if name in SPACES and defined.setdefault((SPACES[name], fields[0]), fields) != fields:
            raise Refusal(f"'{path}' has a second {name} {fields[0]}, which differs from the first: take one out")
    reader.common = next((fields for name, fields in cards if name == "GRDSET"), reader.common)
    for name, fields in cards:
        if name in FIRST:
            FIRST[name](reader, name, fields)
    for name, fields in cards:
        if name in READ:
            READ[name](reader, name, fields)
        elif name not in TABLE.reads:
            reader.mesh.skipped.skip(name)
    return reader.finished(control)


@dataclass
class _Bulk(ReferenceCards):
    """Reads the cards of a file one after the other.

    weight : PARAM WTMASS"""

    sets: dict[int, list[int]] = field(default_factory=dict)
    properties: dict[int, tuple[int, int]] = field(default_factory=dict)
    materials: dict[int, deck.DeckMaterial] = field(default_factory=dict)
    weight: float = 1.0

    # mesh and materials

    def grid(self, card: str, fields: list[str]) -> None:
        """A grid point, the system of its displacements, and its permanent supports."""
        label = to_int(fields[0], card)
        self.mesh.point(label, self.place(label).tolist())
        if (frame := self.system(fields[5])) is not None:
            self.mesh.frames[label] = frame
        self.mesh.hold(label, to_axes(fields[6], card))

    def solid(self, card: str, fields: list[str]) -> None:
        """A solid element."""
        nodes = [to_int(x, card) for x in fields[2:] if x]
        low, high, order = SOLIDS[card]
        if len(nodes) < CORNERS[card]:
            raise Refusal(f"{card} {fields[0]} of '{self.path}' has {len(nodes)} nodes: the file is cut off or broken")
        if len(nodes) not in (CORNERS[card], len(order)):
            self.mesh.skipped.refuse(f"{card} with some of its edge nodes")
        quadratic = len(nodes) >= len(order)
        ordered = [nodes[i] for i in order] if quadratic else nodes[: CORNERS[card]]
        self.mesh.solid(
            high if quadratic else low, to_int(fields[0], card), ordered, f"PSOLID {to_int(fields[1], card)}"
        )

    def psolid(self, card: str, fields: list[str]) -> None:
        """Material of solids, and its system."""
        self.properties[to_int(fields[0], card)] = (to_int(fields[1], card), to_int(fields[2] or "0", card))
        for value in {fields[3], fields[6]} - {"", "0", "BUBBLE", "SMECH"}:
            self.mesh.skipped.refuse(f"PSOLID, {value}")

    def material(self, card: str, fields: list[str]) -> None:
        """An isotropic, orthotropic or anisotropic material."""
        number = to_int(fields[0], card)
        item = deck.DeckMaterial(f"{card} {number}")
        constants = [to_float(x, card) if x else None for x in (*fields[1:], *[""] * 28)]
        filled = [value or 0.0 for value in constants]
        if card == "MAT1":
            young, shear, poisson = constants[:3]
            if poisson is None and young and shear:
                poisson = young / (2 * shear) - 1
            elif young and shear and poisson and not 0.99 < 2 * shear * (1 + poisson) / young < 1.01:
                self.mesh.skipped.refuse("MAT1, a G that is not E / 2 (1 + NU)")
            elif young is None and poisson is not None and shear:
                young = 2 * shear * (1 + poisson)
            item, after = replace(item, young=young, poisson=poisson), constants[3:5]
        elif card == "MAT11":
            item, after = replace(item, engineering=tuple(filled[:9])), constants[9:13]
        else:  # MAT9
            item, after = replace(item, stiffness=deck.stiffness(filled[:21], STRESSES)), constants[21:28]
        density, *expansions = after
        if set(expansions[3:]) - {0.0, None} or len(set(expansions[:3])) > 1:
            self.mesh.skipped.refuse(f"{card}, an expansion that depends on direction")
        self.materials[number] = replace(item, density=density, expansion=expansions[0])

    def set1(self, card: str, fields: list[str]) -> None:
        """A set of grid points or elements."""
        self.sets[to_int(fields[0], card)] = expand_list(fields[1:], self.grids)

    def param(self, card: str, fields: list[str]) -> None:
        """A parameter: WTMASS scales masses; any other one is skipped and recorded by name."""
        if fields[0].upper() == "WTMASS":
            self.weight = to_float(fields[1], card)
        else:
            self.mesh.skipped.skip(f"{card} {fields[0].upper()}")

    # supports and loads

    def spc(self, card: str, fields: list[str]) -> None:
        """Supports."""
        if not self.selected("SPC", fields[0]):
            return
        if card == "SPC1":
            for label in expand_list(fields[2:], self.grids):
                self.mesh.hold(label, to_axes(fields[1], card))
        for point, axes, value in (fields[1:4], fields[4:7]) if card == "SPC" else ():
            if point:
                self.mesh.hold(to_int(point, card), to_axes(axes, card), to_float(value, card))

    def force(self, card: str, fields: list[str]) -> None:
        """A force or a moment, along a system of its own."""
        if not self.selected("LOAD", fields[0]):
            return
        label, frame = to_int(fields[1], card), self.system(fields[2])
        scale = to_float(fields[3], card) * self.scales.get(to_int(fields[0], card), 1.0)
        vector = scale * np.array([to_float(x, card) for x in fields[4:7]])
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
            if any(fields[k] for k in range(7, len(fields)) if k % 8 in (0, 7)):
                self.mesh.skipped.refuse("MPC with terms in the first or last field of a line")
            terms = [fields[start : start + 3] for start in starts if fields[start]]
            mine = [(to_int(g, card), to_axes(c, card, True)[0], to_float(a, card)) for g, c, a in terms]
            self.mesh.equations.append(mine)

    def spring(self, card: str, fields: list[str]) -> None:
        """A spring between two displacements, or to the ground."""
        if card == "CELAS1" and to_int(fields[1] or fields[0], card) not in self.springs:
            raise Refusal(f"CELAS1 {fields[0]} of '{self.path}' names a PELAS that it has not: add it")
        value = to_float(fields[1], card) if card == "CELAS2" else self.springs[to_int(fields[1] or fields[0], card)]
        ends = zip(fields[2:6:2], fields[3:6:2], (1.0, -1.0), strict=True)
        terms = [(to_int(g, card), to_axes(c, card, True)[0], f) for g, c, f in ends if g not in ("", "0")]
        self.mesh.springs.append((terms, value))

    def rbe2(self, card: str, fields: list[str]) -> None:
        """Grid points that move as a rigid body with one of them."""
        members = expand_list([text for text in fields[3:] if "." not in text], self.grids)
        if any(to_float(text, card) for text in fields[3:] if "." in text):
            self.mesh.skipped.refuse("RBE2, ALPHA")
        self.mesh.couple(card, "kinematic", to_int(fields[1], card), members, to_axes(fields[2], card))

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
                members.append(to_int(word, card))
        if len(weights) > 1 or axes != "123" or not set("123") <= set(fields[3]):
            self.mesh.skipped.refuse("RBE3, unequal weights or some directions")
        self.mesh.couple(card, "distributing", to_int(fields[2], card), members)

    def conm2(self, card: str, fields: list[str]) -> None:
        """A mass."""
        inertia = [to_float(text, card) for text in fields[8:14]]
        if any(to_float(text, card) for text in fields[4:7]) or any(inertia[k] for k in (1, 3, 4)):
            self.mesh.skipped.refuse("CONM2, an offset or products of inertia")
        if any(inertia) and fields[2] not in ("", "0"):
            self.mesh.skipped.refuse("CONM2, inertia along a system")
        about = inertia[0], inertia[2], inertia[5]
        self.mesh.masses.append(deck.PointMass(self.mesh.at(to_int(fields[1], card)), to_float(fields[3], card), about))

    def finished(self, control: str) -> RawMesh:
        """The mesh with everything that the cards give."""
        mesh = self.mesh
        labels = {label for elements in mesh.solids.values() for label, _ in elements}
        for kind, number in ((kind, number) for kind, chosen in (self.chosen or {}).items() for number in chosen):
            if (kind, number) not in self.defined and (kind != "LOAD" or not mesh.skipped.refused):
                raise Refusal(f"'{self.path}' selects {kind} {number}, a set that it has not: correct the number")
        for number, members in {**dict(case_sets(control, {*mesh.points, *labels})), **self.sets}.items():
            if all(label in mesh.points for label in members):
                mesh.node_sets[f"SET {number}"] = members
            elif labels.issuperset(members):
                mesh.volumes[f"SET {number}"] = members
            else:
                mesh.skipped.ignored[f"SET {number}, whose members are neither grid points nor solids"] += 1
        groups: dict[int, dict[str, System | None]] = {}
        for number, (material, system) in self.properties.items():
            if (name := f"PSOLID {number}") in mesh.volumes:
                if system < 0 and material in self.materials and self.materials[material].young is None:
                    mesh.skipped.refuse(f"{name}, the material's axes along those of the elements")
                groups.setdefault(material, {})[name] = self.system(str(max(system, 0)))
        materials = []
        for number, item in self.materials.items():
            mine = groups.get(number, {})
            axes = {name: system for name, system in mine.items() if system is not None}
            density = None if item.density is None else self.weight * item.density
            materials.append(replace(item, density=density, groups=tuple(mine), directions=axes))
        mesh.masses = [item.times(self.weight) for item in mesh.masses]
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
# cards whose number no other of them, nor of the same space, may have
SPACES = {name: name for name in ("GRID", "PSOLID", "SET1", "CONM2", "RBE2", "RBE3", "CELAS1", "CELAS2")}
SPACES |= {name: name[:3] for name in ("MAT1", "MAT9", "MAT11")} | {
    f"CORD{k}{of}": "CORD" for k in "12" for of in "RCS"
}
FIELDS = fields_of("""GRID: ID, CP, X1, X2, X3, CD, PS; GRDSET: , CP, , , , CD, PS;
    CTETRA CPYRAM CPENTA CHEXA: EID, PID, G1, ...; PSOLID: PID, MID, CORDM, IN, (STRESS), (ISOP), FCTN;
    MAT1: MID, E, G, NU, RHO, A, (TREF), (GE), (ST), (SC), (SS), (MCSID); MAT9: MID, G11, ...;
    MAT11: MID, E1, E2, E3, NU12, NU13, NU23, G12, G13, G23, RHO, A1, A2, A3, (TREF), (GE); PARAM: N, V1;
    SPC: SID, G1, C1, D1, G2, C2, D2; SPC1: SID, C, G1, ...; FORCE MOMENT: SID, G, CID, F, N1, N2, N3;
    LOAD: SID, S, S1, L1, ...; SPCADD MPCADD SET1: SID, S1, ...; MPC: SID, G1, C1, A1, G2, C2, A2, , , G3, ...;
    CELAS1: EID, PID, G1, C1, G2, C2; CELAS2: EID, K, G1, C1, G2, C2, (GE), (S);
    PELAS: PID1, K1, (GE1), (S1), PID2, K2, (GE2), (S2);
    CORD1R CORD1C CORD1S: CID1, G1, G2, G3, CID2, G4, G5, G6;
    CORD2R CORD2C CORD2S: CID, RID, A1, A2, A3, B1, B2, B3, C1, C2, C3;
    RBE2: EID, GN, CM, GM1, ...; RBE3: EID, , REFGRID, REFC, WT1, C1, G11, ...;
    CONM2: EID, G, CID, M, X1, X2, X3, , I11, I21, I22, I31, I32, I33""")
TABLE = CardTable(
    read=", ".join([*FIRST, *READ, "GRDSET, INCLUDE, PARAM WTMASS"]),
    fields=FIELDS,
    silent="PLOTEL",
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
