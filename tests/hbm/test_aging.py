"""Numbers that change as a contact wears, and a bed of worn material: limits, volumes, derivatives, running-in."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, quad

from tests.helpers.pressed_body import (
    balance_of,
    growth_by_few_modes,
    life,
    pressed_body,
    wear_problem,
    with_factor,
)
from tests.helpers.steps_again import EXACT, derivatives_of_life, elasticity_anew
from tribodyn.hbm.contact.aging import Aging, DebrisBed, EnergyByDepth, NumberTable
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.steady_motion import SteadyMotion
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem, assess
from tribodyn.refusal import Refusal

COEFFICIENT, SHARE = 1e-9, 0.2
AT = AtFrequency("tip", 420.0, EXACT)
PEAK = replace(AtPeak("tip", 250.0, 1200.0, newton=EXACT), tolerance=1e-7)
TABLES = {
    "friction": NumberTable("energy_density", (0.0, 1e5, 3e5), (0.4, 0.6, 0.9)),
    "tangential_stiffness": NumberTable("depth", (0.0, 2e-4), (1.0, 1.6)),
    "normal_stiffness": NumberTable("depth", (0.0, 3e-4), (1.0, 1.1)),
}
FALLING = {"coefficient": NumberTable("energy_density", (0.0, 4e5), (1.0, 0.7))}
BED = DebrisBed(0.5, 1e-4)


@pytest.fixture(scope="module", autouse=True)
def few_modes():
    """Lives do not depend on the growth of perturbations."""
    with growth_by_few_modes():
        yield


def aged(tables, wear_tables, debris=DebrisBed(), site=AT, name="", factor=1.0, **changes) -> WearProblem:  # noqa: B008
    """The wear problem of a joint that ages, with one of its numbers times a factor."""
    coefficient = COEFFICIENT * (factor if name == "coefficient" else 1.0)
    wear = replace(JointWear.of("energy", coefficient=coefficient), tables=wear_tables)
    by_energy = any(table.over == "energy_density" for table in tables.values())
    aging = Aging(tables, wear.energy if by_energy else None, debris)
    problem = wear_problem(wear=wear, mission=(Duty(site),), lost_below=SHARE, **changes)
    contact = problem.balance.contact.with_parameters(lambda p: replace(p, aging=aging))
    return replace(problem, balance=with_factor(problem.balance.with_contact(contact), name, factor))


def test_constant_tables_and_a_bed_that_loses_all_change_no_bit() -> None:
    constant = {name: replace(table, values=(table.values[0],) * len(table.values)) for name, table in TABLES.items()}
    flat = {"coefficient": replace(FALLING["coefficient"], values=(1.0, 1.0))}
    problems = wear_problem(mission=(Duty(AT),), lost_below=SHARE), aged(constant, flat)
    names = ("cycles", "depth", "work", "preload", "omega", "force", "solves", "duty_displacement")
    for rule, step in ((thesis.Rule, 1e-5), (error_controlled.Rule, Tolerance(0.1, 2e-4))):
        plain, aging = (evolve(rule(problem, step)) for problem in problems)
        assert all(np.array_equal(getattr(plain, name), getattr(aging, name)) for name in names)


def test_a_bed_that_loses_nothing_keeps_the_preload() -> None:
    worn = evolve(error_controlled.Rule(aged({}, {}, DebrisBed(1.0)), Tolerance(0.1, 2e-4)), 8)
    assert worn.depth[-1].max() > 1e-5
    np.testing.assert_allclose(worn.preload, worn.preload[0], rtol=1e-12)
    some, none = (life(evolve(thesis.Rule(aged({}, {}, bed), 1e-5)), SHARE) for bed in (BED, DebrisBed()))
    assert some > 1.3 * none


def test_what_is_worn_is_in_the_bed_or_ejected() -> None:
    """What leaves, integrated over the wear, is what the bed lacks of the depth; a full bed loses what it is fed."""
    depth = np.linspace(0.0, 1e-3, 21)
    ejected = [quad(BED.opening_slope, 0.0, end, epsabs=0.0, epsrel=1e-13)[0] for end in depth]
    np.testing.assert_allclose(ejected + BED.bed(depth), depth, rtol=1e-12)
    assert BED.bed(np.array([1.0])) == BED.thickness


def test_the_work_follows_from_the_depth() -> None:
    work, table = np.linspace(0.0, 6e5, 200_001), NumberTable("energy_density", (0.0, 1e5, 3e5), (2.0, 1.0, 4.0))
    depth = cumulative_trapezoid(COEFFICIENT * table.factor(work, work), work, initial=0.0)
    np.testing.assert_allclose(EnergyByDepth(COEFFICIENT, table).of(depth), work, rtol=1e-8)
    with pytest.raises(Refusal, match='give over = "depth"'):
        _ = JointWear.of("archard", coefficient=1e-9).energy


def test_both_rules_wear_the_same_and_the_work_is_that_done() -> None:
    """Energy that tables read off the depth is the friction work that the steps have done, to their accuracy."""
    problem = aged(TABLES, FALLING, BED)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4)))
    coarse, fine = (life(evolve(thesis.Rule(problem, depth)), SHARE) for depth in (1e-6, 5e-7))
    assert life(worn, SHARE) == pytest.approx(2 * fine - coarse, rel=5e-3)
    by_depth = EnergyByDepth(COEFFICIENT, FALLING["coefficient"]).of(worn.depth[1:].ravel())
    work = np.cumsum(worn.work, axis=0)[:-1].ravel() / 1e-4
    np.testing.assert_allclose(by_depth, work, rtol=2e-2, atol=2e-2 * work.max())
    np.testing.assert_array_equal(worn.depth - worn.bed, worn.opening)


def test_a_motion_in_time_has_the_numbers_of_its_state() -> None:
    problem = aged(TABLES, FALLING, balance=balance_of(pressed_body(), tuple(range(8))))
    depth = np.array([2e-5, 5e-5, 1e-5, 3e-5])
    state, fresh = (assess(of, depth, 0.0, None) for of in (problem, aged({}, {}, balance=problem.balance)))
    marched = SteadyMotion(problem, Tolerance(0.02, 2e-4), always=True).follow(state, 0.0)
    assert marched.work.sum() == pytest.approx(state.work.sum(), rel=5e-3)
    np.testing.assert_allclose(marched.rate, state.rate, rtol=2e-2, atol=1e-2 * state.rate.max())
    assert np.abs(fresh.rate - state.rate).max() > 0.05 * state.rate.max()


def test_running_in_stiffens_and_damps_less() -> None:
    """As measured by Fantetti et al. 2019: with work the resonance rises and its damping, force over w^2 a, falls."""
    quiet = balance_of(pressed_body(), (0, 1), shake=10.0)
    last = {"friction": 2.5, "tangential_stiffness": 1.2}  # over the first value
    tables = {name: NumberTable("energy_density", (0.0, 4e3), (1.0, factor)) for name, factor in last.items()}
    problem = aged(tables, {}, site=PEAK, balance=quiet)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.03, 2e-4)), 4)
    assert np.all(np.diff(worn.omega) > 0)
    assert np.all(np.diff(worn.omega**2 * worn.amplitude) > 0)


@pytest.mark.parametrize(("site", "names"), [
    (AT, ("coefficient",)),
    pytest.param(AT, ("friction", "gap"), marks=pytest.mark.slow),
    pytest.param(PEAK, ("friction", "t1", "coefficient", "gap"), marks=pytest.mark.slow),
], ids=["frequency", "others", "peak"])  # fmt: skip
def test_derivatives_of_a_life_are_those_of_its_steps_taken_again(site, names) -> None:
    """At a peak steps are taken again as exactly as that is found: with both rates over the work not to 1e-5."""
    build = partial(aged, TABLES, FALLING if site is AT else {}, BED, site)
    problem = build()
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
    acting = [name for name in names if name not in ("gap", "coefficient")]
    result = derivatives_of_life(problem, worn, build, acting, SHARE)
    for name in names:
        scale = COEFFICIENT if name == "coefficient" else 1.0
        slope = result.by_gap.sum(axis=1) * 1e-4 if name == "gap" else result.slopes[:, result.parameters.index(name)]
        elasticity = scale * slope / result.values
        expected = elasticity_anew(worn, SHARE, partial(build, name), elasticity[0])
        np.testing.assert_allclose(elasticity, expected, rtol=1e-5, atol=1e-6)
