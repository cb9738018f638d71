"""The list of planted faults stays true, and planting one in a copy is seen."""

from __future__ import annotations

from pathlib import Path

from tribodyn.workflows.benchmarks import planted_faults

TREE = Path(__file__).parents[2]


def test_every_planted_fault_still_has_its_place() -> None:
    faults, tests = planted_faults.faults()
    assert len(faults) >= 60
    assert len({(fault.file, fault.does) for fault in faults}) == len(faults)
    for fault in faults:
        assert (TREE / fault.file).read_text().count(fault.old) == 1, f"{fault.file}: {fault.old}"
        assert fault.new != fault.old
        assert fault.room in tests
    assert {fault.file.partition("/")[0] for fault in faults} == {"fem", "reduction", "hbm", "workflows"}
    assert [test for room in tests.values() for test in room if not (TREE / test).exists()] == []


def test_a_fault_is_planted_seen_and_taken_out(tmp_path: Path) -> None:
    copy = tmp_path / "tree"
    planted_faults.copied(TREE, copy)
    fault = next(one for one in planted_faults.faults()[0] if one.file == "workflows/accuracy/limit.py")
    planted_faults.planted(copy, fault, TREE)
    assert fault.new in (copy / fault.file).read_text()
    test = copy / "tests/test_of_limit.py"
    test.write_text(
        "from tribodyn.workflows.accuracy.limit import limit_of\n\n\n"
        "def test_limit():\n    assert abs(limit_of([1, 2, 4], [2.0, 1.5, 1.25]).value - 1.0) < 1e-9\n"
    )
    assert planted_faults.failing(copy, [str(test)], 60.0).endswith("test_of_limit.py::test_limit")
    (copy / fault.file).write_text((TREE / fault.file).read_text())
    assert planted_faults.failing(copy, [str(test)], 60.0) == ""
    row = planted_faults.Seen(fault.file, fault.does, "tests/test_of_limit.py::test_limit", "")
    assert "1 of 1 planted faults are seen" in planted_faults.as_markdown([row])
