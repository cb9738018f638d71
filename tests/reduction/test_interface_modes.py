"""Interface reduction: exact with all modes, converging with few, and its physical DOFs stay what they are."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.coarse_beam import make
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.interface_modes import interface_modes
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.prescribed import prescribe
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

SMALL = (
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=2", "reduction.modes=8",
    "response.points=30",
)  # fmt: skip


@pytest.fixture(scope="module")
def full() -> ReducedModel:
    part = make(nx=4)
    return craig_bampton(part.system, part.interface, n_modes=8)


@pytest.mark.parametrize("n_keep", [0, 4])
def test_all_modes_lose_nothing(full: ReducedModel, n_keep: int) -> None:
    masters = full.origin.masters
    reduced = interface_modes(full, len(masters) - n_keep, masters[len(masters) - n_keep :])
    assert reduced.system.n_dof == full.system.n_dof
    springs = full.interface.stiffness(470e6, 583e6)
    for stiffness in (None, springs):
        ours, theirs = (linear_modes(model, stiffness, 20)[0] for model in (reduced, full))
        assert ours == pytest.approx(theirs, rel=1e-7)
    load = np.linalg.solve(full.system.stiffness, full.system.loads["point"])
    displacement = np.linalg.solve(reduced.system.stiffness, reduced.system.loads["point"])
    assert reduced.interface.B @ displacement == pytest.approx(full.interface.B @ load, rel=1e-7, abs=1e-16)
    assert reduced.reconstruct(displacement) == pytest.approx(full.reconstruct(load), rel=1e-6, abs=1e-16)


def test_frequencies_converge_from_above(full: ReducedModel) -> None:
    masters = full.origin.masters
    exact = linear_modes(full, None, 4)[0]
    errors = [linear_modes(interface_modes(full, n), None, 4)[0] / exact - 1 for n in (6, 15, 40, 80)]
    assert all(np.all(error > -1e-9) for error in errors)
    assert all(np.all(after <= before + 1e-9) for before, after in pairwise(errors))
    assert errors[1].max() < 1e-3
    omitted = [interface_modes(full, n).origin.interface_omitted_frequency for n in (6, 15, len(masters))]
    assert omitted == sorted(omitted)
    assert omitted[-1] == np.inf


def test_a_force_on_kept_dofs_moves_them_as_before(full: ReducedModel) -> None:
    """Static shapes are kept whole, however few the interface modes are."""
    places = [1, 5]
    reduced = interface_modes(full, 4, full.origin.masters[places])
    for mine, theirs in enumerate(places):
        exact = np.linalg.solve(full.system.stiffness, np.eye(full.system.n_dof)[theirs])[places]
        result = np.linalg.solve(reduced.system.stiffness, np.eye(reduced.system.n_dof)[mine])[:2]
        assert result == pytest.approx(exact, rel=1e-7)


def test_kept_dofs_are_displacements(full: ReducedModel) -> None:
    keep = full.origin.masters[[1, 5]]
    reduced = interface_modes(full, 10, keep)
    q = np.zeros(reduced.system.n_dof)
    q[1] = 1.0
    assert reduced.reconstruct(q)[keep] == pytest.approx([0.0, 1.0], abs=1e-12)
    static = np.linalg.solve(reduced.system.stiffness, reduced.system.loads["point"])
    exact = np.linalg.solve(full.system.stiffness, full.system.loads["point"])
    assert reduced.reconstruct(static)[keep] == pytest.approx(full.reconstruct(exact)[keep], rel=2e-2)


def test_a_displacement_can_be_prescribed_after_the_interface_is_reduced() -> None:
    """Harmonic 0 and harmonic 1 of a contact on springs, and the reaction at the height: as without the reduction."""
    part = make(nx=4)
    loose = np.flatnonzero(np.asarray(abs(part.interface.B).sum(axis=0)).ravel() == 0)
    prescribed_dofs = loose[[5, 50, 51]]
    full = craig_bampton(part.system, part.interface, 8, None, prescribed_dofs)
    n_contact = len(full.origin.masters) - len(prescribed_dofs)
    springs = np.ravel(part.interface.stiffness(470e6, 583e6))

    def answers(model: ReducedModel) -> tuple[np.ndarray, ...]:
        places = np.searchsorted(model.origin.masters, prescribed_dofs)
        prescribed = prescribe(model, places, "height")
        reaction = prescribed.reaction
        displacements = []
        for h, load in ((0, "height"), (1, "point")):
            system, B = prescribed.at_harmonic(h)
            K = system.stiffness + B.T @ (springs[:, None] * B) - h * (2 * np.pi * 300) ** 2 * system.mass
            displacements.append(B @ np.linalg.solve(K, system.loads[load]))
        force = (springs * displacements[0]).reshape(part.interface.n_pair, -1)
        return *displacements, reaction.force(1.0, force)

    exact = answers(full)
    for n, within in ((6, 0.05), (n_contact // 2, 0.02), (n_contact, 1e-6)):
        reduced = interface_modes(full, n, prescribed_dofs, separate=prescribed_dofs)
        assert not np.asarray(reduced.interface.B)[:, : len(prescribed_dofs)].any()
        for ours, theirs in zip(answers(reduced), exact, strict=True):
            assert np.linalg.norm(ours - theirs) < within * np.linalg.norm(theirs)
    assert reduced.system.n_dof == full.system.n_dof  # with all modes the static shapes are nothing new
    with pytest.raises(ValueError, match="acts on contact nodes"):
        prescribe(interface_modes(full, 6, prescribed_dofs), np.arange(3), "height")


def test_what_cannot_be_is_refused(full: ReducedModel) -> None:
    masters = full.origin.masters
    slave = np.setdiff1d(np.arange(len(masters) + 1), masters)[:1]
    with pytest.raises(ValueError, match="ask for 1 to"):
        interface_modes(full, len(masters) + 1)
    with pytest.raises(ValueError, match="only DOFs that are masters"):
        interface_modes(full, 3, slave)
    with pytest.raises(ValueError, match="expected interface_keep only with interface_modes"):
        scene_file.read("beam", ("reduction.interface_keep=[]",))


def peak(tmp_path: Path, *overrides: str) -> tuple[ReducedModel, np.ndarray]:
    file = scene_file.read("beam", (*SMALL, *overrides))
    model = modelling.build(file, Progress())
    site = settings.peak_of(file.scene)
    assert isinstance(site, AtPeak)
    point: OperatingPoint = site.solve(model.balance)
    assert point.solution.converged
    energy, preload = model.balance.energy(point.state).sum(), model.balance.preload(point.state)
    return model.reduced, np.array([point.state.omega, point.amplitude, energy, preload])


def test_a_scene_reduces_its_interface(tmp_path: Path) -> None:
    """Peak, energy and preload of the nonlinear response: fewer modes, larger error; all of them, none."""
    full, reference = peak(tmp_path)
    n_contact = 27
    errors = {}
    for n in (3, 12, n_contact):
        reduced, result = peak(tmp_path, f"reduction.interface_modes={n}")
        assert reduced.system.n_dof == full.system.n_dof - n_contact + n
        errors[n] = np.abs(result / reference - 1).max()
    assert errors[n_contact] < 1e-4 < errors[3]
    assert errors[12] < 0.02
    scc, result = peak(tmp_path, "reduction.interface_modes=20", "reduction.interface_keep=[]")
    assert scc.system.n_dof == 20 + 8
    assert np.abs(result / reference - 1).max() < 0.05
    with pytest.raises(ValueError, match="shakers"):
        peak(tmp_path, "reduction.interface_modes=3", 'reduction.interface_keep=["shakers"]')
