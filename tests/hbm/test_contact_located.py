"""Located transitions: against an independent fine integration, against the samples, and in the awkward cases."""

from hashlib import sha256
from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.helpers.contact_draws import CLOSED_FORMS, HARMONICS, ONE_SLIDER, law_id
from tests.helpers.random_problems import cases
from tribodyn.hbm.contact import aft, contact_law, jenkins_cycle, segment_integrals, trigonometric
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.law_check import draw, law_numbers
from tribodyn.hbm.harmonics import HarmonicBasis

EVERY_LAW = pytest.mark.parametrize(("name", "components"), CLOSED_FORMS, ids=law_id)
WITH_STATIC = HarmonicBasis((0, 1, 2, 3), 8, "located")


def fine_force(x, k, mu, load, memory, basis, n=40_000):
    """Force coefficients of one tangential direction by trapezoids on a fine grid that contains the roots of N."""
    angle = np.linspace(0, 2 * np.pi, n + 1)
    value = load(angle)
    for j in np.flatnonzero(value[:-1] * value[1:] < 0):
        a, b = angle[j], angle[j + 1]
        for _ in range(60):
            c = 0.5 * (a + b)
            a, b = (c, b) if load(c) * load(a) > 0 else (a, c)
        angle = np.append(angle, a)
    angle = np.sort(angle)
    u, reach = basis.functions(angle) @ x, mu / k * np.maximum(load(angle), 0.0)
    w = memory
    for _ in range(2):
        force = np.empty(len(angle))
        for j in range(len(angle)):
            w = min(max(w, u[j] - reach[j]), u[j] + reach[j])
            force[j] = k * (u[j] - w)
    weight = np.where(basis.order == 0, 1.0, 2.0) / (2 * np.pi)
    return weight * np.trapezoid(force[:, None] * basis.functions(angle), angle, axis=0)


@pytest.mark.parametrize(("name", "components"), ONE_SLIDER, ids=law_id)
@pytest.mark.parametrize("harmonics", HARMONICS[1:3], ids=str)
def test_against_a_fine_integration(name, components, harmonics):
    law = contact_law.load(name)
    basis = HarmonicBasis(harmonics, 12, "located")
    x, p, memory = draw(name, components, basis, 6, seed=21)
    force = aft.cycle(law, x, p, basis, memory).force
    for i in range(6):

        def load(angle, i=i):
            if "n" not in components:
                return p.numbers["normal_load"][i] + 0 * angle
            return p.stiffness[i, -1] * (basis.functions(angle) @ x[i, -1] - p.gap[i])

        if "n" in components:
            angle = np.linspace(0, 2 * np.pi, 200_001)
            weight = np.where(basis.order == 0, 1.0, 2.0) / (2 * np.pi)
            push = np.maximum(load(angle), 0.0)[:, None] * basis.functions(angle)
            np.testing.assert_allclose(force[i, -1], weight * np.trapezoid(push, angle, axis=0), atol=1e-9)
        for c in range(law.n_state(components)):
            exact = fine_force(x[i, c], p.stiffness[i, c], p.numbers["friction"][i], load, memory[i, c], basis)
            np.testing.assert_allclose(force[i, c], exact, atol=2e-8)


@pytest.mark.parametrize(
    ("name", "components", "swing", "order"),
    [("jenkins_constant", ("t1",), 0.0, 2), ("jenkins", ("t1", "n"), 0.5, 2), ("unilateral", ("n",), 1.5, 2),
     ("jenkins", ("t1", "n"), 1.5, 1)],
)  # fmt: skip
def test_what_locating_buys(name, components, swing, order):
    """Error of the force coefficients against the samples; swing > 1 of the normal motion lifts the pairs.

    Measured over 200 random pairs at H = 3, r.m.s. with forces of order one, at 8, 128 and 4096 samples:
    constant load 2.7e-2, 1.2e-4, 1.1e-7; variable load 2.4e-2, 8.7e-5, 8.5e-8; unilateral 1.4e-2, 3.0e-5, 3.0e-8; but
    friction with separation 3.1e-2, 5.1e-4, 1.7e-5: where contact returns, the samples see the slider up to one sample
    late. Their Jacobian there does not converge at all (1e-2). Located: the same to the last digit at any number."""
    law = contact_law.load(name)
    rng = np.random.default_rng(3)
    x = rng.normal(size=(200, len(components), 7)) / (1 + WITH_STATIC.order) ** 1.5
    x[:, :, 0] = 0
    if "n" in components:
        normal = x[:, -1]
        normal *= swing / np.hypot(normal[:, 1::2], normal[:, 2::2]).sum(axis=1)[:, None]
        normal[:, 0] = 1
    numbers = law_numbers(name, friction=0.5, normal_load=1.0)
    p = ContactParameters.of(components, np.ones((200, len(components))), **numbers)
    exact = aft.cycle(law, x, p, WITH_STATIC)
    samples = 8 * 2 ** np.arange(10)
    error = []
    for n_samples in samples:
        sampled = aft.cycle(law, x, p, HarmonicBasis((0, 1, 2, 3), int(n_samples)))
        error.append(np.sqrt(np.mean((sampled.force - exact.force) ** 2)))
        equal = aft.cycle(law, x, p, HarmonicBasis((0, 1, 2, 3), int(n_samples), "located"))
        np.testing.assert_array_equal(equal.force, exact.force)
    slope = -np.polyfit(np.log2(samples[2:]), np.log2(error[2:]), 1)[0]
    assert slope == pytest.approx(order, abs=0.12)
    assert error[4] < 1e-3


