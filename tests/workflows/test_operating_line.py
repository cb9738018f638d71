"""A wheel whose speed goes with the frequency, against the whole wheel at each speed, and its scene keys."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.hbm.quantity import SolvedCycle, quantity_named
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import linear_references
from tribodyn.workflows.run.sanity_checks import check_speed
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.many import parameter_space, run_task, study_file, study_runs
from tribodyn.workflows.studies.wheels import wheel_model

EXACT = newton.NewtonOptions(tolerance=1e-11)
LINE = ('wheel.sweep="speed"', "reduction.modes=24", "contact.friction=0.3", 'loads.harmonic.wave.value="300 N"')


def scene(sectors: int, *overrides: str) -> scene_file.SceneFile:
    text = WHEEL.replace("n_blades = 6", f"n_blades = {sectors}").replace("sectors = 6", f"sectors = {sectors}")
    return scene_file.parse(text, "w.toml", overrides, Path())


def line(sectors: int, order: int, *overrides: str) -> HarmonicBalance:
    return modelling.build(scene(sectors, *LINE, f"wheel.engine_order={order}", *overrides), Progress()).balance


@pytest.mark.parametrize(("sectors", "order", "hertz", "law"), [
    (5, -2, (240, 264), "jenkins"),
    pytest.param(6, -1, (110, 150), "jenkins", marks=pytest.mark.slow),
    pytest.param(5, -2, (240, 261), "coulomb_planar", marks=pytest.mark.slow),
    pytest.param(6, -1, (110, 150), "coulomb_planar", marks=pytest.mark.slow),
    pytest.param(5, -2, (240, 264), "coulomb_planar", marks=pytest.mark.slow),
])  # fmt: skip
def test_a_line_of_speeds_is_the_whole_wheel_at_each(sectors, order, hertz, law):
    """Slipping, with Coriolis forces, near a resonance; the wheel anew at every speed, with nothing alike assumed.

    The blades of a wheel are sampled at other phases than the one of the wave, which planar friction feels by more
    than 1e-4 at 32 samples: it gets samples that go into all sectors"""
    low, high = hertz
    samples = 32 * (sectors if law == "coulomb_planar" else 1)
    span = (f'response.frequency=["{low} Hz", "{high} Hz"]', f'contact.law="{law}"', f"harmonics.samples={samples}")
    item = line(sectors, order, *span)
    for f in (0.5 * (low + high), high - 1.0):
        base = (*LINE[1:], f"wheel.engine_order={order}", f'wheel.speed="{f / abs(order)} Hz"', *span)
        full = wheel_model.build(scene(sectors, *base)).whole_wheel()
        mine, theirs = (arc_length.solve_along_load(b, 2 * np.pi * f, EXACT) for b in (item, full))
        assert mine.converged
        assert theirs.converged
        assert item.energy(mine.state).sum() > 1e-4
        outputs, result, names = item.outputs(mine.state), full.outputs(theirs.state), full.compliance.output_names
        for n in range(sectors):
            expected = waves.at_sector(item.basis, outputs[0], order, sectors, n)
            miss = result[names.index(f"response@{n}")] - expected
            assert np.abs(miss).max() < 1e-4 * np.abs(expected).max()


def test_stress_on_a_line_is_that_at_each_speed():
    strength = ('fatigue.material.endurance_limit="200 MPa"', 'fatigue.material.strength="600 MPa"')
    place, span = "stress.places.disk.point=[0.0237, 0.0, 0.0484]", 'response.frequency=["240 Hz", "264 Hz"]'
    numbers = []
    for speed in (LINE[0], 'wheel.speed="123 Hz"'):
        file = scene(5, speed, *LINE[1:], "wheel.engine_order=-2", span, place, *strength)
        balance = modelling.build(file, Progress()).balance
        state = arc_length.solve_along_load(balance, 2 * np.pi * 246, EXACT).state
        cycle = SolvedCycle.of(balance, state, "response")
        numbers.append([quantity_named(name).value(cycle) for name in ("stress", "utilisation")])
    np.testing.assert_allclose(*numbers, rtol=1e-5)
    assert numbers[0][0] > 1e7


def test_the_peak_of_a_line_is_where_it_meets_a_mode():
    """The slope over the frequency is that of the whole problem, speed and all; the peak that it finds is the top."""
    item = line(5, -2, 'response.frequency=["240 Hz", "280 Hz"]')
    peak = AtPeak("response", 2 * np.pi * 240, 2 * np.pi * 280).solve(item)
    omega, x = peak.state.omega, peak.state.x
    neighbour = [item.evaluate(omega * (1 + s), x).residual for s in (1e-4, -1e-4)]
    expected = (neighbour[0] - neighbour[1]) / (2e-4 * omega)
    assert np.abs(item.frequency_slope(peak.state)[0] - expected).max() < 1e-5 * np.abs(expected).max()
    heights = []
    for s in (-2e-4, 0.0, 2e-4):
        neighbour = newton.solve(item, omega * (1 + s), x, EXACT)
        assert neighbour.converged
        heights.append(np.linalg.norm(item.outputs(neighbour.state)[0, 1:]))
    assert heights[1] == max(heights)
    built = wheel_model.build(scene(5, *LINE[1:], f'wheel.speed="{omega / (4 * np.pi)} Hz"'))
    free, stuck = (float(built.diagram([-2], 1, state)[0, 0]) for state in (False, True))
    assert 2 * np.pi * free < omega < 2 * np.pi * stuck
    ends = 2 * np.pi * 240, 2 * np.pi * 280
    path, still = (linear_references(b, "response", *ends) for b in (item, built.wave(-2, (240, 280))))
    i = int(np.argmin(np.abs(path.omega - omega)))
    assert path.free[i] == pytest.approx(still.free[i], rel=2e-3)  # between speeds it is interpolated
    assert path.stuck[i] == pytest.approx(still.stuck[i], rel=2e-3)


def test_speeds_and_frequencies_of_a_scene_belong_together():
    by_speed = scene(6, 'response.speed=["3000 rpm", "4200 rpm"]', "response.frequency=", "wheel.engine_order=-2").scene
    by_frequency = scene(
        6, 'wheel.sweep="speed"', 'response.frequency=["100 Hz", "140 Hz"]', "wheel.engine_order=-2"
    ).scene
    for item in (by_speed, by_frequency):
        assert item.response.frequency == pytest.approx((100, 140))
        assert item.wheel.speed == pytest.approx(60)
        assert scene_file.from_json(item.model_dump_json()).wheel == item.wheel
    for wrong in (
        ('response.speed=["3000 rpm", "4200 rpm"]',),
        ('wheel.sweep="speed"', 'wheel.speed="3000 rpm"'),
        ('wheel.sweep="speed"', "wheel.engine_order=0"),
        ('wheel.sweep="frequency"', 'response.speed=["3000 rpm", "4200 rpm"]', "response.frequency="),
    ):
        with pytest.raises(scene_file.SceneError, match=r"wheel|response"):
            scene(6, *wrong)


@pytest.mark.parametrize(("given", "said"), [((), True), (('wheel.sweep="frequency"',), False)])
def test_a_speed_that_does_not_excite_the_range_is_told(given, said):
    item = scene(6, 'wheel.speed="3000 rpm"', *given).mesh_scene
    remarks = check_speed(item, None)
    assert bool(remarks) is said
    assert not said or "24000" in remarks[0]  # rpm at which engine order 1 excites 400 Hz
    fits = item.model_copy(update={"wheel": item.wheel.model_copy(update={"speed": 402.0})})
    assert not check_speed(fits, None)


def test_a_study_follows_each_engine_order_at_its_own_frequencies(tmp_path: Path) -> None:
    """On one line of speeds; the row of the order that meets a mode with open contacts has its peak."""
    text = WHEEL.replace('frequency = ["400 Hz", "404 Hz"]', 'speed = ["6000 rpm", "7500 rpm"]')
    (tmp_path / "wheel.toml").write_text(text, encoding="utf-8")
    quick = ["contact.gap='1 mm'", "response.points=3", "reduction.modes=4", "verdict.enabled=false"]
    tables = {
        "study": {"scene": "wheel.toml", "design": "list", "set": quick}, "vary": {"wheel.engine_order": [-1, -2, -3]}
    }  # fmt: skip
    requested = study_file.parse(tables, "orders.toml", tmp_path)
    tasks, refused = study_runs._tasks(requested, parameter_space.runs(requested))
    assert not refused
    for order, task in zip((1, 2, 3), tasks, strict=True):
        assert task.scene().scene.response.frequency == pytest.approx((100 * order, 125 * order))
    row = run_task.solve(tasks[1])
    assert row.status == "complete"
    assert 230 < row.numbers["peak_frequency_first"] < 240
