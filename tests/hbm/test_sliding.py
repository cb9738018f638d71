"""A wedge that a load presses between two walls slides to where friction and the walls hold it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law import ContactParameters
from tribodyn.hbm.continuation.sliding import solve_along_friction
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.reduction.model import ReducedModel

LOAD, FRICTION, STIFFNESS, OMEGA = 1000.0, 0.3, 1e8, 100.0


def wedge(angle: float, rubs: bool = True) -> HarmonicBalance:
    """A rigid wedge with faces at an angle [rad] to its load, which moves along the load and across it."""
    sine, cosine = np.sin(angle), np.cos(angle)
    contact = np.array([[cosine, -sine], [sine, cosine], [cosine, sine], [sine, -cosine]])  # t1, n of each face
    system = SecondOrderSystem(
        np.eye(2), np.zeros((2, 2)), None, {"press": np.array([1.0, 0.0])}, {"sunk": np.array([1.0, 0.0])}
    )
    components = ("t1", "n") if rubs else ("n",)
    model = ReducedModel(system, interface(contact if rubs else contact[1::2], components))
    springs, numbers = np.full((2, len(components)), STIFFNESS), {"friction": FRICTION} if rubs else {}
    parameters = ContactParameters.of(components, springs, **numbers)
    faces = Joint("faces", "jenkins" if rubs else "unilateral", parameters)
    return HarmonicBalance.of(model, faces, HarmonicBasis((0, 1), 16), Excitation.of({"press": LOAD}, None), OMEGA)


@pytest.mark.parametrize("degrees", [10, 30, 50])
def test_a_wedge_slides_to_where_friction_holds_it(degrees: float) -> None:
    """Both faces slip: load = 2 N (sin a + mu cos a)."""
    angle = np.radians(degrees)
    balance = wedge(angle)
    found = solve_along_friction(balance, OMEGA, NewtonOptions())
    assert found is not None
    assert found.converged
    tangential, normal = found.state.cycle.force[:, :, 0].T
    expected = LOAD / 2 / (np.sin(angle) + FRICTION * np.cos(angle))
    assert normal == pytest.approx([expected] * 2, rel=1e-6)
    assert tangential == pytest.approx([FRICTION * expected] * 2, rel=1e-6)
    again = newton.solve(balance, OMEGA, found.state.x)
    assert again.converged
    assert again.steps == 0


def test_a_law_without_friction_has_no_such_way() -> None:
    assert solve_along_friction(wedge(0.5, rubs=False), OMEGA, NewtonOptions()) is None
