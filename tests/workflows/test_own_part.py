"""A part of one's own, as its tutorial has it: drawing, scene, run, and a study of its grids beside it."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import refusal
from tests.helpers.pages import ROOT, follow
from tribodyn.geometry.gmsh_session import save, session
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.result import store
from tribodyn.workflows.result.summary import summary

PAGE = ROOT / "docs/tutorials/own_part.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("own")
    follow(PAGE, built)
    return built


def test_the_example_runs_from_its_drawing_to_its_worn_surface(folder: Path) -> None:
    result = store.load(folder / "results/arm/result.h5")
    assert result.state.startswith("complete")
    numbers = summary(result)
    free, pressed = numbers["open_frequencies"], numbers["peak_frequency"]["first"]
    assert free[1] < pressed < 3000  # the first mode across the load, stiffened by the stop
    assert numbers["peak_frequency"]["last"] == pytest.approx(free[1], rel=0.02)  # worn off, the arm is free
    assert (folder / "results/arm/pictures/part.png").stat().st_size > 10_000


GRIDS = """
[ladders.mesh]
worn_up_to = 0
sizes = [1, 1.33, 2]
set = [['geometry.mesh="arm_20.msh"'], ['geometry.mesh="arm_15.msh"'], ['geometry.mesh="arm_10.msh"']]
"""


def test_a_study_beside_the_scene_is_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for size in (20, 15, 10):
        with session() as gmsh:
            gmsh.parser.setNumber("size", [1e-3 * size])
            gmsh.merge(str(folder / "arm.geo"))
            gmsh.model.mesh.generate(3)
            save(gmsh, folder / f"arm_{size}.msh")
    (folder / "arm.study.toml").write_text(GRIDS)
    words = [
        "study", "converge", str(folder / "arm.toml"), "--setting", "mesh", "--json", "--out", str(folder),
    ]  # fmt: skip
    cli.app(words, result_action="return_value")
    rows = json.loads(capsys.readouterr().out)
    assert [row["size"] for row in rows] == [1, 1.33, 2]
    assert all(row["outcome"] == "converged" for row in rows)
    assert rows[0]["pairs"] < rows[2]["pairs"]
    assert (folder / "converge_arm.png").is_file()


@pytest.mark.parametrize(("study", "sentence"), [
    ("[knobs.x]", "unknown key knobs"),
    ("ladders = 3", "ladders: expected a table"),
    ("[ladders.x]\nsizes = [1, 2]", "ladders.x.set is missing"),
    ("[ladders", "arm.study.toml"),
])  # fmt: skip
def test_a_study_that_is_none_is_refused(folder, study, sentence, capsys):
    (folder / "arm.study.toml").write_text(study)
    assert sentence in refusal(["study", "converge", str(folder / "arm.toml")], capsys)
