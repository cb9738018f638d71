"""The blade: its faces match after a turn by one pitch, its contact has the thesis's size and grid."""

import numpy as np
import pytest

from tribodyn.fem.surface import surface
from tribodyn.geometry import mesh as mesh_file
from tribodyn.workflows.cases.blade import blade


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T


def read(tmp_path, **changes):
    blade.build(blade.Parameters(**changes), tmp_path / "blade.msh")
    return mesh_file.read(tmp_path / "blade.msh")


@pytest.fixture(scope="module")
def sector(tmp_path_factory):
    return read(tmp_path_factory.mktemp("blade"))


def test_contact_face_is_plane_and_as_published(sector):
    mesh, _ = sector
    for name in ("shroud_right", "shroud_left"):
        face = surface(mesh, mesh.boundaries[name], vertices_only=True)
        assert len(face.nodes) == 20
        assert face.area.sum() == pytest.approx(20e-3 * 30e-3, rel=1e-9)
        assert (face.area > 0).all()
        assert np.ptp(face.normals, axis=0).max() < 1e-9


@pytest.mark.parametrize(("chord", "up"), [(5, 4), (7, 3)])
def test_left_face_is_the_right_one_turned(tmp_path, chord, up):
    mesh, nodes = read(tmp_path, n_along=chord, n_up=up, n_span=4)
    points = mesh.doflocs.T
    right, remaining = points[nodes["shroud_right"]], points[nodes["shroud_left"]]
    assert len(right) == (2 * chord - 1) * (2 * up - 1)
    assert len(surface(mesh, mesh.boundaries["shroud_right"], vertices_only=True).nodes) == chord * up
    refined = turned(right, 2 * np.pi / 40)
    assert np.linalg.norm(refined[:, None] - remaining, axis=2).min(axis=1).max() < 1e-12


def test_disk_sector_has_matching_cyclic_faces_and_touches_no_neighbour(tmp_path):
    mesh, nodes = read(tmp_path, disk_radius=0.12)
    points = mesh.doflocs.T
    right, remaining = points[nodes["cyclic_right"]], points[nodes["cyclic_left"]]
    refined = turned(right, 2 * np.pi / 40)
    assert np.linalg.norm(refined[:, None] - remaining, axis=2).min(axis=1).max() < 1e-12
    angle = np.arctan2(-points[:, 1], points[:, 2])
    disk = np.zeros(len(points), bool)
    disk[nodes["disk"]] = True
    root = np.setdiff1d(nodes["root"], nodes["disk"])
    assert np.abs(angle[root]).max() < 0.95 * np.pi / 40
    assert np.abs(angle[disk]).max() == pytest.approx(np.pi / 40)


def test_shroud_opens_beside_the_contact_face(sector):
    """Neighbouring shrouds meet at the contact face alone: elsewhere the edges part."""
    p = blade.Parameters()
    shroud = blade.shroud_of(p).corners
    gap = turned(shroud[:, :, 3], p.pitch) - shroud[:, :, 0]
    distance = np.linalg.norm(gap, axis=-1)
    assert np.abs(distance[:, 1:3]).max() < 1e-12
    assert (distance[:, [0, 3]] > 1.9 * p.clearance).all()


@pytest.mark.parametrize(("change", "sentence"), [
    ({"shroud_length": 0.02}, r"geometry.shroud_length is 0.02: give more than 0.02459 m"),
    ({"disk_radius": 0.24}, r"geometry.disk_radius is 0.24: give 0 for no disk, or a radius below 0.22 m"),
    ({"root_fill": 1.2}, r"geometry.root_fill is 1.2: give a number from 0.1 to 0.99"),
    ({"n_up": 1}, r"geometry.n_up is 1: give a whole number of at least 2"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        blade.Parameters(**change)


def test_root_block_shorter_than_the_airfoil_is_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"geometry.root_length is 0.05: it must be longer than the airfoil"):
        blade.build(blade.Parameters(root_length=0.05), tmp_path / "no.msh")
