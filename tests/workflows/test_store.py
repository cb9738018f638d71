"""The result file: what is written is read back, and no moment exists at which it cannot be read."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.helpers.synthetic_result import result
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.workflows.result import store
from tribodyn.workflows.result.model_facts import Around, Stage

WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from tests.helpers.synthetic_result import result
from tribodyn.workflows.result import store
full = result(60)
for n in range(10**6):
    store.save(Path(sys.argv[1]), replace(full, provenance={**full.provenance, "started": f"checkpoint {n}"}))
"""


def same(first: Any, second: Any) -> bool:
    """Whether two values, dataclasses of arrays among them, are equal."""
    if is_dataclass(first):
        return all(same(getattr(first, item.name), getattr(second, item.name)) for item in fields(first))
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)
    return bool(np.array_equal(first, second)) if isinstance(first, np.ndarray) else first == second


def test_round_trip(tmp_path: Path) -> None:
    written = result()
    store.save(tmp_path / "result.h5", written)
    assert same(written, store.load(tmp_path / "result.h5"))
    assert [path.name for path in tmp_path.iterdir()] == ["result.h5"]


def test_every_array_has_its_dimensions_and_unit(tmp_path: Path) -> None:
    store.save(tmp_path / "result.h5", result())
    with h5py.File(tmp_path / "result.h5") as file:
        for group, (_, arrays) in store.SCHEMA.items():
            for name, (dimensions, unit) in arrays.items():
                data = file[group][name]
                assert [scale[0].name for scale in data.dims] == [f"/{dimension}" for dimension in dimensions]
                assert data.attrs.get("units", "") == unit


def test_mismatched_arrays_are_refused_and_leave_the_old_file(tmp_path: Path) -> None:
    from dataclasses import replace

    good = result()
    store.save(tmp_path / "result.h5", good)
    assert good.wear is not None
    with pytest.raises(ValueError, match="dimension row"):
        store.save(tmp_path / "result.h5", replace(good, wear=replace(good.wear, cycles=good.wear.cycles[:-1])))
    assert same(good, store.load(tmp_path / "result.h5"))
    assert [path.name for path in tmp_path.iterdir()] == ["result.h5"]


@pytest.mark.faults
@pytest.mark.parametrize("delay", [0.013, 0.021, 0.034, 0.055, 0.089])
def test_a_kill_at_any_moment_leaves_a_whole_checkpoint(tmp_path: Path, delay: float) -> None:
    path = tmp_path / "result.h5"
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], cwd=Path(__file__).parents[2])
    try:
        while not path.exists():
            assert writer.poll() is None
            time.sleep(0.01)
        for _ in range(5):  # a reader never meets a part of a file either
            assert store.load(path).provenance["started"].startswith("checkpoint")
        time.sleep(delay)
    finally:
        writer.send_signal(signal.SIGKILL)
        writer.wait()
    assert store.load(path).wear is not None


@pytest.mark.parametrize("content", [None, b"no HDF5", "other"])
def test_what_is_no_result_is_said_in_a_sentence(tmp_path: Path, content: object) -> None:
    path = tmp_path / "x.h5"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        h5py.File(path, "w").close()
    with pytest.raises(store.ResultError, match=r"x\.h5"):
        store.load(path)


@pytest.mark.parametrize("stage", list(Stage))
@pytest.mark.parametrize("end", [WearEnd.SOLVE_FAILED.say(": why"), WearEnd.NO_STEP.say()])
def test_stage_and_ends_of_a_run_come_back(tmp_path: Path, stage: Stage, end: Outcome[WearEnd]) -> None:
    from dataclasses import replace

    built = result()
    assert built.wear is not None
    written = replace(built, stage=stage, wear=replace(built.wear, end=end))
    store.save(tmp_path / "result.h5", written)
    read = store.load(tmp_path / "result.h5")
    assert (read.stage, read.state, read.finished) == (stage, written.state, stage is Stage.COMPLETE)
    assert read.wear is not None
    assert read.wear.end == end


def test_facts_of_a_wheel_come_back(tmp_path: Path) -> None:
    from dataclasses import replace

    facts = replace(result().facts, around=Around(40, 3, np.array([1.0, 0.0, 0.0])), open_frequencies=np.array([12.5]))
    written = replace(result(), facts=facts)
    store.save(tmp_path / "result.h5", written)
    assert same(written, store.load(tmp_path / "result.h5"))
