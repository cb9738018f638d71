"""Settings of a small beam: where each tends to, and what it costs."""

import json
from pathlib import Path

import numpy as np
import pytest

from tribodyn.hbm.quantity import names_with_error
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.errors import ladders
from tribodyn.workflows.errors.ladder_table import LadderRow, LadderTable, LadderTables, SolvedSetting, table_of
from tribodyn.workflows.errors.ladders import Ladder, Setting, limit_of
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import convergence
from tribodyn.workflows.studies.convergence import Convergence

SMALL = (
    "geometry.n_length=4", "geometry.n_height=1", "geometry.n_patch=3", "reduction.modes=4", "harmonics.kept=[0, 1]",
)  # fmt: skip


@pytest.fixture(scope="module")
def converged() -> Convergence:
    names = ("modes", "newton", "interface_rank")
    return convergence.converge("beam", settings=names, overrides=(*SMALL, "wear="))


def test_each_setting_is_held_against_where_it_tends_to(converged: Convergence) -> None:
    for ladder in converged.table.ladders:
        assert all(row.solved.outcome == "converged" and row.solved.memory > 1e7 for row in ladder.rows)
        bounds = [ladder.bound(row, "amplitude") for row in ladder.rows]
        assert bounds[-1] == min(bounds) < 5e-3
    exact = converged.table.ladders[-1].rows[-1]
    assert np.isnan(exact.setting.size)
    assert converged.table.ladders[-1].bound(exact, "energy") == 0
    rows = converged.record()
    assert [row["setting"] for row in rows if row["of_the_scene"]] == ["modes=4", "tolerance=1e-08", "interface_modes="]
    assert json.loads(json.dumps(rows)) == rows


def test_where_values_tend_to() -> None:
    for order in (1.0, 2.0, 3.0):
        sizes = [2.0, 4.0, 6.0, 8.0]
        result = limit_of(sizes, [5 + 3 * size**-order for size in sizes])
        assert result.value == pytest.approx(5, rel=1e-9)
        assert result.order == pytest.approx(order, rel=1e-6)
        assert result.doubt == pytest.approx(0.25 * 3 * 8**-order / 5, rel=1e-6)
    alternating = limit_of([1, 2, 4], [1.1, 0.97, 1.01])
    assert (alternating.value, alternating.doubt) == (1.01, pytest.approx(0.04 / 1.01))
    unsettled = limit_of([1, 2, 4], [1.0, 1.1, 1.3])
    assert (unsettled.value, unsettled.doubt) == (1.3, pytest.approx(0.3 / 1.3))
    assert limit_of([1, 3], [1.3, 1.1]).doubt == pytest.approx(0.1 / 1.1)  # of first order
    assert limit_of([1], [1.3]).doubt == np.inf
    exact = limit_of([1, 2, np.nan], [1.04, 1.01, 1.0])
    assert (exact.value, exact.doubt) == (1.0, 0.0)
    positioned = limit_of([4, 4, 8, 8, 16], [1.04, 1.06, 1.02, 0.97, 1.01])  # settles by less than the scatter
    assert np.isnan(positioned.order)
    assert (positioned.value, positioned.doubt) == (1.01, pytest.approx(0.09 / 1.01))
    assert limit_of([2, 4, 4, 8], [1.04, 1.02, 1.019, 1.01]).order == pytest.approx(1.0, abs=0.02)
    assert limit_of([1e4, 1e6, 1e8], [1.0, 1.0, 1.0]).doubt == 0.0


def test_the_life_is_that_of_the_run_and_falls_within_its_doubt() -> None:
    worn = ("wear.at=peak", "wear.motion=machine", 'wear.rule="error_controlled"', "harmonics.samples=32")
    overrides = (*SMALL, *worn, "response.points=10", "geometry.n_length=3", "reduction.modes=2")
    (item,) = convergence.converge("beam", settings=["wear"], most=3, overrides=overrides).table.ladders
    coarse, _, fine = item.rows
    life = fine.solved.values["life"]
    assert life is not None
    assert coarse.solved.values["life"] == pytest.approx(life, rel=0.5)
    assert item.bound(fine, "life") < item.bound(coarse, "life")
    assert fine.solved.seconds > fine.solved.wear_seconds > 0


def test_a_setting_that_the_scene_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="the scene has fe_mesh, contact_grid, placed_grid, modes"):
        convergence.converge("beam", settings=["wheels"])
    reference = {name: ladders_of(name) for name in ("beam", "blade", "leaf_seal", "rig")}
    has = {scene: {item.name for item in result} for scene, result in reference.items()}
    assert {"wear", "interface_rank"} <= has["beam"]
    assert "wear" not in has["leaf_seal"]
    assert all({"fe_mesh", "contact_grid", "harmonics", "samples", "newton"} <= result for result in has.values())
    assert "interface_rank" not in has["blade"]


def ladders_of(scene: str) -> tuple[Ladder, ...]:
    file = scene_file.read(scene)
    study = ladders.study_of(file)
    return ladders.ladders_of(scene_file.read(scene, study.base).scene, study)


def test_every_setting_of_every_ladder_is_a_scene() -> None:
    for scene in scene_file.names():
        base = ladders.study_of(scene_file.read(scene)).base
        for item in ladders_of(scene):
            for setting in item.settings:
                inputs = base if item.base is None else item.base
                file = scene_file.read(scene, (*inputs, *setting.overrides))
                assert file.name == scene


def made_up(name: str, costs: list[float], errors: list[float]) -> LadderTable:
    """A ladder that ends with an exact setting, of known costs and errors in amplitude."""
    none = dict.fromkeys(names_with_error())
    sizes = [*range(1, len(costs)), np.nan]
    rows = [
        LadderRow(
            Setting(size, (f"x.{name}={cost:g}",)),
            SolvedSetting({**none, "amplitude": 1 + error}, 1, cost, 0.0, 0.0, "converged"),
        )
        for size, cost, error in zip(sizes, costs, errors, strict=True)
    ]
    return table_of(Ladder(name, tuple(row.setting for row in rows)), rows, rows[0].setting.label)


def test_the_setting_that_is_needed_is_the_first_from_which_all_are_good() -> None:
    item = made_up("n", [1, 2, 3, 4], [0.004, 0.02, 0.008, 0.0])
    needed = item.coarsest("amplitude", 0.01)
    assert needed.setting.label == "n=3"
    assert made_up("n", [1, 2], [0.004, 0.0]).coarsest("amplitude", 0.001).setting.label == "n=2"
    text = str(Convergence(LadderTables("made up", (), (item,))))
    assert "1% on amplitude needs n=3 or finer" in text
    assert "the setting of the scene, n=1, is good for 1% on all: amplitude 0.004" in text


def test_grids_of_the_beam(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["study", "converge", "beam", "--setting", "contact_grid", "--most", "3", "--json", "--out", str(tmp_path)]
    words += [word for text in (*SMALL, "wear=") for word in ("--set", text)]
    cli.app(words, result_action="return_value")
    rows = json.loads(capsys.readouterr().out)
    assert [row["pairs"] for row in rows] == [25, 81, 169]
    assert {path.name for path in tmp_path.iterdir()} == {"converge_beam.png"}
