"""The list of planted faults stays true; a fault is planted in a process, seen and measured, and ends with it."""

import ast
import csv
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from proof import planted_faults, planting, reference_runs
from proof.planted_faults import Detection, Fault, Room
from proof.rewriting import Rule, rewritten
from tribodyn.hbm.wear.history import cycles_to_share
from tribodyn.workflows.errors.ladders import limit_of

TREE = Path(__file__).parents[2]
LIMIT = "workflows/errors/ladders.py"


def fault_in(file: str) -> Fault:
    return next(fault for fault in planted_faults.faults()[0] if fault.file == file)


def test_every_planted_fault_still_has_its_place() -> None:
    faults, rooms = planted_faults.faults()
    assert len(faults) >= 60
    assert len({fault.effect for fault in faults}) == len(faults)
    problems = []
    for fault in faults:
        try:
            compile(fault.faulty(TREE), fault.file, "exec")
        except (ValueError, OSError) as failure:
            problems.append(f"mend proof/planted_faults.toml: {failure}")
        assert fault.room in rooms
    assert not problems, "\n".join(problems)
    assert {fault.file.partition("/")[0] for fault in faults} == {"fem", "reduction", "hbm", "workflows"}
    assert [test for room in rooms.values() for test in room.tests if not (TREE / test).exists()] == []
    assert {run for room in rooms.values() for run in room.runs} == set(reference_runs.RUNS)
    with (TREE / "docs" / "developers" / "planted_faults.csv").open(encoding="utf-8") as file:
        shown = [row["fault"] for row in csv.DictReader(file)]
    assert sorted(shown) == sorted(fault.effect for fault in faults)


SOURCE = """
FACES = [[0, 1], [2, 3]]
class Spring:
    def force(self, x):
        pull = self.stiffness * x - self.damping * x  # a comment
        return pull
def sums(a, b):
    first = a[0] + b[0]
    second = a[1] + b[1]
    if first <= 1.0:
        second -= 2 * first
    return first, second
"""


@pytest.mark.parametrize(("place", "rule", "line"), [
    ("", "[2, 3] -> [3, 2]", "FACES = [[0, 1], [3, 2]]"),
    ("Spring.force", "A * B - C -> A * B + C", "pull = self.stiffness * x + self.damping * x"),
    ("Spring.force", "A = B - C * D -> A = A * C", "pull = pull * self.damping"),
    ("sums", "2 of 2: A + B -> A - B", "second = a[1] - b[1]"),
    ("sums", "A <= 1.0 -> A < 1.0", "if first < 1.0:"),
    ("sums", "A -= B * C -> A += B * C", "second += 2 * first"),
    ("sums", "return A, B -> return B, A", "return (second, first)"),
])  # fmt: skip
def test_a_rule_rewrites_one_place(place: str, rule: str, line: str) -> None:
    module = rewritten(SOURCE, place, Rule.parse(rule))
    compile(module, "source", "exec")
    before, after = ast.unparse(ast.parse(SOURCE)).splitlines(), ast.unparse(module).splitlines()
    assert [updated.strip() for previous, updated in zip(before, after, strict=True) if previous != updated] == [line]


def test_a_rule_without_its_one_place_is_refused() -> None:
    for place, rule, message in (
        ("sums", "A + B -> A - B", "matches A \\+ B 2 times instead of 1"),
        ("sums", "A @ B -> B @ A", "0 times"),
        ("Spring.pull", "A - B -> A + B", "no function Spring.pull"),
        ("sums", "A + B -> A + C", "C stand in the replacement alone"),
        ("sums", "A + B", "pattern -> replacement"),
    ):
        with pytest.raises(ValueError, match=message):
            rewritten(SOURCE, place, Rule.parse(rule))


def test_a_fault_is_planted_in_a_child_alone() -> None:
    def send_limit(send: planting.Send) -> None:
        planting.plant(fault_in(LIMIT), TREE)
        send(limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value)

    assert planting.in_child(send_limit, 30.0) == [pytest.approx(1.0625 + 0.0625)]
    assert limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value == pytest.approx(1.0)

    def send_life(send: planting.Send) -> None:
        planting.plant(fault_in("hbm/wear/history.py"), TREE)
        send(cycles_to_share(np.array([0.0, 10.0, 20.0]), np.array([1.0, 0.1, 0.001]), 0.01))

    assert planting.in_child(send_life, 30.0) == [pytest.approx(25.0)]
    with pytest.raises(ValueError, match="nothing changes"):
        planting.plant(replace(fault_in(LIMIT), rule="A[1] * B / C -> A[1] * B / C"), TREE)


def test_what_does_not_end_in_its_seconds_ends() -> None:
    def forever(send: planting.Send) -> None:
        send("started")
        while True:
            pass

    assert planting.in_child(forever, 0.1) == ["started"]


def test_a_fault_is_seen_by_its_test_and_a_test_that_always_fails_is_not_counted(tmp_path: Path) -> None:
    (tmp_path / "workflows").symlink_to(TREE / "workflows")
    test = tmp_path / "test_of_limit.py"
    test.write_text(
        "from tribodyn.workflows.errors.ladders import limit_of\n\n\n"
        "def test_always_wrong():\n    assert False\n\n\n"
        "def test_limit():\n    assert abs(limit_of([1, 2, 4], [2.0, 1.25, 1.0625]).value - 1.0) < 1e-9\n"
    )
    room = Room((str(test),), ())
    row = planting.detect(fault_in(LIMIT), tmp_path, room, {}, 60.0, {})
    assert row.test.endswith("::test_limit")
    assert (row.cell, row.change) == ("", 0.0)
    harmless = replace(fault_in(LIMIT), rule="A[1] * B / C -> 1 * A[1] * B / C")
    assert planting.detect(harmless, tmp_path, room, {}, 60.0, {}).test == ""


def test_a_change_is_that_of_the_quantity_that_changes_most() -> None:
    before = {"energy": np.array([1.0, 100.0]), "depth": np.array([2.0])}
    assert reference_runs.change(before, before) == (0.0, "")
    after = {"energy": np.array([1.5, 100.0]), "depth": np.array([2.1])}
    assert reference_runs.change(before, after) == (pytest.approx(0.05), "depth")
    assert reference_runs.change(before, {"energy": before["energy"]}) == (float("inf"), "depth")


def test_the_table_counts_those_that_matter(tmp_path: Path) -> None:
    rows = [
        Detection("a.py", "one", "tests/test_a.py::test_one[x]", "", 0.5, "beam: energy", 1.0),
        Detection("a.py", "two", "", "", 1e-5, "beam: energy", 1.0),
        Detection("b.py", "three", "", "lattice, friction 0.1: wrong", float("inf"), "beam: depth", 1.0),
    ]
    (tmp_path / planted_faults.ROWS).write_text("".join(json.dumps(asdict(row)) + "\n" for row in rows))
    assert planted_faults.rows_in(tmp_path) == rows
    text = planted_faults.as_markdown(rows)
    assert "2 of 3 planted faults are detected: 1 by tests, 1 by extremes alone. Of the 2 " in text
    assert "more than 0.1 %, 2 are detected" in text
    assert "| a.py | two | 0.001 % | beam: energy | nothing |" in text
