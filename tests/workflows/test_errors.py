"""The error system: a table of measured changes, one rule, and what is reported of a result."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import tribodyn as td
from proof import reference
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.quantity import names_with_error
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors import accuracy, change_table, judgement, operating_states, refine
from tribodyn.workflows.errors.accuracy import ErrorBound
from tribodyn.workflows.errors.operating_states import relative_change, with_harmonics
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.errors.time_comparison import (
    MotionDifference,
    changes_along_wear,
    compare,
    is_checked,
    wear_differences,
)
from tribodyn.workflows.result import store
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement, Statement, Status, Verdict
from tribodyn.workflows.run import wear_run
from tribodyn.workflows.scene import scene_file

SMALL = (
    "harmonics.kept=[0, 1]", "geometry.n_patch=5", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4",
    "wear.tolerance=10 %", "response.points=20", "verdict.in_time=false", "wear.at=peak", "wear.motion=balance",
)  # fmt: skip
TINY = (
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=5",
    "response.points=20", "harmonics.samples=64", "pictures.renders=false", "wear.tolerance=2 %", "wear.at=peak",
    "wear.motion=balance",
    "verdict.in_time=false",
)  # fmt: skip
OF_STATE = ("peak_frequency", "amplitude", "energy", "preload")


@pytest.fixture(scope="module")
def small() -> td.Result:
    return td.run("beam", overrides=(*SMALL, "wear.max_steps=2"))


def verdict_of(result: td.Result) -> Verdict:
    assert result.verdict is not None
    return result.verdict


def rows(result: td.Result, refinement: Refinement) -> dict[str, MeasuredChange]:
    return {row.quantity: row for row in verdict_of(result).changes if row.refinement == refinement}


def test_every_quantity_has_a_statement(small: td.Result) -> None:
    statements = small.summary()["verdict"]
    words = ("stress", "utilisation", "service", "fatigue", "tension", "ruiz", "topper")  # not asked for
    assert list(statements) == [name for name in names_with_error() if not any(word in name for word in words)]
    for name, statement in statements.items():
        assert statement["stated"] == (statement["status"] == Status.REPORTED), name
        assert (
            not statement["stated"] or 0 < statement["error"] <= DEFAULT.largest
        )  # no value is stated without an error
    assert [statements[name]["stated"] for name in OF_STATE].count(True) >= 2
    assert statements["life"]["value"] is None
    assert json.loads(json.dumps(statements)) == statements


def test_modes_and_mesh_are_refined_one_on_top_of_the_other_and_harmonics_on_the_scenes_own_mesh(small):
    modes, mesh, harmonics = (rows(small, r) for r in (Refinement.MODES, Refinement.MESH, Refinement.HARMONICS))
    for name in OF_STATE:
        assert modes[name].value == harmonics[name].value
        assert modes[name].refined == mesh[name].value
        assert mesh[name].relative == relative_change(mesh[name].value or 0.0, mesh[name].refined or 0.0)
        left_out = (harmonics[name].relative or 0.0) - relative_change(
            harmonics[name].value or 0.0, harmonics[name].refined or 0.0
        )
        assert 0 <= left_out < 2e-3


def test_the_refined_mesh_is_that_of_a_finer_run(small: td.Result) -> None:
    """Twice the elements and twice the modes, run as a scene of its own."""
    finer = td.run(
        "beam",
        overrides=(*SMALL[4:], "geometry.n_patch=9", "geometry.n_length=8", "geometry.n_height=2", "reduction.modes=8",
            "harmonics.kept=[0, 1]", "wear.max_steps=1", "verdict.enabled=false"),
    )  # fmt: skip
    mesh = rows(small, Refinement.MESH)
    assert mesh["preload"].refined == pytest.approx(float(finer.wear.preload[0]), rel=1e-4)
    assert mesh["peak_frequency"].refined == pytest.approx(float(finer.wear.omega[0]) / (2 * np.pi), rel=1e-4)


@pytest.mark.parametrize(("changes", "error"), [
    ({"mesh and contact grid": 0.02, "harmonics": 0.02}, 2.5 * 0.02 + 1.25 * 0.02),  # none cancels another
    ({"mesh and contact grid": 0.02, "modes": 0.01}, 2.5 * 0.03),
    ({"harmonics": 0.0}, 2.5 * DEFAULT.floor),
    ({"harmonics": 0.02, "samples": 0.01}, 2.5 * DEFAULT.floor + 1.25 * 0.03),
    ({"harmonics": 0.02, "mesh and contact grid": None}, None),
    ({"harmonics": None, "mesh and contact grid": 0.02}, None),
    ({}, None),
])  # fmt: skip
def test_a_total_error_is_no_less_than_each_of_its_rows(changes: dict[str, float | None], error: float | None) -> None:
    table = [MeasuredChange(name, "energy", None, None, change, "above the limit") for name, change in changes.items()]
    total, reason = judgement.total_error(table, 2.0)
    assert total == (None if error is None else pytest.approx(error))
    assert (error is None and len(table) > 0) == (reason == "above the limit")


def row(refinement: Refinement, relative: float, quantity: str = "life") -> MeasuredChange:
    return MeasuredChange(refinement, quantity, None, None, relative, "")


def test_the_scatter_of_a_motion_in_time_and_of_its_steps_is_the_least_change_that_counts() -> None:
    changes = [row(Refinement.COMBINED, 0.002), row(Refinement.WEAR_STEPS, 0.01)]
    assert judgement.total_error(changes, 0.7)[0] == 0.01 > DEFAULT.total(0.002, 0.7)
    assert judgement.total_error([changes[0], row(Refinement.WEAR_STEPS, 0.005)], 0.7)[0] == DEFAULT.total(0.002, 0.7)
    assert judgement.total_error([*changes, row(Refinement.MOTION, 0.005)], 0.7)[0] == DEFAULT.total(0.01, 0.7)
    assert judgement.total_error([*changes, row(Refinement.MOTION, 0.03)], 0.7)[0] == DEFAULT.total(0.03, 0.7)
    assert judgement.total_error([*changes, row(Refinement.OTHER_MOTION, 0.06)], 0.7)[0] == pytest.approx(0.01 + 0.06)


def test_the_error_holds_against_a_finer_reference(small: td.Result) -> None:
    file = scene_file.read("beam", (*SMALL, "wear="))
    truth, outcome = reference.solved(file, 120.0)
    assert outcome == reference.MEASURED
    for name, statement in verdict_of(small).statements.items():
        right = truth[name]
        if statement.stated and right is not None:
            assert statement.value is not None
            change = relative_change(statement.value, right)
            assert change < (statement.error or 0.0) < 12 * max(change, DEFAULT.floor)


def test_the_same_scene_has_the_same_errors_in_every_digit(small: td.Result) -> None:
    """Nothing that is decided depends on a clock."""
    first, second = verdict_of(small), verdict_of(td.run("beam", overrides=(*SMALL, "wear.max_steps=2")))
    assert replace(second, seconds=first.seconds) == first


def test_a_life_is_dominated_by_what_changed_it_most() -> None:
    for quantity, expected in (("life", Refinement.COMBINED), ("energy", Refinement.MESH)):
        changes = [row(expected, 0.12, quantity), row(Refinement.WEAR_STEPS, 0.02, quantity)]
        assert judgement.dominating(changes) == expected


def test_what_is_above_a_limit_of_work_is_not_measured() -> None:
    """Limits count unknowns and DOFs; harmonics and modes are measured all the same."""
    limits = replace(DEFAULT, max_unknowns=10)
    file = scene_file.read("beam", (*TINY, "wear="))
    result = td.run(file, overrides=["verdict.enabled=false"])
    verdict = judgement.judge(file, td.build(file), result, change_table.Progress(), limits)
    assert {verdict.statements[name].status for name in OF_STATE} == {Status.NOT_KNOWN}
    assert {row.refinement for row in verdict.changes if row.relative} >= {Refinement.MODES, Refinement.HARMONICS}


def test_depth_and_life_are_those_of_a_finer_wear_run() -> None:
    overrides = (*TINY, "wear.at=700 Hz", "wear.tolerance=60 %")
    result = td.run("beam", overrides=overrides)
    combined = rows(result, Refinement.COMBINED)
    assert result.summary()["life"] == combined["life"].value
    file = scene_file.read("beam", overrides)
    finer = refine.wear(refine.harmonics(refine.modes(refine.mesh(file, 2.0)[0], 2) or file, range(6)), 2.0)
    finer_run = td.run(finer, overrides=["verdict.enabled=false"])
    assert finer_run.summary()["life"] == pytest.approx(combined["life"].refined, rel=1e-6)
    stated(result, result.wear.unstable_share or 0.0)


@pytest.mark.slow
def test_a_coarser_mesh_is_worn_where_a_finer_one_takes_too_much_work() -> None:
    """Its life ends where the scene says, too; an unstable share of the cycles is doubt."""
    ended = ("wear.at=700 Hz", "wear.tolerance=60 %", "wear.lost_below=5 %")
    file = scene_file.read("beam", (*TINY, "geometry.n_patch=5", *ended))
    result = td.run(file, overrides=["verdict.enabled=false"])
    preload = result.wear.preload / result.wear.preload[0]
    assert preload[-2] > 0.05 > preload[-1] > 1e-3
    assert result.wear.cycles[-2] < result.summary()["life"] < result.wear.cycles[-1]
    limits = replace(DEFAULT, max_wear=0.0)
    verdict = judgement.judge(file, td.build(file), result, change_table.Progress(), limits)
    assert verdict.worn_ratio == pytest.approx(refine.mesh(file, 1 / 1.5)[1])
    judged = replace(result, verdict=verdict)
    coarser = refine.harmonics(refine.modes(refine.mesh(file, 1 / 1.5)[0], 2) or file, range(6))
    coarser_run = td.run(coarser, overrides=["verdict.enabled=false"])
    assert rows(judged, Refinement.COMBINED)["life"].refined == pytest.approx(coarser_run.summary()["life"], rel=1e-6)
    assert result.wear.growth is not None
    stated(judged, result.wear.unstable_share or 0.0)
    unstable = replace(result.wear, growth=np.where(np.arange(len(result.wear.growth)) < 2, 1e-3, -1e-3))
    assert unstable.unstable_share == pytest.approx(unstable.cycles_in_step[:2].sum() / unstable.cycles_in_step.sum())


def test_a_refined_run_begins_at_the_peak_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    file = scene_file.read("beam", (*TINY, "wear.rule=thesis", "wear.step=1 um", "wear.max_steps=1"))
    model = td.build(file)
    first, reference = operating_states.unworn_state(file, model), wear_run.worn_out(file, model)
    monkeypatch.delattr(AtPeak, "solve")
    from_peak = wear_run.worn_out(file, model, start=(first.point.state.omega, first.point.state.x))
    assert from_peak.amplitude == pytest.approx(reference.amplitude, rel=1e-5)


def stated(result: td.Result, unstable: float) -> None:
    """The life's error follows from its row by the rule, and is no less than the wear steps say of themselves."""
    verdict = verdict_of(result)
    combined = DEFAULT.total(rows(result, Refinement.COMBINED)["life"].relative or 0.0, verdict.worn_ratio)
    least = rows(result, Refinement.WEAR_STEPS)["life"].relative or 0.0
    assert verdict.statements["life"].error == pytest.approx(max(combined, least) + unstable)


