"""Linear hexahedra with reduced integration: rigid motions, the patch test, and a cantilever that they make softer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import coordinates
from tribodyn.fem.load_vectors import Heating
from tribodyn.fem.material import Material
from tribodyn.fem.prestress import geometric_stiffness

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
        path = np.broadcast_to(axis, x.shape).ravel()
        assert path @ M @ path == pytest.approx(REDUCED.rho * 0.35, rel=1e-3)
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
    for base, other in zip(assemble(fine, REDUCED), assemble(coarse, REDUCED), strict=True):
        assert abs(base - other[dofs][:, dofs]).max() < 1e-10 * abs(base).max()


def test_an_hourglass_strain_bears_no_stress_and_a_field_of_temperature_acts_by_the_mean_gradient():
    heated = replace(REDUCED, expansion=12e-6)
    cube = skfem.MeshHex()
    x = coordinates(cube)
    hourglass = np.outer(np.prod(1 - 2 * x[:, 1:], axis=1), (1.0, 0.0, 0.0))  # its mean gradient is zero
    stretch = 1e-3 * x * [1.0, 0.0, 0.0]
    single, two_results = (geometric_stiffness(cube, REDUCED, u) for u in (stretch, stretch + hourglass))
    assert abs(two_results - single).max() < 1e-10 * abs(single).max()
    lam, mu = REDUCED.lame
    turned = (x - 0.5)[:, [0]] * [0.0, 1.0, 0.0]  # sigma_xx stiffens a rotation: its slope along x is 1 everywhere
    assert turned.ravel() @ single @ turned.ravel() == pytest.approx(1e-3 * (lam + 2 * mu), rel=1e-9)
    warm = 1.0 + np.arange(8.0)
    force = Heating(heated, values=warm).vector(cube, {}).reshape(-1, 3)
    fixed = (3 * lam + 2 * mu) * 12e-6 * warm.mean()
    assert force == pytest.approx(np.where(x > 0.5, 1, -1) * fixed / 4, rel=1e-9)


def test_tetrahedra_are_refused():
    tets = skfem.MeshTet2.from_mesh(skfem.MeshTet())
    with pytest.raises(ValueError, match="needs hexahedra"):
        assemble(tets, REDUCED)
