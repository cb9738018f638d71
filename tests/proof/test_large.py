"""`prove bench --fe` and `--contact`: costs of large models and large contacts by every method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proof import large_contact, large_fe


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


def test_an_assembly_is_measured_from_its_files_to_its_reduced_model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_fe, "MODES", 4)
    rows = [large_fe.measure_assembly((6, 2, 1, 1), way) for way in large_fe.WAYS[:2]]
    assert rows[0].dofs == rows[1].dofs
    assert rows[0].masters == rows[1].masters > 3 * 2 * 3 * 16  # two faces of three joints, the touched nodes of each
    stages = ["rest", "factor", "modes", "constraint modes", "projection"]
    assert list(rows[0].seconds) == ["files", "assembly", *stages]
    assert list(rows[1].seconds) == ["files", "assembly", "factor", "modes", "constraint modes", "projection"]
    assert "assembly" in large_fe.ASSEMBLIES


def test_both_ways_of_a_large_contact_are_measured_and_agree() -> None:
    ours, forces = large_contact.measure(3, 24, "residual_flexibility", 30)
    dense, theirs = large_contact.measure(3, 24, "craig_bampton", 30)
    assert ours.contact_dofs == dense.contact_dofs == 27
    assert ours.converged == ours.points == dense.points == 24
    assert ours.compliance_error < 1e-3
    assert np.abs(forces - theirs).max() < 1e-3 * np.abs(theirs).max()
    twice = replace(ours, contact_dofs=54, setup_seconds=2 * ours.setup_seconds, peak_bytes=4 * ours.peak_bytes)
    powers = large_contact.powers([ours, twice])
    assert powers["set-up"] == pytest.approx(1.0)
    assert powers["memory"] == pytest.approx(2.0)
    text = large_contact.as_text([dense, ours, twice])
    assert "residual_flexibility: powers of the contact DOFs: set-up 1.00" in text
    with pytest.raises(ValueError, match='no size "5k": there are 500, 1500, 3k, 12k, 48k'):
        large_contact.run(["5k"], lambda message: None)
