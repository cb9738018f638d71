"""What a scene may ask about its response curve: chosen harmonics, stability, any method."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import leave, printed_record
from tests.helpers.matrix_scene import matrix_folder
from tribodyn.hbm.continuation.harmonic_choice import estimate, widened
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.stability.branch_stability import stability_along
from tribodyn.workflows.result import store
from tribodyn.workflows.run import modelling, pipeline, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read

QUICK = ["wear.max_steps=0", "response.points=20", "verdict.enabled=false"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scene and its matrices, and with lists that a scene may name."""
    return matrix_folder(tmp_path)


def run(folder: Path, *overrides: str) -> store.Result:
    return pipeline.run(read(str(folder / "own.toml"), [*QUICK, *overrides]), folder, Progress())


def test_harmonics_are_chosen_and_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    overrides = ["harmonics.kept=auto", "harmonics.tolerance=2 %", "harmonics.highest=9", "harmonics.samples=512"]
    result = run(folder, *overrides)
    chosen = result.harmonics
    assert {0, 1} < set(chosen)
    assert max(chosen) <= 9
    assert result.response.response.shape[2] == 2 * len(chosen) - 1
    assert 0 < result.facts.harmonics_error <= 0.02
    numbers = printed_record(["show", str(folder), "--json"], capsys)
    assert numbers["harmonics"] == list(chosen)
    assert numbers["harmonics_error"] == result.facts.harmonics_error
    assert "estimated truncation error" in leave(["show", str(folder)], capsys)[1]
    # the estimate is that of the balance which was solved, at the peak
    file = read(str(folder / "own.toml"), [*QUICK, *overrides])
    balance = modelling.build(file, Progress(), chosen).balance
    assert balance.basis.harmonics == chosen
    peak = settings.peak_of(file.scene).solve(balance).state
    base = estimate(widened(balance, 9), chosen, peak.omega, peak.x, split=False).error
    assert base == pytest.approx(result.facts.harmonics_error, rel=0.3)
    assert result.scene == file.scene


def test_stability_is_marked_kept_and_drawn(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(folder, "response.stability=true", "loads.harmonic.shaker.value=12 N")
    frf, marks = result.response, result.stability
    file = read(str(folder / "own.toml"), [*QUICK, "loads.harmonic.shaker.value=12 N"])
    repeated = stability_along(modelling.build(file, Progress()).balance, frf)
    assert np.array_equal(marks.stable, repeated.stable)
    loaded = store.load(folder / "result.h5")
    assert loaded.stability.kinds == marks.kinds
    run(folder, "response.stability=true", "loads.harmonic.shaker.value=60 N")
    assert "unstable points" in leave(["show", str(folder)], capsys)[1]
    assert leave(["draw", str(folder)], capsys)[0] == 0
    assert (folder / "pictures" / "frf.png").is_file()


@pytest.mark.parametrize("method", ["arc_length", "adaptive"])
def test_every_continuation_gives_the_same_curve(folder: Path, method: str) -> None:
    """The peak of each method's curve is that of a natural sweep with fine steps."""
    natural = run(folder, "response.points=400").response
    other = run(folder, f"response.method={method}").response
    assert other.ended is BranchEnd.REACHED
    assert other.amplitude("response").max() == pytest.approx(natural.amplitude("response").max(), rel=2e-2)


@pytest.mark.parametrize(("override", "words"), [
    ("harmonics.kept=some", "harmonics.kept"),
    ("harmonics.kept=[]", "rising harmonic numbers"),
    ("harmonics.tolerance=1 %", 'only with kept = "auto"'),
    ("harmonics={kept = 'auto', highest = 15, samples = 30}", "expected more than 48 samples"),
    ("response.stability=yes", "true or false"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(folder: Path, override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read(str(folder / "own.toml"), [override])
