"""Contact stiffness against closed forms, numerical integration and boundary elements written here on their own."""

from itertools import pairwise
from math import inf, log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

from tests.helpers.hertz import SphereContact
from tests.helpers.rounded_punch import RoundedPunch
from tribodyn.hbm.contact.stiffness import ElasticPair, rectangular_punch

STEEL = (210e9, 0.3, 210e9, 0.3)
MIXED = ElasticPair(210e9, 0.3, 70e9, 0.33)
PUNCH = RoundedPunch(2e-3, 5e-3, MIXED)
LINE_LOAD = 1.2e6


# ---- sphere ----


def test_sphere_approach_and_stiffness_belong_together():
    contact, load, step = SphereContact(12e-3, MIXED), 80.0, 1e-3
    slope = (contact.approach(load + step) - contact.approach(load - step)) / (2 * step)
    k_n, _ = contact.stiffness(load)
    assert k_n * slope == pytest.approx(1, rel=1e-6)
    # P = 4/3 E* sqrt(R) delta^(3/2)
    assert 4 / 3 * MIXED.modulus * sqrt(12e-3) * contact.approach(load) ** 1.5 == pytest.approx(load, rel=1e-12)
    radius = contact.contact_radius(load)
    volume = quad(lambda r: 2 * pi * r * contact.peak_pressure(load) * sqrt(1 - (r / radius) ** 2), 0, radius)[0]
    assert volume == pytest.approx(load, rel=1e-8)


def test_mindlin_ratio_and_partial_slip_by_superposition():
    contact, load, friction = SphereContact(12e-3, ElasticPair(*STEEL)), 80.0, 0.4
    k_n, k_t = contact.stiffness(load)
    assert k_t / k_n == pytest.approx(2 * (1 - 0.3) / (2 - 0.3), rel=1e-12)
    shear = 0.7 * friction * load
    # Jaeger: the sum of mu dP / k_t(P) over the load that Q uses up
    summed = quad(lambda p: friction / contact.stiffness(p)[1], load - shear / friction, load)[0]
    assert contact.shear_displacement(load, shear, friction) == pytest.approx(summed, rel=1e-9)
    assert contact.shear_displacement(load, 1e-6, friction) * k_t == pytest.approx(1e-6, rel=1e-6)
    assert contact.stick_radius(load, friction * load, friction) == 0


# ---- plane punch ----


def test_cylinder_is_the_limit_without_a_flat():
    cylinder, depth = RoundedPunch(0.0, 5e-3, MIXED), 50e-3
    b = cylinder.half_contact(LINE_LOAD)
    assert b**2 == pytest.approx(4 * LINE_LOAD * 5e-3 / (pi * MIXED.modulus), rel=1e-12)
    x = np.linspace(-b, b, 41)[1:-1]
    np.testing.assert_allclose(
        cylinder.pressure(x, LINE_LOAD), 2 * LINE_LOAD / (pi * b) * np.sqrt(1 - (x / b) ** 2), rtol=1e-10
    )
    # Johnson 1985, eq. 5.57, summed over the bodies
    closed = sum((1 - v**2) / (pi * e) * (2 * log(2 * depth / b) - v / (1 - v)) for e, v in MIXED.bodies) * LINE_LOAD
    assert cylinder.approach(LINE_LOAD, depth) == pytest.approx(closed, rel=1e-8)
    assert RoundedPunch(1e-9, 5e-3, MIXED).half_contact(LINE_LOAD) == pytest.approx(b, rel=1e-5)


@pytest.mark.parametrize("load", [1e-3, 1e2, 1e5, 1e7, 1e10])
def test_contact_width_satisfies_ciavarella(load):
    b = PUNCH.half_contact(load)
    assert PUNCH.load(b) == pytest.approx(load, rel=1e-3 if load < 1 else 1e-8)  # b - a is 1e-8 a at the smallest load
    if load > 1e4:
        p0 = np.arcsin(2e-3 / b)
        remaining = 2 * load * 5e-3 / (MIXED.modulus * 2e-3**2)
        assert (pi - 2 * p0) / (2 * np.sin(p0) ** 2) - 1 / np.tan(p0) == pytest.approx(remaining, rel=1e-9)


