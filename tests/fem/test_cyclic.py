"""One sector against the wheel: pairing by rotation, rigid motions, frequencies of every nodal diameter."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from tests.helpers import small_wheel as small
from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.modes import modes
from tribodyn.fem.sector_fit import describe_fault
from tribodyn.geometry.placement import place, rotation
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.sector_reduction import nodal_diameters
from tribodyn.workflows.scene.fields import parsed_direction


@pytest.fixture(scope="module", params=[0.0, 0.02], ids=["rigid disk", "flexible disk"])
def sector(request, tmp_path_factory):
    return small.full_sector(tmp_path_factory.mktemp("wheel") / "s.msh", request.param)[1]


@pytest.fixture(scope="module")
def sector_part(tmp_path_factory):
    return small.full_sector(tmp_path_factory.mktemp("wheel") / "s.msh", 0.02)[0]


def test_rotation_is_right_handed_about_its_axis():
    R = rotation((0, 0, 2.0), np.pi / 2)
    assert pytest.approx([0, 1, 0]) == R @ [1, 0, 0]
    R = rotation((1, 2, 3), 0.3)
    assert pytest.approx(np.eye(3)) == R.T @ R
    assert pytest.approx([1, 2, 3]) == R @ [1, 2, 3]
    assert np.linalg.matrix_power(rotation((1, 0, 0), 2 * np.pi / 7), 7) == pytest.approx(np.eye(3))


def test_every_nodal_diameter_is_that_of_the_assembled_wheel(sector):
    """Item 1 of the issue, unreduced: all modes of the wheel below a bound are those of the sector, to 1e-8."""
    k = sector.interface.stiffness(*small.STIFFNESS)
    system, interface = cyclic_symmetry.assemble_wheel(sector)
    for springs, all_springs in ((None, None), (k, np.tile(k, (small.N, 1)))):
        half = nodal_diameters(sector, range(small.N // 2 + 1), 4, springs)
        mine = np.concatenate([half, half[1:-1]])  # waves forwards and backwards
        bound = 0.99 * mine[:, -1].min()
        mine = np.sort(mine[mine < bound])
        theirs, _ = linear_modes(ReducedModel(system, interface), all_springs, len(mine) + 4)
        assert np.sum(theirs < bound) == len(mine) >= 2 * small.N
        assert np.abs(theirs[: len(mine)] / mine - 1).max() < 1e-8


def test_opposite_waves_are_mirror_images(sector):
    for index in (1, 3):
        system, B = cyclic_symmetry.wave_system(sector, index)
        other, B_other = cyclic_symmetry.wave_system(sector, small.N - index)
        assert abs(system.stiffness - other.stiffness.conj()).max() <= 1e-12 * abs(system.stiffness).max()
        assert abs(B - B_other.conj()).max() < 1e-14
        assert abs(system.stiffness - system.stiffness.conj().T).max() == 0
    for index in (0, small.N // 2, small.N, -small.N):
        system, B = cyclic_symmetry.wave_system(sector, index)
        assert not np.iscomplexobj(system.stiffness)
        assert not np.iscomplexobj(B)
    assert cyclic_symmetry.phase(3, 8) == pytest.approx(np.exp(-2j * np.pi * 3 / 8))
    assert cyclic_symmetry.phase(-3, 8) == pytest.approx(np.conj(cyclic_symmetry.phase(3, 8)))


@pytest.mark.parametrize(("sectors", "axis", "turn", "shift", "fault"), [
    (small.N, "x", (0, 0, 0), (0, 0, 0), ""),
    (small.N + 1, "x", (0, 0, 0), (0, 0, 0), f"give wheel.sectors = {small.N}"),
    (small.N, "-x", (0, 0, 0), (0, 0, 0), "swap the two faces"),
    (small.N, "y", (0, 0, 0), (0, 0, 0), 'give wheel.axis = "x"'),
    (small.N, "x", (0, np.pi / 2, 0), (0, 0, 0), 'give wheel.axis = "-z"'),
    (small.N, "x", (0, 0, 0.3), (0, 0, 0), "give wheel.axis = [0.955336, 0.29552, 0.0]"),
    (small.N, "x", (0, 0, 0), (0.1, 0.2, -0.3), "its axis goes through (0, 0.2, -0.3) m: move it"),
    (9, "y", (0, 0, 0), (0, 0, 0), f'give wheel.axis = "x", and give wheel.sectors = {small.N}'),
])  # fmt: skip
def test_the_key_of_a_wheel_that_is_wrong_is_found(sector_part, sectors, axis, turn, shift, fault):
    """The rotation that brings one seam to the other says which."""
    R = scipy.spatial.transform.Rotation.from_rotvec(turn).as_matrix()
    mesh, sets = place(sector_part.mesh, 1.0, R, np.array(shift)), sector_part.node_sets
    said = parsed_direction(axis)
    sentence = describe_fault(mesh, sets, ("cyclic_right", "cyclic_left"), sectors, said)
    assert fault in sentence
    assert bool(sentence) == bool(fault)


def test_an_unclamped_wheel_moves_rigidly_in_the_waves_it_should(tmp_path):
    """Along the axis and about it: index 0. Across it: index 1, since y + i z turns into exp(+-i pitch) of itself."""
    part, free = small.full_sector(tmp_path / "s.msh", 0.02, clamps=())
    points = part.points
    about_axis = np.cross([1.0, 0, 0], points)
    plus = np.tile(np.array([0, 1, -1j]), (len(points), 1))  # turn @ v = exp(i pitch) v
    assert free.turn @ plus[0] == pytest.approx(np.exp(2j * np.pi / small.N) * plus[0])
    tilt = plus * points[:, :1] - np.outer(points @ [0, 1, -1j], [1, 0, 0])
    along_axis = np.tile([1.0, 0, 0], (len(points), 1))
    for index, field in ((0, along_axis), (0, about_axis), (1, plus), (1, tilt), (7, plus.conj())):
        T = cyclic_symmetry.seam_map(free, index)
        system, B = cyclic_symmetry.wave_system(free, index)
        q = field.ravel()
        saved = np.setdiff1d(np.arange(len(q)), free.seam_left)
        assert np.abs(T @ q[saved] - q).max() < 1e-12 * np.abs(q).max()
        scale = abs(system.stiffness).max() * np.abs(q).max()
        assert np.abs(system.stiffness @ q[saved]).max() < 1e-9 * scale
        assert np.abs(B @ q[saved]).max() < 1e-12 * np.abs(q).max()  # no relative motion at the shrouds either


def test_wheel_is_closed_and_named(sector):
    system, interface = cyclic_symmetry.assemble_wheel(sector)
    assert interface.n_pair == small.N * sector.interface.n_pair
    assert set(system.loads) == {f"{name}@{n}" for name in small.LOADS for n in range(small.N)}
    radius = np.hypot(*interface.points[:, 1:].T).reshape(small.N, -1)
    assert radius == pytest.approx(np.tile(radius[0], (small.N, 1)))
    assert abs(system.stiffness - system.stiffness.T).max() <= 1e-12 * abs(system.stiffness).max()


def test_a_stiffer_blade_takes_its_own_frequency_with_it(tmp_path):
    """On a rigid disk with open shrouds blades are alone: each frequency scales with the root of its factor."""
    sector = small.full_sector(tmp_path / "s.msh")[1]
    factors = np.linspace(0.9, 1.1, small.N)
    system, _ = cyclic_symmetry.assemble_wheel(sector, factors)
    single = modes(sector.system.stiffness, sector.system.mass, 1)[0][0]
    assert modes(system.stiffness, system.mass, small.N)[0] == pytest.approx(single * np.sqrt(factors), rel=1e-9)
    with pytest.raises(ValueError, match="mistuning needs 8 positive stiffness factors"):
        cyclic_symmetry.assemble_wheel(sector, [1.0, 2.0])


def test_faces_that_do_not_match_are_one_sentence(tmp_path):
    mesh, nodes = small.read(tmp_path / "s.msh", 0.02)

    def build(n=small.N, contact=small.CONTACT, clamps=small.CLAMPS, seam=small.SEAM):
        return small.sector_of(mesh, nodes, clamps, [contact], n, seam)

    with pytest.raises(ValueError, match=r"the second face lies about 0.01\d+ m inside"):
        build(n=9)
    with pytest.raises(ValueError, match="the cyclic faces 'cyclic_right' and 'clamp' have"):
        build(seam=("cyclic_right", "clamp"))
    with pytest.raises(ValueError, match="the cyclic faces 'cyclic_left' and 'cyclic_right' do not match"):
        build(seam=("cyclic_left", "cyclic_right"))
    with pytest.raises(ValueError, match="'cyclic_right' and 'cyclic_left' are held unequally"):
        build(clamps=(Clamp("clamp", "y"),))
    with pytest.raises(ValueError, match="contact 'shroud_right' of a cyclic part needs the opposite face"):
        build(contact=replace(small.CONTACT, opposite=None))
    with pytest.raises(ValueError, match="a wheel of 1 sectors"):
        build(n=1)
    with pytest.raises(ValueError, match="the mesh has no face 'shroud'"):
        build(contact=ContactFaces("shroud_right", (1, 0, 0), "shroud"))
