"""`prove large`: costs of large models by both ways."""

import pytest

from proof import large_fe


def test_a_reduction_is_measured_by_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_fe, "MODES", 4)
    rows = [large_fe.measure(size, way, n_patch=3) for size in ((4, 1), (12, 2)) for way in large_fe.WAYS]
    assert [row.way for row in rows] == [*large_fe.WAYS] * 2
    assert rows[0].dofs == rows[1].dofs < rows[2].dofs
    assert rows[1].first_hz == pytest.approx(rows[0].first_hz, rel=1e-3)  # by other shapes
    assert [row.masters > 0 for row in rows[:2]] == [True, False]
    assert len(large_fe.as_text(rows).splitlines()) == 4
    with pytest.raises(ValueError, match='no size "30": there are 30k'):
        large_fe.run(["30"], lambda message: None)
