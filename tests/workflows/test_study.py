"""Studies: designs against closed forms, one table for any number of workers, nothing finished is lost or repeated."""

import json
import math
import subprocess
import sys
import time
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas
import pytest
from scipy import stats

import tribodyn as td
from tests.helpers import dying
from tests.helpers.command import leave, printed_text
from tribodyn.hbm.linear import compliance
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import model_cache, modelling
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.many import parameter_space, pool, run_task, study_file, study_pictures
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun, solve
from tribodyn.workflows.studies.many.study_table import Journal

TINY = [
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "response.points=6",
    "wear=",
]  # fmt: skip
PRESS, FRICTION = "loads.static.press.value", "contact.friction"
TABLES: dict[str, Any] = {
    "study": {"scene": "beam", "design": "grid", "set": TINY},
    # a scene refuses a friction below 0
    "vary": {FRICTION: [0.3, -0.5], PRESS: ["10 kN", "20 kN"]},
}


def drawn(kind: str, runs: int, vary: dict[str, Any], **more: Any) -> list[dict[str, Any]]:
    tables = {"study": {"scene": "beam", "design": kind, "runs": runs, "seed": 3}, "vary": vary, **more}
    return parameter_space.runs(study_file.parse(tables, "mine.toml", Path()))


@pytest.mark.parametrize("kind", ["sobol", "latin_hypercube"])
def test_draws_have_the_moments_of_their_distributions(kind: str) -> None:
    rows = drawn(kind, 1024, {
        "a": {"distribution": "uniform", "low": "1 mm", "high": "3 mm"},
        "b": {"distribution": "normal", "mean": "20 kN", "cov": "10 %"},
        "c": {"distribution": "lognormal", "median": "2 kN", "cov": 0.5},
        "d": {"distribution": "triangular", "low": 0, "mode": 1, "high": 4},
        "e": {"distribution": "normal", "mean": 0.0, "std": 1.0, "low": 0.0},
        "f": [1, 2],
    })  # fmt: skip
    values = {key: np.array([row[key] for row in rows]) for key in "abcdef"}
    width = math.sqrt(math.log(1.25))
    expected = {  # mean and standard deviation
        "a": (2e-3, 2e-3 / math.sqrt(12)),
        "b": (20e3, 2e3),
        "c": (2e3 * math.exp(width**2 / 2), 2e3 * math.exp(width**2 / 2) * 0.5),
        "d": (5 / 3, math.sqrt((16 + 1 - 4) / 18)),
        "e": (math.sqrt(2 / math.pi), math.sqrt(1 - 2 / math.pi)),  # half normal
        "f": (1.5, 0.5),
    }
    for key, (mean, deviation) in expected.items():
        assert values[key].mean() == pytest.approx(mean, rel=0.01), key
        assert values[key].std() == pytest.approx(deviation, rel=0.03), key
    assert values["e"].min() > 0


def test_correlations_are_those_of_a_gaussian_copula() -> None:
    vary = {
        "a": {"distribution": "uniform", "low": 0, "high": 1},
        "b": {"distribution": "lognormal", "median": 1, "cov": 0.3},
        "c": {"distribution": "uniform", "low": 0, "high": 1},
    }
    rows = drawn("sobol", 2048, vary, correlations=[{"keys": ["a", "b"], "value": 0.7}])
    a, b, c = (np.array([row[key] for row in rows]) for key in "abc")
    assert stats.spearmanr(a, b).statistic == pytest.approx(6 / math.pi * math.asin(0.35), abs=0.01)
    assert stats.spearmanr(a, c).statistic == pytest.approx(0, abs=0.02)
    assert b.mean() == pytest.approx(math.sqrt(1.09), rel=0.01)  # its own distribution stays
    item = [{"keys": ["a", "b"], "value": 0.9}, {"keys": ["b", "c"], "value": 0.9}, {"keys": ["a", "c"], "value": -0.9}]
    with pytest.raises(td.SceneError, match="no variables have all of these correlations"):
        drawn("sobol", 8, vary, correlations=item)


