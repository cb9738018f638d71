"""A wedge that a load presses between two walls slides to where friction and the walls hold it."""

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.stiffening import solve_along_friction
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import SolveEnd
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
    result = solve_along_friction(balance, OMEGA, NewtonOptions())
    assert result.converged
    tangential, normal = result.state.cycle.force[:, :, 0].T
    expected = LOAD / 2 / (np.sin(angle) + FRICTION * np.cos(angle))
    assert normal == pytest.approx([expected] * 2, rel=1e-6)
    assert tangential == pytest.approx([FRICTION * expected] * 2, rel=1e-6)
    solution = newton.solve(balance, OMEGA, result.state.x)
    assert solution.converged
    assert solution.steps == 0


def test_a_law_without_friction_has_no_such_way() -> None:
    assert solve_along_friction(wedge(0.5, rubs=False), OMEGA, NewtonOptions()) is None


def shaken(force: float, stop: float = 0.0) -> HarmonicBalance:
    """A wedge that a load [N] shakes along its edge, while half of it presses; stop : spring along the edge [N/m]."""
    sine, cosine = np.sin(0.5), np.cos(0.5)
    faces = [[cosine, -sine, 0], [0, 0, 1], [sine, cosine, 0], [cosine, sine, 0], [0, 0, 1], [sine, -cosine, 0]]
    loads = {"press": np.array([1.0, 0.0, 0.0]), "shake": np.array([0.5, 0.0, 1.0])}
    system = SecondOrderSystem(np.eye(3), np.diag([0, 0, stop]), None, loads, {"along": np.array([0.0, 0.0, 1.0])})
    components = ("t1", "t2", "n")
    model = ReducedModel(system, interface(np.array(faces), components))
    parameters = ContactParameters.of(components, np.full((2, 3), STIFFNESS), friction=FRICTION)
    load = Excitation.of({"press": LOAD}, {1: {"shake": force}})
    return HarmonicBalance.of(model, Joint("faces", "jenkins", parameters), HarmonicBasis((0, 1), 64), load, OMEGA)


def test_a_wedge_that_walks_along_its_edge_is_refused_by_name() -> None:
    """In time it stays at 400 N and walks by 4 mm a period at 500 N."""
    fixed = arc_length.solve_along_load(shaken(400.0), OMEGA)
    assert fixed.converged
    assert np.hypot(*fixed.state.x[0, 1, 1:]) == pytest.approx(400 / (2 * STIFFNESS), rel=1e-4)
    assert np.abs(fixed.state.x[:, 1, 0]).max() < 1e-12
    for force, share in ((500.0, "86%"), (1500.0, "29%")):  # both are 430 N
        walks = arc_length.solve_along_load(shaken(force), OMEGA)
        assert walks.outcome.kind is SolveEnd.NOT_HELD
        assert f"from {share} of the vibration load on: every pair of faces slips along t2" in str(walks.outcome)
        assert arc_length.solve_along_load(shaken(force, 1e5), OMEGA).converged
