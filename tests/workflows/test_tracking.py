"""`curve track`: peaks and folds against load, gap and wear are those of the problem made anew at the value."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import printed_record, refusal
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.workflows.run import modelling, pipeline, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read

SCENE = """
contact = {dofs = [[0]], area = "1 m2", components = ["n"], law = "unilateral", normal_stiffness = "5 N/m"}
response = {dofs = [0], frequency = ["0.1 Hz", "0.6 Hz"], points = 60}
harmonics = {kept = [0, 1, 2, 3], samples = 128, transitions = "located"}
[scene]
title = "A mass pressed on a unilateral spring"
[model]
file = "mass.npz"
[loads.static.press]
dofs = [0]
value = "1 N"
[loads.harmonic.shake]
dofs = [0]
value = "0.3 N"
"""
SMALL = [
    "verdict.enabled=false", "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
    "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "response.points=20",
]  # fmt: skip


@pytest.fixture
def lifting(tmp_path: Path) -> str:
    np.savez(tmp_path / "mass.npz", M=np.eye(1), K=np.eye(1), C=0.04 * np.eye(1))
    (tmp_path / "lifting.toml").write_text(SCENE)
    return str(tmp_path / "lifting.toml")


def test_a_fold_against_the_load_is_that_of_a_branch_traced_anew(lifting, tmp_path, capsys):
    arguments = ["--against", "load", "--from", "1", "--to", "1.4", "--fold", "2", "--out", str(tmp_path), "--json"]
    record = printed_record(["curve", "track", lifting, *arguments], capsys)
    assert (record["kind"], record["against"], record["end"]) == ("fold", "load factor", "reached load factor 1.4")
    balance = modelling.build(read(lifting), Progress()).balance
    for at in (0, -1):
        loaded = balance.with_load(record["value"][at])
        branch = arc_length.follow(loaded, 2 * np.pi * 0.6, 2 * np.pi * 0.1)
        folds = branch.frequency[list(branch.folds)]
        assert np.abs(folds / record["frequency_hz"][at] - 1).min() < 1e-8
    assert (tmp_path / "track.csv").read_text().startswith("value,frequency_hz,amplitude_m")
    assert (tmp_path / "track.png").is_file()


@pytest.mark.parametrize(
    ("against", "start", "stop"),
    [("load", "1", "0.9"), ("gap", "0 um", "20 um"), ("stiffness", "1", "1.1"), ("friction", "1", "0.9")],
)
def test_peaks_are_those_of_the_problem_made_anew(against, start, stop, tmp_path, capsys):
    sets = [word for override in SMALL for word in ("--set", override)]
    arguments = ["--against", against, "--from", start, "--to", stop, "--points", "3", "--out", str(tmp_path)]
    record = printed_record(["curve", "track", "beam", *sets, *arguments, "--json"], capsys)
    assert len(record["value"]) == 3
    file = read("beam", SMALL)
    balance = modelling.build(file, Progress()).balance
    last = record["value"][-1]
    if against == "load":
        balance = balance.with_load(last)
    elif against == "gap":
        balance = balance.with_gap(balance.contact.gap + last)
    elif against == "stiffness":
        stiffer = balance.contact.with_parameters(lambda p: replace(p, stiffness=last * p.stiffness))
        balance = balance.with_contact(stiffer)
    else:
        balance = balance.with_contact(balance.contact.with_friction_scaled(last))
    peak = settings.peak_of(file.scene).solve(balance)
    assert record["frequency_hz"][-1] == pytest.approx(peak.state.omega / (2 * np.pi), rel=1e-5)
    assert record["amplitude_m"][-1] == pytest.approx(peak.amplitude, rel=1e-5)


def test_a_wear_of_one_is_the_end_of_the_worn_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    overrides = [*SMALL, "wear.rule=thesis", "wear.step=5 %", "wear.max_steps=3"]
    result = pipeline.run(read("beam", overrides), tmp_path, Progress())
    sets = [word for override in overrides for word in ("--set", override)]
    arguments = ["--against", "wear", "--worn", str(tmp_path), "--from", "0", "--to", "1", "--points", "4"]
    record = printed_record(["curve", "track", "beam", *sets, *arguments, "--out", str(tmp_path), "--json"], capsys)
    for at, row in ((0, 0), (-1, -1)):
        assert record["frequency_hz"][at] == pytest.approx(result.wear.omega[row] / (2 * np.pi), rel=2e-5)


@pytest.mark.parametrize(("arguments", "words"), [
    (["--against", "load", "--from", "1", "--to", "1"], "--from and --to are the same"),
    (["--against", "gap", "--from", "0", "--to", "1 kg"], "--from"),
    (["--against", "wear", "--from", "0", "--to", "1"], "--worn"),
    (["--against", "load", "--from", "1", "--to", "2", "--points", "1"], "at least 2"),
    (["--against", "load", "--from", "1", "--to", "2", "--fold", "9"], "--fold: there are"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(arguments, words, lifting, capsys):
    assert words in refusal(["curve", "track", lifting, *arguments], capsys)