@EVERY_LAW
def test_jacobian_through_every_kind_of_transition(name, components):
    """Differences agree for every pair, separating ones included: what the sampled Jacobian misses is there."""
    law = contact_law.load(name)
    for harmonics in HARMONICS:
        basis = HarmonicBasis(harmonics, 16, "located")
        x, p, memory = draw(name, components, basis, 100, seed=22)
        direction = np.random.default_rng(1).normal(size=x.shape)
        e = 1e-6
        plus, minus = (aft.cycle(law, x + s * e * direction, p, basis, memory, jacobian=False).force for s in (1, -1))
        slope = aft.cycle(law, x, p, basis, memory).jacobian @ direction.reshape(100, -1, 1)
        error = np.abs((plus - minus) / (2 * e) - slope.reshape(x.shape)).max(axis=(1, 2))
        assert error.max() < 1e-3  # differences across an event that appears or vanishes
        assert np.quantile(error, 0.97) < 1e-6


def test_dissipation_is_never_negative():
    for name, components in CLOSED_FORMS:
        law = contact_law.load(name)
        x, p, memory = draw(name, components, WITH_STATIC, 500, seed=23)
        work = WITH_STATIC.work_per_cycle(aft.cycle(law, x, p, WITH_STATIC, memory).force, x)
        scale = np.abs(x).max()
        assert work.min() > -1e-14 * scale
        if "n" in components:  # the normal spring gives back what it takes
            assert np.abs(work[:, -1]).max() < 1e-14 * scale**2


def test_several_events_within_one_sample_interval():
    """Harmonic 15 at 31 samples: contact, stick, slip and separation come and go between two samples."""
    law = contact_law.load("jenkins")
    basis = HarmonicBasis((0, 1, 15), 31, "located")
    x = np.zeros((1, 2, 5))
    x[0, 0] = [0.0, 0.3, 0.1, 0.8, 0.4]
    x[0, 1] = [0.1, 0.2, 0.0, 0.0, 1.0]
    p = ContactParameters.of(("t1", "n"), [[1.0, 1.0]], friction=0.4)
    cycle = aft.cycle(law, x, p, basis)
    fine = aft.cycle(law, x, p, HarmonicBasis((0, 1, 15), 2**18))
    np.testing.assert_allclose(cycle.force, fine.force, atol=2e-5)
    assert cycle.status[0] == STICKS | SLIPS | SEPARATES


@pytest.mark.parametrize("touch", [0.0, 1e-16, -1e-16, 1e-9, -1e-9, 1e-5, -1e-5])
def test_grazing_contact(touch):
    """A pair that only just lifts, and one that only just touches, in the middle of a cycle: a double root."""
    law = contact_law.load("jenkins")
    x = np.zeros((2, 2, 7))
    x[:, 0, 2] = 0.3
    x[0, 1, :2] = 1.0 + touch, 1.0
    x[1, 1, :2] = -1.0 + touch, 1.0
    p = ContactParameters.of(("t1", "n"), [[1.0, 1.0]] * 2, friction=0.5)
    cycle = aft.cycle(law, x, p, WITH_STATIC)
    nearby = aft.cycle(law, x + [[[1e-7], [0.0]]] * (WITH_STATIC.order == 0), p, WITH_STATIC)
    assert np.isfinite(cycle.force).all()
    assert np.isfinite(cycle.jacobian).all()
    np.testing.assert_allclose(nearby.force, cycle.force, atol=2e-7)
    lifted, touched = (2 * np.sqrt(2) / (3 * np.pi) * max(t, 0.0) ** 1.5 for t in (-touch, touch))
    assert cycle.force[0, 1, 0] == pytest.approx(1.0 + touch + lifted, abs=1e-10)
    assert cycle.force[1, 1, 0] == pytest.approx(touched, abs=1e-10)


