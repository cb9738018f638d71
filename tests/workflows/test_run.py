"""A whole run of a small beam: balances of the result, checkpoints, resuming after kills, Ctrl-C, failed solves."""

import multiprocessing
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import leave, refusal
from tests.helpers.killed_runs import SPENT, go_on
from tribodyn.hbm.outcome import WearEnd
from tribodyn.workflows.pictures import plots
from tribodyn.workflows.result import store
from tribodyn.workflows.result.model_facts import Stage
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import summary
from tribodyn.workflows.run import checkpoint, full_fields, modelling, pipeline, references
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read

ROOT = Path(__file__).parents[2]
SMALL = [
    "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine", "geometry.n_patch=5",
    "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "response.points=25", "wear.rule=thesis",
    "wear.step=30 %", "wear.lost_below=0", "verdict.enabled=false",
]  # fmt: skip
SMALLER = [*SMALL, "geometry.n_patch=3", "response.points=10"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return pipeline.run(read("beam", SMALL), tmp_path_factory.mktemp("run"), Progress())


def words(folder: Path, *arguments: str, overrides: Iterable[str] = SMALLER) -> list[str]:
    changes = [word for override in overrides for word in ("--set", override)]
    return ["run", "beam", "--no-pictures", "--out", str(folder), *changes, *arguments]


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tribodyn", *words(folder, *arguments)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_rows(process: subprocess.Popen[str], path: Path, count: int) -> None:
    """Wait until a result file holds so many wear rows; reading it must work at every moment."""
    while process.poll() is None:
        if path.exists():
            wear = store.load(path).wear
            if wear is not None and len(wear.cycles) >= count:
                return
        time.sleep(0.02)


def test_the_run_ends_with_contact_lost(finished: Result) -> None:
    assert finished.state == "complete: contact lost at every pair"
    assert finished.wear.ended.lost
    assert finished.wear.preload[0] > 1e3
    assert finished.wear.preload[-1] == 0.0
    assert finished.wear.depth[-1].max() > finished.facts.delta_max


def test_worn_volume_is_coefficient_times_energy(finished: Result) -> None:
    wear, patch = finished.wear, finished.patch
    assert wear.depth[-1] @ patch.area == pytest.approx(2e-15 * wear.work.sum(), rel=1e-12)


def test_static_forces_balance_in_the_full_field(finished: Result) -> None:
    """The displacement field of every node, projected on the contact, is what the balance solved for."""
    wear, patch, fields = finished.wear, finished.patch, finished.fields
    for row, field in zip(fields.row, fields.displacement, strict=True):
        local = np.einsum("pij,pjc->pic", patch.frames, field[patch.nodes])
        solved = wear.displacement[row].reshape(local.shape)
        assert np.abs(local - solved).max() < 1e-7 * np.abs(solved).max()


def test_loops_enclose_the_energy(finished: Result, tmp_path: Path) -> None:
    """Polygons of 4096 points do, down to the last touch; the loops kept are 64 of them, marched in coarser steps."""
    wear, loops = finished.wear, finished.loops
    balance = modelling.build(read("beam", SMALL), Progress()).balance.with_samples(4096, located=False)
    fine = full_fields.hysteresis_loops(balance, [wear.rows()[row] for row in loops.row], loops.row)
    for row, x, force in zip(loops.row, fine.displacement, fine.force, strict=True):
        following = np.roll(x, -1, -1) - np.roll(x, 1, -1)
        area = 0.5 * np.sum(force * following, axis=(1, 2))
        assert area.sum() == pytest.approx(wear.energy[row].sum(), rel=1e-3)
    for saved, all_of_them in ((loops.displacement, fine.displacement), (loops.force, fine.force)):
        complete = all_of_them.shape[-1] // saved.shape[-1]
        np.testing.assert_allclose(saved, all_of_them[..., ::complete], atol=0.02 * np.abs(saved).max())


def test_references_peak_where_the_modes_are(finished: Result) -> None:
    references = finished.references
    hertz = references.omega / (2 * np.pi)
    spacing = hertz[1] - hertz[0]
    free = finished.facts.open_frequencies[0]
    assert hertz[np.argmax(references.free)] == pytest.approx(free, abs=2 * spacing)
    stuck = finished.facts.stuck_frequencies
    refined = stuck[(stuck > hertz[0]) & (stuck < hertz[-1])]
    assert np.abs(hertz[np.argmax(references.stuck)] - refined).min(initial=np.inf) <= 2 * spacing
    # without contact the peak is the free one, 1 % damping: amplitudes agree where the grid of 5 Hz allows
    assert finished.wear.amplitude[-1] >= 0.99 * references.free.max()


def test_the_highest_linear_response_is_that_of_a_fine_grid(tmp_path: Path) -> None:
    balance = modelling.build(read("beam", SMALL), Progress()).balance
    low, high = 2 * np.pi * 300.0, 2 * np.pi * 1000.0
    highest = references.highest_linear(balance, "response", low, high)
    drawn = references.linear_references(balance, "response", 2 * np.pi * 410.0, 2 * np.pi * 430.0)
    assert highest == pytest.approx(drawn.free.max(), rel=1e-3)
    only_stuck = references.linear_references(balance, "response", 2 * np.pi * 500.0, high)
    assert references.highest_linear(balance, "response", 2 * np.pi * 500.0, high) == pytest.approx(
        max(only_stuck.free.max(), only_stuck.stuck.max()), rel=1e-3
    )


def test_transitions_are_located_where_every_law_can(tmp_path: Path) -> None:
    for law, expected in (("jenkins", "located"), ("coulomb_planar", "sampled")):
        file = read("beam", [*SMALL, 'harmonics.transitions="auto"', f"contact.law={law}"])
        assert modelling.build(file, Progress()).balance.basis.transitions == expected


@pytest.mark.faults
def test_a_run_killed_again_and_again_at_its_last_row_keeps_one_of_it(finished, tmp_path, monkeypatch):
    """Where the loss of contact is stored but not yet the sentence that says so."""
    rows: list[Result] = []
    monkeypatch.setattr(store, "save", lambda path, state: rows.append(state))
    earlier = replace(finished, stage=Stage.WEARING, wear=replace(finished.wear, end=WearEnd.UNFINISHED.say()))
    for _ in range(2):
        rows.clear()
        resumed = pipeline.run(read("beam", SMALL), tmp_path, Progress(), earlier)
        assert_same_wear(resumed, finished)
        earlier = next(state for state in rows if state.stage is Stage.WEARING)
        assert earlier.wear is not None
        changed = replace(earlier.wear, end=finished.wear.end)
        assert_same_wear(replace(earlier, stage=finished.stage, wear=changed), finished)


@pytest.mark.faults
@pytest.mark.parametrize("rule", ["thesis", pytest.param("error_controlled", marks=pytest.mark.slow)])
def test_ten_kills_at_random_moments_change_no_bit(rule, tmp_path, capsys):
    smallest = (*SMALLER, "geometry.n_length=2", "reduction.modes=3", "harmonics.samples=32", "response.points=5")
    overrides = (*smallest, f"wear.rule={rule}", "wear.step=40 %", "wear.tolerance=0.4", "wear.lost_below=0.3")
    server = multiprocessing.get_context("forkserver")
    server.set_forkserver_preload(["tests.helpers.killed_runs", "tests.helpers.warmed"])

    def exit_code(folder: Path, killed_after: float = 0.0) -> int | None:
        process = server.Process(target=go_on, args=(folder, overrides, killed_after))
        process.start()
        process.join()
        return process.exitcode

    assert exit_code(tmp_path) == 0
    full = store.load(tmp_path / "result.h5")
    assert full.state.startswith("complete")
    takes = float((tmp_path / SPENT).read_text())  # of the processor: a busy machine kills at the same moments
    path, kills, rng = tmp_path / "killed" / "result.h5", 0, np.random.default_rng(7)
    path.parent.mkdir()
    for _ in range(40):
        code = exit_code(path.parent, rng.uniform(0.0, 0.5 * takes))
        assert code in (0, -signal.SIGPROF)
        if code:
            kills += 1
            if path.exists():
                assert store.load(path).state.startswith(("model built", "response computed", "unfinished", "complete"))
        else:  # it came to its end: once more from the start
            assert_same_wear(store.load(path), full)
            path.unlink()
        if kills == 10:
            break
    assert kills == 10
    assert leave(words(path.parent, "--resume", overrides=overrides), capsys)[0] == 0  # the user's way, once
    assert_same_wear(store.load(path), full)


def assert_same_wear(resumed: Result, whole: Result) -> None:
    assert resumed.state == whole.state
    assert resumed.wear is not None
    for name in ("cycles", "depth", "energy", "preload", "omega", "displacement", "force", "solves"):
        assert np.array_equal(getattr(resumed.wear, name), getattr(whole.wear, name)), name


@pytest.mark.faults
def test_ctrl_c_keeps_what_was_computed_and_says_where_from_which_it_goes_on(tmp_path, capsys):
    process = start(tmp_path, "--set", "wear.step=0.01 %")  # of more steps than any machine takes in the meantime
    wait_for_rows(process, tmp_path / "result.h5", 2)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert err.count("\n") == 1
    assert str(tmp_path / "result.h5") in err
    assert err.endswith("--set 'wear.step=0.01 %' --resume.\n")
    wear = store.load(tmp_path / "result.h5").wear
    count = len(wear.cycles)
    assert count >= 2
    leave(words(tmp_path, "--set", "wear.step=0.01 %", "--set", f"wear.max_steps={count}", "--resume"), capsys)
    np.testing.assert_array_equal(store.load(tmp_path / "result.h5").wear.depth[:count], wear.depth)


def test_a_failed_solve_says_where_and_leaves_with_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = leave(words(tmp_path, "--set", "solver.tolerance=1e-50"), capsys)
    assert code == 3
    assert err.count("\n") == 1
    assert "ended at 380 Hz" in err
    assert store.load(tmp_path / "result.h5").response is not None


def test_resuming_another_scene_is_refused(finished, tmp_path, capsys):
    store.save(tmp_path / "result.h5", finished)
    sizes = ("--set", "geometry.n_patch=5", "--set", "response.points=25")
    err = refusal(words(tmp_path, "--resume", *sizes, "--set", "contact.friction=0.4"), capsys)
    assert "contact.friction differs" in err


def test_an_earlier_result_is_set_aside(finished: Result, tmp_path: Path) -> None:
    store.save(tmp_path / "result.h5", finished)
    pipeline.run(read("beam", [*SMALL, "wear.max_steps=0"]), tmp_path, Progress())
    assert store.load(tmp_path / "result.previous.h5").wear.ended.lost
    assert store.load(tmp_path / "result.h5").wear_steps == 0


def test_a_mesh_file_gives_what_its_part_gives(finished: Result, tmp_path: Path) -> None:
    file = read("beam", SMALL)
    modelling.make_mesh(file, tmp_path)
    text = file.text
    begin, end = text.index("[geometry]"), text.index("[material]")
    base = tmp_path / "own.toml"
    base.write_text(text[:begin] + '[geometry]\nmesh = "mesh.msh"\nfixed = ["clamp"]\n' + text[end:])
    overrides = [override for override in SMALL if not override.startswith("geometry.")]
    result = pipeline.run(read(str(base), [*overrides, "wear="]), tmp_path, Progress())
    assert np.array_equal(result.response.response, finished.response.response)


def test_more_steps_go_on_from_a_run_that_stopped(finished: Result, tmp_path: Path) -> None:
    short, longer = read("beam", [*SMALL, "wear.max_steps=2"]), read("beam", [*SMALL, "wear.max_steps=4"])
    stopped = pipeline.run(short, tmp_path, Progress())
    assert stopped.state == "complete: stopped after 2 wear steps"
    assert checkpoint.is_complete(stopped, short.scene)
    assert not checkpoint.is_complete(stopped, longer.scene)
    assert checkpoint.same_problem(short.scene, longer.scene) == ""
    extra = pipeline.run(longer, tmp_path, Progress(), stopped)
    assert np.array_equal(extra.wear.depth, finished.wear.depth[:5])  # the last row is the state behind the last step


def test_a_share_of_no_deflection_is_refused_before_long_work(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"wear\.step: a share of delta_max needs static loads"):
        pipeline.run(read("beam", [*SMALL, "loads.static.press.value=0 N"]), tmp_path, Progress())
    assert not (tmp_path / "result.h5").exists()


def test_worn_volume_is_shared_by_both_bodies_and_pictures_are_drawn(finished: Result, tmp_path: Path) -> None:
    of_bodies = [summary(finished)[f"volume_of_body_{n}"] for n in (1, 2)]
    assert of_bodies == pytest.approx([0.5 * summary(finished)["volume"]] * 2)
    drawn = {path.name for path in plots.draw(finished, tmp_path, dpi=60)}
    assert {"frf.png", "depth.png"} <= drawn


def test_the_error_controlled_rule_runs_from_a_scene(tmp_path: Path) -> None:
    mission = 'wear.mission=[{at = "peak", share = "60 %"}, {at = "98 % of peak", share = "40 %"}]'
    overrides = [
        *SMALL, "wear.rule=error_controlled", "wear.step=", "wear.at=", "wear.max_steps=3", "wear.motion=balance",
        mission,
    ]  # fmt: skip
    result = pipeline.run(read("beam", overrides), tmp_path, Progress())
    wear, patch = result.wear, result.patch
    assert result.state == "complete: stopped after 3 wear steps"
    assert wear.duty_omega.shape == (4, 2)
    assert wear.duty_omega[:, 1] == pytest.approx(0.98 * wear.duty_omega[:, 0], rel=1e-4)
    assert wear.step_error.max() <= 1.0
    assert wear.worn.sum(0) @ patch.area == pytest.approx(2e-15 * wear.work.sum(), rel=1e-12)
