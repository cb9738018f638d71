"""Choice of harmonics: the estimate is the true change, and the set is the smallest that brute force finds."""

from itertools import combinations

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing, Lifting, rubbing_mass, rubbing_pairs
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.harmonic_choice import ChoiceOptions, NotSolved, choose, widened


def friction() -> tuple[HarmonicBalance, list[float]]:
    return rubbing_mass(n_samples=256), [1.45, 1.8]


def pairs() -> tuple[HarmonicBalance, list[float]]:
    return rubbing_pairs(n_samples=256), [300.0, 600.0]


def true_error(
    balance: HarmonicBalance, harmonics: tuple[int, ...], omega: list[float], x: list[np.ndarray], top: int
) -> float:
    """Change of the response when all harmonics to `top` are kept, at the worst frequency and output."""
    full = widened(balance, top)
    narrow = full.with_harmonics(harmonics)
    errors = []
    for w, start in zip(omega, x, strict=True):
        solution = newton.solve(full, w, narrow.basis.transfer(start, full.basis))
        assert solution.converged
        response = narrow.basis.transfer(narrow.outputs(narrow.evaluate(w, start)), full.basis)
        vibration = np.linalg.norm(response[:, full.basis.order > 0], axis=1)
        errors.append((np.linalg.norm(full.outputs(solution.state) - response, axis=1) / vibration).max())
    return float(max(errors))


def test_estimate_is_the_true_change_and_the_choice_meets_the_tolerance():
    for balance, omega in (friction(), pairs(), (Lifting().balance(n_samples=256), [0.7, 1.8])):
        for tolerance in (5e-2, 1e-2):
            choice = choose(balance, omega, ChoiceOptions(tolerance=tolerance, highest=13))
            error = true_error(balance, choice.harmonics, omega, list(choice.x), 16)
            np.testing.assert_allclose(choice.estimate.error, error, rtol=0.25)
            assert error < 1.25 * tolerance, choice.outcome
            assert choice.outcome.startswith(f"harmonics {', '.join(map(str, choice.harmonics))}: estimated")
            assert choice.balance.basis.harmonics == choice.harmonics
            assert 0 in choice.harmonics
            assert choice.history[0][0] == (0, 1)
            assert set(choice.estimate.shares).isdisjoint(choice.harmonics)
            solved_x = dict(zip(omega, choice.x, strict=True))
            repeated = choose(choice.balance, omega, ChoiceOptions(tolerance=tolerance, highest=13), solved_x)
            assert [harmonics for harmonics, _ in repeated.history] == [choice.harmonics]
            np.testing.assert_allclose(repeated.estimate.error, choice.estimate.error, rtol=1e-3)


def test_the_set_is_the_smallest_that_brute_force_finds():
    balance, omega = friction()
    tolerance, candidates = 2e-3, (2, 3, 4, 5, 6, 7)
    choice = choose(balance, omega, ChoiceOptions(tolerance=tolerance, highest=7))
    full = widened(balance, 7)
    enough = []
    for n in range(len(choice.harmonics)):
        for extra in combinations(candidates, n):
            saved = (0, 1, *extra)
            narrow = full.with_harmonics(saved)
            x = [newton.solve_from_rest(narrow, w).state.x for w in omega]
            if true_error(balance, saved, omega, x, 7) < tolerance:
                enough.append(saved)
        if enough:
            break
    assert choice.harmonics in enough


def test_a_symmetric_problem_needs_odd_harmonics_only():
    duffing = Duffing().balance(n_samples=256)
    choice = choose(duffing, [0.4, 0.9], ChoiceOptions(tolerance=1e-4))
    assert choice.harmonics == (1, 3, 5, 7) or choice.harmonics == (1, 3, 5)
    assert max(choice.estimate.shares[h] for h in (0, 2, 4, 6)) < 1e-10


def test_shares_add_up_to_the_estimate_and_are_cheap_to_leave_out():
    balance, omega = friction()
    wide = widened(balance, 9)
    saved = (0, 1, 3)
    x = newton.solve_from_rest(wide.with_harmonics(saved), omega[0]).state.x
    split = harmonic_choice.estimate(wide, saved, omega[0], x)
    full = harmonic_choice.estimate(wide, saved, omega[0], x, split=False)
    np.testing.assert_allclose(split.error, full.error, rtol=1e-2)
    assert split.error <= sum(split.shares.values()) * 1.01
    assert set(split.shares) == set(range(15)) - set(saved)


def test_fewer_harmonics_share_the_linear_side():
    balance, omega = pairs()
    wide = widened(balance, 4)
    narrow = wide.with_harmonics((0, 1, 3))
    built = HarmonicBalance.of(
        balance.model, balance.contact.joints, narrow.basis, balance.excitation, balance.omega_max
    )
    a, b = newton.solve_from_rest(narrow, omega[0]), newton.solve_from_rest(built, omega[0])
    np.testing.assert_allclose(a.state.x, b.state.x, atol=1e-7 * np.abs(b.state.x).max())
    with pytest.raises(ValueError, match="not among those"):
        wide.with_harmonics((0, 1, 99))
    with pytest.raises(ValueError, match="which is not kept"):
        wide.with_harmonics((0, 2))


def test_it_says_what_it_could_not_do():
    balance, omega = friction()
    short = choose(balance, omega, ChoiceOptions(tolerance=1e-6, highest=3))
    assert "above the tolerance" in short.outcome
    assert short.outcome.endswith("allow harmonics above 3")
    options = ChoiceOptions(tolerance=1e-6, newton=newton.NewtonOptions(max_steps=0))
    unsolved = choose(short.balance, omega, options, dict(zip(omega, short.x, strict=True)))
    assert unsolved.harmonics == short.harmonics
    assert "above the tolerance 1.0e-06: no solution at 0.2" in unsolved.outcome
    with pytest.raises(NotSolved, match="harmonics cannot be chosen: no solution at"):
        choose(balance, omega, ChoiceOptions(newton=newton.NewtonOptions(max_steps=0)))
    with pytest.raises(ValueError, match="time samples cannot carry"):
        choose(balance, omega, ChoiceOptions(highest=100))
