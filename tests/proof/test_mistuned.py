"""Mistuned wheels at low damping: every state of the contacts, against the dense wheel; what counts as wrong."""

from dataclasses import replace

import numpy as np
import pytest

from proof import mistuned
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS


@pytest.mark.parametrize(
    ("state", "damping"), [("open", ("0.05 %",)), ("slipping", mistuned.DAMPING), ("stuck", ("0.05 %",))]
)
def test_a_pattern_of_each_damping_is_solved_as_on_the_dense_wheel(
    state: str, damping: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of linear states at the least damping alone."""
    monkeypatch.setattr(mistuned, "DAMPING", damping)
    result = mistuned.run(1, 1, lambda sentence: None, (state,))
    assert [group.damping for group in result] == list(damping)
    for group in result:
        assert not group.wrong(1), group.line()
        assert (group.slipping > 0) == (state == "slipping"), group.line()


@pytest.mark.parametrize("kind", ["none", "refused", "other contacts", "none compared", "fewer compared", "differs"])
def test_what_is_not_solved_or_not_compared_does_not_pass(kind: str) -> None:
    good = mistuned.Group("0.1 %", "stuck", 4, {}, {}, 0.0, 2, 1e-6, 1.0)
    assert not good.wrong(2)
    changed = {
        "none": good,
        "refused": replace(good, solved=3, failed={2: "SolveFailed: lost"}),
        "other contacts": replace(good, solved=3, other={2: "contacts have status [2]"}),
        "none compared": replace(good, compared=0, dense_error=np.nan),
        "fewer compared": replace(good, compared=1),
        "differs": replace(good, dense_error=1.1e-4),
    }
    assert changed[kind].wrong(2) == (kind != "none")


def test_slipping_contacts_slip_and_stuck_ones_stick() -> None:
    equal = {"open": SEPARATES, "slipping": STICKS | SLIPS, "stuck": STICKS}
    for state in mistuned.STATES:
        assert [other for other, status in equal.items() if mistuned.is_in(state, np.full(3, status))] == [state]
    assert not mistuned.is_in("stuck", np.array([STICKS, SLIPS]))
    assert not mistuned.is_in("open", np.array([SEPARATES, STICKS]))
