"""What moves the life of the rig: every change is worn from the published preload, and none stops the others."""

from __future__ import annotations

import json

import pytest

from proof import __main__ as cli
from proof.cases.rig.published import PRELOAD

COARSE = (
    "geometry.n_contact_length=3", "geometry.n_contact_width=5", "reduction.modes=6", "harmonics.kept=[0, 1]",
    "harmonics.samples=32", "harmonics.transitions=sampled", "damping.modal=6 %", "wear.rule=error_controlled",
    "wear.tolerance=30 %", "wear.lost_below=30 %",
)  # fmt: skip
HALF_AS_FAST = "wear.coefficient=2.75e3 um3/J"
FEWER_MODES = "wear.max_steps=2"


def words(*changes: str) -> list[str]:
    rows = ["rig", "life"]
    for text in COARSE:
        rows += ["--set", text]
    for text in changes:
        rows += ["--change", text]
    return rows


def test_life_and_work_go_with_the_inverse_of_the_coefficient(capsys: pytest.CaptureFixture[str]) -> None:
    """The wear law is linear: nothing else may differ, the platform's height included."""
    too_soft = "material.young=1 GPa; wear.max_steps=1"
    cli.app([*words(HALF_AS_FAST, FEWER_MODES, too_soft), "--json"], result_action="return_value")
    scene, half, small, soft = json.loads(capsys.readouterr().out)
    assert scene["outcome"] == half["outcome"] == "lost"
    assert half["cycles"] == pytest.approx(2 * scene["cycles"], rel=1e-6)
    assert half["work"] == pytest.approx(2 * scene["work"], rel=1e-6)
    assert half["depth"] == pytest.approx(scene["depth"], rel=1e-6)
    assert half["height"] == scene["height"]
    assert small["outcome"].startswith("stopped after 2 wear steps")
    assert small["cycles"] is None
    assert small["energy"] == scene["energy"]
    assert f"makes {PRELOAD:.3g} N of preload" in soft["outcome"]


def test_a_change_that_the_scene_does_not_know_stops_before_anything(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as remaining:
        cli.main(words("contact.colour=red"))
    assert remaining.value.code == 2
    assert "colour" in capsys.readouterr().err
