"""Damage to all input, a little of it; and that a wrong end is seen."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof.fuzzing import fuzz, fuzz_result, fuzz_runs
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result import store
from tribodyn.workflows.result.verdict import Statement, Verdict
from tribodyn.workflows.studies import front_door

TINY = (
    "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
    "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "response.points=6",
    "wear.max_steps=1", "verdict.enabled=false",
)  # fmt: skip


@pytest.mark.parametrize(("does", "end"), [
    ("raise KeyError('x')", "traceback"),
    ("while True: pass", fuzz_runs.SILENT),
    ("import sys; print('x.py:1: RuntimeWarning: overflow', file=sys.stderr); raise SystemExit(2)",
        "a warning of a library"),
    ("raise SystemExit(3)", "no sentence"),
    ("import sys; print('tribodyn: no.', file=sys.stderr); raise SystemExit(2)", "refused"),
])  # fmt: skip
def test_a_wrong_end_is_seen(does: str, end: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz_runs, "LATE", 1.0)
    monkeypatch.setattr(fuzz, "case", lambda base, rng: base.job("", "damaged"))
    monkeypatch.setattr(fuzz, "bases", lambda folder: [fuzz.Base("own", (), {"own": b""}, "own")])

    def instead(words: list[str]) -> None:
        if Path("own").read_text():
            exec(does, {})

    (attempt,) = fuzz.tries(1, seconds=1.0, command=instead)
    assert attempt.end == end


def test_an_input_that_does_not_end_well_as_it_is_is_none_to_damage() -> None:
    def fails(words: list[str]) -> None:
        raise KeyError(words)

    with pytest.raises(RuntimeError, match="as it is does not end well: traceback"):
        fuzz.tries(1, prefix="run K.mtx", command=fails)


def test_a_wrong_number_in_a_result_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = front_door.run("beam", overrides=TINY)
    wear = result.wear
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
    attempts = fuzz.tries(12, seed=3, prefix="run K.mtx", command=cli.main)
    assert [item for item in attempts if not item.good] == []
    assert {"success", "refused"} <= {item.end for item in attempts}
    table = fuzz.as_table(attempts)
    assert "| all | 12 |" in table


def test_a_wrong_end_of_a_damaged_file_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A traceback, and a run that works without a word; one that tells how far it is may go on for longer."""
    kinds = iter("012")
    monkeypatch.setattr(fuzz, "case", lambda base, rng: base.job("", next(kinds)))
    monkeypatch.setattr(fuzz, "bases", lambda folder: [fuzz.Base("own", (), {"own": b""}, "own")])

    def instead(words: list[str]) -> None:
        kind, last = Path("own").read_text(), time.process_time()
        while kind:
            if kind == "0":
                raise KeyError(kind)
            if kind == "1" and time.process_time() - last > 0.05:
                print("some more", flush=True)
                last = time.process_time()

    attempts = fuzz.tries(3, seconds=0.2, command=instead)
    assert {item.end for item in attempts} == {"traceback", fuzz_runs.SILENT, fuzz_runs.GOING}
    assert all(item.good == (item.end == fuzz_runs.GOING) for item in attempts)
