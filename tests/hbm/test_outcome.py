"""Ends of curves and wear runs: values that carry their sentence."""

from __future__ import annotations

import pytest

from tribodyn.hbm.outcome import BranchEnd, End, WearEnd


@pytest.mark.parametrize("member", [*BranchEnd, *WearEnd], ids=str)
def test_an_outcome_is_its_member_and_reads_as_a_sentence(member: End) -> None:
    messages = member.say(" 0.001 of its first value")
    assert messages.kind is member
    assert str(messages) == f"{member.value} 0.001 of its first value"
    assert messages != member.say()


def test_which_ends_are_losses() -> None:
    assert [end for end in WearEnd if end.lost] == [WearEnd.LOST, WearEnd.PRELOAD_LOST, WearEnd.LOST_AT_REST]
