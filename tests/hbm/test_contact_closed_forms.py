"""Contact laws against closed forms: Jenkins describing function, planar Coulomb on a circle, unilateral half sine."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers.contact_draws import HARMONICS
from tests.helpers.jenkins import describing_function
from tribodyn.hbm.contact import aft, contact_law, planar_cycle
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.law_check import draw
from tribodyn.hbm.harmonics import HarmonicBasis


@pytest.mark.parametrize("amplitude", [0.1, 0.999, 1.001, 1.5, 3.0, 40.0])
@pytest.mark.parametrize(("way", "n_samples", "tolerance"), [("located", 8, 1e-14), ("sampled", 4096, 3e-6)])
def test_jenkins_describing_function(amplitude, way, n_samples, tolerance):
    kt, mu, load = 2.0, 0.4, 5.0
    exact = describing_function(amplitude, kt, mu * load)
    basis = HarmonicBasis((0, 1), n_samples, way)
    x = np.array([[[0.0, amplitude, 0.0]]])
    constant = contact_law.load("jenkins_constant")
    cycle = aft.cycle(constant, x, ContactParameters.of(("t1",), [[kt]], friction=mu, normal_load=load), basis)
    assert cycle.force[0, 0] == pytest.approx([0.0, *exact], abs=tolerance * amplitude * kt)
    assert basis.work_per_cycle(cycle.force, x)[0, 0] == pytest.approx(
        4 * mu * load * max(0.0, amplitude - mu * load / kt), abs=10 * tolerance * amplitude * kt * amplitude
    )
    variable = contact_law.load("jenkins")
    x = np.concatenate([x, [[[load, 0.0, 0.0]]]], axis=1)
    cycle = aft.cycle(variable, x, ContactParameters.of(("t1", "n"), [[kt, 1.0]], friction=mu), basis)
    assert cycle.force[0, 0] == pytest.approx([0.0, *exact], abs=tolerance * amplitude * kt)
    assert cycle.status[0] == (STICKS if amplitude < 1 else STICKS | SLIPS)


def test_mean_shear_of_a_slipping_element_vanishes_and_of_a_stuck_one_is_that_of_its_path():
    law = contact_law.load("jenkins_constant")
    parameters = ContactParameters.of(("t1",), [[2.0], [2.0]], friction=0.4, normal_load=5.0)  # slips beyond 1 m
    basis = HarmonicBasis((0, 1), 64, "located")
    x = np.array([[[0.9, 0.3, 0.0]], [[0.9, 1.3, 0.0]]])
    force = aft.cycle(law, x, parameters, basis).force
    assert force[0, 0] == pytest.approx([2.0 * (1.0 - 0.3), 0.6, 0.0])  # the peak of the path touched the limit
    assert force[1, 0, 0] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("n_samples", [64, 256, 1024])
@pytest.mark.parametrize("ratio", [1.05, 1.5, 4.0, 100.0])
def test_planar_coulomb_on_a_circle(n_samples, ratio):
    """u = A (cos t, sin t), N constant, r = mu N / k < A: the slider runs on a circle of radius sqrt(A^2 - r^2).

    It lags by alpha with sin alpha = r / A, and T of size mu N is tangent to its circle, so
    T = mu N (-sin(t - alpha), cos(t - alpha)) and E = 2 pi A mu N sqrt(1 - r^2 / A^2). The implicit step gives the
    friction of the middle of a step to its end: for large A the phase is off by half a step, pi / n_samples, and by
    less with chords, which follow the slider from sample to sample exactly."""
    kt, mu, load = 2.0, 0.4, 5.0
    limit = mu * load
    amplitude = ratio * limit / kt
    alpha = np.arcsin(1 / ratio)
    basis = HarmonicBasis((0, 1), n_samples)
    x = np.array([[[0.0, amplitude, 0.0], [0.0, 0.0, amplitude], [load, 0.0, 0.0]]])
    law = contact_law.load("coulomb_planar")
    parameters = ContactParameters.of(("t1", "t2", "n"), [[kt, kt, 1.0]], friction=mu)
    cycle = aft.cycle(law, x, parameters, basis)
    exact = limit * np.array([[0.0, np.sin(alpha), -np.cos(alpha)], [0.0, np.cos(alpha), np.sin(alpha)]])
    # sin(t - alpha) = sin t cos alpha - cos t sin alpha
    bound = limit * (2 * np.pi / n_samples) * (1 + 2 / np.sqrt(ratio - 1))
    assert np.linalg.norm(cycle.force[0, :2] - exact) < bound
    assert np.linalg.norm(cycle.force[0, 0]) == pytest.approx(limit, rel=1e-12)
    assert cycle.status[0] == SLIPS
    energy = basis.work_per_cycle(cycle.force, x).sum()
    exact_energy = 2 * np.pi * amplitude * limit * np.cos(alpha)
    assert energy == pytest.approx(exact_energy, rel=2 * np.pi / n_samples * (2 * np.pi / n_samples + 2 / (ratio - 1)))


def test_planar_coulomb_on_a_circle_converges_with_the_samples():
    errors = []
    for n_samples in (128, 256, 512, 1024):
        basis = HarmonicBasis((0, 1), n_samples)
        x = np.array([[[0.0, 1.5, 0.0], [0.0, 0.0, 1.5], [5.0, 0.0, 0.0]]])
        parameters = ContactParameters.of(("t1", "t2", "n"), [[2.0, 2.0, 1.0]], friction=0.4)
        force = aft.cycle(contact_law.load("coulomb_planar"), x, parameters, basis).force[0, 0]
        alpha = np.arcsin(1 / 1.5)
        errors.append(np.linalg.norm(force - 2.0 * np.array([0, np.sin(alpha), -np.cos(alpha)])))
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert order == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("top", [1, 3])
def test_planar_coulomb_is_right_to_a_thousandth_at_128_samples(top):
    """Under turning friction, with stick, slip, lift and pairs that come to stick; against 16384 implicit steps.

    A sampled force has kinks, and that of unequal springs steps implicitly: see the law"""
    law, rng = contact_law.load("coulomb_planar"), np.random.default_rng(0)
    saved = tuple(range(top + 1))
    fine, typical = HarmonicBasis(saved, 2**14), HarmonicBasis(saved, 128)
    x = rng.normal(size=(24, 3, typical.n_coeff)) * 0.6 / np.maximum(typical.order, 1) ** 1.5
    x[:, 2] *= np.where(np.arange(24) % 3, 0.3, 1.5)[:, None]
    x[:, 2, 0], x[:12, :2, 0] = 1.0, 0.0
    x[:, :2, 1:] *= np.geomspace(0.2, 2.0, 24)[rng.permutation(24), None, None]
    x[12:18, :2, 1:] *= 0.5  # the static shear of these is more than friction holds
    parameters = ContactParameters.of(("t1", "t2", "n"), np.ones((24, 3)), friction=0.4)
    exact = aft.march(law, x, parameters, np.zeros((24, 2)), fine, False).force
    cycle = aft.cycle(law, x, parameters, typical)
    assert {s & (STICKS | SLIPS) for s in cycle.status} >= {STICKS, STICKS | SLIPS}
    size = np.linalg.norm(exact[:, :2], axis=(1, 2)).max()
    extra = aft.cycle(law, x, parameters, HarmonicBasis(saved, 256), None, False)
    error, smaller = (np.linalg.norm((item.force - exact)[:, :2], axis=(1, 2)).max() for item in (cycle, extra))
    assert error < 1e-3 * size
    assert smaller < 0.4 * error
    d = 1e-6 * rng.normal(size=x.shape)
    high, low = (aft.cycle(law, x + side * d, parameters, typical, None, False).force for side in (1, -1))
    path = np.einsum("pij,pj->pi", cycle.jacobian, d.reshape(24, -1))
    assert np.abs((high - low).reshape(24, -1) / 2 - path).max() < 1e-6 * np.abs(path).max()


@pytest.mark.parametrize("more", [-1e-9, 0.0, 1e-12, 1e-9])
@pytest.mark.parametrize("side", [0.02, 0.3])
def test_a_planar_slider_that_can_just_stick_comes_to_the_middle_of_its_ellipse(more, side):
    """Ellipse of half-axes 1 + more and 0.3 about (0, side), leash 1: the slider may stand across it up to
    sqrt(1 - (1 + more)^2) off the middle, which is where it comes to from outside; each cycle moves it by the cube of
    its distance, so that marching alone does not end."""
    basis = HarmonicBasis((0, 1), 128)
    x = np.array([[[0.0, 1 + more, 0.0], [side, 0.0, 0.3], [1.0, 0.0, 0.0]]])
    parameters = ContactParameters.of(("t1", "t2", "n"), [[1.0, 1.0, 1.0]], friction=1.0)
    force = aft.cycle(contact_law.load("coulomb_planar"), x, parameters, basis, None, False).force[0, :2, 0]
    assert force == pytest.approx([0.0, np.sqrt(max(1 - (1 + more) ** 2, 0.0))], abs=1e-5)


@pytest.mark.parametrize("harmonics", HARMONICS, ids=str)
def test_planar_sliders_between_equal_springs_are_their_chords_marched(harmonics):
    """The compiled cycle, whose period Newton's step finds, beside one chord after the other until the memory repeats;
    the Jacobian of pairs that have come to stick, at the edge of slip, to the rounding of that edge."""
    basis = HarmonicBasis(harmonics, 64)
    x, drawn, memory = draw("coulomb_planar", ("t1", "t2", "n"), basis, 300, seed=8)
    k = drawn.stiffness[:, [0, 0, 2]]
    parameters = ContactParameters.of(drawn.components, k, gap=drawn.gap, **drawn.numbers)
    start = np.concatenate([memory, memory, parameters.gap[:, None]], axis=1)
    slow = aft.march(SimpleNamespace(step=planar_cycle.chord), x, parameters, start, basis)
    fast = aft.cycle(contact_law.load("coulomb_planar"), x, parameters, basis, memory)
    np.testing.assert_allclose(fast.force, slow.force, atol=1e-9)
    np.testing.assert_allclose(fast.slope, slow.slope, atol=1e-6)
    plain = aft.cycle(contact_law.load("coulomb_planar"), x, parameters, basis, memory, False)
    np.testing.assert_allclose(plain.force, fast.force, atol=1e-9)


def test_a_planar_slider_that_creeps_has_a_cycle():
    """It once had none within 500: Newton's step for it went to and fro across a kink of the period map."""
    basis, x = HarmonicBasis((0, 1, 2), 256), np.zeros((1, 3, 5))
    x[0, 0] = [0.0013721, 0.158889, -0.393687, -0.0597611, -0.00925692]
    x[0, 1] = [-0.00163752, -0.207696, -0.294179, 0.0873076, -0.0620917]
    x[0, 2, 0] = 1.0
    parameters = ContactParameters.of(("t1", "t2", "n"), [[1.0, 1.0, 1.0]], friction=0.5)
    force = aft.cycle(contact_law.load("coulomb_planar"), x, parameters, basis).force[0, :2, 0]
    assert force == pytest.approx([-0.07041, 0.10147], abs=2e-4)


