"""A deck as Abaqus writes it, with parts, instances, sets, a tie, a coupling, an equation, loads; and broken ones."""

from pathlib import Path

import numpy as np
import pytest

from tribodyn.geometry.mesh import quality
from tribodyn.geometry.sources import deck, foreign_file
from tribodyn.geometry.sources.abaqus_materials import engineering_constants

LAP = Path(__file__).parent / "decks" / "lap.inp"


@pytest.fixture(scope="module")
def lap():
    return foreign_file.read(LAP, "mm")


def test_instances_are_bodies_in_their_places(lap):
    assert set(lap.bodies) == {"Block-1", "Block-2"}
    first, second = (lap.bodies[name].mesh for name in ("Block-1", "Block-2"))
    for mesh in (first, second):
        assert quality(mesh).volume == pytest.approx(2e-6)
    np.testing.assert_allclose(first.p.max(axis=1), [0.02, 0.01, 0.01])
    np.testing.assert_allclose(second.p.min(axis=1), [-0.01, 0.0, 0.01], atol=1e-12)  # moved up, then turned about z
    np.testing.assert_allclose(second.p.max(axis=1), [0.0, 0.02, 0.02], atol=1e-12)
    assert any("16" not in order_note and "4 hexahedra of first order" in order_note for order_note in lap.order_notes)


def test_sets_and_surfaces_are_where_the_deck_puts_them(lap):
    first, second = lap.bodies["Block-1"], lap.bodies["Block-2"]
    x, _, z = first.mesh.doflocs
    np.testing.assert_array_equal(first.node_sets["Foot"], np.flatnonzero(x == 0))
    np.testing.assert_array_equal(first.node_sets["Block-1.Left"], np.flatnonzero(x == 0))
    np.testing.assert_array_equal(first.node_sets["Upper"], np.flatnonzero(abs(z - 0.01) < 1e-9))
    np.testing.assert_array_equal(first.node_sets["End"], np.flatnonzero(abs(x - 0.02) < 1e-9))
    np.testing.assert_array_equal(second.node_sets["Lower"], np.flatnonzero(abs(second.mesh.doflocs[2] - 0.01) < 1e-9))
    assert set(first.mesh.subdomains) >= {"Block-1", "Block-1.All"}
    assert "Lower" not in first.mesh.boundaries


def test_what_the_deck_says_beside_its_mesh(lap):
    message = lap.deck
    assert message.materials == (
        deck.DeckMaterial("Steel", 210e9, 0.3, pytest.approx(7850.0), 1.2e-5, groups=("Block-1.All", "Block-2.All")),
    )
    assert message.ties == (deck.DeckTie("glue", "Lower", "Upper", 0.5e-3),)
    assert message.couplings == (deck.Coupling("carried", "distributing", "RP", "End"),)
    assert message.equations == (deck.DeckEquation((("node Block-2.11", 0, 1.0), ("node Block-2.12", 0, -1.0))),)
    assert message.forces == (deck.Force("RP", 1, -100.0),)
    assert message.pressures == (deck.FacePressure("Upper", pytest.approx(3e6)),)
    assert message.supports == tuple(deck.Support("Foot", axis) for axis in range(3))
    np.testing.assert_allclose(lap.points["RP"], [0.025, 0.005, 0.005])
    node = lap.bodies["Block-2"].node_sets["node Block-2.11"]
    np.testing.assert_allclose(lap.bodies["Block-2"].mesh.doflocs[:, node[0]], [0.0, 0.02, 0.02], atol=1e-12)
    assert any("*PLASTIC" in clause and "*STATIC" in clause for clause in lap.unused)
    assert "areas of nodes of surface 'Tips', which a contact takes from its faces" in lap.unused


def test_orthotropic_stiffness_becomes_engineering_constants():
    E, nu = 210e9, 0.3
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    result = engineering_constants([lam + 2 * mu, lam, lam + 2 * mu, lam, lam, lam + 2 * mu, mu, mu, mu])
    np.testing.assert_allclose(result, [E, E, E, nu, nu, nu, mu, mu, mu])


BROKEN = {
    "cut inside an element": (", 6, 11, 12, 7\n*Nset, nset=All", "\n*Nset, nset=All", "ends inside element 2"),
    "missing node": ("     12,          20.,          10.,          10.\n", "",
        "names node 12, which the deck has not"),
    "no number": ("10.,          10.,          10.\n      8", "10.,  ten,  10.\n      8",
        "expects a number, got 'ten'"),
    "no whole number": ("\n1, 1, 2, 3, 4", "\n1, 1, two, 3, 4", "expects a whole number, got 'two'"),
    "unknown part": ("part=Block\n          0.", "part=Blok\n          0.", "names the part 'Blok'"),
    "two instances of one name": ("name=Block-2, part", "name=Block-1, part", "name 'Block-1' of another instance"),
    "no instance": ("*Instance", "*Instancy", "needs a *COUPLING|no \\*INSTANCE|parts but no"),
    "unknown surface in a tie": ("Lower, Upper", "Lower, Uper", "names the surface 'Uper'"),
    "half a tie": ("Lower, Upper", "Lower", "needs a slave and a master"),
    "unknown reference": ("ref node=RP", "ref node=RQ", "names 'RQ', which is no node and no set"),
    "reference of many": ("ref node=RP", "ref node=Foot", "needs one reference node, 'Foot' has 4"),
    "kinematic alone": ("*Coupling, constraint name=carried, ref node=RP, surface=End\n", "",
        "needs a \\*COUPLING before"),
    "cut inside an equation": ("Block-2.12, 1, -1.\n", "", "ends before its 2 terms"),
    "unknown material": ("material=Steel", "material=Stahl", "names the material 'Stahl'"),
    "material twice": ("*Material, name=Steel", "*Material, name=Steel\n*Material, name=STEEL",
        "defines the material 'STEEL' again"),
    "elastic alone": ("*Material, name=Steel\n", "", "stands before any \\*MATERIAL"),
    "half a load": ("RP, 2, -100.", "RP, 2", "needs node, direction and value"),
    "unknown set in a support": ("Foot, ENCASTRE", "Fuss, ENCASTRE", "names 'Fuss'"),
    "generated mesh": ("*Nset, nset=Left", "*Ngen\n1, 9, 2\n*Nset, nset=Left", "generates a mesh"),
    "missing include": ("*Part, name=Block", "*Include, input=gone.inp\n*Part, name=Block",
        "'gone.inp', which does not exist"),
    "only shells": ("type=C3D8R", "type=S4", "no volume elements"),
    "data first": ("*Heading\n", "1, 2, 3\n*Heading\n", "data at line 1 before any card"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_decks_are_refused_in_one_sentence(case, tmp_path):
    previous, updated, sentence = BROKEN[case]
    text = LAP.read_text()
    assert previous in text
    broken = tmp_path / "broken.inp"
    broken.write_text(text.replace(previous, updated))
    with pytest.raises(ValueError, match=sentence) as message:
        foreign_file.read(broken, "mm")
    assert "\n" not in str(message.value)
    assert ":" in str(message.value)
