"""Wear along the motion in time beside balances with many harmonics; the motion it follows, and its stability."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.helpers.pressed_body import N_PAIR, balance_of, growth_by_few_modes, pressed_body, wear_problem
from tests.helpers.three_pairs import FLIPS_AT, three_pairs
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.harmonics import amplitude as amplitude_of
from tribodyn.hbm.outcome import SolveEnd, WearEnd
from tribodyn.hbm.quantity import SolvedCycle
from tribodyn.hbm.stability import floquet
from tribodyn.hbm.stability.floquet import HILL, MULTIPLIERS, is_stable
from tribodyn.hbm.time import mean_motion, time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanMotion, MeanOptions
from tribodyn.hbm.time.period_search import Period, PeriodSearch, PerturbedMotion, perturb
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.hbm.wear import law as wear_law, wear_problem as wear_state
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
    options = {"balance": flips, "mission": (Duty(site),), "area": np.full(flips.contact.n_pair, 1e-4)}
    return wear_problem(**options, lost_below=0.5)


@pytest.fixture(scope="module")
def run(problem: WearProblem) -> WearHistory:
    with growth_by_few_modes():  # none of which grows
        return evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4)))


def test_life_in_time_is_that_of_many_harmonics(problem: WearProblem, run: WearHistory) -> None:
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4), motion="time"))
    assert worn.end.kind is WearEnd.PRELOAD_LOST
    assert worn.in_time[:-1].all()
    assert worn.scatter == 0.0
    assert cycles_to_preload(worn, LEFT) == pytest.approx(cycles_to_preload(run, LEFT), rel=5e-3)
    assert worn.energy[0].sum() == pytest.approx(run.energy[0].sum(), rel=5e-3)
    assert 0.95 < worn.preload[-1] / (LEFT * worn.preload[0]) < 1  # the last step ends where life does


def test_wear_in_time_goes_on_where_the_balance_has_no_solution(problem, monkeypatch):
    complete = evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4), motion="time"), 4)
    lost = SolveEnd.NO_DESCENT.say(" here")
    monkeypatch.setattr(
        wear_state,
        "newton",
        SimpleNamespace(Solution=newton.Solution, solve=lambda *of: replace(newton.solve(*of), outcome=lost)),
    )
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4), motion="time"), 4)
    assert len(worn.cycles) == 5
    np.testing.assert_array_equal(worn.depth, complete.depth)
    np.testing.assert_array_equal(worn.displacement[1:], worn.displacement[:1].repeat(4, axis=0))  # that of the first
    assert worn.without_balance.tolist() == [1, 2, 3, 4]
    assert not len(complete.without_balance)


def test_a_motion_that_is_the_balances_is_not_followed(problem, run, monkeypatch):
    """Whatever Hill's method says of it."""
    monkeypatch.setattr(error_controlled, "with_growth", lambda _, state, always: replace(state, growth=1.0))
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, 2e-4), motion="machine"), max_steps=3)
    assert not worn.in_time.any()
    np.testing.assert_array_equal(worn.depth, run.depth[:4])


def test_a_balance_that_is_stable_again_is_taken_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = flipping()
    first = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion="machine"), 3)
    assert first.in_time.all()
    last_unstable = first.cycles[1]
    monkeypatch.setattr(
        error_controlled,
        "with_growth",
        lambda _, state, always: replace(state, growth=1.0 if state.cycles <= last_unstable else -1.0),
    )
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion="machine"), 4)
    assert worn.in_time.tolist() == [True, True, False, False, False]
    assert "from 0 cycles on" in str(worn.end)


@pytest.mark.parametrize("motion", ["machine", "time"])
def test_a_motion_that_a_machine_leaves_is_worn_in_time_and_resumes_bit_for_bit(motion):
    problem = flipping()
    flips = problem.balance
    rows: list[WearRow] = []
    complete = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion=motion), 4, rows.append)
    assert complete.in_time.all()
    assert "followed in time for 100% of the cycles" in str(complete.end)
    follower = Follower(MeanOptions(128))
    follower.start(flips, newton.solve(flips, FLIPS_AT, complete.displacement[0].reshape(3, 3, -1)).state)
    marched = follower.mean(flips, FLIPS_AT, lambda period: period.energy)
    assert complete.energy[0].sum() == pytest.approx(marched.energy.sum(), rel=0.01)
    amplitude = SolvedCycle.at_row(complete, 0, flips.basis, {}).amplitude
    assert amplitude == pytest.approx(marched.amplitude[0], rel=5e-3)
    assert amplitude != pytest.approx(amplitude_of(complete.response[0, 0], flips.basis.harmonics), rel=0.01)
    along_balance = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6)), 1).energy[0].sum()
    assert abs(complete.energy[0].sum() / along_balance - 1) > 0.04
    interrupted = history(rows[:3], WearEnd.UNFINISHED.say())
    resumed = evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-6), motion=motion), 4, resume=interrupted)
    for name in ("cycles", "depth", "energy", "moving", "spread"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(complete, name))


