"""A deck of another FE program brought whole, against the same structure said by hand; what is not used is named."""

from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.lap_deck import OWN, REST, TEXT
from tests.helpers.pages import ROOT, fences
from tribodyn.fem.factor import factorise
from tribodyn.fem.modes import modes
from tribodyn.fem.part import Part
from tribodyn.workflows.pictures import view
from tribodyn.workflows.run import modelling, planning, scene_assembly
from tribodyn.workflows.run.pipeline import part_mesh
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import convergence

DECK = OWN + 'elements = "quadratic"\n'
BY_HAND = """
[materials.Steel]
young = "210 GPa"
poisson = 0.3
density = "7850 kg/m3"
expansion = "12e-6 1/K"
[bodies.Block-1]
mesh = "lap.inp"
volume = "Block-1"
unit = "mm"
material = "Steel"
fixed = ["Foot"]
[bodies.Block-2]
mesh = "lap.inp"
volume = "Block-2"
unit = "mm"
material = "Steel"
[ties.glue]
first = "Block-2.Lower"
second = "Block-1.Upper"
reach = "0.5 mm"
[couplings.RP]
face = "Block-1.End"
point = ["25 mm", "5 mm", "5 mm"]
[loads.static.cload]
group = "RP"
direction = "y"
value = "-100 N"
[loads.static.press]
group = "Block-1.Upper"
pressure = "3 MPa"
"""


def part(text: str, folder: Path, deck: str = TEXT) -> Part:
    (folder / "lap.inp").write_text(deck)
    file = scene_file.parse(text + REST, "scene.toml", (), folder)
    mesh, node_sets = modelling.make_mesh(file, folder)
    return modelling.make_part(file.mesh_scene, mesh, node_sets, folder)


def test_a_deck_is_the_structure_that_the_same_tables_by_hand_make(tmp_path: Path) -> None:
    reference = '["ties", "couplings", "supports", "forces", "pressures"]'
    brought, message = (part(text, tmp_path) for text in (DECK + f"use = {reference}\n", BY_HAND))
    omega = [modes(of.system.stiffness, of.system.mass, 6)[0] for of in (brought, message)]
    np.testing.assert_allclose(*omega, rtol=1e-9)
    by_hand = message.system.loads["cload"] * -100.0 + message.system.loads["press"] * 3e6
    np.testing.assert_allclose(brought.system.loads["decks.lap"], by_hand, atol=1e-9 * np.abs(by_hand).max())


def test_hexahedra_of_first_order_may_stay_what_they_are(tmp_path: Path) -> None:
    """An eighth of the nodes, softer than second order, and towards it as the elements are halved."""
    requested = OWN + 'use = ["ties", "supports"]\n'
    best = part(requested + 'halved = 1\nelements = "quadratic"\n', tmp_path)
    rows = []
    for halved in (1, 2):
        reduced = part(f"{requested}halved = {halved}\n", tmp_path)  # as the deck has them: C3D8R
        rows.append(modes(reduced.system.stiffness, reduced.system.mass, 3)[0])
        assert len(reduced.points) < len(best.points) * (1, 8)[halved - 1] / 3
    exact = modes(best.system.stiffness, best.system.mass, 3)[0]
    errors = [np.abs(omega / exact - 1).max() for omega in rows]
    assert errors[1] < errors[0] / 2
    assert errors[1] < 0.1
    drawn = part_mesh(reduced)
    assert drawn.kind == "hexahedron"
    assert view.grid_of(drawn).volume == pytest.approx(4e-6, rel=1e-9)
    file = scene_file.parse(requested + REST, "scene.toml", (), tmp_path)
    notes = [note for deck in scene_assembly.carried_decks(file.scene, tmp_path).values() for note in deck.notes]
    assert any("(linear_reduced): 24 nodes" in note for note in notes)


def test_an_equation_of_a_deck_holds(tmp_path: Path) -> None:
    of = part(DECK, tmp_path)
    u = of.field(factorise(of.system.stiffness).solve(of.system.loads["decks.lap"]))
    item, other = (int(of.node_sets[f"Block-2.node Block-2.{n}"][0]) for n in (11, 12))
    assert abs(u[item, 0]) > 1e-9
    assert u[item, 0] == pytest.approx(u[other, 0], rel=1e-12)
    assert u[item, 1] != pytest.approx(u[other, 1], rel=1e-3)


def test_what_is_not_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "lap.inp").write_text(TEXT)
    file = scene_file.parse(DECK + 'use = ["supports"]\n' + REST, "scene.toml", (), tmp_path)
    notes = [note for deck in scene_assembly.carried_decks(file.scene, tmp_path).values() for note in deck.notes]
    text = "; ".join(notes)
    for clause in ("*PLASTIC", "1 of its ties that use leaves", "1 of its pressures that", "points RP, which carry"):
        assert clause in text, clause


@pytest.mark.parametrize(("change", "sentence"), [
    (("*Density\n 7.85e-09,\n", ""), "has no density: give .materials.Steel. in the scene"),
    (("*Solid Section, elset=All, material=Steel\n,\n", ""), 'with decks.lap.material = "name"'),
    (("ref node=RP", "ref node=Block-1.9"), "its reference node belongs to the mesh"),
    (("Lower, Upper", "Tips, Upper"), "is a set of nodes that make no face|is no node and no set|has not"),
    (("Foot, ENCASTRE", "Foot, ENCASTRE\nBlock-2.All, ENCASTRE"), "moves nodes that are clamped"),
])  # fmt: skip
def test_what_cannot_be_carried_over_is_one_sentence(tmp_path: Path, change: tuple[str, str], sentence: str) -> None:
    assert change[0] in TEXT
    with pytest.raises(ValueError, match=sentence) as raised:
        part(DECK, tmp_path, TEXT.replace(*change))
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith("decks.lap") or "of deck lap" in str(raised.value)


