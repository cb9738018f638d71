"""A part whose contact lifts, so that a sweep jumps: one peak in head and verdict of a run and by arc length."""

from pathlib import Path

import numpy as np
import pytest

from proof import bracket
from tribodyn.workflows.errors import judgement, operating_states
from tribodyn.workflows.report import text
from tribodyn.workflows.result.summary import numbers
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import parse

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
SCENE = REST.format(pad="pad", above="top", shaken="top", force=2, low=300, high=3000) + BRACKET


def test_head_verdict_and_arc_length_have_one_peak() -> None:
    file = parse(SCENE, "part.toml", ("verdict.enabled=false",), Path(bracket.__file__).parent)
    result = pipeline.run(file, None, Progress())
    assert result.response is not None
    assert operating_states.turns_back(result.response)
    head = numbers(result)
    statement = operating_states.first_state(file, modelling.build(file, Progress()).balance, result).values
    assert (statement["peak_frequency"], statement["amplitude"]) == pytest.approx(
        (head["peak_frequency"]["first"], head["amplitude"]["first"]), rel=1e-9
    )
    down = pipeline.run(file.changed("response.method=arc_length", "response.sweep=down"), None, Progress())
    assert down.response.omega[0] > down.response.omega[-1]  # it comes to the peak from the other side
    other = numbers(down)
    assert other["peak_frequency"] == pytest.approx(head["peak_frequency"], rel=1e-5)
    assert other["amplitude"] == pytest.approx(head["amplitude"], rel=1e-4)


RUBBING = """
[scene]
title = "Den Hartog's oscillator on 32 pairs"
[model]
file = "part.npz"
[contact]
dofs = {dofs}
area = 1e-6
components = ["t1"]
law = "jenkins_constant"
tangential_stiffness = 1e4
friction = 1.0
normal_load = 0.021875
[loads.harmonic.shaker]
dofs = [0]
value = 1.0
[response]
dofs = [0]
frequency = ["{low} Hz", "{high} Hz"]
points = 20
[harmonics]
kept = [0, 1, 2, 3, 4, 5]
samples = 256
"""


@pytest.mark.parametrize(("low", "high"), [(0.08, 0.24), (0.16, 0.3)])
def test_errors_are_of_the_point_in_the_head_peak_or_not(low: float, high: float, tmp_path: Path) -> None:
    """Two resonances of the same height, of which a search from one came to the other; and a range without a peak."""
    np.savez(tmp_path / "part.npz", M=np.eye(1), K=np.eye(1), C=0.1 * np.eye(1))
    text = RUBBING.format(dofs=[[0]] * 32, low=low, high=high)
    file = parse(text, "rubbing.toml", ("verdict.enabled=false",), tmp_path)
    result = pipeline.run(file, None, Progress())
    assert result.response is not None
    head = numbers(result)
    assert head["peak_at_end"] is (low > 0.1)
    state = operating_states.first_state(file, modelling.build(file, Progress()).balance, result)
    for name in ("peak_frequency", "amplitude"):
        assert state.values[name] == pytest.approx(head[name]["first"], rel=1e-12)
    again = state.site.solve_near(state.balance, state.point.state.omega, state.point.state.x)
    assert low < 0.1 or again.amplitude == pytest.approx(state.point.amplitude, rel=1e-9)


@pytest.mark.parametrize(("K", "hertz"), [([[1.0]], 0.5 / np.pi), ([[2.0, -1], [-1, 1]], (5**0.5 - 1) / (4 * np.pi))])
def test_a_resonance_that_nothing_limits_has_no_number(K: list[list[float]], hertz: float, tmp_path: Path) -> None:
    """Closed form: the force works more than friction, 4 / pi of 0.0219; one mass and two in a row (golden ratio)."""
    np.savez(tmp_path / "part.npz", M=1e4 * np.eye(len(K)), K=1e4 * np.array(K))
    file = parse(RUBBING.format(dofs=[[0]], low=0.05, high=0.4), "masses.toml", ("response.points=60",), tmp_path)
    result = pipeline.run(file, None, Progress(), judge=judgement.with_verdict)
    reason = f"no peak: nothing limits the resonance at {hertz:.5g} Hz"
    assert reason in "\n".join(text.brief(result))
    assert result.verdict.statements["amplitude"].reason == reason
