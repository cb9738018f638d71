"""Contact laws that need velocities and time: closed form, derivatives, time integration, multipliers."""

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.nonlinear_modes import backbone
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stability.exponents import stability
from tribodyn.hbm.stability.floquet import floquet_exponents
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal

STANDARD_SOLID = '''
import math
import numba
COMPONENTS = (("t1",),)
VELOCITY = True
def n_state(components): return 1
@numba.njit
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """Spring 1, dashpot 0.1, and a spring 0.8 in series with a dashpot: relaxation in 0.7 s."""
    dt, v = p[p.size - 1], x[1]
    decay = math.exp(-dt / 0.7)
    s[0] = x[0] - 0.7 * v + (s[0] - x[0] + v * (0.7 + dt)) * decay
    dsx[0, 0], dsx[0, 1], dss[0, 0] = 1.0 - decay, -0.7 + (0.7 + dt) * decay, decay
    f[0] = 1.8 * x[0] + 0.1 * v - 0.8 * s[0]
    dfx[0, 0], dfx[0, 1], dfs[0, 0] = 1.8 - 0.8 * dsx[0, 0], 0.1 - 0.8 * dsx[0, 1], -0.8 * decay
    return 1
'''
SPRINGS = np.array([[1.0, -0.3], [-0.3, 1.1]])


@pytest.fixture
def balance(tmp_path):
    (tmp_path / "solid.py").write_text(STANDARD_SOLID)
    system = SecondOrderSystem(np.eye(2), SPRINGS, 0.02 * np.eye(2), {"shake": np.eye(2)[0]}, {"tip": np.eye(2)[0]})
    model = ReducedModel(system, interface(np.eye(1, 2), ("t1",)))
    joint = Joint("solid", str(tmp_path / "solid.py"), ContactParameters.of(("t1",), [[1.0]]))
    return HarmonicBalance.of(model, joint, HarmonicBasis((1,), 1024), Excitation.of({}, {1: {"shake": 1.0}}), 5.0)


def test_a_standard_linear_solid_is_its_closed_form(balance):
    """Amplitude, derivative by frequency, time integration and multipliers."""
    omega = 1.3
    state = newton.solve_from_rest(balance, omega).state
    solid = 1.0 + 0.1j * omega + 0.8 * 0.7j * omega / (1 + 0.7j * omega)
    stiffness = SPRINGS + np.diag([solid, 0.0]) + (0.02j * omega - omega**2) * np.eye(2)
    tip = np.linalg.solve(stiffness, [1.0, 0.0])[0]
    assert balance.basis.to_complex(balance.outputs(state))[0, 0] == pytest.approx(tip, rel=1e-5)
    sides = [balance.evaluate(omega + side, state.x).residual for side in (1e-5, -1e-5)]
    np.testing.assert_allclose(balance.frequency_slope(state)[0], (sides[0] - sides[1]) / 2e-5, atol=1e-6)
    found = verify(balance, state, Options(steps=512))
    assert found.motion.periodic
    assert found.contact < 1e-4
    first_order = np.zeros((5, 5))
    first_order[:2, 2:4] = np.eye(2)
    first_order[2:4, :2], first_order[2:4, 2:4] = -SPRINGS - np.diag([1.8, 0.0]), -np.diag([0.12, 0.02])
    first_order[2, 4], first_order[4, 0], first_order[4, 4] = 0.8, 1 / 0.7, -1 / 0.7
    exact = np.sort(np.linalg.eigvals(first_order).real)[::-1][:4]
    np.testing.assert_allclose(floquet_exponents(balance, state, Options(steps=512)).real[:4], exact, rtol=2e-4)


def test_what_does_not_serve_velocities_refuses(balance):
    state = newton.solve_from_rest(balance, 1.0).state
    with pytest.raises(Refusal, match="Hill's method serves no contact law that needs velocities"):
        stability(balance, state)
    with pytest.raises(Refusal, match="'solid' needs velocities: it has no nonlinear modes"):
        backbone(balance, 1e-3, 1e-2, 0, "tip")
