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


def test_every_run_ends_as_a_run_may(tmp_path: Path) -> None:
    tried = fuzz.fuzz("beam", TINY, values=150, runs=3, seed=1, folder=tmp_path, command=cli.main)
    assert [one for one in tried if not one.good] == []
    again = fuzz.cases("beam", TINY, 150, seed=1)
    assert {(one.key, one.value) for one in tried} == set(again)
    of = fuzz.counts(tried)["beam"]
    assert (of["values"], of["runs"], sum(of["ends"].values())) == (150, 3, 3)
    assert of[fuzz.REFUSED] + of["scenes"] <= 150
    assert of["scenes"] > 3
    assert f"beam: {of['keys']} keys, 150 values: {of[fuzz.REFUSED]} refused when read" in fuzz.as_text(tried)

    def never(words: list[str]) -> None:
        raise AssertionError(words)

    kept = fuzz.fuzz("beam", TINY, values=150, runs=3, seed=1, folder=tmp_path, command=never)
    assert [(one.key, one.value, one.end, one.said) for one in kept] == [
        (one.key, one.value, one.end, one.said) for one in tried
    ]
    with pytest.raises(ValueError, match="keeps runs of beam with other changes"):
        fuzz.fuzz("beam", TINY[1:], values=1, folder=tmp_path, command=never)


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
    monkeypatch.setattr(fuzz, "LATE", 1.0)
    monkeypatch.setattr(fuzz, "cases", lambda *given: [("scene.title", '"abc"')])  # what reading refuses is not run

    def instead(arguments: object) -> None:
        exec(does, {})

    (tried,) = fuzz.fuzz("beam", TINY, seconds=1.0, command=instead)
    assert tried.end == end


def test_what_is_not_finite_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Summary:
        def __init__(self, peak: float, error: float | None) -> None:
            verdict = {"energy": {"stated": True, "value": 1.0, "error": error}}
            self.of = {"peak_hz": (1.0, peak), "verdict": verdict}

        def summary(self) -> dict[str, object]:
            return self.of

    for peak, error, end in (
        (2.0, 0.1, "success"),
        (float("nan"), 0.1, "not finite: peak_hz"),
        (2.0, None, "success"),
        (2.0, float("inf"), "not finite: verdict of energy"),
    ):
        result = Summary(peak, error)
        monkeypatch.setattr(fuzz.store, "load", lambda path, result=result: result)
        assert fuzz._end(0, "", tmp_path) == end
