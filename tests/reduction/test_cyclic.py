"""The reduced sector: exact where it must be, near the full sector where modes are left out."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

from tests.helpers import small_wheel as small
from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.cyclic_symmetry import wave_system
from tribodyn.fem.modes import modes
from tribodyn.reduction import sector_reduction as waves, wave_model
from tribodyn.reduction.limits import ReductionLimits
from tribodyn.reduction.linear import linear_modes, stuck_stiffness
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.wave_model import travelling_wave
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import wheel_model as wheels


@pytest.fixture(scope="module", params=[0.0, 0.02], ids=["rigid disk", "flexible disk"])
def reduced(request, tmp_path_factory):
    return small.reduced_sector(tmp_path_factory.mktemp("wheel") / "s.msh", request.param)


@pytest.fixture(scope="module")
def published():
    """The blade as its scene has it, on its rigid disk, full and reduced."""
    blade = wheels.build(scene_file.read("blade"))
    return blade.full, blade.reduced


def test_reduced_sector_and_reduced_wheel_agree_to_rounding(reduced):
    """Item 1 of the issue, reduced: every frequency of the wheel, free and stuck, is one of a sector."""
    k = reduced.sector.interface.stiffness(*small.STIFFNESS)
    system, interface = cyclic_symmetry.assemble_wheel(reduced.sector)
    n = wave_system(reduced.sector, 0)[0].n_dof
    for springs, all_springs in ((None, None), (k, np.tile(k, (small.N, 1)))):
        mine = np.sort(waves.nodal_diameters(reduced.sector, range(small.N), n, springs).ravel())
        theirs, _ = linear_modes(ReducedModel(system, interface), all_springs, system.n_dof)
        assert np.abs(theirs / mine - 1).max() < 1e-8


def test_reduced_against_full_sector(published):
    """Item 3 of the issue: nodal diameters 0, 1, 2, 5, 10, 20 within 0.5 %; free blades are alone, 0 and 1 tell all."""
    full, reduced = published
    assert full.n_sectors == 40
    for k, diameters in ((None, (0, 1)), (full.interface.stiffness(93e6, 113e6), (0, 1, 2, 5, 10, 20))):
        exact = waves.nodal_diameters(full, diameters, 4, k)
        error = waves.nodal_diameters(reduced.sector, diameters, 4, k) / exact - 1
        assert error.min() > -1e-9  # Rayleigh-Ritz: never below
        assert error.max() < 5e-3
        assert error[:, :2].max() < 1.5e-3
    assert reduced.sector.system.n_dof < 150
    assert reduced.origin.basis.shape == (full.system.n_dof, reduced.sector.system.n_dof)


def test_blade_is_what_the_scene_says(published):
    """Free blades are alone, and contact raises their first bending mode."""
    _, reduced = published
    free = waves.nodal_diameters(reduced.sector, range(21), 1)
    stuck = waves.nodal_diameters(reduced.sector, range(21), 1, reduced.sector.interface.stiffness(93e6, 113e6))
    assert np.ptp(free) < 1e-6 * free.max()  # a rigid disk: blades are alone
    assert free[0, 0] == pytest.approx(175.1, abs=0.5)
    assert stuck[:3, 0] == pytest.approx([248.3, 341.1, 501.4], abs=1.5)
    assert (stuck > free).all()


def test_relative_coordinates_are_the_contact_itself(reduced):
    for index in (0, 1, 3, 4, 7):
        T, n_masters = waves.relative_map(reduced.sector, index)
        n_contact = len(reduced.sector.left_map)
        S = cyclic_symmetry.seam_map(reduced.sector, index)
        system, B = wave_system(reduced.sector, index)
        z = np.random.default_rng(index).normal(size=T.shape[1])
        q = T @ z
        saved = np.setdiff1d(np.arange(len(q)), reduced.sector.seam_left)
        assert S @ q[saved] == pytest.approx(q, abs=1e-12)
        assert B @ q[saved] == pytest.approx(z[:n_contact], abs=1e-12)
        assert T.shape[1] == system.n_dof
        assert n_masters == n_contact + 4  # two of the couple, the driven node, the tip
        small_system = reduced.sector.system.projected(T)
        equal = [modes(s.stiffness, s.mass, system.n_dof)[0] for s in (system, small_system)]
        assert equal[1] == pytest.approx(equal[0], rel=1e-7)


def test_contact_of_fewer_components_leaves_the_others_free(tmp_path):
    contact = ContactFaces("shroud_right", (1, 0, 0), "shroud_left", components=("t1", "n"), vertices_only=True)
    _, full = small.full_sector(tmp_path / "s.msh", contact=contact)
    sector = waves.reduce_sector(full, n_modes=4).sector
    T, _ = waves.relative_map(sector, 1)
    _, B = wave_system(sector, 1)
    assert T.shape == (sector.system.n_dof, sector.system.n_dof)
    assert np.linalg.matrix_rank(T) == sector.system.n_dof
    x = np.eye(len(B), T.shape[1])
    assert np.abs(B @ T - x).max() < 1e-12


def test_model_of_a_wave(reduced):
    undamped = travelling_wave(reduced, 3)
    model = undamped.with_damping(lambda system, B: modal_damping(system, 0.02))
    assert undamped.at_harmonic(1)[0].damping is None
    n_contact = len(reduced.sector.left_map)
    for h, index in ((0, 0), (1, 3), (2, 6), (3, 1), (5, 7), (8, 0), (9, 3)):
        system, B = model.at_harmonic(h)
        assert (np.eye(n_contact, system.n_dof) == B).all()
        assert system is model.at_harmonic(h + small.N)[0]
        expected = modes(*(getattr(wave_system(reduced.sector, index)[0], m) for m in ("stiffness", "mass")), 3)
        assert modes(system.stiffness, system.mass, 3)[0] == pytest.approx(expected[0], rel=1e-8)
        assert np.iscomplexobj(system.stiffness) == (index not in (0, 4))
        lam, phi = sla.eigh(system.stiffness, system.mass)
        modal = phi.conj().T @ system.damping @ phi
        assert np.abs(modal - np.diag(0.04 * np.sqrt(lam))).max() < 1e-6 * modal.max()
    assert model.at_harmonic(0)[0] is model.at_harmonic(8)[0]
    assert model.at_harmonic(0)[0] is not model.at_harmonic(1)[0]
    assert model.system is model.at_harmonic(1)[0]
    k = reduced.sector.interface.stiffness(*small.STIFFNESS)
    stuck, _ = linear_modes(model, k, 2)
    assert stuck == pytest.approx(waves.nodal_diameters(reduced.sector, [3], 2, k)[0], rel=1e-8)


def test_stuck_ritz_shapes_keep_statics_exact_and_the_contact_near(reduced, monkeypatch):
    """Contacts, loads and outputs of a wave in few coordinates, against all of them; above the first mode, too."""
    k = reduced.sector.interface.stiffness(*small.STIFFNESS)
    fine = travelling_wave(reduced, 3)
    for module in (waves, wave_model):
        monkeypatch.setattr(module, "LIMITS", ReductionLimits(many_coordinates=0, ritz_modes=12))
    coarse = travelling_wave(reduced, 3, springs=k)

    def response(model, h, hertz):
        system, B = model.at_harmonic(h)
        dynamic = stuck_stiffness(system.stiffness, B, k) - (2 * np.pi * hertz) ** 2 * system.mass
        ports = np.concatenate([B, np.array(list(system.outputs.values()))])
        return ports @ np.linalg.solve(dynamic, np.column_stack([B.conj().T, *system.loads.values()]))

    first = linear_modes(fine, k, 1)[0][0]
    for h in (0, 1, 2):
        assert coarse.at_harmonic(h)[0].n_dof < fine.at_harmonic(h)[0].n_dof
        for hertz, bound in ((0.0, 1e-9), (1.1 * first, 1e-5)):
            exact = response(fine, h, hertz)
            assert np.abs(response(coarse, h, hertz) - exact).max() < bound * np.abs(exact).max()
    q = np.random.default_rng(0).normal(size=coarse.at_harmonic(1)[0].n_dof)
    B, basis = np.asarray(reduced.sector.interface.B), reduced.origin.basis
    assert coarse.reconstruct(q).shape == (len(basis),)
    slid = B - np.conj(reduced.sector.phase(3)) * reduced.sector.left_map
    inside, *_ = np.linalg.lstsq(basis, coarse.reconstruct(q), rcond=None)
    assert slid @ inside == pytest.approx(coarse.at_harmonic(1)[1] @ q, abs=1e-9 * np.abs(q).max())


def test_shared_nodes_of_contact_and_seam_are_one_sentence(reduced):
    broken = replace(reduced.sector, left_map=np.asarray(reduced.sector.interface.B))
    with pytest.raises(ValueError, match="the right contact face of a cyclic part must be of master nodes"):
        waves.relative_map(broken, 1)
