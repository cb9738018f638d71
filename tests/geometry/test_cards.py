"""What becomes of each card of a deck is what its format's table says; what is read is the structure it should be."""

import re
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.small_decks import archive, bricks, bulk, cut, frequencies, straight
from tribodyn.geometry.sources import abaqus_cards, ansys, foreign_file, nastran

TABLES = {"inp": abaqus_cards.TABLE, "bdf": nastran.TABLE, "cdb": ansys.TABLE}
SMALL = (2, 1, 1)
END = len(cut(SMALL, straight)[0])  # a node beyond those of the solids comes after
STEEL = "*MATERIAL, NAME=S\n*ELASTIC\n200000., .3\n*DENSITY\n7.8e-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=S\n"
TYPES = "ETBLOCK,1,1\n(2i9,19a9)\n        1      186        0        0        1\n       -1\n"
POINT = "*NODE\n999, 150., 0., 0.\n"
LUMP = POINT + "*ELEMENT, TYPE=MASS, ELSET=M\n9, 999\n*MASS, ELSET=M\n1e-3\n"
PART = (
    "*PART, NAME=P\n"
    + bricks(SMALL, straight)
    + STEEL[STEEL.index("*SOLID") :]
    + "*END PART\n*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*END ASSEMBLY\n"
    + STEEL[: STEEL.index("*SOLID")]
)
FACES = "*SURFACE, NAME=END\n2, S4\n*SURFACE, NAME=START\n1, S6\n"
BASES = {
    "inp": bricks(SMALL, straight) + STEEL,
    "bdf": bulk(SMALL, straight) + "PSOLID,1,1\nMAT1,1,200000.,,.3,7.8-9\n",
    "cdb": archive(SMALL, straight, support="") + "MP,EX,1,200000.\nMP,NUXY,1,.3\nMP,DENS,1,7.8E-9\n",
}
BASES["parts"] = PART
# card -> (base, what is added to it); the card's own lines are then taken away
READ = {
    "inp": {
        **dict.fromkeys(("NODE", "ELEMENT", "NSET", "SOLID SECTION", "MATERIAL", "ELASTIC", "DENSITY"), ("inp", "")),
        **dict.fromkeys(("PART", "END PART", "INSTANCE", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY"), ("parts", "")),
        "ELSET": ("inp", "*ELSET, ELSET=SOME\n1\n"),
        "SURFACE": ("inp", "*SURFACE, NAME=END\n2, S4\n"),
        "INCLUDE": ("inp", "*INCLUDE, INPUT=more.inp\n"),
        "SYSTEM": ("inp", "*SYSTEM\n1., 0., 0.\n" + LUMP),
        "ORIENTATION": ("inp", "*ORIENTATION, NAME=OWN\n1., 1., 0., -1., 1., 0.\n"),
        "DISTRIBUTION": ("inp", "*ORIENTATION, NAME=OWN\nD\n*DISTRIBUTION, NAME=D\n, 1., 1., 0., -1., 1., 0.\n"),
        "EXPANSION": ("inp", "*EXPANSION\n1e-5\n"),
        "MASS": ("inp", LUMP),
        "SPRING": ("inp", "*ELEMENT, TYPE=SPRING1, ELSET=K\n9, 1\n*SPRING, ELSET=K\n1\n500.\n"),
        "TIE": ("inp", FACES + "*TIE, NAME=T\nEND, START\n"),
        "EQUATION": ("inp", "*EQUATION\n2\n1, 1, 1., 2, 1, -1.\n"),
        **dict.fromkeys(
            ("COUPLING", "KINEMATIC"),
            ("inp", POINT + FACES + "*COUPLING, REF NODE=999, SURFACE=END\n*KINEMATIC\n"),
        ),
        "DISTRIBUTING": ("inp", POINT + FACES + "*COUPLING, REF NODE=999, SURFACE=END\n*DISTRIBUTING\n"),
        "KINEMATIC COUPLING": ("inp", POINT + "*KINEMATIC COUPLING, REF NODE=999\nFOOT\n"),
        "DISTRIBUTING COUPLING": ("inp", POINT + "*DISTRIBUTING COUPLING, REF NODE=999\nFOOT, 1.\n"),
        "RIGID BODY": ("inp", POINT + "*RIGID BODY, REF NODE=999, NSET=FOOT\n"),
        "CLOAD": ("inp", "*CLOAD\n1, 1, 5.\n"),
        "BOUNDARY": ("inp", "*BOUNDARY\nFOOT, 1, 3\n"),
        "DSLOAD": ("inp", FACES + "*DSLOAD\nEND, P, 1.\n"),
        "DLOAD": ("inp", "*DLOAD\nALL, P1, 1.\n"),
        "INITIAL CONDITIONS": ("inp", "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nFOOT, 20.\n"),
        "STEP": ("inp", "*STEP\n*END STEP\n*STEP\n*END STEP\n"),
        "CONTACT PAIR": ("inp", FACES + "*CONTACT PAIR\nEND, START\n"),
        **dict.fromkeys(
            ("SURFACE INTERACTION", "FRICTION", "CHANGE FRICTION"),
            ("inp", FACES + "*SURFACE INTERACTION, NAME=DRY\n*FRICTION\n.2,\n*CHANGE FRICTION, INTERACTION=DRY\n"
                            "*FRICTION\n.4,\n*CONTACT PAIR, INTERACTION=DRY\nEND, START\n"),
        ),
    },
    "bdf": {
        **dict.fromkeys(("GRID", "CHEXA", "PSOLID", "MAT1"), ("bdf", "")),
        "CTETRA": ("bdf", "CTETRA,90,1,1,2,3,5\n"),
        "CPENTA": ("bdf", "CPENTA,90,1,1,2,3,5,6,7\n"),
        "CPYRAM": ("bdf", "CPYRAM,90,1,1,2,3,4,5\n"),
        "GRDSET": ("bdf", "GRDSET,,,,,,,123\n"),
        "INCLUDE": ("bdf", "INCLUDE 'more.bdf'\n"),
        **{
            f"CORD1{k}": ("bdf", f"GRID,991,,0.,0.,0.\nGRID,992,,0.,0.,1.\nGRID,993,,1.,0.,0.\n"
                                 f"CORD1{k},7,991,992,993\nGRID,999,7,2.,30.,5.\nCONM2,1,999,,1.-3\n")
            for k in "RCS"
        },
        **{
            f"CORD2{k}": ("bdf", f"CORD2{k},7,,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\nGRID,999,7,2.,30.,5.\n"
                                 "CONM2,1,999,,1.-3\n")
            for k in "RCS"
        },
        **dict.fromkeys(("CELAS1", "PELAS"), ("bdf", "PELAS,4,500.\nCELAS1,8,4,1,1,2,1\n")),
        "CELAS2": ("bdf", "CELAS2,8,500.,1,1\n"),
        "LOAD": ("bdf", "LOAD,9,2.,3.,1\nFORCE,1,2,,5.,1.,0.,0.\n"),
        "SPCADD": ("bdf", "SPC = 9\nBEGIN BULK\nSPC1,1,123,1\nSPCADD,9,1\n"),
        "MPCADD": ("bdf", "MPC = 9\nBEGIN BULK\nMPC,1,1,1,1.,2,1,-1.\nMPCADD,9,1\n"),
        "MAT9": ("bdf", "MAT9,2,3.+5,1.+5,1.+5,,,,3.+5\n+,1.+5,,,,3.+5,,,\n+,1.+5,,,1.+5,,1.+5,7.8-9\n"),
        "MAT11": ("bdf", "MAT11,2,140000.,9000.,10000.,.3,.28,.4,5000.\n+,4500.,3500.,1.6-9\n"),
        "SET1": ("bdf", "SET1,5,1,2,3\n"),
        "PARAM": ("bdf", "PARAM,WTMASS,.001\n"),
        "PARAM WTMASS": ("bdf", "PARAM,WTMASS,.001\n"),
        "SPC": ("bdf", "SPC,1,1,123\n"),
        "SPC1": ("bdf", "SPC1,1,123,1,THRU,4\n"),
        "FORCE": ("bdf", "FORCE,1,2,,5.,1.,0.,0.\n"),
        "MOMENT": ("bdf", "GRID,999,,150.,0.,0.\nRBE2,5,999,123456,1,2,3\nMOMENT,1,999,,5.,1.,0.,0.\n"),
        "MPC": ("bdf", "MPC,1,1,1,1.,2,1,-1.\n"),
        "RBE2": ("bdf", "GRID,999,,150.,0.,0.\nRBE2,5,999,123456,1,2,3\n"),
        "RBE3": ("bdf", "GRID,999,,150.,0.,0.\nRBE3,5,,999,123456,1.,123,1,2\n+,3\n"),
        "CONM2": ("bdf", "CONM2,5,1,,1.-3\n"),
    },
    "cdb": {
        **dict.fromkeys(("NBLOCK", "EBLOCK", "MP"), ("cdb", "")),
        "N": ("cdb", f"N,{END + 1},150.,0.,0.\nF,{END + 1},FX,1.\n"),
        "CMBLOCK": ("cdb", "CMBLOCK,SOME,NODE,       2\n(8i10)\n         1         2\n"),
        **dict.fromkeys(("ET", "KEYOPT"), ("", BASES["cdb"].replace("EBLOCK,19", "KEYOPT,1,3,1\nEBLOCK,19"))),
        **{
            name: ("", BASES["cdb"].replace("EBLOCK,19", f"{name},1,3,1\nEBLOCK,19")) for name in ("KEYOP", "KEYO")
        },
        "ETBLOCK": ("", BASES["cdb"].replace("ET,1,186\n", TYPES)),
        "MPDATA": ("cdb", "MPDATA,R5.0, 1,EX  ,  1, 1,  2.1E+05,\n"),
        "CSYS": ("cdb", "CSYS,11\n"),
        "LOCAL": ("", archive(SMALL, straight, system=11) + "MP,EX,1,2E5\nMP,EY,1,1E5\nLOCAL,11,0,0.,0.,0.,30.\n"),
        "D": ("cdb", "D,       1,UX  ,  0.0\n"),
        "F": ("cdb", "F,       1,FX  ,  5.0\n"),
        "CE": ("cdb", "CE,R5.0,DEFI, 2, 1, 0.0\nCE,R5.0,NODE, 1,UX  , 1.0, 2,UX  , -1.0\n"),
        "CP": ("cdb", "CP,1,UX,1,2\n"),
    },
}  # fmt: skip
FRAMES = ("END PART", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY")  # of what stands between them
FURTHER_CARDS = {"inp": "*NSET, NSET=MORE\n2\n", "bdf": "SET1,77,1\n", "cdb": ""}


def without(text: str, card: str, ending: str) -> str:
    """A deck without the lines of a card."""
    if ending == "inp":
        return re.sub(rf"(?m)^\*{card}(?=[,\n]).*\n([^*\n].*\n)*", "", text)
    if ending == "bdf":
        return re.sub(rf"(?m)^{card.split()[0]}[, ].*\n(\+.*\n)*", "", text)
    blocks = {"NBLOCK": r"N,R5.*\n", "EBLOCK": r"\s+-1\n", "CMBLOCK": r"\s+1\s+2\n", "ETBLOCK": r"\s+-1\n"}
    return re.sub(rf"(?m)^{card},.*\n" + (rf"(.*\n)*?{blocks[card]}" if card in blocks else ""), "", text)


@cache
def outcome_of(text: str, ending: str) -> tuple[object, ...]:
    """All that a deck gives: meshes, groups, what else it holds, and what is told of it."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / f"more.{ending}").write_text(FURTHER_CARDS[ending])
        (folder / f"own.{ending}").write_text(text)
        content = foreign_file.read(folder / f"own.{ending}", "mm")
    bodies = {
        name: (body.mesh.doflocs.tolist(), {key: of.tolist() for key, of in body.node_sets.items()})
        for name, body in content.bodies.items()
    }
    places = {name: place.tolist() for name, place in content.points.items()}
    return (
        repr(bodies) + repr(content.deck) + repr(places), list(content.notes), list(content.unused),
        dict(content.refused),
    )  # fmt: skip


def built(ending: str, card: str) -> str:
    base, extra = READ[ending][card]
    text = BASES.get(base, "")
    if "BEGIN BULK" in extra:
        return extra.replace("BULK\n", f"BULK\n{text}")
    return text.replace("MATERIAL=S\n", "MATERIAL=S, ORIENTATION=OWN\n") + extra if "=OWN" in extra else text + extra


def test_every_card_that_is_read_has_its_deck() -> None:
    for ending, table in TABLES.items():
        assert not table.reads - set(READ[ending]), ending


@pytest.mark.parametrize(("ending", "card"), [(ending, card) for ending, cards in READ.items() for card in cards])
def test_a_card_that_is_read_matters(ending: str, card: str) -> None:
    text = built(ending, card)
    smaller = without(text, card, ending)
    assert smaller != text
    *_, refused = full = outcome_of(text, ending)
    choices = ("ET", "ETBLOCK", "KEYOPT", "KEYOP", "KEYO", "CSYS", "LOCAL")  # what these choose is refused
    assert not refused or card in choices
    with suppress(ValueError):  # of a deck that lacks what it cannot do without
        assert card in FRAMES or outcome_of(smaller, ending) != full


@pytest.mark.parametrize("ending", TABLES)
def test_harmless_cards_are_named_and_others_refused(ending: str) -> None:
    table, base = TABLES[ending], outcome_of(BASES[ending], ending)
    line = {"inp": "*{}\n", "bdf": "{},1\n", "cdb": "{},1\n"}[ending]
    for card in table.spares:
        kind = card.replace("PARAM ", "PARAM,").replace("MP ", "MP,")
        result, _, unused, refused = outcome_of(BASES[ending] + line.format(kind), ending)
        assert result == base[0], card
        assert card in unused[-1], card
        assert not refused, card
    for card in table.silents - {"RESTART"}:
        assert outcome_of(BASES[ending] + line.format(card), ending) == base, card
    assert list(outcome_of(BASES[ending] + line.format("OTHER"), ending)[-1]) == [line.format("OTHER").strip(",1\n")]


FORCE = "FORCE,1,2,,5.,1.,0.,0.\n"
# what is written in two ways: added to the base of a format, or in place of another text
ALIKE = {
    "a long free line": ("bdf", "SPC1,1,123,1,2,3,4,5,6,7,8,9,10\n", "SPC1,1,123,1,THRU,10\n"),
    "a range wider than the mesh": ("bdf", f"SPC1,1,123,1,THRU,{10**12}\n", f"SPC1,1,123,1,THRU,{END}\n"),
    "a load twice in a sum": ("bdf", f"LOAD,9,1.,1.,1,2.,1\n{FORCE}", f"LOAD,9,1.,3.,1\n{FORCE}"),
    "after ENDDATA": ("bdf", " ENDDATA\nSPC1,1,123,1\nNOTES OF AN OLD RUN\n", ""),
    "a marker": ("bdf", f"SPC1,1,123,1,2,3,4,5,6,+A\n{FORCE}+A,7,8\n", f"SPC1,1,123,1,THRU,8\n{FORCE}"),
    "a marker before": ("bdf", f"{FORCE}+A,7,8\nSPC1,1,123,1,2,3,4,5,6,+A\n", f"{FORCE}SPC1,1,123,1,THRU,8\n"),
    "a range": ("cdb", "D,1,UX,0,,5,2,UY\n", "D,1,UX\nD,3,UX\nD,5,UX\nD,1,UY\nD,3,UY\nD,5,UY\n"),
    "a range of forces": ("cdb", "F,1,FX,2.,,2\n", "F,1,FX,2.\nF,2,FX,2.\n"),
    "defaults": ("cdb", "ACEL,0.,0.,0.  ! none\nBFUNIF,TEMP,_TINY\n*IF,_CDRDOFF,EQ,1,THEN\n", ""),
    "a format of integers": ("cdb", "(3i9,6e21.13e3)\n", "(1i9,2i9,6e21.13)\n"),
    "types in a block": ("cdb", "ET,1,186\n", TYPES.replace("        1\n", "\n")),
}


@pytest.mark.parametrize("case", ALIKE)
def test_ways_to_write_a_card_are_alike(case: str) -> None:
    ending, first, second = ALIKE[case]
    base = BASES[ending]
    texts = [base, base.replace(first, second)] if first in base else [base + first, base + second]
    assert outcome_of(texts[0], ending)[0] == outcome_of(texts[1], ending)[0]
    assert not outcome_of(texts[0], ending)[-1]


@pytest.mark.parametrize(("ending", "extra", "words"), [
    ("bdf", "GRID,1,,5.,0.,0.\n", "has a second GRID 1, which differs"),
    ("bdf", "CTETRA,1,1,1,2,3,5\n", "two elements have the number 1"),
    ("bdf", "MAT1,1,1000.,,.3\n", "has a second MAT1 1"),
    ("bdf", "SPC1,1,123,1\n+B,2\n+C,3\n+D,4\nSPC1,1,123,1,2,3,4,5,6,+Q\n+R,1\n", "no card ends with the marker"),
    ("cdb", "N,1,5.,0.,0.\n", "two nodes have the number 1"),
    ("cdb", "F,1,FX,nan\n", "no finite number: 'nan'"),
    ("bdf", "SPC1,1,123,9,THRU,2\n", "a list has 9 THRU 2"),
    ("bdf", "SPC1,1,123,THRU,2\n", "a list has 0 THRU 2"),
    ("bdf", "CELAS2,8,500.,1,12\n", "names the directions '12'"),
    ("bdf", "MPC,1,1,12,1.,2,12,-1.\n", "names the directions '12'"),
    ("bdf", "CELAS2,8,inf,1,1\n", "expects a number, got 'inf'"),
])  # fmt: skip
def test_what_contradicts_itself_is_refused(ending: str, extra: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        outcome_of(BASES[ending] + extra, ending)


@pytest.mark.parametrize(("ending", "extra", "refused"), [
    ("bdf", "GRID,999,,1.,0.,0.,,,7\n", "GRID, 7 in field 8"),
    ("bdf", "CONM2,5,1,7,1.-3,,,,,2.\n", "CONM2, inertia along a system"),
    ("bdf", "PSOLID,2,1,0,TWO,,FULL\n", "PSOLID, TWO"),
    ("bdf", "MAT1,2,200000.,50000.,.3\n", "MAT1, a G that is not E / 2 (1 + NU)"),
    ("bdf", "GRID,999,,150.,0.,0.\nRBE2,5,999,123456,1,2,3,4,5,1.2-5\n", "RBE2, ALPHA"),
    ("cdb", "D,1,UX,0,3.\n", "D, 3., an imaginary part"),
    ("cdb", "F,1,FX,2.,,2,1,UY\n", "F, UY in field 7"),
    ("cdb", "LOCAL,11,1,0,0,0,0,0,0,2.\n", "LOCAL, an elliptic system"),
    ("cdb", "ACEL,0.,0.,9810.\n", "ACEL"),
    ("cdb", "*IF,A,GT,1,THEN\nD,1,UX\n*ENDIF\n", "*IF"),
])  # fmt: skip
def test_what_a_reader_does_not_know_is_refused_by_name(ending: str, extra: str, refused: str) -> None:
    assert refused in outcome_of(BASES[ending] + extra, ending)[-1]


# the same structure in the words of two formats
SUPPORTED = {"inp": "*BOUNDARY\nFOOT, 1, 3\n"}
COUNTS = (4, 1, 1)
STEEL_BDF, STEEL_CDB = BASES["bdf"][BASES["bdf"].index("PSOLID") :], BASES["cdb"][BASES["cdb"].index("MP,") :]
PLY = "".join(
    f"MP,{name},1,{value}\n"
    for name, value in zip(
        ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "GXY", "GXZ", "GYZ", "DENS"),
        (140000, 9000, 10000, 0.3, 0.28, 0.4, 5000, 4500, 3500, 1.6e-9),
        strict=True,
    )
)
MINOR = PLY.replace("PRXY,1,0.3", f"NUXY,1,{0.3 * 9 / 140}").replace("PRXZ,1,0.28", f"NUXZ,1,{0.28 / 14}")
PLY_INP = """*MATERIAL, NAME=PLY
*ELASTIC, TYPE=ENGINEERING CONSTANTS
140000., 9000., 10000., .3, .28, .4, 5000., 4500.,
3500.
*DENSITY
1.6e-9
*SOLID SECTION, ELSET=ALL, MATERIAL=PLY"""
TURNED = "*ORIENTATION, NAME=OWN\n.8660254037844387, .5, 0., -.5, .8660254037844387, 0.\n"
EQUAL_DECKS = {
    "PS": ("bdf", bulk(COUNTS, straight, "123456") + STEEL_BDF, STEEL),
    "GRDSET": ("bdf", "GRDSET,,,,,,,23\n" + bulk(COUNTS, straight, "123") + STEEL_BDF,
        STEEL + "*BOUNDARY\nALL, 2, 3\n"),
    "WTMASS": ("bdf",
        bulk(COUNTS, straight, "123") + "PSOLID,1,1\nMAT1,1,200000.,,.3,7.8-6\nPARAM,WTMASS,.001\nCONM2,1,5,,.05\n",
        STEEL + "*ELEMENT, TYPE=MASS, ELSET=M\n90, 5\n*MASS, ELSET=M\n5e-5\n"),
    "CELAS2": (
        "bdf",
        bulk(COUNTS, straight, "123") + STEEL_BDF + "CELAS2,9,500.,5,2\nCELAS2,10,700.,5,3,7,3\n",
        STEEL + "*ELEMENT, TYPE=SPRING1, ELSET=K\n90, 5\n*SPRING, ELSET=K\n2\n500.\n"
        "*ELEMENT, TYPE=SPRING2, ELSET=L\n91, 5, 7\n*SPRING, ELSET=L\n3, 3\n700.\n",
    ),
    "MPC": ("bdf", bulk(COUNTS, straight, "123") + STEEL_BDF + "MPC,1,6,2,1.,7,2,-2.\n+,,8,3,.5\n",
        STEEL + "*EQUATION\n3\n6, 2, 1., 7, 2, -2., 8, 3, .5\n"),
    "RBE3": (
        "bdf",
        bulk(COUNTS, straight, "123") + STEEL_BDF + "GRID,999,,50.,40.,5.\nRBE3,9,,999,123456,1.,123,5,6\n+,7,8\n"
        "CONM2,9,999,,2.-5\n",
        STEEL + "*NODE\n999, 50., 40., 5.\n*NSET, NSET=R\n5, 6, 7, 8\n*DISTRIBUTING COUPLING, REF NODE=999\nR, 1.\n"
        "*ELEMENT, TYPE=MASS, ELSET=M\n90, 999\n*MASS, ELSET=M\n2e-5\n",
    ),
    "MAT11 in CORD2R": (
        "bdf",
        bulk(COUNTS, straight, "123") + "CORD2R,7,,0.,0.,0.,0.,0.,1.\n+,.866025403784,.5,0.\nPSOLID,1,1,7\n"
        "MAT11,1,140000.,9000.,10000.,.3,.28,.4,5000.\n+,4500.,3500.,1.6-9\n",
        TURNED + PLY_INP + ", ORIENTATION=OWN\n",
    ),
    "D": ("cdb", archive(COUNTS, straight) + STEEL_CDB, STEEL),
    "D, ALL": ("cdb", archive(COUNTS, straight) + STEEL_CDB + "D,ALL,UZ,0\n", STEEL + "*BOUNDARY\nALL, 3\n"),
    "CE": (
        "cdb",
        archive(COUNTS, straight) + STEEL_CDB
        + "CE,R5.0,DEFI, 3, 1, 0.0\nCE,R5.0,NODE, 6,UY  , 1.0, 7,UY  , -2.0\nCE,R5.0,NODE, 8,UZ  , 0.5\n",
        STEEL + "*EQUATION\n3\n6, 2, 1., 7, 2, -2., 8, 3, .5\n",
    ),
    "CP": ("cdb", archive(COUNTS, straight) + STEEL_CDB + "CP,1,UY,5,6,7\n",
        STEEL + "*EQUATION\n2\n6, 2, 1., 5, 2, -1.\n*EQUATION\n2\n7, 2, 1., 5, 2, -1.\n"),
    "orthotropic": ("cdb", archive(COUNTS, straight) + PLY, PLY_INP + "\n"),
    "orthotropic, minor ratios": ("cdb", archive(COUNTS, straight) + MINOR, PLY_INP + "\n"),
    "ESYS": (
        "cdb",
        archive(COUNTS, straight, system=11) + PLY
        + "LOCAL,R5.0,LOC, 11, 0, 0.0, 0.0, 0.0\nLOCAL,R5.0,ANG, 11, 30.0, 0.0, 0.0\n",
        TURNED + PLY_INP + ", ORIENTATION=OWN\n",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EQUAL_DECKS)
def test_a_structure_is_the_same_in_every_format(case: str, tmp_path: Path) -> None:
    ending, text, cards = EQUAL_DECKS[case]
    expected = frequencies(bricks(COUNTS, straight) + cards + SUPPORTED["inp"], 4, tmp_path)
    np.testing.assert_allclose(frequencies(text, 4, tmp_path, ending), expected, rtol=1e-6)


def test_elements_that_two_instances_label_alike_keep_their_own_axes(tmp_path: Path) -> None:
    """One part twice, with directions element by element: its modes come twice."""
    cards = ""
    for label, angle in (("1", 0.0), ("2", 40.0)):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        cards += f"{label}, {c:.9f}, {s:.9f}, 0., {-s:.9f}, {c:.9f}, 0.\n"
    base = "*ORIENTATION, NAME=OWN\nD\n*DISTRIBUTION, NAME=D\n, 1., 0., 0., 0., 1., 0.\n" + cards
    part = bricks(SMALL, straight) + base + "*SOLID SECTION, ELSET=ALL, MATERIAL=PLY, ORIENTATION=OWN\n*END PART\n"
    material = PLY_INP[: PLY_INP.index("*SOLID")]
    item, pair = "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", "*INSTANCE, NAME=J, PART=P\n0., 90., 0.\n*END INSTANCE\n"
    rows = [
        frequencies(f"*PART, NAME=P\n{part}*ASSEMBLY\n{of}*END ASSEMBLY\n{material}", count, tmp_path)
        for of, count in ((item, 8), (item + pair, 16))
    ]
    np.testing.assert_allclose(rows[1][12::2], rows[0][6:], rtol=1e-6)
    np.testing.assert_allclose(rows[1][13::2], rows[0][6:], rtol=1e-6)


def ring(x: np.ndarray) -> np.ndarray:
    r, a = 20.0 + 8.0 * x[:, 1], np.pi * x[:, 0]
    return np.stack([r * np.cos(a), r * np.sin(a), 10.0 * x[:, 2]], axis=1)


@pytest.mark.parametrize("ending", ["bdf", "cdb"])
def test_supports_along_axes_of_nodes_turn_with_the_body(ending: str, tmp_path: Path) -> None:
    """A half ring that slides on planes through its axis, as it lies and turned by 30 degrees about z."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    rows = []
    for shape in (ring, lambda x: ring(x) @ turn):
        foot = cut((6, 1, 1), shape)[2]
        if ending == "bdf":
            text = bulk((6, 1, 1), shape, "23", "7") + STEEL_BDF + "CORD2C,7,,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\n"
        else:
            text = archive((6, 1, 1), shape, () if shape is ring else (30.0, 0.0, 0.0), support="UY") + STEEL_CDB
            text += "".join(f"D,{n},UZ,0\n" for n in foot)
        rows.append(frequencies(text, 8, tmp_path, ending))
    assert rows[0][0] < 1e-2 * rows[0][1]  # it can slide along the radius
    np.testing.assert_allclose(rows[1][1:], rows[0][1:], rtol=1e-6)


WARM = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nEVERY, 50.\n"
TABLED = (
    bricks(SMALL, straight)
    + f"*NSET, NSET=EVERY, GENERATE\n1, {END}, 1\n"
    + "*MATERIAL, NAME=S\n*ELASTIC\n200000., .3, 0.\n100000., .2, 200.\n*DENSITY\n8e-9, 0.\n6e-9, 100.\n"
    + "*SOLID SECTION, ELSET=ALL, MATERIAL=S\n*BOUNDARY\nFOOT, 1, 3\n"
)  # fmt: skip


def test_a_table_of_a_material_is_taken_at_the_initial_temperature(tmp_path: Path) -> None:
    by_hand = TABLED.replace("200000., .3, 0.\n100000., .2, 200.", "175000., .275").replace(
        "8e-9, 0.\n6e-9, 100.", "7e-9"
    )
    np.testing.assert_allclose(
        frequencies(TABLED + WARM, 2, tmp_path), frequencies(by_hand, 2, tmp_path), rtol=1e-10
    )  # fmt: skip


@pytest.mark.parametrize("hot", ["", '[loads.static.hot]\ntemperature = "50 K"\n'])
def test_a_table_at_one_temperature_is_noted_where_the_scene_heats(hot: str, tmp_path: Path) -> None:
    (tmp_path / "own.inp").write_text(TABLED.replace("*DENSITY", "*EXPANSION\n1e-5\n*DENSITY") + WARM)
    scene = f'[decks.d]\nfile = "own.inp"\nunit = "mm"\n{hot}[loads.harmonic.shake]\ngroup = "ALL.ALL"\n'
    (tmp_path / "s.toml").write_text(scene + 'direction = "x"\nvalue = 1.0\n[response]\n')
    notes = [note for note in td.inspect(str(tmp_path / "s.toml")).remarks if "initial temperature" in note]
    assert [note.partition(" of material")[0] for note in notes] == (["*ELASTIC and *DENSITY"] if hot else [])


@pytest.mark.parametrize("warm", ["", WARM + "3, 60.\n", WARM.replace("EVERY", "FOOT")])
def test_a_table_is_refused_where_one_temperature_is_not_given_to_all(warm: str, tmp_path: Path) -> None:
    (tmp_path / "own.inp").write_text(TABLED + warm)
    refused = foreign_file.read(tmp_path / "own.inp", "mm").refused
    assert list(refused) == ["*ELASTIC, at several temperatures", "*DENSITY, at several temperatures"]
