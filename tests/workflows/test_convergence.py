"""Bounds of discretisation errors: against functions of the element size whose error is known."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tribodyn.workflows.accuracy.convergence import OBSERVED, Difference, bound, difference, has_settled

SIZES = (1.5, 2 / 3)  # of a coarser and of a finer mesh


def seen(answer: Callable[[float], float], sizes: tuple[float, ...] = SIZES) -> list[Difference]:
    return [difference(size, answer(size), answer(1.0)) for size in sizes]


@given(
    st.floats(0.75, 2.0),
    st.floats(-0.2, 0.2).filter(lambda c: abs(c) > 1e-6),
    st.floats(1.2, 2.2),
    st.floats(0.5, 0.85),
)
def test_an_order_in_the_range_is_observed(order: float, error: float, coarse: float, fine: float) -> None:
    """1 + c h^p, whose limit is 1: the error is bounded, and by not much more than the safety of three meshes."""
    differences = seen(lambda h: 1 + error * h**order, (coarse, fine))
    found, scale = bound(differences), 1 + abs(error)  # differences are relative to answers, not to the limit
    assert abs(error) * 0.999 < found * scale
    assert found < max(OBSERVED * abs(error) * scale**2, OBSERVED * abs(differences[0].change)) * 1.01


@pytest.mark.parametrize(("order", "least", "most"), [(4.0, 1.0, 6.0), (0.5, 0.75, 1.0)])
def test_other_orders_are_not_believed(order: float, least: float, most: float) -> None:
    """Fast convergence may be chance and is not counted; slow one is taken as the lowest order, with its safety."""
    assert least < bound(seen(lambda h: 1 + 0.01 * h**order)) / 0.01 < most


def test_a_difference_that_vanishes_by_chance_deceives_nobody() -> None:
    scattered = {1.5: 0.6, 1.0: 1.0, 2 / 3: 1.001}
    assert bound(seen(scattered.__getitem__)) == pytest.approx(OBSERVED * 0.4)
    up_and_down = {1.5: 1.01, 1.0: 1.0, 2 / 3: 1.02}
    assert bound(seen(up_and_down.__getitem__)) == pytest.approx(OBSERVED * 3 * 0.02 / 1.02)


def test_meshes_too_coarse_for_an_order_count_three_times() -> None:
    differences = seen(lambda h: 1 + 0.01 * h**2)
    assert bound(differences, settled=False) == pytest.approx(3 * abs(differences[1].change) / (1 - (2 / 3) ** 2))
    assert has_settled(differences)
    assert not has_settled([difference(2 / 3, 1.0, 2.0)])
    assert has_settled([difference(1.5, 1.0, 3.0)])  # a coarser mesh may be too coarse


def test_one_side_alone_is_of_first_order() -> None:
    assert bound([Difference(0.5, -0.01)]) == pytest.approx(0.02)
    assert bound([Difference(1.5, 0.01), Difference(2.0, 0.01)]) == pytest.approx(0.02)
    assert difference(0.5, 0.0, 0.0).change == 0.0
    assert difference(0.5, 0.0, 2.0).change == 1.0
