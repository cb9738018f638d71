"""Wear along the motion in time beside balances with many harmonics; the motion it follows, and its stability."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.helpers.pressed_body import N_PAIR, balance_of, growth_by_few_modes, pressed_body, wear_problem
from tests.helpers.three_pairs import FLIPS_AT, three_pairs
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.outcome import SolveEnd, WearEnd
from tribodyn.hbm.stability import floquet
from tribodyn.hbm.stability.floquet import HILL, MULTIPLIERS, is_stable
from tribodyn.hbm.time import mean_motion, time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanMotion, MeanOptions
from tribodyn.hbm.time.period_search import Period, PeriodSearch, PerturbedMotion, perturb
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.hbm.wear import law as wear_law, wear_state
from tribodyn.hbm.wear.history import WearHistory, WearRow, cycles_to_preload, history
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled
from tribodyn.hbm.wear.steady_motion import untaken_periodic_share
from tribodyn.hbm.wear.step_control import Tolerance, measured_error
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem

LEFT = 0.5  # share of the preload


@pytest.fixture(scope="module")
def problem() -> WearProblem:
    return wear_problem(balance=balance_of(pressed_body(), tuple(range(8))), lost_below=LEFT)


def flipping() -> WearProblem:
    """A motion that takes two periods where the balance has one."""
    flips = three_pairs(friction=0.05, static=30.0, shaker=60.0, top=7)
    site = AtFrequency(flips.compliance.output_names[0], FLIPS_AT)
    given = {"balance": flips, "mission": (Duty(site),), "area": np.full(flips.contact.n_pair, 1e-4)}
    return wear_problem(**given, lost_below=0.5)


@pytest.fixture(scope="module")
def run(problem: WearProblem) -> WearHistory:
    with growth_by_few_modes():  # none of which grows
        return evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4)))


def test_life_in_time_is_that_of_many_harmonics(problem: WearProblem, run: WearHistory) -> None:
    found = evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4), motion="time"))
    assert found.end.kind is WearEnd.PRELOAD_LOST
    assert found.in_time[:-1].all()
    assert found.scatter == 0.0
    assert cycles_to_preload(found, LEFT) == pytest.approx(cycles_to_preload(run, LEFT), rel=5e-3)
    assert found.energy[0].sum() == pytest.approx(run.energy[0].sum(), rel=5e-3)
    assert 0.95 < found.preload[-1] / (LEFT * found.preload[0]) < 1  # the last step ends where life does


def test_wear_in_time_goes_on_where_the_balance_has_no_solution(
    problem: WearProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4), motion="time"), 4)
    lost = SolveEnd.NO_DESCENT.say(" here")
    monkeypatch.setattr(
        wear_state,
        "newton",
        SimpleNamespace(Solution=newton.Solution, solve=lambda *of: replace(newton.solve(*of), outcome=lost)),
    )
    found = evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4), motion="time"), 4)
    assert len(found.cycles) == 4
    np.testing.assert_array_equal(found.depth, whole.depth)
    np.testing.assert_array_equal(found.displacement[1:], found.displacement[:1].repeat(3, axis=0))  # that of the first
    assert found.without_balance.tolist() == [1, 2, 3]
    assert not len(whole.without_balance)


def test_a_motion_that_is_the_balances_is_not_followed(
    problem: WearProblem, run: WearHistory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever Hill's method says of it."""
    monkeypatch.setattr(error_controlled, "with_growth", lambda _, state, always: replace(state, growth=1.0))
    found = evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4), motion="machine"), max_steps=3)
    assert not found.in_time.any()
    np.testing.assert_array_equal(found.depth, run.depth[:3])