def test_pressure_carries_the_load_and_is_a_sum_of_flat_punches():
    a, b = PUNCH.half_width, PUNCH.half_contact(LINE_LOAD)
    carried = 2 * sum(quad(PUNCH.pressure, *ends, args=(LINE_LOAD,), epsrel=1e-10)[0] for ends in ((0, a), (a, b)))
    assert carried == pytest.approx(LINE_LOAD, rel=1e-8)
    for x in (0.0, 0.5 * a, 0.5 * (a + b)):
        low = max(a, x)
        # b' = x / sin takes the root away
        flat = quad(
            lambda r, x=x: MIXED.modulus / (pi * PUNCH.edge_radius) * np.arccos(a / np.hypot(x, r)),
            sqrt(low**2 - x**2),
            sqrt(b**2 - x**2),
        )[0]
        assert PUNCH.pressure(x, LINE_LOAD) == pytest.approx(flat, rel=1e-8)
    assert np.isfinite(PUNCH.pressure(np.array([-a, a]), LINE_LOAD)).all()
    assert PUNCH.pressure(1.01 * b, LINE_LOAD) == 0


def test_pressure_bends_the_half_plane_to_the_shape_of_the_punch():
    a, b = PUNCH.half_width, PUNCH.half_contact(LINE_LOAD)
    angle = (np.arange(4000) + 0.5) / 4000 * pi
    edge = -b * np.cos(np.arange(4001) / 4000 * pi)
    force = PUNCH.pressure(-b * np.cos(angle), LINE_LOAD) * np.diff(edge)

    def sinks(x):  # u(x) = -2/(pi E*) int p ln|x - s| ds, each strip in closed form
        t0, t1 = x - edge[:-1], x - edge[1:]
        mean_log = (t0 * np.log(abs(t0)) - t1 * np.log(abs(t1))) / np.diff(edge) - 1
        return -2 / (pi * MIXED.modulus) * (force @ mean_log)

    for x in (0.4 * a, 0.9 * a, a + 0.5 * (b - a), a + 0.9 * (b - a)):
        shape = max(x - a, 0) ** 2 / (2 * PUNCH.edge_radius)
        deepest = (b - a) ** 2 / (2 * PUNCH.edge_radius)
        assert sinks(0.0) - sinks(x) == pytest.approx(shape, abs=2e-4 * deepest)


def test_partial_slip_traction_and_displacement():
    friction, depth = 0.5, 30e-3
    shear = 0.6 * friction * LINE_LOAD
    b, c = PUNCH.half_contact(LINE_LOAD), PUNCH.stick_half_width(LINE_LOAD, shear, friction)
    assert PUNCH.half_width < c < b
    edges = (0, PUNCH.half_width, c, b)
    total = 2 * sum(
        quad(PUNCH.shear_traction, low, high, args=(LINE_LOAD, shear, friction))[0] for low, high in pairwise(edges)
    )
    assert total == pytest.approx(shear, rel=1e-6)
    slipping = np.linspace(1.001 * c, 0.999 * b, 9)
    traction = PUNCH.shear_traction(slipping, LINE_LOAD, shear, friction)
    np.testing.assert_allclose(traction, friction * PUNCH.pressure(slipping, LINE_LOAD), rtol=1e-12)
    x = np.linspace(-c, c, 50)
    assert (PUNCH.shear_traction(x, LINE_LOAD, shear, friction) <= friction * PUNCH.pressure(x, LINE_LOAD)).all()
    _, k_t = PUNCH.stiffness(LINE_LOAD, depth)
    assert PUNCH.shear_displacement(LINE_LOAD, 1.0, friction, depth) * k_t == pytest.approx(1.0, rel=1e-5)
    assert PUNCH.shear_displacement(LINE_LOAD, shear, friction, depth) > shear / k_t  # slip softens


def test_plane_stiffness_is_the_slope_of_the_approach():
    depth, step = 30e-3, 10.0
    k_n, _ = PUNCH.stiffness(LINE_LOAD, depth)
    rise = PUNCH.approach(LINE_LOAD + step, depth) - PUNCH.approach(LINE_LOAD - step, depth)
    assert rise * k_n == pytest.approx(2 * step, rel=1e-5)
    sharp = RoundedPunch(2e-3, 0.0, MIXED)
    assert sharp.approach(LINE_LOAD, depth) * sharp.stiffness(LINE_LOAD, depth)[0] == pytest.approx(LINE_LOAD)
    assert 2 * quad(sharp.pressure, 0, 2e-3, args=(LINE_LOAD,))[0] == pytest.approx(LINE_LOAD, rel=1e-6)


# ---- rectangle ----


def test_square_punch_is_the_electric_capacity_of_a_square_plate():
    # Read, J. Comput. Phys. 133 (1997) 1-5: capacity of the unit square 0.3667896
    k_n, _ = rectangular_punch(1.0, 1.0, 1.0, 0.0, inf, 0.0)
    assert k_n == pytest.approx(pi * 0.3667896, rel=3e-4)
    assert k_n > pi / (4 * log(2))  # any assumed traction, here a product of edge roots, gives a bound from below


