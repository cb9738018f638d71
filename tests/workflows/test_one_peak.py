"""Parts whose contact lifts, so that a sweep jumps: one peak in the head of a run, in its verdict and by arc length."""

from __future__ import annotations

from pathlib import Path

import pytest

from proof import bracket
from tribodyn.workflows.errors import operating_states
from tribodyn.workflows.result.summary import numbers
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import parse

PLATE = """
part = "block"
fixed = ["x_min"]
length = 0.12
width = 0.06
height = 0.003
n_length = 6
n_width = 1
n_height = 1
pad_start = 0.1
pad_end = 0.12
"""
BRACKET = """
part = "bracket.py"
fixed = ["back"]
length = 0.1
height = 0.05
width = 0.03
thickness = 0.006
hole = 0.006
pad_length = 0.02
n_length = 5
holes = 0
"""
REST = """
[scene]
title = "A part on a pad"

[material]
young = "210 GPa"
density = "7860 kg/m3"
poisson = 0.3

[contact]
group = "{pad}"
t1 = "x"
vertices_only = true
tangential_stiffness = "30 N/um"
normal_stiffness = "40 N/um"
friction = 0.3

[loads.static.press]
group = "{above}"
direction = "-z"
value = "20 N"

[loads.harmonic.shake]
group = "{shaken}"
direction = "z"
value = "{force} N"

[response]
group = "{shaken}"
direction = "z"
frequency = ["{low} Hz", "{high} Hz"]
points = 50

[reduction]
modes = 4

[harmonics]
kept = [0, 1]
samples = 64
transitions = "located"

[damping]
modal = "1 %"

[geometry]
"""
SCENES = {
    "thin plate": REST.format(pad="pad_min", above="pad_max", shaken="z_max", force=5, low=100, high=1500) + PLATE,
    "bracket": REST.format(pad="pad", above="top", shaken="top", force=2, low=300, high=3000) + BRACKET,
}


@pytest.mark.parametrize("name", [pytest.param("thin plate", marks=pytest.mark.slow), "bracket"])
def test_head_verdict_and_arc_length_have_one_peak(name: str) -> None:
    file = parse(SCENES[name], "part.toml", ("verdict.enabled=false",), Path(bracket.__file__).parent)
    result = pipeline.run(file, None, Progress())
    assert result.response is not None
    assert operating_states.turns_back(result.response)
    head = numbers(result)
    statement = operating_states.first_state(file, modelling.build(file, Progress()).balance, result).values
    assert (statement["peak_frequency"], statement["amplitude"]) == pytest.approx(
        (head["peak_frequency"]["first"], head["amplitude"]["first"]), rel=1e-9
    )
    down = pipeline.run(file.changed("response.method=arc_length", "response.sweep=down"), None, Progress())
    assert down.response is not None
    assert down.response.omega[0] > down.response.omega[-1]  # it comes to the peak from the other side
    other = numbers(down)
    assert other["peak_frequency"] == pytest.approx(head["peak_frequency"], rel=1e-5)
    assert other["amplitude"] == pytest.approx(head["amplitude"], rel=1e-4)
