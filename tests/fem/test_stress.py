"""Stress against closed forms: beam, hole, tube, rotating disk, restrained heating; rows, gauges, places."""

from itertools import pairwise

import numpy as np
import pytest

from tests.helpers.bent_blocks import STEEL, brick
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import factorise
from tribodyn.fem.load_vectors import Centrifugal, Heating, NodalForce, Pressure
from tribodyn.fem.material import Material
from tribodyn.fem.modes import modes
from tribodyn.fem.part import build
from tribodyn.fem.stress import COLUMNS, ROWS, locate, nodal_stress, strain_row, stress_rows
from tribodyn.hbm.fatigue import face_indicators, von_mises
from tribodyn.hbm.harmonics import HarmonicBasis


def as_tensor(stress):
    """Stress (..., 6) as symmetric tensors (..., 3, 3)."""
    return stress[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]


def displaced(mesh, sets, clamped, load):
    """Displacement (n_node, 3) under a load with clamps (group, axes)."""
    part = build(mesh, sets, STEEL, [Clamp(*each) for each in clamped], [], {"load": load}, {})
    return part.field(factorise(part.system.stiffness).solve(part.system.loads["load"]))


def polar(stress, points):
    """Radial, hoop and axial stress of tensors (n, 6) at points (n, 3) about z."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    radial = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    hoop = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    tensor = as_tensor(stress)
    return (*(np.einsum("ni,nij,nj->n", axis, tensor, axis) for axis in (radial, hoop)), stress[:, 2])


def ring(x):
    """Nodes (r, angle, z) bent about z."""
    return np.stack([x[0] * np.cos(x[1]), x[0] * np.sin(x[1]), x[2]])


@pytest.mark.parametrize("tetrahedra", [False, True])
def test_cantilever(tetrahedra):
    """Bending stress F (L - x) z / I half a depth and more from the ends; zero shear on the faces."""
    length, width, depth, force = 0.2, 0.01, 0.02, 500.0
    n = (24, 3, 6) if tetrahedra else (16, 2, 4)
    ends = ((0, length), (-width / 2, width / 2), (-depth / 2, depth / 2))
    axes = [np.linspace(*end, k + 1) for end, k in zip(ends, n, strict=True)]
    mesh, sets = brick(*axes, tetrahedra=tetrahedra)
    u = force * displaced(mesh, sets, [("x_min",)], NodalForce("x_max", (0, 0, 1), shared="area"))
    points, result = mesh.doflocs.T, nodal_stress(mesh, STEEL, u)
    assert np.array_equal(result.node, np.arange(len(points)))
    x, z = points[:, 0], points[:, 2]
    interior = (x > 1.5 * depth) & (x < length - depth) & (np.abs(np.abs(z) - depth / 2) < 1e-9)
    expected = -force * (length - x) * z / (width * depth**3 / 12)
    largest = np.abs(expected[interior]).max()
    np.testing.assert_allclose(result.tensor[interior, 0], expected[interior], atol=5e-3 * largest)
    np.testing.assert_allclose(von_mises(result.tensor[interior]), np.abs(expected[interior]), atol=1e-2 * largest)


def test_cantilever_in_vibration():
    """First mode of a slender bar, by Euler and Bernoulli: -E z w'' for a deflection w of its end."""
    length, depth, k = 0.3, 0.004, 1.8751040687
    mesh, sets = brick(np.linspace(0, length, 31), [0.0, 0.008], [-depth / 2, depth / 2])
    part = build(mesh, sets, STEEL, [Clamp("x_min")], [], {}, {})
    u = part.field(modes(part.system.stiffness, part.system.mass, 2)[1][:, 0])
    x, _, z = mesh.doflocs
    s, a = k * x / length, (np.cosh(k) + np.cos(k)) / (np.sinh(k) + np.sin(k))
    bend = np.cosh(s) + np.cos(s) - a * (np.sinh(s) + np.sin(s))
    tip = u[x == length, 2].mean() / (np.cosh(k) - np.cos(k) - a * (np.sinh(k) - np.sin(k)))
    expected, inside = -STEEL.E * z * bend * tip * (k / length) ** 2, np.abs(x - length / 2) < 0.45 * length
    tensor = nodal_stress(mesh, STEEL, u).tensor[inside, 0]
    np.testing.assert_allclose(tensor, expected[inside], atol=5e-3 * np.abs(expected).max())


def test_linear_field_is_exact_at_any_place():
    """A uniform strain has the stress of Hooke's law, at nodes, at points between them, and by gauges."""
    gradient = 1e-4 * np.array([[1.0, 0.4, 0.0], [0.2, -0.5, 0.3], [0.0, 0.1, 0.7]])
    strain = (gradient + gradient.T) / 2
    expected = STEEL.lame[0] * np.trace(strain) * np.eye(3) + 2 * STEEL.lame[1] * strain
    for tetrahedra in (False, True):
        mesh, _ = brick([0, 1.0, 2.5], [0, 1.0], [0, 0.8, 1.0], tetrahedra=tetrahedra)
        u = mesh.doflocs.T @ gradient.T
        np.testing.assert_allclose(as_tensor(nodal_stress(mesh, STEEL, u).tensor), expected[None] + 0 * u[:, :1, None],
                                   atol=1e-6 * np.abs(expected).max())  # fmt: skip
        place = locate(mesh, (1.3, 0.37, 0.61), "place")
        np.testing.assert_allclose(place.point, (1.3, 0.37, 0.61), atol=1e-9)
        rows, _ = stress_rows(mesh, STEEL, place)
        np.testing.assert_allclose(as_tensor(rows @ u.ravel()), expected, rtol=1e-9, atol=1e-3)
        axis = np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
        row = strain_row(mesh, "gauge", (1.2, 0.5, 0.5), axis, 0.2)
        assert row @ u.ravel() == pytest.approx(axis @ strain @ axis, rel=1e-9)


