"""Modes of a small wheel along its speeds."""

from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.wheel_scene import WHEEL
from tribodyn.fem.modes import turning_frequencies
from tribodyn.reduction.wave_model import harmonic_index
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import wheel_model as wheels


def wheel_of(text: str, *overrides: str) -> wheels.Wheel:
    return wheels.build(scene_file.parse(text, "w.toml", overrides, Path()))


def test_engine_orders_meet_modes_where_a_wheel_of_that_speed_has_them() -> None:
    """Beside the sector with its stress computed and reduced anew at every speed that is met, from rest on."""
    wheel = wheel_of(WHEEL, "reduction.modes=60")  # of 6 the sector of each speed is 1e-4 off
    _, _, met = wheels.campbell(wheel, 150.0, 2, (-3, -5, 5), 2)
    assert {(m.engine_order, m.family) for m in met["free"]} >= {(-3, 0), (-3, 1), (-5, 0), (5, 1)}
    assert {(m.engine_order, m.family) for m in met["stuck"]} == {(-3, 0), (-5, 0), (5, 0)}
    for state, m in [("free", met["free"][1]), *[("stuck", m) for m in met["stuck"]]]:
        assert m.frequency == pytest.approx(abs(m.engine_order) * m.speed)
        exact = wheel.at_speed(m.speed).diagram([harmonic_index(m.engine_order, 6)], 2, state == "stuck")
        assert m.frequency == pytest.approx(exact[0, m.family], rel=2e-5)


def test_modes_of_an_inspection_are_those_at_the_speed(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text(WHEEL, encoding="utf-8")
    speed = "wheel.speed=9000 rpm"
    inspected = td.inspect(str(tmp_path / "w.toml"), modes=4, overrides=[speed]).frequencies
    turning = wheel_of(WHEEL, speed).full.system
    omega = turning_frequencies(turning.stiffness, turning.mass, turning.gyroscopic, 4)
    assert inspected == pytest.approx(omega / (2 * np.pi), rel=1e-5)
    assert inspected[0] > 1.03 * td.inspect(str(tmp_path / "w.toml"), modes=1).frequencies[0]
