"""ANSYS archives (.cdb): nodes, elements, components, materials, local systems, supports, forces, equations.

Bricks with nodes that coincide are the tetrahedra, prisms and pyramids that they stand for."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn import text_file
from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.ansys_mesh import ArchiveMesh, euler_axes
from tribodyn.geometry.sources.card_table import CardTable, SkippedCards, fields_of, words
from tribodyn.geometry.sources.directions import ElementAxes, System
from tribodyn.geometry.sources.raw_mesh import LabelledMesh, RawMesh, Terms
from tribodyn.refusal import Refusal
from tribodyn.text_file import finite

_AXES = {"UX": 0, "UY": 1, "UZ": 2, "ROTX": 3, "ROTY": 4, "ROTZ": 5}
_FORCES = {"FX": 0, "FY": 1, "FZ": 2, "MX": 3, "MY": 4, "MZ": 5}
_SYSTEMS = ("rectangular", "cylindrical", "spherical")
_PAIRS = ("XY", "XZ", "YZ")


def read(path: Path) -> RawMesh:
    """Read an archive. Raises Refusal: one sentence that names the block and the cure."""
    lines = [line.text for line in text_file.lines_of(path)]
    return _Archive(path, lines, LabelledMesh(SkippedCards(TABLE))).read_all()


@dataclass
class _Archive(ArchiveMesh):
    """A file that is read line by line.

    constants : of materials by number; systems : local ones
    equations : by name; equation : that of the last; first_coupled : set of CP -> its first node
    loads : on nodes, along axes that may be turned"""

    constants: dict[int, dict[str, float]] = field(default_factory=dict)
    systems: dict[int, System] = field(default_factory=dict)
    equations: dict[str, Terms] = field(default_factory=dict)
    equation: str = ""
    first_coupled: dict[str, int] = field(default_factory=dict)
    loads: Terms = field(default_factory=list)

    def read_all(self) -> RawMesh:
        """The mesh with everything that the commands give."""
        while self.i < len(self.lines):
            words = [word.strip() for word in self.lines[self.i].split("!")[0].split(",")]
            name = words[0].upper()
            self.i += 1
            if name in READ:
                self.mesh.skipped.check_fields(name, words[1:])
                try:
                    READ[name](self, words + [""] * 20)
                except ValueError as trouble:
                    raise Refusal(
                        str(trouble)
                        if str(self.path) in str(trouble)
                        else f"'{self.path}' has a broken {name} at line {self.i}: {trouble}: write it again"
                    ) from None
            elif name in ALWAYS and NOTHING.fullmatch(",".join(words[1:])):
                continue
            elif (name[:1].isalpha() and "=" not in name) or name.startswith(("/INPUT", "*")):
                self.mesh.skipped.skip(name)
        for material, system in self.of_solids.values():
            if system and system not in self.systems:
                raise Refusal(f"'{self.path}' has elements in system {system}, which it has not: add its LOCAL")
            self.constants.setdefault(material, {})
        if self.node_axes:
            places = np.array([self.mesh.points[label] for label in self.node_axes])
            element_axes = ElementAxes(places, np.array(list(self.node_axes.values())))
            self.mesh.frames = dict.fromkeys(self.node_axes, element_axes)
        for node, axis, value in self.loads:
            self.mesh.force(node, axis, value)
        return self.mesh.raw(self.path, tuple(self._material(number) for number in self.constants))

    def _material(self, number: int) -> deck.DeckMaterial:
        """A material from its constants, isotropic unless a constant depends on direction."""
        of = self.constants[number]
        mine = [name for name, (material, _) in self.of_solids.items() if material == number]
        at = {name: self.of_solids[name][1] for name in mine}
        if len({of.get(name, of.get("ALPX")) for name in ("ALPX", "ALPY", "ALPZ")}) > 1:
            self.mesh.skipped.refuse("MP, an expansion that depends on direction")
        item = deck.DeckMaterial(
            f"material {number}", density=of.get("DENS"), expansion=of.get("ALPX"), groups=tuple(mine),
            directions={name: self.systems[system] for name, system in at.items() if system},
        )  # fmt: skip
        young = [of.get(name, of.get("EX")) for name in ("EX", "EY", "EZ")]
        poisson = [of.get(f"PR{pair}", of.get("PRXY")) for pair in _PAIRS]
        for k, (one_way, other) in enumerate(((0, 1), (0, 2), (1, 2))):
            minor, first, second = of.get(f"NU{_PAIRS[k]}", of.get("NUXY")), young[one_way], young[other]
            if poisson[k] is None and minor is not None and first and second:
                poisson[k] = minor * first / second  # NU is the strain along the first when pulled along the second
        if not {"EY", "EZ", *(f"G{pair}" for pair in _PAIRS)} & set(of):
            return replace(item, young=young[0], poisson=poisson[0])
        shear = [of.get(f"G{pair}") for pair in _PAIRS]
        if None in (*young, *poisson, *shear):
            self.mesh.skipped.refuse(f"MP, material {number} with some constants of an orthotropic one")
            return item
        return replace(item, engineering=(*young, *poisson, *shear))  # type: ignore[arg-type]

    # types, materials, systems

    def mp(self, words: list[str]) -> None:
        """A constant of a material, or a table of it over the temperature, which has to be constant."""
        if words[0].upper() == "MP":
            label, number, values = words[1], words[2], words[3:]
            is_constant = not any(finite(value) for value in values[1:])
        else:
            label, number, values = words[3], words[4], [value for value in words[6:] if value]
            is_constant = len(set(map(finite, values))) <= 1
        label = label.upper()
        if not is_constant:
            self.mesh.skipped.refuse(f"MP, {label} that depends on the temperature")
        elif label in CONSTANTS:
            self.constants.setdefault(int(number), {})[label] = finite(values[0])
        else:
            self.mesh.skipped.skip(f"MP {label}")

    def csys(self, words: list[str]) -> None:
        """The system that places count in from here on."""
        if words[1] not in ("", "0"):
            self.mesh.skipped.refuse(f"CSYS, {words[1]}")

    def local(self, words: list[str]) -> None:
        """A local system: LOCAL, its number, kind, origin and angles; archives write these on lines of their own."""
        if words[1].upper().startswith("R"):
            part, words = words[2].upper(), words[2:]
            number = int(words[1])
            if part == "LOC":
                self._system(number, words[2], words[3:6], [])
            elif part == "ANG":
                self.systems[number] = replace(self.systems[number], axes=euler_axes(_floats(words[2:5])))
            elif any(value not in (0.0, 1.0) for value in _floats(words[2:4])):
                self.mesh.skipped.refuse("LOCAL, an elliptic system")
        else:
            self._system(int(words[1]), words[2], words[3:6], words[6:9])
            if any(value not in (0.0, 1.0) for value in _floats(words[9:11])):
                self.mesh.skipped.refuse("LOCAL, an elliptic system")

    def _system(self, number: int, kind: str, origin: list[str], angles: list[str]) -> None:
        kind_number = int(kind or 0)
        if kind_number >= len(_SYSTEMS):
            self.mesh.skipped.refuse("LOCAL, a toroidal system")
            kind_number = 0
        self.systems[number] = System(_SYSTEMS[kind_number], np.array(_floats(origin)), euler_axes(_floats(angles)))

    # supports, loads, equations

    def d(self, words: list[str]) -> None:
        """Supports of nodes along up to six directions."""
        labels = [label.upper() for label in (words[2], *words[7:12]) if label]
        unknown = [label for label in labels if label not in (*_AXES, "ALL")]
        axes = range(6) if "ALL" in labels else [_AXES[label] for label in labels if label in _AXES]
        for node in self._nodes(words, unknown):
            self.mesh.hold(node, axes, finite(words[3]))

    def f(self, words: list[str]) -> None:
        """A force or a moment on nodes."""
        label = words[2].upper()
        nodes = self._nodes(words, [] if label in _FORCES else [label])
        self.loads += [(node, _FORCES[label], finite(words[3])) for node in nodes if label in _FORCES]

    def _nodes(self, words: list[str], unknown: list[str]) -> list[int]:
        """Nodes of a support or force: ALL, a component, or a node and those up to NEND in steps of NINC."""
        text, last, step = words[1].upper(), words[5], int(words[6] or 1)
        if text == "ALL":
            nodes = list(self.mesh.points)
        elif text.isdigit():
            nodes = [
                n for n in range(int(text), int(last or text) + 1, abs(step) or 1) if n in self.mesh.points or not last
            ]
        else:
            nodes = self.mesh.node_sets.get(words[1], [])
        if unknown or not nodes or finite(words[4]):
            wrong = unknown[0] if unknown else f"{words[4]}, an imaginary part" if nodes else words[1]
            self.mesh.skipped.refuse(f"{words[0].upper()}, {wrong}")
        return nodes

    def ce(self, words: list[str]) -> None:
        """An equation, or more terms of it."""
        if words[1].upper().startswith("R"):
            number, constant = (words[4], words[5]) if words[2].upper() == "DEFI" else (self.equation, "")
            terms = words[3:] if words[2].upper() == "NODE" else []
        else:
            number, constant, terms = words[1].upper(), words[2], words[3:]
            if number in ("", "HIGH", "NEXT"):
                number = f"{len(self.equations) + 1}" if number == "NEXT" else self.equation
        self.equation = number
        if number not in self.equations:
            self.equations[number] = []
            self.mesh.equations.append(self.equations[number])
        if finite(constant):
            self.mesh.skipped.refuse("CE, a constant term")
        for node, label, factor in zip(terms[::3], terms[1::3], terms[2::3], strict=False):
            if node and label.upper() not in _AXES:
                self.mesh.skipped.refuse(f"CE, {label}")
            elif node:
                self.equations[number].append((int(node), _AXES[label.upper()], finite(factor)))

    def cp(self, words: list[str]) -> None:
        """Displacements that are alike."""
        labels = _AXES if words[2].upper() == "ALL" else {words[2].upper(): 0}
        nodes = [word for word in words[3:] if word]
        if not set(labels) <= set(_AXES) or not all(word.isdigit() for word in (words[1], *nodes)):
            self.mesh.skipped.refuse(f"CP, {words[1]}, {words[2]}")
            return
        for node in map(int, nodes):
            first = self.first_coupled.setdefault(words[1], node)  # a set may go on in a further command
            self.mesh.equations += [
                [(node, _AXES[label], 1.0), (first, _AXES[label], -1.0)] for label in labels if node != first
            ]


def _floats(words: list[str]) -> list[float]:
    return [finite(word) for word in (words + [""] * 3)[:3]]


CONSTANTS = words("EX, EY, EZ, DENS, ALPX, ALPY, ALPZ") | {f"{of}{at}" for of in ("NU", "PR", "G") for at in _PAIRS}
READ: dict[str, Callable[[_Archive, list[str]], None]] = {
    "NBLOCK": _Archive.nblock,
    "N": _Archive.n,
    "EBLOCK": _Archive.eblock,
    "CMBLOCK": _Archive.cmblock,
    "ET": _Archive.et,
    "ETBLOCK": _Archive.etblock,
    **dict.fromkeys(("KEYOPT", "KEYOP", "KEYO"), _Archive.keyopt),
    **dict.fromkeys(("MP", "MPDATA"), _Archive.mp),
    "CSYS": _Archive.csys,
    "LOCAL": _Archive.local,
    "D": _Archive.d,
    "F": _Archive.f,
    "CE": _Archive.ce,
    "CP": _Archive.cp,
}
FIELDS = fields_of("""NBLOCK: (NUMFIELD), (Solkey), (NDMAX), NDSEL; N: NODE, X, Y, Z, THXY, THYZ, THZX;
    EBLOCK: (NUM_NODES), Solkey, (NDMAX), (Count); CMBLOCK: Cname, Entity, NUMITEMS, , , , (KOPT);
    ET: ITYPE, Ename, KOP1, KOP2, KOP3, KOP4, KOP5, KOP6, (INOPR); ETBLOCK: NUM, (MAXNUM);
    KEYOPT KEYOP KEYO: ITYPE, KNUM, VALUE; MP: Lab, MAT, C0, C1, C2, C3, C4;
    MPDATA: (version), (count), Lab, MAT, (STLOC), C1, C2, C3, C4, C5, C6; CSYS: KCN;
    LOCAL: KCN, KCS, XC, YC, ZC, THXY, THYZ, THZX, PAR1, PAR2;
    D: NODE, Lab, VALUE, VALUE2, NEND, NINC, Lab2, Lab3, Lab4, Lab5, Lab6; F: NODE, Lab, VALUE, VALUE2, NEND, NINC;
    CE: NEQN, CONST, NODE1, Lab1, C1, NODE2, Lab2, C2, NODE3, Lab3, C3; CP: NSET, Lab, NODE1, ...""")
ALWAYS = words("ACEL, OMEGA, DOMEGA, CGLOC, CGOMEGA, DCGOMG, IRLF, KUSE, BFUNIF, EN, *IF")  # what archives always have
NOTHING = re.compile(r"[0.E+ ,-]*|TEMP,_TINY|R5.5,ATTR,-1,?|_CDRDOFF,EQ,1,THEN", re.IGNORECASE)  # what these then say
TABLE = CardTable(
    read=", ".join(READ),
    fields=FIELDS,
    silent="""FINISH, NUMOFF, DOF, MPTEMP, EXTOPT, SHPP, *ENDIF, *SET, *DIM,
        *GET, *ELSE, CSCIR, ERESX, MAT, TYPE,
        REAL, SECNUM, ESYS, ALLSEL, TREF, TOFFST""",
    harmless={
        "the step is the scene's": """MODCONTROL, QRDOPT, DMPOPT, TIMINT,
            ANTYPE, MODOPT, MXPAND, NSUBST, TIME, OUTRES, OUTPR, KBC, AUTOTS, DELTIM, EQSLV,
            NLGEOM, LUMPM, PSTRES, SSTIF, NROPT, HARFRQ, HROPT, HROUT, TRNOPT, TINTP, CNVTOL, PRED, LNSRCH, NEQIT, NCNV,
            SOLVE, SAVE, RESUME, RESCONTROL, TUNIF, CUTCONTROL, OPNCONTROL, SOLCONTROL, MONITOR, LSWRITE, ADAPT""",
        "damping is the scene's": """ALPHAD, BETAD, DMPRAT, DMPSTR, MDAMP, MP ALPD, MP BETD, MP DMPR, MP DMPS, MP DAMP,
            MP SDMP""",
        "contact is the scene's": "MP MU",
        "bodies are elastic": """STEF, THOPT, EMUNIT, CRPLIM,
            MP KXX, MP KYY, MP KZZ, MP C, MP HF, MP EMIS, MP REFT, MP ENTH, MP RSVX, MP RSVY,
            MP RSVZ, MP PERX, MP MURX, MP SONC, MP VISC""",
        "real constants and sections of what is no solid": "R, RLBLOCK, RMODIF, SECTYPE, SECDATA, SECBLOCK, SECCONTROL",
    },
)
