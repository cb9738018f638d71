"""Elementwise mass and stiffness are the assembled ones, two levels give the model of a factor, and what cannot be is
refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import diags_array
from skfem import MeshHex, MeshHex2, MeshTet, MeshTet2

from tests.helpers.fits import plain
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elementwise import Elementwise, matrices
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.material import Material, Orthotropic
from tribodyn.fem.modes import modes
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError

SMALL = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3",
    "geometry.n_length=6",
    "geometry.n_height=2",
    "reduction.modes=6",
    "reduction.method=residual_flexibility",
)
STEEL = Material(210e9, 0.3, 7860.0)
CRYSTAL = Orthotropic((11e9, 5e9, 9e9), (0.3, 0.2, 0.25), (2e9, 3e9, 4e9), 450.0, ((1, 2, 3), (0, 1, 1)))


def bent(mesh):
    """The mesh with curved edges."""
    x = mesh.doflocs.copy()
    x[0] += 0.05 * x[1] ** 2 + 0.03 * np.sin(3 * x[2])
    return replace(mesh, doflocs=x)


def meshes():
    """A curved mesh of each element: 2 x 2 x 3 hexahedra, and the tetrahedra in them."""
    whole = MeshHex.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 3), np.linspace(0, 1.5, 4))
    return bent(MeshHex2.from_mesh(whole)), bent(MeshTet2.from_mesh(MeshTet.init_tensor(*[np.linspace(0, 1, 3)] * 3)))


@pytest.mark.parametrize("material", [STEEL, CRYSTAL])
@pytest.mark.parametrize("mesh", meshes())
def test_products_are_those_of_assembled_matrices(mesh, material) -> None:
    free = np.flatnonzero(mesh.doflocs[2].repeat(3) > 0)
    more = diags_array(np.linspace(1.0, 2.0, len(free)) * material.rho * 1e6).tocsr()
    x = np.random.default_rng(0).normal(size=(len(free), 3))
    for ours, theirs in zip(matrices(mesh, material), assemble(mesh, material), strict=True):
        one, other = ours.restricted(free) + more, theirs[free][:, free] + more
        size = np.abs(other @ x).max()
        np.testing.assert_allclose(one @ x, other @ x, atol=1e-13 * size)
        np.testing.assert_allclose(one @ x[:, 0], other @ x[:, 0], atol=1e-13 * size)
        np.testing.assert_allclose(one.astype(np.float32) @ x.astype(np.float32), other @ x, atol=2e-6 * size)
        np.testing.assert_allclose(one.diagonal(), other.diagonal(), rtol=1e-12)
    (elements,) = one.elements  # of the stiffness
    rises = np.linspace(1.0, 2.0, elements.nodes.shape[1])
    varied = replace(elements, law=elements.law * rises, weight=elements.weight * rises)
    backwards = {n: np.ascontiguousarray(getattr(varied, n)[..., ::-1]) for n in ("nodes", "weight", "inverse", "law")}
    ways = [Elementwise([own], one.n_node, one.free, one.rest) @ x for own in (varied, replace(varied, **backwards))]
    np.testing.assert_allclose(*ways, atol=1e-13 * np.abs(ways[0]).max())
    by, linear = one.linear()
    np.testing.assert_allclose((linear - by.T @ other @ by).toarray(), 0.0, atol=1e-13 * np.abs(linear).max())


@pytest.mark.parametrize("mesh", meshes())
def test_solutions_and_modes_are_those_of_a_factor(mesh) -> None:
    free = np.flatnonzero(mesh.doflocs[2].repeat(3) > 0)
    (M, K), (M_a, K_a) = (of(mesh, STEEL) for of in (matrices, assemble))
    M, K, M_a, K_a = M.restricted(free), K.restricted(free), M_a[free][:, free], K_a[free][:, free]
    ours, theirs = factorise(K), factorise(K_a)
    for shape in ((len(free),), (len(free), 11)):
        rhs = np.random.default_rng(1).normal(size=shape)
        np.testing.assert_allclose(ours.solve(rhs), theirs.solve(rhs), atol=1e-8 * np.abs(theirs.solve(rhs)).max())
    assert 0 < ours.iterations < 60  # three times eight or fewer columns
    np.testing.assert_array_equal(ours.solve(np.zeros((len(free), 2))), 0.0)
    omega, phi = modes(K, M, 5, factor=ours)
    np.testing.assert_allclose(omega, modes(K_a, M_a, 5)[0], rtol=1e-9)
    np.testing.assert_allclose(phi.T @ (M @ phi), np.eye(5), atol=1e-8)
    with pytest.raises(SingularStiffness):  # nothing holds it
        factorise(matrices(mesh, STEEL)[1])


def test_a_model_is_that_of_the_direct_solver() -> None:
    direct, other = (plain(scene_file.read("beam", (*SMALL, f"reduction.solver={s}"))) for s in ("direct", "multigrid"))
    assert other.info.factorisation.startswith("conjugate gradients with linear elements")
    np.testing.assert_allclose(other.info.free_frequency, direct.info.free_frequency, rtol=1e-8)
    assert direct.residual is not None
    assert other.residual is not None
    force = np.random.default_rng(0).normal(size=(len(direct.residual.stiffness), 2))
    for square in (0.0, (2 * np.pi * 500) ** 2):
        moved = [
            of.apply(force) + of.at_contact @ (of.at_contact.T @ force / (of.squares - square)[:, None])
            for of in (direct.residual, other.residual)
        ]
        np.testing.assert_allclose(moved[1], moved[0], atol=1e-8 * np.abs(moved[0]).max())


def test_it_is_refused_where_it_cannot_be() -> None:
    with pytest.raises(SceneError, match=r"reduction\.solver has no meaning for a sector"):
        scene_file.read("blade", ("reduction.solver=multigrid",))
    for key in ("relative=true", "method=craig_bampton", "interface_modes=3"):
        with pytest.raises(SceneError, match="expected solver"):
            scene_file.read("beam", ("reduction.solver=multigrid", f"reduction.{key}"))
    with pytest.raises(ValueError, match="needs elements of second order"):
        matrices(MeshHex(), STEEL)
