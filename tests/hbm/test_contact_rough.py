"""Rough contact: one asperity against Hertz, Mindlin and Cattaneo, a face against its sum, cycles against marching."""

import numpy as np
import pytest

from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.asperity import asperity, heights, pressure
from tribodyn.hbm.contact.bed_table import bed_springs
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.laws import rough
from tribodyn.hbm.harmonics import HarmonicBasis

YOUNG, POISSON, RADIUS, MU = 192.31e9, 0.3, 1.36493e-3, 0.3
E_STAR, G = YOUNG / (2 * (1 - POISSON**2)), YOUNG / (2 * (1 + POISSON))
STEEL = {"young": YOUNG, "poisson": POISSON, "radius": RADIUS, "yield_stress": 331.7e6, "tangent_modulus": 620e6}
ALL = ("t1", "t2", "n")
HEIGHTS = np.linspace(0, 28e-6, 101)
FACE = np.column_stack([HEIGHTS, 1.4e6 * np.exp(-0.5 * ((HEIGHTS - 14e-6) / 4e-6) ** 2) / (4e-6 * np.sqrt(2 * np.pi))])


def moving(n_pair: int, n_comp: int, basis: HarmonicBasis, seed: int) -> np.ndarray:
    """Displacements that deepen the contact, slip in part, and nearly open it."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n_pair, n_comp, basis.n_coeff)) * 10 ** rng.uniform(-9, -6.3, (n_pair, 1, 1))
    x[:, -1, 0] = rng.uniform(6e-6, 9e-6, n_pair)
    return x


def one_asperity(**numbers: float) -> ContactParameters:
    inputs = {"friction": MU, "young": YOUNG, "poisson": POISSON, "radius": RADIUS, "deepest": 2e-6, **numbers}
    return contact_law.complete("rough", ContactParameters.of(ALL, np.ones((1, 3)), table=[[0.0, 1.0]], **inputs))


def face(n_pair: int = 1, components: tuple[str, ...] = ALL, friction: float = 0.03) -> ContactParameters:
    springs = np.ones((n_pair, len(components)))
    built = ContactParameters.of(components, springs, table=FACE, friction=friction, area=2e-6, **STEEL)
    return contact_law.complete("rough", built)


def pressed(parameters: ContactParameters, deepest: float) -> tuple[np.ndarray, np.ndarray]:
    """Springs and their touch of the first pair."""
    k, g, _, _ = bed_springs(parameters.packed()[:1], np.array([deepest]))
    return k[0], g[0]


@pytest.mark.parametrize("d", [1e-9, 3.3e-8, 7e-7, 1.99e-6])
def test_one_elastic_asperity_is_hertz(d):
    k, g = pressed(one_asperity(), d)
    assert (k * (d - g)).sum() == pytest.approx(4 / 3 * E_STAR * np.sqrt(RADIUS) * d**1.5, rel=1e-12)
    assert k.sum() == pytest.approx(2 * E_STAR * np.sqrt(RADIUS * d), rel=1e-4)


def test_its_partial_slip_is_that_of_cattaneo_and_mindlin():
    """Johnson 1985, eq. 7.42: delta = 3 mu N (2 - nu) / (8 a G) (1 - (1 - Q / mu N)^(2/3)) for two bodies alike."""
    d = 5e-7
    k, g = pressed(one_asperity(), d)
    a, N = np.sqrt(RADIUS * d), 4 / 3 * E_STAR * np.sqrt(RADIUS) * d**1.5
    Q = MU * N * np.linspace(0.02, 0.98, 13)
    delta = 3 * MU * N * (2 - POISSON) / (8 * a * G) * (1 - (1 - Q / (MU * N)) ** (2 / 3))
    kt = rough.tangential_ratio(POISSON) * k
    total = np.minimum(np.outer(delta, kt), MU * k * (d - g)).sum(axis=1)
    assert np.abs(total - Q).max() < 1e-3 * MU * N
    assert kt.sum() == pytest.approx(4 * a * G / (2 - POISSON), rel=1e-4)


def test_a_loop_loses_what_mindlin_and_deresiewicz_found():
    """Energy per cycle at amplitude Q* of a constant N: Johnson 1985, eq. 7.57."""
    d = 5e-7
    a, N = np.sqrt(RADIUS * d), 4 / 3 * E_STAR * np.sqrt(RADIUS) * d**1.5
    q = 0.6
    amplitude = 3 * MU * N * (2 - POISSON) / (8 * a * G) * (1 - (1 - q) ** (2 / 3))
    # 9 mu^2 N^2 / (10 a) ((2 - nu) / G) {1 - (1 - q)^(5/3) - 5 q / 6 (1 + (1 - q)^(2/3))} for two bodies alike
    bracket = 1 - (1 - q) ** (5 / 3) - 5 * q / 6 * (1 + (1 - q) ** (2 / 3))
    lost = 9 * (MU * N) ** 2 / (10 * a) * 2 * (2 - POISSON) / G * bracket
    parameters, basis = one_asperity(), HarmonicBasis((0, 1), 128, "located")
    x = np.zeros((1, 3, 3))
    x[0, 2, 0], x[0, 0, 1] = d, amplitude
    memory = rough.memory_at_rest(np.array([[0.0, 0.0, d]]), parameters)
    cycle = aft.cycle(rough, x, parameters, basis, memory)
    assert float(basis.work_per_cycle(cycle.force[0, 0], x[0, 0])) == pytest.approx(lost, rel=5e-3)
    assert cycle.status[0] == STICKS | SLIPS


def test_beyond_yield_the_loading_is_continuous_and_unloading_keeps_a_plastic_depth():
    item = asperity((YOUNG, POISSON, RADIUS, 331.7e6, 620e6))
    nearby = item.onset * np.array([1 - 1e-9, 1 + 1e-9])
    assert np.ptp(item.loading(nearby)) < 1e-7 * item.loading(nearby)[0]
    d = np.geomspace(1.01, 60, 200) * item.onset
    assert (np.diff(item.loading(d)) > 0).all()
    assert (item.loading(d) < item.hertz(d)).all()
    depth, root = item.flattened(d)
    assert (np.diff(depth) > 0).all()  # and the unloading curve meets the loading one where it begins
    np.testing.assert_allclose(4 / 3 * E_STAR * root * (d - depth) ** 1.5, item.loading(d), rtol=1e-12)


@pytest.mark.parametrize("tangent", [0.0, 620e6, 0.05 * YOUNG])
def test_beyond_yield_two_spheres_are_twice_one_sphere_on_a_rigid_flat(tangent):
    """Ghaednia et al. 2019, eq. 5, 6 and 23 to 30, for one sphere: twice the radius and E*, half the approach."""
    S, ratio, C = 331.7e6, tangent / YOUNG, 1.295 * np.exp(0.736 * POISSON)
    R, E = 2 * RADIUS, YOUNG / (1 - POISSON**2)
    critical = (np.pi * C * S / (2 * E)) ** 2 * R
    w = np.append(1.9 * (1 + 1e-9), np.geomspace(2, 200, 30))
    delta = w * critical
    a_e, a_p = np.sqrt(R * delta), R * np.pi * C * S / (2 * E) * np.sqrt(w * (w / 1.9) ** (0.14 * np.exp(23 * S / E)))
    softer = 2 * np.sqrt(1 / (S / YOUNG)) * ratio ** (1 - (delta - critical) / R)
    softer /= (4 - 3 * np.exp(-2 * np.sqrt(YOUNG / S) * ratio)) * (1 - ratio)
    hardness = 2.84 - 0.92 * (1 - np.cos(np.pi * (a_e + (a_p - a_e) * np.exp(-softer)) / R))
    plastic = np.exp(-0.25 * w ** (5 / 12)) * w**1.5 + 4 * hardness / C * (1 - np.exp(-0.04 * w ** (5 / 9))) * w
    plastic *= 4 / 3 * (R / E) ** 2 * (C * np.pi * S / 2) ** 3
    reference = plastic + (4 / 3 * E * np.sqrt(R) * delta**1.5 - plastic) * (1 - np.exp(-3.3 * ratio))
    item = asperity((YOUNG, POISSON, RADIUS, S, tangent))
    assert item.onset == pytest.approx(2 * 1.9 * critical)
    off = item.loading(2 * delta) / reference - 1
    assert np.abs(off).max() < 6e-3  # the jump that is taken off
    assert np.abs(off[w > 20]).max() < 1e-8


def test_a_face_is_the_sum_of_its_asperities_on_loading_and_unloading():
    item, rows = asperity(tuple(STEEL.values())), heights(FACE)
    for deepest in (4e-6, 9e-6, 14e-6):
        k, g = pressed(face(), deepest)
        loading = rows[:, 1] @ item.loading(np.maximum(deepest - rows[:, 0], 0.0))
        assert (k * (deepest - g)).sum() == pytest.approx(2e-6 * loading, rel=3e-5)
        u = deepest - (deepest - g[-1]) * np.array([0.02, 0.1, 0.3, 0.6])
        unloading = 2e-6 * pressure(item, rows, u, deepest)
        total = (k * np.maximum(u[:, None] - g, 0.0)).sum(axis=1)
        np.testing.assert_allclose(total, unloading, atol=1e-3 * unloading[0])
        assert (k >= 0).all()


@pytest.mark.parametrize("components", rough.COMPONENTS, ids="".join)
def test_the_cycle_is_the_one_that_marching_reaches(components):
    basis, n_pair = HarmonicBasis((0, 1, 2), 48), 6
    parameters = face(n_pair, components)
    x = moving(n_pair, len(components), basis, 1)
    values = np.zeros((n_pair, len(components)))
    values[:, -1] = 8e-6
    memory = rough.memory_at_rest(values, parameters)
    fast = aft.cycle(rough, x, parameters, basis, memory)
    slow = aft.march(rough, x, parameters, memory, basis)
    np.testing.assert_allclose(fast.force, slow.force, atol=1e-12 * np.abs(fast.force).max())
    size = np.abs(fast.jacobian).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(fast.jacobian / size, slow.jacobian / size, atol=1e-11)
    assert (fast.status & SLIPS).any()


@pytest.mark.parametrize("deepest", [7e-6, 1.2e-5])
def test_the_located_jacobian_equals_differences(deepest):
    """Whether the cycle deepens the contact, and so moves its bed, or not."""
    basis, n_pair = HarmonicBasis((0, 1, 2), 48, "located"), 8
    parameters = face(n_pair)
    x = moving(n_pair, 3, basis, 2)
    memory = rough.memory_at_rest(np.tile([0.0, 0.0, deepest], (n_pair, 1)), parameters)
    jac = aft.cycle(rough, x, parameters, basis, memory).jacobian
    size = np.abs(jac).max(axis=(1, 2))
    for column in range(15):
        h = np.zeros((3, 5))
        h.flat[column] = 1e-12
        ahead, previous = (aft.cycle(rough, x + s * h, parameters, basis, memory, False).force for s in (1, -1))
        slope = (ahead - previous).reshape(n_pair, -1) / 2e-12
        assert np.abs(slope - jac[:, :, column]).max(axis=1) == pytest.approx(np.zeros(n_pair), abs=2e-5 * size.max())


def test_the_memory_and_its_slopes_are_those_of_a_step():
    parameters = face()
    p = parameters.packed()[0]
    state = rough.memory_at_rest(np.array([[1e-8, -2e-8, 9e-6]]), parameters)[0]
    for x in ([3e-8, 2e-8, 8.9e-6], [1e-6, -1e-8, 9.1e-6]):

        def advance(z):
            s, f = z[3:].copy(), np.zeros(3)
            slopes = [np.zeros((a, b)) for a in (3, len(s)) for b in (3, len(s))]
            rough.step(z[:3].copy(), s, p, f, *slopes)
            return np.concatenate([f, s]), np.block([[slopes[0], slopes[1]], [slopes[2], slopes[3]]])

        z = np.concatenate([x, state])
        _, slope = advance(z)
        for column in (0, 1, 2, 3, 5, 30, 60):
            h = np.zeros(len(z))
            h[column] = 2e-13
            difference = (advance(z + h)[0] - advance(z - h)[0]) / 4e-13
            scale = np.abs(slope[:3]).max()
            assert np.abs(difference - slope[:, column])[:3].max() < 1e-6 * scale
            assert np.abs(difference - slope[:, column])[3:].max() < 1e-4


def test_a_pair_beyond_its_gap_is_open_and_the_contact_at_rest_has_no_shear():
    parameters, basis = face(2), HarmonicBasis((0, 1), 32)
    x = np.zeros((2, 3, 3))
    x[:, :2, 0], x[0, 2, 0], x[1, 2, 0] = 3e-7, -1e-6, 9e-6
    memory = rough.memory_at_rest(x[:, :, 0], parameters)
    cycle = aft.cycle(rough, x, parameters, basis, memory)
    assert cycle.status[0] == SEPARATES
    assert not cycle.force[0].any()
    assert np.abs(cycle.force[1, :2]).max() < 1e-12 * cycle.force[1, 2, 0]


def test_the_springs_at_a_pressure_carry_it():
    built = ContactParameters.of(ALL, np.ones((1, 3)), table=FACE, friction=0.03, area=2e-6, pressure=5e6, **STEEL)
    parameters = contact_law.complete("rough", built)
    kt, _, kn = rough.springs(parameters)[0]
    deepest = np.linspace(5e-6, 2e-5, 4000)
    p = parameters.packed().repeat(len(deepest), axis=0)
    k, g, _, _ = bed_springs(p, deepest)
    at = np.searchsorted((k * (deepest[:, None] - g)).sum(axis=1), 5e6 * 2e-6)
    assert kn == pytest.approx(k[at].sum(), rel=2e-3)
    assert kt == pytest.approx(rough.tangential_ratio(POISSON) * kn)


def test_a_law_without_its_table_or_with_a_wrong_one_is_one_sentence():
    built = ContactParameters.of(ALL, np.ones((1, 3)), friction=0.03, **STEEL)
    with pytest.raises(ValueError, match="needs its table of asperities: columns gap in m and"):
        contact_law.complete("rough", built)
    for table, words in (([[0.0, 1.0, 2.0]], "two columns"), ([[1e-6, 1.0], [0.0, 1.0]], "must rise")):
        wrong = ContactParameters.of(ALL, np.ones((1, 3)), table=np.array(table), friction=0.03, **STEEL)
        with pytest.raises(ValueError, match=words):
            contact_law.complete("rough", wrong)
    with pytest.raises(ValueError, match="takes no table"):
        contact_law.complete("jenkins", ContactParameters.of(ALL, np.ones((1, 3)), table=FACE, friction=0.1))
