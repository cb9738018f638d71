"""Scenes of several bodies that tests share, and their models."""

from pathlib import Path

from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

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
[harmonics]
kept = [0, 1]
[damping]
modal = "1 %"
"""
FREE = (
    BLOCKS.replace('fixed = ["x_min"]\n', "")
    .replace('length = "100 mm"\nn_length = 4', 'length = "40 mm"\nn_length = 2')
    .replace('width = "14 mm"\n', "")
    .replace('["55 mm", "3 mm", "10 mm"]', '["0 mm", "0 mm", "10 mm"]')
)
STACK = """
[scene]
title = "Two bars that a bolt holds together"
[materials.plain]
young = "200 GPa"
poisson = 0.0
density = "7860 kg/m3"
[bodies.a]
part = "block"
length = "30 mm"
width = "20 mm"
height = "20 mm"
n_length = 2
material = "plain"
fixed = ["x_min"]
[bodies.b]
part = "block"
length = "50 mm"
width = "20 mm"
height = "20 mm"
n_length = 2
n_width = 3
translation = ["30 mm", "0 mm", "0 mm"]
material = "plain"
[contacts.joint]
first = "a.x_max"
second = "b.x_min"
t1 = "y"
tangential_stiffness = "100 N/um"
normal_stiffness = "500 N/um"
friction = 0.3
[bolts.m8]
first = "a.x_min"
second = "b.x_max"
preload = "5 kN"
stiffness = "90 N/um"
[loads.harmonic.shake]
group = "b.x_max"
direction = "y"
value = "1 N"
[response]
group = "b.x_max"
direction = "x"
frequency = ["1 kHz", "2 kHz"]
[reduction]
modes = 5
[harmonics]
kept = [0, 1]
"""


def built(text: str, folder: Path, *overrides: str) -> modelling.Model:
    return modelling.build(scene_file.parse(text, "scene.toml", overrides, folder), Progress())