@pytest.mark.parametrize("ratio", [1.0, 2.5, 5.0])
def test_rectangle_against_published_fits(ratio):
    # Dobry and Gazetas, J. Geotech. Eng. 112 (1986) 109-135, rigid footings, good to some per cent
    nu, shear_modulus, long, chi = 0.3, 1.0, ratio / 2, 1 / ratio
    pair = (2 * shear_modulus * (1 + nu), nu, inf, 0.0)
    k_n, k_across = rectangular_punch(1.0, ratio, *pair)
    _, k_along = rectangular_punch(ratio, 1.0, *pair)
    fit_n = 2 * shear_modulus * long / (1 - nu) * (0.73 + 1.54 * chi**0.75)
    fit_across = 2 * shear_modulus * long / (2 - nu) * (2 + 2.5 * chi**0.85)
    fit_along = fit_across - 0.2 / (0.75 - nu) * shear_modulus * long * (1 - chi)
    assert (k_n, k_across, k_along) == pytest.approx((fit_n, fit_across, fit_along), rel=0.07)


@pytest.mark.parametrize(("ratio", "within"), [(1e4, 1e-3), (1e6, 5e-4), (1e9, 3e-4)])
def test_a_long_strip_is_the_slender_conductor(ratio, within):
    """Capacity of a slender body, L / 2 (1/W + (1 - pi^2/12) / W^3), W = ln(4 L/w) + ln 2 - 1, a strip of width w as a
    wire of radius w/4 (Jackson, Am. J. Phys. 68 (2000) 789-799)."""
    W = log(4 * ratio) + log(2) - 1
    capacity = ratio / 2 * (1 / W + (1 - pi**2 / 12) / W**3)
    k_n, path = rectangular_punch(ratio, 1.0, 1.0, 0.3, inf, 0.0)
    _, across = rectangular_punch(1.0, ratio, 1.0, 0.3, inf, 0.0)
    assert k_n * (1 - 0.3**2) == pytest.approx(pi * capacity, rel=within)
    assert path < across < k_n
    # far from its ends a strip under shear across it is a plane problem, as stiff as under pressure; along it is softer
    assert across == pytest.approx(k_n, rel=3 / W)


def _love(x, y):
    r = np.hypot(x, y)
    return x * np.log(y + r) + y * np.log(x + r)


def _cells(edge_x, edge_y, primitive):
    """Influence of uniform rectangles on all midpoints, from the double primitive of a kernel."""
    x, y = (edge_x[1:] + edge_x[:-1]) / 2, (edge_y[1:] + edge_y[:-1]) / 2
    at = primitive((x[:, None] - edge_x)[:, None, :, None], (y[:, None] - edge_y)[None, :, None, :])
    cells = at[..., :-1, :-1] - at[..., 1:, :-1] - at[..., :-1, 1:] + at[..., 1:, 1:]
    return cells.reshape(len(x) * len(y), -1)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.0, 2.5)])
def test_rectangle_against_boundary_elements_with_both_shear_components(a, b):
    """Uniform cells over the whole patch, u_x = 1 and u_y = 0 imposed, three meshes extrapolated to none."""
    nu = 0.3

    def along(x, y):
        r = np.hypot(x, y)
        return (1 - nu) * x * np.log(y + r) + y * np.log(x + r)

    normal, shear = [], []
    sizes = (8, 16, 24)
    for n in sizes:
        x, y = np.linspace(0, a, n + 1), np.linspace(0, b, int(n * b / a) + 1)
        cell, count = (x[1] - x[0]) * (y[1] - y[0]), (len(x) - 1) * (len(y) - 1)
        normal.append(np.linalg.solve(_cells(x, y, _love), np.ones(count)).sum() * cell * pi)
        across = _cells(x, y, lambda u, v: along(v, u))
        cross = _cells(x, y, lambda u, v: -nu * np.hypot(u, v))
        two_results = np.block([[_cells(x, y, along), cross], [cross, across]])
        pull = np.linalg.solve(two_results, np.concatenate([np.ones(count), np.zeros(count)]))
        shear.append(pull[:count].sum() * cell * pi / (1 + nu))
    # the error of uniform cells at the edge singularity falls with h, then h^2
    limits = [np.polyfit(1 / np.array(sizes), values, 2)[-1] for values in (normal, shear)]
    k_n, _ = rectangular_punch(a, b, 1.0, 0.0, inf, 0.0)
    _, k_t = rectangular_punch(a, b, 1.0, nu, inf, 0.0)
    assert k_n == pytest.approx(limits[0], rel=3e-3)
    assert k_t == pytest.approx(limits[1], rel=3e-3)


