"""`tribodyn bench --scaling`: every size in its own process, every point converged, the slope that of its rows."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import leave
from tribodyn.workflows.benchmarks import scaling


def test_small_sizes_converge_and_memory_is_their_own(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scaling, "QUICK", (5, 3))
    monkeypatch.setenv("PYTHONPATH", str(Path(scaling.__file__).parents[3]))  # the measured processes start afresh
    picture = tmp_path / "scaling.png"
    code, out, err = leave(["bench", "--scaling", "--quick", "--json", "--out", str(picture)], capsys)
    assert code == 0, err
    numbers = json.loads(out)
    assert [row["contact_dofs"] for row in numbers["rows"]] == [27, 75]
    for row in numbers["rows"]:
        assert row["converged"] == row["points"] >= scaling.POINTS
        assert row["compliance_error"] < 1e-7
        assert 5e7 < row["peak_bytes"] < 4e9
    assert picture.is_file()


def test_the_slope_is_the_exponent() -> None:
    row = scaling.SizeCost(5, 75, 92, 1.0, 0.1, 1.0, 40, 40, 200, 1e-9, 10**9)
    rows = [replace(row, contact_dofs=n, response_seconds=3e-4 * n**1.25) for n in (75, 243, 507, 2883)]
    assert scaling.slope(rows) == pytest.approx(1.25, rel=1e-12)
    assert "power of 1.25" in scaling.as_text(rows)
    assert np.isfinite(scaling.slope(rows[:2]))
