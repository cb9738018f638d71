"""Stability of travelling waves against every perturbation wave, held against the whole wheel."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers import tiny_wheel as tiny
from tests.helpers.floquet import multipliers
from tests.helpers.stability_in_time import stability_in_time
from tribodyn.hbm import newton
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.stability.exponents import stability
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.wave_model import as_wave

EXACT = newton.NewtonOptions(tolerance=1e-12)


def solved(one, wheel, omega, order):
    """The states of a wave and of the whole wheel that it is."""
    found = newton.solve_from_rest(one, omega, EXACT)
    assert found.converged
    x = np.concatenate(tiny.spread(one, found.state.x, order))
    everywhere = newton.solve(wheel, omega, x, EXACT)
    assert everywhere.converged
    assert np.abs(everywhere.state.x - x).max() < 1e-8 * np.abs(x).max()
    return found.state, everywhere.state


def matched(ours, theirs):
    """Largest distance of an exponent to the nearest one of the others."""
    return np.abs(ours[:, None] - theirs[None, :]).min(axis=1).max()


def test_a_harmonic_of_the_opposite_index_sees_the_conjugate_system():
    """Harmonics 2 and 3 of engine order 2 on five sectors are waves of index 4 and 1; each against a direct solve."""
    one, _ = tiny.wave_and_wheel(tiny.sector(("t1", "n"), 12.0), "jenkins", 2, (0, 1, 2, 3, 4), 160.0, friction=0.4)
    assert [positions for _, positions in one.compliance.groups] == [[0], [1], [4], [2], [3]]
    force = np.random.default_rng(1).normal(size=(2, one.basis.n_coeff))
    moved = one.basis.to_complex(one.at(120.0).apply(force))
    for h in one.basis.harmonics:
        system, b = one.model.at_harmonic(h)
        s = 120j * h
        stiffness = system.stiffness + b.conj().T @ (one.compliance.k[:, None] * b)
        dynamic = stiffness + s * system.velocity_matrix + s * s * system.mass
        wanted = b @ np.linalg.solve(dynamic, b.conj().T @ one.basis.to_complex(force)[:, h])
        np.testing.assert_allclose(moved[:, h], wanted, rtol=1e-9)


@pytest.mark.parametrize("turning", [0.0, 12.0])
def test_exponents_of_a_lifting_wave_are_those_of_the_monodromy_matrix_of_the_whole_wheel(turning):
    """A law without memory: Hill's method makes no assumption but the highest harmonic of the perturbation."""
    one, wheel = tiny.wave_and_wheel(tiny.sector(("n",), turning), "unilateral", 2, tuple(range(10)), 120.0)
    here, there = solved(one, wheel, 120.0, 2)
    assert (here.cycle.status & SEPARATES).all()
    found = stability(one, here)
    assert len(found.exponents) == len(found.diameters) == 2 * 4 * tiny.N
    reference = stability_in_time(wheel, there)
    unit = 2 * np.pi / found.omega
    assert matched(np.exp(found.exponents * unit), multipliers(reference)) < 4e-4
    assert matched(multipliers(reference), np.exp(found.exponents * unit)) < 4e-4


def test_exponents_of_a_slipping_wave_are_those_of_the_whole_wheel_by_the_same_method():
    one, wheel = tiny.wave_and_wheel(tiny.sector(("t1", "n"), 12.0), "jenkins", 2, (0, 1, 2, 3), 120.0, friction=0.4)
    here, there = solved(one, wheel, 120.0, 2)
    assert (here.cycle.status & SLIPS).all()
    found, reference = stability(one, here, top=6), stability(wheel, there, top=6)
    lead = found.exponents[:8]
    assert matched(lead, reference.exponents) < 1e-10 * np.abs(lead).max()
    assert matched(reference.exponents[:8], found.exponents) < 1e-10 * np.abs(lead).max()


@pytest.mark.parametrize("omega", [120.0, 140.0])
def test_growth_that_friction_limits_is_that_of_the_whole_wheel_in_time(omega, monkeypatch):
    """Negative damping: what grows is found again with the contact's answer to just that."""
    monkeypatch.setattr(tiny, "modal_damping", lambda system, ratio: -modal_damping(system, ratio))
    slipping = tiny.sector(("t1", "n"), 12.0)
    one, wheel = tiny.wave_and_wheel(slipping, "jenkins", 2, (0, 1, 2, 3, 4, 5), 12.0, damping=0.005, friction=0.4)
    here, there = solved(one, wheel, omega, 2)
    assert (here.cycle.status & SLIPS).all()
    found, reference = stability(one, here), stability_in_time(wheel, there)
    largest = np.abs(multipliers(reference)).max()
    assert np.abs(multipliers(found)).max() == pytest.approx(largest, rel=2e-4)
    monkeypatch.setattr(exponents, "_answer", lambda *of: None)
    steady = stability(one, here)
    assert np.abs(multipliers(steady)).max() > largest + 5e-3
    assert steady.n_unstable > found.n_unstable


def test_a_wave_whose_contacts_stick_is_as_stable_as_the_stuck_wheel():
    """Sliders that were dragged once stand still in a perturbation: frequency and decay of the stuck modes."""
    one, _ = tiny.wave_and_wheel(tiny.sector(("t1", "n")), "jenkins", 2, (0, 1), 0.5, friction=0.4)
    found = newton.solve_from_rest(one, 120.0, EXACT)
    assert (found.state.cycle.status == 1).all()
    memory = np.full_like(one.memory, 1e-3)  # far beyond what friction holds
    dragged = one.with_memory(memory)
    state = newton.solve(dragged, 120.0, found.state.x, EXACT).state
    assert (state.cycle.status == 1).all()
    exponents = stability(dragged, state).exponents
    assert exponents.real.max() < 0
    for index in range(tiny.N):
        system, b = as_wave(one.model).at_index(index)
        k = one.compliance.k
        stuck = system.stiffness + b.conj().T @ (k[:, None] * b)
        n = len(stuck)
        force = -np.linalg.solve(system.mass, np.concatenate([stuck, system.damping], axis=1))
        first = np.concatenate([np.eye(2 * n)[n:], force])
        wanted = np.exp(np.linalg.eigvals(first) * 2 * np.pi / 120.0)
        assert matched(wanted, np.exp(exponents * 2 * np.pi / 120.0)) < 1e-9
