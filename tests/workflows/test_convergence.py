"""Bounds of discretisation errors: against functions of the element size whose error is known."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tribodyn.workflows.accuracy.convergence import (
    RESULTANT,
    SAFETY,
    UNSETTLED,
    Difference,
    bound,
    difference,
    has_settled,
)

SIZES = (1.5, 2 / 3)  # of a coarser and of a finer mesh


def seen(answer: Callable[[float], float], sizes: tuple[float, ...] = SIZES) -> list[Difference]:
    return [difference(size, answer(size), answer(1.0)) for size in sizes]


@given(
    st.floats(0.75, 2.0),
    st.floats(-0.2, 0.2).filter(lambda c: abs(c) > 1e-6),
    st.floats(1.2, 2.2),
    st.floats(0.5, 0.75),
)
def test_orders_in_the_range_are_bounded(order: float, error: float, coarse: float, fine: float) -> None:
    """1 + c h^p, whose limit is 1: the error is bounded, and by not much more than what both differences are worth."""
    differences = seen(lambda h: 1 + error * h**order, (coarse, fine))
    found, scale = bound(differences), 1 + abs(error)  # differences are relative to answers, not to the limit
    assert abs(error) * 0.98 < found * scale
    assert found < (3.2 if order > 1 else 1.01 * SAFETY) * abs(error) * scale**2 * coarse ** max(order - 1, 0)


@pytest.mark.parametrize("sizes", [SIZES, (1.7, 0.6), (2.0, 0.5)])
def test_first_order_has_the_safety(sizes: tuple[float, float]) -> None:
    assert bound(seen(lambda h: 10 + 1e-4 * h, sizes)) == pytest.approx(SAFETY * 1e-5, rel=1e-3)


def test_what_the_coarser_mesh_does_not_change_is_of_second_order() -> None:
    """An edge with a single element, which the finer mesh alone can halve."""
    halved = [Difference(1.5, 0.0), Difference(0.5, -0.03)]
    assert bound(halved) == pytest.approx(SAFETY * 0.04)


def test_a_difference_that_vanishes_by_chance_deceives_nobody() -> None:
    scattered = {1.5: 0.6, 1.0: 1.0, 2 / 3: 1.0}
    assert bound(seen(scattered.__getitem__)) == pytest.approx(SAFETY * 0.8 * 0.4)
    up_and_down = {1.5: 1.01, 1.0: 1.0, 2 / 3: 1.02}
    assert bound(seen(up_and_down.__getitem__)) > 0.04


def test_meshes_too_coarse_for_an_order_count_twice() -> None:
    differences = seen(lambda h: 1 + 0.01 * h**2)
    assert bound(differences, settled=False) == pytest.approx(UNSETTLED * bound(differences))
    assert has_settled(differences)
    assert not has_settled([difference(2 / 3, 1.0, 2.0)])
    assert not has_settled([difference(1.5, 1.0, 3.0)])


def test_one_side_alone_is_of_first_order() -> None:
    assert bound([Difference(0.5, -0.01)]) == pytest.approx(0.02)
    assert bound([Difference(1.5, 0.01), Difference(2.0, 0.01)]) == pytest.approx(0.02)
    assert difference(0.5, 0.0, 0.0).change == 0.0
    assert difference(0.5, 0.0, 2.0).change == 1.0


@pytest.mark.parametrize(("order", "times"), [(1, 1.1), (2, 2.0)])
def test_a_resultant_force_is_bounded_from_first_order_on(order: int, times: float) -> None:
    """With sizes 1.5 and 2/3 half of the coarser mesh counts 0.8 times a first-order error, 1.5 a second-order one."""
    found = bound(seen(lambda h: 10 + 1e-4 * h**order), coarser_counts=RESULTANT)
    assert found == pytest.approx(times * 1e-5, rel=0.03)
