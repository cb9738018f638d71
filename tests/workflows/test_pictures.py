"""Every picture is drawn and is not blank; geometry of the pictures is checked where it carries meaning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.pictures import assert_not_blank
from tests.helpers.synthetic_result import result
from tribodyn.workflows.pictures import plots, render, view


def test_curves_and_maps(tmp_path: Path) -> None:
    written = plots.draw(result(), tmp_path)
    names = {"frf", "cycles_per_step", "peak", "preload", "depth", "energy", "status", "hysteresis", "patch"}
    assert {path.stem for path in written} == names
    for path in written:
        assert_not_blank(path)


def test_a_response_alone_is_drawn_too(tmp_path: Path) -> None:
    written = plots.draw(replace(result(), wear=None, fields=None, loops=None), tmp_path)
    assert [path.stem for path in written] == ["frf"]
    assert_not_blank(written[0])


def test_renders(tmp_path: Path) -> None:
    written = render.draw(result(), tmp_path)
    assert {path.stem for path in written} == {"part", "contact"}
    for path in written:
        assert_not_blank(path)


def test_missing_libraries_are_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render, "PROBE", "import os; os.abort()")
    with pytest.raises(render.RenderingUnavailable, match=r"install the system libraries .*libegl1"):
        render.check()


def test_shares_of_the_patch_have_the_area_of_its_faces() -> None:
    patch = result().patch
    assert patch is not None
    corners, pair = patch.shares(patch.flat)
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs(np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1))
    assert area.sum() == pytest.approx(0.05 * 0.02)
    assert set(pair) == set(range(len(patch.area)))


def test_swing_is_the_largest_vibration_over_the_cycle() -> None:
    displacement = np.zeros((2, 3, 3))
    displacement[1, 2] = [5.0, 3.0, 4.0]
    assert np.abs(view.swing(displacement, (0, 1))[1, 2]) == pytest.approx(5.0, rel=2e-3)  # 64 instants of a cycle
    assert not view.swing(displacement, (0, 1))[0].any()
    assert view.at_rest(displacement, (0, 1))[1, 2] == 5.0


def test_swing_is_that_of_the_harmonics_kept() -> None:
    """cos t - cos 3t reaches 1.54, cos t - cos 2t would reach 2."""
    displacement = np.zeros((1, 3, 4))
    displacement[0, 0] = [1.0, 0.0, -1.0, 0.0]  # without harmonic 0
    assert np.abs(view.swing(displacement, (1, 3))[0, 0]) == pytest.approx(8 / 27**0.5, rel=5e-3)
    assert not view.at_rest(displacement, (1, 3)).any()


@pytest.mark.parametrize(("value", "nice"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (7.0, 5.0), (0.3, 0.2), (5e3, 5e3)])
def test_factors_are_round(value: float, nice: float) -> None:
    assert view.nice(value) == nice