@pytest.mark.parametrize(("radius", "depth", "within"), [(2.0, 0.005, 0.02), (2.0, 0.02, 0.03)])
def test_rounded_rectangle_against_unilateral_boundary_elements(radius, depth, within):
    """Pressure of a punch with four round edges by an active set; its slope dP/d(depth) is the tangent stiffness."""
    n, half, reach = 22, 0.5, 0.75  # cells of one quarter
    edge = np.linspace(-reach, reach, 2 * n + 1)
    middle = (edge[1:] + edge[:-1])[n:] / 2
    rows = _cells(edge, edge, _love).reshape((2 * n,) * 4)[n:, n:]
    rows = rows[:, :, n:] + rows[:, :, n - 1 :: -1]
    influence = (rows[..., n:] + rows[..., n - 1 :: -1]).reshape(n * n, n * n) / pi
    drop = np.clip(abs(middle) - half, 0, None) ** 2 / (2 * radius)
    gap = (drop[:, None] + drop).ravel()

    def load(sunk):
        active = gap < sunk
        for _ in range(40):
            pressure = np.zeros(n * n)
            pressure[active] = np.linalg.solve(influence[np.ix_(active, active)], sunk - gap[active])
            places = np.where(active, pressure > 0, influence @ pressure + gap < sunk)
            if (places == active).all():
                break
            active = places
        return 4 * pressure.sum() * (edge[1] - edge[0]) ** 2

    tangent = (load(1.05 * depth) - load(0.95 * depth)) / (0.1 * depth)
    k_n, _ = rectangular_punch(1.0, 1.0, 1.0, 0.0, inf, 0.0, edge_radius=radius, load=load(depth))
    flat, _ = rectangular_punch(1.0, 1.0, 1.0, 0.0, inf, 0.0)
    assert k_n > 1.1 * flat  # the rounding matters in this case
    assert k_n == pytest.approx(tangent, rel=within)


def test_extruded_plane_punch_needs_a_reference_depth():
    """The number in the docs: four half-widths under a square patch of steel; deeper is softer, without end."""
    k_n, _ = rectangular_punch(20e-3, 20e-3, *STEEL)
    plane = RoundedPunch(10e-3, 0.0, ElasticPair(*STEEL))
    assert plane.stiffness(1.0, 40e-3)[0] * 20e-3 == pytest.approx(k_n, rel=0.01)
    assert plane.stiffness(1.0, 47.5e-3)[0] * 20e-3 == pytest.approx(0.89 * k_n, rel=0.01)


def test_units_and_directions():
    k_n, k_t = rectangular_punch(2e-3, 5e-3, *STEEL)
    assert rectangular_punch(2e6, 5e6, 210, 0.3, 210, 0.3) == pytest.approx((k_n, k_t), rel=1e-9)
    swapped_n, swapped_t = rectangular_punch(5e-3, 2e-3, *STEEL)
    assert swapped_n == pytest.approx(k_n, rel=1e-9)
    assert swapped_t < k_t < k_n  # shear along the long side is the softer one
    assert rectangular_punch(2e-3, 5e-3, *STEEL, edge_radius=1e-3, load=1e-3) == pytest.approx((k_n, k_t), rel=1e-4)


@pytest.mark.parametrize(("sides", "published"), [((20e-3, 20e-3), 470 / 583), ((20e-3, 30e-3), 93 / 113)])
def test_ratio_beside_the_published_patches(sides, published):
    """Tamatam 2021, 4.2 and 4.3: the ratios agree; the published sizes are 4.6 and 29 times lower."""
    k_n, k_t = rectangular_punch(*sides, *STEEL)
    assert k_t / k_n == pytest.approx(published, rel=0.03)
    assert k_n > 2e9


@pytest.mark.parametrize(("call", "word"), [
    (lambda: rectangular_punch(0.0, 1e-3, *STEEL), "a is 0"),
    (lambda: rectangular_punch(1.0, 1e-10, *STEEL), "check their units"),
    (lambda: rectangular_punch(1e-3, 1e-3, 210e9, 0.6, 210e9, 0.3), "nu1"),
    (lambda: rectangular_punch(1e-3, 1e-3, inf, 0.3, inf, 0.3), "elastic"),
    (lambda: rectangular_punch(1e-3, 1e-3, *STEEL, edge_radius=1e-4), "give load"),
    (lambda: rectangular_punch(1e-3, 1e-3, *STEEL, edge_radius=-1.0), "edge_radius"),
    (lambda: PUNCH.stiffness(LINE_LOAD, 1e-3), "too shallow"),
    (lambda: PUNCH.shear_traction(0.0, 1.0, 0.6, 0.5), "slides"),
    (lambda: RoundedPunch(0.0, 0.0, MIXED), "no shape"),
    (lambda: PUNCH.half_contact(-1.0), "load"),
])  # fmt: skip
def test_bad_numbers_are_refused_in_one_sentence(call, word):
    with pytest.raises(ValueError, match=word) as refusal:
        call()
    assert "\n" not in str(refusal.value)
