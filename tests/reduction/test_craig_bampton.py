"""Craig-Bampton: exact with all modes, statically exact always, and an error estimate that tells the truth."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

from tests.helpers.coarse_beam import make
from tribodyn.fem.factor import factorise
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction import craig_bampton as craig_bampton_module
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.limits import ReductionLimits
from tribodyn.reduction.linear import linear_modes, stuck_stiffness
from tribodyn.reduction.linear_damping import modal_damping, rayleigh

SPRINGS = (470e6, 583e6)


@pytest.fixture(scope="module")
def part():
    return make()


@pytest.fixture(scope="module")
def model(part):
    return craig_bampton(part.system, part.interface, n_modes=15)


def test_masters(part, model):
    """25 pairs with 3 DOFs, 2 DOFs of the point load, 25 of the tip's mean displacement; two shapes of the pressure."""
    masters = model.origin.masters
    assert len(masters) == 75 + 2 + 25 - 5  # the patch and the tip share 5 nodes
    assert model.system.n_dof == len(masters) + 15 + 2
    q = np.zeros(model.system.n_dof)
    q[3] = 1.0
    assert model.reconstruct(q)[masters] == pytest.approx(q[: len(masters)], abs=1e-14)
    extra = craig_bampton(part.system, part.interface, n_modes=0, extra_masters=[0, 1, 2])
    assert extra.system.n_dof == len(masters) + 3 + 2
    with pytest.raises(ValueError, match="a master lies outside"):
        craig_bampton(part.system, part.interface, n_modes=0, extra_masters=[part.system.n_dof])


def test_all_modes_are_exact():
    part = make(nx=2, patch=1)
    n = part.system.n_dof
    masters = len(craig_bampton(part.system, part.interface, n_modes=1).origin.masters)
    model = craig_bampton(part.system, part.interface, n_modes=n - masters)
    assert model.system.n_dof == n
    k = part.interface.stiffness(*SPRINGS)
    for stiffness in (None, k):
        full, _ = linear_modes(part, stiffness, n)
        reduced, _ = linear_modes(model, stiffness, n)
        assert reduced == pytest.approx(full, rel=1e-9)
    # a forced response, damped, with a stuck contact
    w = 2 * np.pi * 1500
    part_K = stuck_stiffness(part.system.stiffness.toarray(), part.interface.B.toarray(), k) * (1 + 0.02j)
    model_K = stuck_stiffness(model.system.stiffness, model.interface.B, k) * (1 + 0.02j)
    x = np.linalg.solve(part_K - w**2 * part.system.mass.toarray(), part.system.loads["pressure"])
    q = np.linalg.solve(model_K - w**2 * model.system.mass, model.system.loads["pressure"])
    assert np.abs(model.reconstruct(q) - x).max() < 1e-9 * np.abs(x).max()
    assert model.origin.first_omitted_frequency == np.inf


@pytest.mark.parametrize("load", ["point", "pressure"])
def test_statics_are_exact_with_few_modes(part, model, load):
    """A load on masters or on slaves gives the exact static field for any number of modes; preload included."""
    k = part.interface.stiffness(*SPRINGS)
    guyan = craig_bampton(part.system, part.interface, n_modes=0)
    x = factorise(stuck_stiffness(part.system.stiffness, part.interface.B, k)).solve(part.system.loads[load])
    for reduced in (guyan, model):
        K = stuck_stiffness(reduced.system.stiffness, reduced.interface.B, k)
        q = np.linalg.solve(K, reduced.system.loads[load])
        assert np.abs(reduced.reconstruct(q) - x).max() < 1e-9 * np.abs(x).max()
        assert reduced.interface.B @ q == pytest.approx(part.interface.B @ x, abs=1e-9 * np.abs(x).max())
        for name in ("mid", "tip"):
            assert reduced.system.outputs[name] @ q == pytest.approx(part.system.outputs[name] @ x, rel=1e-9)


def test_few_modes_are_enough(part, model):
    """15 modes: the first within 0.05 %; 30 modes: ten free and nine stuck ones within 0.3 %; always from above."""
    k = part.interface.stiffness(*SPRINGS)
    finer = craig_bampton(part.system, part.interface, n_modes=30)
    for stiffness in (None, k):
        full, _ = linear_modes(part, stiffness)
        small, _ = linear_modes(model, stiffness)
        extra, _ = linear_modes(finer, stiffness)
        assert (small - full > -1e-8 * full).all()
        assert (extra <= small * (1 + 1e-9)).all()
        assert small[0] / full[0] - 1 < 5e-4
    assert (extra / full - 1)[:9].max() < 3e-3
    full, _ = linear_modes(part)
    assert (linear_modes(finer)[0] / full - 1).max() < 3e-3


