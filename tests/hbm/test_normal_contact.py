"""Unilateral contact alone: only normal unknowns, rigid-body modes, moving ground, chattering and impact wear."""

import numpy as np
import pytest

from proof.chatter import chatter, sign_changes
from tests.helpers.verification_models import floating_beam
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.expansion import SingularStuckSystem
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.wear.law import Exposure
from tribodyn.hbm.wear.laws.impact import impact_work, loading_work
from tribodyn.reduction.model import ReducedModel

STIFFNESS = 50.0
TIGHT = NewtonOptions(tolerance=1e-12)
OMEGA = 5.0


def balance_of(
    model: ReducedModel, excitation: Excitation, harmonics=(0, 1, 2, 3), stiffness=STIFFNESS, gap=0.0, samples=256
) -> HarmonicBalance:
    n = model.interface.n_pair
    parameters = ContactParameters.of(("n",), np.full((n, 1), stiffness / n), gap=gap)
    return HarmonicBalance.of(
        model, Joint("contact", "unilateral", parameters), HarmonicBasis(harmonics, samples), excitation, 2 * OMEGA
    )


def shaken(shake: complex = 0.3, **options) -> HarmonicBalance:
    return balance_of(floating_beam(), Excitation.of({"press": 1.0}, {1: {"shake": shake}}), **options)


def test_one_unknown_for_each_pair_and_coefficient():
    balance = shaken()
    assert balance.n_unknown == 9 * 1 * 7
    assert balance.memory.size == 0
    state = balance.evaluate(OMEGA, balance.stuck(OMEGA))
    assert state.x.shape == (9, 1, 7)
    assert state.cycle.jacobian.shape == (9, 7, 7)


def test_rigid_modes_of_the_free_part_are_solved_without_any_help():
    balance = shaken(shake=0.25)
    system = balance.model.system
    free = np.linalg.eigvalsh(system.stiffness)
    assert (np.abs(free[:2]) < 1e-9 * free[2]).all()
    solution = newton.solve_from_rest(balance, OMEGA, TIGHT)
    assert solution.converged
    status = solution.state.cycle.status
    assert {STICKS, SEPARATES | STICKS} <= set(status.tolist())
    # the full equations of motion, with the singular stiffness as it is, harmonic by harmonic
    basis, force = balance.basis, solution.state.cycle.force.reshape(9, -1)
    q = basis.to_complex(_coordinates(balance, solution.state))
    load = np.zeros((9, 4), complex)
    load[:, 0], load[:, 1] = system.loads["press"], 0.25 * system.loads["shake"]
    load -= balance.model.interface.B.T @ basis.to_complex(force)
    for column, h in enumerate(basis.harmonics):
        s = 1j * h * OMEGA
        residual = (system.stiffness + s * system.damping + s**2 * system.mass) @ q[:, column] - load[:, column]
        assert np.abs(residual).max() < 1e-9 * np.abs(load).max()
    np.testing.assert_allclose(-q.real[:, 0], solution.state.x[:, 0, 0], rtol=1e-8)


def _coordinates(balance, state):
    """Coordinates of the model of a state, over the stuck system."""
    basis, system, B = balance.basis, balance.model.system, balance.model.interface.B
    k = balance.contact.stiffness.ravel()
    base = 0.0 if balance.excitation.base is None else balance.excitation.base
    pull = basis.to_complex(k[:, None] * (state.flat + base) - state.cycle.force.reshape(len(k), -1))
    columns = []
    for i, h in enumerate(basis.harmonics):
        s = 1j * h * state.omega
        force = B.T @ pull[:, i]
        for (order, name), value in balance.excitation.loads.items():
            if order == h:
                force = force + value * system.loads[name]
        D = system.stiffness + B.T @ (k[:, None] * B) + s * system.damping + s**2 * system.mass
        columns.append(np.linalg.solve(D, force))
    return basis.to_real(np.stack(columns, axis=-1))


def test_rigid_modes_agree_with_time_integration():
    balance = shaken(shake=0.25, harmonics=tuple(range(14)))
    solution = newton.solve_from_rest(balance, OMEGA)
    assert_agrees_in_time(balance, solution.state)


def assert_agrees_in_time(balance: HarmonicBalance, state: State) -> None:
    motion = time_integration.integrate(balance, OMEGA, state, Options(steps=2048))
    theirs = motion.coefficients(motion.outputs, balance.basis)
    assert np.abs(balance.outputs(state) - theirs).max() < 2e-3 * np.abs(theirs).max()
    assert motion.outcome == CONVERGED


def test_a_part_that_nothing_holds_is_refused():
    with pytest.raises(SingularStuckSystem, match="rigid body"):
        shaken(stiffness=0.0)