def test_rows_are_those_of_the_field():
    """Rows at a node give the stress of the whole field there, heated or not."""
    mesh, _ = brick([0, 1.0, 2.0], [0, 1.0], [0, 1.0, 1.5])
    rng = np.random.default_rng(5)
    u, heat = 1e-4 * rng.standard_normal((mesh.doflocs.shape[1], 3)), rng.standard_normal(mesh.doflocs.shape[1])
    field = nodal_stress(mesh, STEEL, u, heat).tensor
    for node in rng.integers(0, len(u), 4):
        rows, thermal = stress_rows(mesh, STEEL, locate(mesh, mesh.doflocs[:, node], "place"), heat)
        np.testing.assert_allclose(rows @ u.ravel() + thermal, field[node], rtol=1e-7, atol=1e-3)


def test_hole_converges_to_three():
    """A plate with a hole in tension, by the stress of its exact solution on the cut boundary (Kirsch 1898): 3 S."""
    radius, size, errors = 1.0, 4.0, []
    for n in (6, 12):
        axes = (np.linspace(0, 1, n + 1) ** 1.5, np.linspace(0, np.pi / 2, n + 1), [0.0, 0.1])

        def bent(x):
            r = radius * (size / radius) ** x[0]
            return np.stack([r * np.cos(x[1]), r * np.sin(x[1]), x[2]])

        mesh, sets = brick(*axes, bent=bent)
        u = kirsch(mesh.doflocs.T, radius, 1e8)
        fixed = np.zeros(mesh.doflocs.shape[1], bool)
        fixed[sets["x_max"]] = True
        K = assemble(mesh, STEEL)[1]
        plane = np.zeros((len(fixed), 3), bool)
        plane[sets["y_min"], 1] = plane[sets["y_max"], 0] = plane[:, 2] = True
        plane[fixed] = True
        clamped = plane.ravel()
        full = np.where(clamped, u.ravel(), 0.0)
        full[~clamped] = factorise(K[~clamped][:, ~clamped]).solve(-(K[~clamped][:, clamped] @ u.ravel()[clamped]))
        top = np.flatnonzero(np.hypot(*(mesh.doflocs[:2] - [[0.0], [radius]])) < 1e-9)
        errors.append(nodal_stress(mesh, STEEL, full.reshape(-1, 3)).tensor[top, 0].mean() / 3e8 - 1)
    assert abs(errors[1]) < 0.01
    assert abs(errors[1]) < 0.5 * abs(errors[0])


def kirsch(points, a, tension):
    """Displacement (n, 3) of plane strain round a hole of radius a, pulled along x."""
    r, t = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    k, mu = 3 - 4 * STEEL.nu, STEEL.lame[1]
    c = tension * a / (8 * mu)
    ux = c * (r / a * (k + 1) * np.cos(t) + 2 * a / r * ((1 + k) * np.cos(t) + np.cos(3 * t))
              - 2 * a**3 / r**3 * np.cos(3 * t))  # fmt: skip
    uy = c * (r / a * (k - 3) * np.sin(t) + 2 * a / r * ((1 - k) * np.sin(t) + np.sin(3 * t))
              - 2 * a**3 / r**3 * np.sin(3 * t))  # fmt: skip
    return np.stack([ux, uy, 0 * ux], axis=1)


