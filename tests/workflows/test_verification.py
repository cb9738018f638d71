"""`tribodyn verify`: a small beam against time integration, unworn and worn, and what is refused."""

from pathlib import Path

import pytest

from tests.helpers.command import printed_record, printed_text, refusal
from tribodyn.workflows.result import store
from tribodyn.workflows.run import pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read
from tribodyn.workflows.studies import verification
from tribodyn.workflows.studies.verification import verify

SMALL = [
    "verdict.enabled=false", "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
    "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "response.points=20",
    "response.frequency=['380 Hz', '1000 Hz']", "wear.rule=thesis", "wear.step=30 %", "wear.lost_below=0",
    "wear.max_steps=2", "harmonics.kept=[0, 1, 2, 3]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("verify")
    pipeline.run(read("beam", SMALL), built, Progress())
    return built


def test_the_command_compares_and_draws(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = printed_record(["verify", str(folder), "--at", "640Hz", "--steps", "128", "--json"], capsys)
    assert numbers["frequency_hz"] == pytest.approx(640)
    assert numbers["outcome"] == "converged"
    assert numbers["drift"] <= verification.TOLERANCE
    response, energy = numbers["outputs"]["response"], numbers["energy"]
    assert response["balance_m"] == pytest.approx(response["time_m"] * (1 + response["difference"]))
    assert energy["balance_J"] == pytest.approx(energy["time_J"] * (1 + energy["difference"]))
    assert Path(numbers["files"][0]).is_file()


def test_a_motion_that_hill_finds_unstable_is_said_to_be_and_time_leaves_it(folder, capsys):
    result = {}
    for hertz in (900, 640):
        result[hertz] = printed_record(
            ["verify", str(folder), "--at", f"{hertz}Hz", "--steps", "128", "--json"], capsys
        )
    assert not result[900]["stable"]
    assert abs(result[900]["outputs"]["response"]["difference"]) > 0.1
    assert result[900]["left_alone"]["periods"] == verification.LEFT_ALONE
    assert result[640]["stable"] is None  # neither Hill's method nor time decides: a plain march is shown beside it
    assert result[640]["left_alone"]["periods"] == verification.LEFT_ALONE
    assert abs(result[640]["outputs"]["response"]["difference"]) < 0.1


def with_harmonics(folder: Path, highest: int, hertz: float) -> verification.TimeComparison:
    override = [f"harmonics.kept={list(range(highest + 1))}"]
    return verify(store.load(folder / "result.h5"), hertz, overrides=override, steps=512, progress=Progress())


def test_sliders_that_stick_without_springs_stay_where_they_came_to_rest(folder: Path) -> None:
    """Put back on the load path of the balance each period, they let no motion repeat itself."""
    comparison = verify(folder, 640.0, law="rigid", steps=128, overrides=["loads.harmonic.shake.value=1 kN"])
    assert comparison.integration.motion.periodic


@pytest.mark.slow
def test_a_machine_leaves_an_unstable_motion(folder: Path) -> None:
    """For one that never repeats itself, with eleven times the energy.

    600 periods from this start and from rest, at 256 and 1024 steps: 5.09 and 5.19 J, spread 0.28 J."""
    comparison = with_harmonics(folder, 15, 700.0)
    single = comparison.left_alone
    assert not comparison.stable
    assert single.energy == pytest.approx(5.15, rel=0.05)
    assert 0.1 < single.energy_spread < 0.6
    assert single.drift > 0.1
    assert any(line.startswith("left alone") for line in comparison.lines())


def test_a_worn_row_is_compared_where_it_was_solved(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = store.load(folder / "result.h5")
    comparison = verify(result, row=1, steps=128)
    assert comparison.integration.omega == result.wear.omega[1]
    assert comparison.solution.steps == 0  # it starts at the solution of the row
    assert comparison.record()["preload"]["balance_N"] == pytest.approx(result.wear.preload[1], rel=1e-6)
    out = printed_text(["verify", str(folder), "--row", "1", "--steps", "128", "--out", str(folder / "own")], capsys)
    assert "worn as in row 1" in out
    assert "waveform response" in out
    assert list((folder / "own").glob("verify_*Hz_row1.png"))


@pytest.mark.parametrize(("arguments", "words"), [
    (["--at", "410"], "--at: expected"),
    (["--at=-3 Hz"], "outside what the scene models"),
    (["--at", "5 kHz"], "change response.frequency"),
    (["--row", "9"], "no wear row 9: it has 0 to"),
    (["--at", "500 Hz", "--steps", "3"], "at least 8"),
])  # fmt: skip
def test_what_cannot_be_is_refused(folder, capsys, arguments, words):
    assert words in refusal(["verify", str(folder), *arguments], capsys)
