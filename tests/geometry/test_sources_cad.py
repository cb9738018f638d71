"""CAD files become bodies of second order under their names; faces are picked by number and by rule."""

from pathlib import Path

import numpy as np
import pytest

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.mesh import area, facts
from tribodyn.geometry.sources import face_rules, foreign_file
from tribodyn.geometry.sources.cad import Sizes


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """Two blocks of 60 x 20 x 10, one on the other, as a CAD program writes them."""
    path = tmp_path_factory.mktemp("cad") / "blocks.step"
    with session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 60, 20, 10)
        gmsh.model.occ.addBox(40, 0, 10, 60, 20, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    lines = path.read_text().splitlines()
    number = 0
    for i, line in enumerate(lines):
        if "PRODUCT('" in line and "translator" in line and line.split("'")[1].rpartition(".")[2] in ("1", "2"):
            product = line.split("'")[1]
            if product.count(".") == 2:
                lines[i] = line.replace(product, ("lower", "upper")[number])
                number += 1
    path.write_text("\n".join(lines))
    return path


def test_solids_are_bodies_that_stay_apart(blocks):
    source = foreign_file.read(blocks, "mm")
    assert len(source.bodies) == 2
    for body in source.bodies.values():
        result = facts(body.mesh)
        assert result.volume == pytest.approx(60e-3 * 20e-3 * 10e-3, rel=1e-9)
        assert sorted(np.round(result.high - result.low, 9)) == [0.01, 0.02, 0.06]
        areas = {name: area(body.mesh, ids) for name, ids in body.mesh.boundaries.items()}
        assert len(areas) == 6
        assert sum(areas.values()) == pytest.approx(2 * (60 * 20 + 60 * 10 + 20 * 10) * 1e-6)
    assert any("second order" in sentence for sentence in source.notes)


def test_sizes_by_body_and_by_face_refine_there(blocks):
    coarse = foreign_file.read(blocks, "mm", Sizes(15.0))
    first, second = coarse.bodies
    number = int(next(iter(coarse.bodies[second].mesh.boundaries)).split()[1])
    fine = foreign_file.read(blocks, "mm", Sizes(15.0, bodies={first: 5.0}))
    at_face = foreign_file.read(blocks, "mm", Sizes(15.0, faces={number: 3.0}))
    assert fine.bodies[first].mesh.nelements > 4 * coarse.bodies[first].mesh.nelements
    face = f"face {number}"
    count = {s: len(item.bodies[second].mesh.boundaries[face]) for s, item in (("coarse", coarse), ("fine", at_face))}
    assert count["fine"] > 6 * count["coarse"]


def test_one_solid_alone_with_edges_of_the_size_that_is_asked_for(blocks):
    name = next(iter(foreign_file.read(blocks, "mm", Sizes(20.0)).bodies))
    for size in (5.0, 8.0):
        (body,) = foreign_file.read(blocks, "mm", Sizes(size, solid=name)).bodies.values()
        a, b = (body.mesh.p[:, end] for end in body.mesh.edges)
        length = 1e3 * np.linalg.norm(a - b, axis=0)
        assert np.median(length) == pytest.approx(size, rel=0.2)


@pytest.mark.parametrize(("sizes", "sentence"), [
    (Sizes(faces={99: 1.0}), "has no face 99 to give a size to"),
    (Sizes(bodies={"middle": 1.0}), "has no solid middle"),
    (Sizes(-1.0), "must be above zero"),
])  # fmt: skip
def test_sizes_that_cannot_be_are_refused(blocks, sizes, sentence):
    with pytest.raises(ValueError, match=sentence):
        foreign_file.read(blocks, "mm", sizes)


def test_broken_cad_files_are_refused_in_one_sentence(tmp_path, blocks):
    broken = tmp_path / "broken.step"
    broken.write_text("ISO-10303-21;\nhello\n")
    with pytest.raises(ValueError, match=r"cannot be read|has no solid") as message:
        foreign_file.read(broken)
    assert "\n" not in str(message.value)
    drawing = tmp_path / "broken.geo"
    drawing.write_text("Box(1) = {0, 0, 0};")
    with pytest.raises(ValueError, match=r"cannot be meshed|no volume"):
        foreign_file.read(drawing)
    with pytest.raises(ValueError, match="meshed already"):
        foreign_file.read(Path(__file__).parent / "decks" / "lap.inp", "mm", Sizes(1.0))


def test_drawings_are_meshed(tmp_path):
    drawing = tmp_path / "box.geo"
    text = (
        'SetFactory("OpenCASCADE");', "Box(1) = {0, 0, 0, 1, 2, 3};", 'Physical Volume("box") = {1};',
        'Physical Surface("end") = {1};', "Mesh.MeshSizeMax = 1;",
    )  # fmt: skip
    drawing.write_text("\n".join(text) + "\n")
    (body,) = foreign_file.read(drawing, "mm").bodies.values()
    assert facts(body.mesh).volume == pytest.approx(6e-9)
    assert area(body.mesh, body.mesh.boundaries["end"]) == pytest.approx(6e-6)


def test_faces_are_picked_by_rule(blocks):
    source = foreign_file.read(blocks, "mm")
    body = min(source.bodies.values(), key=lambda item: item.mesh.p[2].min())
    mesh = body.mesh
    top = face_rules.by_normal(mesh, (0, 0, 1), 5.0)
    assert area(mesh, top) == pytest.approx(60e-3 * 20e-3)
    np.testing.assert_array_equal(np.sort(face_rules.nearest(mesh, (0.03, 0.01, 0.02))), np.sort(top))
    np.testing.assert_array_equal(np.sort(face_rules.within_box(mesh, (0, 0, 0.01), (0.06, 0.02, 0.01))), np.sort(top))
    with pytest.raises(ValueError, match="no face of the boundary lies within the box"):
        face_rules.within_box(mesh, (1, 1, 1), (2, 2, 2))
    with pytest.raises(ValueError, match="no face of the boundary faces"):
        face_rules.by_normal(mesh, (1, 1, 1), 5.0)
    with pytest.raises(ValueError, match="not all zero"):
        face_rules.by_normal(mesh, (0, 0, 0), 5.0)
