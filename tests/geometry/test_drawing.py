"""Drawings in Gmsh's language: numbers reach the mesh, what is wrong is one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from tribodyn.geometry import mesh
from tribodyn.geometry.drawing import mesh_drawing

BOX = """
SetFactory("OpenCASCADE");
DefineConstant[size = 0.2, length = 2];
Box(1) = {0, 0, 0, length, 1, 1};
Physical Volume("body") = {1};
Physical Surface("root") = Surface In BoundingBox {-1e-3, -1, -1, 1e-3, 2, 2};
Mesh.MeshSizeMax = size;
Mesh.ElementOrder = 2;
"""


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.geo"
    path.write_text(BOX)
    return path


def test_numbers_of_the_drawing_are_set(box: Path) -> None:
    out = box.with_suffix(".msh")
    coarse = mesh_drawing(box, out)
    assert mesh.quality(mesh.read(out)[0]).volume == pytest.approx(2.0)
    fine = mesh_drawing(box, out, {"size": 0.1, "length": 3})
    read, node_sets = mesh.read(out)
    assert mesh.quality(read).volume == pytest.approx(3.0)
    assert read.nelements == fine > 4 * coarse
    assert set(node_sets) == {"body", "root"}


@pytest.mark.parametrize(
    ("text", "numbers", "sentence"),
    [
        (BOX, {"sise": 1.0}, 'has no number "sise"'),
        ("Box(1) = {;", {}, "cannot be read by Gmsh"),
        ("Point(1) = {0, 0, 0};", {}, "has no volume"),
    ],
)
def test_what_is_wrong_is_one_sentence(tmp_path: Path, text: str, numbers: dict[str, float], sentence: str) -> None:
    path = tmp_path / "part.geo"
    path.write_text(text)
    with pytest.raises(ValueError, match=sentence) as problem:
        mesh_drawing(path, tmp_path / "part.msh", numbers)
    assert "\n" not in str(problem.value)
    assert not (tmp_path / "part.msh").exists()


def test_a_drawing_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no drawing"):
        mesh_drawing(tmp_path / "none.geo", tmp_path / "none.msh")