def test_a_balance_that_is_stable_again_is_taken_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = flipping()
    first = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion="machine"), 3)
    assert first.in_time.all()
    until = first.cycles[1]
    monkeypatch.setattr(
        error_controlled,
        "with_growth",
        lambda _, state, always: replace(state, growth=1.0 if state.cycles <= until else -1.0),
    )
    found = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion="machine"), 4)
    assert found.in_time.tolist() == [True, True, False, False]
    assert "from 0 cycles on" in str(found.end)


@pytest.mark.parametrize("motion", ["machine", "time"])
def test_a_motion_that_a_machine_leaves_is_worn_in_time_and_resumes_bit_for_bit(
    motion: Literal["machine", "time"],
) -> None:
    problem = flipping()
    flips = problem.balance
    rows: list[WearRow] = []
    whole = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion=motion), 4, rows.append)
    assert whole.in_time.all()
    assert "followed in time for 100% of the cycles" in str(whole.end)
    follower = Follower(MeanOptions(128))
    follower.start(flips, newton.solve(flips, FLIPS_AT, whole.displacement[0].reshape(3, 3, -1)).state)
    alone = follower.mean(flips, FLIPS_AT, lambda period: period.energy)
    assert whole.energy[0].sum() == pytest.approx(alone.energy.sum(), rel=0.01)
    along_balance = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6)), 1).energy[0].sum()
    assert abs(whole.energy[0].sum() / along_balance - 1) > 0.04
    begun = history(rows[:3], WearEnd.UNFINISHED.say())
    resumed = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion=motion), 4, resume=begun)
    for name in ("cycles", "depth", "energy", "moving", "spread"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(whole, name))


def test_a_law_by_slip_path_sees_a_motion_as_it_sees_a_balance(problem: WearProblem) -> None:
    balance = problem.balance
    state = newton.solve_from_rest(balance, 420.0).state
    motion = time_integration.integrate(balance, 420.0, state, Options(256))
    archard = JointWear.of("archard", coefficient=1e-9)
    rates = []
    for own in (None, motion):
        of_joint = (problem.area, archard.numbers, np.zeros(N_PAIR), 0.0, "contact")
        seen = wear_law.Exposure(balance, state, *of_joint, own)
        rates.append(wear_law.depth_rate("archard", seen))
    np.testing.assert_allclose(*rates, rtol=0.02)


def test_a_periodic_motion_is_followed_and_one_that_a_push_drives_away_is_left() -> None:
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    state = newton.solve_from_rest(balance, 420.0).state
    exact = time_integration.integrate(balance, 420.0, state, Options(128))
    follower = Follower(MeanOptions(128))
    follower.start(balance, state)
    found = follower.mean(balance, 420.0, lambda motion: motion.energy)
    assert found.spread == 0.0
    assert found.energy.sum() == pytest.approx(exact.energy.sum(), rel=1e-3)
    np.testing.assert_array_equal(found.seen, found.energy)
    assert len(found.normal_force) == N_PAIR
    flips = three_pairs(friction=0.0, static=30.0, shaker=60.0, top=15)
    state = newton.solve_from_rest(flips, FLIPS_AT).state
    follower = Follower(MeanOptions(128))
    follower.start(flips, state)
    left = follower.mean(flips, FLIPS_AT, lambda motion: np.sqrt(2 * motion.outputs.var(axis=1)))
    periodic = time_integration.integrate(flips, FLIPS_AT, state, Options(128))
    assert periodic.periodic
    assert abs(left.amplitude[0] / np.sqrt(2 * periodic.outputs[0].var()) - 1) > 1e-3
    assert is_stable(flips, state, verify(flips, state, Options(128)), Options(128)) == (False, MULTIPLIERS)
    assert is_stable(flips, state, None, Options(128)) == (False, HILL)