def test_a_law_by_slip_path_sees_a_motion_as_it_sees_a_balance(problem: WearProblem) -> None:
    balance = problem.balance
    state = newton.solve_from_rest(balance, 420.0).state
    motion = time_integration.integrate(balance, 420.0, state, Options(256))
    archard = JointWear.of("archard", coefficient=1e-9)
    rates = []
    for reference in (None, motion):
        of_joint = (problem.area, archard.numbers, np.zeros(N_PAIR), 0.0, "contact")
        exposures = wear_law.Exposure(balance, state, *of_joint, reference)
        rates.append(wear_law.depth_rate("archard", exposures))
    np.testing.assert_allclose(*rates, rtol=0.02)


def test_a_periodic_motion_is_followed_and_one_that_a_push_drives_away_is_left() -> None:
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    state = newton.solve_from_rest(balance, 420.0).state
    exact = time_integration.integrate(balance, 420.0, state, Options(128))
    follower = Follower(MeanOptions(128))
    follower.start(balance, state)
    means = follower.mean(balance, 420.0, lambda motion: motion.energy)
    assert means.spread == 0.0
    assert means.energy.sum() == pytest.approx(exact.energy.sum(), rel=1e-3)
    np.testing.assert_array_equal(means.observed, means.energy)
    assert len(means.normal_force) == N_PAIR
    flips = three_pairs(friction=0.0, static=30.0, shaker=60.0, top=15)
    state = newton.solve_from_rest(flips, FLIPS_AT).state
    follower = Follower(MeanOptions(128))
    follower.start(flips, state)
    irregular = follower.mean(flips, FLIPS_AT, lambda motion: np.sqrt(2 * motion.outputs.var(axis=1)))
    periodic = time_integration.integrate(flips, FLIPS_AT, state, Options(128))
    assert periodic.periodic
    assert abs(irregular.amplitude[0] / np.sqrt(2 * periodic.outputs[0].var()) - 1) > 1e-3
    assert is_stable(flips, state, verify(flips, state, Options(128)), Options(128)) == (False, MULTIPLIERS)
    assert is_stable(flips, state, None, Options(128)) == (False, HILL)


@pytest.mark.parametrize(("finest", "after", "left"), [(128, 64, False), (256, 64, True), (128, 8, True)])
def test_a_slow_push_drives_a_motion_away_only_if_it_grows_in_finer_steps(finest, after, left, monkeypatch):
    """finest : steps a period up to which it grows; after : periods in which it has left"""
    observed = []

    def grows(plain: PeriodSearch, period: Period, interval: int) -> PerturbedMotion:
        observed.append(plain.options.steps)
        if plain.options.steps > finest:
            return perturb(plain, period, interval)
        motion = period.end
        while plain.periods < after:
            motion = plain.step(motion).end
        return PerturbedMotion(True, motion)

    monkeypatch.setattr(mean_motion, "perturb", grows)
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    follower = Follower(MeanOptions(128))
    follower.start(balance, newton.solve_from_rest(balance, 420.0).state)
    follower.mean(balance, 420.0, lambda motion: motion.energy, 0.05)
    assert bool(follower.stored_state()[2]) is left  # whether it passes on as a motion that does not repeat itself
    assert observed == [128, 256][: 1 + (after > follower.options.search)]


def test_a_motion_that_takes_two_periods_is_told() -> None:
    """By its work of two periods in turn."""
    flips = three_pairs(friction=0.05, static=30.0, shaker=60.0, top=7)
    follower = Follower(MeanOptions(128))
    follower.start(flips, newton.solve_from_rest(flips, FLIPS_AT).state)
    works = []

    def see(motion: time_integration.PeriodicMotion) -> np.ndarray:
        works.append(motion.energy.sum())
        return motion.energy

    means = follower.mean(flips, FLIPS_AT, see)
    late = np.array(works[-8:])  # of a block
    assert late[::2] == pytest.approx(late[0], rel=1e-3)
    assert abs(late[1] / late[0] - 1) > 0.1
    assert means.spread == pytest.approx(abs(late[1] - late[0]) / late[:2].sum(), rel=0.05)
    np.testing.assert_array_equal(means.observed, means.energy)


