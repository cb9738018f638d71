"""The list of planted faults stays true; a fault is planted in a process, seen and measured, and ends with it."""

from __future__ import annotations

import csv
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from proof import planted_faults, planting, reference_runs
from proof.planted_faults import Fault, Seen
from tribodyn.hbm.wear.history import cycles_to_share
from tribodyn.workflows.errors.limit import limit_of

TREE = Path(__file__).parents[2]
LIMIT = "workflows/errors/limit.py"


def the_fault(file: str, does: str = "") -> Fault:
    return next(one for one in planted_faults.faults()[0] if one.file == file and does in one.does)


def test_every_planted_fault_still_has_its_place() -> None:
    faults, rooms = planted_faults.faults()
    assert len(faults) >= 60
    assert len({(fault.file, fault.does) for fault in faults}) == len(faults)
    for fault in faults:
        assert (TREE / fault.file).read_text().count(fault.old) == 1, f"{fault.file}: {fault.old}"
        assert fault.new != fault.old
        assert fault.room in rooms
    assert {fault.file.partition("/")[0] for fault in faults} == {"fem", "reduction", "hbm", "workflows"}
    assert [test for room in rooms.values() for test in room.tests if not (TREE / test).exists()] == []
    assert {run for room in rooms.values() for run in room.runs} == set(reference_runs.RUNS)
    with (TREE / "docs" / "accuracy" / "planted_faults.csv").open(encoding="utf-8") as file:
        shown = [(row["file"], row["fault"]) for row in csv.DictReader(file)]
    assert sorted(shown) == sorted((fault.file, fault.does) for fault in faults)


def test_a_fault_is_planted_in_a_child_alone() -> None:
    def found(send: planting.Send) -> None:
        planting.plant(the_fault(LIMIT), TREE)
        send(limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value)

    assert planting.in_child(found, 30.0) == [pytest.approx(1.0625 + 0.0625)]
    assert limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value == pytest.approx(1.0)
    history = "hbm/wear/history.py"

    def later(send: planting.Send) -> None:
        planting.plant(the_fault(history), TREE)
        send(cycles_to_share(np.array([0.0, 10.0, 20.0]), np.array([1.0, 0.1, 0.001]), 0.01))

    assert planting.in_child(later, 30.0) == [pytest.approx(25.0)]
    with pytest.raises(ValueError, match="exactly once"):
        planting.plant(replace(the_fault(LIMIT), old="no such text"), TREE)
    with pytest.raises(ValueError, match="nothing of the loaded module changes"):
        planting.plant(replace(the_fault(LIMIT), new=the_fault(LIMIT).old), TREE)


def test_what_does_not_end_in_its_seconds_ends() -> None:
    def forever(send: planting.Send) -> None:
        send("begun")
        while True:
            pass

    assert planting.in_child(forever, 0.1) == ["begun"]


def test_a_fault_is_seen_by_its_test_and_a_test_that_always_fails_is_not_counted(tmp_path: Path) -> None:
    (tmp_path / "workflows").symlink_to(TREE / "workflows")
    test = tmp_path / "test_of_limit.py"
    test.write_text(
        "from tribodyn.workflows.errors.limit import limit_of\n\n\n"
        "def test_always_wrong():\n    assert False\n\n\n"
        "def test_limit():\n    assert abs(limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value - 1.0) < 1e-9\n"
    )
    row = planting.judged(the_fault(LIMIT), tmp_path, (str(test),), (), {}, 60.0, {})
    assert row.tests.endswith("::test_limit")
    assert (row.extremes, row.change) == ("", 0.0)
    sound = replace(the_fault(LIMIT), old="rest = steps[1]", new="rest = 1 * steps[1]")
    assert planting.judged(sound, tmp_path, (str(test),), (), {}, 60.0, {}).tests == ""


def test_a_change_is_that_of_the_quantity_that_changes_most() -> None:
    before = {"energy": np.array([1.0, 100.0]), "depth": np.array([2.0])}
    assert reference_runs.change(before, before) == (0.0, "")
    after = {"energy": np.array([1.5, 100.0]), "depth": np.array([2.1])}
    assert reference_runs.change(before, after) == (pytest.approx(0.05), "depth")
    assert reference_runs.change(before, {"energy": before["energy"]}) == (float("inf"), "depth")


def test_the_table_counts_those_that_matter(tmp_path: Path) -> None:
    rows = [
        Seen("a.py", "one", "tests/test_a.py::test_one[x]", "", 0.5, "beam: energy", 1.0),
        Seen("a.py", "two", "", "", 1e-5, "beam: energy", 1.0),
        Seen("b.py", "three", "", "lattice, friction 0.1: wrong", float("inf"), "beam: depth", 1.0),
    ]
    (tmp_path / planted_faults.ROWS).write_text("".join(json.dumps(asdict(row)) + "\n" for row in rows))
    assert planted_faults.rows_in(tmp_path) == rows
    text = planted_faults.as_markdown(rows)
    assert "2 of 3 planted faults are seen: 1 by tests, 1 by extremes alone. Of the 2 " in text
    assert "more than 0.1 %, 2 are seen" in text
    assert "| a.py | two | 0.001 % | beam: energy | nothing |" in text
