"""The other contact laws on one mass: against time integration with the same law, and against closed forms."""

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.reduction.model import ReducedModel

STIFFNESS = np.array([4.0e4, 5.0e4, 6.0e4])
LOADS = ("along", "across", "press")


def mass_on_contact(components: tuple[str, ...]) -> ReducedModel:
    """m = 1.3 kg on springs t1, t2, n of its own, 2 % damping, loads and outputs named along, across, press."""
    used = [i for i, c in enumerate(("t1", "t2", "n")) if c in components]
    n, k = len(used), STIFFNESS[used]
    vectors = {LOADS[i]: np.eye(n)[j] for j, i in enumerate(used)}
    damping = np.diag(2 * 0.02 * np.sqrt(1.3 * k))
    system = SecondOrderSystem(1.3 * np.eye(n), np.diag(k), damping, vectors, vectors)
    return ReducedModel(system, interface(np.eye(n), components))


def solved(law, components, parameters, excitation, omega, top, transitions="sampled", n_samples=1024):
    basis = HarmonicBasis(tuple(range(top + 1)), n_samples, transitions)
    balance = HarmonicBalance.of(
        mass_on_contact(components), Joint("contact", law, parameters), basis, excitation, omega
    )
    solution = newton.solve_from_rest(balance, omega, NewtonOptions(tolerance=1e-10))
    assert solution.converged
    return balance, solution.state


@pytest.mark.parametrize("across", [2.0e4, 6.0e4], ids=["isotropic", "unequal springs"])
def test_planar_friction_on_an_ellipse_agrees_with_time_integration(across):
    """Rotating load and swinging press: the direction of slip turns all the time."""
    components = ("t1", "t2", "n")
    parameters = ContactParameters.of(components, [[2.0e4, across, 1.0e6]], friction=0.4)
    excitation = Excitation.of({"press": 80.0, "along": 5.0}, {1: {"along": 40.0, "across": 30.0j, "press": 20.0}})
    errors = []
    for top in (1, 3, 7):
        balance, state = solved("coulomb_planar", components, parameters, excitation, 190.0, top)
        assert state.cycle.status[0] & SLIPS
        result = verify(balance, state, Options(steps=2048))
        assert result.outcome == CONVERGED
        errors.append(result.largest)
    assert errors[-1] < 5e-3
    assert errors[-1] < errors[0]


@pytest.mark.parametrize("transitions", ["sampled", "located"])
@pytest.mark.parametrize(("law", "component", "number", "press", "load", "omega", "expected"), [
    ("jenkins_constant", "t1", {"friction": 0.4, "normal_load": 50.0}, {}, {"along": 45.0}, 100.0, STICKS | SLIPS),
    ("unilateral", "n", {"gap": 1e-4}, {"press": 20.0}, {"press": 25.0}, 210.0, STICKS | SEPARATES),
])  # fmt: skip
def test_one_component_alone_agrees_with_time_integration(
    law, component, number, press, load, omega, expected, transitions
):
    stiffness = 3.0e4 if component == "t1" else 6.0e4
    parameters = ContactParameters.of((component,), [[stiffness]], **number)
    balance, state = solved(law, (component,), parameters, Excitation.of(press, {1: load}), omega, 9, transitions)
    assert state.cycle.status[0] == expected
    result = verify(balance, state, Options(steps=2048))
    assert result.outcome == CONVERGED
    assert result.largest < 2e-3
    assert component == "t1" or balance.energy(state)[0] == 0.0
