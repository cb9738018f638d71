"""A displacement that harmonic 0 prescribes, in time: beside balances with many harmonics and a force that is known."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.held_bodies import OMEGA, PLATFORM, problem, two_bodies
from tests.helpers.pressed_body import growth_by_few_modes
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.stability import exponents, floquet
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanOptions
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.hbm.time.verify import verify
from tribodyn.hbm.wear.history import cycles_to_preload
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.reduction.prescribed import PrescribedModel, prescribe

HEIGHT = 1.5e-4
STEPS = 128


def held(
    force: float, top: int = 15, height: float = HEIGHT, friction: float = 0.4, gap: float = 0.0
) -> HarmonicBalance:
    model = prescribe(two_bodies(), PLATFORM, "height", support=4e5)
    gaps = (gap, gap + 1e-5, gap - 1e-5)
    return problem(model, height, force, gaps, tuple(range(top + 1)), friction)


def solved(balance: HarmonicBalance) -> State:
    solution = newton.solve_from_rest(balance, OMEGA)
    assert solution.converged
    return solution.state


@pytest.mark.parametrize(("height", "force"), [(4e-5, 1.5), (HEIGHT, 30.0)])
def test_motion_in_time_is_that_of_many_harmonics(height: float, force: float) -> None:
    """They stick, slip and lift; at the larger load the motion is unstable."""
    balance = held(force, height=height)
    state = solved(balance)
    assert np.bitwise_or.reduce(state.cycle.status) == STICKS | SLIPS | SEPARATES
    comparison = verify(balance, state, Options(512, tolerance=1e-8))
    assert comparison.motion.periodic
    assert comparison.largest < 1e-3
    assert np.abs(comparison.motion.hold_error).max() < 1e-7 * height  # of the displacement as it was marched
    stepper = TimeStepper(balance, OMEGA, Options(512))
    assert isinstance(balance.model, PrescribedModel)
    reaction = balance.model.reaction
    in_time = reaction.force(height, comparison.motion.force.mean(axis=2))  # another formula than that of the hold
    np.testing.assert_allclose(in_time, reaction.force(height, state.cycle.force[:, :, 0]), rtol=2e-3)
    finer = reaction.support * height  # of the springs that act about the height
    np.testing.assert_allclose(stepper.hold.in_balance(state) - finer, in_time, rtol=2e-3)


def test_a_force_that_is_known_makes_the_same_motion() -> None:
    """The force that holds the mean, as a static load of the same bodies with nothing prescribed."""
    balance = held(12.0, height=4e-5)
    options = Options(STEPS, tolerance=1e-10)
    exact = time_integration.integrate(balance, OMEGA, solved(balance), options)
    assert isinstance(balance.model, PrescribedModel)
    reaction = balance.model.reaction
    free = two_bodies()
    push = np.zeros(free.system.n_dof)
    push[reaction.dofs] = reaction.force(4e-5, exact.force.mean(axis=2)) + reaction.support * 4e-5
    loads = {**free.system.loads, "push": push}
    joints, basis = balance.contact.joints, balance.basis
    pushed = HarmonicBalance.of(
        replace(free, system=replace(free.system, loads=loads)), joints, basis,
        Excitation.of({"push": 1.0}, {1: {"shaker": 12.0}}), 2 * OMEGA,
    )  # fmt: skip
    motion = time_integration.integrate(pushed, OMEGA, solved(pushed), options)
    assert len(exact.hold_error) == len(PLATFORM)
    assert len(motion.hold_error) == 0
    np.testing.assert_allclose(motion.outputs, exact.outputs, atol=1e-6 * np.abs(exact.outputs).max())
    assert motion.energy.sum() == pytest.approx(exact.energy.sum(), rel=1e-6)


@pytest.mark.parametrize(
    ("friction", "gap", "status"), [(1e6, -1e-4, STICKS), (0.4, 1.0, SEPARATES)], ids=["stuck", "loose"]
)
def test_a_plain_march_comes_to_the_mean_of_a_stuck_and_of_a_loose_contact(friction, gap, status):
    """From rest at half the height: no balance tells the force."""
    balance = held(3.0, 3, friction=friction, gap=gap)
    lower = held(3.0, 3, 0.5 * HEIGHT, friction, gap)
    options = Options(64, tolerance=1e-7, accelerate=False, max_periods=400)
    motion = time_integration.integrate(balance, OMEGA, lower.evaluate(OMEGA, solved(lower).x), options)
    assert motion.periodic
    assert (motion.status == status).all()
    assert np.abs(motion.hold_error).max() < 1e-6 * HEIGHT


def test_the_mean_of_a_motion_that_never_repeats_itself_is_held() -> None:
    balance = held(12.0, 7, 4e-5)
    state = solved(balance)
    follower = Follower(MeanOptions(128))
    follower.start(balance, state)
    means = follower.mean(balance, OMEGA, lambda motion: motion.hold_error)
    assert means.is_stationary
    assert means.spread > 0.02
    assert 0 < np.abs(means.observed).max() < 1e-3 * 4e-5
    assert means.energy.sum() == pytest.approx(balance.energy(state).sum(), rel=0.02)


def test_multipliers_while_the_force_stays_are_those_by_hill() -> None:
    """Of a contact that lifts without friction, where Hill's method sees all that a perturbation does."""
    balance = held(12.0, 9, 4e-5, friction=0.0)
    state = solved(balance)
    hill = np.abs(np.exp(exponents.stability(balance, state).exponents * 2 * np.pi / OMEGA))
    multipliers = np.abs(np.exp(floquet.floquet_exponents(balance, state, Options(STEPS)) * 2 * np.pi / OMEGA))
    np.testing.assert_allclose(np.sort(hill)[-4:], np.sort(multipliers)[-4:], rtol=0.01)