def test_thick_tube():
    """Hoop and radial stress under inner pressure, after Lame (1852)."""
    a, b, pressure = 0.05, 0.1, 1e8
    mesh, sets = brick(np.linspace(a, b, 17), np.linspace(0, np.pi / 2, 17), [0.0, 1e-3], bent=ring)
    planes = [("y_min", "y"), ("y_max", "x"), ("z_min", "z"), ("z_max", "z")]
    u = pressure * displaced(mesh, sets, planes, Pressure("x_min"))
    radial, hoop, _ = polar(nodal_stress(mesh, STEEL, u).tensor, mesh.doflocs.T)
    r = np.hypot(*mesh.doflocs[:2])
    scale = pressure * a**2 / (b**2 - a**2)
    np.testing.assert_allclose(hoop, scale * (1 + b**2 / r**2), atol=5e-3 * hoop.max())
    np.testing.assert_allclose(radial, scale * (1 - b**2 / r**2), atol=1e-2 * hoop.max())


@pytest.mark.parametrize("bore", [0.02, 1e-6])
def test_rotating_disk(bore):
    """A thin disk that spins, with a bore and, but for a pinhole, without (Timoshenko and Goodier, section 32)."""
    b, speed, nu = 0.1, 2000.0, STEEL.nu
    grading = np.linspace(0, 1, 25) ** 2 * (b - bore) + bore
    axes = (grading, np.linspace(0, np.pi / 2, 13), [0.0, 2e-3])
    mesh, sets = brick(*axes, bent=ring)
    u = speed**2 * displaced(mesh, sets, [("y_min", "y"), ("y_max", "x"), ("z_min", "z")], Centrifugal((0, 0, 1)))
    radial, hoop, _ = polar(nodal_stress(mesh, STEEL, u).tensor, mesh.doflocs.T)
    r = np.hypot(*mesh.doflocs[:2])
    c = STEEL.rho * speed**2 / 8
    expected = (
        c * (3 + nu) * (b**2 + bore**2 - bore**2 * b**2 / r**2 - r**2),
        c * ((3 + nu) * (b**2 + bore**2 + bore**2 * b**2 / r**2) - (1 + 3 * nu) * r**2),
    )
    outer = r > 2 * bore if bore < 1e-3 else r > 0
    outer &= r > 0.1 * b
    for values, exact in zip((radial, hoop), expected, strict=True):
        np.testing.assert_allclose(values[outer], exact[outer], atol=5e-3 * expected[1][outer].max())


def test_heated_bar_between_walls():
    """-E alpha T along a bar that cannot expand, and no stress where it can."""
    mesh, sets = brick(np.linspace(0, 1, 5), [0, 0.2], [0, 0.2])
    heat = np.full(mesh.doflocs.shape[1], 50.0)
    sides = [("y_min", "y"), ("z_min", "z"), ("x_min", "x")]
    for walls, expected in ((["x_max"], -STEEL.E * STEEL.expansion * 50.0), ([], 0.0)):
        clamped = [*sides, *((wall, "x") for wall in walls)]
        u = displaced(mesh, sets, clamped, Heating(STEEL, values=heat))
        tensor = nodal_stress(mesh, STEEL, u, heat).tensor
        np.testing.assert_allclose(tensor[:, 0], expected, rtol=1e-8, atol=1e-2)
        np.testing.assert_allclose(tensor[:, 1:], 0.0, atol=1e-2)


def test_materials_of_a_body_are_not_averaged():
    """Two materials in series under one pull have one stress, and each its own in parallel."""
    mesh, _ = brick(np.linspace(0, 2, 5), [0, 0.5], [0, 0.5])
    halves = {"left": lambda x: x[0] < 1, "right": lambda x: x[0] > 1}
    mesh = mesh.with_subdomains(halves)
    soft = Material(E=STEEL.E / 4, nu=0.0, rho=1.0)
    stiff = Material(E=STEEL.E, nu=0.0, rho=1.0)
    u = 1e-3 * mesh.doflocs.T * [1.0, 0, 0]
    result = nodal_stress(mesh, {"left": soft, "right": stiff}, u)
    for number, material in enumerate((soft, stiff)):
        np.testing.assert_allclose(result.tensor[result.material == number, 0], 1e-3 * material.E, rtol=1e-9)
    assert len(result.node) > mesh.doflocs.shape[1]  # nodes between them stand there twice


