"""Curves followed from both ends at once: the curve of one way, cut once, whatever the two processes do."""

from __future__ import annotations

import time
from collections.abc import Callable
from multiprocessing import active_children
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing, Lifting, rubbing_mass
from tribodyn.hbm import newton, processes, threads
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import two_ends
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import adaptive, arc_length, natural
from tribodyn.hbm.outcome import BranchEnd

pytestmark = pytest.mark.skipif(not processes.FORKS, reason="this system cannot fork")
POINTS = {natural: natural.Options(n_points=80)}


@pytest.fixture
def shares(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int] | None]:
    """Two processors, whatever this machine has; and how many points of either way each curve was made of."""
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    seen: list[tuple[int, int] | None] = []
    joined = two_ends._Meeting.joined

    def watched(self: two_ends._Meeting, stop: float) -> Branch | None:
        seen.append(self._cut)
        return joined(self, stop)

    monkeypatch.setattr(two_ends._Meeting, "joined", watched)
    return seen


def alone(method: ModuleType, balance: HarmonicBalance, start: float, stop: float, options: Any = None) -> Branch:
    branch: Branch = method.follow(balance, start, stop, options or POINTS.get(method))
    return branch


def both(
    method: ModuleType, balance: HarmonicBalance, start: float, stop: float, options: Any = None, on_point: Any = None
) -> Branch:
    with threads.limited(2):
        branch = two_ends.follow(method, balance, start, stop, options or POINTS.get(method), on_point)
    assert active_children() == []
    return branch


def equal(one: Branch, other: Branch) -> bool:
    """Whether two branches are the same to the last bit."""
    fields = ("parameter", "omega", "response", "contact", "energy", "newton_steps")
    alike = all(np.array_equal(getattr(one, name), getattr(other, name)) for name in fields)
    return alike and (one.end, one.folds, one.outcome) == (other.end, other.folds, other.outcome)


@pytest.mark.parametrize("method", [natural, arc_length, adaptive])
@pytest.mark.parametrize(("start", "stop"), [(0.3, 4.0), (4.0, 0.3)])
def test_a_smooth_curve_is_that_of_one_way(method, start, stop, shares):
    balance = rubbing_mass((0, 1, 2, 3))
    one, two = (way(method, balance, start, stop) for way in (alone, both))
    assert str(two.end) == str(one.end)
    assert min(shares[0]) > 0.1 * len(two.omega)
    assert two.omega[0] == start
    assert two.omega[-1] == stop
    assert np.all(np.diff(two.omega) * (stop - start) > 0)
    if method is natural:
        common, here, there = np.intersect1d(one.omega, two.omega, return_indices=True)
        assert len(common) >= POINTS[natural].n_points
        np.testing.assert_allclose(two.response[there], one.response[here], atol=1e-6 * np.abs(one.response).max())
        np.testing.assert_allclose(two.energy[there], one.energy[here], atol=1e-5 * one.energy.max())
    exact = newton.NewtonOptions(tolerance=1e-11)
    for i in range(0, len(two.omega), 4):  # each of its points is the point of the other curve at its frequency
        guess = one.contact[np.argmin(np.abs(one.omega - two.omega[i]))].reshape(1, 2, -1)
        there = newton.solve(balance, two.omega[i], guess, exact)
        assert there.converged
        np.testing.assert_allclose(two.contact[i], there.state.flat, atol=1e-6 * np.abs(one.contact).max())


@pytest.mark.parametrize(("start", "stop"), [(0.5, 5.0), (5.0, 0.5)])
def test_folds_are_passed_and_listed_once(start, stop, shares):
    duffing = Duffing()
    branch = both(arc_length, duffing.balance(), start, stop)
    assert str(branch.end) == str(arc_length.follow(duffing.balance(), start, stop).end)
    assert min(shares[0]) > 20
    amplitude = branch.amplitude("mass")
    assert np.abs(duffing.defect(branch.omega, amplitude)).max() < 1e-5
    exact = duffing.folds() if start > stop else duffing.folds()[::-1]
    np.testing.assert_allclose(branch.omega[list(branch.folds)], exact, rtol=1e-8)
    turns = np.flatnonzero(np.diff(branch.omega)[1:] * np.diff(branch.omega)[:-1] < 0) + 1
    assert tuple(turns) == branch.folds  # it turns back there and, where it was cut, goes on
    assert np.abs(np.diff(amplitude)).max() < 0.25 * amplitude.max()


