"""Derivatives of a solved balance are those of balances solved again, for every contact law, and at a peak."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.contact_draws import LAWS, LOCATED, own
from tests.helpers.verification_models import interface, random_structure
from tribodyn.hbm import derivatives, newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import law as contact_law
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law import ContactParameters
from tribodyn.hbm.derivatives import Change, NoDerivative, Posed, at_frequency
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions

OMEGA, PAIRS, K = 900.0, 3, 2e6
EXACT = NewtonOptions(tolerance=1e-12)


def balance_of(name, components, transitions):
    """A structure whose pairs slip and lift."""
    model = random_structure(PAIRS, seed=5, ratio=0.05)
    rows = [3 * pair + ("t1", "t2", "n").index(c) for pair in range(PAIRS) for c in components]
    model = replace(model, interface=interface(np.asarray(model.interface.B)[rows], components))
    rng = np.random.default_rng(1)
    numbers = own(name, friction=0.4, normal_load=rng.uniform(20, 60, PAIRS), cubic=1e14)
    gap = -1e-5 * rng.random(PAIRS)
    parameters = ContactParameters.of(components, rng.uniform(0.5, 2, (PAIRS, len(components))) * K, gap=gap, **numbers)
    excitation = Excitation.of({"static": 150.0}, {1: {"shaker": 260.0 - 40j}})
    return HarmonicBalance.of(
        model, Joint("j", name, parameters), HarmonicBasis((0, 1, 2, 3), 64, transitions), excitation, 2e3
    )


def with_number(balance, name, factor):
    """The contact with one of its numbers, or of its springs, times a factor."""

    def change(p):
        if name == "stiffness":
            return replace(p, stiffness=factor * p.stiffness)
        return replace(p, numbers={**p.numbers, name: factor * p.numbers[name]})

    return balance.contact.with_parameters(change)


@pytest.mark.parametrize(("name", "components"), LAWS, ids=lambda v: v if isinstance(v, str) else "".join(v))
def test_derivatives_by_every_number_of_a_law_are_those_of_balances_solved_again(name, components):
    balance = balance_of(name, components, "located" if (name, components) in LOCATED else "sampled")
    solved = newton.solve_from_rest(balance, OMEGA, EXACT)
    assert solved.converged
    names = ["stiffness", *(n.name for n in contact_law.declared(name) if not n.whole)]
    step, posed = 1e-6, Posed.of(balance)
    changes = [
        Change(p, step, *(replace(posed, contact=with_number(balance, p, 1 + s)) for s in (step, -step))) for p in names
    ]

    def loaded(factor):
        given = balance.excitation
        return replace(given, loads={of: factor * value for of, value in given.loads.items()})

    def reloaded(factor):
        made = HarmonicBalance.of(balance.model, balance.contact.joints, balance.basis, loaded(factor), 2e3)
        return replace(made, memory=balance.memory)

    loads = [loaded(1 + s) for s in (step, -step)]
    changes.append(Change("loads", step, *(replace(posed, excitation=e) for e in loads)))
    found = at_frequency(balance, solved.state, "tip", changes)

    def again(other):
        state = newton.solve(other, OMEGA, found.state.x, EXACT).state
        return np.array([q.value for q in derivatives.quantities(other, state, "tip")])

    for i, p in enumerate([*names, "loads"]):
        h = 2e-5
        if p == "loads":
            pair = [reloaded(1 + s) for s in (h, -h)]
        else:
            pair = [balance.with_contact(with_number(balance, p, 1 + s)) for s in (h, -h)]
        difference = (again(pair[0]) - again(pair[1])) / (2 * h)
        size = np.maximum(np.abs(difference), 1e-2 * np.abs(found.slopes).max(axis=1))
        assert (np.abs(found.slopes[:, i] - difference) <= 1e-5 * size).all(), (p, found.slopes[:, i], difference)
    gap = balance.contact.gap
    for pair in range(PAIRS if "n" in components else 0):
        d = 1e-10 * (np.arange(PAIRS) == pair)
        difference = (again(balance.with_gap(gap + d)) - again(balance.with_gap(gap - d))) / 2e-10
        size = np.maximum(np.abs(difference), 1e-2 * np.abs(found.by_gap).max(axis=1))
        assert (np.abs(found.by_gap[:, pair] - difference) <= 1e-4 * size).all()


def test_a_fold_has_no_derivative():
    """An adjoint that is no solution is refused, not returned."""
    balance = balance_of("jenkins", ("t1", "t2", "n"), "located")
    state = newton.solve_from_rest(balance, OMEGA, EXACT).state
    gradient = derivatives.Gradient(balance, state, tuple(derivatives.quantities(balance, state, "tip")))
    with pytest.raises(NoDerivative, match="fold"):
        gradient._transposed_solve(lambda v: np.zeros_like(v), np.ones_like(state.flat))