@pytest.mark.parametrize(("changes", "status"), [
    ({}, None),
    ({"differences": {"energy": 0.2}}, Status.CONTRADICTED),
    ({"differences": {"energy": 0.2}, "spread": 0.1}, Status.UNSTABLE),
    ({"error": 0.02, "spread": 0.1}, Status.UNSTABLE),  # how far it is off is not known well enough
    ({"spread": 0.1}, None),  # it leaves, for a motion that answers the same
])  # fmt: skip
def test_what_time_integration_finds_decides_what_is_reported(changes, status):
    comparison = MotionDifference(0.0, np.ones(2), np.ones(2), {"energy": 0.001}, 0.0, 0.0)
    comparison = replace(comparison, **changes)  # type: ignore[arg-type]
    assert (comparison.status if comparison.contradicts({"energy": 0.01}) else None) == status


@pytest.mark.parametrize("steepness", [0.0, 3.0])
def test_a_life_is_off_by_the_mean_of_its_states(steepness: float) -> None:
    """Three states stand for all, beside the cycles that the wear takes by its work in time, 3 to 7 % less."""
    done = np.linspace(0.0, 1.0, 401)
    off, rate = 0.03 + 0.04 * done[:-1], np.exp(-steepness * done[:-1])
    cycles_taken = np.diff(done) / rate
    cycles, remaining = np.cumsum(cycles_taken) - cycles_taken, np.linspace(1.0, 0.9, 400)
    worn = np.diff(done)[:, None] * [1.0, 0.5]
    wear = SimpleNamespace(
        cycles=cycles, cycles_in_step=cycles_taken, preload=remaining, in_time=np.zeros(400, bool), worn=worn
    )
    wear.depth = np.cumsum(worn, axis=0) - worn
    result = cast(td.Result, SimpleNamespace(wear=wear))
    share, state_rows = np.array([0.6, 0.4]), (0, *operating_states.later_rows(result))
    comparisons = [MotionDifference(cycles[i], (1 + off[i]) * share, share, {}, 0.0, 0.0) for i in state_rows]
    life_in_time = np.sum(np.diff(done) * (1 + off) / rate)
    assert wear_differences(comparisons, result) == (
        pytest.approx(1 - cycles_taken.sum() / life_in_time, rel=0.06),
        0.0,
    )
    scattered = [replace(comparison, error=0.02) for comparison in comparisons]
    assert wear_differences(scattered, result)[0] == pytest.approx(wear_differences(comparisons, result)[0] + 0.02)
    elsewhere = [
        replace(comparison, in_time=comparison.balance * [1.1, 0.85]) for comparison in comparisons
    ]  # as much work, 10 % more of it there
    assert wear_differences(elsewhere, result) == pytest.approx((0.0, 1 - 1 / 1.1))
    at_rest = [replace(comparison, in_time=0.0 * share) for comparison in comparisons]
    assert wear_differences(at_rest, result)[0] == pytest.approx(1.0)  # no life ends
    nothing = [replace(comparison, balance=0.0 * share) for comparison in at_rest]
    assert wear_differences(nothing, result) == (0.0, 0.0)  # both motions rest
    wear.in_time = cycles > 0  # what was worn in time needs no balance
    assert wear_differences(comparisons, result)[0] < 0.001