def test_a_cutoff_with_too_many_modes_is_refused_before_they_are_computed(part, model, monkeypatch):
    omitted = model.origin.first_omitted_frequency
    refusal = craig_bampton(part.system, part.interface, cutoff=2 * omitted).origin.n_modes
    monkeypatch.setattr(craig_bampton_module, "LIMITS", ReductionLimits(most_modes=refusal))
    assert craig_bampton(part.system, part.interface, cutoff=2 * omitted).origin.n_modes == refusal
    monkeypatch.setattr(craig_bampton_module, "LIMITS", ReductionLimits(most_modes=refusal - 1))
    with pytest.raises(ValueError, match=rf"is above {refusal - 1} modes: {refusal} of its \d+ modes lie below it"):
        craig_bampton(part.system, part.interface, cutoff=2 * omitted)


def test_cutoff_keeps_the_modes_below_it(part, model):
    omitted = model.origin.first_omitted_frequency
    assert craig_bampton(part.system, part.interface, cutoff=omitted * 0.9999).origin.n_modes == 15
    wider = craig_bampton(part.system, part.interface, cutoff=2 * omitted)
    assert wider.origin.n_modes > 15
    assert wider.origin.first_omitted_frequency > 2 * omitted
    assert craig_bampton(part.system, part.interface, cutoff=1.0).origin.n_modes == 0
    with pytest.raises(
        ValueError, match=r"beyond what the mesh resolves: mode 17 of \d+ has .* Hz; lower reduction.cutoff"
    ):
        craig_bampton(part.system, part.interface, cutoff=1e9)
    with pytest.raises(ValueError, match=r"beyond what the mesh resolves: \d+ of its \d+ modes lie below it"):
        craig_bampton(part.system, part.interface, cutoff=60 * omitted)
    for two_results in ({}, {"n_modes": 3, "cutoff": 1e3}):
        with pytest.raises(ValueError, match="one of the two"):
            craig_bampton(part.system, part.interface, **two_results)
    with pytest.raises(ValueError, match="not masters"):
        craig_bampton(part.system, part.interface, n_modes=part.system.n_dof)


def test_damping_of_the_full_system_is_projected(part, model):
    damped = replace(part.system, damping=1e-6 * part.system.stiffness)
    reduced = craig_bampton(damped, part.interface, n_modes=15)
    assert np.abs(reduced.system.damping - 1e-6 * model.system.stiffness).max() < 1e-6 * 1e-8 * np.max(
        model.system.stiffness
    )


def test_modal_damping(model):
    C = modal_damping(model.system, 0.01)
    omega, phi = 2 * np.pi * linear_modes(model, n=model.system.n_dof)[0], linear_modes(model, n=model.system.n_dof)[1]
    modal = phi.T @ C @ phi
    assert np.diag(modal) == pytest.approx(0.02 * omega, rel=1e-6)
    assert np.abs(modal - np.diag(np.diag(modal))).max() < 1e-6 * omega.max()
    with pytest.raises(ValueError, match="0 or more"):
        modal_damping(model.system, -0.01)


def test_rigid_bodies_are_not_damped():
    part = make(nx=3, clamped=False)
    model = craig_bampton(part.system, part.interface, n_modes=10)
    C = modal_damping(model.system, 0.05)
    omega, phi = linear_modes(model, n=8)
    assert omega[5] < 1e-3 * omega[6]
    assert np.abs(np.diag(phi.T @ C @ phi))[:6].max() < 1e-6 * 0.1 * omega[6]
    C = rayleigh(model.system, 2.0, 3e-7)
    assert np.diag(phi.T @ C @ phi)[6:] == pytest.approx(2 + 3e-7 * (2 * np.pi * omega[6:]) ** 2, rel=1e-6)
    with pytest.raises(ValueError, match="must not be negative"):
        rayleigh(model.system, -1, 0)


def test_damping_is_a_number_for_each_mode_that_vibrates():
    """The first two have theirs, all further ones the last; two motions as a rigid body have none."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(6, 6)), rng.normal(size=(6, 4))
    system = SecondOrderSystem(a @ a.T + np.eye(6), b @ b.T, None, {}, {})
    squares, shapes = sla.eigh(system.stiffness, system.mass)
    rate = shapes.T @ modal_damping(system, (0.01, 0.03, 0.02)) @ shapes
    expected = 2 * np.array([0, 0, 0.01, 0.03, 0.02, 0.02]) * np.sqrt(np.maximum(squares, 0))
    np.testing.assert_allclose(rate, np.diag(expected), atol=1e-12)
