"""Conjugate gradients with multigrid: the same model as from a factor, and what cannot be is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from tests.helpers.fits import plain
from tribodyn.fem.factor import factorise
from tribodyn.fem.multigrid import rigid_motions
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError

pytest.importorskip("pyamg")

SMALL = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3",
    "geometry.n_length=6",
    "geometry.n_height=2",
    "reduction.modes=6",
)


def test_a_model_is_that_of_the_direct_solver() -> None:
    models = {}
    for solver in ("direct", "multigrid"):
        models[solver] = plain(scene_file.read("beam", (*SMALL, f"reduction.solver={solver}")))
    direct, other = models["direct"], models["multigrid"]
    assert other.info.factorisation == "conjugate gradients with algebraic multigrid"
    assert other.info.free_frequency == pytest.approx(direct.info.free_frequency, rel=1e-8)
    masters = slice(0, len(direct.info.master_dofs))
    size = np.abs(direct.system.stiffness[masters, masters]).max()
    np.testing.assert_allclose(
        other.system.stiffness[masters, masters], direct.system.stiffness[masters, masters], atol=1e-8 * size
    )
    np.testing.assert_allclose(other.basis[:, masters], direct.basis[:, masters], atol=1e-8)


def test_a_stretched_free_bar_has_its_rigid_motions() -> None:
    points = np.random.default_rng(0).normal(size=(7, 3))
    motions = rigid_motions(points).reshape(7, 3, 6)
    assert np.linalg.matrix_rank(motions.reshape(21, 6)) == 6
    for i in range(7):
        for j in range(i):  # no distance changes
            apart = points[i] - points[j]
            np.testing.assert_allclose(apart @ (motions[i] - motions[j]), 0.0, atol=1e-12)


def test_the_shape_of_right_hand_sides_is_kept() -> None:
    draw = np.random.default_rng(1).normal(size=(30, 30))
    matrix = csr_matrix(draw @ draw.T + 30 * np.eye(30))
    factor = factorise(matrix, solver="multigrid")
    for shape in ((30,), (30, 3)):
        rhs = np.random.default_rng(2).normal(size=shape)
        found = factor.solve(rhs)
        assert found.shape == shape
        np.testing.assert_allclose(matrix @ found, rhs, atol=1e-9)


def test_it_is_refused_where_it_cannot_be() -> None:
    with pytest.raises(SceneError, match=r"reduction\.solver has no meaning for a sector"):
        scene_file.read("blade", ("reduction.solver=multigrid",))
    with pytest.raises(SceneError, match="expected solver"):
        scene_file.read("beam", ("reduction.solver=multigrid", "reduction.relative=true"))