@pytest.mark.parametrize(("start", "stop"), [(0.5, 5.0), (5.0, 0.5)])
@pytest.mark.parametrize("method", [natural, adaptive])
def test_a_sweep_jumps_as_it_does_in_its_own_sense(method, start, stop, shares):
    """The way from the stop jumps at another fold: nothing behind it is taken."""
    for balance in (Duffing().balance(), Lifting().balance(how="located")):
        one, two = (way(method, balance, start, stop) for way in (alone, both))
        assert str(two.end) == str(one.end)
        assert two.ended is BranchEnd.JUMPED
        assert min(shares[-1]) > 5
        if method is natural:
            np.testing.assert_array_equal(two.omega, one.omega)
            assert two.folds == one.folds
            np.testing.assert_allclose(two.contact, one.contact, atol=1e-6 * np.abs(one.contact).max())


def test_it_is_the_same_whichever_process_is_late(shares, monkeypatch):
    balance = Duffing().balance()
    told: list[float] = []
    for method in (natural, arc_length):
        prompt = both(method, balance, 0.5, 5.0)
        late_here = both(method, balance, 0.5, 5.0, on_point=lambda done, wanted: time.sleep(0.005))
        with monkeypatch.context() as patch:
            feed = two_ends._feed

            def late(*given: Any, feed: Callable[..., None] = feed) -> None:
                time.sleep(0.5)
                feed(*given)

            patch.setattr(two_ends, "_feed", late)
            late_there = both(method, balance, 0.5, 5.0, on_point=lambda done, wanted: told.append(done / wanted))
        assert equal(prompt, late_here)
        assert equal(prompt, late_there)
    assert None not in shares
    assert all(0 < share <= 1 for share in told)


def test_one_end_alone_is_todays_answer(shares, monkeypatch):
    undamped = Duffing(zeta=0.0, cubic=0.0).balance()
    one, two = (way(arc_length, undamped, 0.5, 1.0) for way in (alone, both))
    assert equal(one, two)  # there is no solution at the stop
    one, two = (way(arc_length, undamped, 0.5, 2.0) for way in (alone, both))
    assert "grows without bound" in str(one.end)
    assert two.ended is BranchEnd.ENDED
    assert str(two.end).startswith(f"{one.end}; followed from {2 / (2 * np.pi):.6g} Hz the response comes to 0.")
    assert np.array_equal(one.contact, two.contact)
    assert shares == [None, None]

    def refused(self: BaseProcess) -> None:
        raise OSError("no room")

    balance = rubbing_mass()
    monkeypatch.setattr(processes.get_context("fork").Process, "start", refused)
    assert equal(arc_length.follow(balance, 0.3, 4.0), both(arc_length, balance, 0.3, 4.0))


def test_ways_on_two_branches_do_not_meet(shares):
    """At 2.0 the response is on the upper branch from below, and on the lower one from rest."""
    balance = Duffing().balance()
    one, two = arc_length.follow(balance, 0.5, 2.0), both(arc_length, balance, 0.5, 2.0)
    assert shares == [None]
    assert np.array_equal(one.contact, two.contact)
    assert str(two.end).startswith(f"{one.end}; followed from {2 / (2 * np.pi):.6g} Hz the response comes to ")


def test_what_has_a_start_of_its_own_and_one_thread_go_one_way(shares):
    balance = Duffing().balance()
    guess = newton.solve_from_rest(balance, 0.5).state.x
    options = arc_length.Options(guess=guess)
    assert equal(arc_length.follow(balance, 0.5, 5.0, options), both(arc_length, balance, 0.5, 5.0, options))
    assert equal(arc_length.follow(balance, 0.5, 5.0), two_ends.follow(arc_length, balance, 0.5, 5.0))
    assert shares == []


def test_who_leaves_early_leaves_no_process(shares):
    def leave(done: int, wanted: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), threads.limited(2):
        two_ends.follow(natural, Duffing().balance(), 0.5, 5.0, None, leave)
    assert active_children() == []
