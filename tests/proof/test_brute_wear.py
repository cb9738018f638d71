"""The driver that `prove wear` holds stated lives against: its blocks of cycles are fine enough."""

from __future__ import annotations

import pytest

from tests.proof import brute_wear


def test_a_life_in_time_depends_little_on_the_depth_of_a_block() -> None:
    one = brute_wear.draw(1)
    coarse, lifts = brute_wear.life(one, 0.05)
    fine, _ = brute_wear.life(one, 0.025)
    assert lifts > 0
    assert coarse is not None
    assert fine is not None
    assert coarse == pytest.approx(fine, rel=0.05)
