"""Decks in the style of those that come with CalculiX and Nastran: read as CalculiX solves them, or refused by name."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.small_decks import Shape, archive, bricks, bulk, by_calculix, cut, frequencies, straight
from tribodyn.geometry.sources import foreign_file

N, FINE = (12, 4, 2), (16, 4, 4)


def double(x: np.ndarray) -> np.ndarray:
    return straight(x) * [1, 1, 2]


STEEL = "*MATERIAL, NAME=EL\n*ELASTIC\n 210000.0, .3\n*DENSITY\n7.8E-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=EL\n"
FIX = "*BOUNDARY\nFOOT, 1\nFOOT, 2\nFOOT, 3\n"
TIP = sorted(n for n, x in enumerate(cut(N, straight)[0], 1) if x[0] == 100.0)
END = "*NSET, NSET=TIP\n" + "".join(f"{n},\n" for n in TIP)
BEAM = bricks(N, straight) + END + STEEL
CLAMPED = BEAM + FIX
TIED = "*TIE, NAME=T1, POSITION TOLERANCE=1.\nHIGH, LOW\n"


def fine_at_the_corner(counts: tuple[int, int, int], upper: bool) -> Shape:
    """The lower or the upper block of a lap, whose elements shrink towards the line where clamp and lap meet."""
    path, across = (np.linspace(0, 1, n + 1) for n in (counts[0], counts[2]))

    def shape(x: np.ndarray) -> np.ndarray:
        distant = np.interp(x[:, 2] if upper else 1 - x[:, 2], across, across**2)
        return straight(
            np.stack([np.interp(x[:, 0], path, path**2), x[:, 1], 1 + distant if upper else 1 - distant], axis=1)
        )

    return shape


def lap(counts: tuple[int, int, int], lower: Shape, upper: Shape) -> str:
    """A block clamped at its end and another one upon it, with the surfaces HIGH and LOW where they meet."""
    points, cells, _ = cut(counts, upper)
    top = [e for e, place in enumerate(np.ndindex(*counts), 1) if place[2] == counts[2] - 1]
    bottom = [e + 10000 for e, place in enumerate(np.ndindex(*counts), 1) if place[2] == 0]
    lines = ["*NODE", *(f"{n + 100000}, {x:.9f}, {y:.9f}, {z:.9f}" for n, (x, y, z) in enumerate(points, 1))]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=UPPER")
    for e, cell in enumerate(cells, 1):
        row = [str(n + 100000) for n in cell]
        lines += [f"{e + 10000}, {', '.join(row[:10])},", ", ".join(row[10:])]
    lines += ["*SOLID SECTION, ELSET=UPPER, MATERIAL=EL", "*SURFACE, NAME=LOW", *(f"{e}, S2" for e in top)]
    lines += ["*SURFACE, NAME=HIGH", *(f"{e}, S1" for e in bottom)]
    return bricks(counts, lower) + STEEL + FIX + "\n".join(lines) + "\n"


DEMO = "ID DEMO,ONE\nSOL 103\nCEND\nTITLE = A BAR\nSPC = 1\nMETHOD = 10\nBEGIN BULK\nEIGRL,10,,,4\n"
BULK_STEEL = "PSOLID,1,1\nMAT1,1,210000.,,.3,7.8-9\n"
FOOT = ",".join(map(str, cut(N, straight)[2][:6]))
# name -> (ending, deck, what is refused of it)
DECKS = {
    "cantilever": ("inp", CLAMPED, []),
    "held at both ends": ("inp", CLAMPED + "*BOUNDARY\nTIP, 2, 3\n", []),
    "equation": ("inp", CLAMPED + "".join(f"*EQUATION\n2\n{n}, 1, 1., {TIP[0]}, 1, -1.\n" for n in TIP[1:]), []),
    "spring": ("inp", CLAMPED + f"*ELEMENT, TYPE=SPRING1, ELSET=SP\n900, {TIP[0]}\n*SPRING, ELSET=SP\n2\n800.\n", []),
    "tie": ("inp", lap(FINE, fine_at_the_corner(FINE, False), fine_at_the_corner(FINE, True)) + TIED, []),
    "rigid body": ("inp",
        CLAMPED + "*NODE\n900, 130., 10., 5.\n901, 130., 10., 5.\n*RIGID BODY, NSET=TIP, REF NODE=900, ROT NODE=901\n",
        []),
    "turned supports": ("inp", BEAM + "*TRANSFORM, NSET=FOOT, TYPE=C\n0., 0., 0., 0., 0., 1.\n" + FIX, ["*TRANSFORM"]),
    "shell skin": ("inp",
        CLAMPED + "*ELEMENT, TYPE=S4, ELSET=SKIN\n900, 1, 2, 3, 4\n*SHELL SECTION, ELSET=SKIN, MATERIAL=EL\n1.\n",
        ["S4", "*SHELL SECTION"]),
    "sector": ("inp", CLAMPED + "*CYCLIC SYMMETRY MODEL, N=12, TIE=T1\n0., 0., 0., 1., 0., 0.\n",
        ["*CYCLIC SYMMETRY MODEL"]),
    "heated": ("inp",
        CLAMPED + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nTIP, 20.\n*STEP\n*TEMPERATURE\nTIP, 90.\n*END STEP\n",
        ["*TEMPERATURE"]),
    "normal modes": ("bdf", DEMO + bulk(N, straight) + BULK_STEEL + f"SPC1,1,123,{FOOT}\nSPC1,2,123,{TIP[0]}\n", []),
    "plates on a block": ("bdf",
        DEMO + bulk(N, straight) + BULK_STEEL + "CQUAD4,900,2,1,2,3,4\nPSHELL,2,1,1.\nSPC1,1,123,1,2\n",
        ["CQUAD4", "PSHELL"]),
    "archive": ("cdb", archive(N, straight) + "MP,EX,1,210000.\nMP,PRXY,1,.3\nMP,DENS,1,7.8E-9\nANTYPE,MODAL\n", []),
    "archive with a pressure": ("cdb",
        archive(N, straight) + "MP,EX,1,210000.\nMP,PRXY,1,.3\nMP,DENS,1,7.8E-9\nSFE,1,3,PRES,0,R5.0\n  5.0,\n",
        ["SFE"]),
}  # fmt: skip


@pytest.mark.parametrize("name", DECKS)
def test_a_deck_is_read_or_refused_by_the_names_of_its_cards(name: str, tmp_path: Path) -> None:
    ending, text, refused = DECKS[name]
    (tmp_path / f"own.{ending}").write_text(text)
    assert list(foreign_file.read(tmp_path / f"own.{ending}", "mm").refused) == refused
    if refused:
        with pytest.raises(ValueError, match="not carried over") as raised:
            frequencies(text, 2, tmp_path, ending)
        assert all(f'"{card}"' in str(raised.value) for card in refused)


def test_a_set_of_supports_that_the_case_control_does_not_select_holds_nothing(tmp_path: Path) -> None:
    ending, text, _ = DECKS["normal modes"]
    (tmp_path / f"own.{ending}").write_text(text)
    assert any("set SPC 2" in clause for clause in foreign_file.read(tmp_path / f"own.{ending}", "mm").unused)
    first, *_ = text.rpartition("SPC1,2")
    np.testing.assert_allclose(
        frequencies(text, 2, tmp_path, ending), frequencies(first, 2, tmp_path, ending), rtol=1e-9
    )  # fmt: skip
    with pytest.raises(ValueError, match="selects SPC 7, a set that it has not"):
        frequencies(text.replace("SPC = 1", "SPC = 7"), 2, tmp_path, ending)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize(
    "name", [name for name, (ending, _, refused) in DECKS.items() if ending == "inp" and not refused]
)
def test_what_is_read_has_the_frequencies_of_calculix(name: str, tmp_path: Path) -> None:
    text = DECKS[name][1]
    np.testing.assert_allclose(frequencies(text, 4, tmp_path), by_calculix(text, 4, tmp_path), rtol=5e-3)


def test_a_tie_of_equal_meshes_makes_one_body(tmp_path: Path) -> None:
    item = (12, 4, 4)
    lower = [n for n, x in enumerate(cut(item, double)[0], 1) if x[0] == 0 and x[2] <= 10]
    fixed = "*NSET, NSET=LOWER\n" + "".join(f"{n},\n" for n in lower) + STEEL + FIX.replace("FOOT", "LOWER")
    full = frequencies(bricks(item, double) + fixed, 4, tmp_path)
    distance = lap(N, straight, lambda x: straight(x) + [0, 0, 10]) + TIED
    np.testing.assert_allclose(frequencies(distance, 4, tmp_path), full, rtol=1e-6)


@pytest.mark.parametrize("kind", ["C3D20", "C3D8"])
def test_equations_between_two_faces_make_one_body_of_them_added_nodes_too(kind: str, tmp_path: Path) -> None:
    """Blocks joined node by node, of which the first of each equation is once of one and once of the other body."""
    corners = 20 if kind == "C3D20" else 8
    full, half = (cut((n, 2, 1), straight) for n in (4, 2))

    def block(of: tuple[np.ndarray, list[list[int]], list[int]], name: str, first: int, shift: float) -> str:
        points, cells, _ = of
        used = sorted({n for c in cells for n in c[:corners]})
        rows = [f"{n + first}, {points[n - 1][0] * len(cells) / 8 + shift}, {points[n - 1][1]}, {points[n - 1][2]}"
                for n in used]  # fmt: skip
        elements = [", ".join(str(n + first) for n in c[:10]) + ",\n" + ", ".join(str(n + first) for n in c[10:corners])
                    if corners > 10 else ", ".join(str(n + first) for n in c[:8]) for c in cells]  # fmt: skip
        numbered = [f"{e + first}, {row}" for e, row in enumerate(elements, 1)]
        base = f"*SOLID SECTION, ELSET={name}, MATERIAL=EL"
        return "\n".join(["*NODE", *rows, f"*ELEMENT, TYPE={kind}, ELSET={name}", *numbered, base, ""])

    steel = "*MATERIAL, NAME=EL\n*ELASTIC\n210000., .3\n*DENSITY\n7.8E-9\n"
    foot = [n for n in half[2] if any(n in c[:corners] for c in half[1])]
    support = "*BOUNDARY\n" + "".join(f"{n}, 1, 3\n" for n in foot)
    place = {tuple(x): n for n, x in enumerate(half[0], 1)}
    pairs = [(place[(100.0, *half[0][n - 1][1:])], n + 1000) for n in foot]
    turned = [pair if k % 2 else pair[::-1] for k, pair in enumerate(pairs)]
    joined = "".join(f"*EQUATION\n2\n{n}, {axis}, 1., {m}, {axis}, -1.\n" for n, m in turned for axis in (1, 2, 3))
    second = steel + block(half, "A", 0, 0.0) + block(half, "B", 1000, 50.0) + support + joined
    item = steel + block(full, "A", 0, 0.0) + "*BOUNDARY\n" + "".join(
        f"{n}, 1, 3\n" for n in full[2] if any(n in c[:corners] for c in full[1])
    )  # fmt: skip
    np.testing.assert_allclose(frequencies(second, 6, tmp_path), frequencies(item, 6, tmp_path), rtol=1e-8)