def test_small_contacts_are_integrated_in_time() -> None:
    """By default up to so many components; not where the scene says no."""
    smaller_load = ("loads.harmonic.shake.value=2 kN", "response.frequency=['600 Hz', '2600 Hz']")
    file = scene_file.read("beam", (*TINY[:-1], "wear=", *smaller_load))
    result = td.run(file, overrides=["verdict.enabled=false"])
    first = operating_states.first_state(file, td.build(file).balance, result)
    default_limits, small_limits = DEFAULT, replace(DEFAULT, max_time=1.0)
    checked = [
        is_checked(first, *case)
        for case in ((None, default_limits), (None, small_limits), (True, small_limits), (False, default_limits))
    ]
    assert checked == [True, False, True, False]
    coarse, refined = (compare(state).differences for state in (first, with_harmonics(first, tuple(range(10)))))
    assert 0.01 < coarse["energy"] < 1  # one harmonic beside the motion in time
    assert refined["energy"] < 0.1 * coarse["energy"]  # what the others change is in the combined row, and counts once


def test_a_machine_that_leaves_the_balance_makes_the_error_of_a_life() -> None:
    """One harmonic alone does other work than the motion in time: that is in the errors, and no reason to refuse."""
    file = scene_file.read("beam", (*TINY[:-1], "wear.at=700 Hz", "wear.tolerance=60 %"))
    result = td.run(file)
    motion_rows = rows(result, Refinement.OTHER_MOTION)
    assert set(motion_rows) == {"life", "depth"}
    life = motion_rows["life"].relative or 0.0
    assert life > 0
    stated(result, life)
    changes = changes_along_wear(file, td.build(file).balance, result, tuple(range(10)))
    refined_change = next(row.relative for row in changes if row.quantity == "life")
    assert refined_change != life  # beside the balance with the harmonics of the combined refinement
    life_in_time = td.run(file, overrides=["wear.motion=time", "verdict.enabled=false"]).summary()["life"]
    balance = result.summary()["life"]
    assert abs(balance / life_in_time - 1) < (verdict_of(result).statements["life"].error or 0.0)


