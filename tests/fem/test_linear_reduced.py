"""Linear hexahedra with reduced integration: rigid motions, the patch test, and a cantilever that they make softer."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import coordinates
from tribodyn.fem.material import Material

REDUCED = Material(E=210e9, nu=0.3, rho=7860.0, linear_reduced=True)


def block() -> skfem.MeshHex2:
    """A block with straight edges and inner nodes that are moved."""
    axes = [np.linspace(0, size, 3) for size in (1.0, 0.7, 0.5)]
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*axes))
    bubble = np.prod(mesh.doflocs * (np.array([[1.0], [0.7], [0.5]]) - mesh.doflocs), axis=0)
    return skfem.MeshHex2(mesh.doflocs + 5 * bubble * np.array([[1.0], [-0.5], [0.7]]), mesh.t)


def test_rigid_motions_cost_nothing_and_the_mass_is_that_of_the_block():
    mesh = block()
    M, K = assemble(mesh, REDUCED)
    x = coordinates(mesh)
    size = abs(K).max() * np.abs(x).max()
    for axis in np.eye(3):
        for motion in (np.broadcast_to(axis, x.shape), np.cross(axis, x)):
            assert np.abs(K @ motion.ravel()).max() < 1e-10 * size
        along = np.broadcast_to(axis, x.shape).ravel()
        assert along @ M @ along == pytest.approx(REDUCED.rho * 0.35, rel=1e-3)
    assert (M != M.T).nnz == (K != K.T).nnz == 0
    assert np.linalg.eigvalsh(K.toarray())[6] > 0  # no hourglass mode is free


def test_a_uniform_strain_has_its_exact_energy():
    mesh = block()
    _, K = assemble(mesh, REDUCED)
    strain = np.random.default_rng(0).normal(size=(3, 3))
    strain += strain.T
    lam, mu = REDUCED.lame
    u = (coordinates(mesh) @ strain).ravel()
    volume = 0.35
    density = 0.5 * lam * np.trace(strain) ** 2 + mu * (strain**2).sum()
    assert 0.5 * u @ K @ u == pytest.approx(volume * density, rel=1e-3)


def test_eight_node_hexahedra_are_those_on_the_nodes_of_a_27_node_mesh():
    """A mesh of first order and one of second order with the same nodes have the same matrices."""
    fine = skfem.MeshHex.init_tensor(*[np.linspace(0, size, 5) for size in (1.0, 0.7, 0.5)])
    coarse = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*[np.linspace(0, s, 3) for s in (1.0, 0.7, 0.5)]))
    order = [int(np.linalg.norm(coordinates(coarse) - x, axis=1).argmin()) for x in coordinates(fine)]
    dofs = (3 * np.array(order)[:, None] + np.arange(3)).ravel()
    for own, other in zip(assemble(fine, REDUCED), assemble(coarse, REDUCED), strict=True):
        assert abs(own - other[dofs][:, dofs]).max() < 1e-10 * abs(own).max()


def test_tetrahedra_are_refused():
    tets = skfem.MeshTet2.from_mesh(skfem.MeshTet())
    with pytest.raises(ValueError, match="needs hexahedra"):
        assemble(tets, REDUCED)