@pytest.fixture(scope="module")
def half_plane():
    """Nodes of a plane-strain half-plane, fine at x = 0 and -1, and its stress under a pressure and a shear of x."""
    fine, ends = np.geomspace(1e-4, 0.5, 12), np.geomspace(1.0, 400.0, 16)
    x = np.concatenate([-ends - 0.6, [-1], -1 - fine, -1 + fine, np.linspace(-0.4, 1, 15), ends])
    x = np.unique(np.round(x, 9))
    z = [0, *np.geomspace(3e-4, 0.1, 7), *np.linspace(0.15, 1.2, 22), *np.geomspace(1.5, 400.0, 13)]
    mesh, sets = brick(x, [0.0, 1.0], -np.array(z)[::-1])
    fixed = np.zeros((mesh.doflocs.shape[1], 3), bool)
    fixed[sets["z_min"]], fixed[:, 1] = True, True
    free, points = np.flatnonzero(~fixed.ravel()), mesh.doflocs.T
    factor = factorise(assemble(mesh, STEEL)[1][free][:, free])
    at, weight = np.polynomial.legendre.leggauss(60)
    at, weight = np.sin(np.pi / 2 * at), weight * np.pi / 2 * np.cos(np.pi / 2 * at)  # for roots at the ends
    shapes = (at * (at - 1) / 2, 1 - at**2, at * (at + 1) / 2)

    def stress(pressure, shear):
        force = np.zeros_like(points)
        for left, right in pairwise(x):
            s, half = (left + right) / 2 + (right - left) / 2 * at, (right - left) / 2 * weight
            for N, place in zip(shapes, (left, (left + right) / 2, right), strict=True):
                nodes = np.flatnonzero((np.abs(points[:, 0] - place) < 1e-9) & (points[:, 2] > -1e-9))
                share = np.where(points[nodes, 1] == 0.5, 4, 1)[:, None] / 6
                force[nodes] += share * [half @ (N * shear(s)), 0.0, -half @ (N * pressure(s))]
        u = np.zeros(points.size)
        u[free] = factor.solve(force.ravel()[free])
        return nodal_stress(mesh, STEEL, u.reshape(-1, 3)).tensor

    return points, stress


def ellipse(half, height):
    return lambda x: height * np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0))


@pytest.mark.parametrize("stick", [0.0, 0.5])
def test_contact_of_two_cylinders(stick, half_plane):
    """Largest shear 0.300 p0 at 0.786 half-widths below (Hertz; Johnson, Contact Mechanics, 1985, 4.49), and tension
    2 mu p0 sqrt(1 - c2 / a2) at the trailing edge, c = 0 in sliding (Cattaneo 1938, Mindlin 1949; Johnson, 7.2)."""
    points, stress = half_plane
    sliding, core = ellipse(1.0, 5e7), ellipse(stick or 1.0, 5e7 * stick)
    tensor = stress(ellipse(1.0, 1e8), lambda x: sliding(x) - core(x))
    sheared = stress(lambda x: 0 * x, lambda x: sliding(x) - core(x))
    edges = np.flatnonzero((np.abs(np.abs(points[:, 0]) - 1) < 1e-9) & (points[:, 2] > -1e-9))
    cycle = np.stack([tensor - sheared, sheared, 0 * sheared], axis=-1)[edges]  # pressed, and sheared to and fro
    S = np.linalg.inv(STEEL.tensor(points[edges])[:, ROWS, COLUMNS][:, :, ROWS, COLUMNS])
    tension, watson = face_indicators(cycle, np.tile(np.eye(3), (len(edges), 1, 1)), S, HarmonicBasis((0, 1), 64))
    exact = 2 * 5e7 * np.sqrt(1 - stick**2)
    assert tension.max() == pytest.approx(exact, rel=0.03)
    assert watson.max() == pytest.approx(exact**2 * (1 - STEEL.nu**2) / STEEL.E, rel=0.06)
    axis = np.flatnonzero((np.abs(points[:, 0]) < 1e-9) & (points[:, 1] == 0))
    shear = np.abs(tensor[axis, 0] - tensor[axis, 2]) / 2  # of an odd shear zero on the axis
    assert shear.max() == pytest.approx(0.300 * 1e8, rel=0.01)
    assert -points[axis[shear.argmax()], 2] == pytest.approx(0.786, abs=0.03)
