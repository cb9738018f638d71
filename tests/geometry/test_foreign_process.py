"""Opening a file runs nothing, and a parser that dies or does not end is one sentence."""

from pathlib import Path

import numpy as np
import pytest

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.sources import foreign_file, foreign_process
from tribodyn.refusal import Refusal
from tribodyn.workflows.studies.draft import draft
from tribodyn.workflows.studies.inspection import inspect

SCRIPT = 'SystemCall "touch {marker}"; Printf("x") > "{marker}";\n'
MESH = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"


HEADS = ["", MESH[1:], "\n" + MESH, " " + MESH, "\ufeff" + MESH, "//\n" + MESH, "$Comments\n" + MESH]


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("ending", [".msh", ".MSH"])
def test_a_script_with_the_ending_of_a_mesh_does_not_run(tmp_path, head, ending):
    path, marker = tmp_path / f"part{ending}", tmp_path / "ran"
    path.write_text(head + SCRIPT.format(marker=marker), encoding="utf-8")
    with pytest.raises(Refusal, match=r"does not begin with \$MeshFormat"):
        foreign_file.read(path)
    assert not marker.exists()


@pytest.mark.parametrize("ending", [".msh", ".step", ".brep", ".vtk"])
def test_a_script_in_a_file_beside_does_not_run(tmp_path, ending):
    path, marker = tmp_path / f"part{ending}", tmp_path / "ran"
    with session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    for name in (f"{path.name}.opt", f"{path.stem}.opt", ".gmshrc", ".gmsh-options"):
        (tmp_path / name).write_text(SCRIPT.format(marker=marker))
    assert foreign_file.read(path).bodies
    assert not marker.exists()


@pytest.mark.parametrize("function", [inspect, draft])
def test_a_drawing_runs_with_consent_alone(tmp_path, function):
    path, marker = tmp_path / "box.geo", tmp_path / "ran"
    path.write_text('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1};\n' + SCRIPT.format(marker=marker))
    with pytest.raises(Refusal, match="add --allow-scripts"):
        function(path)
    assert not marker.exists()
    function(path, allow_scripts=True)
    assert marker.exists()


@pytest.mark.parametrize(
    ("command", "sentence"),
    [("kill -SEGV $PPID", "was ended by SIGSEGV: it is damaged"), ("sleep 9", "was not read in 1 s: mesh it in Gmsh")],
)
def test_a_parser_that_dies_or_does_not_end_is_a_sentence(tmp_path, monkeypatch, command, sentence):
    monkeypatch.setattr(foreign_process, "SECONDS", 1.0)
    path = tmp_path / "box.geo"
    path.write_text(f'SystemCall "{command}";\n')
    with pytest.raises(Refusal, match=sentence) as refusal:
        foreign_file.read(path)
    assert str(path) in str(refusal.value)


def test_a_damaged_shape_that_ends_opencascade_is_refused():
    with pytest.raises(Refusal, match=r"damaged\.brep' (was ended by|cannot be read)"):
        foreign_file.read(Path(__file__).parent / "decks" / "damaged.brep")


def test_groups_of_any_name_come_back_as_they_were(tmp_path):
    content = {"value": {"array": np.arange(3), "an {array}": [np.eye(2), "text"], "empty": np.empty((0, 3), int)}}
    foreign_process._save(tmp_path / "answer.npz", content)
    loaded = foreign_process._load(tmp_path / "answer.npz")
    np.testing.assert_equal(loaded, content)
