"""Modes matched by the kind of their motion."""

import numpy as np
import pytest

from proof.cases.rig.joints import match_kinds


def test_a_mode_of_its_kind_is_taken_before_a_nearer_one_of_another_kind() -> None:
    share = np.array([[0.9, 0.1], [0.2, 0.8], [0.7, 0.3]])
    np.testing.assert_array_equal(match_kinds(np.array([9.0, 10.0, 20.0]), share, [(0, 10.0), (1, 10.0)]), [0, 1])
    np.testing.assert_array_equal(match_kinds(np.array([9.0, 10.0, 20.0]), share, [(0, 10.0), (0, 12.0)]), [0, 2])


def test_more_modes_than_there_are_cannot_be_matched() -> None:
    with pytest.raises(ValueError, match="compute more modes"):
        match_kinds(np.ones(1), np.ones((1, 1)), [(0, 1.0), (0, 2.0)])
