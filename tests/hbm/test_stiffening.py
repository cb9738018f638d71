"""Contacts far stiffer than the body, which lift and slip: solved, and held against the dense free structure."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from proof.hard_settings.extremes_march import march_checks
from proof.hard_settings.extremes_models import Setting, lattice
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.stiffening import solve_along_stiffness
from tribodyn.hbm.newton import NewtonOptions, Solution


@pytest.mark.parametrize(
    ("stiffness", "transitions"), [pytest.param(1e10, "sampled", marks=pytest.mark.slow), (1e12, "located")]
)
def test_a_stiff_contact_that_lifts_is_solved(stiffness: float, transitions: str) -> None:
    body = lattice(3, 2)
    setting = replace(body.ordinary, tangential=stiffness, normal=stiffness, transitions=transitions)
    balance, omega = body.balance(setting), setting.omega
    solution = arc_length.solve_along_load(balance, omega)
    assert solution.converged
    assert solution.products == 0  # directions of the dense Jacobian: it was solved by stiffening
    assert {4, 7} <= set(solution.state.cycle.status.tolist())
    _holds(balance, setting, solution)


@pytest.mark.parametrize("changes", [{"tangential": 1e15}, {"normal": 1e11}, {"normal": 1e15}], ids=str)
def test_springs_stiff_one_way_alone_are_solved(changes: dict[str, float]) -> None:
    """The soft ones keep their own stiffness on the way; normal ones touch for a thousandth of the cycle."""
    body = lattice(3, 3)
    setting = replace(body.ordinary, **changes)
    balance = body.balance(setting)
    solution = solve_along_stiffness(balance, setting.omega, NewtonOptions())
    assert solution is not None
    _holds(balance, setting, solution)


def _holds(balance: HarmonicBalance, setting: Setting, solution: Solution) -> None:
    """The motion of the free structure under the contact forces, and the forces of a march of its own."""
    state, omega = solution.state, setting.omega
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    force, x = (balance.basis.to_complex(a.reshape(len(b), -1)) for a in (state.cycle.force, state.x))
    loads = [setting.preload * system.loads["press"], setting.force * system.loads["shake"]]
    for h in (0, 1):  # the free structure under the contact forces, without the springs of the contact
        s = 1j * h * omega
        dynamic = system.stiffness + s * system.damping + s * s * system.mass
        expected = b @ np.linalg.solve(dynamic, loads[h] - b.T @ force[:, h])
        np.testing.assert_allclose(x[:, h], expected, atol=1e-6 * np.abs(expected).max())
    assert [
        march_check.name for march_check in march_checks(balance, state) if march_check.off > march_check.allowed
    ] == []


def test_the_limit_of_stiff_springs_is_come_to() -> None:
    """A contact ten times stiffer moves the forces by a third less: its touch is shorter by the third root."""
    body = lattice(2, 2)
    rows = []
    for stiffness in (1e10, 1e11, 1e12):
        setting = replace(body.ordinary, tangential=stiffness, normal=stiffness)
        solution = solve_along_stiffness(body.balance(setting), setting.omega, NewtonOptions())
        rows.append(solution.state.cycle.force[:, 2])
    steps = [np.linalg.norm(b - a) for a, b in pairwise(rows)]
    assert steps[1] < 0.7 * steps[0]
    assert steps[1] < 0.05 * np.linalg.norm(rows[-1])


def test_too_many_unknowns_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    body = lattice(2, 2)
    balance = body.balance(body.ordinary)
    monkeypatch.setattr(newton, "RULES", replace(newton.RULES, most_dense=balance.n_unknown - 1))
    assert solve_along_stiffness(balance, body.ordinary.omega, NewtonOptions()) is None
