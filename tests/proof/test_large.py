"""`prove bench --fe`: costs of large models by every method."""

import pytest

from proof import large_fe


def test_a_reduction_is_measured_in_four_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_fe, "MODES", 4)
    rows = [large_fe.measure(size, way, n_patch=3) for size in ((4, 1), (12, 2)) for way in large_fe.WAYS]
    assert [row.way for row in rows] == [*large_fe.WAYS] * 2
    assert rows[0].dofs == rows[1].dofs < rows[2].dofs
    assert len({row.masters for row in rows}) == 1
    smaller = large_fe.measure((4, 1), "flexibility", n_patch=3)
    assert smaller.first_hz == pytest.approx(rows[0].first_hz, rel=1e-3)  # by other shapes
    assert smaller.masters == 0
    text = large_fe.as_text(rows)
    assert "by hand: seconds grow with the power" in text
    with pytest.raises(ValueError, match='no way "by foot": there are product, flexibility'):
        large_fe.run(["30k"], lambda message: None, ["by foot"])
    with pytest.raises(ValueError, match='no size "30": there are 30k'):
        large_fe.run(["30"], lambda message: None)
