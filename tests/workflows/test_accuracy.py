"""Trade of the knobs of a small beam, the promise of `run --accuracy`, grids and their limit, the error budget."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tribodyn.workflows.accuracy import accuracy, budget, converge, knob_trade, knobs, trade_table
from tribodyn.workflows.accuracy.limit import limit_of
from tribodyn.workflows.accuracy.measure import measure
from tribodyn.workflows.accuracy.trade_table import Trade, TradeRow
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result import store
from tribodyn.workflows.result.facts import BudgetEntry, Facts, Stage
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

SMALL = (
    "geometry.n_length=4",
    "geometry.n_height=1",
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3",
    "response.points=30",
    "harmonics.samples=64",
)
NO_WEAR = (*SMALL, "wear=", "verdict.enabled=false")
TRADED = ("modes", "samples", "newton", "points")


def shipped_trade(name: str) -> Path:
    """The table that comes with a scene."""
    return accuracy.beside(scene_file.read(name))


def dear_by_size(trade: Trade) -> Trade:
    """The trade as of a clock by which each finer setting takes half as long again: so machines choose alike."""

    def rank(row: TradeRow) -> int:
        return sum(other.size < row.size or np.isnan(row.size) for other in trade.of(row.knob) if other is not row)

    return replace(trade, base_seconds=1.0, rows=tuple(replace(row, share=1.5 ** rank(row)) for row in trade.rows))


@pytest.fixture(scope="module")
def table() -> Trade:
    return dear_by_size(knob_trade.run("beam", TRADED, NO_WEAR, lambda text: None))


def knobs_of(scene: str) -> tuple[knobs.Knob, ...]:
    file = scene_file.read(scene)
    return knobs.knobs_of(file, knobs.study_of(file))


def set_of(overrides: tuple[str, ...]) -> list[str]:
    return [word for text in overrides for word in ("--set", text)]


def test_each_knob_is_held_against_where_it_tends_to(table: Trade) -> None:
    assert table.knobs == TRADED
    for knob in TRADED:
        rows = table.of(knob)
        assert all(row.outcome == "converged" and row.seconds > 0 and row.memory > 1e7 for row in rows)
        errors = [accuracy.error_of(rows, place, "peak_m") for place in range(len(rows))]
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
    assert knob_trade.as_records(again) == knob_trade.as_records(table)
    assert json.loads(path.read_text())["key"] == table.key
    path.write_text("[]")
    with pytest.raises(ValueError, match="no trade table of this version"):
        trade_table.load(path)


def test_accuracy_meets_what_it_promises(table: Trade, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Settings for a wanted error, run by the command, against the finest setting of every knob at once."""
    path, wanted = tmp_path / "trade.json", 0.02
    trade_table.save(table, path)
    words = ["run", "beam", *set_of(NO_WEAR), "--accuracy", "2 %", "--table", str(path), "--no-pictures"]
    cli.app([*words, "--out", str(tmp_path)], result_action="return_value")
    assert "expected error" in capsys.readouterr().out
    result = store.load(tmp_path / "result.h5")
    finest = tuple(text for knob in table.knobs for text in table.of(knob)[-1].overrides)
    reference = measure(scene_file.read("beam", (*NO_WEAR, *finest)))
    chosen = result.provenance["overrides"].splitlines()
    file = scene_file.read("beam", chosen)
    promised = measure(file, refined=False)
    for quantity in ("peak_hz", "peak_m", "energy_J", "preload_N"):
        ours, theirs = promised.values[quantity], reference.values[quantity]
        assert ours is not None
        assert ours == pytest.approx(theirs, rel=wanted), quantity
    assert result.response is not None
    assert result.response.amplitude("response").max() == pytest.approx(reference.values["peak_m"], rel=wanted)
    choice = accuracy.choose(table, wanted)
    assert choice.error <= wanted
    assert choice.seconds <= accuracy.choose(table, wanted / 2).seconds


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


