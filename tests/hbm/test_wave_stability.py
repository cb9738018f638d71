"""Stability of travelling waves against every perturbation wave, held against the whole wheel."""

import numpy as np
import pytest

from tests.helpers import tiny_wheel as tiny
from tests.helpers.stability_in_time import multipliers, stability_in_time
from tribodyn.hbm import newton
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.stability.exponents import stability
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.wave_model import as_wave

EXACT = newton.NewtonOptions(tolerance=1e-12)


def solved(balance, wheel, omega, order):
    """The states of a wave and of the whole wheel that it is."""
    result = newton.solve_from_rest(balance, omega, EXACT)
    assert result.converged
    x = np.concatenate(tiny.spread(balance, result.state.x, order))
    everywhere = newton.solve(wheel, omega, x, EXACT)
    assert everywhere.converged
    assert np.abs(everywhere.state.x - x).max() < 1e-8 * np.abs(x).max()
    return result.state, everywhere.state


def matched(ours, theirs):
    """Largest distance of an exponent to the nearest one of the others."""
    return np.abs(ours[:, None] - theirs[None, :]).min(axis=1).max()


def test_a_harmonic_of_the_opposite_index_sees_the_conjugate_system():
    """Harmonics 2 and 3 of engine order 2 on five sectors are waves of index 4 and 1; each against a direct solve."""
    item, _ = tiny.wave_and_wheel(tiny.sector(("t1", "n"), 12.0), "jenkins", 2, (0, 1, 2, 3, 4), 160.0, friction=0.4)
    assert [positions for _, positions in item.compliance.groups] == [[0], [1], [4], [2], [3]]
    force = np.random.default_rng(1).normal(size=(2, item.basis.n_coeff))
    shifted = item.basis.to_complex(item.at(120.0).apply(force))
    for h in item.basis.harmonics:
        system, b = item.model.at_harmonic(h)
        s = 120j * h
        stiffness = system.stiffness + b.conj().T @ (item.compliance.k[:, None] * b)
        dynamic = stiffness + s * system.velocity_matrix + s * s * system.mass
        expected = b @ np.linalg.solve(dynamic, b.conj().T @ item.basis.to_complex(force)[:, h])
        np.testing.assert_allclose(shifted[:, h], expected, rtol=1e-9)


@pytest.mark.parametrize("turning", [0.0, 12.0])
def test_exponents_of_a_lifting_wave_are_those_of_the_monodromy_matrix_of_the_whole_wheel(turning):
    """A law without memory: Hill's method makes no assumption but the highest harmonic of the perturbation."""
    item, wheel = tiny.wave_and_wheel(tiny.sector(("n",), turning), "unilateral", 2, tuple(range(10)), 120.0)
    current, refined = solved(item, wheel, 120.0, 2)
    assert (current.cycle.status & SEPARATES).all()
    result = stability(item, current)
    assert len(result.exponents) == len(result.diameters) == 2 * 4 * tiny.N
    reference = stability_in_time(wheel, refined)
    unit = 2 * np.pi / result.omega
    assert matched(np.exp(result.exponents * unit), multipliers(reference)) < 4e-4
    assert matched(multipliers(reference), np.exp(result.exponents * unit)) < 4e-4


def test_exponents_of_a_slipping_wave_are_those_of_the_whole_wheel_by_the_same_method():
    item, wheel = tiny.wave_and_wheel(tiny.sector(("t1", "n"), 12.0), "jenkins", 2, (0, 1, 2, 3), 120.0, friction=0.4)
    current, refined = solved(item, wheel, 120.0, 2)
    assert (current.cycle.status & SLIPS).all()
    result, reference = stability(item, current, top=6), stability(wheel, refined, top=6)
    lead = result.exponents[:8]
    assert matched(lead, reference.exponents) < 1e-10 * np.abs(lead).max()
    assert matched(reference.exponents[:8], result.exponents) < 1e-10 * np.abs(lead).max()


@pytest.mark.parametrize("omega", [120.0, 140.0])
def test_growth_that_friction_limits_is_that_of_the_whole_wheel_in_time(omega, monkeypatch):
    """Negative damping: what grows is found again with the contact's answer to just that."""
    monkeypatch.setattr(tiny, "modal_damping", lambda system, ratio: -modal_damping(system, ratio))
    slipping = tiny.sector(("t1", "n"), 12.0)
    item, wheel = tiny.wave_and_wheel(slipping, "jenkins", 2, (0, 1, 2, 3, 4, 5), 12.0, damping=0.005, friction=0.4)
    current, refined = solved(item, wheel, omega, 2)
    assert (current.cycle.status & SLIPS).all()
    result, reference = stability(item, current), stability_in_time(wheel, refined)
    largest = np.abs(multipliers(reference)).max()
    assert np.abs(multipliers(result)).max() == pytest.approx(largest, rel=2e-4)
    monkeypatch.setattr(exponents, "_answer", lambda *of: None)
    steady = stability(item, current)
    assert np.abs(multipliers(steady)).max() > largest + 5e-3
    assert steady.n_unstable > result.n_unstable


def test_a_wave_whose_contacts_stick_is_as_stable_as_the_stuck_wheel():
    """Sliders that were dragged once stand still in a perturbation: frequency and decay of the stuck modes."""
    item, _ = tiny.wave_and_wheel(tiny.sector(("t1", "n")), "jenkins", 2, (0, 1), 0.5, friction=0.4)
    result = newton.solve_from_rest(item, 120.0, EXACT)
    assert (result.state.cycle.status == 1).all()
    memory = np.full_like(item.memory, 1e-3)  # far beyond what friction holds
    dragged = item.with_memory(memory)
    state = newton.solve(dragged, 120.0, result.state.x, EXACT).state
    assert (state.cycle.status == 1).all()
    exponents = stability(dragged, state).exponents
    assert exponents.real.max() < 0
    for index in range(tiny.N):
        system, b = as_wave(item.model).at_index(index)
        k = item.compliance.k
        stuck = system.stiffness + b.conj().T @ (k[:, None] * b)
        n = len(stuck)
        force = -np.linalg.solve(system.mass, np.concatenate([stuck, system.damping], axis=1))
        first = np.concatenate([np.eye(2 * n)[n:], force])
        expected = np.exp(np.linalg.eigvals(first) * 2 * np.pi / 120.0)
        assert matched(expected, np.exp(exponents * 2 * np.pi / 120.0)) < 1e-9
