"""What solver and statements say of a state, each number found by a second way: sums over time, differences, ratios."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from proof.hard_settings.extremes_march import march_checks
from proof.hard_settings.extremes_models import lattice, rigid
from tribodyn.fem.interface import ContactInterface
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import recovery
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.wear.history import cycles_to_share
from tribodyn.hbm.wear.law import Exposure
from tribodyn.hbm.wear.laws import energy
from tribodyn.reduction.linear_damping import rayleigh, rayleigh_of_ratios
from tribodyn.workflows.errors.judgement import total_error
from tribodyn.workflows.errors.ladders import limit_of
from tribodyn.workflows.errors.operating_states import relative_change
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement
from tribodyn.workflows.run import scene_loads
from tribodyn.workflows.run.references import delta_max
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.load_tables import StaticLoad

BASIS = HarmonicBasis((0, 1, 2, 3), 64)


@pytest.fixture(scope="module", params=["located", "sampled"])
def solved(request: pytest.FixtureRequest) -> tuple[HarmonicBalance, State]:
    """Pairs that stick, slip and lift."""
    body = lattice(3, 3)
    balance = body.balance(replace(body.ordinary, harmonics=(0, 1, 2, 3), transitions=request.param))
    solution = arc_length.solve_along_load(balance, body.ordinary.omega)
    assert solution.converged
    return balance, solution.state


def test_transforms_are_each_others_inverse_and_the_rate_is_the_derivative() -> None:
    c = np.random.default_rng(0).normal(size=(5, BASIS.n_coeff))
    np.testing.assert_allclose(BASIS.from_time(BASIS.to_time(c)), c, atol=1e-13)
    step = 1e-6
    ahead, previous = (BASIS.functions(BASIS.angle + way * step) for way in (1, -1))
    np.testing.assert_allclose(BASIS.to_time(c @ BASIS.rate), c @ (ahead - previous).T / (2 * step), atol=1e-8)


def test_work_is_force_times_velocity_over_the_cycle() -> None:
    force, x = np.random.default_rng(1).normal(size=(2, 5, BASIS.n_coeff))
    fine = HarmonicBasis(BASIS.harmonics, 512)
    step = 1e-5
    speed = x @ (fine.functions(fine.angle + step) - fine.functions(fine.angle - step)).T / (2 * step)
    expected = (fine.to_time(force) * speed).sum(axis=1) * 2 * np.pi / fine.n_samples
    np.testing.assert_allclose(BASIS.work_per_cycle(force, x), expected, rtol=1e-8)


def test_forces_and_friction_work_are_those_of_a_plain_march(solved: tuple[HarmonicBalance, State]) -> None:
    assert [march_check.name for march_check in march_checks(*solved) if march_check.off > march_check.allowed] == []


def test_outputs_and_preload_follow_from_the_coordinates(solved: tuple[HarmonicBalance, State]) -> None:
    """Coordinates from M, C, K and the contact forces; what is pressed on is carried by contact and supports."""
    balance, state = solved
    shape = (-1, balance.basis.n_coeff)
    q = recovery.coordinates(balance, state.x.reshape(shape), state.cycle.force.reshape(shape), state.omega)
    row = balance.model.system.outputs["edge"]
    edge = balance.basis.to_real(np.array([[row @ item for item in q]]))
    place = balance.compliance.output_names.index("edge")
    np.testing.assert_allclose(balance.outputs(state)[place], edge[0], rtol=1e-6, atol=1e-9 * np.abs(edge).max())
    weight = np.zeros(len(q[0]))
    weight[len(weight) // 2 + 2 :: 3] = 1.0  # the upper layer moves up
    springs = weight @ np.asarray(balance.model.system.stiffness) @ q[0].real
    pressed = abs(np.real(balance.excitation.loads[0, "press"]))
    lower = np.zeros(len(q[0]))
    lower[2 : len(lower) // 2 : 3] = 1.0
    springs += lower @ np.asarray(balance.model.system.stiffness) @ q[0].real
    assert balance.preload(state) == pytest.approx(pressed + springs, rel=1e-6)


def test_the_slope_over_frequency_is_the_difference(solved: tuple[HarmonicBalance, State]) -> None:
    balance, state = solved
    result, outputs = balance.frequency_slope(state)
    step = 1e-5 * state.omega
    ends = [balance.evaluate(state.omega + way * step, state.x) for way in (1, -1)]
    residual = (ends[0].residual - ends[1].residual) / (2 * step)
    np.testing.assert_allclose(result, residual, atol=1e-5 * np.abs(residual).max())
    shifted = (balance.outputs(ends[0]) - balance.outputs(ends[1])) / (2 * step)
    np.testing.assert_allclose(outputs, shifted, atol=1e-5 * np.abs(shifted).max())


def test_a_converged_state_leaves_what_the_tolerance_says(solved: tuple[HarmonicBalance, State]) -> None:
    _, state = solved
    assert np.linalg.norm(state.residual) < 2 * NewtonOptions().tolerance * np.linalg.norm(state.x)


def test_the_load_factor_scales_vibration_alone(solved: tuple[HarmonicBalance, State]) -> None:
    balance, state = solved
    full, half = balance.x_lin(state.omega), balance.with_load(0.5).x_lin(state.omega)
    np.testing.assert_allclose(half, full * np.where(balance.basis.order > 0, 0.5, 1.0), rtol=1e-12)
    assert np.abs(full[:, balance.basis.order == 1]).max() > 0


def test_static_loads_add_up() -> None:
    loads = Excitation({(0, "a"): 2.0, (0, "b"): -3.0, (1, "a"): 5.0})
    computed = loads.force(0, {"a": np.array([1.0, 0.0]), "b": np.array([0.0, 1.0])}, 2)
    np.testing.assert_allclose(computed, [2.0, -3.0])


def test_rayleigh_gives_two_modes_their_ratios() -> None:
    system = lattice(2, 2).model.system
    alpha, beta = rayleigh_of_ratios(system, (1, 4), (0.01, 0.03))
    C = rayleigh(system, alpha, beta)
    values, phi = np.linalg.eigh(system.stiffness / system.mass[0, 0])
    phi = phi / np.sqrt(system.mass[0, 0])
    for mode, ratio in ((1, 0.01), (4, 0.03)):
        assert phi[:, mode] @ C @ phi[:, mode] == pytest.approx(2 * ratio * np.sqrt(values[mode]), rel=1e-9)


def test_the_cycles_to_a_share_lie_between_its_rows() -> None:
    assert cycles_to_share(np.array([0.0, 10.0, 20.0]), np.array([1.0, 0.1, 0.001]), 0.01) == pytest.approx(15.0)


def test_delta_max_of_a_wheel_is_half_the_mean_approach() -> None:
    approach, area = np.array([1.0, 4.0]), np.array([3.0, 1.0])
    assert delta_max(scene_file.read("blade").scene, approach, area) == pytest.approx(0.5 * 7 / 4)
    assert delta_max(scene_file.read("beam").scene, approach, area) == 4.0


def test_gravity_acts_along_its_direction_and_an_accelerated_ground_against_it() -> None:
    for key, sign in (("acceleration", 1.0), ("base_acceleration", -1.0)):
        load = StaticLoad(**{key: 9.81}, direction=(0.0, 0.0, 1.0))
        result = scene_loads.make_load(load, None, None, None)
        np.testing.assert_allclose(result.direction, [0, 0, sign])


def test_the_ground_moves_ahead_by_its_phase() -> None:
    """cos(w t + phase): a = cos(phase), b = -sin(phase)."""
    frames, none = np.eye(3)[None], np.zeros((1, 3))
    interface = ContactInterface(
        ("t1", "t2", "n"), none, frames, np.ones(1), np.zeros(1), np.zeros((3, 3)), np.zeros((0, 4), int)
    )
    moves = SimpleNamespace(static=0.0, harmonic=2.0, phase=0.3, direction=(1.0, 0.0, 0.0))
    scene = SimpleNamespace(motion={"foot": moves})
    part = SimpleNamespace(interface=interface, pairs={"foot": slice(0, 1)})
    computed = scene_loads.ground_motion(scene, part, HarmonicBasis((0, 1)))
    np.testing.assert_allclose(computed[0], [0.0, 2 * np.cos(0.3), -2 * np.sin(0.3)], atol=1e-15)


def test_a_sequence_of_known_order_is_extrapolated_to_its_limit() -> None:
    result = limit_of([1, 2, 4], [1 + 1.0, 1 + 0.25, 1 + 0.0625])
    assert (result.value, result.order) == (pytest.approx(1.0), pytest.approx(2.0))


@pytest.mark.parametrize(
    ("change", "ratio", "total"), [(0.01, 2.0, 0.025), (0.01, 1.5, 0.0375), (0.0, 2.0, 2.5e-3), (0.3, 2.0, 0.75)]
)
def test_the_total_error_extrapolates_the_change(change: float, ratio: float, total: float) -> None:
    row = MeasuredChange(Refinement.COMBINED, "energy", 1.0, 1.0, change, "")
    assert total_error([row], ratio)[0] == pytest.approx(total)


def test_a_change_is_relative_to_the_better_value() -> None:
    assert relative_change(1.1, 1.0) == pytest.approx(0.1)
    assert relative_change(-0.5, 1.0) == pytest.approx(1.5)
    assert (relative_change(0.0, 0.0), relative_change(1e-9, 0.0)) == (0.0, 1.0)


def test_the_energy_law_takes_off_its_coefficient_times_the_work(solved: tuple[HarmonicBalance, State]) -> None:
    balance, state = solved
    area, none = np.linspace(1e-6, 2e-6, len(state.x)), np.zeros(len(state.x))
    exposure = Exposure(balance, state, area, {"coefficient": np.full(len(area), 3e-15)}, none, 0.0)
    np.testing.assert_allclose(energy.depth_rate(exposure), 3e-15 * balance.energy(state) / area, rtol=1e-12)


def test_force_times_slip_is_the_friction_work_over_the_coefficient_of_friction() -> None:
    """One direction, constant pressure: N |ds| = 4 N (u - mu N / k) in a cycle."""
    body = rigid(1)
    balance = body.balance(replace(body.ordinary, samples=4096, transitions="sampled"))
    k, k_n = balance.contact.stiffness[0]
    x = np.zeros((1, 2, 3))
    x[0, 0, 1], x[0, 1, 0] = 3e-4, 100.0 / k_n
    exposure = Exposure(balance, balance.evaluate(1100.0, x), np.ones(1), {}, np.zeros(1), 0.0)
    assert exposure.normal_force_times_slip[0] == pytest.approx(4 * 100.0 * (3e-4 - 0.4 * 100.0 / k), rel=1e-4)


def test_a_peak_is_looked_for_where_the_line_through_two_distances_vanishes() -> None:
    rises, falls = (SimpleNamespace(omega=w, distance=d) for w, d in ((1.0, 2.0), (5.0, -6.0)))
    assert AmplitudeSlope.zero_with(rises, falls) == pytest.approx(2.0)


@pytest.mark.parametrize("transitions", ["located", "sampled"])
def test_forces_over_gaps_are_those_of_a_plain_march(transitions: str) -> None:
    body = lattice(2, 2)
    balance = body.balance(replace(body.ordinary, gap=-2e-6, transitions=transitions))
    solution = arc_length.solve_along_load(balance, body.ordinary.omega)
    assert solution.converged
    assert [
        march_check.name
        for march_check in march_checks(balance, solution.state)
        if march_check.off > march_check.allowed
    ] == []


def test_the_derivative_of_the_contact_forces_is_the_difference(solved: tuple[HarmonicBalance, State]) -> None:
    balance, state = solved
    jacobian, shape = balance.evaluate(state.omega, state.x).cycle.jacobian, state.x.shape
    step = 1e-7 * np.abs(state.x).max()
    for way in np.random.default_rng(0).normal(size=(3, *shape)):
        ends = [balance.evaluate(state.omega, state.x + side * step * way, False).cycle.force for side in (1, -1)]
        values = np.einsum("pij,pj->pi", jacobian, way.reshape(shape[0], -1)).reshape(shape)
        difference = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(values - difference).max() < 1e-4 * np.abs(difference).max()
