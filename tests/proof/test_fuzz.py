"""Fuzz inputs in the keys of a scene, a few of them; and that a wrong end is seen."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof import fuzz, fuzz_mixed, fuzz_result, fuzz_runs
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result import store
from tribodyn.workflows.result.verdict import Statement, Verdict
from tribodyn.workflows.studies import front_door

TINY = (
    "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
    "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "response.points=6",
    "wear.max_steps=1", "verdict.enabled=false",
)  # fmt: skip


def test_every_run_ends_as_a_run_may(tmp_path: Path) -> None:
    attempts = fuzz.fuzz("beam", TINY, values=150, runs=3, seed=1, folder=tmp_path, command=cli.main)
    assert [item for item in attempts if not item.good] == []
    repeated = fuzz.cases("beam", TINY, 150, seed=1)
    assert {(item.key, item.value) for item in attempts} == set(repeated)
    of = fuzz.counts(attempts)["beam"]
    assert (of["values"], of["runs"], sum(of["ends"].values())) == (150, 3, 3)
    assert of[fuzz.REFUSED] + of["scenes"] <= 150
    assert of["scenes"] > 3
    assert f"beam: {of['keys']} keys, 150 values: {of[fuzz.REFUSED]} refused when read" in fuzz.as_text(attempts)

    def never(words: list[str]) -> None:
        raise AssertionError(words)

    saved = fuzz.fuzz("beam", TINY, values=150, runs=3, seed=1, folder=tmp_path, command=never)
    assert [(item.key, item.value, item.end, item.output) for item in saved] == [
        (item.key, item.value, item.end, item.output) for item in attempts
    ]
    with pytest.raises(ValueError, match="keeps runs of beam with other changes"):
        fuzz.fuzz("beam", TINY[1:], values=1, folder=tmp_path, command=never)


def test_every_key_is_tried() -> None:
    names = fuzz.keys("beam", TINY)
    assert {"contact.friction", "wear.law", "response.points", "geometry.n_patch", "scene.title"} <= set(names)
    assert len(fuzz.cases("beam", TINY)) == len(names) * len(fuzz.INPUTS)
    assert len(set(fuzz.INPUTS)) == 30


@pytest.mark.parametrize(
    ("does", "end"),
    [
        ("raise KeyError('x')", "traceback"),
        ("while True: pass", "too long"),
        (
            "import sys; print('x.py:1: RuntimeWarning: overflow', file=sys.stderr); raise SystemExit(2)",
            "a warning of a library",
        ),
        ("raise SystemExit(3)", "no sentence"),
        ("import sys; print('tribodyn: no.', file=sys.stderr); raise SystemExit(2)", "refused"),
    ],
)
def test_a_wrong_end_is_seen(does: str, end: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz_runs, "LATE", 1.0)
    monkeypatch.setattr(fuzz, "cases", lambda *inputs: [("scene.title", '"abc"')])  # what reading refuses is not run

    def instead(words: list[str]) -> None:
        if 'scene.title="abc"' not in words:
            print("tribodyn: no.", file=sys.stderr)
            raise SystemExit(2)
        exec(does, {})

    (attempts,) = fuzz.fuzz("beam", TINY, seconds=1.0, command=instead)
    assert attempts.end == end


def test_a_scene_that_does_not_end_well_as_it_is_is_no_scene_to_fuzz() -> None:
    def fails(words: list[str]) -> None:
        raise KeyError(words)

    with pytest.raises(RuntimeError, match="beam as it is does not end well: traceback"):
        fuzz.fuzz("beam", TINY, values=80, runs=1, command=fails)


def test_a_wrong_number_in_a_result_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = front_door.run("beam", overrides=TINY)
    wear = result.wear
    assert wear is not None
    messages = {"depth": Statement(1.0, 0.1, "mesh and contact grid", "reported", "measured")}

    def end(**changes: object) -> str:
        store.save(tmp_path / "changed.h5", replace(result, **changes))
        return fuzz_result.wrong(tmp_path / "changed.h5")

    def verdict(**changes: object) -> str:
        return end(verdict=Verdict({"depth": replace(messages["depth"], **changes)}, (), 2.0, 0.0))

    assert end() == verdict() == ""
    assert verdict(error=None) == "verdict: depth is stated without an error"
    assert end(wear=replace(wear, depth=np.full_like(wear.depth, np.inf))) == "not finite: wear.depth"
    assert end(facts=replace(result.facts, delta_max=float("nan"))) == "not finite: facts.delta_max"
    assert verdict(value=None) == "verdict: depth is stated without a value"
    assert verdict(value=float("nan")) == "verdict: depth is no number"
    assert verdict(value=-1.0) == "verdict: depth is negative"
    assert verdict(error=float("inf")) == "verdict: depth has an error that is no number"
    assert verdict(error=0.6) == "verdict: depth is stated with an error above 50%"


def test_damage_of_several_kinds_at_once_ends_as_it_may() -> None:
    attempts = fuzz_mixed.tries(12, seed=3, prefix="run K.mtx", command=cli.main)
    assert [item for item in attempts if not item.good] == []
    assert {"success", "refused"} <= {item.end for item in attempts}
    table = fuzz_mixed.as_table(attempts)
    assert "| all | 12 |" in table


def test_a_wrong_end_of_a_damaged_file_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A traceback, and a run that works without a word; one that tells how far it is may go on for longer."""
    kinds = iter("012")
    monkeypatch.setattr(fuzz_mixed, "case", lambda base, rng: base.job("", next(kinds)))
    monkeypatch.setattr(fuzz_mixed, "bases", lambda folder: [fuzz_mixed.Base("own", (), {"own": b""}, "own")])

    def instead(words: list[str]) -> None:
        kind, last = Path("own").read_text(), time.process_time()
        while kind:
            if kind == "0":
                raise KeyError(kind)
            if kind == "1" and time.process_time() - last > 0.05:
                print("some more", flush=True)
                last = time.process_time()

    attempts = fuzz_mixed.tries(3, seconds=0.2, command=instead)
    assert {item.end for item in attempts} == {"traceback", fuzz_runs.SILENT, fuzz_runs.GOING}
    assert all(item.good == (item.end == fuzz_runs.GOING) for item in attempts)
