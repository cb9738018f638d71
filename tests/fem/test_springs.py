"""Directional springs: resultants, tilting stiffness, rigid motion across a joint, and bad input."""

import numpy as np
import pytest
from skfem import MeshHex, MeshHex2, MeshTet, MeshTet2

from tribodyn.fem.elements import coordinates
from tribodyn.fem.springs import Spring

SIDE = 0.1


@pytest.fixture(scope="module")
def cubes():
    """Two cubes side by side that share no nodes: faces "left" and "right" coincide at x = 0.1 m."""
    item = MeshHex.init_tensor(np.linspace(0, SIDE, 3), np.array([0.0, 0.03, 0.1]), np.linspace(0, SIDE, 2))
    p = np.hstack([item.p, item.p + [[SIDE], [0.0], [0.0]]])
    t = np.hstack([item.t, item.t + item.p.shape[1]])
    mesh = MeshHex2.from_mesh(MeshHex(p, t, sort_t=False))
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    inside_first = mesh.f2t[0] < item.t.shape[1]
    outer = mesh.f2t[1] < 0
    at_joint = np.isclose(middle[0], SIDE) & outer
    boundaries = {
        "right": np.flatnonzero(at_joint & inside_first),
        "left": np.flatnonzero(at_joint & ~inside_first),
        "far": np.flatnonzero(np.isclose(middle[0], 2 * SIDE) & outer),
    }
    mesh = mesh.with_boundaries(boundaries)
    sets = {name: np.unique(mesh.dofs.get_facet_dofs(facets).flatten()) for name, facets in boundaries.items()}
    sets["pair"] = np.array([0, 5])
    return mesh, sets


def translation(mesh, axis):
    u = np.zeros((mesh.doflocs.shape[1], 3))
    u[:, axis] = 1.0
    return u.ravel()


def test_ground_spring_has_its_resultant_and_direction(cubes):
    mesh, sets = cubes
    K = Spring("far", (0, 3.0, 4.0), 5e6).matrix(mesh, sets)
    assert abs(K - K.T).max() < 1e-9
    for axis, cosine in enumerate((0.0, 0.6, 0.8)):
        u = translation(mesh, axis)
        assert u @ K @ u == pytest.approx(5e6 * cosine**2)
    x = coordinates(mesh)
    shifted = np.zeros(len(x), bool)
    shifted[np.unique(K.indices) // 3] = True
    np.testing.assert_allclose(x[shifted, 0], 2 * SIDE)


def test_face_resists_tilting_as_a_uniform_bedding(cubes):
    """Rotational stiffness k side^2 / 12 of a square face, exact however the face is divided."""
    mesh = MeshTet2.from_mesh(MeshTet.init_tensor(np.linspace(0, SIDE, 2), np.linspace(0, SIDE, 3), [0.0, 0.02]))
    far = np.flatnonzero(np.isclose(mesh.p[0][mesh.facets].min(axis=0), SIDE))
    mesh = mesh.with_boundaries({"far": far})
    for of, sets in (cubes, (mesh, {"far": np.unique(mesh.dofs.get_facet_dofs(far).flatten())})):
        K = Spring("far", (1, 0, 0), 7e6).matrix(of, sets)
        x = coordinates(of)
        u = np.zeros_like(x)
        u[:, 0] = x[:, 1] - SIDE / 2  # turned by one radian about z
        assert u.ravel() @ K @ u.ravel() == pytest.approx(7e6 * SIDE**2 / 12)
        along = translation(of, 0)
        assert along @ K @ along == pytest.approx(7e6)


def test_joint_feels_only_relative_motion(cubes):
    mesh, sets = cubes
    K = Spring("right", (1, 0, 0), 3e6, "left").matrix(mesh, sets)
    u = translation(mesh, 0)
    assert abs(K @ u).max() < 1e-6
    second = np.repeat(coordinates(mesh)[:, 0] > SIDE * 1.001, 3)
    second[np.repeat(np.isin(np.arange(mesh.doflocs.shape[1]), sets["left"]), 3)] = True
    half = np.where(second, u, 0.0)
    assert half @ K @ half == pytest.approx(3e6)


def test_node_set_shares_evenly(cubes):
    mesh, sets = cubes
    K = Spring("pair", (0, 0, 1), 8.0).matrix(mesh, sets)
    np.testing.assert_allclose(K.diagonal()[sets["pair"] * 3 + 2], 4.0)
    assert K.nnz == 2


def test_bad_springs_are_refused_in_one_sentence(cubes):
    mesh, sets = cubes
    for stiffness in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="must be finite and >= 0"):
            Spring("far", (1, 0, 0), stiffness)
    with pytest.raises(ValueError, match="has no node set 'near'"):
        Spring("near", (1, 0, 0), 1.0).matrix(mesh, sets)
    with pytest.raises(ValueError, match="15 of 15 nodes of the first have no partner"):
        Spring("right", (1, 0, 0), 1.0, "far").matrix(mesh, sets)
    with pytest.raises(ValueError, match="direction of the spring at 'far'"):
        Spring("far", (0, 0, 0), 1.0).matrix(mesh, sets)
