"""Derivatives of a solved balance are those of balances solved again, for every contact law, and at a peak."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.helpers.contact_draws import EVENT_BASED, LAWS, law_id
from tests.helpers.verification_models import interface, modal_damping, random_structure
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law_check import law_numbers
from tribodyn.hbm.derivatives.adjoint_gradient import Gradient, cycle_numbers
from tribodyn.hbm.derivatives.cycle_derivatives import at_frequency, at_peak, peak_moves
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.reduction.model import ReducedModel

OMEGA, PAIRS, K = 900.0, 3, 2e6
EXACT = NewtonOptions(tolerance=1e-12)


def balance_of(name, components, transitions):
    """A structure whose pairs slip and lift."""
    model = random_structure(PAIRS, seed=5, ratio=0.05)
    rows = [3 * pair + ("t1", "t2", "n").index(c) for pair in range(PAIRS) for c in components]
    model = replace(model, interface=interface(np.asarray(model.interface.B)[rows], components))
    rng = np.random.default_rng(1)
    numbers = law_numbers(name, friction=0.4, normal_load=rng.uniform(20, 60, PAIRS), slip_force=16.0, free=1e14)
    at_limit = [n for n in contact_law.declared(name) if np.all(n.high == numbers[n.name])]  # no derivative there
    numbers |= {number.name: 0.5 * number.high for number in at_limit}
    gap = -1e-5 * rng.random(PAIRS)
    parameters = ContactParameters.of(components, rng.uniform(0.5, 2, (PAIRS, len(components))) * K, gap=gap, **numbers)
    basis = HarmonicBasis((0, 1, 2, 3), 64, transitions)
    base = np.zeros((len(rows), basis.n_coeff))
    base[:, :3] = 1e-6 * rng.normal(size=(len(rows), 3))
    excitation = replace(Excitation.of({"static": 150.0}, {1: {"shaker": 260.0 - 40j}}), base=base)
    return HarmonicBalance.of(model, Joint("j", name, parameters), basis, excitation, 2e3)


def with_number(balance, name, factor):
    """The contact with one of its numbers, or of its springs, times a factor."""

    def change(p):
        if name in ("tangential stiffness", "normal stiffness"):
            scaled = [(c == "n") == (name == "normal stiffness") for c in balance.contact.components]
            return replace(p, stiffness=np.where(scaled, factor, 1.0) * p.stiffness)
        return replace(p, numbers={**p.numbers, name: factor * p.numbers[name]})

    return balance.contact.with_parameters(change)


@pytest.mark.parametrize(("name", "components"), LAWS, ids=law_id)
def test_derivatives_by_every_number_of_a_law_are_those_of_balances_solved_again(name, components):
    balance = balance_of(name, components, "located" if (name, components) in EVENT_BASED else "sampled")
    solved = newton.solve_from_rest(balance, OMEGA, EXACT)
    assert solved.converged
    springs = ["tangential stiffness", "normal stiffness"][: 1 + ("n" in components)]
    names = [*springs, *(n.name for n in contact_law.declared(name) if not n.integer)]
    step, posed = 1e-6, BalanceInputs.of(balance)
    changes = [
        ParameterChange(p, step, *(replace(posed, contact=with_number(balance, p, 1 + s)) for s in (step, -step)))
        for p in names
    ]

    def loaded(name, factor):
        inputs = balance.excitation
        if name == "base":
            return replace(inputs, base=factor * inputs.base)
        return replace(inputs, loads={of: factor * value for of, value in inputs.loads.items()})

    def reloaded(name, factor):
        built = HarmonicBalance.of(balance.model, balance.contact.joints, balance.basis, loaded(name, factor), 2e3)
        return replace(built, memory=balance.memory)

    driven = ["loads", "base"]
    changes += [
        ParameterChange(p, step, *(replace(posed, excitation=loaded(p, 1 + s)) for s in (step, -step))) for p in driven
    ]
    result = at_frequency(balance, solved.state, "tip", changes)

    def again(other):
        state = newton.solve(other, OMEGA, result.state.x, EXACT).state
        return np.array([q.value for q in cycle_numbers(other, state, "tip") if q.moves_with_state])

    for i, p in enumerate([*names, *driven]):
        h = 2e-5
        if p in driven:
            pair = [reloaded(p, 1 + s) for s in (h, -h)]
        else:
            pair = [balance.with_contact(with_number(balance, p, 1 + s)) for s in (h, -h)]
        difference = (again(pair[0]) - again(pair[1])) / (2 * h)
        size = np.maximum(np.abs(difference), 1e-2 * np.abs(result.slopes).max(axis=1))
        assert (np.abs(result.slopes[:, i] - difference) <= 1e-5 * size).all(), (p, result.slopes[:, i], difference)
    gap = balance.contact.gap
    for pair in range(PAIRS if "n" in components else 0):
        d = 1e-10 * (np.arange(PAIRS) == pair)
        difference = (again(balance.with_gap(gap + d)) - again(balance.with_gap(gap - d))) / 2e-10
        size = np.maximum(np.abs(difference), 1e-2 * np.abs(result.by_gap).max(axis=1))
        assert (np.abs(result.by_gap[:, pair] - difference) <= 1e-4 * size).all()


def slider_behind_a_mass(friction):
    """A driven mass, and one behind it on a slider, whose first slip is a peak of the first."""
    mass, stiffness = np.diag([1.0, 0.566]), np.array([[1.131, -0.131], [-0.131, 0.233]])
    spring = 0.2
    damping = modal_damping(mass, stiffness + np.diag([0, spring]), 0.01)
    system = SecondOrderSystem(mass, stiffness, damping, {"force": np.eye(2)[0]}, {"tip": np.eye(2)[0]})
    parameters = ContactParameters.of(("t1",), np.array([[spring]]), friction=friction, normal_load=np.array([1.0]))
    model = ReducedModel(system, interface(np.eye(2)[1:], ("t1",)))
    basis, excitation = HarmonicBasis((1, 3), 64, "located"), Excitation.of({}, {1: {"force": 1.0}})
    return HarmonicBalance.of(model, Joint("j", "jenkins_constant", parameters), basis, excitation, 2.0)


def test_a_peak_that_is_a_corner_follows_first_slip():
    """Against the linear response with the slider stuck: there the second mass moves by the slip limit."""
    balance, friction = slider_behind_a_mass(2.6), 2.6

    def stuck(omega):
        system = balance.model.system
        dynamic = system.stiffness + np.diag([0, 0.2]) - omega**2 * system.mass + 1j * omega * system.damping
        return np.abs(np.linalg.solve(dynamic, [1.0, 0.0]))

    omega, step = brentq(lambda omega: stuck(omega)[1] - friction / 0.2, 0.8, 0.82), 1e-6
    tip, slider = (stuck(omega + step) - stuck(omega - step)) / (2 * step)
    state = newton.solve_from_rest(balance, omega * (1 + 1e-4), EXACT).state
    posed, h = BalanceInputs.of(balance), 1e-6
    sides = (replace(posed, contact=with_number(balance, "friction", 1 + s)) for s in (h, -h))
    result = at_peak(balance, state, "tip", [ParameterChange("friction", h * friction, *sides)])
    assert result.follows_corner
    assert result.names[:2] == ("peak_frequency", "amplitude")
    np.testing.assert_allclose(result.values[:2], [omega / (2 * np.pi), stuck(omega)[0]], rtol=1e-6)
    np.testing.assert_allclose(result.slopes[:2, 0], np.array([1 / (2 * np.pi), tip]) / slider / 0.2, rtol=5e-6)
    with pytest.raises(NoDerivative, match="peak is a corner of the curve"):
        peak_moves(balance, state, "tip", ())


def test_an_adjoint_that_is_no_solution_is_refused(monkeypatch):
    balance = balance_of("jenkins", ("t1", "t2", "n"), "located")
    state = newton.solve_from_rest(balance, OMEGA, EXACT).state
    monkeypatch.setattr(Gradient, "_residual_transposed", lambda _, v: np.zeros_like(v))
    with pytest.raises(NoDerivative, match="as at a fold"):
        Gradient(balance, state, tuple(cycle_numbers(balance, state, "tip"))).by_frequency()
