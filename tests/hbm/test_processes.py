"""Work shared by two processes: the results of one, whatever becomes of the other."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from multiprocessing import active_children

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing
from tribodyn.hbm import processes, threads
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.stability import exponents

pytestmark = pytest.mark.skipif(not processes.FORKS, reason="this system cannot fork")


@pytest.fixture(autouse=True)
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    with threads.limited(2):
        yield
    assert active_children() == []


def test_every_second_item_is_done_by_the_other_process_and_all_are_told():
    told: list[int] = []
    found = processes.shared(lambda i: (i * i, os.getpid()), 7, told.append)
    assert [square for square, _ in found] == [0, 1, 4, 9, 16, 25, 36]
    assert [worker == os.getpid() for _, worker in found] == [True, False] * 3 + [True]
    assert told == [1, 2, 3, 4, 5, 6, 7]
    with threads.limited(1):
        assert set(processes.shared(lambda i: os.getpid(), 3)) == {os.getpid()}


def test_what_the_other_process_does_not_do_is_done_here():
    here = os.getpid()

    def dies(i: int) -> tuple[int, int]:
        if i == 3 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return i, os.getpid()

    found = processes.shared(dies, 6)
    assert [i for i, _ in found] == list(range(6))
    assert found[3][1] == found[5][1] == here

    def fails(i: int) -> int:
        if i == 3:
            raise ValueError("no third")
        return i

    with pytest.raises(ValueError, match="no third"):
        processes.shared(fails, 6)


def test_the_stability_of_a_curve_is_shared():
    balance = Duffing().balance()
    branch = arc_length.follow(balance, 0.5, 5.0)
    two = exponents.mark(balance, branch)
    with threads.limited(1):
        one = exponents.mark(balance, branch)
    assert not one.stable.all()
    np.testing.assert_array_equal(two.stable, one.stable)
    np.testing.assert_array_equal(two.leading, one.leading)
    assert two.bifurcations == one.bifurcations
    assert len(one.bifurcations) >= 2
