"""Trade of the settings of a small beam, grids and their limit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tribodyn.workflows.command import main as cli
from tribodyn.workflows.errors import choice, ladders, trade, trade_table
from tribodyn.workflows.errors.limit import limit_of
from tribodyn.workflows.errors.trade_table import Trade, TradeRow
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import convergence as converge
from tribodyn.workflows.studies.trades import Traded

SMALL = (
    "geometry.n_length=4",
    "geometry.n_height=1",
    "harmonics.kept=[0, 1]",
    "wear.tolerance=2 %",
    "wear.at=peak",
    "wear.motion=machine",
    "geometry.n_patch=3",
    "response.points=30",
    "harmonics.samples=64",
)
NO_WEAR = (*SMALL, "wear=", "verdict.enabled=false")
TRADED = ("modes", "samples", "newton", "points")


def dear_by_size(trade: Trade) -> Trade:
    """The trade as of a clock by which each finer setting takes half as long again: so machines choose alike."""

    def rank(row: TradeRow) -> int:
        others = [other for other in trade.of(row.parameter) if other is not row]
        return sum(other.size < row.size or np.isnan(row.size) for other in others)

    return replace(trade, base_seconds=1.0, rows=tuple(replace(row, share=1.5 ** rank(row)) for row in trade.rows))


@pytest.fixture(scope="module")
def table() -> Trade:
    return dear_by_size(trade.run("beam", TRADED, NO_WEAR, lambda text: None))


def parameters_of(scene: str) -> tuple[ladders.Parameter, ...]:
    file = scene_file.read(scene)
    return ladders.parameters_of(file, ladders.study_of(file))


def set_of(overrides: tuple[str, ...]) -> list[str]:
    return [word for text in overrides for word in ("--set", text)]


def test_each_parameter_is_held_against_where_it_tends_to(table: Trade) -> None:
    assert table.parameters == TRADED
    for parameter in TRADED:
        rows = table.of(parameter)
        assert all(row.outcome == "converged" and row.seconds > 0 and row.memory > 1e7 for row in rows)
        errors = [choice.error_of(rows, place, "peak_m") for place in range(len(rows))]
        assert errors[-1] <= errors[0]
        assert errors[-1] < 1e-4
    assert table.of("points")[-1].setting == "refined peak"
    assert not table.of("points")[-1].tunable
    assert all(error == 0 for error in table.of("points")[-1].errors.values() if error is not None)


def test_where_values_tend_to() -> None:
    for order in (1.0, 2.0, 3.0):
        sizes = [2.0, 4.0, 6.0, 8.0]
        found = limit_of(sizes, [5 + 3 * size**-order for size in sizes])
        assert found.value == pytest.approx(5, rel=1e-9)
        assert found.order == pytest.approx(order, rel=1e-6)
        assert found.doubt == pytest.approx(0.25 * 3 * 8**-order / 5, rel=1e-6)
    alternating = limit_of([1, 2, 4], [1.1, 0.97, 1.01])
    assert (alternating.value, alternating.doubt) == (1.01, pytest.approx(0.04 / 1.01))
    unsettled = limit_of([1, 2, 4], [1.0, 1.1, 1.3])
    assert (unsettled.value, unsettled.doubt) == (1.3, pytest.approx(0.3 / 1.3))
    assert limit_of([1, 3], [1.3, 1.1]).doubt == pytest.approx(0.1 / 1.1)  # of first order
    assert limit_of([1], [1.3]).doubt == np.inf
    exact = limit_of([1, 2, np.nan], [1.04, 1.01, 1.0])
    assert (exact.value, exact.doubt) == (1.0, 0.0)
    assert exact.order == pytest.approx(2)
    assert limit_of([1e4, 1e6, 1e8], [1.0, 1.0, 1.0]).doubt == 0.0


def test_the_table_survives_its_file(table: Trade, tmp_path: Path) -> None:
    path = tmp_path / "trade.json"
    trade_table.save(table, path)
    again = trade_table.load(path)
    assert Traded(again, None).record() == Traded(table, None).record()
    assert json.loads(path.read_text())["key"] == table.key
    path.write_text("[]")
    with pytest.raises(ValueError, match="no trade table of this version"):
        trade_table.load(path)


LEAF = (
    "harmonics.kept=[0, 1]",
    "geometry.n_column=11",
    "geometry.pin_column=2",
    'response.frequency=["100 Hz", "200 Hz"]',
)
BLADE = ("geometry.n_along=3", "geometry.n_up=3", "wear=", "response.points=30")
RIG = ("geometry.n_contact_length=3", "geometry.n_contact_width=3", "wear=", 'response.method="natural"')
RIG = (*RIG, "response.points=9", 'response.frequency=["289 Hz", "293 Hz"]')
COARSE = {"beam": (*SMALL, 'wear.at="700 Hz"'), "blade": BLADE, "leaf_seal": LEAF, "rig": RIG}
ASKED = {"beam": ("wear", "30 % of life, depth"), "blade": ("samples", "1 %"), "leaf_seal": ("newton", "1 %")}
ASKED["rig"] = ("interface_rank", "1 %")


def test_a_parameter_that_the_scene_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="the scene has the parameters fe_mesh, contact_grid, nodes, modes"):
        trade.run("beam", ("wheels",), NO_WEAR, lambda text: None)
    known = {scene: parameters_of(scene) for scene in ("beam", "blade", "leaf_seal", "rig")}
    has = {scene: {parameter.name for parameter in found} for scene, found in known.items()}
    assert {"wear", "friction", "interface_rank"} <= has["beam"]
    assert not {"wear", "friction", "nodes"} & has["leaf_seal"]
    assert all({"fe_mesh", "contact_grid", "harmonics", "samples", "points"} <= found for found in has.values())
    assert all({"wear", "wear_thesis", "friction"} <= has[scene] for scene in ("beam", "blade", "rig"))
    assert "interface_rank" not in has["blade"]
    friction = {scene: one for scene, found in known.items() for one in found if one.name == "friction"}
    assert {scene: one.wears(one.settings[0]) for scene, one in friction.items()} == {
        "beam": True, "blade": True, "rig": False,
    }  # fmt: skip


def test_every_setting_of_every_parameter_is_a_scene() -> None:
    for scene in scene_file.names():
        study = ladders.study_of(scene_file.read(scene))
        for parameter in ladders.parameters_of(scene_file.read(scene, study.base), study):
            for setting in parameter.settings:
                assert scene_file.read(scene, (*study.base, *setting.overrides)).name == scene
        for ladder in study.ladders:
            for setting in ladder.settings:
                for placement in ((), *ladder.placements):
                    scene_file.read(scene, (*ladder.base, *setting.overrides, *placement))


def made_up(parameter: str, cost: float, error: float) -> TradeRow:
    values: dict[str, float | None] = {**dict.fromkeys(trade_table.QUANTITIES), "peak_m": 1 + error}
    errors: dict[str, float | None] = {**dict.fromkeys(trade_table.QUANTITIES), "peak_m": error}
    label = f"{parameter}={cost:g}"
    doubts = {name: None if e is None else 0.0 for name, e in errors.items()}
    return TradeRow(parameter, label, cost, (label,), values, errors, doubts, cost, cost / 4, 0.0, "converged", True)


def set_by(found: choice.Choice) -> tuple[str, ...]:
    return tuple(text for row in found.rows for text in row.overrides)


def test_the_cheapest_combination_is_found() -> None:
    rows = [made_up("a", 1, 0.1), made_up("a", 2, 0.004), made_up("a", 9, 0.0)]
    rows += [made_up("b", 3, 0.002), made_up("b", 4, 0.001), made_up("b", 8, 0.0)]
    trade = Trade("made up", "", (), 4.0, tuple(rows))
    assert set_by(choice.choose(trade, 0.01)) == ("a=2", "b=3")
    assert set_by(choice.choose(trade, 0.2)) == ("a=1", "b=3")
    front = choice.front(trade, "peak_m")
    assert [choice.seconds for choice in front] == sorted(choice.seconds for choice in front)
    assert [choice.error for choice in front] == sorted((choice.error for choice in front), reverse=True)
    assert set_by(front[-1]) == ("a=9", "b=8")
    assert choice.advice(trade)[0].startswith("for 1 % on amplitude use a=2, b=3: ")


def test_limit_of_a_known_power() -> None:
    size = [3.0, 5.0, 9.0, 17.0]
    for order in (1.0, 2.0):
        found = converge.limit_of(size, [[7.0 + 3.0 * (1 / (n - 1)) ** order] for n in size])
        assert found.value == pytest.approx(7.0, rel=1e-4)
        assert found.order == pytest.approx(order, abs=0.02)


def test_a_limit_of_scattered_values_is_as_uncertain_as_they_are() -> None:
    unsettled = converge.limit_of([3.0, 5.0, 9.0, 17.0], [[1.0], [1.2], [0.9], [1.1]])
    assert np.isnan(unsettled.order)
    assert unsettled.value == pytest.approx(1.05)
    assert unsettled.doubt == pytest.approx(0.15 / 1.05)
    # three that settle, but by less than where the nodes happen to lie makes out
    by_chance = converge.limit_of([3.0, 5.0, 9.0], [[1.04, 1.06], [1.02, 0.97], [1.01]])
    assert np.isnan(by_chance.order)
    assert by_chance.value == pytest.approx((0.97 + 1.06) / 2)
    assert converge.limit_of([3.0, 5.0, 9.0], [[1.04], [1.02, 1.019], [1.01]]).order == pytest.approx(1.0, abs=0.02)


def test_a_linear_field_is_carried_to_a_millionth_of_the_patch() -> None:
    fine = np.array([[x, y] for x in np.linspace(0, 1, 7) for y in np.linspace(0, 2, 6)])
    coarse = np.array([[0.0, 0.0], [0.31, 1.3], [1.0, 2.0]])
    plane = np.array([2.0, -3.0])
    assert converge.on_grid(fine, fine @ plane + 1, coarse) == pytest.approx(coarse @ plane + 1, abs=1e-5)
    beyond = coarse * (1 + 1e-15) + 1e-16  # the rim of a coarser grid, by rounding outside of the finer one
    assert converge.on_grid(fine, fine @ plane + 1, beyond) == pytest.approx(coarse @ plane + 1, abs=1e-5)


def test_grids_of_the_beam(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["study", "converge", "beam", "--most", "9", "--json", "--out", str(tmp_path)]
    words += set_of((*NO_WEAR[:2], "wear="))
    cli.app([*words, *set_of(("reduction.modes=4", "response.points=25"))], result_action="return_value")
    rows = [row for row in json.loads(capsys.readouterr().out) if row["ladder"] == "contact_grid"]
    assert [row["size"] for row in rows] == [5, 7, 9]
    maps = [row["map_difference"] for row in rows]
    assert maps[0] > maps[1] > 0
    assert maps[2] is None
    assert (tmp_path / "converge_beam_contact_grid.png").stat().st_size > 10_000


def grid_row(n: int, worst: float, own: bool = False) -> converge.GridRow:
    none = dict.fromkeys(trade_table.QUANTITIES)
    one = {**none, "peak_m": worst}
    return converge.GridRow(n, f"n={n}", own, n * n, {**none, "peak_m": 1.0}, one, one, 0.1, 1.0, "converged")


def test_the_grid_that_is_needed_is_the_first_from_which_all_are_good() -> None:
    rows = (grid_row(3, 0.004), grid_row(5, 0.02), grid_row(7, 0.008, own=True), grid_row(9, 0.001))
    limits = {"peak_m": converge.Limit(1.0, np.nan, 1e-3)}
    study = converge.Study("made up", "grid", rows, limits, ())
    needed = study.needed("peak_m")
    assert needed is not None
    assert needed.setting == "n=7"
    assert replace(study, rows=rows[:2]).needed("peak_m") is None
    text = "\n".join(converge.Converged((study,)).lines())
    assert "1 % on amplitude needs n=7 (49 pairs) or finer; the limit is known to 0.1 %" in text
    assert "the grid of the scene, n=7 (49 pairs), is good for 1 % on all: amplitude 0.8 %" in text
    poor = replace(study, rows=(grid_row(3, 0.03, own=True), *rows[1:]))
    assert "n=3 (9 pairs), misses 1 % on amplitude: amplitude 3 %" in "\n".join(converge.Converged((poor,)).lines())
