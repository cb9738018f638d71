"""Derivatives of a life against the same steps taken again, laws of scaling, and where there is none."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.helpers.pressed_body import balance_of, growth_by_few_modes, pressed_body, wear_problem, with_factor
from tests.helpers.steps_again import EXACT, derivatives_of_life, elasticity_anew
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_condition import AtPeakRatio
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.run_end import PreloadAtRest
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem, assess

SHARE, LOADS = 0.2, ("press", "shake")
AT = AtFrequency("tip", 420.0, EXACT)
PEAK = replace(AtPeak("tip", 250.0, 1200.0, newton=EXACT), tolerance=1e-7)


@pytest.fixture(scope="module", autouse=True)
def few_modes():
    """Lives do not depend on the growth of perturbations."""
    with growth_by_few_modes():
        yield


def problem_of(site, name="", factor=1.0, **changes) -> WearProblem:
    """The problem with one of its numbers times a factor; gaps open by (factor - 1) 0.1 mm."""
    balance = balance_of(pressed_body(), (0, 1))
    if name in LOADS:
        loads = {of: factor * value if of[1] == name else value for of, value in balance.excitation.loads.items()}
        excitation = replace(balance.excitation, loads=loads)
        balance = HarmonicBalance.of(balance.model, balance.contact.joints, balance.basis, excitation, 1500.0)
    else:
        balance = with_factor(balance, name, factor)
    coefficient = 1e-9 * (factor if name == "coefficient" else 1.0)
    inputs = {"mission": (Duty(site),), "lost_below": SHARE, "wear": JointWear.of("energy", coefficient=coefficient)}
    return wear_problem(balance=balance, **(inputs | changes))


def found_of(problem, worn, site, names, share=SHARE, numbers=None):
    return derivatives_of_life(problem, worn, partial(problem_of, site), names, share, numbers)


@pytest.mark.parametrize(("rule", "site", "names"), [
    ("error_controlled", AT, ("friction", "gap")),
    ("thesis", AT, ("press",)),
    pytest.param("error_controlled", PEAK, ("friction", "t1", "shake", "gap"), marks=pytest.mark.slow),
], ids=["frequency", "thesis", "peak"])  # fmt: skip
def test_derivatives_of_a_life_are_those_of_its_steps_taken_again(rule, site, names):
    problem = problem_of(site)
    if rule == "thesis":
        worn = evolve(thesis.Rule(problem, 1e-5))
    else:
        worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
    result = found_of(problem, worn, site, [name for name in names if name != "gap"])
    for name in names:
        slope = result.by_gap.sum(axis=1) * 1e-4 if name == "gap" else result.slopes[:, result.parameters.index(name)]
        elasticity = slope / result.values
        expected = elasticity_anew(worn, SHARE, partial(problem_of, site, name), elasticity[0])
        np.testing.assert_allclose(elasticity, expected, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(1e-9 * result.slopes[:, -1] / result.values, [-1.0, 0.0, 0.0], atol=1e-12)


OWN_LAW = """
from dataclasses import dataclass
import numpy as np
from tribodyn.declarations import number

@dataclass(frozen=True)
class Parameters:
    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0)
    depth: float = number("m", low=0.0)
    cycles: float = number("", low=0.0)

def depth_rate(e):
    n = e.numbers
    faces = (1 + np.exp(-e.depth / n["depth"])) * (1 + 1 / (1 + e.cycles / n["cycles"]))
    return n["coefficient"] * e.energy**1.1 / e.area * faces
"""
TWO_DUTIES = (Duty(AT, 0.6), Duty(AtFrequency("tip", 300.0, EXACT), 0.4, 1.3))
NEAR_PEAK = (Duty(AtPeakRatio(PEAK, 0.97)),)


@pytest.mark.parametrize(("law", "mission", "names"), [
    ("own", (Duty(AT),), ("friction", "depth", "cycles")),
    ("energy", TWO_DUTIES, ("shake", "gap")),
    pytest.param("archard", TWO_DUTIES, ("friction", "coefficient"), marks=pytest.mark.slow),
    pytest.param("impact", (Duty(AT),), ("friction",), marks=pytest.mark.slow),
    pytest.param("energy", NEAR_PEAK, ("friction", "shake"), marks=pytest.mark.slow),
    pytest.param(
        "energy", (*TWO_DUTIES[:1], Duty(NEAR_PEAK[0].site, 0.4)), ("friction", "gap"), marks=pytest.mark.slow
    ),
], ids=["own", "mission", "archard", "impact", "beside", "both"])  # fmt: skip
def test_other_laws_and_missions_have_the_derivatives_of_their_steps_taken_again(tmp_path, law, mission, names):
    """Where pairs lift, archard's sum over samples is rough: that is marked, and differences meet it to 1 % only."""
    (tmp_path / "own.py").write_text(OWN_LAW)
    extra = {"depth": 2e-5, "cycles": 1e3} if law == "own" else {}
    wear = JointWear.of(str(tmp_path / "own.py") if law == "own" else law, coefficient=1e-9, **extra)

    def posed(name="", factor=1.0):
        base = name in wear.numbers
        wears = replace(wear, numbers={**wear.numbers, name: factor * wear.numbers[name]}) if base else wear
        return problem_of(AT, "" if base else name, factor, wear=wears, mission=mission)

    problem = posed()
    if mission is TWO_DUTIES and law == "energy":
        worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
    else:
        worn = evolve(thesis.Rule(problem, 1e-5))
    base = {name: (name, ["contact"]) for name in wear.numbers}
    result = found_of(problem, worn, AT, [name for name in names if name not in (*base, "gap")], numbers=base)
    assert (result.corner.any(), law) in ((False, "energy"), (False, "own"), (True, "archard"), (True, "impact"))
    for name in names:
        scale = wear.numbers.get(name, 1.0)
        slope = result.by_gap.sum(axis=1) * 1e-4 if name == "gap" else result.slopes[:, result.parameters.index(name)]
        expected = elasticity_anew(worn, SHARE, partial(posed, name), (scale * slope / result.values)[0])
        close = 1e-2 if law == "archard" else 1e-5
        np.testing.assert_allclose(scale * slope / result.values, expected, rtol=close, atol=close / 10)