def test_planar_coulomb_along_a_line_is_a_jenkins_element():
    """Any direction in the plane, sliding through the origin; with unequal springs along their axes only."""
    basis = HarmonicBasis((0, 1, 2, 3), 128)
    rng = np.random.default_rng(1)
    x = np.zeros((20, 3, basis.n_coeff))
    motion = rng.normal(size=(20, basis.n_coeff)) * 10 ** rng.uniform(-1, 1, (20, 1))
    motion[:, 0] = 0
    x[:, 2] = rng.normal(size=(20, basis.n_coeff)) * 0.2
    x[:, 2, 0] = 1.0
    angle = rng.uniform(0, 2 * np.pi, 20)
    x[:, 0], x[:, 1] = np.cos(angle)[:, None] * motion, np.sin(angle)[:, None] * motion
    planar = ContactParameters.of(("t1", "t2", "n"), np.ones((20, 3)), friction=0.5)
    line = ContactParameters.of(("t1", "n"), np.ones((20, 2)), friction=0.5)
    force = aft.cycle(contact_law.load("coulomb_planar"), x, planar, basis).force
    path = aft.cycle(contact_law.load("jenkins"), np.stack([motion, x[:, 2]], axis=1), line, basis).force
    np.testing.assert_allclose(force[:, 0], np.cos(angle)[:, None] * path[:, 0], atol=1e-12)
    np.testing.assert_allclose(force[:, 1], np.sin(angle)[:, None] * path[:, 0], atol=1e-12)
    x[:, 0], x[:, 1] = motion, 0.0
    unequal = ContactParameters.of(("t1", "t2", "n"), np.tile([1.0, 50.0, 1.0], (20, 1)), friction=0.5)
    force = aft.cycle(contact_law.load("coulomb_planar"), x, unequal, basis).force
    np.testing.assert_allclose(force[:, 0], path[:, 0], atol=1e-12)
    np.testing.assert_allclose(force[:, 1], 0.0, atol=1e-14)


