"""Hard ends: full disks, damaged files, two runs in one folder, absurd sizes, Ctrl-C while the program is loaded."""

import importlib.abc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock

import tribodyn as td
import tribodyn.__main__ as program
from tests.helpers import synthetic_result
from tribodyn.workflows.result import store
from tribodyn.workflows.scene import scene_file

pytestmark = pytest.mark.faults

TINY = ("harmonics.kept=[0, 1]",
    "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "wear=",
        "verdict.enabled=false", "response.points=5")  # fmt: skip


def test_every_flipped_byte_and_a_result_cut_short_are_told(tmp_path: Path) -> None:
    path = tmp_path / "result.h5"
    store.save(path, synthetic_result.result())
    full = path.read_bytes()
    assert store.load(path).state
    for place in np.random.default_rng(0).integers(0, len(full), 60):
        damaged = bytearray(full)
        damaged[place] ^= 0x10
        path.write_bytes(damaged)
        if len(store.MARK) + 65 <= place < store.USER_BLOCK:
            continue  # padding, which nobody reads
        with pytest.raises(store.ResultError):
            store.load(path)
    for share in (0.0, 0.001, 0.3, 0.999):
        path.write_bytes(full[: int(share * len(full))])
        with pytest.raises(store.ResultError):
            store.load(path)


def test_two_runs_in_one_folder_are_kept_apart(tmp_path: Path) -> None:
    with FileLock(tmp_path / ".lock"), pytest.raises(ValueError, match="another run is writing into"):
        td.run("beam", tmp_path, overrides=TINY)
    td.run("beam", tmp_path, overrides=TINY)


SAVES = """
import resource, sys
from pathlib import Path
from tests.helpers import synthetic_result
from tribodyn.workflows.result import store
store.save(Path(sys.argv[1]), synthetic_result.result())
result = synthetic_result.result()
for limit in (100, 600, 20_000, 120_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        store.save(Path(sys.argv[1]), result)
    except store.ResultError as error:
        assert "cannot be written" in str(error), error
        continue
    raise SystemExit(f"{limit} bytes were enough")
print(store.load(Path(sys.argv[1])).state)
"""


def test_a_full_disk_keeps_the_result_that_was_there(tmp_path: Path) -> None:
    """A limit on the size of files stands for the full disk: the write fails at that byte."""
    root = Path(__file__).parents[2]
    path = tmp_path / "result.h5"
    store.save(path, synthetic_result.result())
    assert path.stat().st_size > 120_000, "the limits below must be smaller than the file"
    command = [sys.executable, "-c", SAVES, str(path)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == synthetic_result.result().state
    assert [item.name for item in tmp_path.iterdir()] == ["result.h5"]


@pytest.mark.parametrize("override", [
    "geometry.n_length=1000000",
    "loads.static.press.value=1e300 kN",
    "contact.tangential_stiffness=1e12 N/um",
    "harmonics.tolerance=1e-300",
])  # fmt: skip
def test_absurd_sizes_are_refused_at_once(override: str) -> None:
    start = time.process_time()
    with pytest.raises(td.SceneError, match=override.partition("=")[0].rpartition(".")[2]):
        scene_file.read("beam", [override])
    assert time.process_time() - start < 10


def test_a_mesh_beyond_the_memory_is_refused_before_it_is_factorised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIBODYN_CACHE", "off")  # a reduction that is kept is not made again
    page = os.sysconf("SC_PAGE_SIZE")
    monkeypatch.setattr(os, "sysconf", lambda name: page if name == "SC_PAGE_SIZE" else 1000)
    with pytest.raises(ValueError, match="DOFs, whose factorisation needs"):
        td.run("beam", overrides=TINY)


def test_ctrl_c_while_the_program_is_loaded_ends_quietly(monkeypatch, capsys):
    class Interrupting(importlib.abc.MetaPathFinder):
        def find_spec(self, name, path, target=None):
            if name == "tribodyn.workflows.command.main":
                raise KeyboardInterrupt
            return

    monkeypatch.delitem(sys.modules, "tribodyn.workflows.command.main", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    with pytest.raises(SystemExit) as stop:
        program.main()
    assert stop.value.code == 130
    assert capsys.readouterr().err == "tribodyn: stopped.\n"