def test_a_wear_law_that_jumps_as_a_pair_lifts_is_told():
    problem = problem_of(AT, wear=JointWear.of("impact", coefficient=1e-9))
    worn = evolve(thesis.Rule(problem, 1e-5))
    closed = replace(worn, duty_displacement=worn.duty_displacement.copy())
    closed.duty_displacement[0, 0, 2::3, 0] += 1e-2  # pressed, so that no pair lifts
    with pytest.raises(NoDerivative, match="cycles a wear law jumps as a pair lifts"):
        found_of(problem, closed, AT, ())


@pytest.mark.parametrize("at_rest", [False, True])
def test_all_loads_times_c_wear_c_times_as_deep_in_a_life_over_c(at_rest):
    """Contacts without gap are homogeneous: displacements go with c, work with its square."""
    ends = {"lost_below": 0.0, "lost_below_at_rest": SHARE} if at_rest else {}
    problem = problem_of(AT, **ends)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
    assert (worn.preload_at_rest is not None) == at_rest
    result = found_of(problem, worn, AT, LOADS)
    total = result.slopes[:, :2].sum(axis=1) / result.values
    np.testing.assert_allclose(total, [-1.0, 1.0, 1.0], atol=1e-5)


def test_a_pair_that_just_touches_marks_the_derivatives():
    ends = {"lost_below": 0.0, "lost_below_at_rest": SHARE}

    def opened(gap):
        problem = problem_of(AT, **ends)
        return replace(problem, balance=problem.balance.with_gap(np.array([0.0, 0.0, gap, 0.0])))

    def pressed(gap):
        problem = opened(gap)
        remainder = PreloadAtRest(problem).quiet(assess(problem, np.zeros(4), 0.0, None))
        return assess(remainder, np.zeros(4), 0.0, None).points[0].state.x[2, 2, 0] - gap

    touching = brentq(pressed, 0.0, 1e-2, xtol=1e-16)
    for gap, marked in ((touching, True), (0.5 * touching, False)):
        problem = opened(gap)
        worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
        result = found_of(problem, worn, AT, ("press",))
        assert result.corner.tolist() == 2 * [marked]


def test_where_a_life_has_no_derivative_is_a_sentence():
    problem = problem_of(AT)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.3, 2e-4)))
    jumped, marched, stepped = (
        worn.duty_omega.copy(), np.zeros(len(worn.cycles), int), worn.memory["next_cycles"].copy(),
    )  # fmt: skip
    jumped[2:] *= 1.5
    marched[1], stepped[1] = 3, 0.0
    moving = np.zeros((len(marched), 1))
    in_time = {"periods": marched, "moving": moving, "spread": 0.0 * marched, "mean_error": 0.0 * marched}
    for messages, run in (
        ("the response jumps from 66.8", replace(worn, duty_omega=jumped)),
        ("the motion is followed in time", replace(worn, is_stationary=marched == 0, **in_time)),
        ("stepped over the end of a branch", replace(worn, memory={**worn.memory, "next_cycles": stepped})),
    ):
        with pytest.raises(NoDerivative, match=f"cycles.* {messages}"):
            found_of(problem, run, AT, ())
    parted = np.where(np.arange(len(worn.preload)) == 0, worn.preload, 0.0)
    with pytest.raises(NoDerivative, match="first step"):
        found_of(problem, replace(worn, preload=parted), AT, ())
    with pytest.raises(NoDerivative, match="no life"):
        found_of(problem, worn, AT, (), share=1e-3)
    spinning = replace(problem, mission=(Duty(AT, balance=problem.balance),))
    with pytest.raises(NoDerivative, match="several speeds"):
        found_of(spinning, worn, AT, ())