def test_a_motion_that_passes_is_marched_as_far_as_each_place_asks() -> None:
    flips = three_pairs(friction=0.05, static=30.0, shaker=60.0, top=7)
    follower = Follower(MeanOptions(128, accuracy=0.02))
    follower.start(flips, newton.solve_from_rest(flips, FLIPS_AT).state)
    stationary, passing, precise = (
        follower.mean(flips, FLIPS_AT, lambda motion: motion.energy, a) for a in (1.0, 1.0, 0.02)
    )
    restored = Follower(MeanOptions(128, accuracy=0.02))
    restored.restore(flips, follower.stored_state())
    assert stationary.periods > 2 * passing.periods == 2 * follower.options.block
    assert passing.error > 0.02 >= precise.error
    assert passing.energy.sum() == pytest.approx(stationary.energy.sum(), rel=0.01)
    later = [item.mean(flips, FLIPS_AT, lambda motion: motion.energy, 1.0) for item in (follower, restored)]
    np.testing.assert_array_equal(later[1].energy, later[0].energy)


def test_periods_go_to_states_by_the_cycles_that_they_stand_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates that scatter about a constant: a life of known length, its first hundredth in few of its steps.

    By steps held to the cycles passed, not to those of a life, each tenfold of cycles would take as many."""
    problem, scale, scatter = flipping(), 1e-6, 0.2
    rng, gap, all_asked = np.random.default_rng(4), problem.balance.contact.gap, []

    def mean(self: Follower, balance: HarmonicBalance, omega: float, see: object, accuracies: float) -> MeanMotion:
        all_asked.append(accuracies)
        periods = max(8, int((scatter / accuracies) ** 2)) if np.isfinite(accuracies) else 8
        error = scatter / np.sqrt(periods)
        rate = np.full(len(gap), 1e-14 * (1 + error * rng.normal()))
        force = np.maximum(1 - (balance.contact.gap - gap) / scale, 0.0)
        return MeanMotion(rate, force, np.stack([rate, rate]), np.zeros(1), scatter, error, True, periods)

    monkeypatch.setattr(Follower, "mean", mean)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, scale), motion="time"))
    life = worn.cycles[-1]
    assert life == pytest.approx(LEFT * scale / 1e-14, rel=0.05)
    early = worn.cycles < 0.01 * life
    assert early.sum() < 0.25 * len(early)
    assert (worn.cycles_in_step * worn.mean_error).max() < 0.02 * life
    assert min(all_asked) * worn.cycles_in_step.max() == pytest.approx(0.02 * life, rel=1.5)  # of the longest step
    assert worn.scatter < measured_error(worn, Tolerance(0.02, scale)).cycles < 0.1


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
    worn = evolve(error_controlled.Rule(flips, Tolerance(0.05, 1e-6), motion="machine"), 3)
    assert worn.spread.min() > 0.05
    assert untaken_periodic_share(flips, worn, 3) == 0.0


def test_the_largest_multiplier_without_the_monodromy_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    balance = balance_of(pressed_body(), (0, 1, 2, 3))
    state = newton.solve_from_rest(balance, 420.0).state
    options = Options(64, tolerance=1e-9)
    flips = three_pairs(friction=0.0, static=30.0, shaker=60.0, top=15)
    unstable = newton.solve_from_rest(flips, FLIPS_AT).state
    exact = [floquet.largest_multiplier(b, s, options) for b, s in ((balance, state), (flips, unstable))]
    monkeypatch.setattr(floquet, "RULES", replace(floquet.RULES, dense=0))
    multiplier = [floquet.largest_multiplier(b, s, options) for b, s in ((balance, state), (flips, unstable))]
    assert multiplier[0] == pytest.approx(exact[0], rel=0.2)  # any value below 1 does
    assert max(multiplier[0], exact[0]) < 1 < exact[1]
    assert multiplier[1] == pytest.approx(exact[1], rel=0.01)


def test_life_is_as_exact_where_little_is_left_to_wear(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate in proportion to the preload: it falls exponentially, and half of a life passes below a tenth of it."""
    problem, scale = replace(flipping(), lost_below=1e-3), 1e-6
    gap = problem.balance.contact.gap

    def mean(self: Follower, balance: HarmonicBalance, omega: float, see: object, accuracies: float) -> MeanMotion:
        remaining = np.maximum(1 - (balance.contact.gap - gap) / scale, 0.0)
        return MeanMotion(remaining, remaining, np.outer([1e-14, 1.0], remaining), np.zeros(1), 0.0, 0.0, True, 8)

    monkeypatch.setattr(Follower, "mean", mean)
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.05, scale), motion="time"))
    for share in (0.1, 0.01, 1e-3):
        assert cycles_to_preload(worn, share) == pytest.approx(np.log(1 / share) * scale / 1e-14, rel=0.01)