@pytest.mark.parametrize("ratio", [1.0, 1e-4, 1e4])
def test_planar_slip_is_parallel_to_friction_whatever_the_springs(ratio):
    """Maximum dissipation: |T| = mu N and the slider moves along T, forward."""
    law = contact_law.load("coulomb_planar")
    rng = np.random.default_rng(2)
    for _ in range(200):
        k = np.array([1.0, ratio, 1.0])
        p = np.array([*k, 0.0, 0.3])  # springs, gap, friction
        w = rng.normal(size=2)
        x, before = np.array([*rng.normal(size=2), rng.uniform(0.01, 1)]), w.copy()
        f = np.zeros(3)
        d = [np.zeros((a, b)) for a in (3, 2) for b in (3, 2)]
        if law.step(x, w, p, f, *d) != SLIPS:
            continue
        assert np.hypot(f[0], f[1]) == pytest.approx(0.3 * x[2], rel=1e-12)
        slip = w - before
        assert abs(slip[0] * f[1] - slip[1] * f[0]) < 1e-12 * np.hypot(*slip) * np.hypot(f[0], f[1])
        assert slip @ f[:2] > 0
        np.testing.assert_allclose(f[:2], k[:2] * (x[:2] - w), atol=1e-9 * k[:2].max())


@pytest.mark.parametrize(("way", "n_samples", "tolerance"), [("located", 16, 2e-16), ("sampled", 4096, 3e-7)])
def test_unilateral_half_sine(way, n_samples, tolerance):
    """v = A sin t against a gap of zero: N = k A (1/pi + sin t / 2 - 2/pi sum cos(2 m t) / (4 m^2 - 1))."""
    k, amplitude = 3.0, 0.7
    basis = HarmonicBasis(tuple(range(7)), n_samples, way)
    x = np.zeros((1, 1, basis.n_coeff))
    x[0, 0, 2] = amplitude
    exact = np.zeros(basis.n_coeff)
    exact[0], exact[2] = 1 / np.pi, 0.5
    for m in (1, 2, 3):
        exact[4 * m - 1] = -2 / np.pi / (4 * m**2 - 1)
    cycle = aft.cycle(contact_law.load("unilateral"), x, ContactParameters.of(("n",), [[k]]), basis)
    np.testing.assert_allclose(cycle.force[0, 0], k * amplitude * exact, atol=3 * k * tolerance)
    assert cycle.status[0] == STICKS | SEPARATES


