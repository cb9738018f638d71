"""The mesh reader against what Gmsh's own mesher writes: shape, node numbering, groups, quality, refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skfem

from tribodyn.geometry import bolt, mesh as mesh_file, nut
from tribodyn.geometry.gmsh_session import save, session
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation
from tribodyn.geometry.placement import overlap

EDGES = (1.0, 0.7, 0.4)
CELLS = ("tetra10", "hexahedron20", "hexahedron27")


def box(path: Path, cell: str, order: int = 2, skew: float = 0.0) -> Path:
    """Mesh a box with Gmsh's CAD kernel; groups of all four dimensions."""
    with session() as gmsh:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", cell == "hexahedron20")
        geo = gmsh.model.occ
        volume = geo.addBox(0, 0, 0, *EDGES)
        geo.synchronize()
        if cell.startswith("hexahedron"):
            for _, tag in gmsh.model.getEntities(1):
                gmsh.model.mesh.setTransfiniteCurve(tag, 4)
            for dimension, tag in gmsh.model.getEntities(2):
                gmsh.model.mesh.setTransfiniteSurface(tag)
                gmsh.model.mesh.setRecombine(dimension, tag)
            gmsh.model.mesh.setTransfiniteVolume(volume)
        else:
            gmsh.option.setNumber("Mesh.MeshSizeMax", 0.35)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)

        def at(dimension: int, **place: float) -> list[int]:
            rows = []
            for _, tag in gmsh.model.getEntities(dimension):
                bounds = np.array(gmsh.model.getBoundingBox(dimension, tag)).reshape(2, 3)
                if all(np.allclose(bounds[:, "xyz".index(axis)], value, atol=1e-6) for axis, value in place.items()):
                    rows.append(tag)
            return rows

        for dimension, tags, name in (
            (3, [volume], "box"),
            (2, at(2, x=0.0), "left"),
            (2, at(2, z=0.0) + at(2, x=0.0), "left_and_bottom"),
            (1, at(1, y=0.0, z=0.0), "edge"),
            (0, at(0, x=1.0, y=0.7, z=0.4), "corner"),
        ):
            gmsh.model.addPhysicalGroup(dimension, tags, name=name)
        save(gmsh, path)
    return path


@pytest.fixture(params=CELLS)
def read_box(request, tmp_path):
    return request.param, *mesh_file.read(box(tmp_path / "box.msh", request.param))


def test_box_has_its_volume_and_faces_their_area(read_box):
    _, mesh, _ = read_box
    assert mesh_file.quality(mesh).volume == pytest.approx(np.prod(EDGES), rel=1e-12)
    remaining, two_results = (mesh.boundaries[name] for name in ("left", "left_and_bottom"))
    assert mesh_file.area(mesh, remaining) == pytest.approx(0.7 * 0.4, rel=1e-12)
    assert mesh_file.area(mesh, two_results) == pytest.approx(0.7 * 0.4 + 0.7, rel=1e-12)
    far = replace(mesh, doflocs=1e-4 * mesh.doflocs + 1.0)  # as a small face at the rim of a wheel
    assert mesh_file.area(far, remaining) == pytest.approx(1e-8 * 0.7 * 0.4, rel=1e-9)


def test_node_numbering_is_right_quadratics_are_reproduced(read_box):
    """A permuted midside node would spoil the interpolation of a quadratic, and its gradient."""
    _, mesh, _ = read_box
    basis = skfem.Basis(mesh, mesh.elem(), intorder=6)
    x, y, z = mesh.doflocs
    assert np.allclose(basis.doflocs, mesh.doflocs)
    field = basis.interpolate(1 + 2 * x - y + x * y + z**2 - 3 * x * z + y**2)
    u, v, w = np.asarray(basis.global_coordinates())
    np.testing.assert_allclose(np.asarray(field), 1 + 2 * u - v + u * v + w**2 - 3 * u * w + v**2, atol=1e-12)
    np.testing.assert_allclose(field.grad[0], 2 + v - 3 * w, atol=1e-11)
    np.testing.assert_allclose(field.grad[2], 2 * w - 3 * u, atol=1e-11)


