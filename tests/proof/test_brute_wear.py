"""Two random scenes worn in time, and that a wrong life is seen."""

from dataclasses import replace

import pytest

from proof import brute_wear


@pytest.mark.slow
def test_lives_of_two_scenes_hold_in_time() -> None:
    rows = [row for first in (1, 4) for row in brute_wear.run(1, lambda line: None, first)]
    assert all(row.brute.opened > 0.5 for row in rows)
    assert [row.preload for row in rows] == pytest.approx([1.0, 1.0], abs=0.02)
    assert [row.doubt for row in rows] == pytest.approx([0.0, 0.0], abs=0.01)
    assert [row.outcome for row in rows] == ["held", "held"]
    for row in rows:  # matrices have no mesh: harmonics and wear steps make the error
        assert abs(row.value / row.brute.cycles - 1) < row.error + row.doubt
    for row in rows:
        wrong = replace(row, stated=True, error=0.05, value=1.2 * row.brute.cycles)
        assert wrong.outcome == "violated"
        assert replace(wrong, value=1.04 * row.brute.cycles).outcome == "held"


def test_a_scene_that_sticks_has_no_life_and_says_why() -> None:
    worn = brute_wear.life(replace(brute_wear.draw(1), shaken=1.0))
    assert worn.cycles is None
    assert "nothing slips any more" in worn.reason
