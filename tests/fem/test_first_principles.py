"""Resultants, work and symmetries that a factor of 1.001 or a wrong sign breaks: each is known without any solve."""

import numpy as np
import pytest
import skfem

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.bolts import Bolt
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.load_vectors import Heating, NodalForce, Sum
from tribodyn.fem.material import Material, Orthotropic
from tribodyn.fem.prestress import coriolis, geometric_stiffness, spin_softening
from tribodyn.fem.springs import Mass
from tribodyn.fem.surface import surface

STEEL = Material(210e9, 0.3, 7860.0, expansion=1e-5)
SIZE = (2.0, 1.0, 0.5)
WEIGHT = 7860.0 * np.prod(SIZE)


@pytest.fixture(scope="module")
def block():
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*(np.linspace(0, s, 3) for s in SIZE)))
    mesh = mesh.with_boundaries({"top": lambda x: x[2] > SIZE[2] - 1e-9, "bottom": lambda x: x[2] < 1e-9})
    p = mesh.doflocs
    return mesh, {"top": np.flatnonzero(p[2] > SIZE[2] - 1e-9), "left": np.flatnonzero(p[0] < 1e-9)}


def everywhere(mesh, vector):
    return np.tile(np.asarray(vector, float), mesh.doflocs.shape[1])


def test_an_orthotropic_material_of_isotropic_constants_is_isotropic(block):
    E, nu, G = STEEL.E, STEEL.nu, STEEL.E / (2 * (1 + STEEL.nu))
    equal = Orthotropic((E, E, E), (nu, nu, nu), (G, G, G), STEEL.rho)
    for ours, plain in zip(assemble(block[0], equal), assemble(block[0], STEEL), strict=True):
        assert abs(ours - plain).max() < 1e-13 * abs(plain).max()


def test_a_lumped_mass_weighs_what_it_says(block):
    mesh, sets = block
    for at in ("top", "left"):
        M = Mass(at, 3.0).matrix(mesh, sets)
        for direction in np.eye(3):
            u = everywhere(mesh, direction)
            assert u @ M @ u == pytest.approx(3.0, rel=1e-12)


def test_loads_that_act_together_add_up(block):
    mesh, sets = block
    two_results = Sum([(NodalForce("top", (1, 0, 0)), 2.0), (NodalForce("left", (0, 1, 0)), -3.0)])
    assert two_results.vector(mesh, sets, None).reshape(-1, 3).sum(axis=0) == pytest.approx([2, -3, 0], rel=1e-12)


def test_the_gap_of_a_bowed_and_inclined_face_is_its_height_above_the_ground(block):
    mesh, _ = block
    bowed = mesh.doflocs.copy()
    at_bottom = bowed[2] < 1e-9
    bowed[2, at_bottom] += 1e-3 * bowed[0, at_bottom] ** 2
    mesh = type(mesh)(bowed, mesh.t).with_boundaries({"bottom": mesh.boundaries["bottom"]})
    built = ContactFaces("bottom", (1, 0, 0), plane=(0, 0, -1)).build(mesh)
    np.testing.assert_allclose(built.gap, 1e-3 * built.points[:, 0] ** 2, atol=1e-15)
    leaning = ContactFaces("bottom", (1, 0, 0), plane=(0, 0, -1), inclination=1e-2).build(mesh)
    t2 = built.frames[0, 1]
    distant = built.gap + np.tan(1e-2) * built.points @ t2
    np.testing.assert_allclose(leaning.gap, distant - distant.min(), atol=1e-15)


def test_the_area_of_a_curved_face_is_its_arc_length_times_its_width() -> None:
    """z = a x^2: the arc from 0 to 1 is sqrt(1 + 4 a^2) / 2 + asinh(2 a) / (4 a)."""
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor([0, 1.0], [0, 0.5, 1.0], [0, 1.0]))
    bent, a = mesh.doflocs.copy(), 0.8
    top = bent[2] > 1 - 1e-9
    bent[2, top] += a * bent[0, top] ** 2
    mesh = type(mesh)(bent, mesh.t)
    facets = mesh.facets_satisfying(lambda x: x[2] > 1 + 1e-9, boundaries_only=True)
    facets = [
        f for f in facets if np.ptp(mesh.p[0, mesh.facets[:, f]]) > 0.5 and np.ptp(mesh.p[1, mesh.facets[:, f]]) > 0
    ]
    result = surface(mesh, np.array(facets))
    arc = np.sqrt(1 + 4 * a**2) / 2 + np.arcsinh(2 * a) / (4 * a)
    assert result.area.sum() == pytest.approx(arc, rel=1e-4)
    assert result.area @ result.points[:, 1] == pytest.approx(0.5 * arc, rel=1e-4)


