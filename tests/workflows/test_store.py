"""The result file: what is written is read back, and no moment exists at which it cannot be read."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
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
                assert data.attrs.get("units", "") == unit.partition(store.INDEX)[0]


def test_mismatched_arrays_are_refused_and_leave_the_old_file(tmp_path: Path) -> None:
    good = result()
    store.save(tmp_path / "result.h5", good)
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
    built = result()
    assert built.wear is not None
    written = replace(built, stage=stage, wear=replace(built.wear, end=end))
    store.save(tmp_path / "result.h5", written)
    read = store.load(tmp_path / "result.h5")
    assert (read.stage, read.state, read.finished) == (stage, written.state, stage is Stage.COMPLETE)
    assert read.wear.end == end


def test_facts_of_a_wheel_come_back(tmp_path: Path) -> None:
    facts = replace(result().facts, around=Around(40, 3, np.array([1.0, 0.0, 0.0])), open_frequencies=np.array([12.5]))
    written = replace(result(), facts=facts)
    store.save(tmp_path / "result.h5", written)
    assert same(written, store.load(tmp_path / "result.h5"))


def _stored_elsewhere(file: h5py.File, secret: Path) -> None:
    del file["wear/cycles"]
    file.create_dataset("wear/cycles", (9,), "f8", external=[(str(secret), 0, 72)])


def _virtual(file: h5py.File, secret: Path) -> None:
    del file["wear/cycles"]
    layout = h5py.VirtualLayout((9,), "f8")
    layout[:] = h5py.VirtualSource(str(secret), "x", (9,))
    file["wear"].create_virtual_dataset("cycles", layout)


def _not_stored(file: h5py.File, _: Path) -> None:
    del file["wear/cycles"]
    file.create_dataset("wear/cycles", (10**12,), "f8")


def _replaced(name: str, value: Any) -> Callable[[h5py.File, Path], None]:
    """Another array, group (None), link, or attribute (name with @)."""

    def change(file: h5py.File, _: Path) -> None:
        group, _, attribute = name.partition("@")
        if attribute:
            (file[group] if group else file).attrs[attribute] = value
        else:
            del file[name]
            file[name] = value

    return change


@pytest.mark.parametrize(("change", "sentence"), [
    (_stored_elsewhere, "is stored in another file"),
    (_virtual, "is stored in another file"),
    (_replaced("wear/cycles", h5py.ExternalLink("secret.h5", "x")), "is a link to another place"),
    (_replaced("wear/cycles", h5py.SoftLink("/frf/omega")), "is a link to another place"),
    (_not_stored, "another version"),
    (lambda file, _: (file.pop("frf"), file.create_dataset("frf", data=1.0)), "another version"),
    (_replaced("patch/faces", np.full((3, 4), 10**9)), "another version"),
    (_replaced("part/cells", np.zeros((2, 8))), "another version"),
    (_replaced("frf/omega", np.full(61, np.nan)), "another version"),
    (_replaced("wear/depth", np.array([b"a", b"b"])), "another version"),
    (_replaced("wear/depth", np.zeros(9)), "another version"),
    (_replaced("wear/amplitude", np.zeros(8)), "another version"),
    (_replaced("provenance@scene_text", 3), "another version"),
    (_replaced("provenance@scene", "[]"), "another version"),
    (_replaced("facts@open_frequencies", "x"), "another version"),
    (_replaced("facts@delta_max", "x"), "another version"),
    (_replaced("facts@joints", '{"a": [0, 99999]}'), "another version"),
    (_replaced("facts@harmonics", np.arange(5)), "another version"),
    (_replaced("@verdict", '{"statements": []}'), "another version"),
    (_replaced("@verdict", "null"), "another version"),
    (_replaced("@stage", np.zeros(2)), "another version"),
    (_replaced("@format", np.zeros(2)), "of this version"),
])  # fmt: skip
def test_a_result_of_another_structure_or_that_names_other_files_is_refused(tmp_path, change, sentence):
    path, secret = tmp_path / "result.h5", tmp_path / "secret.h5"
    store.save(path, result())
    with h5py.File(secret, "w") as file:
        file["x"] = np.arange(9.0)
    path.write_bytes(path.read_bytes()[store.USER_BLOCK :])
    store.load(path)
    with h5py.File(path, "r+") as file:
        change(file, secret)
    with pytest.raises(store.ResultError, match=sentence):
        store.load(path)


def test_a_pipe_is_not_waited_for_and_names_do_not_reach_the_terminal(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "result.h5")
    with pytest.raises(store.ResultError, match="there is no result file"):
        store.load(tmp_path)
    written = replace(result(), provenance={**result().provenance, "scene_name": "a\x1b[2Jb"})
    store.save(tmp_path / "x.h5", written)
    assert store.load(tmp_path / "x.h5").provenance["scene_name"] == "a\ufffd[2Jb"
