"""The leaf seal's patches, pins and named nodes, flat and bowed."""

import numpy as np
import pytest

from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.geometry import mesh as mesh_file
from tribodyn.workflows.cases.leaf_seal import leaf_seal


def read(tmp_path, **changes):
    leaf_seal.build(leaf_seal.Parameters(**changes), tmp_path / "leaf.msh")
    return mesh_file.read(tmp_path / "leaf.msh")


def patch(mesh, name, **changes):
    return ContactFaces(name, (-1, 0, 0), components=("n",), plane=(0, 0, -1), **changes).build(mesh)


@pytest.mark.parametrize(
    "changes", [{}, {"n_thickness": 2}, {"bow": 3e-4}, {"bow": -3e-4, "n_web": 1, "pin_column": 0}]
)
def test_patches_are_three_arcs_of_21_nodes(tmp_path, changes):
    p = leaf_seal.Parameters(**changes)
    mesh, node_sets = read(tmp_path, **changes)
    volume = p.angle * p.radius * p.height * p.thickness
    assert mesh_file.quality(mesh).volume == pytest.approx(volume, rel=1e-4)  # second-order faces of a cylinder
    for name, low in (("lower_contact", -p.height / 2), ("upper_contact", p.height / 2 - p.patch_height)):
        points = mesh.doflocs[:, node_sets[name]].T
        assert len(points) == 63
        radius = np.hypot(points[:, 0], points[:, 1] + p.radius) - p.radius
        rows = np.unique(np.round(radius, 9))
        np.testing.assert_allclose(rows, low + p.patch_height * np.array([0, 0.5, 1]), atol=1e-4 * p.height)
        interface = patch(mesh, name)
        assert interface.n_pair == 63
        assert interface.area.min() > 0
        exact = p.angle * p.patch_height * (p.radius + low + p.patch_height / 2)
        assert interface.area.sum() == pytest.approx(exact, rel=1e-3)


def test_every_pair_is_one_displacement_even_where_the_leaf_is_bowed(tmp_path):
    for bow in (0.0, 2e-4):
        mesh, node_sets = read(tmp_path, bow=bow)
        B = patch(mesh, "upper_contact").B
        assert (np.diff(B.indptr) == 1).all()
        assert set(B.indices) == set(node_sets["upper_contact"] * 3 + 2)
        np.testing.assert_allclose(B.data, -1.0)


def test_gaps_of_the_flat_inclined_and_bowed_leaf(tmp_path):
    mesh, _ = read(tmp_path)
    p = leaf_seal.Parameters()
    np.testing.assert_allclose(patch(mesh, "upper_contact").gap, 0.0, atol=1e-15)
    for name in ("upper_contact", "lower_contact"):
        outward = patch(mesh, name, inclination=0.01)
        y = outward.points[:, 1]
        np.testing.assert_allclose(outward.gap, np.tan(0.01) * (y - y.min()), atol=1e-15)
        assert abs(outward.points[outward.gap.argmin(), 0]) > 0.9 * outward.points[:, 0].max()  # an end touches
        inward = patch(mesh, name, inclination=-0.01)
        assert abs(inward.points[inward.gap.argmin(), 0]) < 1e-12  # the middle touches
        lifted = patch(mesh, name, inclination=-0.01, gap=1e-5)
        np.testing.assert_allclose(lifted.gap, inward.gap + 1e-5)
    for bow in (2e-4, -2e-4):
        mesh, _ = read(tmp_path, bow=bow)
        i = patch(mesh, "lower_contact")
        theta = np.arctan2(i.points[:, 0], i.points[:, 1] + p.radius)
        height = bow * (1 - (2 * theta / p.angle) ** 2)
        np.testing.assert_allclose(i.gap, height - height.min(), atol=1e-4 * abs(bow))
    with pytest.raises(ValueError, match="inclination"):
        patch(mesh, "lower_contact", inclination=2.0)


def test_pins_and_watched_nodes(tmp_path):
    p = leaf_seal.Parameters(pin_column=3, pin_height=-0.005)
    mesh, node_sets = read(tmp_path, pin_column=3, pin_height=-0.005)
    at = {name: mesh.doflocs[:, nodes].T for name, nodes in node_sets.items() if mesh.boundaries.get(name) is None}
    for side, sign in (("left", -1), ("right", 1)):
        seat, hole = at[f"{side}_pin"], at[f"{side}_hole"]
        assert (len(seat), len(hole)) == (3, 1)
        angle = sign * p.angle / 2 * (1 - 2 * 3 / 20)
        radius = np.sort(np.hypot(seat[:, 0], seat[:, 1] + p.radius) - p.radius)
        np.testing.assert_allclose(radius, p.pin_height + p.pin_width * np.array([-0.5, 0, 0.5]), atol=1e-12)
        np.testing.assert_allclose(np.arctan2(seat[:, 0], seat[:, 1] + p.radius), angle, atol=1e-12)
        np.testing.assert_allclose(seat[:, 2], p.thickness / 2)
        np.testing.assert_allclose(np.hypot(hole[0, 0], hole[0, 1] + p.radius) - p.radius, p.pin_height, atol=1e-12)
    for name in ("upper_centre", "middle", "lower_corner"):
        assert at[name].shape == (1, 3)
        assert at[name][0, 2] == pytest.approx(0.0, abs=1e-15)
    assert node_sets["upper_centre"][0] in node_sets["upper_contact"]
    assert node_sets["lower_corner"][0] in node_sets["lower_contact"]
    assert at["lower_corner"][0, 0] > 0
    assert abs(at["middle"][0, 1]) < p.height / 8


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"angle": 4.0}, "geometry.angle"),
    ({"height": 1.2}, "geometry.height"),
    ({"pin_column": 10}, "geometry.pin_column"),
    ({"pin_height": 0.03}, "geometry.pin_height"),
    ({"pin_height": float("nan")}, "geometry.pin_height"),
    ({"bow": float("inf")}, "geometry.bow"),
    ({"n_row": 4}, "geometry.n_row"),
    ({"thickness": 0.0}, "geometry.thickness"),
])  # fmt: skip
def test_bad_dimensions_are_refused_in_one_sentence(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        leaf_seal.Parameters(**changes)