@pytest.mark.parametrize("gap", [-0.69, 0.3, 0.69])
def test_unilateral_static_part_with_a_gap(gap):
    """v = A cos t, closed for |t| < c = arccos(gap / A): N_0 = k (A sin c - gap c) / pi."""
    k, amplitude = 3.0, 0.7
    basis = HarmonicBasis((0, 1), 8, "located")
    x = np.array([[[0.0, amplitude, 0.0]]])
    cycle = aft.cycle(contact_law.load("unilateral"), x, ContactParameters.of(("n",), [[k]], gap=gap), basis)
    c = np.arccos(gap / amplitude)
    assert cycle.force[0, 0, 0] == pytest.approx(k * (amplitude * np.sin(c) - gap * c) / np.pi, abs=1e-15)
    assert cycle.force[0, 0, 1] == pytest.approx(k * amplitude * (c - np.sin(c) * np.cos(c)) / np.pi, abs=1e-15)


def test_cubic_spring_gives_the_duffing_amplitudes():
    """x = A cos t: f = (k A + 3/4 k_3 A^3) cos t + k_3 A^3 / 4 cos 3 t."""
    basis = HarmonicBasis((0, 1, 2, 3), 16)
    x = np.zeros((1, 1, 7))
    x[0, 0, 1] = 1.3
    parameters = ContactParameters.of(("t1",), [[2.0]], cubic=0.7)
    force = aft.cycle(contact_law.load("cubic_spring"), x, parameters, basis).force[0, 0]
    assert force == pytest.approx([0, 2.6 + 0.75 * 0.7 * 1.3**3, 0, 0, 0, 0.25 * 0.7 * 1.3**3, 0], abs=1e-14)