@pytest.mark.parametrize("samples", [64, 256])
def test_moving_ground_equals_the_motion_relative_to_it(samples):
    rng = np.random.default_rng(1)
    model = floating_beam()
    basis = HarmonicBasis((0, 1, 2, 3), samples)
    amplitudes = np.zeros((9, 4), complex)
    amplitudes[:5, 0] = 2e-3 * rng.normal(size=5)  # five of the nine nodes stand on ground that moves
    amplitudes[:5, 1] = 4e-3 * (rng.normal(size=5) + 1j * rng.normal(size=5))
    base = basis.to_real(amplitudes)
    loads = {(0, "press"): 1.0, (1, "shake"): 0.2 - 0.1j}
    moving = balance_of(model, Excitation(loads, base), samples=samples)
    # q = q_ground + r with B q_ground = base: inertia, damping and stiffness of q_ground load the relative motion
    ground = np.linalg.solve(model.interface.B, amplitudes)
    s = model.system
    extra = {
        f"ground {h} {part}": getattr(
        -(s.stiffness + 1j * h * OMEGA * s.damping - (h * OMEGA) ** 2 * s.mass) @ ground[:, h], part ) for h in (0, 1)
        for part in ("real", "imag")
    }  # fmt: skip
    system = type(s)(s.mass, s.stiffness, s.damping, {**s.loads, **extra}, s.outputs)
    extra_loads = {(h, f"ground {h} {part}"): unit for h in (0, 1) for part, unit in (("real", 1.0), ("imag", 1j))}
    relative = balance_of(ReducedModel(system, model.interface), Excitation({**loads, **extra_loads}), samples=samples)
    ours, theirs = (newton.solve_from_rest(b, OMEGA, TIGHT) for b in (moving, relative))
    assert ours.converged
    assert theirs.converged
    assert len(set(ours.state.cycle.status.tolist())) > 1
    np.testing.assert_allclose(ours.state.x, theirs.state.x, atol=1e-9 * np.abs(theirs.state.x).max())
    refined = basis.to_real(ground[-1:])
    np.testing.assert_allclose(moving.outputs(ours.state), relative.outputs(theirs.state) + refined, atol=1e-11)
    slope = moving.frequency_slope(ours.state)[0]
    step = 1e-5
    before, after = (moving.evaluate(OMEGA + d, ours.state.x).residual for d in (-step, step))
    np.testing.assert_allclose(slope, (after - before) / (2 * step), atol=1e-6 * np.abs(slope).max())


def test_moving_ground_agrees_with_time_integration():
    basis_base = HarmonicBasis(tuple(range(14)), 256)
    amplitudes = np.zeros((9, 14), complex)
    amplitudes[:4, 0], amplitudes[:4, 1] = -4e-3, 24e-3j
    balance = balance_of(
        floating_beam(), Excitation({(0, "press"): 1.0}, basis_base.to_real(amplitudes)), harmonics=tuple(range(14))
    )
    solution = newton.solve_from_rest(balance, OMEGA)
    assert (solution.state.cycle.status & SEPARATES).any()
    assert_agrees_in_time(balance, solution.state)


def test_sign_changes_of_a_cosine_are_its_roots():
    basis = HarmonicBasis((0, 1), 8)
    np.testing.assert_allclose(sign_changes(basis, np.array([0.5, 1.0, 0.0]), 0.0), [2 * np.pi / 3, 4 * np.pi / 3])
    assert len(sign_changes(basis, np.array([1.5, 1.0, 0.0]), 0.0)) == 0
    assert len(sign_changes(basis, np.array([1.0, 1.0, 0.0]), 0.0)) == 0  # grazing
    assert len(sign_changes(basis, np.zeros(3), 0.0)) == 0
    large = HarmonicBasis(tuple(range(8)), 32)
    rng = np.random.default_rng(0)
    for _ in range(20):
        c = rng.normal(size=large.n_coeff)
        angle = np.linspace(0, 2 * np.pi, 20001)
        value = large.functions(angle) @ c - 0.3
        rough = angle[:-1][np.sign(value[1:]) != np.sign(value[:-1])]
        result = sign_changes(large, c, 0.3)
        assert len(result) == len(rough)
        np.testing.assert_allclose(result, rough, atol=4e-4)


KNOWN = np.zeros((9, 1, 3))  # three pairs always closed, never, and by 0.5 + sin for 2/3 of the cycle
KNOWN[:3, 0] = [[1.0, 0.5, 0.0], [-1.0, 0.5, 0.0], [0.5, 0.0, 1.0]]


def test_chatter_of_a_cycle_that_is_known():
    balance = shaken(harmonics=(0, 1))
    result = chatter(balance, balance.evaluate(OMEGA, KNOWN))
    period = 2 * np.pi / OMEGA
    np.testing.assert_allclose(result.touching[:3], [1.0, 0.0, 2 / 3])
    np.testing.assert_allclose(result.contact_duration[:3], period * result.touching[:3])
    assert list(map(len, result.closing[:3])) == [0, 0, 1]
    np.testing.assert_allclose(result.opening[2] / period, [7 / 12])
    np.testing.assert_allclose(result.closing[2] / period, [11 / 12])
    np.testing.assert_allclose(result.impact_velocity[:3], [0, 0, OMEGA * np.sqrt(0.75)])
    with_gap = chatter(balance.with_gap(np.full(9, 0.5)), balance.evaluate(OMEGA, KNOWN))
    assert with_gap.touching[2] == pytest.approx(0.5)


def test_impact_work_is_that_of_the_deepest_compression():
    balance = shaken(harmonics=(0, 1), samples=4096)
    k = balance.contact.stiffness[0, 0]
    base = {"coefficient": np.full(9, 3e-12)}
    exposure = Exposure(balance, balance.evaluate(OMEGA, KNOWN), np.full(9, 2e-4), base, np.zeros(9), 0.0)
    np.testing.assert_allclose(impact_work(exposure)[:3], [0.0, 0.0, k * 1.5**2 / 2], rtol=1e-5)
    angle = 2 * np.pi * np.arange(400) / 400
    spring = 0.2 + 0.1 * np.cos(angle)
    assert loading_work(7.0 * spring, spring) == pytest.approx(7.0 * (0.3**2 - 0.1**2) / 2, rel=1e-9)
