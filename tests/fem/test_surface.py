"""Surfaces, contact interfaces and loads against hand calculations."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import batches
from tribodyn.fem.interface import contact_frames, join
from tribodyn.fem.load_vectors import BodyForce, Centrifugal, NodalForce, Pressure
from tribodyn.fem.material import Material
from tribodyn.fem.surface import face_integrals, facet_nodes, surface

STEEL = Material(210e9, 0.3, 7860.0)


def block(nx=2, ny=1, nz=1, tets=False):
    """Block 2 x 1 x 1 with its faces named."""
    axes = (np.linspace(0, 2, nx + 1), np.linspace(0, 1, ny + 1), np.linspace(0, 1, nz + 1))
    mesh = (
        skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*axes))
        if tets
        else skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*axes))
    )
    return mesh.with_boundaries(
        { "left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 2 - 1e-9, "bottom": lambda x: x[2] < 1e-9,
        "top": lambda x: x[2] > 1 - 1e-9, }
    )  # fmt: skip


def two_blocks(shift=0.0):
    """Two cubes, one on top of the other, that share no nodes; the lower one 1 m wider in y."""
    upper = skfem.MeshHex.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 3), [1.0, 2.0])
    lower = skfem.MeshHex.init_tensor(np.linspace(0, 1, 3) + shift, np.linspace(0, 2, 5), [0.0, 1.0])
    p = np.hstack([upper.p, lower.p])
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex(p, np.hstack([upper.t, lower.t + upper.p.shape[1]])))
    body = mesh.p[:, mesh.t[:, mesh.f2t[0]]].mean(axis=1)[2]
    middle = mesh.p[:, mesh.facets].mean(axis=1)[2]
    at = np.abs(middle - 1) < 1e-9
    return mesh.with_boundaries({"upper": np.flatnonzero(at & (body > 1)), "lower": np.flatnonzero(at & (body < 1))})


def test_nine_node_face_areas():
    mesh = block(1, 1, 1)
    face = surface(mesh, mesh.boundaries["bottom"])
    nodes = facet_nodes(mesh, mesh.boundaries["bottom"])[0]
    expected = dict(zip(nodes, [1 / 36] * 4 + [4 / 36] * 4 + [16 / 36], strict=True))
    assert face.area == pytest.approx([2 * expected[n] for n in face.nodes], rel=1e-13)
    assert face.normals == pytest.approx(np.tile([0, 0, -1.0], (9, 1)), abs=1e-14)
    assert face.faces.shape == (4, 4)
    corners = face.points[face.faces]
    d = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    assert np.linalg.norm(d, axis=1) == pytest.approx(np.full(4, 0.5))


def test_edge_nodes_lie_between_their_corners():
    for mesh in (block(2, 2, 2), block(2, 2, 2, tets=True)):
        for name in mesh.boundaries:
            x = mesh.doflocs.T[facet_nodes(mesh, mesh.boundaries[name])]
            k = 4 if x.shape[1] == 9 else 3
            assert x[:, k : 2 * k] == pytest.approx((x[:, :k] + np.roll(x[:, :k], -1, axis=1)) / 2)


@pytest.mark.parametrize("tets", [False, True])
def test_vertex_only_grid(tets):
    mesh = block(4, 3, 2, tets)
    face = surface(mesh, mesh.boundaries["top"], vertices_only=True)
    assert len(face.nodes) == 20
    assert face.area.min() > 0
    assert face.area.sum() == pytest.approx(2.0, rel=1e-13)
    assert face.faces.shape == ((24, 3) if tets else (12, 4))


def test_curved_surface_converges_to_the_cylinder():
    """Area and normals of a half cylinder of radius 1 and length 1."""
    errors = []
    for n in (4, 8):
        flat = skfem.MeshHex2.from_mesh(
            skfem.MeshHex.init_tensor(np.linspace(0, np.pi, n + 1), np.linspace(0, 1, 3), [1.0, 1.2])
        )
        angle, y, r = flat.doflocs
        mesh = skfem.MeshHex2(np.stack([r * np.cos(angle), y, r * np.sin(angle)]), flat.t)
        radius = np.linalg.norm(mesh.p[::2][:, mesh.facets], axis=0).max(axis=0)
        inner = np.flatnonzero((radius < 1 + 1e-9) & (mesh.f2t[1] < 0))
        face = surface(mesh, inner)
        radial = -face.points * [1, 0, 1]
        errors.append([abs(face.area.sum() - np.pi), np.abs(face.normals - radial).max()])
        frames = contact_frames(face.normals, (0, 1, 0))
        assert frames @ frames.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (len(frames), 1, 1)), abs=1e-14)
        assert np.linalg.det(frames) == pytest.approx(np.ones(len(frames)))
    order = np.log2(np.array(errors[0]) / errors[1])
    assert order[0] > 3.7
    assert order[1] > 1.7
    assert errors[1][0] < 1e-4


def test_ground_contact_closes_along_the_outward_normal():
    mesh = block()
    contact = ContactFaces("bottom", (1, 0, 0.3), gap=1e-6).build(mesh)
    assert contact.n_pair == 15
    assert contact.area.sum() == pytest.approx(2.0)
    assert (contact.gap == 1e-6).all()
    move = np.tile([1.0, 2.0, -3.0], mesh.doflocs.shape[1])
    relative = (contact.B @ move).reshape(-1, 3)
    assert relative == pytest.approx(np.tile([1.0, -2.0, 3.0], (15, 1)))  # t2 = n x t1 = -y; down closes
    normal = ContactFaces("bottom", (1, 0, 0), components=("n",)).build(mesh)
    assert (contact.B[2::3] != normal.B).nnz == 0
    assert normal.stiffness(1.0, 5.0).sum() == pytest.approx(5.0)


def test_pair_contact_sees_relative_motion_only():
    mesh = two_blocks()
    contact = ContactFaces("upper", (1, 0, 0), "lower", pairing="nodes").build(mesh)
    assert contact.n_pair == 25
    assert contact.area.sum() == pytest.approx(1.0)
    x = mesh.doflocs.T
    rigid = (np.array([0.1, 0.2, 0.3]) + np.cross([1.0, -2.0, 0.5], x)).ravel()
    assert np.abs(contact.B @ rigid).max() < 1e-14
    upper_down = np.where(np.isin(np.arange(len(x)), np.unique(mesh.dofs.element_dofs[:, :4])), -1.0, 0.0)
    move = np.stack([0 * upper_down, 0 * upper_down, upper_down], axis=1).ravel()
    assert (contact.B @ move).reshape(-1, 3) == pytest.approx(np.tile([0, 0, 1.0], (25, 1)))


def test_pair_contact_names_what_does_not_match():
    mesh = two_blocks(shift=0.1)
    with pytest.raises(ValueError, match="25 of 25 nodes of the first have no partner"):
        ContactFaces("upper", (1, 0, 0), "lower", pairing="nodes").build(mesh)
    mesh = two_blocks()
    with pytest.raises(ValueError, match="20 of 45 nodes"):
        ContactFaces("lower", (1, 0, 0), "upper", pairing="nodes").build(mesh)


def test_cyclic_halves():
    """A quarter ring whose end faces meet after a quarter turn: turning as a whole makes no relative motion."""
    flat = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(np.linspace(0, np.pi / 2, 4), [1.0, 2.0], [0.0, 1.0]))
    angle, r, z = flat.doflocs
    mesh = skfem.MeshHex2(np.stack([r * np.cos(angle), r * np.sin(angle), z]), flat.t)
    mesh = mesh.with_boundaries({"start": lambda x: x[1] < 1e-9, "end": lambda x: x[0] < 1e-9})
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # carries the start face onto the end face
    contact, B_2 = ContactFaces("end", (0, 0, 1), "start", turn=turn.T).halves(mesh)
    spin = np.cross([0, 0, 1.0], mesh.doflocs.T).ravel()
    lift = np.tile([0, 0, 1.0], mesh.doflocs.shape[1])
    for equal in (spin, lift):  # every sector does the same in its own coordinates
        assert contact.B @ equal == pytest.approx(B_2 @ equal, abs=1e-14)
    assert (contact.B @ spin).reshape(-1, 3)[:, 2].min() > 0.99  # this sector closes on the next


def test_contacts_join():
    mesh = block()
    item = ContactFaces("bottom", (1, 0, 0)).build(mesh)
    pair = ContactFaces("top", (1, 0, 0), gap=1e-5).build(mesh)
    text = join([item, pair])
    assert text.n_pair == 30
    assert text.points[text.faces[8:]][..., 2] == pytest.approx(np.ones((8, 4)))
    assert text.gap[15:] == pytest.approx(pair.gap)
    assert (text.B[45:] != pair.B).nnz == 0
    with pytest.raises(ValueError, match="same components"):
        join([item, replace(pair, components=("n",))])


def test_a_face_of_tetrahedra_has_its_pairs_at_its_sides():
    mesh = block(tets=True)
    contact = ContactFaces("bottom", (1, 0, 0)).build(mesh)
    sides = np.unique(mesh.f2e[:, mesh.boundaries["bottom"]])
    assert contact.n_pair == len(sides)
    assert contact.area.sum() == pytest.approx(2.0, rel=1e-12)
    # drawn, the triangles between the sides leave out the small ones at the rim alone
    a, b, c = np.moveaxis(contact.points[contact.faces], 1, 0)
    drawn = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert 1.2 < drawn < 2.0
    assert len(np.unique(np.sort(contact.faces, axis=1), axis=0)) == len(contact.faces)


@pytest.mark.parametrize(("face", "t1", "changes", "message"), [
    ("none", (1, 0, 0), {}, "empty"),
    ("inner", (1, 0, 0), {}, "inside the body"),
    ("bottom", (0, 0, 1), {}, "along the contact normal"),
    ("bottom", (0, 0, 0), {}, "not all zero"),
    ("bottom", (1, 0, 0), {"components": ("n", "t1")}, "in this order"),
    ("bottom", (1, 0, 0), {"gap": np.zeros(3)}, "3 values for 15 node pairs"),
    ("bottom", (1, 0, 0), {"plane": (0, 0, -1), "inclination": np.pi / 2}, "inclination"),
    ("bottom", (1, 0, 0), {"inclination": 0.1}, "plane ground"),
    ("bottom", (1, 0, 0), {"opposite": "top", "pairing": "magnets"}, "there are auto, nodes, mortar"),
    ("bottom", (1, 0, 0), {"opposite": "top", "plane": (0, 0, -1)}, "exclude each other"),
])  # fmt: skip
def test_contact_refuses(face, t1, changes, message):
    mesh = block()
    extra = {"none": np.zeros(0, int), "inner": np.flatnonzero(mesh.f2t[1] >= 0)}
    mesh = mesh.with_boundaries({**mesh.boundaries, **extra})
    with pytest.raises(ValueError, match=message):
        ContactFaces(face, t1, **changes).build(mesh)


@pytest.mark.parametrize("tets", [False, True])
def test_load_resultants(tets):
    mesh = block(3, 2, 2, tets)
    x = mesh.doflocs.T
    sets = {"tip": np.flatnonzero(x[:, 0] > 2 - 1e-9), "none": np.array([], dtype=int)}
    M, _ = assemble(mesh, STEEL)

    def resultant(load):
        force = load.vector(mesh, sets, M).reshape(-1, 3)
        return force.sum(axis=0), np.cross(x, force).sum(axis=0)

    force, _ = resultant(NodalForce("tip", (0, 3, 4)))
    assert force == pytest.approx([0, 0.6, 0.8])
    force, moment = resultant(Pressure("top"))
    assert force == pytest.approx([0, 0, -2], abs=1e-13)
    assert moment == pytest.approx([-1, 2, 0], abs=1e-13)
    force, moment = resultant(BodyForce((0, 0, -1)))
    assert force == pytest.approx([0, 0, -2 * 7860], abs=1e-9)
    force, moment = resultant(Centrifugal((0, 0, 1)))
    assert force == pytest.approx([2 * 7860, 7860, 0], abs=1e-9)  # mass times the arm of the centre of gravity
    force, _ = resultant(Centrifugal((0, 0, 2), point=(1, 0.5, 9)))
    assert force == pytest.approx([0, 0, 0], abs=1e-8)
    with pytest.raises(ValueError, match="no node set 'root'; it has none, tip"):
        resultant(NodalForce("root", (1, 0, 0)))
    with pytest.raises(ValueError, match="'none' is empty"):
        resultant(NodalForce("none", (1, 0, 0)))
    with pytest.raises(ValueError, match="no face 'side'"):
        resultant(Pressure("side"))


def test_consistent_integrals_of_a_warped_face_point_outward():
    mesh = block(3, 2, 2)
    warped = skfem.MeshHex2(mesh.doflocs + 0.05 * np.sin(2 * mesh.doflocs[[1, 2, 0]]), mesh.t)
    _, vectors = face_integrals(warped, warped.boundary_facets())
    assert np.abs(vectors.sum(axis=(0, 1))).max() < 1e-13  # a closed surface
    points = warped.doflocs.T[facet_nodes(warped, warped.boundary_facets())]
    volume = np.einsum("fax,fax->", vectors, points) / 3  # Gauss: integral of x . n
    assert volume == pytest.approx(sum(weight.sum() for *_, weight in batches(warped)), rel=1e-12)
