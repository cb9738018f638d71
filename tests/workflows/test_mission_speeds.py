"""A mission of a wheel over several speeds of rotation: wear adds over them."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError

WEAR = """
[wear]
coefficient = "1e5 um3/J"
step = "2 um"
max_steps = 2
"""
SLIPPING = ("contact.friction=0.3", "contact.gap=-0.2 mm", "loads.harmonic.wave.value=200 N")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel") / "wheel.toml"
    text = WHEEL.replace('["400 Hz", "404 Hz"]', '["750 Hz", "880 Hz"]') + WEAR
    path.write_text(text.replace("sectors = 6", 'sectors = 6\nspeed = "6000 rpm"'), encoding="utf-8")
    return path


def worn(scene: Path, *changes: str) -> WearHistory:
    file = scene_file.read(str(scene), (*SLIPPING, *changes))
    model = modelling.build(file, Progress())
    wear = file.scene.wear
    problem = wear_run.wear_problem(file.scene, model.balance)
    return evolve(wear_run.rule_of(file.scene, problem, 2e-6), wear.max_steps)


def rate(history: WearHistory) -> np.ndarray:
    """Depth per cycle of the unworn wheel [m]."""
    return history.worn[0] / history.cycles_in_step[0]


def test_wear_adds_over_the_speeds(scene: Path) -> None:
    """The rate of a mission is that of its speeds, each by itself, by their shares of the cycles."""
    slow = rate(worn(scene, "wear.at=810 Hz", "wear.max_steps=1"))
    fast = rate(worn(scene, "wear.at=805 Hz", "wear.max_steps=1", "wheel.speed=7000 rpm"))
    assert np.abs(fast - slow).max() > 0.05 * slow.max() > 0
    mission = 'wear.mission=[{at="810 Hz", share="30 %"}, {at="805 Hz", share="70 %", speed="7000 rpm"}]'
    two_results = rate(worn(scene, mission, "wear.max_steps=1"))
    np.testing.assert_allclose(two_results, 0.3 * slow + 0.7 * fast, rtol=1e-6)


@pytest.mark.parametrize("rule", ["thesis", "error_controlled"])
def test_a_mission_of_two_equal_points_is_one(scene: Path, rule: str) -> None:
    changes = (f"wear.rule={rule}", 'wear.tolerance="5 %"')
    item = worn(scene, "wear.at=810 Hz", *changes)
    mission = 'wear.mission=[{at="810 Hz", share=0.5}, {at="810 Hz", share=0.5, speed="6000 rpm"}]'
    pair = worn(scene, mission, *changes)
    assert len(item.cycles) == len(pair.cycles) == 3
    np.testing.assert_allclose(pair.depth, item.depth, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(pair.cycles, item.cycles, rtol=1e-6)


def test_a_speed_needs_a_wheel_that_turns(scene: Path) -> None:
    mission = 'wear.mission=[{at="810 Hz", share=1, speed="9000 rpm"}]'
    with pytest.raises(SceneError, match=r"in wheel\.speed"):
        scene_file.read(str(scene), ("wheel.speed=0", mission))
    with pytest.raises(SceneError, match=r"in wheel\.speed"):
        scene_file.read("beam", ("wear.at=", 'wear.mission=[{at="peak", share=1, speed="9000 rpm"}]'))
