"""Mistuned wheels at low damping: open contacts, and against the dense wheel."""

from tests.proof import mistuned


def test_every_pattern_of_open_contacts_is_solved_as_on_the_dense_wheel() -> None:
    found = list(mistuned.groups(1, 1, ("open",)))
    assert [group.damping for group in found] == list(mistuned.DAMPING)
    for group in found:
        assert not group.failed, group.line()
        assert group.dense_error < 1e-4, group.line()
