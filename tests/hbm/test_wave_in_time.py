"""Travelling waves in time, on as many sectors as they need, against the whole wheel and against the balance."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import tiny_wheel as tiny
from tribodyn.hbm import newton
from tribodyn.hbm.contact.contact_law import SLIPS
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import integrate, march_freely
from tribodyn.hbm.time.verify import verify
from tribodyn.reduction.unrolled import unrolled
from tribodyn.reduction.wave_model import travelling_wave

OMEGA = 120.0


@pytest.mark.parametrize(("order", "sectors"), [(2, 3), (-1, 6), (3, 2), (0, 1)])
def test_a_wave_in_time_is_the_whole_wheel_in_time(order, sectors):
    """Slipping, with Coriolis forces, on a wheel of six: the ring that the wave needs and all sectors agree."""
    item, wheel = tiny.wave_and_wheel(
        tiny.sector(("t1", "n"), 12.0, 6), "jenkins", order, (0, 1, 2, 3), 160.0, friction=0.4
    )
    result = newton.solve_from_rest(item, OMEGA)
    assert result.converged
    assert item.model.sectors_in_time == sectors
    options = Options(steps=120, tolerance=1e-9)  # a whole number of them from sector to sector
    current = integrate(item, OMEGA, result.state, options)
    everywhere = newton.solve(wheel, OMEGA, np.concatenate(tiny.spread(item, result.state.x, order, 6)))
    refined = integrate(wheel, OMEGA, everywhere.state, options)
    assert current.outcome == refined.outcome
    assert current.status[0] & SLIPS or order == 0
    names = wheel.compliance.output_names
    first = [names.index(f"{name}@0") for name in item.compliance.output_names]
    np.testing.assert_allclose(current.outputs, refined.outputs[first], atol=1e-7 * np.abs(refined.outputs).max())
    np.testing.assert_allclose(current.x, refined.x[:1], atol=1e-7 * np.abs(refined.x).max())
    assert current.energy.sum() == pytest.approx(refined.energy.sum() / 6, rel=1e-6, abs=1e-9)
    assert current.preload == pytest.approx(refined.preload / 6, rel=1e-6)


def test_a_wave_is_verified_and_left_alone_like_any_motion():
    item, _ = tiny.wave_and_wheel(tiny.sector(("t1", "n"), 12.0), "jenkins", 2, tuple(range(8)), 160.0, friction=0.4)
    result = newton.solve_from_rest(item, OMEGA)
    observed = verify(item, result.state, Options(steps=256))
    assert observed.largest < 5e-3
    assert observed.step_error < 5e-3
    assert list(observed.amplitude) == ["tip", "side"]
    single = march_freely(item, OMEGA, result.state, 20, Options(steps=256))
    assert single.energy == pytest.approx(item.energy(result.state).sum(), rel=1e-2)


def test_static_shapes_stand_for_modes_above_the_highest():
    """Compliance at contact, loads and outputs is kept when modes give way to static shapes."""
    reduced = tiny.sector(("n",))
    bare = replace(reduced, sector=replace(reduced.sector, system=replace(reduced.sector.system, outputs={})))
    wave = travelling_wave(bare, 2)
    full, complete = unrolled(wave, 0.1), unrolled(wave, 1e6)
    assert full.system.n_dof < complete.system.n_dof
    compliance = []
    for model in (complete, full):
        rows = np.concatenate([model.interface.B, np.array(list(model.system.loads.values()))])
        compliance.append(rows @ np.linalg.solve(model.system.stiffness, rows.T))
    np.testing.assert_allclose(compliance[1], compliance[0], rtol=1e-9, atol=1e-12 * compliance[0].max())
