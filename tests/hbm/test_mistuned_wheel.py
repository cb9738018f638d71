"""Blades that differ, with contact on every blade, on the reduced sector, against the whole wheel as a dense model."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import small_wheel as small
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SLIPS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.harmonics import HarmonicBasis, amplitude
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.hbm.mistuned_wheel import MistunedWheel
from tribodyn.reduction import nominal_modes
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.wave_model import travelling_wave, wheel_model

ORDER = 1
BASIS, HIGHEST = HarmonicBasis((0, 1), 64), 2 * np.pi * 1000
DIFFERENT = np.array([0.03, -0.02, 0.01, -0.04, 0.02, 0.0, -0.01, 0.04])
EXACT = newton.NewtonOptions(tolerance=1e-11)


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    """On a rigid disk: few coordinates, so that all shapes can be kept."""
    return small.reduced_sector(tmp_path_factory.mktemp("wheel") / "s.msh")


@pytest.fixture(scope="module")
def flexible(tmp_path_factory):
    """On a flexible disk."""
    return small.reduced_sector(tmp_path_factory.mktemp("wheel") / "s.msh", 0.02)


def damped(model):
    return model.with_damping(lambda system, B: modal_damping(system, 0.01))


def springs(reduced):
    return reduced.sector.interface.stiffness(*small.STIFFNESS)


def joint(k, friction=0.3, gap=0.0):
    return Joint("contact", "jenkins", ContactParameters.of(("t1", "t2", "n"), k, friction=friction, gap=gap))


def on_sector(reduced, families=None, left_out=1e-6):
    """The wheel on its sector, with so many families of shapes; all shapes by default."""
    K, k = np.asarray(reduced.sector.system.stiffness), springs(reduced)
    if families is None:
        shapes = nominal_modes.orthonormal(K, np.eye(len(K)), 1e-13)
    else:
        shapes = nominal_modes.nominal_shapes(reduced, k, K, families, list(small.LOADS), left_out)
    model = damped(travelling_wave(nominal_modes.with_ports(reduced, K, shapes), ORDER))
    wave = HarmonicBalance.of(model, joint(k), BASIS, small.excitation(), HIGHEST)
    return MistunedWheel(wave, tuple(nominal_modes.port_name(i) for i in range(shapes.shape[1])))


def whole(reduced, deviation, friction=0.3, gap=0.0):
    """All sectors as one dense model, its damping that of sectors alike."""
    equal, model = damped(wheel_model(reduced)), wheel_model(reduced, 1 + deviation)
    model = replace(model, system=replace(model.system, damping=equal.system.damping))
    k = np.tile(springs(reduced), (small.N, 1))
    load = waves.on_wheel(small.excitation(), ORDER, small.N)
    return HarmonicBalance.of(model, joint(k, friction, gap), BASIS, load, HIGHEST)


def tips(balance, outputs):
    names = list(balance.compliance.output_names)
    return outputs[[names.index(f"tip@{n}") for n in range(small.N)]]


def apart(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def test_the_linear_wheel_is_the_dense_one(reduced):
    """Responses, compliance of the contacts and slopes over frequency, every shape kept."""
    ours, dense = on_sector(reduced).balance(DIFFERENT), whole(reduced, DIFFERENT)
    point, refined = ours.at(2 * np.pi * 310), dense.at(2 * np.pi * 310)
    g = np.random.default_rng(0).normal(size=point.x_lin.shape)
    assert apart(point.x_lin, refined.x_lin) < 1e-9
    assert apart(tips(ours, point.outputs_lin), tips(dense, refined.outputs_lin)) < 1e-9
    assert apart(point.apply(g), refined.apply(g)) < 1e-9
    assert apart(point.jacobian_product(np.arange(len(g)))(g), refined.apply(g)) < 1e-4  # single precision
    for part, factor in ((1.0, 0.0), (0.0, 1.0), (1.0, 0.7)):
        mine, theirs = point.slope(part * g, factor), refined.slope(part * g, factor)
        assert apart(mine[0], theirs[0]) < 1e-7
        assert apart(tips(ours, mine[1]), tips(dense, theirs[1])) < 1e-7


def test_few_nominal_shapes_carry_the_linear_wheel(flexible):
    """Amplitudes of all blades within 1e-6 on a fifth of the shapes, and the coarser choice within 1e-3."""
    deviation, hertz = 0.5 * DIFFERENT, (300.0, 310.0, 330.0)
    dense = whole(flexible, deviation)
    expected = np.array([amplitude(tips(dense, dense.at(2 * np.pi * f).outputs_lin), BASIS.harmonics) for f in hertz])
    assert np.ptp(expected, axis=1).min() > 0.01 * expected.max()
    for families, left_out, within in ((3, 1e-6, 1e-6), (1, 1e-2, 1e-3)):
        wheel = on_sector(flexible, families, left_out)
        ours = wheel.balance(deviation)
        values = np.array([amplitude(tips(ours, ours.at(2 * np.pi * f).outputs_lin), BASIS.harmonics) for f in hertz])
        assert apart(values, expected) < within
        assert len(wheel.ports) < 0.25 * len(flexible.sector.system.stiffness)


def test_friction_and_gap_that_differ_by_blade_are_the_dense_wheel(reduced):
    """Slipping and separating: to 1e-6 with all shapes, to 1e-3 with few of them."""
    factor, gap, deviation = 1 + 5 * DIFFERENT, 5e-5 * DIFFERENT, 0.5 * DIFFERENT
    n_pair = len(springs(reduced))

    def change(joint, sector):
        opened = replace(joint.parameters, gap=joint.parameters.gap + gap[sector])
        return replace(joint, parameters=opened).with_friction_scaled(factor[sector])

    dense = whole(reduced, deviation, np.repeat(0.3 * factor, n_pair), np.repeat(gap, n_pair))
    refined = newton.solve_from_rest(dense, 2 * np.pi * 250, EXACT)
    assert refined.converged
    assert (refined.state.cycle.status & SLIPS).any()
    for families, left_out, within in ((None, 0.0, 1e-6), (2, 1e-3, 1e-3)):
        ours = on_sector(reduced, families, left_out).balance(deviation, change)
        solution = newton.solve(ours, 2 * np.pi * 250, refined.state.x, EXACT)
        assert solution.converged
        assert apart(tips(ours, ours.outputs(solution.state)), tips(dense, dense.outputs(refined.state))) < within
        linear = ours.linearise(solution.state)
        d = np.random.default_rng(0).normal(size=solution.state.flat.shape)
        shifted = d - ours.at(solution.state.omega).apply(linear.departure_slope(d))
        assert apart(linear.dense() @ d.ravel(), shifted.ravel()) < 1e-10


def test_sectors_alike_are_the_wave(reduced):
    """Without deviation every blade moves as the travelling wave says, slipping, to 1e-8."""
    wheel = on_sector(reduced, 1, 1e-2)
    ours = wheel.balance(np.zeros(small.N))
    rows = [newton.solve_from_rest(balance, 2 * np.pi * 250, EXACT) for balance in (ours, wheel.wave)]
    assert all(item.converged for item in rows)
    tip = wheel.wave.outputs(rows[1].state)[wheel.wave.compliance.output_names.index("tip")]
    expected = np.array([waves.at_sector(BASIS, tip, ORDER, small.N, n) for n in range(small.N)])
    assert apart(tips(ours, ours.outputs(rows[0].state)), expected) < 1e-8


def test_what_cannot_be_is_one_sentence(reduced):
    wheel = on_sector(reduced, 1, 1e-2)
    with pytest.raises(ValueError, match="8 deviations of stiffness above -1"):
        wheel.balance(np.full(small.N, -1.0))
    with pytest.raises(ValueError, match="stability and integration in time need one"):
        wheel.balance(np.zeros(small.N)).model.at_harmonic(1)
