"""Ten wheels that flutter: every wave has its limit cycle or the reason why not, and time integration comes to it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import FLOW, WHEEL
from tribodyn.hbm.continuation.free_vibration import FreeVibration
from tribodyn.hbm.continuation.nonlinear_modes import newton_on
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import march_freely
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import flutter, wheel_model as wheels

SCENE = WHEEL.replace("friction = 5.0", "friction = 0.3").replace('"2 %"', '"0.1 %"') + FLOW
BY_DIAMETER = "[[-2, 0, 0.01], [-1, 0, 0.01], [0, 0, 0.01], [1, 0, -0.01], [2, 0, -0.02], [3, 0, 0.0]]"
CASES = {
    "plain": (),
    "little preload": ("contact.gap='-0.01 mm'",),
    "little friction": ("contact.friction=0.05",),
    "much friction": ("contact.friction=1.0",),
    "eight harmonics": ("harmonics.kept=[0, 1, 2, 3, 4, 5, 6, 7]", "harmonics.samples=128"),
    "strong flow": ("flow.influence=[[0, 0, 0.012], [1, 0.06, 0.002], [-1, -0.06, 0.002]]",),
    "second family": ("flow.influence=", f"flow.by_diameter={BY_DIAMETER}", "flow.mode=1"),
    "eight sectors": ("wheel.sectors=8", "geometry.n_blades=8"),
    "every wave": ("flow.influence=[[0, 0, -0.01]]",),
    "spinning": ("wheel.speed='6000 rpm'",),
}
PERIODS = 200
WITHIN = 0.03  # of a cycle
KEPT = {  # waves with a limit cycle that time integration keeps
    "plain": {1}, "little preload": {1}, "little friction": {1, 2}, "much friction": set(), "eight harmonics": {1},
    "strong flow": {2}, "second family": {2}, "eight sectors": {2, 3}, "every wave": set(), "spinning": {1, 2},
}  # fmt: skip


@pytest.mark.parametrize("case", [pytest.param(c, marks=pytest.mark.slow) for c in CASES])
def test_every_wave_that_flutters_has_a_limit_cycle_or_a_reason(case: str) -> None:
    """A cycle said to be kept is what time integration comes to from 0.95 of its amplitude in the reference mode."""
    saved = ("harmonics.kept=[0, 1, 2, 3]", *CASES[case])
    file = scene_file.parse(SCENE, "wheel.toml", saved, Path())
    result = flutter.of_scene(file, 1e-8, 1e-3, 30)
    assert set(result.cycles) == {index for index, ratio in result.damping.items() if ratio < 0}
    wheel = wheels.build(file)
    kept_waves = set()
    for index, (cycles, reason) in result.cycles.items():
        assert cycles or reason
        assert all(item.is_stable is not None and item.moved is not None for item in cycles)
        balance = replace(flutter.in_flow(wheel, index), load_factor=0.0)
        problem = FreeVibration(balance, None, "response")
        row = balance.compliance.output_names.index("response")
        for cycle in (item for item in cycles if item.is_stable and abs(item.moved or 0.0) < WITHIN):
            kept_waves.add(index)
            coordinates = cycle.point.coordinates.copy()
            coordinates[-1] += np.log(0.95)
            fixed = np.zeros(len(coordinates))
            fixed[-1] = 1.0
            begin, outcome, _ = newton_on(problem, problem.evaluate(coordinates), fixed, NewtonOptions())
            assert outcome == CONVERGED
            assert begin.zeta < 0  # it grows
            start = balance.evaluate(begin.omega, begin.x)
            single = march_freely(balance, cycle.omega, start, PERIODS, Options(steps=128), begin.zeta)
            expected = np.sqrt((cycle.response[row, 1:] ** 2).sum())
            assert np.sqrt((problem.outputs(begin)[row, 1:] ** 2).sum()) < 0.97 * expected
            print(f"{case}: wave {index}, {expected:.4g} m, time {single.amplitude[row] / expected - 1:+.2%}")
            assert single.amplitude[row] == pytest.approx(expected, rel=WITHIN)
    assert kept_waves == KEPT[case]
