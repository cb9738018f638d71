"""Assembly against scikit-fem's own, rigid bodies, the patch test and convergence orders."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from skfem.helpers import ddot, dot, sym_grad, trace

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import batches, coordinates
from tribodyn.fem.factor import factorise
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


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_rigid_bodies_and_total_mass(kind):
    mesh = block(kind, n=1, distort=1.0)
    M, K = assemble(mesh, STEEL)
    x = coordinates(mesh)
    rigid = [np.tile(e, (len(x), 1)) for e in np.eye(3)] + [np.cross(e, x) for e in np.eye(3)]
    for mode in rigid:
        assert np.abs(K @ mode.ravel()).max() < 1e-13 * abs(K).max()
    values = np.linalg.eigvalsh(K.toarray())
    assert np.sum(values < 1e-10 * values[-1]) == 6
    for e in rigid[:3]:
        assert e.ravel() @ M @ e.ravel() == pytest.approx(STEEL.rho * 0.35, rel=1e-13)
    spin = rigid[5].ravel()  # about z through the corner
    assert spin @ M @ spin == pytest.approx(STEEL.rho * 0.35 * (1 + 0.7**2) / 3, rel=5e-3)


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_patch_test(kind):
    """A linear displacement leaves no force at inner nodes of a mesh of skewed straight-sided elements."""
    mesh = block(kind, n=2)
    rng = np.random.default_rng(1)
    first = (skfem.MeshHex if kind == "hex" else skfem.MeshTet)(mesh.p.copy(), mesh.t)
    inner = np.setdiff1d(np.arange(first.p.shape[1]), first.boundary_nodes())
    first.p[:, inner] += 0.05 * rng.standard_normal((3, len(inner)))
    mesh = type(mesh).from_mesh(first)
    _, K = assemble(mesh, STEEL)
    x = coordinates(mesh)
    force = (K @ (x @ rng.standard_normal((3, 3))).ravel()).reshape(-1, 3)
    surface = mesh.dofs.get_facet_dofs(mesh.boundary_facets()).flatten()
    inside = np.setdiff1d(np.arange(len(x)), surface)
    assert len(inside) > 0
    assert np.abs(force[inside]).max() < 1e-13 * np.abs(force).max()


def manufactured(mesh, exact, body_force):
    """Relative L2 and energy errors of a Dirichlet problem with a known solution."""
    _, K = assemble(mesh, Material(1.0, 0.3, 1.0))
    x = coordinates(mesh)
    load = np.zeros_like(x)
    for elements, N, _, weight in batches(mesh, 8):
        nodes = mesh.dofs.element_dofs.T[elements]
        at = np.einsum("qa,eax->eqx", N, x[nodes])
        np.add.at(load, nodes, np.einsum("qa,eq,eqx->eax", N, weight, body_force(at)))
    fixed = mesh.dofs.get_facet_dofs(mesh.boundary_facets()).flatten()
    free = np.setdiff1d(np.arange(K.shape[0]), (fixed[:, None] * 3 + np.arange(3)).ravel())
    u = exact(x)
    u.ravel()[free] = 0
    reference = K @ u.ravel()
    u.ravel()[free] = factorise(K[free][:, free]).solve((load.ravel() - reference)[free])
    error = norm = slope = slope_norm = 0.0
    h = 1e-5
    for elements, N, gradient, weight in batches(mesh, 8):
        nodes = mesh.dofs.element_dofs.T[elements]
        at = np.einsum("qa,eax->eqx", N, x[nodes])
        field = np.einsum("qa,eax->eqx", N, u[nodes])
        error += np.einsum("eqx,eq->", (field - exact(at)) ** 2, weight)
        norm += np.einsum("eqx,eq->", exact(at) ** 2, weight)
        grad = np.einsum("eqia,eax->eqix", gradient, u[nodes])
        true = np.stack([(exact(at + h * e) - exact(at - h * e)) / (2 * h) for e in np.eye(3)], axis=2)
        slope += np.einsum("eqix,eq->", (grad - true) ** 2, weight)
        slope_norm += np.einsum("eqix,eq->", true**2, weight)
    return np.sqrt(error / norm), np.sqrt(slope / slope_norm)


@pytest.mark.parametrize("kind", ["hex", "tet"])
def test_convergence_orders(kind):
    """Second-order elements: order 3 in L2, 2 in the gradient, for u = a sin(k . x)."""
    lam, mu = Material(1.0, 0.3, 1.0).lame
    a, k = np.array([1.0, -0.5, 0.7]), np.array([2.0, 1.5, -1.0])

    def exact(x):
        return np.sin(x @ k)[..., None] * a

    def body_force(x):  # -div sigma
        return np.sin(x @ k)[..., None] * (mu * (k @ k) * a + (lam + mu) * (k @ a) * k)

    sizes = (3, 6)
    errors = np.array([manufactured(block(kind, n, distort=1.0), exact, body_force) for n in sizes])
    order = np.log(errors[0] / errors[1]) / np.log(2)
    assert order[0] > 2.8
    assert order[1] > 1.8


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
    with pytest.raises(ValueError, match="lock in bending: raise the element order"):
        assemble(skfem.MeshHex.init_tensor([0, 1.0], [0, 1.0], [0, 1.0]), STEEL)
    mesh = block("hex", n=1)
    mesh.doflocs[:, -1] = [3.0, 0.3, 0.2]  # the middle node leaves the element
    with pytest.raises(ValueError, match="folded element near"):
        assemble(mesh, STEEL)