def test_groups_of_every_dimension_hold_all_their_nodes(read_box):
    _, mesh, node_sets = read_box
    x, y, z = mesh.doflocs
    expected = {
        "box": np.arange(mesh.doflocs.shape[1]),
        "left": np.flatnonzero(abs(x) < 1e-9),
        "left_and_bottom": np.flatnonzero((abs(x) < 1e-9) | (abs(z) < 1e-9)),
        "edge": np.flatnonzero((abs(y) < 1e-9) & (abs(z) < 1e-9)),
        "corner": np.flatnonzero((x > 1 - 1e-9) & (y > 0.7 - 1e-9) & (z > 0.4 - 1e-9)),
    }
    assert set(node_sets) == set(expected)
    for name, nodes in expected.items():
        np.testing.assert_array_equal(node_sets[name], nodes, err_msg=name)
    assert set(mesh.boundaries) == {"left", "left_and_bottom"}
    np.testing.assert_array_equal(mesh.subdomains["box"], np.arange(mesh.nelements))


def test_curved_twenty_node_hexahedra_keep_their_volume(tmp_path):
    """A quarter of a thick ring: 20 and 27 nodes describe nearly the same body, both close to the true volume."""
    volumes = {}
    for cell in CELLS[1:]:
        with session() as gmsh:
            gmsh.option.setNumber("Mesh.SecondOrderIncomplete", cell == "hexahedron20")
            face = gmsh.model.occ.addRectangle(1.0, 0.0, 0.0, 0.5, 0.5)
            out = gmsh.model.occ.revolve([(2, face)], 0, 0, 0, 0, 1, 0, np.pi / 2, [6], recombine=True)
            gmsh.model.occ.synchronize()
            for _, tag in gmsh.model.getBoundary([(2, face)], oriented=False):
                gmsh.model.mesh.setTransfiniteCurve(tag, 3)
            gmsh.model.mesh.setTransfiniteSurface(face)
            gmsh.model.mesh.setRecombine(2, face)
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
            gmsh.model.addPhysicalGroup(3, [tag for dimension, tag in out if dimension == 3], name="ring")
            save(gmsh, tmp_path / "ring.msh")
        mesh, _ = mesh_file.read(tmp_path / "ring.msh")
        volumes[cell] = mesh_file.quality(mesh).volume
    exact = np.pi / 4 * (1.5**2 - 1.0) * 0.5
    assert volumes["hexahedron20"] == pytest.approx(exact, rel=1e-4)
    assert volumes["hexahedron27"] == pytest.approx(exact, rel=1e-4)


def test_scaled_jacobian_of_known_shapes():
    cube = skfem.MeshHex2()
    assert mesh_file.quality(cube).scaled_jacobian == pytest.approx(1.0)
    angle = np.radians(30.0)
    sheared = replace(cube, doflocs=np.array([[1, np.sin(angle), 0], [0, np.cos(angle), 0], [0, 0, 1]]) @ cube.doflocs)
    assert mesh_file.quality(sheared).scaled_jacobian == pytest.approx(np.cos(angle))
    assert mesh_file.quality(sheared).volume == pytest.approx(np.cos(angle))
    regular = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1.0]]).T
    tetrahedron = skfem.MeshTet2.from_mesh(skfem.MeshTet1(regular, np.array([[0], [1], [2], [3]])))
    assert mesh_file.quality(tetrahedron).scaled_jacobian == pytest.approx(1.0)


