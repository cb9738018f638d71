"""A factor in single precision with conjugate gradients: the same solutions and the same model as from a full one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

from tests.helpers.fits import plain
from tribodyn.fem.factor import Pardiso, SingularStiffness, factorise, pardiso_available
from tribodyn.workflows.scene import scene_file

pytestmark = pytest.mark.skipif(not pardiso_available(), reason="pypardiso is not installed")

SMALL = ("harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=6", "geometry.n_height=2")


def bending(n: int) -> csr_matrix:
    """Stiffness of a clamped chain that resists bending alone, condition some n^4, in units that change along it."""
    second = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsr()
    units = diags_array(10.0 ** np.linspace(-3, 3, n))
    return csr_matrix(units @ (second.T @ second) @ units)


def test_double_precision_comes_out_of_a_matrix_that_single_precision_cannot_refine() -> None:
    matrix = bending(300)  # condition 4e8 where the units are equal
    rhs = np.random.default_rng(0).normal(size=(300, 4))
    rhs[:, 2] = 0.0
    factor = factorise(matrix, solver="single_precision")
    for b in (rhs, rhs[:, 0]):
        found = factor.solve(b)
        assert found.shape == b.shape
        exact = np.linalg.solve(matrix.toarray(), b)
        assert np.linalg.norm(found - exact) <= 1e-7 * np.linalg.norm(exact)
    alone = Pardiso(bending(300), single=True).solve(rhs[:, 0])
    exact = np.linalg.solve(matrix.toarray(), rhs[:, 0])
    assert np.linalg.norm(alone - exact) > 1e-3 * np.linalg.norm(exact)


def test_a_singular_matrix_is_refused() -> None:
    free = bending(40).tolil()
    free[:, 0] = 0.0
    free[0, :] = 0.0
    with pytest.raises(SingularStiffness):
        factorise(free.tocsr(), solver="single_precision")


@pytest.mark.parametrize("method", ["craig_bampton", "residual_flexibility"])
def test_a_model_is_that_of_the_direct_solver(method: str) -> None:
    found = {}
    for solver in ("direct", "single_precision"):
        changes = (*SMALL, "reduction.modes=6", f"reduction.method={method}", f"reduction.solver={solver}")
        found[solver] = plain(scene_file.read("beam", changes))
    direct, other = found["direct"], found["single_precision"]
    assert other.info.factorisation == "MKL PARDISO in single precision, with conjugate gradients"
    assert other.info.free_frequency == pytest.approx(direct.info.free_frequency, rel=1e-9)
    if method == "residual_flexibility":
        whole = []
        for model in (direct, other):
            rest, force = model.residual, np.eye(model.interface.B.shape[0])
            assert rest is not None
            whole.append(rest.apply(force) + rest.at_contact @ (rest.at_contact.T / rest.squares[:, None]))
    else:
        n = len(direct.info.master_dofs)
        whole = [model.system.stiffness[:n, :n] for model in (direct, other)]
    assert np.abs(whole[0] - whole[1]).max() <= 1e-9 * np.abs(whole[0]).max()
