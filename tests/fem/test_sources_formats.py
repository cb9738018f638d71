"""The same bricks through every format give the same frequencies and the same set."""

import re
from functools import lru_cache

import numpy as np
import pytest

from tests.helpers import foreign_files
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.material import Material
from tribodyn.geometry.sources import foreign_file

FORMATS = [
    ("a.msh", "4.1"), ("b.msh", "2.2"), ("c.inp", ""), ("d.bdf", ""), ("e.cdb", ""), ("f.vtu", ""), ("g.vtk", ""),
    ("h.med", ""),
]  # fmt: skip


def squared_frequencies(mesh):
    from scipy.linalg import eigh

    M, K = assemble(mesh, Material(210e9, 0.3, 7860.0))
    return eigh(K.toarray(), M.toarray(), eigvals_only=True, subset_by_index=[6, 13])


@lru_cache(maxsize=1)
def reference():
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        mesh = foreign_files.bricks(Path(folder))
        (body,) = foreign_file.read(foreign_files.write(mesh, Path(folder) / "a.msh", "4.1")).bodies.values()
        return mesh, squared_frequencies(body.mesh)


@pytest.mark.parametrize(("name", "kind"), FORMATS)
def test_every_format_gives_the_same_frequencies_and_set(name, kind, tmp_path):
    mesh, expected = reference()
    source = foreign_file.read(foreign_files.write(mesh, tmp_path / name, kind))
    (body,) = source.bodies.values()
    np.testing.assert_allclose(squared_frequencies(body.mesh), expected, rtol=1e-7 if name == "d.bdf" else 2e-9)
    if name[-3:] not in ("msh", "med"):
        (fixed,) = (nodes for group, nodes in body.node_sets.items() if group in ("ROOT", "SET 7"))
        np.testing.assert_array_equal(fixed, np.flatnonzero(abs(body.mesh.doflocs[0]) < 1e-9))


@pytest.mark.parametrize(("name", "original", "replacement", "sentence"), [
    ("d.bdf", "GRID*                  1", "GRID*                  x", "expects a whole number"),
    ("d.bdf", "210.+9", "stiff", "expects a number, got 'stiff'"),
    ("e.cdb", "       -1\nCMBLOCK", "", "ends inside a block|broken EBLOCK"),
    ("e.cdb", "N,R5.3,LOC,       -1,", "", "broken NBLOCK"),
    ("e.cdb", "(8i10)", "(a10)", "has a broken CMBLOCK"),
    ("e.cdb", "EBLOCK,19,SOLID", "EBLOCK,10,SHELL", "no volume elements"),
    ("f.vtu", "<Points>", "<Pints>", "cannot be read"),
    ("g.vtk", "CELL_TYPES", "CELL_TIPES", "cannot be read|no volume"),
    ("c.inp", "*NODE\n1, ", "*NODE\n9999, ", "names node 1, which the deck has not"),
])  # fmt: skip
def test_broken_files_are_refused_in_one_sentence(name, original, replacement, sentence, tmp_path):
    path = foreign_files.write(reference()[0], tmp_path / name, "")
    data = path.read_bytes()
    assert original.encode() in data
    path.write_bytes(data.replace(original.encode(), replacement.encode(), 1))
    with pytest.raises(ValueError, match=sentence) as message:
        foreign_file.read(path)
    assert "\n" not in str(message.value)


@pytest.mark.parametrize("extra_fields", ["", ",7."])
def test_a_free_line_with_a_star_has_four_fields(extra_fields, tmp_path):
    plain = foreign_files.write(foreign_files.bricks(tmp_path), tmp_path / "d.bdf", "").read_text()
    at = re.compile(r"GRID\*   (.{16})(.{16})(.{16})(.{16})\*\n\*       (.{16})")
    free = at.sub(lambda g: f"GRID*,{g[1]},{g[2]},{g[3]},{g[4]},*1{extra_fields}\n*1,{g[5]}", plain)
    assert free != plain
    (tmp_path / "free.bdf").write_text(free)
    if extra_fields:
        with pytest.raises(ValueError, match="more than the four fields of a star"):
            foreign_file.read(tmp_path / "free.bdf")
        return
    base, other = (
        next(iter(foreign_file.read(tmp_path / name).bodies.values())).mesh for name in ("d.bdf", "free.bdf")
    )
    assert np.array_equal(base.doflocs, other.doflocs)
