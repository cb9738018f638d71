"""A test plan is replayed: marks, sweeps at several forces and scans, beside what was measured."""

import json
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.command import refusal
from tribodyn.refusal import Refusal
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.run import modelling, response_curve, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

SMALL = (
    "harmonics.kept=[0, 1]", "harmonics.samples=32", "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1",
    "reduction.modes=3", "response.points=16", "verdict.enabled=false", 'wear.step="20 %"',
    'test={marks=3, sweeps=["10 kN", "4 kN"], scans=2}',
)  # fmt: skip


@pytest.fixture(scope="module")
def replayed() -> td.studies.ReplayedTest:
    return td.studies.replay("beam_thesis", overrides=SMALL)


def test_marks_are_those_of_the_scenes_own_wear(replayed: td.studies.ReplayedTest) -> None:
    """Depth at a mark lies on the straight line between the wear steps; sweeps are those of the worn contact."""
    file = scene_file.read("beam_thesis", SMALL)
    model = modelling.build(file, Progress())
    history = wear_run.worn_out(file, model)
    marks = replayed.tables["marks"]
    np.testing.assert_allclose(marks["cycles"], history.cycles[-1] * np.array([0, 0.5, 1]))
    np.testing.assert_allclose(marks["depth_m"][[0, -1]], history.depth[[0, -1]].max(axis=1))
    assert marks["preload_N"][0] == pytest.approx(history.preload[0])
    assert marks["work_J"][-1] == pytest.approx(history.work[:-1].sum())
    volume = history.depth @ replayed.patch.area
    assert marks["volume_m3"][1] == pytest.approx(np.interp(marks["cycles"][1], history.cycles, volume))
    branch = response_curve.follow_response(file.scene, model.balance.worn(history.depth[-1]).with_load(0.4))
    last = {name: column[-1] for name, column in replayed.tables["peaks"].items()}
    assert last["force_N"] == 4000
    hertz = replayed.tables["peaks"]["frequency_hz"][1::2]  # from the stuck beam to the free one
    assert np.all(np.diff(hertz) <= 0)
    assert hertz[-1] == pytest.approx(model.reduced.free_frequency[0], rel=0.05)
    assert last["amplitude_m"] == branch.amplitude("response").max()
    assert (
        set(replayed.tables["scans"]["cycles"])
        == set(replayed.tables["loops"]["cycles"])
        == set(marks["cycles"][[0, -1]])
    )
    first = replayed.tables["loops"]["cycles"] == 0
    x, friction = (replayed.tables["loops"][name][first] for name in ("displacement_m", "friction_N"))
    assert (x[0], friction[0]) == (x[-1], friction[-1])
    assert x.max() == pytest.approx(-x.min())
    balance = model.balance
    moved = history.duty_displacement[0, 0].reshape(balance.contact.n_pair, 3, -1)
    motion = balance.history(balance.evaluate(float(history.omega[0]), moved))[0][:, 1]  # t2, along the force
    area = balance.model.interface.area
    assert np.ptp(x) == pytest.approx(np.ptp(area @ motion / area.sum()), rel=1e-12)


def test_a_measurement_stands_row_by_row(replayed: td.studies.ReplayedTest, tmp_path: Path, capsys) -> None:
    """What the test itself computes is a measurement without a difference; between marks the line, beyond them none."""
    marks, peaks = replayed.tables["marks"], replayed.tables["peaks"]
    cycles = [*peaks["cycles"], 0.25 * marks["cycles"][-1], 2 * marks["cycles"][-1]]
    columns = {"cycles": cycles, "force_N": [*peaks["force_N"], 4000, 4000]}
    columns["frequency_hz"] = [*peaks["frequency_hz"], 1, 1]
    columns["preload_N"] = np.interp(cycles, marks["cycles"], marks["preload_N"])
    write_columns(columns, tmp_path / "bench.csv")
    words = ["study", "test", "beam_thesis", "--measurement", str(tmp_path / "bench.csv"), "--json"]
    words += ["--out", str(tmp_path), *(word for text in SMALL for word in ("--set", text))]
    cli.app(words, result_action="return_value")
    record = json.loads(capsys.readouterr().out)
    compared = record["compared"]
    np.testing.assert_allclose(compared["frequency_hz_difference"][:6], 0, atol=1e-12)
    np.testing.assert_allclose(compared["preload_N_difference"][:7], 0, atol=1e-12)
    assert compared["computed_preload_N"][-1] is None or np.isnan(compared["computed_preload_N"][-1])
    names = {Path(name).name for name in record["files"]}
    assert {f"test_{n}.csv" for n in ("marks", "peaks", "compared", "sweeps", "scans", "loops")} <= names
    assert {f"test_{n}.png" for n in ("sweeps", "evolution", "scans", "loops")} <= names
    write_columns({"cycles": [1.0], "colour": [2.0]}, tmp_path / "bench.csv")
    words[-2 * len(SMALL) - 2] = "--out"
    assert "column colour: there is cycles, work_J" in refusal(words, capsys)


def test_a_scene_without_a_plan_and_marks_out_of_order_are_refused(capsys) -> None:
    assert "study test needs [wear] and [test]" in refusal(["study", "test", "beam_thesis"], capsys)
    with pytest.raises(Refusal, match="rising order"):
        scene_file.read("beam_thesis", ("test={marks=[5, 1]}",))
    table = scene_file.read("beam_thesis", ("test={marks=[0, 5, 50], scans=2}",)).scene.test
    np.testing.assert_array_equal(table.cycles(20.0), [0, 5])
    np.testing.assert_array_equal(table.is_scanned(4), [True, False, True, True])