def test_always_separated_costs_and_gives_nothing():
    law = contact_law.load("jenkins")
    x = np.zeros((1, 3, 7))
    x[0, :, 1:] = 0.1
    x[0, 2, 0] = -1.0
    p = ContactParameters.of(("t1", "t2", "n"), [[1.0, 1.0, 1.0]], friction=0.5)
    cycle = aft.cycle(law, x, p, WITH_STATIC, memory=np.array([[3.0, -1.0]]))
    assert not cycle.force.any()
    assert not cycle.jacobian.any()
    assert cycle.status[0] == SEPARATES


def test_stuck_on_the_rim_keeps_the_shear_of_the_extreme_load_path():
    """From a far memory the slider is dragged to the point that just fits the cycle, and stays: linear about it."""
    law = contact_law.load("jenkins")
    x = np.zeros((1, 2, 7))
    x[0, 0, 1], x[0, 1, 0], x[0, 1, 3] = 0.2, 1.0, 0.1
    p = ContactParameters.of(("t1", "n"), [[2.0, 1.0]], friction=0.6)
    angle = np.linspace(0, 2 * np.pi, 100_001)
    room = (0.6 * (1 + 0.1 * np.cos(2 * angle)) - 2.0 * 0.2 * np.cos(angle)).min()
    for side in (1, -1):
        cycle = aft.cycle(law, x, p, WITH_STATIC, memory=np.array([[-side * 1e6]]))
        assert cycle.force[0, 0, 0] == pytest.approx(side * room, abs=1e-9)
        assert cycle.force[0, 0, 1:] == pytest.approx(2.0 * x[0, 0, 1:], abs=0)


@pytest.mark.parametrize("load", [0.0, 1e-300, 1e-30, 1e-15])
def test_tiny_preload(load):
    law = contact_law.load("jenkins")
    x = np.zeros((1, 2, 7))
    x[0, 0, 1:] = np.random.default_rng(6).normal(size=6)
    x[0, 1, 0] = load
    cycle = aft.cycle(law, x, ContactParameters.of(("t1", "n"), [[1.0, 1.0]], friction=0.5), WITH_STATIC)
    assert np.abs(cycle.force[0, 0]).max() <= 4 / np.pi * 0.5 * load + 1e-15
    assert cycle.force[0, 1, 0] == load
    assert np.isfinite(cycle.jacobian).all()


def test_friction_proportional_to_the_motion():
    """u = mu v: a wall stands still, every instant is a turning point."""
    law = contact_law.load("jenkins")
    rng = np.random.default_rng(7)
    for lift in (0.0, 1.5):
        x = np.zeros((1, 2, 7))
        x[0, 1] = rng.normal(size=7)
        x[0, 1] *= 1 / np.abs(x[0, 1]).sum()
        x[0, 1, 0] = 1 - lift
        x[0, 0] = 0.5 * x[0, 1]
        p = ContactParameters.of(("t1", "n"), [[1.0, 1.0]], friction=0.5)
        cycle = aft.cycle(law, x, p, WITH_STATIC)
        assert np.isfinite(cycle.jacobian).all()
        np.testing.assert_allclose(cycle.force[0, 0], 0.5 * cycle.force[0, 1], atol=1e-14)