def test_forces_of_a_turning_frame_have_their_resultants(block):
    """-2 m omega x v, and m omega^2 on what is shifted away from the axis; nothing along it."""
    mesh, _ = block
    M, _ = assemble(mesh, STEEL)
    axis, speed = np.array([0.0, 0.6, 0.8]), 30.0
    G, softening = coriolis(M, axis, speed), spin_softening(M, axis, speed)
    assert abs(G + G.T).max() < 1e-12 * abs(G).max()
    for v in np.eye(3):
        force = (-G @ everywhere(mesh, v)).reshape(-1, 3).sum(axis=0)
        assert force == pytest.approx(-2 * WEIGHT * speed * np.cross(axis, v), rel=1e-11, abs=1e-8)
        force = (-softening @ everywhere(mesh, v)).reshape(-1, 3).sum(axis=0)
        assert force == pytest.approx(WEIGHT * speed**2 * (v - axis * (axis @ v)), rel=1e-11, abs=1e-6)


def test_a_body_that_expands_freely_carries_no_stress_and_one_that_is_held_does(block):
    """u = alpha T x: no geometric stiffness. Held: sigma = -E alpha T / (1 - 2 nu) in every direction."""
    mesh, _ = block
    warm = np.full(mesh.doflocs.shape[1], 50.0)
    x = mesh.doflocs.T
    fixed = geometric_stiffness(mesh, STEEL, np.zeros_like(x), warm)
    free = geometric_stiffness(mesh, STEEL, STEEL.expansion * 50.0 * x, warm)
    assert abs(free).max() < 1e-12 * abs(fixed).max()
    tilt = (x[:, :1] * [0, 0, 1.0]).ravel()
    stress = -STEEL.E * STEEL.expansion * 50.0 / (1 - 2 * STEEL.nu)
    assert tilt @ fixed @ tilt == pytest.approx(stress * np.prod(SIZE), rel=1e-12)


def test_the_work_of_heat_is_stress_times_strain(block):
    """A temperature T = 1 + x does the work 3 K alpha T e_xx on a body that is stretched along x: integral over x."""
    mesh, sets = block
    x = mesh.doflocs.T
    force = Heating(STEEL, values=1.0 + x[:, 0]).vector(mesh, sets)
    stretch = (x * [1.0, 0, 0]).ravel()
    per_kelvin = STEEL.E * STEEL.expansion / (1 - 2 * STEEL.nu)
    mean = 1.0 + SIZE[0] / 2
    assert force @ stretch == pytest.approx(per_kelvin * mean * np.prod(SIZE), rel=1e-12)
    assert np.abs(force.reshape(-1, 3).sum(axis=0)).max() < 1e-9 * np.abs(force).max()


def test_a_bolt_is_in_balance_and_pulls_its_faces_together_with_one_newton(block):
    mesh, sets = block
    force = Bolt("one", "top", "bottom").vector(mesh, sets).reshape(-1, 3)
    assert np.abs(force.sum(axis=0)).max() < 1e-12
    at_top = mesh.doflocs[2] > SIZE[2] - 1e-9
    assert force[at_top].sum(axis=0) == pytest.approx([0, 0, -1.0], rel=1e-12)


def test_a_sector_that_is_ahead_repeats_its_right_neighbour_later():
    """q_n = q_0 exp(-i 2 pi j n / N) is the wave cos(w t - 2 pi j n / N): it runs towards sectors that are ahead."""
    phase = cyclic_symmetry.phase(1, 12)
    time = np.linspace(0, 1, 50)
    ours = (phase * np.exp(2j * np.pi * time)).real
    np.testing.assert_allclose(ours, np.cos(2 * np.pi * (time - 1 / 12)), atol=1e-12)
