"""Ties, couplings, lumped masses, temperature and orthotropic materials against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem.assembly import Assembly, Body
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.couplings import DistributedCoupling, Link, RigidCoupling, Tie
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import factorise
from tribodyn.fem.load_vectors import Heating, Moment, NodalForce, Pressure
from tribodyn.fem.material import Material, Orthotropic
from tribodyn.fem.modes import modes
from tribodyn.fem.part import Part, build
from tribodyn.fem.springs import Mass

STEEL = Material(210e9, 0.3, 7860.0, 12e-6)
L = np.linspace


def block(x, y, z, tets=False, linear=False):
    """A block with its six faces named, as mesh and node sets."""
    mesh = (skfem.MeshTet if tets else skfem.MeshHex).init_tensor(x, y, z)
    if not linear:
        mesh = (skfem.MeshTet2 if tets else skfem.MeshHex2).from_mesh(mesh)
    faces = {}
    for axis, line, letter in ((0, x, "x"), (1, y, "y"), (2, z, "z")):
        for at, side in ((line[0], "min"), (line[-1], "max")):
            inside = np.abs(mesh.p[axis][mesh.facets] - at).max(axis=0) < 1e-9
            faces[f"{letter}_{side}"] = np.flatnonzero(inside)
    sets = {name: np.unique(mesh.dofs.get_facet_dofs(facets).flatten()) for name, facets in faces.items()}
    return mesh.with_boundaries(faces), sets


def two_blocks(x_1, x_2, n_1=(3, 3), n_2=(4, 4), tets=False, materials=(STEEL, STEEL), points=None):
    """Two blocks of section 1 x 1 that meet where the first ends; 8-node hexahedra where a material asks for them."""
    linear = [isinstance(material, Material) and bool(material.elements) for material in materials]
    item = block(x_1, L(0, 1, n_1[0]), L(0, 1, n_1[1]), linear=linear[0])
    other = block(x_2, L(0, 1, n_2[0]), L(0, 1, n_2[1]), tets, linear[1])
    return Assembly([Body("a", *item, materials[0]), Body("b", *other, materials[1])], points)


def part(of, clamps=(), loads=None, outputs=None, **options) -> Part:
    return build(of, of.node_sets, of.material, clamps, [], loads or {}, outputs or {}, **options)


def static(of: Part, load: str) -> np.ndarray:
    return of.field(factorise(of.system.stiffness).solve(of.system.loads[load]))


@pytest.mark.parametrize(("tets", "linear"), [(False, (0, 0)), (True, (0, 0)), (False, (1, 1)), (True, (1, 0))])
def test_a_tie_of_different_meshes_carries_a_bar_in_tension_exactly(tets, linear):
    materials = [replace(STEEL, nu=0.0, elements="linear_reduced" if item else "") for item in linear]
    bar = two_blocks(L(0, 2, 3), L(2, 5, 4), tets=tets, materials=materials)
    pull = {"pull": NodalForce("b.x_max", (1, 0, 0), "area")}
    tied = part(bar, [Clamp("a.x_min")], pull, constraints=[Tie("ties.t", "a.x_max", "b.x_min")])
    u = static(tied, "pull")
    expected = np.zeros_like(u)
    expected[:, 0] = tied.points[:, 0] / STEEL.E
    assert np.abs(u - expected).max() < 1e-11 * np.abs(expected).max()


KINDS = [(False, False), (True, False), (False, True)]  # tetrahedra, eight nodes


@pytest.mark.parametrize(("tets", "linear"), KINDS)
def test_a_tie_carries_constant_tractions_of_each_node_to_the_nodes_near_it(tets, linear):
    item = block(L(0, 1, 2), L(0, 1, 9), L(0, 1, 9), tets, linear)
    other = block(L(1, 2, 2), L(0, 1, 8), L(0, 1, 8), linear=linear)
    assembly = Assembly([Body("a", *item, STEEL), Body("b", *other, STEEL)])
    tied = Tie("ties.t", "a.x_max", "b.x_min").build(assembly, {})
    pressure = [Pressure(face).vector(assembly, assembly.node_sets, None) for face in ("a.x_max", "b.x_min")]
    assert np.abs(tied.map.T @ pressure[0][tied.dofs] + pressure[1]).max() < 1e-12 * np.abs(pressure[1]).max()
    assert np.diff(tied.map.indptr).max() <= (25 if linear else 81)  # 64 and 225 nodes has the other face


@pytest.mark.parametrize(("tets", "linear"), KINDS)
@pytest.mark.parametrize("turn", [0.0, 1e-3, 0.3])
def test_a_face_that_another_covers_in_part_follows_its_linear_motions(tets, linear, turn):
    """At 1e-3 slivers are cut on which shape functions look alike."""
    item = block(L(0, 1, 2), L(0, 1, 6), L(0, 1, 6), tets, linear)
    mesh, sets = block(L(1, 2, 2), L(0.2, 0.8, 4), L(0.2, 0.9, 5), linear=linear)
    c, s = np.cos(turn), np.sin(turn)
    mesh = replace(mesh, doflocs=np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) @ mesh.doflocs)
    assembly = Assembly([Body("a", *item, STEEL), Body("b", mesh, sets, STEEL)])
    tied = Tie("ties.t", "a.x_max", "b.x_min").build(assembly, {})
    u = (assembly.doflocs.T @ np.random.default_rng(0).normal(size=(3, 3))).ravel()
    assert np.abs(tied.map @ u - u[tied.dofs]).max() < 1e-10
    assert len(tied.dofs) < 3 * len(assembly.node_sets["a.x_max"])  # what is not covered stays free


def frequencies(n: int) -> tuple[float, float]:
    """Second mode in bending of two clamped, tied blocks against that of one piece, both of about n elements."""
    bar = two_blocks(L(0, 2, n + 1), L(2, 5, n + 2), (n + 1, n + 1), (n + 2, n + 2))
    tied = part(bar, [Clamp("a.x_min")], constraints=[Tie("ties.t", "a.x_max", "b.x_min")])
    mesh, sets = block(L(0, 5, 2 * n + 2), L(0, 1, n + 2), L(0, 1, n + 2))
    full = build(mesh, sets, STEEL, [Clamp("x_min")], [], {}, {})
    return tuple(modes(of.system.stiffness, of.system.mass, 3)[0][2] for of in (tied, full))


def test_a_tie_converges_with_the_mesh_like_the_one_piece_mesh():
    fine, best = frequencies(4)
    errors = [abs(frequencies(n)[0] / best - 1) for n in (1, 2)]
    assert errors[0] / errors[1] > 2**2.5  # 3.1, measured; corners at the clamp keep both meshes from order 4
    assert errors[1] < 8e-3
    assert abs(fine / best - 1) < 3e-4


def test_faces_that_a_tie_cannot_join_are_one_sentence():
    bar = two_blocks(L(0, 2, 3), L(4, 5, 3))
    with pytest.raises(ValueError, match=r"ties.t: the two faces do not meet: they are about 2.* m apart"):
        part(bar, constraints=[Tie("ties.t", "a.x_max", "b.x_min")])
    bar = two_blocks(L(0, 2, 3), L(2, 5, 3))
    with pytest.raises(ValueError, match=r"ties\.t moves nodes that are clamped"):
        part(bar, [Clamp("a.x_max")], constraints=[Tie("ties.t", "a.x_max", "b.x_min")])
    twice = [Tie("ties.t", "a.x_max", "b.x_min"), Tie("ties.s", "a.x_max", "b.x_min")]
    with pytest.raises(ValueError, match=r"ties\.s and ties\.t both move the same nodes"):
        part(bar, constraints=twice)


@pytest.mark.parametrize("kind", [RigidCoupling, DistributedCoupling])
def test_a_point_bends_and_twists_the_face_that_it_carries(kind):
    beam, sets = block(L(0, 10, 11), L(0, 1, 3), L(0, 1, 3))
    bar = Assembly([Body("a", beam, sets, STEEL)], {"tip": (10.0, 0.5, 0.5)})
    loads = {"force": NodalForce("tip", (0, 0, 1)), "moment": Moment("tip", (0, 1, 0))}
    of = part(bar, [Clamp("a.x_min")], loads, constraints=[kind("tip", "a.x_max")])
    inertia = 1 / 12
    node, turn = bar.points["tip"]
    assert static(of, "force")[node, 2] == pytest.approx(10**3 / (3 * STEEL.E * inertia), rel=0.02)
    bent = static(of, "moment")
    assert bent[turn, 1] == pytest.approx(10 / (STEEL.E * inertia), rel=0.02)
    assert bent[node, 2] == pytest.approx(-(10**2) / (2 * STEEL.E * inertia), rel=0.02)
    assert static(of, "force")[turn, 1] == pytest.approx(bent[node, 2], rel=1e-9)  # Maxwell and Betti


def test_a_heavy_point_swings_on_the_bar_that_carries_it():
    beam, sets = block(L(0, 10, 11), L(0, 1, 2), L(0, 1, 2))
    light = Material(210e9, 0.3, 1e-3)
    bar = Assembly([Body("a", beam, sets, light)], {"tip": (10.0, 0.5, 0.5)})
    of = part(bar, [Clamp("a.x_min")], constraints=[RigidCoupling("tip", "a.x_max")], masses=[Mass("tip", 100.0)])
    omega = modes(of.system.stiffness, of.system.mass, 2)[0]
    assert omega == pytest.approx([np.sqrt(3 * 210e9 / 12 / 10**3 / 100.0)] * 2, rel=0.02)


def test_a_heated_bar_between_walls_and_a_free_one():
    path = [  # they expand along the bar alone, and do not contract across
        Orthotropic((E,) * 3, (0.0,) * 3, (E / 2,) * 3, 1000.0, expansion=(alpha, 0.0, 0.0))
        for E, alpha in ((210e9, 12e-6), (70e9, 23e-6))
    ]
    bar = two_blocks(L(0, 2, 3), L(2, 5, 3), materials=path)
    heat = {"heat": Heating(bar.material)}
    tie = [Tie("ties.t", "a.x_max", "b.x_min")]
    free = part(bar, [Clamp("a.x_min")], heat, constraints=tie)
    u = static(free, "heat")
    side = bar.node_sets["b.x_max"]
    assert u[side, 0].mean() == pytest.approx(2 * 12e-6 + 3 * 23e-6, rel=1e-9)
    walls = part(bar, [Clamp("a.x_min"), Clamp("b.x_max", "x")], heat, constraints=tie)
    q = factorise(walls.system.stiffness).solve(walls.system.loads["heat"])
    meeting = walls.field(q)[bar.node_sets["b.x_min"], 0].mean()
    # one force in both: (alpha L)_1 + (alpha L)_2 = F (L / E A)_1 + F (L / E A)_2
    force = (2 * 12e-6 + 3 * 23e-6) / (2 / 210e9 + 3 / 70e9)
    assert meeting == pytest.approx(2 * 12e-6 - force * 2 / 210e9, rel=1e-9)


def crystal(**options):
    numbers = {"young": (120e9, 80e9, 60e9), "poisson": (0.3, 0.25, 0.2), "shear": (40e9, 30e9, 20e9), "rho": 5000.0}
    return Orthotropic(**numbers, **options)


def test_an_orthotropic_bar_and_its_turned_axes():
    mesh, sets = block(L(0, 3, 4), L(0, 1, 2), L(0, 1, 2))
    modulus = {}
    for first, second, E in (((1, 0, 0), (0, 1, 0), 120e9), ((0, 1, 0), (1, 0, 0), 80e9), ((0, 1, 0), (0, 0, 1), 60e9)):
        fixed = [Clamp(f"{axis}_min", axis) for axis in "xyz"]
        pull = {"pull": NodalForce("x_max", (1, 0, 0), "area")}
        of = build(mesh, sets, crystal(axes=(first, second)), fixed, [], pull, {})
        modulus[E] = 3 / static(of, "pull")[sets["x_max"], 0].mean()
    assert list(modulus.values()) == pytest.approx(list(modulus), rel=1e-9)


def test_turning_material_and_mesh_alike_changes_no_frequency():
    mesh, sets = block(L(0, 3, 4), L(0, 1, 2), L(0, 1.5, 2))
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = replace(mesh, doflocs=R @ mesh.doflocs)
    axes = np.array([[0.6, 0.5, 0.2], [-0.3, 0.9, 0.1]])
    rows = []
    for of, directions in ((mesh, axes), (turned, axes @ R.T)):
        M, K = assemble(of, crystal(axes=directions))
        free = np.setdiff1d(np.arange(K.shape[0]), (sets["x_min"][:, None] * 3 + np.arange(3)).ravel())
        rows.append(modes(K[free][:, free], M[free][:, free], 6)[0])
    assert rows[0] == pytest.approx(rows[1], rel=1e-9)


def test_an_isotropic_material_is_the_special_case():
    mesh, _ = block(L(0, 3, 4), L(0, 1, 2), L(0, 1.5, 2), tets=True)
    G = STEEL.E / (2 * (1 + STEEL.nu))
    equal = Orthotropic((STEEL.E,) * 3, (STEEL.nu,) * 3, (G,) * 3, STEEL.rho, ((1, 2, 3), (0, 1, 1)))
    for item, other in zip(assemble(mesh, STEEL), assemble(mesh, equal), strict=True):
        assert abs(item - other).max() < 1e-11 * abs(item).max()


def test_a_link_joins_the_points_of_two_bodies_in_all_motions_or_leaves_one_free():
    """A bar cut in two: linked in all motions it is the bar tied by rigid ends; free along, it slides there alone."""
    points = {"one": (2.0, 0.5, 0.5), "two": (2.0, 0.5, 0.5)}
    loads = {"pull": NodalForce("b.x_max", (1, 0, 0), "area"), "bend": NodalForce("b.x_max", (0, 0, 1), "area")}
    mesh, sets = block(L(0, 2, 3), L(0, 1, 3), L(0, 1, 3)), block(L(2, 5, 4), L(0, 1, 3), L(0, 1, 3))
    bar = Assembly([Body("a", *mesh, STEEL), Body("b", *sets, STEEL)], points)
    rigid = [RigidCoupling("one", "a.x_max"), RigidCoupling("two", "b.x_min")]
    joined = part(bar, [Clamp("a.x_min")], loads, constraints=[*rigid, Link("links.l", *rigid)])
    equal = Assembly([Body("a", *mesh, STEEL), Body("b", *sets, STEEL)], {"one": points["one"]})
    full = [RigidCoupling("one", "a.x_max"), RigidCoupling("one", "b.x_min")]
    one_point = part(equal, [Clamp("a.x_min")], loads, constraints=full)
    for load in loads:
        expected = static(one_point, load)[: bar.doflocs.shape[1] - 4]
        assert np.abs(static(joined, load)[: len(expected)] - expected).max() < 1e-9 * np.abs(expected).max()
    soft = [DistributedCoupling("one", "a.x_max"), DistributedCoupling("two", "b.x_min")]
    sliding = part(bar, [Clamp("a.x_min")], loads, constraints=[*soft, Link("links.l", *soft, free=[0])])
    lam, shapes = modes(sliding.system.stiffness + 1e-3 * sliding.system.mass, sliding.system.mass, 2)
    assert lam[0] ** 2 < 1e-6 * lam[1] ** 2
    u = sliding.field(shapes[:, 0])
    other = np.unique(u[sliding.node_sets["b.x_max"], 0].round(9))
    assert len(other) == 1
    assert np.abs(u[sliding.node_sets["a.x_max"]]).max() < 1e-6 * abs(other[0])
    with pytest.raises(ValueError, match=r"links\.m and links\.l both move the same nodes"):
        part(bar, [Clamp("a.x_min")], constraints=[*soft, Link("links.l", *soft), Link("links.m", *soft)])


def test_tied_faces_that_are_apart_are_refused_by_name_unless_a_reach_bridges_them():
    bar = two_blocks(L(0, 2, 3), L(2.02, 5, 3))
    with pytest.raises(ValueError, match=r"ties\.t: a\.x_max and b\.x_min are 20 mm apart"):
        part(bar, constraints=[Tie("ties.t", "a.x_max", "b.x_min")])
    bridged = part(bar, constraints=[Tie("ties.t", "a.x_max", "b.x_min", 0.05)])
    assert abs(modes(bridged.system.stiffness, bridged.system.mass, 7)[0][:6]).max() < 1e-2
    neighbour = two_blocks(L(0, 2, 3), L(0, 2, 3))
    for tied in (("a.x_max", "b.x_max"), ("a.x_max", "b.y_min"), ("a.y_max", "b.x_min")):
        with pytest.raises(ValueError, match=r"ties\.t: the two faces"):
            part(neighbour, constraints=[Tie("ties.t", *tied)])