def test_the_verdict_is_kept(small: td.Result, tmp_path: Path) -> None:
    result = verdict_of(small)
    store.save(tmp_path / "result.h5", small)
    assert store.load(tmp_path / "result.h5").verdict == result
    assert small.summary()["changes"] == [vars(row) for row in result.changes]


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> tuple[td.Result, ErrorBound, Path]:
    """The beam without wear, to 20 % of its preload and peak frequency."""
    folder = tmp_path_factory.mktemp("accuracy")
    result, bound = td.run_to_accuracy("beam", "20 % of peak frequency, preload", folder, overrides=TINY)
    return result, bound, folder


def test_a_bound_is_what_the_last_run_measured(reached: tuple[td.Result, ErrorBound, Path]) -> None:
    result, bound, folder = reached
    assert bound.is_satisfied, bound.sentence
    statements = result.summary()["verdict"]
    for name in ("peak_frequency", "preload"):
        assert bound.errors[name] == statements[name]["error"] <= 0.2
    assert result.wear is None  # neither depth nor life was asked for
    assert td.load(folder).summary() == result.summary()
    assert sorted(path.name for path in (folder / "rounds").iterdir()) == [str(n) for n in range(1, bound.rounds + 1)]


def test_a_resumed_search_repeats_no_round(reached: tuple[td.Result, ErrorBound, Path]) -> None:
    result, bound, folder = reached
    before = {path: path.stat().st_mtime_ns for path in folder.glob("rounds/*/result.h5")}
    resumed = td.run_to_accuracy("beam", "20 % of peak frequency, preload", folder, overrides=TINY, resume=True)
    assert {path: path.stat().st_mtime_ns for path in folder.glob("rounds/*/result.h5")} == before
    assert (resumed[1], resumed[0].summary()) == (bound, result.summary())


