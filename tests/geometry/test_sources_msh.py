"""Gmsh files of every version and kind of element become the same body; kinds that mix are cut conformingly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skfem

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.mesh import quality
from tribodyn.geometry.sources import foreign_file, msh, solid_body
from tribodyn.geometry.sources.raw_mesh import Cells, RawMesh

GMSH_TYPES = {"tetra": 4, "hexahedron": 5, "wedge": 6, "pyramid": 7}
PYRAMIDS = ((0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def mixed_cells(n: int = 2) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Points of the box n x n x 3 of unit cubes, its cells by kind, and the faces "bottom" and "top"."""
    grid = {}
    points = []
    for k in range(4):
        for j in range(n + 1):
            for i in range(n + 1):
                grid[i, j, k] = len(points)
                points.append((i, j, k))
    cells: dict[str, list[tuple[int, ...]]] = {kind: [] for kind in GMSH_TYPES}
    bottom, top = [], []
    for j in range(n):
        for i in range(n):

            def cube(k: int, i: int = i, j: int = j) -> list[int]:
                return [grid[i + a, j + b, k + c] for c in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]

            low, middle, high = cube(0), cube(1), cube(2)
            cells["hexahedron"].append(tuple(low))
            centre = len(points)
            points.append((i + 0.5, j + 0.5, 1.5))
            cells["pyramid"] += [(*(middle[c] for c in reversed(face)), centre) for face in PYRAMIDS]
            a, b, c, d = middle[4:]
            cells["tetra"] += [(a, c, b, centre), (a, d, c, centre)]
            cells["wedge"] += [tuple(high[x] for x in (0, 1, 2, 4, 5, 6)), tuple(high[x] for x in (0, 2, 3, 4, 6, 7))]
            bottom.append(low[:4])
            top += [[high[4], high[5], high[6]], [high[4], high[6], high[7]]]
    faces = {"bottom": np.array(bottom), "top": np.array(top)}
    return np.array(points, dtype=float), {kind: np.array(nodes) for kind, nodes in cells.items()}, faces


def write_mixed(
    path: Path, order: int, complete: bool = True, version: float = 4.1, save_all: bool = False, named: bool = True
) -> Path:
    """Write the box with Gmsh: volume group "box", surface groups "bottom" and "top"."""
    points, cells, faces = mixed_cells()
    with session() as gmsh:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", not complete)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.SaveAll", save_all)
        model = gmsh.model
        for tag in (1, 2):
            model.addDiscreteEntity(2, tag)
        model.addDiscreteEntity(3, 1, [1, 2])
        model.mesh.addNodes(3, 1, np.arange(1, len(points) + 1), points.ravel())
        for kind, nodes in cells.items():
            model.mesh.addElementsByType(1, GMSH_TYPES[kind], [], (nodes + 1).ravel())
        model.mesh.addElementsByType(1, 3, [], (faces["bottom"] + 1).ravel())
        model.mesh.addElementsByType(2, 2, [], (faces["top"] + 1).ravel())
        if order == 2:
            model.mesh.setOrder(2)
        if named:
            for dimension, tag, name in ((2, 1, "bottom"), (2, 2, "top"), (3, 1, "box")):
                model.addPhysicalGroup(dimension, [tag], name=name)
        gmsh.write(str(path))
    return path


def area(mesh, facets):
    basis = skfem.FacetBasis(mesh, mesh.elem(), facets=facets, intorder=6)
    return skfem.Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(basis)


def outside(mesh):
    return np.flatnonzero(mesh.f2t[1] < 0)


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(("order", "complete"), [(1, True), (2, False), (2, True)])
@pytest.mark.parametrize(("version", "save_all"), [(4.1, False), (4.1, True), (2.2, False)])
def test_every_gmsh_file_gives_the_same_body(order, complete, version, save_all, named, tmp_path):
    path = write_mixed(tmp_path / "box.msh", order, complete, version, save_all, named)
    source = foreign_file.read(path)
    (name, body), *remaining = source.bodies.items()
    assert not remaining
    assert name == ("box" if named else "body")
    mesh = body.mesh
    assert mesh.nelements == 4 * (6 + 5 * 2 + 2 + 2 * 3)
    assert mesh.doflocs.shape[1] == 207
    assert quality(mesh).volume == pytest.approx(12.0, rel=1e-12)
    assert area(mesh, outside(mesh)) == pytest.approx(32.0, rel=1e-12)  # a crack would add to it
    bottom, top = ("bottom", "top") if named else ("face 1", "face 2")
    for face, height in ((bottom, 0.0), (top, 3.0)):
        assert area(mesh, mesh.boundaries[face]) == pytest.approx(4.0, rel=1e-12)
        np.testing.assert_array_equal(body.node_sets[face], np.flatnonzero(abs(mesh.doflocs[2] - height) < 1e-9))
    assert any("cut into 96 tetrahedra" in sentence for sentence in source.notes)
    assert any("first order" in sentence for sentence in source.order_notes) == (order == 1)
    assert source.unused == ()


@pytest.mark.parametrize("complete", [True, False])
def test_curved_elements_of_mixed_kinds_keep_their_shape(complete, tmp_path):
    """x + 0.3 z^2 is in every element space: a node taken for its neighbour would fold an element."""
    raw = foreign_file.read_raw(write_mixed(tmp_path / "box.msh", 2, complete))
    bent = raw.points.copy()
    bent[:, 0] += 0.3 * raw.points[:, 2] ** 2
    body = solid_body.build(replace(raw, points=bent))
    result = quality(body.mesh)
    assert result.volume == pytest.approx(12.0, rel=1e-12)
    assert result.scaled_jacobian > 0.1
    straight = solid_body.build(raw).mesh.doflocs
    straight[0] += 0.3 * straight[2] ** 2
    np.testing.assert_allclose(body.mesh.doflocs, straight, atol=1e-14)


