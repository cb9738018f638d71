"""The beam's contact patch, named nodes, and its first bending frequency."""

import numpy as np
import pytest
import skfem

from tribodyn.fem.elasticity import assemble
from tribodyn.fem.material import Material
from tribodyn.fem.modes import modes
from tribodyn.geometry import mesh as mesh_file
from tribodyn.workflows.cases.beam import beam


def read(tmp_path, **changes):
    beam.build(beam.Parameters(**changes), tmp_path / "beam.msh")
    return mesh_file.read(tmp_path / "beam.msh")


def first_frequency(mesh) -> float:
    """Lowest natural frequency of the clamped steel beam [Hz]."""
    mass, stiffness = assemble(mesh, Material(210e9, 0.3, 7860.0))
    fixed = 3 * mesh.dofs.get_facet_dofs(mesh.boundaries["clamp"]).flatten()[:, None] + np.arange(3)
    free = np.setdiff1d(np.arange(mass.shape[0]), fixed)
    return float(modes(stiffness[free][:, free], mass[free][:, free], 1)[0][0] / (2 * np.pi))


def test_patch_has_the_grid_of_the_thesis(tmp_path):
    mesh, node_sets = read(tmp_path)
    patch = mesh.doflocs[:, node_sets["contact"]]
    assert patch.shape[1] == 169
    np.testing.assert_allclose(patch[2], 0.0, atol=1e-15)
    path, across = (np.unique(np.round(patch[i], 9)) for i in (0, 1))
    assert len(path) == len(across) == 13
    np.testing.assert_allclose([path[0], path[-1], across[0], across[-1]], [0.18, 0.2, 0.0, 0.02])
    for line in (path, across):
        steps = np.diff(line)
        np.testing.assert_allclose(steps, steps[::-1], rtol=1e-6)
        np.testing.assert_allclose(steps[::2], steps[1::2], rtol=1e-6)  # midside nodes stand in the middle
        assert (np.diff(steps[:6:2]) > 0).all()  # finer towards the boundary
    faces = skfem.FacetBasis(mesh, mesh.elem(), facets=mesh.boundaries["contact"], intorder=4)
    weights = skfem.LinearForm(lambda v, w: v).assemble(faces)[node_sets["contact"]]
    assert weights.min() > 0
    assert weights.sum() == pytest.approx(0.02 * 0.02)


@pytest.mark.parametrize("changes", [
    {},
    {"n_patch": 3, "n_length": 2, "n_height": 1},
    {"n_patch": 11, "n_length": 7, "n_height": 3, "height_grading": 3.0, "grading": 5.0},
    {"length": 0.31, "width": 0.06, "height": 0.01, "patch_length": 0.15, "n_length": 3, "n_height": 2},
])  # fmt: skip
def test_named_nodes_stand_where_they_should(tmp_path, changes):
    p = beam.Parameters(**changes)
    mesh, node_sets = read(tmp_path, **changes)
    places = {
        "static_load": (p.length / 2, p.width / 2, p.height),
        "shaker": (p.length / 2, p.width, p.height / 2),
        "response": (p.length - p.patch_length / 2, p.width / 2, 0.0),
    }
    for name, place in places.items():
        assert len(node_sets[name]) == 1
        np.testing.assert_allclose(mesh.doflocs[:, node_sets[name][0]], place, atol=1e-12)
    assert node_sets["response"][0] in node_sets["contact"]
    assert len(node_sets["contact"]) == p.n_patch**2
    np.testing.assert_allclose(mesh.doflocs[0, node_sets["clamp"]], 0.0, atol=1e-15)
    assert mesh_file.quality(mesh).volume == pytest.approx(p.length * p.width * p.height, rel=1e-12)


def test_first_frequency_converges_to_the_solid_block(tmp_path):
    """416.06 Hz is the converged solid model; a displacement model comes down to it."""
    coarse = first_frequency(read(tmp_path, n_patch=5, n_length=4, n_height=1)[0])
    middle = first_frequency(read(tmp_path, n_patch=7, n_length=8, n_height=2)[0])
    default = first_frequency(read(tmp_path)[0])
    assert coarse > middle > default > 416.06
    assert default == pytest.approx(416.06, rel=4e-3)


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"length": 0.0}, r"geometry\.length is 0\.0: give a number above zero"),
    ({"height": float("nan")}, r"geometry\.height is nan"),
    ({"grading": -1.0}, r"geometry\.grading is -1\.0"),
    ({"n_patch": 12}, r"geometry\.n_patch is 12: give an odd number of nodes, 11 or 13"),
    ({"n_patch": 1}, r"geometry\.n_patch is 1: give a whole number of at least 3"),
    ({"n_height": 1.5}, r"geometry\.n_height is 1\.5: give a whole number"),
    ({"n_length": True}, r"geometry\.n_length is True"),
    ({"patch_length": 0.1}, r"geometry\.patch_length is 0\.1: keep it below half"),
])  # fmt: skip
def test_bad_parameters_are_refused_in_a_sentence(changes, sentence):
    with pytest.raises(ValueError, match=sentence) as caught:
        beam.Parameters(**changes)
    assert "\n" not in str(caught.value)
