"""Elastic constants by the definition of Young's modulus, Poisson's ratio and the shear modulus."""

import numpy as np
import pytest

from tribodyn.fem.material import Material, Orthotropic


@pytest.mark.parametrize(("young", "poisson"), [(210e9, 0.3), (2e6, 0.49), (70e9, 0.0)])
def test_uniaxial_stress_and_pure_shear(young: float, poisson: float) -> None:
    tensor = Material(young, poisson, 1.0).tensor(np.zeros((1, 3)))[0]
    strain = np.diag([1.0, -poisson, -poisson])
    np.testing.assert_allclose(np.einsum("ijkl,kl->ij", tensor, strain), np.diag([young, 0, 0]), atol=1e-9 * young)
    shear = np.einsum("ijkl,kl->ij", tensor, np.array([[0, 1.0, 0], [1.0, 0, 0], [0, 0, 0]]))
    assert shear[0, 1] == pytest.approx(young / (1 + poisson), rel=1e-12)


def test_every_poisson_ratio_of_an_orthotropic_material_belongs_to_its_own_modulus() -> None:
    item = Orthotropic((100e9, 60e9, 30e9), (0.3, 0.2, 0.25), (20e9, 15e9, 10e9), 1.0)
    compliance = np.linalg.inv(
        [[item.tensor(np.zeros((1, 3)))[0][i, i, j, j] for j in range(3)] for i in range(3)]
    )  # strains of three normal stresses
    ratios = -compliance / np.diag(compliance)  # of strain i under stress along j
    assert ratios[1, 0] == pytest.approx(0.3, rel=1e-9)
    assert ratios[2, 0] == pytest.approx(0.2, rel=1e-9)
    assert ratios[2, 1] == pytest.approx(0.25, rel=1e-9)
    assert item.tensor(np.zeros((1, 3)))[0][1, 2, 1, 2] == pytest.approx(10e9, rel=1e-9)
