"""Threads: every entry of the solver takes one by itself, gives back what it found, and minds who asks for more."""

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from tests.helpers.verification_models import oscillator
from tribodyn.hbm import newton, rest, threads
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import adaptive, arc_length, natural
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis

OMEGA = 100.0


def balance() -> HarmonicBalance:
    parameters = ContactParameters.of(("t1", "n"), [[1e4, 1e4]], friction=0.3)
    excitation = Excitation.of({"normal": 50.0}, {1: {"force": 10.0}})
    joint = Joint("joint", "jenkins", parameters)
    return HarmonicBalance.of(oscillator(1.0, 1e4, 0.02), joint, HarmonicBasis((0, 1), 64), excitation, 200.0)


def counts() -> set[int]:
    return {pool["num_threads"] for pool in ThreadpoolController().info() if pool["user_api"] == "blas"}


ENTRIES = {
    "newton": lambda b: newton.solve(b, OMEGA, b.stuck(OMEGA)),
    "from rest": lambda b: newton.solve_from_rest(b, OMEGA),
    "natural": lambda b: natural.follow(b, OMEGA, 1.1 * OMEGA, natural.Options(n_points=3)),
    "adaptive": lambda b: adaptive.follow(b, OMEGA, 1.1 * OMEGA),
    "arc length": lambda b: arc_length.follow(b, OMEGA, 1.1 * OMEGA),
    "at rest": lambda b: rest.displacement(b),
    "at a frequency": lambda b: AtFrequency("mass", OMEGA).solve(b),
    "at the peak": lambda b: AtPeak("mass", 80.0, 160.0, n_scan=5).solve(b),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_entry_called_from_python_takes_one_thread_and_gives_the_others_back(entry, monkeypatch):
    observed = []
    evaluate = HarmonicBalance.evaluate

    def watched(self, omega: float, x: np.ndarray, jacobian: bool = True):
        observed.append(counts())
        return evaluate(self, omega, x, jacobian)

    monkeypatch.setattr(HarmonicBalance, "evaluate", watched)
    with threadpool_limits(2, "blas"):
        before = counts()
        ENTRIES[entry](balance())
        assert counts() == before
    assert observed
    assert all(count == {1} for count in observed)


def test_who_asks_for_two_threads_has_two_outside_of_the_solver_and_the_limit_ends_with_its_context(monkeypatch):
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    inside = threads.single(counts)
    with threadpool_limits(1, "blas"):
        with threads.limited(1_000_000):  # which would never end
            assert counts() == {2}
            assert inside() == {1}
        with threads.limited(2):
            assert counts() == {2}
            with threads.limited(1):
                assert counts() == {1}
                assert inside() == {1}
            assert counts() == {2}
        assert counts() == {1}
        assert inside() == {1}