def test_what_drives_a_motion_away_in_time_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the whole monodromy matrix, and by marched periods, of which the force is no part."""
    monkeypatch.setattr(floquet, "RULES", replace(floquet.RULES, dense=0))
    for force, height, stable in ((1.5, 4e-5, True), (30.0, HEIGHT, False)):
        balance = held(force, 9, height)
        state, options = solved(balance), Options(STEPS, tolerance=1e-9)
        complete = np.exp(floquet.floquet_exponents(balance, state, options).real.max() * 2 * np.pi / OMEGA)
        assert (complete < 1) == stable
        assert floquet.largest_multiplier(balance, state, options) == pytest.approx(
            complete, rel=0.2 if stable else 0.02
        )


def test_a_push_decides_where_sliders_just_reach_their_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """There differences have a kink: their largest multiplier is above 1 at a motion that is stable."""
    model = prescribe(two_bodies(), PLATFORM, "height", support=4e5)
    kink = problem(model, HEIGHT, 6.0, (0.0, 1.0, -1e-5), tuple(range(8)))
    options = Options(STEPS, tolerance=1e-9)
    complete = floquet.largest_multiplier(kink, solved(kink), options)
    monkeypatch.setattr(floquet, "RULES", replace(floquet.RULES, dense=0))
    assert complete < 0.9
    for balance, leaves in ((kink, False), (held(12.0, 7, 4e-5), True), (held(30.0, 7), True)):
        assert (floquet.largest_multiplier(balance, solved(balance), options) > 1.001) == leaves


def test_life_in_time_is_that_of_many_harmonics() -> None:
    problem = WearProblem(
        balance=held(6.0, 9), mission=(Duty(AtFrequency("tip", OMEGA)),),
        wear=JointWear.of("energy", coefficient=1e-9), area=np.full(3, 1e-4), lost_below=0.5,
    )  # fmt: skip
    with growth_by_few_modes():
        run = evolve(error_controlled.Rule(problem, Tolerance(0.01, 1e-4)))
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, 1e-4), motion="time"))
    assert worn.ended is run.ended is WearEnd.PRELOAD_LOST
    assert worn.in_time.all()
    assert worn.is_stationary.all()
    assert cycles_to_preload(worn, 0.5) == pytest.approx(cycles_to_preload(run, 0.5), rel=0.02)
