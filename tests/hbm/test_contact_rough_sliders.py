"""Rough contact with one slider for each asperity: closed forms of one, a face as their sum, cycles and marching."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers.steel_asperities import ALL, E_STAR, FACE, MU, POISSON, RADIUS, STEEL, YOUNG, G, moving
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.asperity import asperity
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.laws import rough, rough_sliders
from tribodyn.hbm.harmonics import HarmonicBasis

G_STAR = G / (2 * (2 - POISSON))


def made(table, n_pair: int = 1, components: tuple[str, ...] = ALL, **numbers: float) -> ContactParameters:
    inputs = {"friction": MU, "young": YOUNG, "poisson": POISSON, "radius": RADIUS, **numbers}
    springs = np.ones((n_pair, len(components)))
    return contact_law.checked("rough_sliders", ContactParameters.of(components, springs, table=table, **inputs))


def test_one_asperity_is_hertz_and_a_stick_slip_slider_of_8_g_a():
    """With constant N and amplitude A the loop of a Jenkins element loses 4 mu N (A - mu N / k_t)."""
    d, parameters, basis = 5e-7, made([[0.0, 1.0]], deepest=2e-6), HarmonicBasis((0, 1), 4096)
    a, N = np.sqrt(RADIUS * d), 4 / 3 * E_STAR * np.sqrt(RADIUS) * d**1.5
    kt, x = 8 * G_STAR * a, np.zeros((1, 3, 3))
    x[0, 2, 0] = d
    memory = rough_sliders.rested(np.array([[0.0, 0.0, d]]), parameters)
    for share in (0.5, 3.0):  # of the displacement where it slips
        x[0, 0, 1] = share * MU * N / kt
        cycle = aft.cycle(rough_sliders, x, parameters, basis, memory)
        assert cycle.force[0, 2, 0] == pytest.approx(N, rel=1e-12)
        lost = 4 * MU * N * max(x[0, 0, 1] - MU * N / kt, 0.0)
        assert basis.work_per_cycle(cycle.force[0, 0], x[0, 0]) == pytest.approx(lost, rel=1e-5, abs=1e-20)
        assert cycle.status[0] == (STICKS if share < 1 else STICKS | SLIPS)
    assert 8 * G_STAR * a == pytest.approx(4 * G * a / (2 - POISSON))
    x[0, 0, 1] = 1e-12
    stiff = aft.cycle(rough_sliders, x, parameters, basis, memory).jacobian[0]
    assert stiff[1, 1] == pytest.approx(kt, rel=1e-9)


def face(n_pair: int = 1, components: tuple[str, ...] = ALL) -> ContactParameters:
    return made(FACE, n_pair, components, **{**STEEL, "friction": 0.03, "area": 2e-6})


def test_a_face_carries_what_its_asperities_do_and_is_as_stiff_as_the_bed():
    basis, item, x = HarmonicBasis((0, 1), 16), asperity(tuple(STEEL.values())), np.zeros((1, 3, 3))
    equal = ContactParameters.of(ALL, np.ones((1, 3)), table=FACE, friction=0.03, area=2e-6, **STEEL)
    bed = contact_law.checked("rough", equal)
    for deepest in (7e-6, 1.4e-5):
        x[0, 2, 0] = deepest
        remainder = x[:, :, 0]
        cycle = aft.cycle(rough_sliders, x, face(), basis, rough_sliders.rested(remainder, face()))
        gap, count = FACE[:, 0], FACE[:, 1] * (FACE[1, 0] - FACE[0, 0])
        count[[0, -1]] /= 2
        carried = 2e-6 * count @ item.loading(np.maximum(deepest - gap, 0.0))
        assert cycle.force[0, 2, 0] == pytest.approx(carried, rel=1e-6)
        finer = aft.cycle(rough, x, bed, basis, rough.rested(remainder, bed))
        for at in (1, 4, 7):  # first cosine of t1, t2 and n
            assert cycle.jacobian[0, at, at] == pytest.approx(
                finer.jacobian[0, at, at], rel=2e-2
            )  # the trapezoidal rule
    np.testing.assert_allclose(rough_sliders.springs(face()), rough.springs(bed))


@pytest.mark.parametrize("components", rough_sliders.COMPONENTS, ids="".join)
def test_the_cycle_is_the_second_that_steps_make(components):
    basis, n_pair, n_comp = HarmonicBasis((0, 1, 2), 48), 6, len(components)
    parameters, x = face(n_pair, components), moving(n_pair, n_comp, basis, 1)
    values = np.zeros((n_pair, n_comp))
    values[:, -1] = 8e-6
    memory, samples = rough_sliders.rested(values, parameters), basis.to_time(x)
    fast = rough_sliders.history(x, parameters, memory, basis)[1]
    found, status = np.zeros_like(samples), np.zeros(n_pair, int)
    for i in range(n_pair):
        s, n = memory[i].copy(), memory.shape[1]
        s[0] = max(s[0], samples[i, -1].max())  # the deepest of the cycle and of its past
        for turn in range(2):
            for j in range(basis.n_samples):
                f = np.zeros(n_comp)
                slopes = [np.zeros((a, b)) for a in (n_comp, n) for b in (n_comp, n)]
                bits = rough_sliders.step(samples[i, :, j].copy(), s, parameters.packed()[i], f, *slopes)
                found[i, :, j] = f
                status[i] |= bits if turn else 0
    np.testing.assert_allclose(fast, found, atol=1e-12 * np.abs(found).max())
    np.testing.assert_array_equal(aft.cycle(rough_sliders, x, parameters, basis, memory).status, status)
    assert (status & SLIPS).any()
    friction = np.abs(fast[:, :-1]).max(axis=(1, 2))
    assert (friction <= 0.03 * fast[:, -1].max(axis=1) * (1 + 1e-12)).all()


@pytest.mark.parametrize("deepest", [7e-6, 1.2e-5])
def test_the_jacobian_equals_differences(deepest):
    basis, n_pair = HarmonicBasis((0, 1, 2), 48), 8
    parameters, x = face(n_pair), moving(n_pair, 3, basis, 2)
    memory = rough_sliders.rested(np.tile([0.0, 0.0, deepest], (n_pair, 1)), parameters)
    jac = aft.cycle(rough_sliders, x, parameters, basis, memory).jacobian
    size, off = np.maximum(np.abs(jac).max(axis=(1, 2)), 1e-3 * np.abs(jac).max()), []
    for column in range(15):
        h = np.zeros((3, 5))
        h.flat[column] = 1e-13
        ahead, previous = (aft.cycle(rough_sliders, x + s * h, parameters, basis, memory, False).force for s in (1, -1))
        slope = (ahead - previous).reshape(n_pair, -1) / 2e-13
        off.append(np.abs(slope - jac[:, :, column]).max(axis=1) / size)
    assert np.quantile(off, 0.9) < 1e-5  # a kink of one asperity may lie within a difference
    assert np.max(off) < 1e-2


def test_the_slopes_of_a_step_are_differences():
    parameters = face()
    p = parameters.packed()[0]
    state = rough_sliders.rested(np.array([[1e-8, -2e-8, 9e-6]]), parameters)[0]
    rng = np.random.default_rng(0)
    state[3:] = 1e-4 * rng.normal(size=len(state) - 3)
    for x in ([3e-8, 2e-8, 8.9e-6], [1e-6, -1e-8, 9.1e-6]):

        def advance(z):
            s, f = z[3:].copy(), np.zeros(3)
            slopes = [np.zeros((a, b)) for a in (3, len(s)) for b in (3, len(s))]
            rough_sliders.step(z[:3].copy(), s, p, f, *slopes)
            return np.concatenate([f, s]), np.block([[slopes[0], slopes[1]], [slopes[2], slopes[3]]])

        z = np.concatenate([x, state])
        _, slope = advance(z)
        for column in (0, 1, 2, 3, 4, 5, 6, 30, 130):
            h = np.zeros(len(z))
            h[column] = 2e-13 if column < 6 else 1e-9
            difference = (advance(z + h)[0] - advance(z - h)[0]) / (2 * h[column])
            np.testing.assert_allclose(
                difference, slope[:, column], atol=2e-5 * (np.abs(slope[:, column]).max() + 1e-9)
            )


def test_a_pair_beyond_its_gap_is_open_and_frictionless_work_is_nothing():
    parameters, basis = face(2), HarmonicBasis((0, 1), 32)
    x = np.zeros((2, 3, 3))
    x[0, 2, 0], x[1, 2, 0] = -1e-6, 9e-6
    x[:, 0, 1] = 1e-6
    cycle = aft.cycle(rough_sliders, x, parameters, basis)
    assert cycle.status[0] == SEPARATES
    assert not cycle.force[0].any()
    smooth = aft.cycle(rough_sliders, x, parameters.scaled("friction", 0.0), basis)
    assert not smooth.force[:, :2].any()