PICKED = """
[materials.steel]
young = "210 GPa"
poisson = 0.3
density = "7850 kg/m3"
[bodies.Block-2]
part = "block"
length = "40 mm"
width = "20 mm"
height = "10 mm"
n_length = 4
n_width = 2
material = "steel"
fixed = ["left"]
translation = ["5 mm", "0 mm", "0 mm"]
[bodies.Block-2.faces.left]
normal = "-x"
[bodies.Block-2.faces.patch]
normal = "z"
box = [["10 mm", "0 mm", "0 mm"], ["30 mm", "20 mm", "10 mm"]]
[bodies.Block-2.faces.end]
nearest = ["41 mm", "9 mm", "4 mm"]
"""


def test_faces_are_picked_by_rule_where_the_body_is_made(tmp_path: Path) -> None:
    of = part(PICKED, tmp_path)
    x, _, z = of.mesh.doflocs
    np.testing.assert_array_equal(of.node_sets["Block-2.left"], np.flatnonzero(abs(x - 5e-3) < 1e-9))
    np.testing.assert_array_equal(of.node_sets["Block-2.end"], np.flatnonzero(abs(x - 45e-3) < 1e-9))
    inside = (abs(z - 10e-3) < 1e-9) & (x > 15e-3 - 1e-9) & (x < 35e-3 + 1e-9)
    np.testing.assert_array_equal(of.node_sets["Block-2.patch"], np.flatnonzero(inside))
    with pytest.raises(ValueError, match=r"bodies.Block-2: faces.left: .* satisfies all its rules together"):
        part(PICKED.replace('normal = "-x"', 'normal = "-x"\nbox = [[0, 0, 0], ["40 mm", "20 mm", 0]]'), tmp_path)


def of_page(folder: Path, *changes: tuple[str, str]) -> Path:
    """The deck and the scene of the page on decks, the deck changed; where the scene lies."""
    for fence in fences(ROOT / "docs/howto/deck.md"):
        text = fence.text
        if fence.word == "lap.inp":
            for previous, updated in changes:
                assert previous in text
                text = text.replace(previous, updated)
        if fence.word in ("lap.inp", "joint.toml"):
            (folder / fence.word).write_text(text)
    return folder / "joint.toml"


COARSE = ("harmonics.kept=[0, 1]", "verdict.enabled=false", "response.points=5")
GRIDS = """
[ladders.mesh]
sizes = [1, 2, 4]
set = [["decks.lap.halved=0"], ["decks.lap.halved=1"], ["decks.lap.halved=2"]]
worn_up_to = 1
"""


def test_a_convergence_keeps_the_peaks_of_grids_whose_wear_has_no_end(tmp_path: Path) -> None:
    scene = of_page(tmp_path)
    (tmp_path / "joint.study.toml").write_text(GRIDS)
    result = convergence.converge(scene, settings=["mesh"], overrides=COARSE)
    (item,) = result.table.ladders
    measured = [row.solved for row in item.rows]
    assert [m.outcome for m in measured] == ["stopped after 1 wear steps", "converged", "converged"]
    assert [m.pairs for m in measured] == [11, 35, 117]
    assert item.limits["amplitude"].value == pytest.approx(measured[-1].values["amplitude"], rel=2e-3)
    assert any(line.startswith("1% on amplitude needs halved=2") for line in result.lines())
    assert [path.name for path in result.write(tmp_path)] == ["converge_joint.png"]


def test_a_body_that_tips_over_has_no_state_of_rest(tmp_path: Path) -> None:
    scene = of_page(tmp_path, ("5., 0., 10.", "15., 0., 10."))  # 5 of its 20 mm lie on the lower one
    with pytest.raises(RuntimeError, match=r"no state of rest was found under the static loads alone: .* may tip"):
        td.run(str(scene), tmp_path / "out", overrides=(*COARSE, "wear="))


GLUED = "*Tie, name=glue, position tolerance=5.\n Sole, Top\n*End Assembly"


def test_a_plan_tells_faces_that_lie_apart(tmp_path: Path) -> None:
    assert planning.plan(scene_file.read(of_page(tmp_path))).remarks == ()
    lifted = ("5., 0., 10.", "5., 0., 12.")
    (contact,) = planning.plan(scene_file.read(of_page(tmp_path, lifted))).remarks
    assert contact == "the faces of contacts.joint lie up to 2 mm apart: correct their places"
    plan = planning.plan(scene_file.read(of_page(tmp_path, lifted, ("*End Assembly", GLUED))))
    tie = "the faces of tie 'glue' of deck lap lie up to 2 mm apart: correct their places"
    assert plan.remarks == (contact, tie)
    assert ("warning", tie) in plan.lines()
    refused = GLUED.replace(", position tolerance=5.", "")
    with pytest.raises(ValueError, match="2 mm apart on average"):
        planning.plan(scene_file.read(of_page(tmp_path, lifted, ("*End Assembly", refused))))