@pytest.mark.parametrize(("finest", "after", "left"), [(128, 64, False), (256, 64, True), (128, 8, True)])
def test_a_slow_push_drives_a_motion_away_only_if_it_grows_in_finer_steps(
    finest: int, after: int, left: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """finest : steps a period up to which it grows; after : periods in which it has left"""
    seen = []

    def grows(plain: PeriodSearch, found: Period, every: int) -> PerturbedMotion:
        seen.append(plain.options.steps)
        if plain.options.steps > finest:
            return perturb(plain, found, every)
        motion = found.end
        while plain.periods < after:
            motion = plain.step(motion).end
        return PerturbedMotion(True, motion)

    monkeypatch.setattr(mean_motion, "perturb", grows)
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    follower = Follower(MeanOptions(128))
    follower.start(balance, newton.solve_from_rest(balance, 420.0).state)
    follower.mean(balance, 420.0, lambda motion: motion.energy, 0.05)
    assert bool(follower.stored_state()[2]) is left  # whether it passes on as a motion that does not repeat itself
    assert seen == [128, 256][: 1 + (after > follower.options.search)]


def test_a_motion_that_takes_two_periods_is_told() -> None:
    """By its work of two periods in turn."""
    flips = three_pairs(friction=0.05, static=30.0, shaker=60.0, top=7)
    follower = Follower(MeanOptions(128))
    follower.start(flips, newton.solve_from_rest(flips, FLIPS_AT).state)
    works = []

    def see(motion: time_integration.PeriodicMotion) -> np.ndarray:
        works.append(motion.energy.sum())
        return motion.energy

    found = follower.mean(flips, FLIPS_AT, see)
    late = np.array(works[-8:])  # of a block
    assert late[::2] == pytest.approx(late[0], rel=1e-3)
    assert abs(late[1] / late[0] - 1) > 0.1
    assert found.spread == pytest.approx(abs(late[1] - late[0]) / late[:2].sum(), rel=0.05)
    np.testing.assert_array_equal(found.seen, found.energy)


def test_a_motion_that_passes_is_marched_as_far_as_each_place_asks() -> None:
    flips = three_pairs(friction=0.05, static=30.0, shaker=60.0, top=7)
    follower = Follower(MeanOptions(128, accuracy=0.02))
    follower.start(flips, newton.solve_from_rest(flips, FLIPS_AT).state)
    settled, passed, known = (follower.mean(flips, FLIPS_AT, lambda motion: motion.energy, a) for a in (1.0, 1.0, 0.02))
    again = Follower(MeanOptions(128, accuracy=0.02))
    again.take_up(flips, follower.stored_state())
    assert settled.periods > 2 * passed.periods == 2 * follower.options.block
    assert passed.error > 0.02 >= known.error
    assert passed.energy.sum() == pytest.approx(settled.energy.sum(), rel=0.01)
    later = [one.mean(flips, FLIPS_AT, lambda motion: motion.energy, 1.0) for one in (follower, again)]
    np.testing.assert_array_equal(later[1].energy, later[0].energy)


def test_periods_go_to_states_by_the_cycles_that_they_stand_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates that scatter about a constant: a life of known length, its first hundredth in few of its steps.

    By steps held to the cycles passed, not to those of a life, each tenfold of cycles would take as many.
    """
    problem, scale, scatter = flipping(), 1e-6, 0.2
    rng, gap, all_asked = np.random.default_rng(4), problem.balance.contact.gap, []

    def mean(self: Follower, balance: HarmonicBalance, omega: float, see: object, asked: float) -> MeanMotion:
        all_asked.append(asked)
        periods = max(8, int((scatter / asked) ** 2)) if np.isfinite(asked) else 8
        error = scatter / np.sqrt(periods)
        rate = np.full(len(gap), 1e-14 * (1 + error * rng.normal()))
        force = np.maximum(1 - (balance.contact.gap - gap) / scale, 0.0)
        return MeanMotion(rate, force, rate, np.zeros(1), scatter, error, is_stationary=True, periods=periods)

    monkeypatch.setattr(Follower, "mean", mean)
    found = evolve(error_controlled.Rule(problem, Tolerance(0.02, scale), motion="time"))
    life = found.cycles[-1]
    assert life == pytest.approx(LEFT * scale / 1e-14, rel=0.05)
    early = found.cycles < 0.01 * life
    assert early.sum() < 0.25 * len(early)
    assert (found.cycles_in_step * found.mean_error).max() < 0.02 * life
    assert min(all_asked) * found.cycles_in_step.max() == pytest.approx(0.02 * life, rel=1.5)  # of the longest step
    assert found.scatter < measured_error(found, Tolerance(0.02, scale)).cycles < 0.1


def test_the_standard_error_of_a_mean_covers_its_deviation() -> None:
    """Autoregression as correlated as the beam's work; the mean of n deviates by s / (1 - r) / n^0.5."""
    r, n, rng = 0.3, 64, np.random.default_rng(1)
    noise = rng.normal(0.0, 0.1, 400 * n)
    series = 1.0 + lfilter([1.0], [1.0, -r], noise)
    windows = series.reshape(-1, n)
    errors = np.array([mean_motion._standard_error(window) for window in windows])
    exact = 0.1 / (1 - r) / np.sqrt(n)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(exact, rel=0.2)
    assert np.mean(np.abs(windows.mean(axis=1) - 1) <= 2 * errors) > 0.93


def test_a_periodic_motion_that_a_run_passed_by_is_told(problem: WearProblem, run: WearHistory) -> None:
    """The work of a run halved, as if a transient had been followed; and one whose balance's motion does not stay."""
    short = evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4), motion="time"), 3)
    assert untaken_periodic_share(problem, short, 3) == 0.0
    half = replace(run, energy=0.5 * run.energy, spread=np.full(len(run.cycles), 0.3))
    assert untaken_periodic_share(problem, half, 3) == pytest.approx(-0.5, rel=0.02)
    flips = flipping()
    passed = evolve(error_controlled.Rule(flips, Tolerance(0.05, 1e-6), motion="machine"), 3)
    assert passed.spread is not None
    assert passed.spread.min() > 0.05
    assert untaken_periodic_share(flips, passed, 3) == 0.0


