"""Closed curves beside the main one: each step stays on its branch, whatever the length of the steps."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.helpers.continuation_models import Duffing
from tests.helpers.verification_models import oscillator
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.methods.arc_length import Options
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions

ZETA, FORCE = 0.01, 3.0  # x'' + 2 zeta x' + x + x^3 = FORCE cos(3 w t)
STEPS = [0.5, 1.0, 2.0]  # longest steps; the longer ones once left the closed curve, the first went round it thrice


def driven_in_the_third_harmonic() -> HarmonicBalance:
    model = oscillator(1.0, 0.5, ZETA * np.sqrt(2.0), "n")
    joint = Joint("contact", "cubic_spring", ContactParameters.of(("n",), [[0.5]], cubic=1.0))
    basis = HarmonicBasis((1, 3, 5, 7, 9), 32)
    return HarmonicBalance.of(model, joint, basis, Excitation.of(harmonic={3: {"force": FORCE}}), 6.0)


def subharmonic(balance: HarmonicBalance) -> np.ndarray:
    """A motion of three periods of the drive at 1.2 rad/s."""
    guess = np.zeros((1, 1, balance.basis.n_coeff))
    guess[0, 0, [0, 1, 2]] = -0.55, 0.04, -0.26
    solution = newton.solve(balance, 1.2, guess)
    assert solution.converged
    return solution.state.x


def monodromy(balance: HarmonicBalance, omega: float, x: np.ndarray) -> tuple[np.ndarray, float]:
    """Derivative of the period map at a motion of the balance, and by how much the motion misses its own start."""
    angle0 = balance.basis.functions(0.0)
    start = np.array([angle0 @ x, omega * (balance.basis.rate.T @ x) @ angle0])

    def rate(t, y):
        stiffness = 1 + 3 * y[0] ** 2
        force = FORCE * np.cos(3 * omega * t) - 2 * ZETA * y[1] - y[0] - y[0] ** 3
        first, second = y[2:4], y[4:6]
        return [y[1], force, *second, *(-stiffness * first - 2 * ZETA * second)]

    end = solve_ivp(rate, (0, 2 * np.pi / omega), [*start, 1, 0, 0, 1], rtol=1e-10, atol=1e-12).y[:, -1]
    return end[2:].reshape(2, 2), float(np.abs(end[:2] - start).max())


@pytest.mark.parametrize("stop", [4.5, 0.9], ids=["up", "down"])
@pytest.mark.parametrize("longest", STEPS)
def test_subharmonic_curve_closes_from_both_sides_at_every_step(longest, stop):
    balance = driven_in_the_third_harmonic()
    options = Options(max_step=longest, width=0.33 / abs(stop - 1.2), bounds=(0.2, 6.0), guess=subharmonic(balance))
    branch = arc_length.follow(balance, 1.2, stop, options)
    assert str(branch.end).startswith("closed curve"), branch.end
    base = balance.basis.order % 3 != 0  # what the drive does not move on the main branch
    assert np.abs(branch.contact[:, 0, base]).max(axis=1).min() > 0.05
    assert len(branch.folds) == 2
    for i in branch.folds:  # a fold is where a multiplier of the motion, integrated in time, is one
        matrix, miss = monodromy(balance, branch.omega[i], branch.contact[i, 0])
        assert miss < 1e-3
        assert abs(np.linalg.det(np.eye(2) - matrix)) < 1e-3
    np.testing.assert_allclose(np.sort(branch.omega[list(branch.folds)]), [1.07039931, 4.13303918], rtol=1e-7)


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["up", "down"])
@pytest.mark.parametrize("longest", STEPS)
def test_superharmonic_curve_closes_from_both_sides_at_every_step(longest, way):
    """Driven at 0.55 rad/s the third harmonic resonates: between two loads three motions live side by side. A drive
    that grows to just above the lower of the two loads makes the two with the large third harmonic a closed curve."""
    omega, balance = 0.55, Duffing(zeta=0.005, force=1.5).balance((1, 3, 5, 7))
    branch = arc_length.follow(parameter.load(balance, omega), 0.0, 3.0, Options(width=0.3))
    low, high = sorted(branch.folds, key=lambda i: branch.parameter[i])
    fold, dip = branch.parameter[low], 0.1
    assert np.linalg.norm(branch.contact[low, 0, 2:4]) > 3 * np.linalg.norm(branch.contact[low, 0, :2])
    island = Parameter("detuning", lambda v: balance.with_load(fold + dip - v * v), omega)
    upper = branch.contact[low + 2].reshape(1, 1, -1)
    at = float(np.sqrt(fold + dip - branch.parameter[low + 2]))
    guess = _along(island, at, upper)
    options = Options(max_step=longest, width=0.3, bounds=(-2.0, 2.0), guess=guess)
    ring = arc_length.follow(island, 0.0, way, options)
    assert str(ring.end).startswith("closed curve"), ring.end
    np.testing.assert_allclose(np.sort(ring.parameter[list(ring.folds)]), [-np.sqrt(dip), np.sqrt(dip)], rtol=1e-6)
    assert branch.parameter[high] > fold + dip


def _along(path: Parameter, start: float, x: np.ndarray) -> np.ndarray:
    """The motion at the value zero, by steps from a motion at another value."""
    for value in np.linspace(start, 0.0, 12):
        solution = newton.solve(*path.place(value), x, NewtonOptions())
        assert solution.converged
        x = solution.state.x
    return x
