"""What stands on the cards of an Abaqus deck changes the structure as it should, or is refused by its name."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.small_decks import bricks, cut, frequencies, straight
from tribodyn.geometry.sources import foreign_file
from tribodyn.workflows.run import decks
from tribodyn.workflows.scene.structure_tables import DeckTable

COUNTS = (2, 1, 1)
POINTS, CELLS, FOOT = cut(COUNTS, straight)
TIP = [n for n, x in enumerate(POINTS, 1) if x[0] == 100]
MESH = bricks(COUNTS, straight)
STEEL = "*MATERIAL, NAME=S\n*ELASTIC\n2E5, .3\n*DENSITY\n7.8e-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=S\n"
END = "*NSET, NSET=TIP\n" + "".join(f"{n}\n" for n in TIP)
BASE = MESH + END + STEEL
FEET = BASE + "*BOUNDARY\nFOOT, 1, 3\n"
HALF = [f"*NSET, NSET={name}\n" + "".join(f"{n}\n" for n in TIP[k::2]) for k, name in enumerate("AB")]
RIGID = "*NODE, NSET=R\n900, 130., 10., 5.\n*NODE, NSET=T\n901, 130., 10., 5.\n"
STIFF = RIGID + "*RIGID BODY, NSET=TIP, REF NODE=900\n"
COUPLED = "*COUPLING, REF NODE=900, SURFACE=U\n*KINEMATIC\n"
FACES = "*SURFACE, NAME=F\n2, S4\n*SURFACE, NAME=G\nTIP\n"
SPUN = STIFF + "*ELEMENT, TYPE=MASS, ELSET=M\n90, 900\n*MASS, ELSET=M\n1e-3\n"
PAIRS = list(zip(TIP[:4], FOOT[:4], strict=True))
SINGLE = "".join(f"*EQUATION\n2\n{a}, 1, 1., {b}, 1, -1.\n" for a, b in PAIRS)
COLUMNS = [", ".join(map(str, column)) for column in zip(*PAIRS, strict=True)]


def paired(options: str, first: str, second: str) -> str:
    return f"*NSET, NSET=P{options}\n{first}\n*NSET, NSET=Q{options}\n{second}\n*EQUATION\n2\nP, 1, 1., Q, 1, -1.\n"


def part(inside: str, place: str = "") -> str:
    material, section = STEEL.split("*SOLID")
    item = f"*PART, NAME=P\n{MESH}{END}*SOLID{section}{inside}*END PART\n"
    return f"{item}*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n{place}*END INSTANCE\n*END ASSEMBLY\n{material}"


TURNED = "0., 0., 0.\n0., 0., 0., 0., 0., 1., 30.\n"
EQUAL = {
    "quotes": (BASE.replace("FOOT", '"My, Foot"') + '*BOUNDARY\n"My, Foot", 1, 3\n', FEET),
    "quoted digits": (BASE.replace("=FOOT", '="7"') + '*BOUNDARY\n"7", 1, 3\n', FEET),
    "one label": (BASE.replace("NSET=FOOT", "NSET=FOOT, GENERATE") + "*BOUNDARY\nFOOT, 1, 3\n", FEET),
    "unsorted": (FEET + paired(", UNSORTED", *COLUMNS), FEET + SINGLE),
    "unsorted turned": (FEET + paired(", UNSORTED", *(", ".join(c.split(", ")[::-1]) for c in COLUMNS)), FEET + SINGLE),
    "sorted": (FEET + paired("", ", ".join(COLUMNS[0].split(", ")[::-1]), COLUMNS[1]),
        FEET + paired(", UNSORTED", *(", ".join(map(str, sorted(map(int, c.split(", "))))) for c in COLUMNS))),
    "input": (FEET + "*EQUATION, INPUT=more.txt\n", FEET + SINGLE),
    "include in data": (FEET + "*NSET, NSET=MORE\n*INCLUDE, INPUT=labels.txt\n*BOUNDARY\nMORE, 3\n",
        FEET + "*BOUNDARY\nTIP, 3\n"),
    "tie and pin": (FEET + RIGID + "".join(HALF) + "*RIGID BODY, TIE NSET=A, PIN NSET=B, REF NODE=900\n", FEET + STIFF),
    "three sets": (FEET + RIGID + "".join(HALF) + "*RIGID BODY, NSET=R, TIE NSET=A, PIN NSET=B, REF NODE=900\n",
        FEET + STIFF),
    "rot node": (FEET + STIFF[:-1] + ", ROT NODE=901\n", FEET + STIFF),
    "held rot node": (FEET + STIFF[:-1] + ", ROT NODE=901\n*BOUNDARY\n901, 1, 2\n",
        FEET + STIFF + "*BOUNDARY\n900, 4, 5\n"),
    "turned by an equation": (FEET + STIFF[:-1] + ", ROT NODE=901\n*EQUATION\n2\nT, 3, 1., R, 2, -.01\n",
        FEET + STIFF + "*EQUATION\n2\nR, 6, 1., R, 2, -.01\n"),
    "points alone": (FEET + SPUN + "*NSET, NSET=X\n900, 901\n*BOUNDARY\nX, 1, 6\n",
        FEET + SPUN + "*BOUNDARY\n900, 1, 6\n"),
    "both kinds": (BASE + SPUN + "*NSET, NSET=X\n900, FOOT\n*BOUNDARY\nX, 1, 3\n",
        FEET + SPUN + "*BOUNDARY\n900, 1, 3\n"),
    "union": (FEET + RIGID + FACES + "*SURFACE, NAME=U, COMBINE=UNION\nF\n" + COUPLED, FEET + STIFF),
    "union before its members": (FEET + RIGID + "*SURFACE, NAME=U, COMBINE=UNION\nf, F\n" + FACES + COUPLED,
        FEET + STIFF),
    "supports of a part": (part("*BOUNDARY\nFOOT, 1, 3\n"), FEET),
    "supports of a turned part": (part("*BOUNDARY\nFOOT, ENCASTRE\n", TURNED), FEET),
    "equations of a part": (part("*BOUNDARY\nFOOT, 1, 3\n" + SINGLE), FEET + SINGLE),
    "a rigid body of a part": (part("*BOUNDARY\nFOOT, 1, 3\n" + STIFF), FEET + STIFF),
    "new supports": (BASE + "*BOUNDARY\nTIP, 1, 3\n*STEP\n*BOUNDARY, OP=NEW\nFOOT, 1, 3\n*END STEP\n", FEET),
    "supports of an earlier step": (
        FEET + "*STEP\n*BOUNDARY\nTIP, 1\n*END STEP\n*STEP\n*BOUNDARY, OP=NEW\nFOOT, 1, 3\n*END STEP\n",
        FEET,
    ),
    "two cards of new supports": (
        BASE + "*BOUNDARY\nTIP, 1, 3\n*STEP\n*BOUNDARY, OP=NEW\nFOOT, 1, 2\n*BOUNDARY, OP=NEW\nFOOT, 3\n*END STEP\n",
        FEET,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EQUAL)
def test_two_ways_of_writing_a_structure_give_the_same(case: str, tmp_path: Path) -> None:
    (tmp_path / "more.txt").write_text(SINGLE.replace("*EQUATION\n", ""))
    (tmp_path / "labels.txt").write_text("".join(f"{n}\n" for n in TIP))
    text, expected = EQUAL[case]
    np.testing.assert_allclose(frequencies(text, 5, tmp_path), frequencies(expected, 5, tmp_path), rtol=1e-7)


def eight_nodes(kind: str) -> str:
    """A bar of 100 x 10 x 10 mm of 8 x 2 x 2 bricks of a type."""
    points, cells, foot = cut((8, 2, 2), lambda x: x * [100.0, 10.0, 10.0])
    corners = sorted({n for c in cells for n in c[:8]})
    lines = [
        "*NODE", *(f"{n}, {', '.join(map(str, points[n - 1]))}" for n in corners), f"*ELEMENT, TYPE={kind}, ELSET=ALL",
    ]  # fmt: skip
    lines += [f"{e}, {', '.join(map(str, c[:8]))}" for e, c in enumerate(cells, 1)]
    foot = [str(n) for n in foot if n in corners]
    return "\n".join(
        [*lines, "*NSET, NSET=FOOT", *foot, STEEL.replace("2E5", "210000."), "*BOUNDARY", "FOOT, 1, 3", ""]
    )


@pytest.mark.parametrize(("kind", "hertz", "within"), [
    ("C3D8", 1077.5, 1e-4),  # as CalculiX has it
    ("C3D8I", 840.18, 1e-2),  # of second order
    ("C3D8R", 729.81, 1e-4),
])  # fmt: skip
def test_hexahedra_are_computed_as_the_deck_names_them(kind: str, hertz: float, within: float, tmp_path: Path) -> None:
    text = eight_nodes(kind)
    np.testing.assert_allclose(frequencies(text, 2, tmp_path), hertz, rtol=within)
    (tmp_path / "own.inp").write_text(text.replace("\n32, ", "\n*ELEMENT, TYPE=C3D8X, ELSET=ALL\n32, "))
    several = foreign_file.read(tmp_path / "own.inp").notes
    assert len(several) == (kind != "C3D8")


BROKEN = {
    "empty set": ("*NSET, NSET=E\n*BOUNDARY\nE, 1\n",
        r"\*BOUNDARY at line \d+ of 'own.inp' names the set 'E', which is empty"),
    "empty set of a load": ("*NSET, NSET=E\n*CLOAD\nE, 1, 2.\n", "which is empty"),
    "increment 0": ("*NSET, NSET=E, GENERATE\n1, 9, 0\n",
        r"\*NSET at line \d+ of 'own.inp' generates labels from 1 to 9 by 0"),
    "backwards": ("*NSET, NSET=E, GENERATE\n9, 1, -1\n", "generates labels from 9 to 1 by -1"),
    "too many": ("*NSET, NSET=E, GENERATE\n1, 99999999999\n", "count up, to 1e7 labels"),
    "no direction": ("*BOUNDARY\nFOOT\n", "names no direction of 'FOOT'"),
    "directions backwards": ("*BOUNDARY\nFOOT, 3, 1\n", "names the directions 3 to 1"),
    "no mass": ("*MASS, ELSET=M\n", "has no mass"),
    "no file": ("*INCLUDE\n", "names no file"),
    "unequal sets": (paired("", "1, 2, 3", "4, 5"), "pairs sets of 2 and 3 nodes"),
    "a set after a node": ("*EQUATION\n2\n1, 1, 1., FOOT, 1, -1.\n", "pairs sets of 1 and"),
    "data elsewhere": ("*BOUNDARY, INPUT=more.txt\n", r"\*BOUNDARY at line \d+ .* has its data in another file"),
    "a term too many": ("*EQUATION\n2\n1, 1, 1., 2, 1, -1., 3, 1, 1.\n", "has 9 fields for its 2 terms"),
    "an axis 0": ("*EQUATION\n2\n1, 0, 1., 2, 0, -1.\n", "names the direction '0'"),
    "a spring of no length": ("*ELEMENT, TYPE=SPRINGA, ELSET=K\n90, 1, 1\n*SPRING, ELSET=K\n5.\n", "at one place"),
    "a node again": ("*NODE\n1, 9., 9., 9.\n", "has node 1 again"),
    "an element again": ("*ELEMENT, TYPE=MASS\n1, 1\n", "has element 1 again"),
    "too many nodes": ("*ELEMENT, TYPE=C3D4\n90, 1, 2, 3, 4, 5\n", "with more nodes than C3D4 has"),
    "a constant again": ("*MATERIAL, NAME=T\n*DENSITY\n1.\n*DENSITY\n2.\n", "gives another value of material 'T'"),
    "a set with a lost node": ("*NSET, NSET=E\n1, 999\n*BOUNDARY\nE, 1\n", "names 'E' with node 999"),
    "a part again": ("*PART, NAME=P\n*END PART\n*PART, NAME=p\n", "has the name 'p' of another part"),
    "infinite": ("*NODE\n990, 1e400, 0., 0.\n", "expects a number, got '1e400'"),
    "the same element twice": ("*ELEMENT, TYPE=C3D8\n77, " + ", ".join(map(str, CELLS[0][:8])) + "\n",
        "such as 1 and 77"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_what_cannot_be_read_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    (tmp_path / "own.inp").write_text(FEET + BROKEN[case][0])
    with pytest.raises(ValueError, match=BROKEN[case][1]):
        foreign_file.read(tmp_path / "own.inp")


NAMED = {
    "*NODE, SYSTEM=Q": "*NODE, SYSTEM=Q\n990, 1., 0., 0.\n",
    "*MPC": "*MPC\nBEAM, 1, 2\n",
    "*TRANSFORM": "*TRANSFORM, NSET=FOOT, TYPE=R\n1., 1., 0., -1., 1., 0.\n",
    "S4": "*ELEMENT, TYPE=S4, ELSET=SHELL\n9100, 1, 2, 3, 4\n",
    "*DLOAD, GRAV": "*DLOAD\nALL, GRAV, 9810., 0., 0., -1.\n",
    "*OF ANOTHER AGE": "*OF ANOTHER AGE\n1\n",
    "*EQUATION, REMOVE": "*EQUATION, REMOVE\n",
    "*TIE, CYCLICSYMMETRY": FACES + "*TIE, CYCLIC SYMMETRY, NAME=T\nF, F\n",
    "*RIGID BODY, ELSET": RIGID + "*RIGID BODY, ELSET=ALL, REF NODE=900\n",
    "*COUPLING, INFLUENCERADIUS": RIGID
    + FACES
    + "*COUPLING, REF NODE=900, SURFACE=F, INFLUENCE RADIUS=3.\n*KINEMATIC\n",
    "*DISTRIBUTING, WEIGHTINGMETHOD=LINEAR": RIGID
    + FACES
    + "*COUPLING, REF NODE=900, SURFACE=F\n*DISTRIBUTING, WEIGHTING METHOD=LINEAR\n",
    "*MASS, TYPE=ANISOTROPIC": "*ELEMENT, TYPE=MASS, ELSET=M\n90, 1\n*MASS, ELSET=M, TYPE=ANISOTROPIC\n1.\n",
    "*BOUNDARY, TYPE=VELOCITY": "*BOUNDARY, TYPE=VELOCITY\n1, 1\n",
    "*BOUNDARY, 7 in field 5": "*BOUNDARY\n1, 1, 1, 0., 7\n",
    "*NSET, 5": "*NSET, NSET=E, 5\n1\n",
    "*SURFACE, COMBINE=DIFFERENCE": FACES + "*SURFACE, NAME=D, COMBINE=DIFFERENCE\nF, G\n",
    "supports with a displacement": "*BOUNDARY\nTIP, 1, 1, .05\n",
    "*BOUNDARY, direction 11": "*BOUNDARY\nTIP, 11, 11, 5.\n",
    "*KINEMATIC, direction 7": RIGID + FACES + "*COUPLING, REF NODE=900, SURFACE=F\n*KINEMATIC\n1, 6\n7, 9\n",
    "*COUPLING, without *KINEMATIC or *DISTRIBUTING": RIGID + FACES + "*COUPLING, REF NODE=900, SURFACE=F\n",
    "elements of type MASS without *MASS": "*ELEMENT, TYPE=MASS, ELSET=M\n90, 1\n",
    "*MASS, of elements of type C3D20": "*MASS, ELSET=ALL\n1.\n",
    "*MASS, 2. in field 1": "*ELEMENT, TYPE=MASS, ELSET=M\n90, 1\n*MASS, ELSET=M\n1.\n2.\n",
    "*SPRING, of SPRING2 with other numbers than its directions and a stiffness": "*ELEMENT, TYPE=SPRING2, ELSET=K\n"
    "90, 1, 2\n*SPRING, ELSET=K\n1\n5.\n",
    "*CONTACT PAIR, F in field 3": FACES + "*CONTACT PAIR\nF, G, F\n",
}


@pytest.mark.parametrize("name", NAMED)
def test_what_is_not_declared_is_refused_by_name_and_ignored_on_request(name: str, tmp_path: Path) -> None:
    (tmp_path / "own.inp").write_text(FEET + NAMED[name])
    assert list(foreign_file.read(tmp_path / "own.inp", "mm").refused) == [name]
    with pytest.raises(ValueError, match=f'not carried over.*ignore = ."{re.escape(name)}"'):
        decks.structure("d", DeckTable(file="own.inp", unit=1e-3), {}, tmp_path)
    if "SURFACE" not in name:
        notes = decks.structure("d", DeckTable(file="own.inp", unit=1e-3, ignore=(name,)), {}, tmp_path).notes
        assert any("by ignore" in note for note in notes)
    with pytest.raises(ValueError, match="NOWHERE"):
        decks.structure("d", DeckTable(file="own.inp", unit=1e-3, ignore=(name, "NOWHERE")), {}, tmp_path)


@pytest.mark.parametrize(("cards", "forces"), [
    (("", "1, 1, 5.", "1, 1, 8."), [5, 8]),
    (("1, 1, 5.", "", "1, 1, 8."), [8]),
    (("1, 1, 5.", "2, 1, 6.", "1, 1, 8."), [6, 8]),
    (("1, 1, 5.", "2, 1, 6.", "*CLOAD, OP=NEW\n1, 1, 8."), [8]),
])  # fmt: skip
def test_a_load_is_that_of_the_last_step_which_gives_it(cards, forces, tmp_path):
    start, *steps = ("" if not card else card if card[0] == "*" else f"*CLOAD\n{card}" for card in cards)
    steps = [f"*STEP\n{start}\n*END STEP\n", *(f"*STEP\n{step}\n*END STEP\n" for step in steps)] if start else [
        "*STEP\n" + "\n".join(steps) + "\n*END STEP\n"
    ]  # fmt: skip
    (tmp_path / "own.inp").write_text(FEET + "".join(steps))
    assert [force.value for force in foreign_file.read(tmp_path / "own.inp").deck.forces] == forces
