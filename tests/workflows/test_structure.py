"""Scenes of several bodies: from TOML to a worn joint, named joints, what joins and loads bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tribodyn.hbm import newton
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError

STEEL = 'young = "210 GPa"\npoisson = 0.3\ndensity = "7860 kg/m3"'
BLOCKS = f"""
[scene]
title = "Two blocks"
[materials.steel]
{STEEL}
expansion = "12e-6 1/K"
[materials.aluminium]
young = "70 GPa"
poisson = 0.33
density = "2700 kg/m3"
expansion = "23e-6 1/K"
[bodies.lower]
part = "block"
length = "100 mm"
n_length = 4
n_width = 2
material = "steel"
fixed = ["x_min"]
[bodies.upper]
part = "block"
length = "40 mm"
width = "14 mm"
n_length = 3
n_width = 1
translation = ["55 mm", "3 mm", "10 mm"]
material = "aluminium"
[contacts.lap]
first = "upper.z_min"
second = "lower.z_max"
t1 = "x"
tangential_stiffness = "100 N/um"
normal_stiffness = "120 N/um"
friction = 0.3
[loads.static.press]
group = "upper.z_max"
pressure = "0.5 MPa"
[loads.harmonic.pull]
group = "lower.x_max"
direction = "x"
value = "20 N"
[response]
group = "lower.x_max"
direction = "x"
frequency = ["4.5 kHz", "7 kHz"]
points = 10
[reduction]
modes = 6
[damping]
modal = "1 %"
"""


def built(text: str, folder: Path, *overrides: str) -> modelling.Model:
    return modelling.build(scene_file.parse(text, "scene.toml", overrides, folder), folder, Progress())


def test_a_joint_between_two_bodies_carries_what_presses_them(tmp_path: Path) -> None:
    model = built(BLOCKS, tmp_path)
    assert model.part is not None
    assert model.reduced.interface.area.sum() == pytest.approx(0.04 * 0.014, rel=1e-10)
    omega = 2 * np.pi * 5e3
    solved = newton.solve(model.balance, omega, model.balance.stuck(omega))
    assert solved.converged
    assert model.balance.preload(solved.state) == pytest.approx(0.5e6 * 0.04 * 0.014, rel=1e-6)
    assert [joint.name for joint in model.balance.contact.joints] == ["lap"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("lower.z_max", "lower.top"), "the mesh has no face 'lower.top'; it has lower.x_max"),
        (('material = "aluminium"', 'material = "gold"'), "bodies.upper: unknown key materials.gold"),
        (('translation = ["55 mm", "3 mm", "10 mm"]', 'translation = ["55 mm", "3 mm", "60 mm"]'), "do not meet"),
        (('first = "upper.z_min"', 'firts = "upper.z_min"'), "first is missing"),
        (('group = "upper.z_max"\npressure', 'group = "upper.block"\npressure'), "no face 'upper.block'"),
        (("n_width = 1\n", "n_witdh = 1\n"), r"unknown key n_witdh \(did you mean n_width\?\)"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    assert change[0] in BLOCKS
    with pytest.raises(ValueError, match=said) as raised:
        built(BLOCKS.replace(*change), tmp_path)
    assert "\n" not in str(raised.value)


def test_a_body_without_its_material_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"either \[bodies.NAME\] with \[materials.NAME\]"):
        scene_file.parse(BLOCKS + '[geometry]\npart = "beam"\n', "scene.toml", (), tmp_path)