def test_unit_and_version_and_missing_volume(tmp_path):
    path = write_mixed(tmp_path / "box.msh", 2)
    assert quality(foreign_file.read(path, "mm").bodies["box"].mesh).volume == pytest.approx(12e-9)
    with pytest.raises(ValueError, match=r'unit = "inch".* is no length'):
        foreign_file.read(path, "inch")
    with session() as gmsh:
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "flat.msh"))
    with pytest.raises(ValueError, match="no volume elements"):
        foreign_file.read(tmp_path / "flat.msh")


def test_prisms_numbered_in_a_mirror_are_turned():
    points, cells, _ = mixed_cells()
    kinds = dict(cells, wedge=cells["wedge"][:, [3, 4, 5, 0, 1, 2]])
    blocks = [Cells(kind, nodes, np.arange(len(nodes))) for kind, nodes in kinds.items()]
    body = solid_body.build(RawMesh(points, np.arange(len(points)), blocks))
    assert quality(body.mesh).volume == pytest.approx(12.0, rel=1e-12)


def test_parts_that_share_no_nodes_are_bodies_named_by_their_groups():
    points, cells, _ = mixed_cells(1)
    n = len(points)
    two_results = np.vstack([points, points + [5.0, 0, 0], points + [9.0, 0, 0]])
    blocks = [Cells(k, np.vstack([c, c + n, c + 2 * n]), np.arange(3 * len(c))) for k, c in cells.items()]
    number, start, owner = {}, 0, []
    for block in blocks:
        owner.append(np.repeat([0, 1, 2], len(block.nodes) // 3))
        start += len(block.nodes)
    owner = np.concatenate(owner)
    number = {i: np.flatnonzero(owner == i) for i in range(3)}
    raw = RawMesh(
        two_results,
        np.arange(3 * n),
        blocks,
        volumes={"all": np.arange(start), "left": number[0], "half": number[1][:2], "rest": number[1][2:]},
    )
    source = solid_body.bodies(raw)
    assert set(source) == {"left", "half+rest", "body1"}
    np.testing.assert_array_equal(source["left"], number[0])
    np.testing.assert_array_equal(source["body1"], number[2])
    body = solid_body.build(raw, source["half+rest"])
    assert set(body.mesh.subdomains) == {"all", "half", "rest"}
    assert quality(body.mesh).volume == pytest.approx(3.0)


def test_sets_of_corner_nodes_hold_the_nodes_added_between_them():
    points, cells, _ = mixed_cells()
    blocks = [Cells("hexahedron", cells["hexahedron"], np.arange(4))]
    ground = np.flatnonzero(points[:, 2] == 0)
    edge = np.flatnonzero((points[:, 2] == 0) & (points[:, 1] == 0))
    raw = RawMesh(
        points, np.arange(len(points)), blocks, nodes={"ground": ground, "edge": edge}, skins=frozenset(["ground"])
    )
    body = solid_body.build(raw)
    _, y, z = body.mesh.doflocs
    np.testing.assert_array_equal(body.node_sets["ground"], np.flatnonzero(z == 0))
    np.testing.assert_array_equal(body.node_sets["edge"], np.flatnonzero((z == 0) & (y == 0)))
    assert area(body.mesh, body.mesh.boundaries["ground"]) == pytest.approx(4.0)
    assert "edge" not in body.mesh.boundaries


@pytest.mark.faults
@pytest.mark.parametrize(("version", "binary"), [(4.1, 1), (4.1, 0), (2.2, 0)])
def test_a_damaged_file_is_read_or_refused_in_one_sentence(tmp_path, version, binary):
    """Cut anywhere, one bit turned, some bytes lost."""
    path = tmp_path / "box.msh"
    with session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], name="box")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    full, rng = path.read_bytes(), np.random.default_rng(3)
    refusals = []
    for place in rng.integers(0, len(full) - 8, 6):
        turned = bytearray(full)
        turned[place] ^= 1 << int(rng.integers(8))
        for damaged in (full[:place], bytes(turned), full[:place] + full[place + 3 :]):
            path.write_bytes(damaged)
            try:
                for body in foreign_file.read(path).bodies.values():
                    assert np.isfinite(quality(body.mesh).volume)
            except ValueError as refusal:
                refusals.append(str(refusal))
    assert len(refusals) > 6
    assert not any("\n" in message for message in refusals)


def test_binary_numbers_that_look_like_a_section_cut_no_file_short(tmp_path):
    path = tmp_path / "box.msh"
    path.write_bytes(b"$MeshFormat\n4.1 1 8\n$EndMeshFormat\n$Nodes\n\x01\n$G\n\x02\n$EndNodes\n")
    msh._check(path)
    path.write_bytes(path.read_bytes().replace(b"$EndNodes", b""))
    with pytest.raises(ValueError, match=r"it ends inside \$Nodes"):
        msh._check(path)
    nodes = "".join(f"{k + 1} {k & 1} {k & 2} {k & 4}\n" for k in (*range(8), 7))
    path.write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n{nodes}$EndNodes\n")
    with pytest.raises(ValueError, match="duplicate node 8"):
        foreign_file.read(path)
