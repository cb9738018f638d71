"""The rig's contact grid, matching faces, named points, and the beam's open frequency."""

import numpy as np
import pytest

from tribodyn.fem import part as fem_part
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.load_vectors import NodalForce
from tribodyn.fem.material import Material
from tribodyn.fem.surface import surface
from tribodyn.geometry import mesh as mesh_file
from tribodyn.reduction.linear import linear_modes
from tribodyn.workflows.cases.rig import rig


def read(tmp_path, **changes):
    rig.build(rig.Parameters(**changes), tmp_path / "rig.msh")
    return mesh_file.read(tmp_path / "rig.msh")


def test_contact_has_the_grid_of_the_thesis(tmp_path):
    mesh, node_sets = read(tmp_path)
    assert mesh.doflocs.shape[1] * 3 < 40_000
    face = surface(mesh, mesh.boundaries["upper_contact"])
    assert len(face.nodes) == 55
    assert face.area.sum() == pytest.approx(10e-6)
    assert [len(np.unique(np.round(face.points[:, axis], 9))) for axis in (0, 1)] == [5, 11]
    np.testing.assert_allclose(np.ptp(face.points, axis=0), [0.002, 0.005, 0.0], atol=1e-12)
    np.testing.assert_allclose(face.normals, np.tile([0.0, 0.0, -1.0], (55, 1)), atol=1e-12)
    lower = mesh.doflocs[:, node_sets["lower_contact"]].T
    distance = np.abs(lower[:, None] - face.points[None]).max(axis=2).min(axis=0)
    assert distance.max() < 1e-12
    assert np.ptp(lower, axis=0).min() == 0.0  # flat, and larger than the upper face
    assert (np.ptp(lower, axis=0)[:2] > np.ptp(face.points, axis=0)[:2]).all()


def test_joint_faces_match_but_share_no_nodes(tmp_path):
    mesh, node_sets = read(tmp_path)
    seat, root = (mesh.doflocs[:, node_sets[name]] for name in ("column_seat", "beam_root"))
    assert not set(node_sets["column_seat"]) & set(node_sets["beam_root"])
    np.testing.assert_allclose(seat[:, np.lexsort(seat)], root[:, np.lexsort(root)], atol=1e-12)


@pytest.mark.parametrize("changes", [
    {},
    {"n_contact_length": 3, "n_contact_width": 5, "longest": 0.1, "n_root": 1, "n_half": 1},
    {"free_length": 0.25},
])  # fmt: skip
def test_named_points_stand_where_they_should(tmp_path, changes):
    p = rig.Parameters(**changes)
    mesh, node_sets = read(tmp_path, **changes)
    side, middle = -p.thickness / 2, p.height / 2
    at = {"shaker": (p.shaker_distance, side, middle), "accelerometer": (p.free_length, side, p.height)}
    at |= {f"middle{k}": (p.solid_length * k / 4, side, middle) for k in (1, 2, 3, 4)}
    for name, where in at.items():
        np.testing.assert_allclose(mesh.doflocs[:, node_sets[name]].T, [where], atol=1e-12)
    assert len(node_sets["screws"]) == 6
    assert len(node_sets["pins"]) == 2
    lower = mesh.doflocs[2, node_sets["platform"]].min()
    np.testing.assert_allclose(mesh.doflocs[2, node_sets["screws"]], lower)
    np.testing.assert_allclose(mesh.doflocs[:2, node_sets["screws"]].mean(axis=1), [p.contact_x, 0.0], atol=1e-12)


def test_clamped_beam_has_the_frequency_of_a_cantilever(tmp_path):
    """The rigidly held beam is Euler and Bernoulli's with the mass that the slot takes from its tip."""
    mesh, node_sets = read(tmp_path)
    E, rho, p = 193e9, 8000.0, rig.Parameters()
    part = fem_part.build(
        mesh, node_sets, Material(E, 0.29, rho), [Clamp("column"), Clamp("beam_root"), Clamp("platform")],
        [ContactFaces("upper_contact", (0, 1, 0), "lower_contact")], {"shaker": NodalForce("shaker", (0, 1, 0))}, {},
    )  # fmt: skip
    result = linear_modes(part, None, 1)[0][0]
    full = 3.516 / (2 * np.pi) * np.sqrt(E / rho / 12) * p.thickness / p.free_length**2
    missing = p.slot_length * p.slot_height * 0.9  # less the upper specimen
    at = 1.8751 * (1 - 0.5 * p.slot_length / p.free_length)  # the mode there: squares integrate to one over the length
    shape = np.cosh(at) - np.cos(at) - 0.7341 * (np.sinh(at) - np.sin(at))
    removed = missing * shape**2 / (p.free_length * p.height)  # of the modal mass, whose unit is the beam's mass
    assert result == pytest.approx(full / np.sqrt(1 - removed), rel=0.03)


def test_impossible_shapes_are_refused_in_one_sentence():
    for changes, message in (
        ({"contact_length": 0.011}, "contact_length is 0.011: keep it within the shank"),
        ({"contact_width": 0.012}, "keep it within geometry.thickness"),
        ({"foot": 0.008}, "nine tenths of geometry.protrusion"),
        ({"shaker_distance": 0.28}, "the free length without the slot less 10 mm"),
        ({"slot_length": 0.02}, "the lower specimen needs 0.02 m"),
        ({"slot_height": 0.03}, "keep it above half of geometry.height"),
        ({"slot_height": 0.058}, "geometry.height less 5 mm"),
        ({"protrusion": 0.038}, "geometry.slot_height less 1 mm"),
        ({"root_length": 0.1}, "keep it below column_length"),
        ({"free_length": 1e6}, "takes more than 2000 such elements; give at least 500 m"),
        ({"n_contact_width": 10}, "give an odd number of nodes"),
    ):
        with pytest.raises(ValueError, match=message) as caught:
            rig.Parameters(**changes)
        assert "\n" not in str(caught.value)
