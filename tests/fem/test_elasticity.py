"""Assembly against scikit-fem's own, whose rigid bodies and patch test it has."""

import numpy as np
import pytest
import skfem
from skfem.helpers import ddot, dot, sym_grad, trace

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.material import Material

STEEL = Material(E=210e9, nu=0.3, rho=7860.0)


def block(kind, n=2, size=(1.0, 0.7, 0.5), distort=0.0):
    """Block of n x n x n cells (six tetrahedra each), its inner nodes moved smoothly so that the faces stay flat."""
    axes = [np.linspace(0, s, n + 1) for s in size]
    if kind == "hex":
        mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*axes))
    else:
        mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*axes))
    unit = mesh.doflocs / np.array(size)[:, None]
    bubble = np.prod(unit * (1 - unit), axis=0)
    shift = distort * bubble * np.stack([np.sin(3 * unit[1]), np.cos(2 * unit[2]), np.sin(4 * unit[0])])
    return type(mesh)(mesh.doflocs + shift, mesh.t)


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_equals_scikit_fem(kind):
    mesh = block(kind, distort=2.0)
    lam, mu = STEEL.lame
    basis = skfem.Basis(mesh, skfem.ElementVector(mesh.elem()), intorder=5)

    @skfem.BilinearForm
    def stiffness(u, v, _):
        eps = sym_grad(u)
        return 2 * mu * ddot(eps, sym_grad(v)) + lam * trace(eps) * trace(sym_grad(v))

    @skfem.BilinearForm
    def mass(u, v, _):
        return STEEL.rho * dot(u, v)

    for ours, form in zip(assemble(mesh, STEEL), (mass, stiffness), strict=True):
        theirs = form.assemble(basis)
        assert abs(ours - theirs).max() < 1e-14 * abs(theirs).max()
        assert (ours != ours.T).nnz == 0


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_default_order_is_exact_for_straight_elements(kind):
    mesh = block(kind)
    for ours, exact in zip(assemble(mesh, STEEL), assemble(mesh, STEEL, order=9), strict=True):
        assert abs(ours - exact).max() < 1e-13 * abs(exact).max()


def test_materials_of_subdomains():
    mesh = block("hex").with_subdomains({"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5})
    light = Material(70e9, 0.33, 2700.0)
    M, K = assemble(mesh, {"left": STEEL, "right": light})
    e = np.tile([0.0, 0, 1], mesh.doflocs.shape[1])
    assert e @ M @ e == pytest.approx(0.175 * (7860 + 2700), rel=1e-13)
    equal, K_same = assemble(mesh, {"left": STEEL, "right": STEEL})
    M_one, K_one = assemble(mesh, STEEL)
    assert abs(equal - M_one).max() == 0
    assert abs(K_same - K_one).max() == 0
    assert abs(K - K_one).max() > 0
    with pytest.raises(ValueError, match=r"4 elements have no material.*left.*right"):
        assemble(mesh, {"left": STEEL})
    with pytest.raises(ValueError, match="no subdomain 'centre'"):
        assemble(mesh, {"centre": STEEL})


@pytest.mark.parametrize(
    ("values", "word"), [((0.0, 0.3, 1.0), "E = "), ((1.0, 0.5, 1.0), "nu = "), ((1.0, 0.3, float("nan")), "rho = ")]
)
def test_material_refuses(values, word):
    with pytest.raises(ValueError, match=word):
        Material(*values)


def test_refuses_first_order_and_folded_meshes():
    with pytest.raises(ValueError, match="the elements have 8 nodes"):
        assemble(skfem.MeshHex.init_tensor([0, 1.0], [0, 1.0], [0, 1.0]), STEEL)
    mesh = block("hex", n=1)
    mesh.doflocs[:, -1] = [3.0, 0.3, 0.2]  # the middle node leaves the element
    with pytest.raises(ValueError, match="folded element near"):
        assemble(mesh, STEEL)