@pytest.mark.parametrize("stiffness", [1e8, 1e11, 1e14])
def test_a_touch_of_a_thousandth_of_the_cycle_is_known_to_many_digits(stiffness: float) -> None:
    """What a stiff spring pushes is a small difference of what it would over the whole cycle; friction far less yet.

    Against Gauss's rule in extended precision: stick from the touch on, slip shortly before the end of it."""
    a, u1, u2, kt, mu = 5e-5, -1.7e-5, -2e-7, 2e5, 0.4
    deep = (10 * np.sqrt(a) / stiffness) ** (2 / 3)
    x = np.array([[[0.0, u1, u2], [deep - a, a, 0.0]]])
    basis = HarmonicBasis((0, 1), 64, "located")
    law = contact_law.load("jenkins")
    p = ContactParameters.of(("t1", "n"), [[kt, stiffness]], friction=mu)
    result = aft.cycle(law, x, p, basis).force[0]

    far = np.longdouble
    c0, c1 = far(stiffness) * far(x[0, 1, 0]), far(stiffness) * far(a)
    end = np.arccos(-c0 / c1)

    def load(t):
        return c0 + c1 * np.cos(t)

    def pull(t):  # of the stick that begins with the touch
        return far(kt) * (far(u1) * (np.cos(t) - np.cos(end)) + far(u2) * (np.sin(t) + np.sin(end)))

    remaining, right = far(0), end  # u falls after the touch at -end and rises again: it slips where |T| reaches mu N
    for _ in range(80):
        middle = (remaining + right) / 2
        remaining, right = (middle, right) if abs(pull(middle)) < mu * load(middle) else (remaining, middle)
    points, weights = (v.astype(far) for v in np.polynomial.legendre.leggauss(30))

    def coefficients(f, start, stop):
        t = start + (stop - start) / 2 * (1 + points)
        value = f(t) * weights * (stop - start) / 2 / far(np.pi)
        return np.array([value.sum() / 2, (value * np.cos(t)).sum(), (value * np.sin(t)).sum()])

    stick, slip = coefficients(pull, -end, remaining), coefficients(lambda t: mu * load(t), remaining, end)
    friction = stick + np.sign(pull(remaining)) * slip
    for ours, exact in zip(result, (friction, coefficients(load, -end, end)), strict=True):
        np.testing.assert_allclose(ours, exact.astype(float), atol=1e-8 * float(abs(exact).max()))


@cases(150)
@given(
    st.lists(st.floats(-1, 1, allow_subnormal=False), min_size=9, max_size=9),
    st.sampled_from([(1, 2, 3, 4), (1, 3, 5, 7), (2, 3, 8, 9)]),
)
def test_no_root_is_missed(coefficients, harmonics):
    c, hs = np.array(coefficients), np.array(harmonics)
    grid = trigonometric.cell_grid(harmonics)
    out = np.empty(4 * hs[-1] + 16)
    roots = out[: trigonometric.roots(c, hs, grid, np.empty(3 * grid.shape[1] // 4), out, 0)]
    assert len(roots) <= 2 * hs[-1]
    assert np.all(np.diff(roots) >= 0)
    basis = HarmonicBasis((0, *harmonics), 32)
    value = basis.functions(roots) @ c
    assert np.abs(value).max(initial=0.0) <= 1e-13 * np.abs(c).max(initial=0.0) * hs[-1]
    angle = np.linspace(0, 2 * np.pi, 4001)
    sign = basis.functions(angle) @ c
    for j in np.flatnonzero((sign[:-1] > 1e-12) & (sign[1:] < -1e-12) | (sign[:-1] < -1e-12) & (sign[1:] > 1e-12)):
        assert np.any((roots >= angle[j]) & (roots <= angle[j + 1]))


def test_without_numba_the_kernels_give_the_same(monkeypatch):
    """The compiled kernels and their Python source agree (one cycle with all kinds of segment)."""
    law = contact_law.load("jenkins")
    x, p, memory = draw("jenkins", ("t1", "n"), WITH_STATIC, 4, seed=24)
    compiled = aft.cycle(law, x, p, WITH_STATIC, memory)
    for module in (jenkins_cycle, segment_integrals, trigonometric):
        for kernel in [name for name, value in vars(module).items() if hasattr(value, "py_func")]:
            monkeypatch.setattr(module, kernel, getattr(module, kernel).py_func)
    plain = aft.cycle(law, x, p, WITH_STATIC, memory)
    np.testing.assert_allclose(plain.force, compiled.force, atol=1e-14)
    np.testing.assert_allclose(plain.jacobian, compiled.jacobian, atol=1e-13)


def test_kernels_on_disk_are_stamped_with_the_files_of_their_callees() -> None:
    """Else numba runs the old physics after an edit of a callee in another file."""
    plain = numba.njit(cache=True)(jenkins_cycle._cycle.py_func)._cache._cache_file._source_stamp
    stamp = jenkins_cycle._cycle._cache._cache_file._source_stamp
    files = (jenkins_cycle.segment_integrals, jenkins_cycle.trigonometric)
    assert stamp == (plain, *(sha256(Path(module.__file__).read_bytes()).digest() for module in files))
