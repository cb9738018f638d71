"""Many pairs with variable normal load and separation: balance against time integration as harmonics are added."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from hbm import newton
from hbm.balance import HarmonicBalance
from hbm.excitation import Excitation
from hbm.harmonics import HarmonicBasis
from hbm.law import SEPARATES, SLIPS, STICKS, ContactParameters
from hbm.time_integration import Options
from hbm.verify import Verification, verify
from tests.verification_models import random_structure, slab


def slab_verified(nx: int, ny: int, top: int, steps: int = 512) -> tuple[np.ndarray, Verification]:
    """Status of every pair, and the comparison, for a slab that slides, rocks and lifts at its edges."""
    model = slab(nx, ny)
    omega = 2 * np.pi * 800.0
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(20e6, 30e6), friction=0.4)
    excitation = Excitation.of({"press": 100.0}, {1: {"shake": 60.0, "rock": 12.0j}})
    basis = HarmonicBasis(tuple(range(top + 1)), 512)
    balance = HarmonicBalance(model, "jenkins", parameters, basis, excitation, omega)
    solution = newton.solve_from_rest(balance, omega)
    assert solution.converged
    result = verify(balance, solution.state, Options(steps=steps))
    assert result.outcome == "converged"
    return solution.state.cycle.status, result


def test_55_pairs_agree_with_time_integration_within_one_per_cent_at_seven_harmonics():
    errors = {}
    for top in (1, 3, 5, 7, 9):
        status, result = slab_verified(11, 5, top)
        errors[top] = (result.largest, result.waveform["edge"], result.contact)
    assert status.shape == (55,)
    assert np.sum(status & SEPARATES > 0) == 5  # partial separation: the pairs along one edge
    assert np.all(status & SLIPS > 0)
    assert np.sum(status & STICKS > 0) == 55
    assert max(errors[7]) < 0.01
    assert all(b[0] < a[0] for a, b in pairwise(errors.values()))
    assert all(b[1] < a[1] for a, b in pairwise(errors.values()))
    assert all(b[2] < a[2] for a, b in pairwise(errors.values()))
    assert result.step_error < 3e-4
    assert result.drift < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(("top", "bound"), [(15, 2e-3), (25, 1e-3)])
def test_55_pairs_keep_converging(top, bound):
    _, result = slab_verified(11, 5, top, steps=4096)
    assert max(result.largest, result.waveform["edge"], result.contact) < bound


@pytest.mark.parametrize("law", ["jenkins", "coulomb_planar"])
def test_coupled_structure_near_resonance_approaches_time_integration(law):
    omega = 305.3  # 3 % below the first mode without contact
    errors = []
    for top in (1, 3, 7, 15):
        model = random_structure(3)
        parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=0.3)
        excitation = Excitation.of({"static": 30.0}, {1: {"shaker": 60.0}})
        basis = HarmonicBasis(tuple(range(top + 1)), 1024)
        balance = HarmonicBalance(model, law, parameters, basis, excitation, omega)
        solution = newton.solve_from_rest(balance, omega)
        assert solution.converged
        result = verify(balance, solution.state, Options(steps=2048))
        assert result.outcome == "converged"
        assert np.all(solution.state.cycle.status == STICKS | SLIPS | SEPARATES)
        errors.append(max(result.largest, result.contact))
    assert all(b < a for a, b in pairwise(errors))
    assert errors[-1] < 5e-3
