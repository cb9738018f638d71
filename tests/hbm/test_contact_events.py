"""Transitions of any law located from its own steps: beside the closed forms of laws that locate them themselves."""

from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from tests.helpers.contact_draws import HARMONICS, ONE_SLIDER, law_id
from tests.helpers.continuation_models import pressed_slab
from tests.helpers.verification_models import oscillator
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import contact_law, event_cycle
from tribodyn.hbm.contact.contact_law import STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint, joint_transitions
from tribodyn.hbm.contact.law_check import draw
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis

OWN = '''
"""A law of one's own that has its steps alone."""
from dataclasses import dataclass
from tribodyn.declarations import number
from tribodyn.hbm.contact.laws.{name} import COMPONENTS, n_state, step
'''
FRICTION = '''
@dataclass(frozen=True)
class Parameters:
    friction: float = number("", low=0.0)
    """Coulomb coefficient."""
'''


@pytest.mark.parametrize(("name", "components"), ONE_SLIDER, ids=law_id)
@pytest.mark.parametrize("harmonics", HARMONICS, ids=str)
def test_forces_and_jacobians_are_those_of_the_closed_form(name, components, harmonics):
    law, basis = contact_law.load(name), HarmonicBasis(harmonics, 16, "located")
    x, parameters, memory = draw(name, components, basis, 40, seed=7)
    exact = law.event_based_cycle(x, parameters, memory, basis, True)
    computed = event_cycle.cycle(law, x, parameters, memory, basis, True)
    size = np.abs(exact.force).max()
    np.testing.assert_allclose(computed.force, exact.force, atol=1e-10 * size)
    np.testing.assert_allclose(computed.jacobian, exact.jacobian, atol=2e-5 * np.abs(exact.jacobian).max())
    assert (computed.status == exact.status).mean() > 0.95  # but where a transition merely grazes
    single = event_cycle.cycle(law, x, parameters, memory, basis, False)
    np.testing.assert_allclose(single.force, exact.force, atol=1e-10 * size)
    assert single.jacobian is None


@numba.njit
def two_slopes(x, s, p, f, dfx, dfs, dsx, dss):
    """A spring that is three times as stiff beyond a limit on either side, and says nothing about it."""
    outside = max(abs(x[0]) - 0.4, 0.0)
    f[0] = p[0] * (x[0] + 2.0 * outside * (1.0 if x[0] > 0.0 else -1.0))
    dfx[0, 0] = p[0] * (3.0 if outside > 0.0 else 1.0)
    return STICKS


def test_a_kink_that_only_the_slope_tells_is_located():
    law, basis = SimpleNamespace(step=two_slopes), HarmonicBasis((0, 1, 2, 3), 16, "located")
    x = np.random.default_rng(5).normal(size=(20, 1, basis.n_coeff)) * 0.4
    parameters = ContactParameters.of(("n",), np.full((20, 1), 2.0))
    computed = event_cycle.cycle(law, x, parameters, np.zeros((20, 0)), basis)
    edges = np.linspace(0, 2 * np.pi, 200_001)
    t = 0.5 * (edges[1:] + edges[:-1])
    phi = basis.functions(t)
    motion = x[:, 0] @ phi.T
    outside = np.maximum(np.abs(motion) - 0.4, 0) * np.sign(motion)
    exact = 2.0 * (motion + 2 * outside) @ phi / len(t) * np.where(np.arange(basis.n_coeff) > 0, 2, 1)
    np.testing.assert_allclose(computed.force[:, 0], exact, atol=1e-8)
    step = 1e-6 * np.random.default_rng(6).normal(size=x.shape)
    ahead, back = (event_cycle.cycle(law, x + e * step, parameters, np.zeros((20, 0)), basis).force for e in (1, -1))
    slope = (computed.jacobian @ step.reshape(20, -1, 1))[..., 0]
    np.testing.assert_allclose(slope, (ahead - back)[:, 0] / 2, atol=1e-11)


def own_file(folder: Path, name: str) -> str:
    path = folder / f"my_{name}.py"
    path.write_text(OWN.format(name=name) + (FRICTION if name == "jenkins" else ""))
    return str(path)


def stop(law: str) -> HarmonicBalance:
    """A mass that hits an elastic stop, twenty times stiffer than its spring, at less than its resonant amplitude."""
    parameters = ContactParameters.of(("n",), [[20.0]], gap=1.0)
    return HarmonicBalance.of(
        oscillator(1.0, 1.0, 0.02, "n"), Joint("contact", law, parameters),
        HarmonicBasis((0, 1, 2, 3, 4, 5), 128, joint_transitions(Joint("contact", law, parameters))),
        Excitation.of(harmonic={1: {"force": 0.1}}), 10.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "name", "ends"), [(stop, "unilateral", (0.5, 2.5)), (pressed_slab, "jenkins", (4800.0, 6000.0))]
)
def test_a_law_of_ones_own_gives_the_same_curve_from_both_ends(make, name, ends, tmp_path):
    mine, theirs = make(own_file(tmp_path, name)), make(name)
    assert mine.basis.transitions == "located"
    for start, end in (ends, ends[::-1]):
        base, exact = (arc_length.follow(balance, start, end) for balance in (mine, theirs))
        assert str(base.end) == str(exact.end)  # reached, or turned back where the stop is within a loop of the curve
        assert len(base.folds) == len(exact.folds) >= 1
        np.testing.assert_allclose(base.omega[list(base.folds)], exact.omega[list(exact.folds)], rtol=1e-6)
        output = next(iter(mine.model.system.outputs))
        assert base.amplitude(output).max() == pytest.approx(exact.amplitude(output).max(), rel=1e-3)  # of its points
        harmonic = np.hypot(*base.response[:, 0, theirs.basis.order == 1].T)
        for omega, contact, amplitude in zip(base.omega, base.contact, harmonic, strict=True):
            x = contact.reshape(theirs.contact.n_pair, -1, contact.shape[-1])
            state = theirs.evaluate(omega, x, jacobian=False)
            assert newton.relative_residual(state, theirs.x_lin(omega)) < 1e-6
            y = theirs.outputs(state)[0]
            assert np.hypot(*y[theirs.basis.order == 1]) == pytest.approx(amplitude, rel=1e-6)
