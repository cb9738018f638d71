"""`import tribodyn`: what it offers, that it is quick, and that it says the same as the command."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result.provenance import rebuilt

SMALL = {
    "harmonics.kept": [0, 1], "wear.tolerance": 0.02, "wear.at": "peak", "wear.motion": "machine",
    "geometry.n_patch": 5, "geometry.n_length": 4, "geometry.n_height": 1, "reduction.modes": 4,
    "response.points": 12, "wear.max_steps": 2, "verdict.enabled": False,
}  # fmt: skip


@pytest.fixture(scope="module")
def messages() -> list[tuple[str, float | None]]:
    return []


@pytest.fixture(scope="module")
def worn(messages: list[tuple[str, float | None]]) -> td.Result:
    return td.run("beam", overrides=SMALL, progress=lambda text, share: messages.append((text, share)))


def test_every_name_is_there_and_is_told_once() -> None:
    assert len(td.__all__) == len(set(td.__all__)) <= 40
    for name in td.__all__:
        assert getattr(td, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = td.nonsense


def test_the_import_brings_nothing_heavy() -> None:
    heavy = ("numpy", "gmsh", "pyvista", "matplotlib", "skfem", "h5py", "numba")
    code = f"import sys, tribodyn; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_a_scene_is_a_name_a_path_or_a_dict(tmp_path: Path) -> None:
    by_name = td.read_scene("beam", {"contact.friction": 0.3, "wear.step": "4 %"})
    assert by_name.scene.contact.numbers["friction"] == 0.3
    path = tmp_path / "mine.toml"
    path.write_text(td.read_scene("beam").text)
    by_path = td.read_scene(path, ["contact.friction=0.3", "wear.step=4 %"])
    tables = tomllib.loads(path.read_text())
    tables["contact"]["friction"] = np.float64(0.3)
    tables["wear"]["step"] = "4 %"
    by_dict = td.read_scene(tables, folder=tmp_path)
    assert by_name.scene == by_path.scene == by_dict.scene
    repeated = td.read_scene(by_dict, {"wear": None})
    assert repeated.scene.wear is None
    assert repeated.folder == tmp_path.resolve()


@pytest.mark.parametrize(("source", "overrides", "sentence"), [
    ("baem", (), 'there is no scene "baem"'),
    ({"geometry": {"part": "beam"}}, (), "is missing"),
    ("beam", {"contact.fraction": 1}, r"unknown key contact.fraction \(did you mean friction\?\)"),
    ("beam", "contact.friction=1", "give a list of texts"),
])  # fmt: skip
def test_a_bad_scene_is_one_sentence(source: object, overrides: object, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        td.read_scene(source, overrides)  # type: ignore[arg-type]


def test_a_run_in_memory_is_that_of_the_command(worn, messages, tmp_path, capsys):
    sets = [word for key, value in SMALL.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    cli.app(["run", "beam", *sets, "--no-pictures", "--out", str(tmp_path)], result_action="return_value")
    capsys.readouterr()
    cli.app(["show", str(tmp_path), "--json"], result_action="return_value")
    theirs, ours = json.loads(capsys.readouterr().out), json.loads(json.dumps(worn.summary()))
    assert {**theirs, "seconds": 0, "error_budget": 0} == {**ours, "seconds": 0, "error_budget": 0}
    loaded = td.load(tmp_path)
    assert np.array_equal(loaded.response.frequency, worn.response.frequency)
    assert loaded.summary() == td.load(tmp_path / "result.h5").summary()
    shares = [share for text, share in messages if text.startswith("frequency response") and share is not None]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert ("wear", None) not in messages


def test_resume_and_pictures_need_a_folder() -> None:
    for option in ("pictures", "resume"):
        with pytest.raises(ValueError, match=f"{option} needs a folder"):
            td.run("beam", **{option: True})  # type: ignore[arg-type]


def test_fields_on_the_mesh_are_those_of_the_result(worn: td.Result) -> None:
    grid, patch = td.plot.mesh_fields(worn), td.plot.patch_fields(worn)
    assert grid.n_points == len(worn.part.points)
    depth = np.asarray(patch.point_data["depth"])
    assert np.array_equal(depth, worn.wear.depth[-1])  # of the state that the row solved
    split = worn.facts.share_of_body_1
    assert np.allclose(np.asarray(grid["depth_on_this_face"])[worn.patch.nodes], split * depth, rtol=1e-12)
    first = td.plot.patch_fields(worn, 0)
    assert not np.asarray(first.point_data["depth"]).any()
    with pytest.raises(ValueError, match="no wear row 77"):
        td.plot.patch_fields(worn, 77)
    # a single harmonic on top of the static one swings by sqrt(a^2 + b^2 in the ellipse's long axis)
    a, b = worn.fields.displacement[-1][..., 1:3].transpose(2, 0, 1)
    long = np.linalg.svd(np.stack([a, b], axis=-1), compute_uv=False)[:, 0]
    assert np.allclose(grid["amplitude"], long, rtol=5e-3)
    with pytest.raises(ValueError, match="no field at wear row 77"):
        td.plot.mesh_fields(worn, 77)


def test_every_plot_is_a_figure(worn: td.Result, tmp_path: Path) -> None:
    courses = ("depth", "peak", "preload", "energy", "cycles_per_step")
    figures = [td.plot.response(worn), td.plot.hysteresis(worn), td.plot.patch(worn), td.plot.patch(worn, [0])]
    figures += [td.plot.motion(worn), td.plot.motion(worn, [0])]
    figures += [td.plot.wear(worn, course) for course in courses]
    assert all(figure.axes for figure in figures)
    with pytest.raises(ValueError, match='no wear plot "life"'):
        td.plot.wear(worn, "life")
    unworn = td.run("beam", overrides={**SMALL, "wear.max_steps": 0})
    assert td.plot.hysteresis(unworn).axes
    for draw in (td.plot.wear, td.plot.status, td.plot.motion):
        with pytest.raises(ValueError, match="the result holds no"):
            draw(unworn)


def test_a_list_among_changes_stays_on_one_line_of_the_result() -> None:
    """A result keeps a change in each line, and is built again from these."""
    changes = {**SMALL, "response.frequency": ["500 Hz", "520 Hz"], "response.points": 2, "wear": None}
    result = td.run("beam", overrides=changes)
    lines = result.provenance["overrides"].split("\n")
    assert len(lines) == len(changes)
    assert rebuilt(result).scene.response.frequency == (500.0, 520.0)
