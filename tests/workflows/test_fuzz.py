"""Nasty values in the keys of a scene, a few of them; and that a wrong end is seen."""

from __future__ import annotations

from pathlib import Path

import pytest

from tribodyn.workflows.benchmarks import fuzz
from tribodyn.workflows.command import main as cli

TINY = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "response.points=6",
    "wear.max_steps=1", "verdict.enabled=false",
)  # fmt: skip


def test_every_run_ends_as_a_run_may() -> None:
    tried = fuzz.fuzz("beam", TINY, runs=12, seed=1, command=cli.main)
    assert len(tried) == 12
    assert [one for one in tried if not one.good] == []
    again = fuzz.cases("beam", TINY, runs=12, seed=1)
    assert {(one.key, one.value) for one in tried} == set(again)


def test_every_key_is_tried() -> None:
    names = fuzz.keys("beam", TINY)
    assert {"contact.friction", "wear.law", "response.points", "geometry.n_patch", "scene.title"} <= set(names)
    assert len(fuzz.cases("beam", TINY)) == len(names) * len(fuzz.NASTY)
    assert len(set(fuzz.NASTY)) == 30


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
    monkeypatch.setattr(fuzz, "cases", lambda *given: [("scene.title", '"abc"')])  # what reading refuses is not run

    def instead(arguments: object) -> None:
        exec(does, {})

    (tried,) = fuzz.fuzz("beam", TINY, runs=1, seconds=1.0, command=instead)
    assert tried.end == end


def test_what_is_not_finite_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Summary:
        def summary(self) -> dict[str, object]:
            return {"peak_hz": (1.0, float("nan")), "verdict": None}

    monkeypatch.setattr(fuzz.store, "load", lambda path: Summary())
    assert fuzz._end(0, "", tmp_path) == "not finite: peak_hz"
