"""A wanted accuracy on a scene without a table: what its rounds change, promise and leave alone; held against finer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

import tribodyn as td
from tribodyn.workflows.accuracy import reference, refinement
from tribodyn.workflows.accuracy.statement import QUANTITIES, Contribution, Statement, Verdict
from tribodyn.workflows.command import main

TINY = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=5", "response.points=20",
    "harmonics.samples=64", "pictures.renders=false", "verdict.in_time=false",
)  # fmt: skip


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> tuple[td.Result, refinement.Promise, Path]:
    """The beam without wear, to 20 % of its preload and peak frequency."""
    folder = tmp_path_factory.mktemp("accuracy")
    result, promise = td.run_to_accuracy("beam", "20 % of peak frequency, preload", folder, overrides=TINY)
    return result, promise, folder


def test_what_is_promised_is_what_the_last_run_measured(
    reached: tuple[td.Result, refinement.Promise, Path],
) -> None:
    result, promise, folder = reached
    assert promise.kept, promise.sentence
    said = result.summary()["verdict"]
    for name in ("peak_frequency", "preload"):
        assert promise.errors[name] == said[name]["error"] <= 0.2
    assert result.wear is None  # neither depth nor life was asked for
    assert td.load(folder).summary() == result.summary()
    assert sorted(path.name for path in (folder / "rounds").iterdir()) == [str(n) for n in range(1, promise.rounds + 1)]


def test_the_promise_holds_against_a_reference_that_is_finer(
    reached: tuple[td.Result, refinement.Promise, Path],
) -> None:
    result, promise, _ = reached
    found, lacking = td.check_accuracy("beam", result, promise, overrides=TINY)
    assert not lacking
    assert {one.quantity for one in found} == {"peak_frequency", "preload"}
    assert not any(one.broken for one in found)
    assert all(1e-5 < one.true < 0.2 for one in found if one.true is not None)  # another answer, but not far away
    text = reference.as_text(found, lacking)
    assert text.endswith("promise kept")
    bad = [replace(found[0], true=0.3), *found[1:]]
    assert "30.00%  BROKEN" in reference.as_text(bad, "")
    assert reference.as_text(bad, "").endswith("promise broken")
    assert reference.as_text(found, "its reference is too dear").endswith("too dear")


def test_a_check_needs_a_promise(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main.main(["run", "beam", "--check"])
    assert left.value.code == 2
    assert "--check is of what --accuracy promises" in capsys.readouterr().err


def test_a_resumed_search_repeats_no_round(reached: tuple[td.Result, refinement.Promise, Path]) -> None:
    result, promise, folder = reached
    before = {path: path.stat().st_mtime_ns for path in folder.glob("rounds/*/result.h5")}
    again = td.run_to_accuracy("beam", "20 % of peak frequency, preload", folder, overrides=TINY, resume=True)
    assert {path: path.stat().st_mtime_ns for path in folder.glob("rounds/*/result.h5")} == before
    assert (again[1], again[0].summary()) == (promise, result.summary())


def _told(errors: dict[str, dict[str, float | None]]) -> Verdict:
    """A verdict from errors by source and quantity."""
    parts = tuple(Contribution(s, q, e, "told") for s, of in errors.items() for q, e in of.items())
    said = {}
    for name in QUANTITIES:
        own = [part.error for part in parts if part.quantity == name]
        total = None if not own or None in own else sum(error or 0.0 for error in own)
        said[name] = Statement(1.0 if own else None, total, None, total is not None, "told")
    return Verdict(said, parts, 0.0)


def _search(wanted: str, verdicts: list[Verdict]) -> tuple[refinement.Promise, list[tuple[str, ...]]]:
    """A search whose runs are told their verdicts; returns the overrides of every round, too."""
    asked: list[tuple[str, ...]] = []

    def run(file: td.SceneFile, number: int) -> td.Result:
        asked.append(file.overrides)
        told = verdicts[min(number, len(verdicts)) - 1]
        return cast(td.Result, SimpleNamespace(verdict=told.dumped(), harmonics=(0, 1)))

    file = td.read_scene("beam")
    return refinement.to_accuracy(file, wanted, run, lambda sentence: None)[1], asked


def test_only_what_contributes_is_made_finer() -> None:
    rough = _told({"harmonics": {"energy": 0.3}, "modes": {"energy": 1e-4}, "wear steps": {"life": 0.5}})
    fine = _told({"harmonics": {"energy": 0.004}, "modes": {"energy": 1e-4}})
    promise, rounds = _search("1 % of energy", [rough, fine])
    assert promise.kept
    assert promise.errors == {"energy": pytest.approx(0.0041)}
    added = set(rounds[1]) - set(rounds[0])
    assert added == {"harmonics.kept=[0, 1, 2, 3]"}
    assert promise.alone == ("modes",)


def test_what_nothing_helps_is_said() -> None:
    verdict = _told({"compliance": {"energy": 0.3}, "points": {"amplitude": 1e-3}})
    promise, rounds = _search("1 % of energy, amplitude", [verdict])
    assert not promise.kept
    assert len(rounds) == 1
    assert promise.left == ("compliance",)
    assert "not promised: energy (its error is 0.3)" in promise.sentence
    assert "amplitude 0.001" in promise.sentence
    unknown = _told({"mesh and contact grid": {"energy": None}})
    promise, _ = _search("1 % of energy", [unknown])
    assert promise.errors == {"energy": None}
    assert not promise.kept


def test_what_is_given_is_left_alone_and_named() -> None:
    verdict = _told({"harmonics": {"energy": 0.8}, "samples": {"energy": 0.003}})
    promise, rounds = _search("1 % of energy given harmonics", [verdict])
    assert promise.kept
    assert len(rounds) == 1
    assert promise.errors == {"energy": 0.003}
    assert promise.alone == ("samples",)
    assert promise.sentence.endswith("; left as the scene has them: samples")
    assert "not counted: harmonics" in promise.sentence


def test_the_settings_that_are_told_are_those_that_were_run() -> None:
    verdict = _told({"wear steps": {"life": 0.5}})
    promise, rounds = _search("1 % of life", [verdict])
    assert not promise.kept
    assert len(rounds) == promise.rounds == refinement.ROUNDS
    assert set(promise.overrides) <= set(rounds[-1])
