"""The trade of the wear step on a small beam, and what its table says."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from proof import wear_steps
from tests.helpers.coarse_scenes import BEAM

SMALL = (*BEAM, "harmonics.samples=16")


@pytest.fixture(scope="module")
def table() -> wear_steps.WearStepTable:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wear_steps, "THESIS_STEPS", (0.5, 0.25))
        patch.setattr(wear_steps, "FINER_STEPS", (0.15,))
        patch.setattr(wear_steps, "REFERENCE_TOLERANCES", (0.5, 0.2))
        patch.setattr(wear_steps, "TOLERANCES", ())  # those of the reference are rows too
        return wear_steps.compare("beam", lambda _: None, SMALL)


def test_errors_fall_with_the_step(table: wear_steps.WearStepTable) -> None:
    thesis = [row for row in table.rows if row.rule == "thesis"]
    assert [row.step for row in thesis] == [0.5, 0.25, 0.15]
    assert np.all(np.diff([row.wear_steps for row in thesis]) >= 0)  # finer steps cost more
    errors = [abs(row.life_error or 0.0) for row in thesis]
    assert errors[-1] < errors[0]
    assert all(row.life > 0 and 0 < row.depth_m < 0.02 for row in table.rows)
    assert all(row.wear_steps <= row.hbm_solves for row in table.rows)


def test_text_and_records_hold_every_row(table: wear_steps.WearStepTable) -> None:
    text = wear_steps.as_text(table)
    assert text.count("thesis  ") >= 2
    assert "extrapolated" in text
    records = json.loads(json.dumps([asdict(row) for row in table.rows]))
    keys = {"rule", "step", "hbm_solves", "wear_steps", "seconds"}
    keys |= {"depth_m", "depth_error", "life", "life_error"}
    assert all(keys <= set(record) for record in records)


def test_roughness_of_a_plane_is_nothing_and_of_a_spike_is_its_share() -> None:
    x = np.array([0.0, 0.1, 0.3, 0.6, 1.0])
    points = np.array([[a, b, 0.0] for a in x for b in x])
    plane = 1.0 + points @ [0.2, 0.3, 0.0]
    assert wear_steps.roughness(points, plane) < 1e-14
    plane[12] += 0.5
    assert wear_steps.roughness(points, plane) == pytest.approx(0.5 / plane.max(), rel=1e-12)


def test_a_scene_without_wear_is_refused() -> None:
    with pytest.raises(ValueError, match=r"beam has no \[wear\]"):
        wear_steps.compare("beam", lambda _: None, ("wear=",))
