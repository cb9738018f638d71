"""Mapped blocks and graded lines: joining, mirroring, names, refusals."""

import numpy as np
import pytest
import skfem

from tribodyn.geometry import blocks, mesh as mesh_file

LINE = np.linspace(0.0, 1.0, 4)


def read(path, *bodies):
    blocks.write(path, *bodies)
    return mesh_file.read(path)


@pytest.mark.parametrize("n", [1, 2, 5, 6, 9])
@pytest.mark.parametrize("grading", [0.4, 1.0, 2.0, 7.0])
def test_graded_lines(n, grading):
    line = blocks.towards_ends(0.1, 0.3, n, grading)
    assert len(line) == n + 1
    assert (line[0], line[-1]) == (0.1, 0.3)
    lengths = np.diff(line)
    np.testing.assert_allclose(lengths, lengths[::-1])
    if n > 2:
        assert lengths[n // 2] / lengths[0] == pytest.approx(grading)
    one_sided = np.diff(blocks.towards_start(0.1, 0.3, n, grading))
    np.testing.assert_allclose(one_sided[1:] / one_sided[:-1], grading ** (1 / max(n - 1, 1)))
    np.testing.assert_allclose(np.diff(blocks.towards_end(0.1, 0.3, n, grading)), one_sided[::-1])


@pytest.mark.parametrize("mirror", [False, True])
def test_a_mapped_ring_closes_on_itself(tmp_path, mirror):
    """One block bent to a full ring: its two ends meet, and the volume converges to pi (R^2 - r^2) h at order 4."""

    def bend(p):
        angle = 2 * np.pi * p[:, 0] * (-1 if mirror else 1)
        return np.column_stack([(1 + p[:, 1]) * np.cos(angle), (1 + p[:, 1]) * np.sin(angle), p[:, 2]])

    errors = []
    for n in (6, 12):
        ring = blocks.Block(np.linspace(0, 1, n + 1), LINE, LINE, "ring", {"v-": "bore"}, mapping=bend)
        mesh, node_sets = read(tmp_path / "ring.msh", blocks.body([ring]))
        assert mesh.doflocs.shape[1] == 2 * n * 7 * 7
        assert len(node_sets["bore"]) == 2 * n * 7
        errors.append(abs(mesh_file.quality(mesh).volume / (3 * np.pi) - 1))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


def test_bodies_that_touch_stay_apart_and_share_names(tmp_path):
    low = blocks.body([blocks.Block(LINE, LINE, LINE, "solid", {"w+": "face_low", "w-": "outside"})])
    high = blocks.body([blocks.Block(LINE, LINE, LINE + 1, "solid", {"w-": "face_high", "w+": "outside"})])
    mesh, node_sets = read(tmp_path / "two.msh", low, high)
    assert mesh.doflocs.shape[1] == 2 * 7**3
    assert not set(node_sets["face_low"]) & set(node_sets["face_high"])
    np.testing.assert_allclose(mesh.doflocs[2, node_sets["face_low"]], mesh.doflocs[2, node_sets["face_high"]])
    assert len(node_sets["outside"]) == 2 * 49


def test_blocks_of_one_body_join_and_keep_their_volumes(tmp_path):
    parts = [blocks.Block(LINE, LINE, LINE, "steel"), blocks.Block(LINE + 1, LINE, LINE, "brass")]
    mesh, node_sets = read(tmp_path / "one.msh", blocks.body(parts, points={"ends": [(0, 0, 0), (2, 1, 1)]}))
    assert mesh.doflocs.shape[1] == 13 * 7 * 7
    assert len(np.intersect1d(node_sets["steel"], node_sets["brass"])) == 49
    assert len(node_sets["ends"]) == 2
    brass = skfem.Basis(mesh, mesh.elem(), elements="brass", intorder=2)
    assert skfem.Functional(lambda w: w.x[0]).assemble(brass) == pytest.approx(1.5)


def test_surface_names_survive_as_boundaries_with_area(tmp_path):
    names = dict(zip(blocks.SIDES, ("a", "b", "c", "d", "e", "f"), strict=True))
    block = blocks.Block(LINE, 2 * LINE, 3 * LINE, "box", names)
    mesh, _ = read(tmp_path / "sides.msh", blocks.body([block]))
    item = skfem.Functional(lambda w: 1.0 + 0.0 * w.x[0])
    for name, area in zip("abcdef", (6, 6, 3, 3, 2, 2), strict=True):
        facets = skfem.FacetBasis(mesh, mesh.elem(), facets=mesh.boundaries[name], intorder=2)
        assert item.assemble(facets) == pytest.approx(area)


@pytest.mark.parametrize(("make", "sentence"), [
    (lambda: blocks.body([blocks.Block(LINE[::-1], LINE, LINE, "b")]), "u of a block in 'b' does not increase"),
    (lambda: blocks.body([blocks.Block(LINE, LINE, LINE, "b", {"x+": "s"})]), "no side 'x+'"),
    (lambda: blocks.body([blocks.Block(LINE + 3 * i, LINE, LINE, "b") for i in (0, 1)]), "fall into 2 pieces"),
    (lambda: blocks.body([blocks.Block(LINE, LINE, LINE, "b")], {"p": (0.4, 0, 0)}), "no mesh node lies at point"),
    (lambda: blocks.body([blocks.Block(LINE, LINE, LINE, "b", mapping=lambda p: p * [1, 1, 0])]), "collapses"),
    (lambda: blocks.write("never.msh", blocks.body([blocks.Block(LINE, LINE, LINE, "b", {"u-": "b"})])),
        "b names groups of different dimension"),
])  # fmt: skip
def test_refusals_are_sentences(make, sentence):
    with pytest.raises(ValueError, match=sentence.replace("+", r"\+")):
        make()