def test_inverted_and_collapsed_elements_are_refused():
    cube = skfem.MeshHex2()
    bent = cube.doflocs.copy()
    bent[0, np.flatnonzero((bent == 0.5).all(axis=0))] = 1.2  # the middle node leaves through a face
    flat = cube.doflocs * np.array([[1.0], [1.0], [0.0]])
    for doflocs in (bent, flat):
        with pytest.raises(ValueError, match="1 of 1 mesh elements are inverted"):
            mesh_file.quality(replace(cube, doflocs=doflocs))
    pair = skfem.MeshHex2.from_mesh(skfem.MeshHex1.init_tensor(np.array([0.0, 1.0, 3.0]), *[np.array([0.0, 1.0])] * 2))
    turned = pair.doflocs.copy()
    turned[0, turned[0] < 1.0] += 2 * (1.0 - turned[0, turned[0] < 1.0])  # folded back over its neighbour
    assert mesh_file.quality(pair).volume == pytest.approx(3.0)
    with pytest.raises(ValueError, match="1 of 2 mesh elements are inverted"):
        mesh_file.quality(replace(pair, doflocs=turned))


@pytest.mark.parametrize(("name", "text"), [
    ("garbage.msh", "hello\nworld\n"),
    ("empty.msh", ""),
    ("broken.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2"),
    ("garbage.vtk", "hello"),
    ("garbage.unknown", "hello"),
])  # fmt: skip
def test_what_is_no_mesh_is_refused_in_a_sentence(name, text, tmp_path, capfd):
    with pytest.raises(ValueError, match=f"{name}' does not exist"):
        mesh_file.read(tmp_path / name)
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=rf"mesh file '.*{name}' cannot be read.*: write it as a Gmsh file"):
        mesh_file.read(tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_permutation_refuses_different_elements():
    reference = REFERENCE_POINTS["tetra10"]
    shuffled = reference[[3, 1, 2, 0, 9, 8, 7, 6, 5, 4]]
    np.testing.assert_array_equal(reference[permutation(reference, shuffled)], shuffled)
    with pytest.raises(ValueError, match="same element"):
        permutation(reference, 2 * reference - 1)


def test_a_body_that_reaches_into_another_is_found_and_one_that_touches_or_is_pressed_in_is_not() -> None:
    """Share of elements whose middle lies in the other: a half, in place and turned; none of a shaft in its bore."""
    line = np.linspace
    lower = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(line(0, 1, 5), line(0, 1, 5), line(0, 1, 5)))
    for low, share in ((0.5, 0.5), (1.0, None), (0.9999, None)):
        upper = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(line(0, 1, 4), line(0, 1, 4), line(low, low + 1, 5)))
        turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
        for R in (np.eye(3), turn):
            pair = [replace(mesh, doflocs=R @ mesh.doflocs) for mesh in (upper, lower)]
            for item, other in (pair, pair[::-1]):
                result = overlap(item, other)
                assert (result is None) if share is None else result[0] == pytest.approx(share, abs=0.05)
    box = skfem.MeshHex.init_tensor(line(-2, 2, 9), line(-2, 2, 9), line(0, 1, 2))
    ring, shaft = (
        skfem.MeshHex2.from_mesh(box.restrict(lambda x, out=out: (np.abs(x[:2]).max(axis=0) > 1) == out))
        for out in (True, False)
    )
    assert overlap(ring, shaft) is None
    assert overlap(shaft, ring) is None


def test_bolt_and_nut_of_few_elements_do_not_overlap(tmp_path: Path):
    """Six elements around a bore: the middles of their corners lie inside the shank, those of the elements do not."""
    paths = [tmp_path / f"{name}.msh" for name in ("bolt", "nut")]
    bolt.build(bolt.Parameters(), paths[0])
    nut.build(nut.Parameters(n_around=6), paths[1])
    shank, ring = (mesh_file.read(path)[0] for path in paths)
    lower = bolt.Parameters().grip + bolt.Parameters().nut_height
    fixed = replace(ring, doflocs=ring.doflocs - np.array([[0.0], [0.0], [lower]]))
    assert overlap(shank, fixed) is None
    assert overlap(fixed, shank) is None
    neglected = replace(fixed, doflocs=fixed.doflocs + np.array([[2e-3], [0.0], [0.0]]))
    assert overlap(neglected, shank) is not None