@pytest.mark.parametrize(("change", "sentence"), [
    ({"vary": {"contact.fricton": [0.3]}}, "unknown key contact.fricton .did you mean friction"),
    ({"vary": {FRICTION: 0.3}}, "vary.contact.friction: expected a list of values or a distribution"),
    ({"vary": {FRICTION: {"distribution": "normal", "mean": 0.3}}}, "draw with design"),
    ({"vary": {}}, "vary is empty"),
    ({"study": {"scene": "beam", "design": "sobol"}}, "say how many runs"),
    ({"study": {"scene": "beam", "design": "grid", "runs": 3}}, "leave it out"),
    ({"study": {"scene": "beam", "design": "list"}, "vary": {"a": [1], "b": [1, 2]}}, "need one length"),
    ({"study": {"scene": "beam", "design": "grid", "worker": 2}}, "unknown key study.worker"),
    ({"study": {"scene": "beam", "design": "grid", "set": ["solver.threads=2"]}}, "every run has one thread"),
    ({"study": {"scene": "no", "design": "grid"}}, 'there is no scene "no"'),
    ({"correlations": [{"keys": [FRICTION, "b"], "value": 0.1}]}, "does not vary by a distribution"),
])  # fmt: skip
def test_what_cannot_be_is_refused_with_a_sentence(change: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    with pytest.raises(td.SceneError, match=sentence):
        td.studies.grid(TABLES | change, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("table", "sentence"), [
    ({"distribution": "normal", "mean": "3 N", "std": "2 mm"}, "different units"),
    ({"distribution": "uniform", "low": 2, "high": 1}, "low 2.0 is not below high 1.0"),
    ({"distribution": "lognormal", "median": -1, "cov": 0.1}, "median -1.0 is not above 0"),
    ({"distribution": "triangular", "low": 0, "high": 1}, "needs high, low, mode; this has high, low"),
    ({"distribution": "normal", "mean": 0, "std": 1, "low": 99}, "nothing is left"),
])  # fmt: skip
def test_a_wrong_distribution_is_refused(table: dict[str, Any], sentence: str) -> None:
    with pytest.raises(td.SceneError, match=sentence):
        drawn("sobol", 4, {"a": table})


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study done by two processes."""
    folder = tmp_path_factory.mktemp("two")
    td.studies.grid(TABLES, folder, workers=2)
    return folder


def test_a_row_is_what_the_run_itself_gives(done: Path) -> None:
    frame = pandas.read_csv(done / "study.csv", index_col="run")
    assert list(frame.index) == [1, 2, 3, 4]
    assert list(frame["status"]) == ["complete", "complete", "refused", "refused"]
    assert "friction" in frame["sentence"][3]
    assert list(frame[PRESS]) == [10e3, 20e3] * 2  # in SI units
    base = td.run("beam", overrides=[*TINY, f"{FRICTION}=0.3", f"{PRESS}=20 kN", "verdict.enabled=false"]).summary()
    assert frame["amplitude_first"][2] == pytest.approx(base["amplitude"]["first"], rel=1e-9)
    assert frame["peak_frequency_first"][2] == base["peak_frequency"]["first"]
    assert (done / "study.png").stat().st_size > 5000


def test_the_table_does_not_depend_on_the_workers(done: Path, tmp_path: Path) -> None:
    td.studies.grid(TABLES, tmp_path, workers=1)
    assert (tmp_path / "study.csv").read_bytes() == (done / "study.csv").read_bytes()


def test_runs_that_share_their_linear_side_give_what_each_gives_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    base, springs, damping = scene_file.read("beam"), "contact.tangential_stiffness=300 N/um", "damping.modal=2 %"
    changes = ["", f"{FRICTION}=0.3", f"{PRESS}=10 kN", springs, damping, "loads.harmonic.shake.value=8 kN"]
    always = (*TINY, "response.points=20", "verdict.enabled=false")
    tasks = [
        StudyRun(n, base.name, base.text, (*always, *filter(None, [c])), base.folder) for n, c in enumerate(changes)
    ]
    single = [solve(task).numbers for task in tasks]
    assert len({tuple(numbers.values()) for numbers in single}) == len(tasks), single
    rows: list[float] = []
    expansion = compliance.Expansion.__init__

    def counted(self: compliance.Expansion, *arguments: Any) -> None:
        rows.append(1.0)
        expansion(self, *arguments)

    monkeypatch.setattr(compliance.Expansion, "__init__", counted)
    with model_cache.memory_cache():
        assert [solve(task).numbers for task in tasks] == single
    assert len(rows) == 4  # the first, other springs, other damping, and back: not for friction and loads


def test_resuming_repeats_nothing_and_takes_what_a_larger_study_shares(done, tmp_path, monkeypatch):
    lines = (done / "rows.jsonl").read_text().splitlines(keepends=True)
    assert len(lines) == 2
    (tmp_path / "rows.jsonl").write_text(lines[0] + lines[1] + '{"run": 2, "key": "torn')
    requested: list[int] = []

    def pretend(tasks: list[StudyRun], workers: int, solve: Any) -> Any:
        for task in tasks:
            requested.append(task.number)
            yield RunRow(task.number, task.key, "failed", "at 400 Hz")

    monkeypatch.setattr(pool, "finished", pretend)
    computed = td.studies.grid(TABLES, tmp_path)
    assert requested == []
    assert (tmp_path / "study.csv").read_bytes() == (done / "study.csv").read_bytes()
    larger = TABLES | {"vary": {FRICTION: [0.2, 0.3], PRESS: ["10 kN", "20 kN"]}}
    computed = td.studies.grid(larger, tmp_path)
    assert requested == [1, 2]
    assert list(computed.columns["status"]) == ["failed", "failed", "complete", "complete"]
    td.studies.grid(larger, tmp_path)
    assert requested == [1, 2]  # what failed fails again
    td.studies.grid(larger, tmp_path, retry=True)
    assert requested == [1, 2, 1, 2]


def test_the_key_of_a_run_follows_its_files(tmp_path: Path) -> None:
    (tmp_path / "map.txt").write_text("1")
    item = StudyRun(1, "own", 'file = "map.txt"', ("a=1",), tmp_path)
    assert item.key == replace(item, number=2).key
    assert item.key != replace(item, overrides=("a=2",)).key
    before = item.key
    (tmp_path / "map.txt").write_text("22")
    assert item.key != before


@pytest.mark.faults
def test_a_process_that_dies_takes_no_other_run_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forked = get_context("forkserver")  # spawned ones, as in `done`, import the program anew: six of them here
    forked.set_forkserver_preload(["tests.helpers.dying"])
    monkeypatch.setattr(pool, "get_context", lambda _: forked)
    good = StudyRun(1, "none", "", (), tmp_path)
    tasks = [replace(good, number=n) for n in (1, 2, 3, 4)]
    rows = {row.run: row for row in pool.finished(tasks, 2, dying.at_two)}
    assert {n: row.status for n, row in rows.items()} == {1: "refused", 2: "lost", 3: "refused", 4: "refused"}
    assert "died 3 times" in rows[2].sentence


@pytest.mark.faults
def test_the_command_resumes_a_study_that_was_killed(done, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    file.write_text(
        f'[study]\nscene = "beam"\ndesign = "grid"\nset = {json.dumps(TINY)}\n'
        f'[vary]\n{FRICTION} = [0.3, -0.5]\n{PRESS} = ["10 kN", "20 kN"]\n'
    )
    words = ["study", "grid", str(file), "--workers", "1", "--out", str(tmp_path / "out")]
    process = subprocess.Popen([sys.executable, "-m", "tribodyn", *words], stdout=subprocess.DEVNULL)
    journal = Journal(tmp_path / "out")
    while not journal.rows() and process.poll() is None:
        time.sleep(0.02)
    base = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
    process.kill()
    process.wait()
    before = journal.rows()
    assert before
    assert base
    end = time.monotonic() + 60
    while any(_runs(pid) for pid in base):
        assert time.monotonic() < end  # none waits for ever for a study that is gone
        time.sleep(0.05)
    out = printed_text([*words, "--json"], capsys)
    assert json.loads(out)["runs"] == {"complete": 2, "failed": 0, "refused": 2, "defect": 0, "lost": 0}
    after = journal.rows()
    assert all(after[key].seconds == row.seconds for key, row in before.items())
    assert (tmp_path / "out" / "study.csv").read_bytes() == (done / "study.csv").read_bytes()


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_defect_stops_its_own_run_alone_and_shows_its_place(tmp_path, monkeypatch, capsys):
    def broken(file: Any, *_: Any, **__: Any) -> Any:
        if f"{FRICTION}=0.2" in file.overrides:
            return [][1]
        raise SolveFailed("no balance at 400 Hz")

    monkeypatch.setattr(run_task.pipeline, "run", broken)
    monkeypatch.setattr(pool, "finished", lambda tasks, workers, solve: map(solve, tasks))
    study = study_file.parse(TABLES | {"vary": {FRICTION: [0.2, 0.3]}}, "mine.toml", Path())
    monkeypatch.setattr(study_file, "read", lambda _: study)
    table = td.studies.grid("mine.toml", tmp_path)
    assert list(table.columns["status"]) == ["defect", "failed"]
    assert table.defects[0].startswith("run 1: IndexError: list index out of range (test_study.py, line ")
    code, _, message = leave(["study", "grid", "mine.toml", "--out", str(tmp_path / "out")], capsys)
    assert code == 70
    assert "IndexError" in message


def test_what_runs_share_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows: list[Any] = []
    two_results = {FRICTION: [0.3, 0.4], "geometry.n_length": [3, 4]}
    base = modelling.make_mesh
    monkeypatch.setenv("TRIBODYN_CACHE", str(tmp_path / "kept"))
    monkeypatch.setattr(modelling, "make_mesh", lambda *which: rows.append(which) or base(*which))
    monkeypatch.setattr(pool, "finished", lambda tasks, workers, solve: map(solve, tasks))
    computed = td.studies.grid(TABLES | {"vary": two_results}, tmp_path, workers=2)
    assert computed.count("complete") == 4
    assert len(rows) == 2


def test_runs_without_a_peak_have_nothing_to_draw() -> None:
    """Complete runs, none of which has a number that is drawn."""
    runs = {"run": np.arange(2.0), FRICTION: np.array([0.2, 0.3]), "status": np.array(["complete"] * 2)}
    bare = {**runs, "peak_frequency_first": np.full(2, np.nan)}
    assert not study_pictures.shown(SimpleNamespace(columns=bare))  # type: ignore[arg-type]
    assert study_pictures.shown(SimpleNamespace(columns={**runs, "peak_frequency_first": np.array([np.nan, 900.0])}))  # type: ignore[arg-type]
