"""Peers are held against this program by their own coefficients."""

from __future__ import annotations

import numpy as np

from proof import peers
from tribodyn.hbm import newton


def test_coefficients_of_a_peer_are_solved_again():
    balance, messages = peers.chain(2, 3)
    solution = newton.solve_from_rest(balance, 0.6)
    assert solution.converged
    x = solution.state.x[:, 0].T
    assert (solution.state.cycle.status[:1] & 1).any()  # the first mass slips
    assert peers._difference(balance, 0.6, x) < 1e-7
    assert peers._difference(balance, 0.6, 1.001 * x) > 5e-4
    assert np.shape(messages["stiffness"]) == (2, 2)


def test_the_table_has_the_ratio_of_each_problem():
    race = peers.Race("a chain", 3, 50, 0.1, 60, 0.5, 1e-9)
    assert race.ratio == 5.0
    assert peers.as_records([race])[0]["ratio"] == 5.0
    assert " 5.0 " in peers.as_text([race])
