"""Contacts of faces that do not match: patch tests, moments, gaps of the geometry."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.assembly import Assembly, Body
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.load_vectors import Pressure
from tribodyn.fem.material import Material
from tribodyn.fem.mortar import coefficients, dual, shared_surface, side, tabulate

STEEL = Material(210e9, 0.3, 7860.0)
L = np.linspace


def block(x, y, z, tets=False, bend=0.0, linear=False):
    """A block with its bottom and top named, bent to z + bend (x - 0.3)^2, which second order represents exactly."""
    mesh = (skfem.MeshTet if tets else skfem.MeshHex).init_tensor(x, y, z)
    if not linear:
        mesh = (skfem.MeshTet2 if tets else skfem.MeshHex2).from_mesh(mesh)
    height = mesh.p[2][mesh.facets]
    low, high = (np.flatnonzero(np.abs(height - at).max(axis=0) < 1e-9) for at in (z[0], z[-1]))
    locations = mesh.doflocs.copy()
    locations[2] += bend * (locations[0] - 0.3) ** 2
    return replace(mesh, doflocs=locations).with_boundaries({"bottom": low, "top": high})


def pair(tets, bend=0.0, gap=0.0, lower=(6, 5)):
    upper = block(L(0, 1, 4), L(0, 1, 4), L(gap, 0.3, 2), False, bend)
    under = block(L(0, 1, lower[0]), L(0, 1, lower[1]), L(-0.4, 0, 2), tets, bend)
    return Assembly([Body("upper", upper, {}, STEEL), Body("lower", under, {}, STEEL)])


def test_contacts_of_eight_node_hexahedra_carry_constant_tractions():
    upper = block(L(0, 1, 4), L(0, 1, 4), L(0, 0.3, 2), linear=True)
    for linear in (True, False):
        under = block(L(0, 1, 6), L(0, 1, 5), L(-0.4, 0, 2), linear=linear)
        assembly = Assembly([Body("upper", upper, {}, STEEL), Body("lower", under, {}, STEEL)])
        interface, B_2 = halves(assembly, "upper.bottom", "lower.top")
        assert interface.area.sum() == pytest.approx(1.0, rel=1e-12)
        pressure = np.zeros((interface.n_pair, 3))
        pressure[:, 2] = interface.area
        for face, B in (("upper.bottom", interface.B), ("lower.top", -B_2)):
            consistent = -Pressure(face).vector(assembly, assembly.node_sets, None)
            assert np.abs(B.T @ pressure.ravel() - consistent).max() < 1e-12 * np.abs(consistent).max()


def halves(of, first, second, **options):
    return ContactFaces(first, (1, 0, 0), second, **options).halves(of)


@pytest.mark.parametrize("bend", [0.0, 0.2])
@pytest.mark.parametrize("tets", [False, True])
@pytest.mark.parametrize("faces", [("upper.bottom", "lower.top"), ("lower.top", "upper.bottom")])
def test_constant_tractions_are_those_of_both_bodies(tets, bend, faces):
    two_results = pair(tets, bend)
    interface, B_2 = halves(two_results, *faces)
    assert (interface.area > 0).all()
    pressure = np.zeros((interface.n_pair, 3))
    pressure[:, 2] = interface.area
    for face, force in ((faces[0], interface.B.T @ pressure.ravel()), (faces[1], -B_2.T @ pressure.ravel())):
        consistent = -Pressure(face).vector(two_results, two_results.node_sets, None)
        assert np.abs(force - consistent).max() < 1e-12 * np.abs(consistent).max()
    # a shear of constant direction keeps resultant and moment on both sides
    shear = interface.frames[:, 0] * interface.area[:, None]
    local = np.einsum("pcx,px->pc", interface.frames, shear).ravel()
    f_1, f_2 = ((B.T @ local).reshape(-1, 3) for B in (interface.B, B_2))
    assert f_1.sum(axis=0) == pytest.approx(f_2.sum(axis=0), abs=1e-12)
    at = two_results.doflocs.T
    assert np.cross(at, f_1).sum(axis=0) == pytest.approx(np.cross(at, f_2).sum(axis=0), abs=1e-12)


@pytest.mark.parametrize("bend", [0.0, 0.2])
def test_rigid_motion_of_both_is_no_relative_motion_and_moments_are_kept(bend):
    two_results = pair(True, bend)
    interface, B_2 = halves(two_results, "upper.bottom", "lower.top")
    at = two_results.doflocs.T
    rigid = np.cross([0.3, 0.5, 0.7], at) + [1.0, 2.0, 3.0]
    assert np.abs((interface.B - B_2) @ rigid.ravel()).max() < 1e-13
    if not bend:
        observed = (interface.B @ at.ravel()).reshape(-1, 3)[:, :2]
        assert observed[:, 0] @ interface.area == pytest.approx(1 / 2, rel=1e-13)
        assert observed[:, 0] ** 2 @ interface.area == pytest.approx(1 / 3, rel=1e-13)
        assert (observed[:, 0] * observed[:, 1]) @ interface.area == pytest.approx(-1 / 4, rel=1e-13)


@pytest.mark.parametrize("vertices_only", [False, True])
@pytest.mark.parametrize("pairing", ["ground", "nodes", "mortar"])
@pytest.mark.parametrize("tets", [False, True])
def test_a_face_of_one_element_resists_tilting_as_a_uniform_bedding(tets, pairing, vertices_only):
    """Area, first and second moments of the unit square are kept by all nodes; by its vertices only the first two."""
    upper = block(L(0, 1, 2), L(0, 1, 2), L(0, 0.3, 2), tets)
    n = 2 if pairing == "nodes" else 3
    under = block(L(0, 1, n), L(0, 1, n + (n > 2)), L(-0.4, 0, 2), tets)
    assembly = Assembly([Body("upper", upper, {}, STEEL), Body("lower", under, {}, STEEL)])
    if pairing == "ground":
        interface = ContactFaces("upper.bottom", (1, 0, 0), vertices_only=vertices_only).build(assembly)
    else:
        interface, B_2 = halves(assembly, "upper.bottom", "lower.top", pairing=pairing, vertices_only=vertices_only)
        assert (np.abs(B_2).sum(axis=1) > 0).all()
    tilted = np.zeros((assembly.doflocs.shape[1], 3))
    second = []
    for path in ([1, 0], [0, 1], [1, 1]):
        tilted[:, 2] = (assembly.doflocs[:2].T - 0.5) @ path
        observed = (interface.B @ tilted.ravel())[2::3]
        assert interface.area @ observed == pytest.approx(0, abs=1e-14)
        second.append(interface.area @ observed**2)
    assert (interface.area > 0).all()
    assert interface.area.sum() == pytest.approx(1.0, rel=1e-13)
    if not vertices_only:
        assert second == pytest.approx([1 / 12, 1 / 12, 1 / 6], rel=1e-12)
    else:  # thrice too stiff at the nodes themselves, and too soft in means over the weights of corners
        assert (second[0] > 0.2) == (pairing != "mortar")


@pytest.mark.parametrize("gap", [1e-6, -1e-6, 0.02])
@pytest.mark.parametrize("lower", [(6, 5), (4, 4)])
def test_the_gap_is_that_of_the_geometry_with_its_sign(gap, lower):
    two_results = pair(False, gap=gap, lower=lower)
    interface, _ = halves(two_results, "upper.bottom", "lower.top")
    assert interface.gap == pytest.approx(np.full(interface.n_pair, gap), rel=1e-9)
    over, _ = halves(two_results, "upper.bottom", "lower.top", gap=3e-5)
    assert (over.gap == 3e-5).all()


def test_a_coarse_face_on_a_fine_one_uses_every_node_of_it():
    two_results = pair(False, lower=(7, 7))  # the upper grid of 4 x 4 lies on every second line of the lower one
    assert len(two_results.boundaries["lower.top"]) == 36
    for faces in (("upper.bottom", "lower.top"), ("lower.top", "upper.bottom")):
        interface, B_2 = halves(two_results, *faces)
        fine = B_2 if faces[0].startswith("upper") else interface.B
        touched = np.unique(fine.nonzero()[1] // 3)
        assert len(touched) == 13 * 13
        assert interface.area.sum() == pytest.approx(1.0, rel=1e-13)


def test_a_face_that_overhangs_is_cut_where_the_other_ends():
    upper = block(L(0.25, 1.5, 6), L(0.1, 0.8, 4), L(0, 0.3, 2))
    under = block(L(0, 1, 6), L(0, 1, 5), L(-0.4, 0, 2), True)
    assembly = Assembly([Body("upper", upper, {}, STEEL), Body("lower", under, {}, STEEL)])
    interface, B_2 = halves(assembly, "upper.bottom", "lower.top")
    assert interface.area.sum() == pytest.approx(0.75 * 0.7, rel=1e-12)
    assert (interface.area > 0).all()
    assert (interface.points[:, 0] <= 1.0).all()  # the lower face ends there, within elements of the upper one
    assert interface.points[:, 0].max() > 0.9
    ones = np.ones(3 * assembly.doflocs.shape[1])
    assert np.abs((interface.B - B_2) @ ones).max() < 1e-12


def test_matching_faces_are_paired_node_by_node():
    two_results = pair(False, lower=(4, 4))
    interface, B_2 = halves(two_results, "upper.bottom", "lower.top")
    assert interface.n_pair == 49
    assert (np.diff(B_2.indptr) == 1).all()
    weighed, _ = halves(two_results, "upper.bottom", "lower.top", pairing="mortar")
    assert weighed.area == pytest.approx(interface.area, rel=1e-12)


def test_what_does_not_meet_is_one_sentence():
    two_results = pair(False, gap=0.25)
    with pytest.raises(ValueError, match=r"do not meet: they are about 0.25\d* m apart"):
        halves(two_results, "upper.bottom", "lower.top")
    with pytest.raises(ValueError, match="look the same way"):
        halves(pair(True), "upper.top", "lower.top", reach=0.5)
    faces = np.concatenate([two_results.boundaries["upper.bottom"], two_results.boundaries["lower.top"]])
    two_results.boundaries["both"] = faces
    with pytest.raises(ValueError, match="several bodies"):
        halves(two_results, "both", "lower.top")


def test_dual_functions_hold_where_a_cut_is_hollow_and_weights_are_below_zero():
    """Meshes of bolts give such cuts: the weights were taken for areas, and a root of them was no number."""
    two_results = pair(False)
    item, second = (side(two_results, two_results.boundaries[name]) for name in ("upper.bottom", "lower.top"))
    shared = shared_surface(item, second, 0.1)
    weight = shared.weight.copy()
    weight[::7] *= -0.1
    shared = replace(shared, weight=weight)
    psi, d = dual(item, shared)
    k = item.nodes.shape[1]
    N = np.linalg.inv(coefficients(k)).T @ tabulate(k, shared.xi)[0]
    for i in np.unique(shared.first):
        base = shared.first == i
        np.testing.assert_allclose(psi[:, base] @ N[:, base].T, np.diag(d[i]), atol=1e-9 * np.abs(d[i]).max())
    np.testing.assert_allclose(psi.sum(axis=0), weight, atol=1e-9 * weight.max())