def verdict_from(changes: dict[str, dict[str, float | None]]) -> Verdict:
    """A verdict from changes by refinement and quantity."""
    table = [MeasuredChange(r, q, 1.0, 1.0, e, "changed") for r, of in changes.items() for q, e in of.items()]
    statements = {}
    for name in names_with_error():
        of_quantity = [row for row in table if row.quantity == name]
        relatives = [row.relative for row in of_quantity if row.relative is not None]
        error = DEFAULT.total(sum(relatives), 2.0) if of_quantity and len(relatives) == len(of_quantity) else None
        status = Status.NOT_KNOWN if error is None else Status.REPORTED
        statements[name] = Statement(
            1.0 if of_quantity else None, error, None, status if of_quantity else Status.ABSENT, ""
        )
    return Verdict(statements, tuple(table), 2.0, 0.0)


def search(accuracy_text: str, verdicts: list[Verdict]) -> tuple[ErrorBound, list[tuple[str, ...]]]:
    """A search whose runs have given verdicts; returns the overrides of every round, too."""
    requested: list[tuple[str, ...]] = []

    def run(file: td.SceneFile, number: int) -> td.Result:
        requested.append(file.overrides)
        inputs = verdicts[min(number, len(verdicts)) - 1]
        return cast(td.Result, SimpleNamespace(verdict=inputs, harmonics=(0, 1)))

    file = td.read_scene("beam", ["harmonics.kept=[0, 1]"])
    return accuracy.to_accuracy(file, accuracy_text, run, lambda sentence: None)[1], requested


ROUGH = {"harmonics": {"energy": 0.3}, "modes": {"energy": 1e-5}, "wear steps": {"life": 0.5}}


@pytest.mark.parametrize(("quantity", "changes", "refined"), [
    ("energy", ROUGH, {"harmonics.kept", "harmonics.samples"}),
    ("life", {"statistics of the motion": {"life": 0.3}}, {"wear.max_steps", "wear.tolerance"}),
])  # fmt: skip
def test_only_what_contributes_is_refined(quantity, changes, refined):
    fine = verdict_from({"harmonics": {quantity: 0.003}, "modes": {quantity: 1e-4}})
    bound, rounds = search(f"1 % of {quantity}", [verdict_from(changes), fine])
    assert bound.is_satisfied
    assert {text.partition("=")[0] for text in set(rounds[1]) - set(rounds[0])} == refined


def test_what_cannot_be_refined_is_named() -> None:
    bound, rounds = search("1 % of energy", [verdict_from({"mesh and contact grid": {"energy": None}})])
    assert not bound.is_satisfied
    assert len(rounds) == DEFAULT.max_runs


@pytest.mark.parametrize("text", ["", "0", "120 %", "1 % of colour", "1 % of life given harmonics", "abc"])
def test_an_accuracy_that_means_nothing_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="--accuracy"):
        accuracy.parsed(text)


def test_an_accuracy_is_read() -> None:
    request = accuracy.parsed("1 % of life and peak frequency")
    assert request.error == pytest.approx(0.01)
    assert request.quantities == ("life", "peak_frequency")


@pytest.mark.parametrize("failure", [
    IndexError("planted"), ValueError("planted"), AttributeError("planted"), SolverFailure("no solution"),
])  # fmt: skip
def test_a_defect_in_the_refined_model_ends_the_run(failure: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing but refusals and failures of solvers counts as an error that is not known."""
    file = scene_file.read("beam", (*TINY, "wear=", "verdict.enabled=false"))
    result, model = td.run(file), td.build(file)

    def fail(*_: object) -> None:
        raise failure

    monkeypatch.setattr(change_table.modelling, "build", fail)
    if isinstance(failure, SolverFailure):
        verdict = judgement.judge(file, model, result, change_table.Progress())
        assert {verdict.statements[name].status for name in OF_STATE} == {Status.NOT_KNOWN}
    else:
        with pytest.raises(type(failure), match="planted"):
            judgement.judge(file, model, result, change_table.Progress())
