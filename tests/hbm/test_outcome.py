"""Ends of curves and wear runs: every member is read back from its sentence, whatever details follow."""

from __future__ import annotations

import pytest

from tribodyn.hbm.outcome import BranchEnd, End, WearEnd


@pytest.mark.parametrize("member", [*BranchEnd, *WearEnd], ids=str)
def test_a_member_is_read_back_from_its_sentence(member: End) -> None:
    assert type(member).of(member.say()) is member
    assert type(member).of(member.say(" 0.001 of its first value")) is member


def test_an_unknown_sentence_is_refused() -> None:
    with pytest.raises(ValueError, match='"lunch" is no WearEnd'):
        WearEnd.of("lunch")
    assert [end for end in WearEnd if end.lost] == [WearEnd.LOST, WearEnd.PRELOAD_LOST, WearEnd.LOST_AT_REST]
