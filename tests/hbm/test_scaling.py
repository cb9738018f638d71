"""Units mean nothing: scaled by 1e-9 to 1e9 in length or in force, the problem has the scaled solution."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.verification_models import random_structure
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.stability.exponents import stability
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options

OMEGA = 305.3
GIGA = 2.0**30  # rounding is the same in both units, so that even a long way to the solution is the same
BINARY = [(1 / GIGA, 1.0), (GIGA, 1.0), (1.0, 1 / GIGA), (1.0, GIGA), (1 / GIGA, GIGA / 4), (GIGA, GIGA)]
SCALES = [(1e-9, 1.0), (1e9, 1.0), (1.0, 1e-9), (1.0, 1e9), (1e-6, 1e3), (1e3, 1e-6)]


def scaled(length: float, force: float, shaker: float = 25.0) -> HarmonicBalance:
    """The three-pair structure in units in which every length is `length` times, every force `force` times itself."""
    model = random_structure(3)
    s = model.system
    ratio = force / length
    system = SecondOrderSystem(s.mass * ratio, s.stiffness * ratio, s.damping * ratio, s.loads, s.outputs)
    stiffness = model.interface.stiffness(3e6, 5e6) * ratio
    parameters = ContactParameters.of(
        ("t1", "t2", "n"), stiffness, friction=0.3, gap=np.array([0.0, 1e-6, -2e-6]) * length
    )
    excitation = Excitation.of({"static": 30.0 * force}, {1: {"shaker": shaker * force}})
    basis = HarmonicBasis((0, 1, 2, 3), 256)
    return HarmonicBalance.of(
        replace(model, system=system), Joint("contact", "jenkins", parameters), basis, excitation, 1.2 * OMEGA
    )


def solved(balance: HarmonicBalance) -> Solution:
    solution = newton.solve_from_rest(balance, OMEGA)
    assert solution.converged
    assert np.all(solution.state.cycle.status & 3 == 3)
    assert np.any(solution.state.cycle.status == 7)
    return solution


@pytest.mark.parametrize(("length", "force"), SCALES)
def test_scaled_problem_has_the_scaled_solution_after_the_same_steps(length, force):
    plain, other = scaled(1.0, 1.0), scaled(length, force)
    a, b = solved(plain), solved(other)
    assert a.steps == b.steps
    np.testing.assert_allclose(b.history, a.history, rtol=0.05, atol=1e-9)
    np.testing.assert_allclose(b.state.x / length, a.state.x, atol=1e-8 * np.abs(a.state.x).max())
    np.testing.assert_allclose(
        b.state.cycle.force / force, a.state.cycle.force, atol=1e-8 * np.abs(a.state.cycle.force).max()
    )
    np.testing.assert_allclose(other.energy(b.state) / (length * force), plain.energy(a.state), rtol=1e-6)
    np.testing.assert_allclose(
        other.outputs(b.state) / length, plain.outputs(a.state), atol=1e-8 * np.abs(plain.outputs(a.state)).max()
    )


@pytest.mark.parametrize(("length", "force"), BINARY)
def test_even_a_long_search_takes_the_same_way(length, force):
    a, b = solved(scaled(1.0, 1.0, shaker=60.0)), solved(scaled(length, force, shaker=60.0))
    assert a.steps == b.steps > 10
    assert a.products == b.products
    assert np.array_equal(b.state.x / length, a.state.x)


@pytest.mark.parametrize(("length", "force"), SCALES)
def test_time_integration_and_stability_do_not_see_the_units(length, force):
    plain, other = scaled(1.0, 1.0), scaled(length, force)
    a, b = solved(plain), solved(other)
    options = Options(steps=256)
    item = time_integration.integrate(plain, OMEGA, a.state, options)
    pair = time_integration.integrate(other, OMEGA, b.state, options)
    assert item.outcome == pair.outcome == CONVERGED
    assert abs(item.periods - pair.periods) <= 3
    np.testing.assert_allclose(pair.x / length, item.x, atol=1e-6 * np.abs(item.x).max())
    leading_one, leading_two = stability(plain, a.state).exponents[0], stability(other, b.state).exponents[0]
    assert leading_two.real == pytest.approx(leading_one.real, rel=1e-5)
