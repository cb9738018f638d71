"""Linear hexahedra with reduced integration: rigid motions, the patch test, and a cantilever that they make softer."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.assembly import Body
from tribodyn.fem.elasticity import FORMULATIONS, assemble
from tribodyn.fem.elements import coordinates
from tribodyn.fem.load_vectors import Heating
from tribodyn.fem.material import Material, Orthotropic
from tribodyn.fem.prestress import geometric_stiffness
from tribodyn.workflows.run.sanity_checks import check_thickness

SOFT = Orthotropic((140e9, 9e9, 10e9), (0.3, 0.28, 0.4), (5e9, 4.5e9, 3.5e9), 1600.0)
REDUCED = Material(E=210e9, nu=0.3, rho=7860.0, elements="linear_reduced")


@pytest.mark.parametrize("form", FORMULATIONS)
def test_every_formulation_of_eight_nodes_has_rigid_motions_and_uniform_strains(form: str) -> None:
    """On distorted elements whose strain is uniform, forces act on the surface alone."""
    fine = skfem.MeshHex.init_tensor(*[np.linspace(0, size, 4) for size in (1.0, 0.7, 0.5)])
    inner = np.setdiff1d(np.arange(fine.nvertices), fine.boundary_nodes())
    points = fine.p.copy()
    points[:, inner] += 0.04 * np.random.default_rng(1).uniform(-1, 1, (3, len(inner)))
    mesh = skfem.MeshHex(points, fine.t)
    for material in (replace(REDUCED, elements=form), replace(SOFT, elements=form)):
        M, K = assemble(mesh, material)
        x = coordinates(mesh)
        for motion in (
            np.cross([1.0, 2.0, 3.0], x),
            x @ np.array([[1.0, 0.2, 0.4], [0.2, -2.0, 0.5], [0.4, 0.5, 0.7]]),
        ):
            force = (K @ motion.ravel()).reshape(-1, 3)
            assert np.abs(force[inner]).max() < 1e-12 * abs(K).max()
        assert np.linalg.eigvalsh(K.toarray())[6] > 1e-6 * abs(K).max()
        assert M.sum() == pytest.approx(3 * material.rho * 0.35)


def test_a_body_one_element_thick_is_remarked():
    for planes, count in ((2, 1), (3, 0)):
        body = Body("plate", skfem.MeshHex.init_tensor(*map(np.arange, (5, 3, planes))), {}, REDUCED)
        assert sum("hourglass" in text for text in check_thickness([body])) == count


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
