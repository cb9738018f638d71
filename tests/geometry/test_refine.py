"""A mesh cut into elements of half the size: the same body, the same groups."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.material import Material
from tribodyn.fem.surface import surface
from tribodyn.geometry.subdivision import subdivide

L = np.linspace


def bent(tets: bool):
    """A bent block with two faces, a half of its elements, and some node sets named."""
    grid = skfem.MeshTet if tets else skfem.MeshHex
    plain = grid.init_tensor(L(0, 1, 3), L(0, 0.5, 3), L(0, 0.3, 2))
    mesh = (skfem.MeshTet2 if tets else skfem.MeshHex2).from_mesh(plain)
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    faces = {"left": np.flatnonzero(middle[0] < 1e-9), "top": np.flatnonzero(abs(middle[2] - 0.3) < 1e-9)}
    half = {"half": np.flatnonzero(mesh.p[0][mesh.t].mean(axis=0) < 0.5)}
    x, y, z = mesh.doflocs
    sets = {
        "left": np.flatnonzero(x < 1e-9),
        "edge": np.flatnonzero((x < 1e-9) & (z < 1e-9)),
        "corner": np.flatnonzero((x < 1e-9) & (y < 1e-9) & (z < 1e-9)),
        "two": np.flatnonzero((x < 1e-9) | (z < 1e-9)),
        "half": np.unique(mesh.dofs.element_dofs[:, half["half"]]),
    }
    locations = mesh.doflocs.copy()
    locations[2] += 0.3 * locations[0] ** 2
    locations[1] += 0.2 * locations[0] * locations[2]
    return replace(mesh, doflocs=locations).with_boundaries(faces).with_subdomains(half), sets


@pytest.mark.parametrize("tets", [False, True])
def test_the_refined_mesh_is_the_same_body_with_the_same_groups(tets):
    mesh, sets = bent(tets)
    fine, finer_sets = subdivide(mesh, sets)
    assert fine.nelements == 8 * mesh.nelements
    np.testing.assert_array_equal(fine.doflocs[:, : mesh.doflocs.shape[1]], mesh.doflocs)
    volume = [assemble(of, Material(1.0, 0.0, 1.0))[0].sum() / 3 for of in (mesh, fine)]
    assert volume[1] == pytest.approx(volume[0], rel=1e-12)
    for name in ("left", "top"):
        item, other = (surface(of, of.boundaries[name], vertices_only=True) for of in (mesh, fine))
        assert len(fine.boundaries[name]) == 4 * len(mesh.boundaries[name])
        assert other.area.sum() == pytest.approx(item.area.sum(), rel=1e-6)  # quadrature of a curved face
        assert other.area @ other.normals == pytest.approx(item.area @ item.normals, abs=2e-2)
    assert len(fine.subdomains["half"]) == 8 * len(mesh.subdomains["half"])
    full = np.unique(fine.dofs.element_dofs[:, fine.subdomains["half"]])
    np.testing.assert_array_equal(finer_sets["half"], full)
    remaining = np.unique(fine.dofs.get_facet_dofs(fine.boundaries["left"]).flatten())
    np.testing.assert_array_equal(finer_sets["left"], remaining)
    np.testing.assert_array_equal(finer_sets["corner"], sets["corner"])
    # bodies are bent along x only where x > 0: on the left edge nodes stay where they were
    x, _, z = fine.doflocs
    np.testing.assert_array_equal(finer_sets["edge"], np.flatnonzero((abs(x) < 1e-9) & (abs(z) < 1e-9)))
    np.testing.assert_array_equal(finer_sets["two"], np.flatnonzero((abs(x) < 1e-9) | (abs(z - 0.3 * x**2) < 1e-9)))


@pytest.mark.parametrize("tets", [False, True])
def test_what_the_mesh_can_represent_the_refined_one_can(tets):
    """The spaces are nested: a displacement of the mesh has the same strain and kinetic energy on the refined one."""
    mesh, _ = bent(tets)
    fine, _ = subdivide(mesh, {})
    steel = Material(210e9, 0.3, 7860.0)
    u = [np.stack([of.doflocs[1], 0.3 * of.doflocs[0], -of.doflocs[2]], axis=1).ravel() for of in (mesh, fine)]
    for item, other in zip(assemble(mesh, steel), assemble(fine, steel), strict=True):
        assert u[1] @ other @ u[1] == pytest.approx(u[0] @ item @ u[0], rel=1e-12)
