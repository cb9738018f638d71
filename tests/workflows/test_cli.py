"""The command: exit codes with one sentence, summaries, and which packages stay out."""

import errno
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.helpers.command import leave, printed_text, refusal
from tests.helpers.synthetic_result import result
from tribodyn.hbm.outcome import SolveEnd, WearEnd
from tribodyn.workflows.command.main import BAD_INPUT, INTERRUPTED, READER_LEFT, guard
from tribodyn.workflows.report import text
from tribodyn.workflows.result import number_format, store, summary
from tribodyn.workflows.result.model_facts import Stage
from tribodyn.workflows.studies.many.run_task import numbers_of

ROOT = Path(__file__).parents[2]

BAD = {
    "no scene": (["run", "bim"], 'no scene "bim"'),
    "no file": (["run", "nowhere.toml"], 'no scene file "nowhere.toml"'),
    "no command": (["fly"], "fly"),
    "no option": (["run", "beam", "--sett", "x"], "--sett"),
    "no value": (["run"], "scene"),
    "unknown key": (["run", "beam", "--set", "contact.fricton=1"], "did you mean friction?"),
    "wrong unit": (["run", "beam", "--set", "loads.static.press.value=20 mm"], "loads.static.press.value"),
    "negative stiffness": (["run", "beam", "--set", "contact.normal_stiffness=-1"], "contact.normal_stiffness"),
    "no law": (["run", "beam", "--set", "contact.law=glue"], "no contact law 'glue'"),
    "no wear law": (["run", "beam", "--set", "wear.law=rust"], "no wear law 'rust'"),
    "no option of a method": (["run", "beam", "--set", "response.options.points=9"], "did you mean n_points?"),
    "no number": (["run", "beam", "--set", "response.options.refinements=x"], "expected a whole number, got 'x'"),
    "no method": (["run", "beam", "--set", "response.method=guess"], "no continuation 'guess'"),
    "no face": (["run", "beam", "--set", "contact.group=foot"], "no face 'foot'"),
    "a patch with no nodes": (["run", "beam", "--set", "contact.group=response"], "no face 'response'"),
    "no clamp": (["run", "beam", "--set", "geometry.fixed=['root']"], "no node set 'root'"),
    "no load group": (["run", "beam", "--set", "loads.static.press.group=top"], "no node set 'top'"),
    "no output group": (["plan", "beam", "--set", "response.group=tip"], "no node set 'tip'"),
    "no result": (["show", "nowhere"], 'no result file "nowhere"'),
    "nothing to render": (["draw", "nowhere"], 'no result file "nowhere"'),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_and_exit_code_2(case, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, words = BAD[case]
    err = refusal(arguments, capsys)
    assert words in err
    assert err.endswith((".\n", "?\n"))


def test_a_mesh_file_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    beam = (ROOT / "workflows" / "cases" / "beam" / "beam.toml").read_text()
    start, end = beam.index("[geometry]"), beam.index("[material]")
    scene = tmp_path / "own.toml"
    scene.write_text(beam[:start] + '[geometry]\nmesh = "gone.msh"\nfixed = ["clamp"]\n' + beam[end:])
    assert "gone.msh' does not exist" in refusal(["run", str(scene), "--out", str(tmp_path / "out")], capsys)


WRITING = {
    "a folder at a file": (["run", "beam"], "file", "no folder can be made at .*file, file exists"),
    "a folder in a file": (["study", "converge", "beam"], "file/folder", "no folder can be made"),
    "a page that is none": (["report", "nowhere"], "page.png", "give a file that ends with .html"),
    "a page at a folder": (["report", "nowhere"], "folder.html", "a folder is there, give a file"),
}


@pytest.mark.parametrize("case", WRITING)
def test_what_cannot_be_written_is_refused_before_long_work(case, capsys, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder.html").mkdir()
    words, out, says = WRITING[case]
    code, _, err = leave([*words, "--out", str(tmp_path / out)], capsys)
    assert code == 2
    assert re.search(says, err)
    assert err.count("\n") == 1


def test_closed_standard_streams_do_not_matter() -> None:
    command = f"{sys.executable} -m tribodyn cases >&-"
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


PLANNED = ("169 node pairs", "524 DOFs", "1521 in each", "GB", "about 33 steps", "finer model", "whole run")


@pytest.mark.parametrize(("arguments", "words"), [(["cases"], ("beam",)), (["plan", "beam_thesis"], PLANNED)])
def test_cases_and_plans_are_told(arguments: list[str], words: tuple[str, ...], capsys: Any) -> None:
    out = printed_text(arguments, capsys)
    assert [word for word in words if word not in out] == []


def test_show_as_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    written = result(9)
    store.save(tmp_path / "result.h5", written)
    code, out, _ = leave(["show", str(tmp_path), "--json"], capsys)
    numbers = json.loads(out)
    wear, patch = written.wear, written.patch
    assert code == 0
    assert numbers["depth"] == wear.depth[-1].max()
    assert numbers["mean_depth"] == pytest.approx(wear.depth[-1].mean())
    assert numbers["separated_cycles"] == wear.cycles[-1]
    assert wear.cycles[-2] < numbers["life"] < wear.cycles[-1]
    assert numbers["friction_work"] == pytest.approx(wear.work.sum())
    assert numbers["volume"] == pytest.approx(wear.depth[-1] @ patch.area)
    assert numbers["wear_steps"] == 8
    assert numbers["solves"] == 36
    assert [numbers["peak_frequency"][instant] for instant in ("first", "last")] == pytest.approx([500, 415])
    assert [numbers["amplitude"][instant] for instant in ("first", "last")] == [wear.amplitude[0], wear.amplitude[-1]]
    assert numbers["preload"] == {"first": 6e3, "last": 0.0}
    assert numbers["seconds"] == 12.5


def test_show_for_people(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    store.save(tmp_path / "result.h5", result())
    out = printed_text(["show", str(tmp_path / "result.h5")], capsys)
    assert out.count("\n") <= 25
    heads = [line.split()[0] for line in out.splitlines()[1:] if line[0] != " "]
    assert heads == ["model", "response", "wear", "warning"]
    _, extra, _ = leave(["show", str(tmp_path / "result.h5"), "--verbose"], capsys)
    assert extra.startswith(out)
    for words in ("contact lost", "mean_depth / m", "solves"):
        assert words in extra


@pytest.mark.parametrize(("value", "unit", "error", "shown"), [
    (0.00095074, "m", 0.053, "0.951 mm"),
    (796.236, "Hz", 0.021, "796 Hz"),
    (7376.7, "N", 0.025, "7.38 kN"),
    (2.219e7, "cycles", 0.3, "22 million cycles"),
    (9.996e5, "cycles", 0.5, "1 000 000 cycles"),
    (2.24e-6, "m3", 0.02, "2240 mm³"),
    (3.7e-8, "m", 0.2, "37 nm"),
    (123456.0, "Hz", 1e-5, "123.456 kHz"),
    (0.0, "N", 0.1, "0 N"),
])  # fmt: skip
def test_a_number_has_the_digits_that_its_error_allows(value: float, unit: str, error: float, shown: str) -> None:
    assert number_format.measured(value, unit, number_format.digits(error)) == shown
    last = 10.0 ** (np.floor(np.log10(abs(value) or 1)) + 1 - number_format.digits(error))
    assert last <= 10 * error * (abs(value) or 1)


def test_a_sparkline_has_its_highest_block_at_the_resonance():
    x = np.linspace(2.0, 4.0, 400)
    line = number_format.sparkline(x, 1 / np.abs(3.3**2 - x**2 + 0.1j), 10)
    assert line.index("█") == 6
    assert (line.count("█"), len(line)) == (1, 10)
    assert "▁" in line
    assert number_format.sparkline(np.array([1.0]), np.array([0.0]), 10).strip() == "▁"
    assert number_format.sparkline(x[::-1], x[::-1], 4)[-1] == "█"


def test_what_is_beyond_the_linear_model_is_warned_of() -> None:
    built = result()
    bent = replace(
        built, wear=replace(built.wear, periods=None, amplitude=np.geomspace(1e-3, 0.15, len(built.wear.amplitude)))
    )
    assert not any("linear" in line for line in text.warnings(built))
    assert ["150 mm" in line for line in text.warnings(bent) if "linear" in line] == [True]
    assert any(line.startswith("warning") and "linear" in line for line in text.brief(bent))


def test_a_reader_that_has_seen_enough_ends_the_command_in_silence(tmp_path: Path) -> None:
    """As in `tribodyn cases | head -1`; here nobody reads at all."""
    store.save(tmp_path / "result.h5", result(9))
    for words in (["show", str(tmp_path)], ["cases"]):
        read_end, write_end = os.pipe()
        os.close(read_end)
        command = [sys.executable, "-m", "tribodyn", *words]
        done = subprocess.run(command, cwd=ROOT, stdout=write_end, stderr=subprocess.PIPE, check=False)
        os.close(write_end)
        assert (done.returncode, done.stderr) == (READER_LEFT, b"")


CTRL_C_WHILE_AN_OBJECT_IS_FREED = """
import os, signal, time
from tribodyn.workflows.command.main import guard

class Freed:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0)

def command():
    Freed()
    while True:
        time.sleep(1)

guard(command)
"""


@pytest.mark.faults
def test_ctrl_c_is_not_lost_while_an_object_is_freed() -> None:
    command = [sys.executable, "-c", CTRL_C_WHILE_AN_OBJECT_IS_FREED]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (INTERRUPTED, "tribodyn: stopped.\n")


@pytest.mark.faults
def test_a_full_disk_is_told_by_name(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    def writes() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "a.png"))

    with pytest.raises(SystemExit) as stop:
        guard(writes)
    message = capsys.readouterr().err
    assert stop.value.code == BAD_INPUT
    assert message.startswith("tribodyn: the disk is full")
    assert "a.png" in message
    assert message.count("\n") == 1


def curve(peak: int, unstable: range | None = None):
    """A made-up result without wear, its response highest at one of its points, unstable at some."""
    built = result()
    assert built.stability is not None
    response = built.response.response.copy()
    response[peak, 0, 1] = 10 * np.abs(response).max()
    marks = None if unstable is None else ~np.isin(np.arange(61), unstable)
    stability = None if marks is None else replace(built.stability, stable=marks)
    return replace(built, wear=None, response=replace(built.response, response=response), stability=stability)


def test_an_unstable_peak_is_reported_with_the_highest_stable_point() -> None:
    steady, falls = curve(30, range(20, 25)), curve(30, range(28, 33))
    assert summary.summary(steady)["peak_is_stable"] is True
    numbers, frf = summary.summary(falls), falls.response
    assert numbers["peak_is_stable"] is False
    best = max((i for i in range(61) if not 28 <= i < 33), key=lambda i: frf.amplitude("response")[i])
    assert numbers["peak_frequency"]["stable"] == frf.frequency[best]
    assert numbers["amplitude"]["stable"] == frf.amplitude("response")[best]
    assert any(line.split()[:2] == ["stable", "point"] for line in text.brief(falls))
    assert any("this peak is unstable" in line for line in text.warnings(falls))
    assert all("detached" in line for line in text.warnings(steady))
    assert "stable" not in summary.summary(curve(30, range(61)))["peak_frequency"]
    assert any("no point is stable" in line for line in text.warnings(curve(30, range(61))))
    assert summary.summary(curve(30))["peak_is_stable"] is None


def test_the_end_of_the_range_is_no_peak() -> None:
    for point, at_end in ((0, True), (30, False), (60, True)):
        built = curve(point)
        assert summary.summary(built)["peak_at_end"] is at_end
        assert any("no peak: " in line for line in text.warnings(built)) is at_end


def test_a_point_beside_a_peak_that_was_not_found_is_no_peak() -> None:
    built = curve(30)
    outcome = tuple(SolveEnd.BESIDE_PEAK.say() if i == 30 else item for i, item in enumerate(built.response.outcome))
    lost = replace(built, response=replace(built.response, outcome=outcome))
    assert summary.summary(lost)["peak_at_end"] is True
    assert "amplitude_first" not in numbers_of(lost)
    assert any("none was found beside the point at" in line for line in text.warnings(lost))


def test_separation_is_reported_only_where_contact_was_lost() -> None:
    built = result()
    unfinished = replace(built, wear=replace(built.wear, end=WearEnd.STEPS_DONE.say(" 8 wear steps")))
    numbers = summary.summary(unfinished)
    assert numbers["separated_cycles"] is None
    assert numbers["cycles"] == built.wear.cycles[-1]


def test_a_result_before_any_solve_has_a_summary() -> None:
    numbers = summary.summary(replace(result(), wear=None, response=None, stage=Stage.BUILT))
    assert numbers["depth"] is None
    assert numbers["peak_frequency"] is None
    assert numbers["finished"] is False
    assert text.brief(replace(result(), wear=None, response=None))


def test_render_draws_the_pictures_of_a_result(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    store.save(tmp_path / "result.h5", result())
    out = printed_text(["draw", str(tmp_path), "--dpi", "40"], capsys)
    assert (tmp_path / "pictures" / "frf.png").is_file()
    assert "part.png" in out or "no renders: " in out


@pytest.mark.parametrize(("statement", "banned"), [
    ("import tribodyn.workflows.command.main", {"gmsh", "pyvista", "vtk", "matplotlib", "numba", "skfem", "h5py"}),
    ("import tribodyn.workflows.run.pipeline", {"gmsh", "pyvista", "vtk", "matplotlib"}),
    ("import tribodyn.workflows.result.summary, tribodyn.workflows.result.store",
        {"gmsh", "pyvista", "vtk", "matplotlib", "skfem"}),
])  # fmt: skip
def test_packages_are_imported_only_where_they_are_used(statement: str, banned: set[str]) -> None:
    code = f"{statement}; import sys; print(' '.join(sorted(set(sys.modules) & {banned!r})))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
