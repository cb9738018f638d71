"""A study on an engine of another process: workers and the scheduler are killed in the middle, and nothing is lost."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import tribodyn as td
from tribodyn.workflows.studies.many import pool
from tribodyn.workflows.studies.many.study_table import Journal

pytest.importorskip("distributed")
pytestmark = pytest.mark.faults

KEYS = {"loads.static.press.value": ["15 kN", "18 kN", "20 kN"], "contact.friction": [0.3, 0.5]}
SET = [
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "response.points=8",
    "wear=",
]  # fmt: skip
TABLES: dict[str, Any] = {"study": {"scene": "beam", "design": "grid", "set": SET}, "vary": KEYS}
RUNS = 6
PATIENCE = 60.0


def until(true: Callable[[], Any]) -> None:
    """Wait for something to come true."""
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


class Loopback:
    """A scheduler and two workers of dask, each a process of its own, with only the engine between them and a study."""

    host = "127.0.0.1"
    before: tuple[tuple[str, ...], ...] = ((), ())  # words that start each worker

    def __init__(self) -> None:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "scheduler.json"
            words = ("--host", self.host, "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
            self.scheduler = self._start("scheduler", *words)
            until(lambda: file.exists() and file.stat().st_size > 0)
            self.address = str(json.loads(file.read_text())["address"])
        plain = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
        self.workers = [self._start("worker", self.address, *plain, before=words) for words in self.before]

    @staticmethod
    def _start(kind: str, *words: str, before: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
        words = (*before, sys.executable, "-m", f"distributed.cli.dask_{kind}", *words)
        return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def kill_worker(self) -> None:
        self.workers[0].kill()

    def kill_scheduler(self) -> None:
        self.scheduler.kill()
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()


class TwoHosts(Loopback):
    """The second worker in a network namespace, as on another host: a virtual cable joins it to all others."""

    host = "10.99.77.1"
    there, cable = "tribodyn-there", ("tribodyn-a", "tribodyn-b")
    before = ((), ("ip", "netns", "exec", there))

    def __init__(self) -> None:
        self._pull()
        steps = (
            f"ip netns add {self.there}",
            f"ip link add {self.cable[0]} type veth peer name {self.cable[1]} netns {self.there}",
            f"ip addr add {self.host}/24 dev {self.cable[0]}",
            f"ip link set {self.cable[0]} up",
            f"ip -n {self.there} addr add 10.99.77.2/24 dev {self.cable[1]}",
            f"ip -n {self.there} link set {self.cable[1]} up",
        )
        for step in steps:
            try:
                subprocess.run(step.split(), check=True, capture_output=True)
            except (OSError, subprocess.CalledProcessError) as trouble:
                self._pull()
                pytest.skip(f"no network namespaces here: {trouble}")
        super().__init__()
        with pytest.importorskip("distributed").Client(self.address) as client:
            until(lambda: len(client.scheduler_info()["workers"]) == 2)
            hosts = sorted(address.split(":")[1] for address in client.scheduler_info()["workers"])
        assert hosts == ["//10.99.77.1", "//10.99.77.2"]

    def kill_scheduler(self) -> None:
        super().kill_scheduler()
        self._pull()

    def _pull(self) -> None:
        for step in (f"ip link del {self.cable[0]}", f"ip netns del {self.there}"):
            try:
                subprocess.run(step.split(), capture_output=True)
            except OSError:
                return


class InProcess:
    """The same by closing what lives in this process, which takes less time."""

    def __init__(self) -> None:
        distributed = pytest.importorskip("distributed")
        self.cluster = distributed.LocalCluster(2, threads_per_worker=1, processes=False, dashboard_address=None)
        self.address = str(self.cluster.scheduler_address)

    def kill_worker(self) -> None:
        self.cluster.scale(1)

    def kill_scheduler(self) -> None:
        self.cluster.close()


@pytest.fixture
def reference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The study done without any engine."""
    with monkeypatch.context() as patch:
        patch.setattr(pool, "finished", lambda tasks, workers, solve: map(solve, tasks))
        td.studies.grid(TABLES, tmp_path / "here", workers=1)
    return tmp_path / "here"


OF_PROCESSES = [pytest.param(kind, marks=pytest.mark.slow) for kind in (Loopback, TwoHosts)]


@pytest.mark.parametrize("kind", [InProcess, *OF_PROCESSES])
def test_a_killed_worker_and_a_killed_scheduler_lose_nothing(kind: Any, tmp_path: Path, reference: Path) -> None:
    folder, failures = tmp_path / "there", []
    journal = Journal(folder)
    engine = kind()

    def study() -> None:
        try:
            td.studies.grid(TABLES, folder, scheduler=engine.address)
        except td.SolveFailed as failure:
            failures.append(str(failure))

    thread = threading.Thread(target=study)
    thread.start()
    until(lambda: len(journal.rows()) >= 1)
    engine.kill_worker()  # dask gives its run to the other one
    until(lambda: len(journal.rows()) >= 2)
    engine.kill_scheduler()
    thread.join(PATIENCE)
    assert failures == [f"the scheduler at {engine.address} was lost"]
    before = journal.rows()
    assert 2 <= len(before) < RUNS

    repeated = kind() if kind is InProcess else None
    computed = td.studies.grid(TABLES, folder, workers=1, scheduler=repeated.address if repeated else "local")
    if repeated:
        repeated.kill_scheduler()
    assert computed.count("complete") == RUNS
    after = journal.rows()
    assert all(after[key].seconds == row.seconds for key, row in before.items())  # none was done again
    assert (folder / "study.csv").read_bytes() == (reference / "study.csv").read_bytes()
    assert not (folder / "models").exists()
