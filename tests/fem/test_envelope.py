"""What a kinematic envelope leaves free: directional springs and held rotations of a leaf."""

from types import SimpleNamespace

import numpy as np
import pytest

from tribodyn.fem import part as fem_part
from tribodyn.fem.constraints import Clamp, NoMeanRotation
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.material import Material
from tribodyn.fem.springs import Spring
from tribodyn.geometry import mesh as mesh_file
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.prescribed import hold
from tribodyn.workflows.cases.leaf_seal import leaf_seal

STEEL = Material(210e9, 0.3, 7860.0)
PARAMETERS = leaf_seal.Parameters(n_column=9, n_web=1, pin_column=1)
IN_PLANE = [Clamp("left_hole", "xy"), Clamp("right_hole", "y")]
PATCHES = ("upper_contact", "lower_contact")
CONTACTS = [ContactFaces(name, (-1, 0, 0), components=("n",), plane=(0, 0, -1)) for name in PATCHES]
NO_TURN = [NoMeanRotation((0, 1, 0))]


@pytest.fixture(scope="module")
def leaf(tmp_path_factory):
    path = tmp_path_factory.mktemp("leaf") / "leaf.msh"
    leaf_seal.build(PARAMETERS, path)
    return SimpleNamespace(**dict(zip(("mesh", "node_sets"), mesh_file.read(path), strict=True)))


def part(leaf, springs=()):
    fixed = {"springs": springs, "held_motions": NO_TURN}
    return fem_part.build(leaf.mesh, leaf.node_sets, STEEL, IN_PLANE, CONTACTS, {}, {}, **fixed)


def test_held_rotation_leaves_two_rigid_modes_and_every_elastic_one(leaf):
    built = part(leaf)
    full, _ = linear_modes(built, n=12)
    assert (full[:3] < 1e-3 * full[3]).all()  # lift, pitch and turn about the radial axis
    reduced = craig_bampton(built.system, built.interface, n_modes=20)
    envelope, shapes = linear_modes(hold(reduced, built.held_rows), n=10)
    assert (envelope[:2] < 1e-3 * envelope[2]).all()
    np.testing.assert_allclose(envelope[2:8], full[3:9], rtol=2e-3)
    np.testing.assert_allclose(built.held_rows @ hold(reduced, built.held_rows).origin.basis @ shapes, 0.0, atol=1e-9)
    free, _ = linear_modes(reduced, n=11)
    np.testing.assert_allclose(envelope[2:], free[3:], rtol=1e-9)  # exactly those without the turn


def test_held_rows_are_the_rotation_about_the_centre_of_mass(leaf):
    built = part(leaf)
    unit = np.zeros((len(built.points), 3))
    x, z = built.points[:, 0], built.points[:, 2] - PARAMETERS.thickness / 2
    unit[:, 0], unit[:, 2] = z, -x
    turn = unit.ravel()[built.free]
    np.testing.assert_allclose(built.held_rows[0], built.system.mass @ turn, atol=1e-9 * np.abs(built.held_rows).max())
    inertia = turn @ built.system.mass @ turn
    assert built.held_rows[0] @ turn == pytest.approx(inertia)
    lift = np.tile([0.0, 0, 1], len(x))[built.free]
    assert built.held_rows[0] @ lift == pytest.approx(0.0, abs=1e-9 * np.sqrt(inertia))


def test_springs_hold_a_rigid_leaf_as_a_mass_on_springs(leaf):
    k = 100.0  # soft enough that the leaf stays rigid
    springs = [Spring(f"{side}_pin", (0, 0, 1), k) for side in ("left", "right")]
    built = part(leaf, springs)
    frequency, _ = linear_modes(hold(craig_bampton(built.system, built.interface, n_modes=5), built.held_rows))
    lift, pitch = np.zeros((2, len(built.points), 3))
    pins = np.concatenate([leaf.node_sets[name] for name in ("left_pin", "right_pin")])
    y = built.points[:, 1] - built.points[pins, 1].mean()
    lift[:, 2] = 1.0
    pitch[:, 2], pitch[:, 1] = y, PARAMETERS.thickness / 2 - built.points[:, 2]
    rigid = np.stack([lift.ravel()[built.free], pitch.ravel()[built.free]], axis=1)
    K = np.diag([2 * k, 2 * k * np.mean(y[pins] ** 2)])  # turning about the pins meets the width of their seats alone
    exact = np.linalg.eigvals(np.linalg.solve(rigid.T @ built.system.mass @ rigid, K)).real
    np.testing.assert_allclose(frequency[:2], np.sqrt(np.sort(exact)) / (2 * np.pi), rtol=1e-3)
    assert frequency[0] < 0.1 * frequency[1]


def test_envelope_errors_name_the_cure():
    with pytest.raises(ValueError, match="exclude each other"):
        ContactFaces("a", (1, 0, 0), opposite="b", plane=(0, 0, 1))
    with pytest.raises(ValueError, match="give its plane"):
        ContactFaces("a", (1, 0, 0), inclination=0.1)
    with pytest.raises(ValueError, match="not all zero"):
        NoMeanRotation((0, 0, 0)).row(np.zeros((1, 3)), np.eye(3))
