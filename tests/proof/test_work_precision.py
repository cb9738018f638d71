"""Work and precision of the motion on a small beam, and what its table says."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from proof import __main__ as cli, work_precision as measured, work_precision_table as table
from tests.helpers.coarse_scenes import BEAM, RIG
from tribodyn.hbm import newton
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

SMALL = (
    *BEAM,
    'wear.at="950 Hz"',
    'wear.rule="thesis"',
    'wear.step="50 %"',
)
HERTZ = 950.0


@pytest.fixture(autouse=True, scope="module")
def few() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured, "TOPS", (1, 3))
        patch.setattr(measured, "STEPS", (128,))
        patch.setattr(measured, "TICKS", 0.02)
        yield


@pytest.fixture(scope="module")
def found(few: None) -> measured.WorkPrecision:
    return measured.run("beam", None, SMALL, lambda _: None)


def test_energy_is_that_of_the_scene_with_so_many_harmonics(found: measured.WorkPrecision) -> None:
    assert found.place == pytest.approx(HERTZ)
    for row, kept in zip(found.of(measured.LOCATED), ("[0, 1]", "[0, 1, 2, 3]"), strict=True):
        file = scene_file.read("beam", (*SMALL, f"harmonics.kept={kept}"))
        balance = modelling.build(file, Progress()).balance
        state = newton.solve_from_rest(balance, 2 * np.pi * HERTZ).state
        assert row.values["energy"] == pytest.approx(balance.energy(state).sum(), rel=1e-5)
        assert row.seconds > 0


def test_time_steps_come_near_to_the_harmonics_and_lives_are_there(found: measured.WorkPrecision) -> None:
    (integrated,) = found.of(measured.IN_TIME)
    assert found.error(integrated, "energy") == pytest.approx(0.0, abs=0.03)
    assert found.error(integrated, "amplitude") == pytest.approx(0.0, abs=0.03)
    assert abs(found.error(found.of(measured.LOCATED)[0], "energy") or 0.0) > 0.1
    assert found.drawn == ("energy", measured.LIFE)
    lives = [row.values[measured.LIFE] for row in found.of(measured.LIFE)]
    assert lives == pytest.approx([6.3e8, 5.5e8], rel=0.1)
    assert [row.outcome for row in found.of(measured.LIFE)] == [
        "preload fell below 0.001 of its first value",
        "contact lost at every pair",
    ]


def test_candidates_that_are_kept_are_taken_over(found: measured.WorkPrecision, tmp_path: Path) -> None:
    path = tmp_path / "motion.json"
    table.save(found, path)
    assert table.load(path) == found
    again = measured.run("beam", None, SMALL, lambda _: None, earlier=table.load(path))
    assert again == found
    assert measured.key_of(scene_file.read("beam", SMALL), 1.0) != found.key
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(ValueError, match="no work and precision"):
        table.load(path)


def test_what_finds_nothing_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(measured, "PERIODS", 1)
    words = [word for text in (*SMALL[:-3], "wear=") for word in ("--set", text)]
    out = tmp_path / "motion.json"
    with pytest.raises(SystemExit, match="0"):
        cli.main(["motion", "beam", "--at", "950 Hz", "--out", str(out), *words])
    said = capsys.readouterr().out
    assert "not periodic" in said
    assert "time integration has found no periodic motion" in said
    rows = json.loads(out.read_text(encoding="utf-8"))["rows"]
    assert [row["values"] == {} for row in rows] == [False, False, False, False, True]
    assert out.with_suffix(".png").stat().st_size > 10_000


def test_a_prescribed_displacement_is_held_by_its_force_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured, "TOPS", (3,))
    found = measured.run("rig_thesis", 2 * np.pi * 290, (*RIG, "wear="), lambda _: None)
    (integrated,) = found.of(measured.IN_TIME)
    for name in found.names:
        assert found.error(integrated, name) == pytest.approx(0.0, abs=0.1)
