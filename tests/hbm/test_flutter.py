"""Flutter of a small wheel and its limit cycles by friction: eigenvalues of the whole wheel, and time integration."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import tiny_wheel as tiny
from tribodyn.fem.cyclic_symmetry import seam_map, seam_parts, wave_system
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.limit_cycles import limit_cycles
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import coordinates
from tribodyn.hbm.stability.exponents import stability
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import march_freely
from tribodyn.reduction.flow import Flow, added, aeroelastic, family, parts_of, with_flow
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.sector_reduction import ReducedSector
from tribodyn.reduction.wave_model import travelling_wave, wheel_model

FLOW = Flow({1: 0.012 + 0.002j, -1: -0.012 + 0.002j, 0: 0.004j})
SPRINGS = np.array([[4e3, 6e3]])
TURNING = 6.0
ORDER = 1


def damped(model):
    return model.with_damping(lambda system, B: modal_damping(system, 0.005))


def balance_of(model, copies):
    contact = ContactParameters.of(("t1", "n"), np.tile(SPRINGS, (copies, 1)), gap=-2e-3, friction=0.4)
    joint = Joint("contact", "jenkins", contact)
    basis = HarmonicBasis(tuple(range(6)), 256, "located")
    return HarmonicBalance.of(model, joint, basis, Excitation.of({}, {}), 500.0)


def wave(factor=1.0):
    """The wave of one nodal diameter that runs with the rotation, in a flow."""
    reduced = tiny.sector(("t1", "n"), TURNING)
    return balance_of(with_flow(damped(travelling_wave(reduced, ORDER)), SPRINGS, FLOW.scaled(factor)), 1)


def wheel_with_flow(reduced: ReducedSector, wheel: ReducedModel, springs: np.ndarray, flow: Flow) -> ReducedModel:
    """All sectors of a wheel, alike or not, with the forces of a flow on the modes of the wheel of sectors alike.

    wheel : of `cyclic.wheel_model`, damped or not; springs : (n_pair, n_component) of one sector"""
    sector, n = reduced.sector, reduced.sector.n_sectors
    transform = seam_parts(sector)[0].T  # a sector's own coordinates from all of them
    total = [np.zeros((wheel.system.n_dof, wheel.system.n_dof), complex) for _ in range(4)]
    for index in range(n):
        system, B = wave_system(sector, index)
        _, omega, shape = family(system, np.asarray(B), springs, flow.mode)
        refined = transform @ (seam_map(sector, index) @ shape)
        turns = np.exp(-2j * np.pi * (index * np.arange(n) % n) / n) / np.sqrt(n)
        force = np.asarray(wheel.system.mass) @ np.kron(turns, refined)
        for matrix, part in zip(total, parts_of(flow, index, n, omega), strict=True):
            matrix += part * np.outer(force, force.conj())
    return replace(wheel, system=added(wheel.system, *(matrix.real for matrix in total)))


def whole(stiffness=None):
    """All five sectors in the flow."""
    reduced = tiny.sector(("t1", "n"), TURNING)
    return wheel_with_flow(reduced, damped(wheel_model(reduced, stiffness)), SPRINGS, FLOW)


def test_eigenvalues_of_nodal_diameters_are_those_of_the_whole_wheel():
    item = damped(travelling_wave(tiny.sector(("t1", "n"), TURNING), ORDER))
    result = aeroelastic(item, SPRINGS, FLOW)
    assert sorted(result) == [-2, -1, 0, 1, 2]
    assert result[1].real > 0 > result[-1].real  # the wave with the rotation flutters
    model = whole()
    system, B = model.system, np.asarray(model.interface.B)
    K = system.stiffness + B.T @ (np.tile(SPRINGS.ravel(), tiny.N)[:, None] * B) + system.circulatory
    n = len(K)
    complete = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -system.velocity_matrix]]))
    for value in result.values():
        assert np.abs(complete - value).min() < 1e-9 * abs(value)


def test_damping_and_frequency_of_a_wave_are_what_the_coefficients_say():
    """Without other damping: Im c / 2 of critical, the frequency shifted by Re c / 2, to first order."""
    item = travelling_wave(tiny.sector(("t1", "n")), ORDER)
    small = FLOW.scaled(1e-3)
    still = aeroelastic(item, SPRINGS, small.scaled(1e-9))
    for index, value in aeroelastic(item, SPRINGS, small).items():
        c = small.of_index(index, tiny.N)
        omega = still[index].imag
        assert -value.real / omega == pytest.approx(c.imag / 2, abs=1e-8)
        assert value.imag / omega - 1 == pytest.approx(c.real / 2, abs=1e-8)


@pytest.fixture(scope="module")
def cycle():
    result, reason = limit_cycles(wave(), 1e-5, 2e-2, output="tip", options=BackboneOptions(n_points=30))
    assert not reason
    assert result
    return result[0]


def test_the_limit_cycle_of_a_tuned_wheel_is_what_time_integration_comes_to(cycle):
    """From three quarters of its amplitude, on the whole wheel, within 1 %."""
    problem = wave()
    begin = cycle.state.x.copy()
    begin[..., 1:] *= 0.75
    start = problem.evaluate(cycle.omega, begin)
    single = march_freely(problem, cycle.omega, start, 160, Options(steps=128))
    expected = np.sqrt((cycle.response[0, 1:] ** 2).sum())
    assert np.sqrt((problem.outputs(start)[0, 1:] ** 2).sum()) < 0.8 * expected
    assert single.amplitude[0] == pytest.approx(expected, rel=0.01)
    assert single.drift < 0.05


def test_the_coordinates_of_a_limit_cycle_are_those_of_its_contact(cycle):
    """With the circulatory forces: without them they miss the contact by as much as these do."""
    problem = replace(wave(), load_factor=0.0)
    x = cycle.state.flat
    result = coordinates(problem, x, cycle.state.cycle.force.reshape(x.shape), cycle.omega)
    expected = problem.basis.to_complex(x)
    for position, h in enumerate(problem.basis.harmonics):
        _, B = problem.model.at_harmonic(h)
        np.testing.assert_allclose(B @ result[position], expected[:, position], atol=1e-7 * np.abs(expected).max())


def test_a_limit_cycle_has_a_neutral_exponent_and_leaves_its_own_wave_stable(cycle):
    result = stability(wave(), cycle.state, top=9)
    base = result.exponents[result.diameters == 0]
    neutral = np.argmin(np.abs(base))
    assert abs(base[neutral]) < 2e-3 * cycle.omega
    assert np.delete(base, neutral).real.max() < 0


def test_the_limit_cycle_of_a_mistuned_wheel_is_what_time_integration_comes_to():
    """Sectors that differ by up to 2 %: the least damped mode of the whole wheel, within 1 % in every sector."""
    model = whole([1.02, 0.985, 1.0, 0.99, 1.005])
    problem = balance_of(model, tiny.N)
    names = problem.compliance.output_names
    result, _ = limit_cycles(problem, 1e-5, 2e-2, output="tip@0", options=BackboneOptions(n_points=30))
    assert result
    rows = [names.index(f"tip@{n}") for n in range(tiny.N)]
    expected = np.linalg.norm(result[0].response[rows, 1:], axis=1)
    assert np.ptp(expected) > 0.03 * expected.max()
    begin = result[0].state.x.copy()
    begin[..., 1:] *= 0.9
    start = problem.evaluate(result[0].omega, begin)
    single = march_freely(problem, result[0].omega, start, 240, Options(steps=128))
    np.testing.assert_allclose(single.amplitude[rows], expected, rtol=0.01)
