"""The scoreboard on scenes of two families, its table, and that a violated error is seen."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof import reference
from proof.unseen_scenes import scoreboard, scoreboard_scenes, scoreboard_table, stress_modes
from proof.unseen_scenes.scoreboard import Judged, Row

SEED = 2
SCENES = (12, 7)  # a beam and a plate that take a second each
COUNTED = Path(__file__).parents[2] / "docs" / "developers" / "scoreboard_rows.jsonl"


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return [scoreboard.measured(number, SEED, 60.0) for number in SCENES]


def test_what_is_stated_of_untuned_scenes_holds(rows: list[Row]) -> None:
    """But for the amplitude of the second, off by a fifth where a sixth is stated: the rule holds in 98 % of all."""
    for row in rows:
        assert row.outcome == "measured"
        assert {item.quantity for item in row.judged if item.counted} >= {"peak_frequency", "amplitude"}
        assert {item["refinement"] for item in row.changes} >= {"harmonics", "mesh and contact grid"}
    violated = [item for row in rows for item in row.judged if item.violated]
    assert {item.quantity for item in violated} <= {"amplitude"}
    assert all((item.true or 0.0) < 1.35 * (item.error or 0.0) for item in violated)


def test_the_reference_is_finer_in_every_setting(tmp_path: Path) -> None:
    drawn = scoreboard_scenes.draw(SCENES[0], SEED, tmp_path)
    assert drawn.text == scoreboard_scenes.draw(SCENES[0], SEED, tmp_path).text
    assert drawn.text != scoreboard_scenes.draw(SCENES[0], SEED + 1, tmp_path).text
    ours = drawn.file(tmp_path)
    fine = reference.finer(ours).mesh_scene
    scene = ours.mesh_scene
    for name in ("n_patch", "n_length", "n_height"):
        assert fine.geometry.parameters[name] > scene.geometry.parameters[name]
    assert (fine.reduction.modes or 0) > 2 * scene.reduction.modes
    assert max(fine.harmonics.kept) >= max(scene.harmonics.kept) + 3
    assert fine.harmonics.samples > scene.harmonics.samples
    assert fine.solver.tolerance < scene.solver.tolerance


def test_stress_comes_to_that_of_the_full_model_with_more_modes() -> None:
    rows = stress_modes.run(1, SEED, lambda sentence: None)
    assert "4 of 4 errors stated by twice the modes hold" in stress_modes.as_text(rows)
    assert rows[0][1][2].max() < 1e-4


def test_the_work_at_a_flat_peak_of_own_matrices_holds() -> None:
    """Where the slope of the height is small over a fiftieth of the width, over which the work changes by 1.5 %."""
    row = scoreboard.measured(13, 1, 60.0, "masses")
    (energy,) = [item for item in row.judged if item.quantity == "energy"]
    assert energy.counted
    assert not energy.violated


def test_scenes_that_all_wear_do_so_in_time(tmp_path: Path) -> None:
    drawn = scoreboard_scenes.draw(4, SEED, tmp_path, "wear")
    assert drawn.family == "rig"  # the fifth of five families: no wave of a wheel is worn in time
    wear = drawn.file(tmp_path).scene.wear
    assert (wear.motion, wear.rule) == ("time", "error_controlled")


def test_rows_are_kept_and_taken_up_again(rows: list[Row], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    def measured(number: int, seed: int, seconds: float, kind: str) -> Row:
        calls.append(number)
        return replace(rows[0], number=number, seed=seed, kind=kind)

    monkeypatch.setattr(scoreboard, "measured", measured)
    two = [replace(rows[0], number=n) for n in range(2)]
    assert scoreboard.run(2, SEED, tmp_path, 1.0, lambda message: None) == two
    scoreboard_table.write(rows, tmp_path)
    assert (tmp_path / "scoreboard.png").exists()
    with (tmp_path / scoreboard.ROWS).open("a") as file:
        file.write('{"number": 7, "se')  # killed while it wrote
    result = scoreboard.run(3, SEED, tmp_path, 1.0, lambda sentence: None)
    assert calls == [0, 1, 2]
    assert result[0] == replace(rows[0], number=0)
    worn = scoreboard.run(1, SEED, tmp_path, 1.0, lambda sentence: None, "wear")  # other scenes of the same seed
    assert (worn, calls) == ([replace(rows[0], number=0, kind="wear")], [0, 1, 2, 0])


def test_a_violated_error_is_reported(tmp_path: Path) -> None:
    off = Judged("energy", 1.0, 0.01, "modes", True, 1.1, 0.09, "")
    good = Row(0, SEED, "beam", "measured", 9, 1, (replace(off, error=0.1),), (), (), (1.0, 1.0, 1.0))
    bad = [replace(good, number=1, judged=(off,)), good]
    assert off.violated
    assert not replace(off, error=0.1).violated
    assert not replace(off, stated=False).violated
    assert not replace(off, error=0.0, true=0.0).counted  # a frequency that the scene gives
    assert "energy: stated 0.01, true 0.09" in scoreboard_table.summary(bad)
    assert "violated:" not in scoreboard_table.summary([good])
    assert np.isclose(scoreboard_table.overestimates(bad, "energy")[0], 0.01 / 0.09)
    scoreboard_table.write(bad, tmp_path)
    table = (tmp_path / "scoreboard.csv").read_text().splitlines()
    assert table[1].split(",")[4:8] == ["energy", "1.0", "0.01", "0.09"]
    assert (tmp_path / "scoreboard.png").stat().st_size > 10_000


def test_the_page_says_what_the_kept_rows_say(tmp_path: Path) -> None:
    """The rows of the campaign are kept beside its page, whose counts, ratios and figure come from them."""
    (tmp_path / scoreboard.ROWS).write_text(COUNTED.read_text(encoding="utf-8"), encoding="utf-8")
    saved = scoreboard.rows_in(tmp_path)
    assert len({row.seed for row in saved}) == 1
    page = COUNTED.with_name("scoreboard.md").read_text(encoding="utf-8")
    for line in scoreboard_table.summary(saved).splitlines():
        assert line.rstrip() in page, line
    assert scoreboard.run(0, saved[0].seed, tmp_path, 1.0, lambda sentence: None) == saved  # nothing is run again
