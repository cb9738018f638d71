"""Relative coordinates change nothing but the number of masters."""

from dataclasses import replace

import numpy as np
import pytest

from tribodyn.fem import part as fem_part
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.interface import COMPONENTS
from tribodyn.fem.load_vectors import NodalForce
from tribodyn.fem.material import Material
from tribodyn.fem.springs import Spring
from tribodyn.geometry import blocks, mesh as mesh_file
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.relative import relative

CONTACT = np.full((25, 3), 2e7)


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    return built(tmp_path_factory.mktemp("relative") / "blocks.msh")


def built(path):
    """Two steel blocks one above the other, on springs; 5 x 5 node pairs in an inclined frame."""
    line, up, tall = np.linspace(0.0, 0.02, 3), np.linspace(0.0, 0.03, 3), np.linspace(0.03, 0.075, 4)

    def lean(at):
        return at + 0.1 * at[:, [2]] * [1.0, 0.0, 0.0]

    def tilt(at):
        x, y, z = lean(at).T
        return np.column_stack([x, y, z + 0.2 * y])

    corner = tilt(np.array([[0.0, 0.0, 0.075]]))
    block = blocks.Block(line, line, tall, "upper", {"w-": "bottom", "w+": "lid"}, tilt)
    upper = blocks.body([block], {"point": corner})
    lower = blocks.body([blocks.Block(line, line, up, "lower", {"w+": "top", "w-": "base"}, tilt)])
    blocks.write(path, upper, lower)
    mesh, sets = mesh_file.read(path)
    springs = [Spring(name, axis, 3e7) for name in ("lid", "base") for axis in np.eye(3)]
    return fem_part.build(
        mesh, sets, Material(200e9, 0.3, 7900.0), [], [ContactFaces("bottom", (1.0, 0.3, 0.0), "top")],
        {"push": NodalForce("point", (1, 0, 0))}, {"tip": NodalForce("point", (0, 0, 1))}, springs=springs,
    )  # fmt: skip


def test_full_model_is_the_same_in_other_coordinates(part):
    system, interface, T = relative(part.system, part.interface)
    for springs in (None, CONTACT):
        expected, shapes = linear_modes(part, springs, 6)
        result, shifted = linear_modes(ReducedModel(system, interface), springs, 6)
        np.testing.assert_allclose(result, expected, rtol=1e-8)
        equal = np.abs(np.sum((T @ shifted) * (part.system.mass @ shapes), axis=0))
        np.testing.assert_allclose(equal, 1.0, atol=1e-6)
    q = np.random.default_rng(0).normal(size=system.n_dof)
    np.testing.assert_allclose(interface.B @ q, part.interface.B @ (T @ q), atol=1e-12)
    np.testing.assert_allclose(system.loads["push"] @ q, part.system.loads["push"] @ (T @ q))
    np.testing.assert_allclose(system.outputs["tip"] @ q, part.system.outputs["tip"] @ (T @ q))


def test_reduced_model_needs_half_the_masters(part):
    two_results = craig_bampton(part.system, part.interface, n_modes=25)
    system, interface, _ = relative(part.system, part.interface)
    half = craig_bampton(system, interface, n_modes=25)
    assert (len(two_results.origin.masters), len(half.origin.masters)) == (152, 77)
    assert set(np.unique(half.interface.B)) == {0.0, 1.0}
    np.testing.assert_array_equal(half.interface.B.sum(axis=1), 1.0)
    for springs in (None, CONTACT):
        exact = linear_modes(part, springs, 6)[0]
        np.testing.assert_allclose(linear_modes(two_results, springs, 6)[0], exact, rtol=2e-3)
        np.testing.assert_allclose(linear_modes(half, springs, 6)[0], exact, rtol=2e-3)


def test_bad_contacts_are_refused_in_one_sentence(part):
    with pytest.raises(ValueError, match="need contact components t1, t2, n"):
        relative(part.system, replace(part.interface, components=COMPONENTS[:2], B=part.interface.B[:50]))
    blind = part.interface.B.tolil()
    blind[:3] = 0.0
    with pytest.raises(ValueError, match="free in x, y and z"):
        relative(part.system, replace(part.interface, B=blind.tocsr()))
    i = part.interface
    twice = replace(i, points=i.points[[0, 0]], frames=i.frames[[0, 0]], area=i.area[[0, 0]], gap=i.gap[[0, 0]])
    with pytest.raises(ValueError, match="two pairs share one"):
        relative(part.system, replace(twice, B=i.B[[0, 1, 2, 0, 1, 2]]))