@pytest.mark.parametrize("scene", sorted(COARSE))
def test_a_promise_is_checked_against_finer_settings(
    scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    knob, wanted = ASKED.get(scene, ("krylov", "1 %"))
    path = tmp_path / "trade.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(knobs, "WEAR_TOLERANCES", (0.6, 0.3))
        trade_table.save(dear_by_size(knob_trade.run(scene, (knob,), COARSE[scene], lambda text: None, 2)), path)
    words = ["trade", scene, *set_of(COARSE[scene]), "--out", str(path), "--check", wanted]
    cli.app(words, result_action="return_value")
    assert capsys.readouterr().out.rstrip().endswith("promise kept")


def test_a_broken_promise_ends_with_code_1(table: Trade, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table that takes coarse points for exact."""
    path, nothing = tmp_path / "trade.json", {name: 0.0 for name in trade_table.QUANTITIES}
    rows = [row for row in table.of("points") if row.tunable]
    trade_table.save(replace(table, rows=(replace(rows[0], errors=nothing), *rows[1:])), path)
    with pytest.raises(SystemExit) as left:
        cli.main(["trade", "beam", *set_of(NO_WEAR), "--out", str(path), "--check", "0.1 % of peak frequency"])
    assert left.value.code == 1
    assert "BROKEN" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ("1 kg", "--accuracy"),
        ("0 %", "above 0"),
        ("1 % of beauty", '"beauty" is none of peak frequency, amplitude'),
        ("", "expected a number"),
        ("of life", "expected a number"),
        ("-1 %", "above 0"),
        ("nan", "expected a number"),
        ("1", "an error of 100 % says nothing"),
        ("200 %", "an error of 200 % says nothing"),
        ("1 % of", 'after "of" nothing is none of'),
        ("1 % of life,", 'after "of" nothing is none of'),
        ("1 % of life or energy", '"life or energy" is none of'),
        ("1 % given", 'after "given" a knob is missing'),
        ("1 % of life given harmonics,", 'after "given" a knob is missing'),
    ],
)
def test_an_accuracy_that_means_nothing_is_refused(asked: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        accuracy.parsed(asked)


@pytest.mark.parametrize(
    ("asked", "meant"),
    [
        ("1 %", (0.01, (), ())),
        ("0.02", (0.02, (), ())),
        ("1 percent of the life.", (0.01, ("life_cycles",), ())),
        ("1 % of life, energy", (0.01, ("life_cycles", "energy_J"), ())),
        (" 5%  of Peak frequency  and  amplitude", (0.05, ("peak_hz", "peak_m"), ())),
        ("1 % of depth, energy, and depth", (0.01, ("depth_m", "energy_J"), ())),
        ("1 % of life given fe mesh and harmonics", (0.01, ("life_cycles",), ("fe_mesh", "harmonics"))),
        ("2 % of depth, life, given harmonics", (0.02, ("depth_m", "life_cycles"), ("harmonics",))),
        ("3 % given contact_grid", (0.03, (), ("contact_grid",))),
    ],
)
def test_an_accuracy_is_read_as_people_write_it(asked: str, meant: tuple[object, ...]) -> None:
    wanted, quantities, given = accuracy.parsed(asked)
    assert (pytest.approx(wanted), quantities, given) == meant


def test_a_quantity_that_the_scene_has_not_is_refused_not_forgotten() -> None:
    for asked in ("1 % of amplitude, energy", "1 % of life"):
        with pytest.raises(ValueError, match=r"no (energy|life), but peak frequency, amplitude, preload"):
            accuracy.tuned("leaf_seal", (), asked, shipped_trade("leaf_seal"))


def with_a_trade() -> list[str]:
    """Scenes whose trade was measured; that of the others would take hours."""
    found = [name for name in scene_file.names() if shipped_trade(name).is_file()]
    assert {"beam", "blade", "leaf_seal", "rig"} <= set(found)
    return found


def test_every_trade_was_measured_on_its_scene_as_it_is() -> None:
    for name in with_a_trade():
        found = accuracy.table_of(scene_file.read(name), shipped_trade(name))
        assert len(found.knobs) >= 8
        settings = {knob.name: knob.settings for knob in knobs_of(name)}
        assert set(found.knobs) <= set(settings)


def test_a_knob_may_stay_as_the_scene_has_it() -> None:
    """Life of the beam has not settled in the harmonics: it is promised for those that the scene keeps."""
    measured = trade_table.load(shipped_trade("beam"))
    with pytest.raises(ValueError, match=r'of knob harmonics leaves .* add "given harmonics"'):
        accuracy.choose(measured, 0.01, ["life_cycles"])
    file, choice = accuracy.tuned("beam", (), "1 % of life given harmonics", shipped_trade("beam"))
    assert file.scene.harmonics.kept == scene_file.read("beam").scene.harmonics.kept
    assert choice.error <= 0.007
    assert "error by harmonics is not counted" in choice.sentence
    file, choice = accuracy.tuned("beam", (), "1 %", shipped_trade("beam"))
    assert file.scene.wear is not None
    assert {"peak_hz", "preload_N", "depth_m"} <= set(choice.errors)
    assert "life_cycles" not in choice.errors
    assert "nothing else is promised: an accuracy of 0.01 is more than" in choice.sentence
    named = ", ".join(trade_table.NAMES)
    with pytest.raises(ValueError, match="more than the trade of beam can promise"):  # named, hence promised or refused
        accuracy.tuned("beam", (), f"1 % of {named}", shipped_trade("beam"))
    with pytest.raises(ValueError, match='no knob "taste"'):
        accuracy.choose(measured, 0.01, given=["taste"])


def test_a_table_of_another_scene_is_refused(table: Trade, tmp_path: Path) -> None:
    path = tmp_path / "trade.json"
    trade_table.save(table, path)
    with pytest.raises(ValueError, match="was measured on another scene"):
        accuracy.tuned("beam", (*NO_WEAR, "contact.friction=0.4"), "2 %", path)
    with pytest.raises(ValueError, match=r"more than the trade of beam can promise: .* of knob points leaves"):
        accuracy.choose(table, 1e-9)


def test_nothing_is_worn_where_no_wear_is_asked_for() -> None:
    for asked, worn in (("2 % of peak frequency", False), ("2 % of depth", True)):
        file, choice = accuracy.tuned("beam", (), asked, shipped_trade("beam"))
        assert (file.scene.wear is not None) == worn
        assert choice.error <= 0.02


def test_a_knob_that_the_scene_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="the scene has the knobs fe_mesh, contact_grid, nodes, modes"):
        knob_trade.run("beam", ("wheels",), NO_WEAR, lambda text: None)
    known = {scene: knobs_of(scene) for scene in with_a_trade()}
    has = {scene: {knob.name for knob in found} for scene, found in known.items()}
    assert {"wear", "friction", "interface_rank"} <= has["beam"]
    assert not {"wear", "friction", "nodes"} & has["leaf_seal"]
    assert all({"fe_mesh", "contact_grid", "harmonics", "samples", "points"} <= found for found in has.values())
    assert all({"wear", "wear_thesis", "friction"} <= has[scene] for scene in ("beam", "blade", "rig"))
    assert "interface_rank" not in has["blade"]
    friction = {scene: knob for scene, found in known.items() for knob in found if knob.name == "friction"}
    assert {scene: knob.wears(knob.settings[0]) for scene, knob in friction.items()} == {
        "beam": True, "blade": True, "rig": False,
    }  # fmt: skip


def test_every_setting_of_every_knob_is_a_scene() -> None:
    for scene in scene_file.names():
        study = knobs.study_of(scene_file.read(scene))
        for knob in knobs.knobs_of(scene_file.read(scene, study.base), study):
            for setting in knob.settings:
                assert scene_file.read(scene, (*study.base, *setting.overrides)).name == scene
        for ladder in study.ladders:
            for setting in ladder.settings:
                for placement in ((), *ladder.placements):
                    scene_file.read(scene, (*ladder.base, *setting.overrides, *placement))


def made_up(knob: str, cost: float, error: float) -> TradeRow:
    values: dict[str, float | None] = {**dict.fromkeys(trade_table.QUANTITIES), "peak_m": 1 + error}
    errors: dict[str, float | None] = {**dict.fromkeys(trade_table.QUANTITIES), "peak_m": error}
    label = f"{knob}={cost:g}"
    doubts = {name: None if e is None else 0.0 for name, e in errors.items()}
    return TradeRow(knob, label, cost, (label,), values, errors, doubts, cost, cost / 4, 0.0, "converged", True)


def test_the_cheapest_combination_is_found() -> None:
    rows = [made_up("a", 1, 0.1), made_up("a", 2, 0.004), made_up("a", 9, 0.0)]
    rows += [made_up("b", 3, 0.002), made_up("b", 4, 0.001), made_up("b", 8, 0.0)]
    trade = Trade("made up", "", (), 4.0, tuple(rows))
    assert accuracy.choose(trade, 0.01).overrides == ("a=2", "b=3")
    assert accuracy.choose(trade, 0.2).overrides == ("a=1", "b=3")
    front = accuracy.front(trade, "peak_m")
    assert [choice.seconds for choice in front] == sorted(choice.seconds for choice in front)
    assert [choice.error for choice in front] == sorted((choice.error for choice in front), reverse=True)
    assert front[-1].overrides == ("a=9", "b=8")
    assert accuracy.advice(trade)[0].startswith("for 1 % on amplitude use a=2, b=3: ")


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
    words = ["converge", "beam", "--most", "9", "--json", "--out", str(tmp_path)]
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
    assert study.needed("peak_m", 1e-4) is None
    text = converge.as_text([study])
    assert "1 % on amplitude needs n=7 (49 pairs) or finer; the limit is known to 0.1 %" in text
    assert "the grid of the scene, n=7 (49 pairs), is good for 1 % on all: amplitude 0.8 %" in text
    poor = replace(study, rows=(grid_row(3, 0.03, own=True), *rows[1:]))
    assert "n=3 (9 pairs), misses 1 % on amplitude: amplitude 3 %" in converge.as_text([poor])


def test_the_budget_of_a_run(tmp_path: Path) -> None:
    words = ["run", "beam", *set_of(SMALL), "--set", "wear.max_steps=2", "--no-pictures", "--out", str(tmp_path)]
    cli.app(words, result_action="return_value")
    result = store.load(tmp_path / "result.h5")
    found = {entry.source: entry for entry in result.budget}
    assert {"modes", "harmonics", "samples", "newton, krylov", "points", "wear steps", "compliance"} <= set(found)
    assert found["newton, krylov"].error < 1e-5
    assert found["samples"].error < 1e-4
    assert 0 < found["points"].error < 0.05
    shown = dict(budget.lines(result))
    assert "estimate" in shown["  harmonics"]


def test_what_no_estimator_covers_is_known_from_the_trade() -> None:
    """A grid that was not measured itself has the error of the next coarser one."""

    def traded(knob: str, size: float, error: float, *overrides: str) -> TradeRow:
        return replace(made_up(knob, size, error), overrides=overrides)

    rows = [traded("contact_grid", n, 0.1 / n, f"geometry.n_patch={n}") for n in (3, 5, 9)]
    rows += [traded("fe_mesh", n, 0.01 / n, f"geometry.n_length={12 * n}") for n in (1, 2)]
    rows += [traded("newton", 1.0, 0.5, "solver.tolerance=1")]
    table = Trade("beam", "", (), 1.0, tuple(rows))

    def found(*overrides: str) -> dict[str, tuple[float | None, str]]:
        entries = budget._of_trade(scene_file.read("beam", overrides), budget.ESTIMATED)
        return {entry.source: (entry.error, entry.by) for entry in entries}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget.accuracy, "table_of", lambda _: table)
        scene = found("geometry.n_patch=13")
        assert scene["contact grid"] == (pytest.approx(0.1 / 9), "trade: as with the coarser contact_grid=9")
        assert scene["fe mesh"] == (pytest.approx(0.01), "trade: fe_mesh=1")
        assert "newton" not in scene
        assert found("harmonics.kept=[0, 1]", "geometry.n_patch=5")["contact grid"] == (
            pytest.approx(0.02),
            "trade: contact_grid=5",
        )
        error, how = found("geometry.n_length=6")["fe mesh"]
        assert error is None
        assert "finer settings alone" in how


def test_samples_do_not_make_another_setting_where_transitions_are_located() -> None:
    """The trade's harmonics are measured with more samples than the scene has; sampled ones would be another result."""
    for transitions, known in (("located", True), ("sampled", False)):
        file = scene_file.read("beam_thesis", (f'harmonics.transitions="{transitions}"',))
        overrides = ("harmonics.kept=[0, 1]", "harmonics.samples=128")
        assert (budget._compared(file, overrides) == budget.SAME) == known
    entries = budget._of_trade(scene_file.read("beam", ("harmonics.kept=[0, 1]",)), ())
    errors = {e.quantity: e.error for e in entries if e.source == "harmonics"}
    assert 0.2 < errors["life"] < 0.3  # a peak that another one overtakes with more harmonics kept


def test_where_one_step_tells_nothing_of_the_harmonics_the_trade_does(tmp_path: Path) -> None:
    """The highest point of the leaf seal is a fold, at which a step at the same frequency leads anywhere."""
    table = trade_table.load(shipped_trade("leaf_seal"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget.accuracy, "table_of", lambda _: table)
        file = scene_file.read("leaf_seal_thesis", ('response.frequency=["120 Hz", "180 Hz"]', "verdict.enabled=false"))
        entries = pipeline.run(file, tmp_path, Progress()).budget
    found = {entry.quantity: entry for entry in entries if entry.source == "harmonics"}
    assert {entry.by for entry in found.values()} == {"trade: kept=[0, 1]"}
    # one harmonic overstates the peak by a quarter, as time integration finds too (./tribodyn prove leaf accuracy)
    assert found["amplitude"].error == pytest.approx(0.24, abs=0.01)


def test_the_budget_says_where_no_life_can_be_stated() -> None:
    result = Result({}, Facts(), Stage.COMPLETE, (BudgetEntry("wear steps", "life", 0.8, "estimate"),))
    assert "no life can be stated" in dict(budget.lines(result))["  wear steps"]
    assert replace(made_up("a", 1, 0.1), outcome="solve failed").worst == np.inf
