"""Every part in geometry/ keeps the promises that the rest of the house builds on."""

import dataclasses
import inspect
import sys

import numpy as np
import pytest

from tribodyn.geometry import gmsh_session, mesh as mesh_file, parts


@pytest.fixture(scope="module", params=parts.names())
def part(request):
    return parts.load(request.param)


@pytest.fixture(scope="module")
def built(part, tmp_path_factory):
    path = tmp_path_factory.mktemp(part.__name__) / "part.msh"
    part.build(part.Parameters(), path)
    return mesh_file.read(path)


def test_beam_is_found_and_shared_modules_are_not():
    assert "beam" in parts.names()
    assert not {"mesh", "blocks", "grid", "checks", "parts"} & set(parts.names())
    with pytest.raises(ValueError, match=r"there is no part 'bean': the parts are .*beam"):
        parts.load("bean")


def test_parameters_are_frozen_plain_and_documented(part):
    fields = dataclasses.fields(part.Parameters)
    assert part.Parameters.__dataclass_params__.frozen
    for entry in fields:
        assert entry.default is not dataclasses.MISSING, f"{entry.name} has no default"
        assert entry.name in inspect.getdoc(part.Parameters), f"{entry.name} is not documented"


def test_lengths_and_counts_are_validated(part):
    """Each number refuses zero-like nonsense: NaN for a float, a fraction for a count."""
    for entry in dataclasses.fields(part.Parameters):
        if isinstance(entry.default, bool) or not isinstance(entry.default, (int, float)):
            continue
        bad = 2.5 if isinstance(entry.default, int) else float("nan")
        with pytest.raises(ValueError, match=entry.name) as caught:
            part.Parameters(**{entry.name: bad})
        assert "\n" not in str(caught.value)


def test_default_mesh_is_sound(built):
    mesh, node_sets = built
    quality = mesh_file.quality(mesh)
    assert quality.scaled_jacobian > 0.2
    assert quality.volume > 0
    assert mesh.doflocs.shape[1] * 3 < 60_000
    used = np.unique(mesh.dofs.element_dofs)
    np.testing.assert_array_equal(used, np.arange(mesh.doflocs.shape[1]))
    assert len({tuple(x) for x in np.round(mesh.p.T, 12)}) > 8
    assert mesh.subdomains
    assert mesh.boundaries
    covered = np.concatenate(list(mesh.subdomains.values()))
    assert set(covered) == set(range(mesh.nelements))
    for name, nodes in node_sets.items():
        assert len(nodes), name
        assert (np.diff(nodes) > 0).all(), name


def test_building_twice_gives_the_same_mesh(part, built, tmp_path):
    part.build(part.Parameters(), tmp_path / "again.msh")
    mesh, node_sets = mesh_file.read(tmp_path / "again.msh")
    np.testing.assert_array_equal(mesh.doflocs, built[0].doflocs)
    assert set(node_sets) == set(built[1])


def test_gmsh_without_its_libraries_is_one_sentence(monkeypatch):
    class Broken:
        def find_spec(self, name, path=None, target=None):
            if name == "gmsh":
                raise OSError("libGLU.so.1: cannot open shared object file")

    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    expected = pytest.raises(ValueError, match=r"gmsh cannot be loaded \(libGLU.*install its system libraries")
    with expected, gmsh_session.session():
        pass


def test_a_session_ends_when_its_body_fails():
    gmsh = pytest.importorskip("gmsh")
    with pytest.raises(RuntimeError, match="inside"), gmsh_session.session():
        raise RuntimeError("inside")
    assert not gmsh.isInitialized()