def test_the_largest_multiplier_without_the_monodromy_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    state = newton.solve_from_rest(balance, 420.0).state
    options = Options(64, tolerance=1e-9)
    flips = three_pairs(friction=0.0, static=30.0, shaker=60.0, top=15)
    unstable = newton.solve_from_rest(flips, FLIPS_AT).state
    whole = [floquet.largest_multiplier(b, s, options) for b, s in ((balance, state), (flips, unstable))]
    monkeypatch.setattr(floquet, "RULES", replace(floquet.RULES, dense=0))
    found = [floquet.largest_multiplier(b, s, options) for b, s in ((balance, state), (flips, unstable))]
    assert found[0] == pytest.approx(whole[0], rel=0.2)  # any value below 1 does
    assert max(found[0], whole[0]) < 1 < whole[1]
    assert found[1] == pytest.approx(whole[1], rel=0.01)


def test_life_is_as_exact_where_little_is_left_to_wear(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate in proportion to the preload: it falls exponentially, and half of a life passes below a tenth of it."""
    problem, scale = replace(flipping(), lost_below=1e-3), 1e-6
    gap = problem.balance.contact.gap

    def mean(self: Follower, balance: HarmonicBalance, omega: float, see: object, asked: float) -> MeanMotion:
        left = np.maximum(1 - (balance.contact.gap - gap) / scale, 0.0)
        return MeanMotion(left, left, 1e-14 * left, np.zeros(1), 0.0, 0.0, is_stationary=True, periods=8)

    monkeypatch.setattr(Follower, "mean", mean)
    found = evolve(error_controlled.Rule(problem, Tolerance(0.05, scale), motion="time"))
    for share in (0.1, 0.01, 1e-3):
        assert cycles_to_preload(found, share) == pytest.approx(np.log(1 / share) * scale / 1e-14, rel=0.01)
