"""Many pairs with variable normal load and separation: balance against time integration as harmonics are added."""

from itertools import pairwise

import numpy as np
import pytest

from tests.helpers.three_pairs import FLIPS_AT, three_pairs
from tests.helpers.verification_models import slab
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import Verification, verify

BESIDE_RESONANCE = (900.0, 60.0, 12.0)  # frequency [Hz], shaking and rocking force [N]: all pairs slip, most lift
ABOVE_RESONANCE = (2500.0, 40.0, 40.0)  # pairs that stay stuck, pairs that slip, pairs that lift


def slab_balance(case: tuple[float, float, float], top: int) -> HarmonicBalance:
    """A slab of 55 pairs that slides, rocks and lifts at its edges, harmonics 0 to top."""
    hertz, shake, rock = case
    model = slab(11, 5)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(20e6, 30e6), friction=0.4)
    excitation = Excitation.of({"press": 100.0}, {1: {"shake": shake, "rock": 1j * rock}})
    basis = HarmonicBasis(tuple(range(top + 1)), 512, "located")
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 2 * np.pi * hertz)


def slab_verified(
    case: tuple[float, float, float], top: int, steps: int = 512
) -> tuple[np.ndarray, tuple[float, float, float], Verification]:
    """Status of every pair, errors (scalars, waveform of an output, waveforms of all pairs) and the comparison."""
    omega = 2 * np.pi * case[0]
    balance = slab_balance(case, top)
    solution = newton.solve_from_rest(balance, omega)
    assert solution.converged
    result = verify(balance, solution.state, Options(steps=steps))
    assert result.outcome == CONVERGED
    return solution.state.cycle.status, (result.largest, result.waveform["edge"], result.contact), result


@pytest.mark.parametrize(("tops", "steps"), [((7,), 256), pytest.param((1, 3, 5, 7, 9), 512, marks=pytest.mark.slow)])
def test_55_pairs_of_which_some_stick_some_slip_and_some_lift_agree_with_time_integration(tops, steps):
    errors = {}
    for top in tops:
        status, errors[top], result = slab_verified(ABOVE_RESONANCE, top, steps)
    assert status.shape == (55,)
    assert np.sum(status & SEPARATES > 0) == 24
    assert np.sum(status & SLIPS > 0) == 38
    assert np.sum(status == STICKS) == 17
    assert max(errors[7]) < 0.002
    if 1 in tops:
        assert errors[7][0] < errors[1][0]  # from 5 on the scalars are at the error of the time integration
    for a, b in pairwise(tops):
        assert errors[b][1] < errors[a][1]
        assert errors[b][2] < errors[a][2]
    assert result.step_error < 1e-3
    assert result.drift < 1e-8


@pytest.mark.slow
def test_55_sliding_pairs_of_which_40_lift_agree_with_time_integration_within_one_per_cent_at_seven_harmonics():
    errors = {}
    for top in (5, 7, 9):
        status, errors[top], result = slab_verified(BESIDE_RESONANCE, top)
    assert np.sum(status & SEPARATES > 0) == 40
    assert np.all(status & SLIPS > 0)
    assert np.all(status & STICKS > 0)
    assert max(errors[7]) < 0.01
    assert errors[5][1] > errors[7][1] > errors[9][1]
    assert errors[5][2] > errors[7][2] > errors[9][2]
    assert result.step_error < 3e-4
    assert result.drift < 1e-8


@pytest.mark.slow
def test_four_periodic_motions_at_one_frequency_and_time_integration_finds_each():
    """Two curves with a fold each pass 800 Hz: which motion a solve from rest finds is a matter of its way."""
    computed = {}
    for start, stop in ((700.0, 900.0), (900.0, 700.0)):
        balance = slab_balance((900.0, 60.0, 12.0), 7)
        branch = arc_length.follow(balance, 2 * np.pi * start, 2 * np.pi * stop)
        assert str(branch.end) == f"turned back to {start:g} Hz"
        assert len(branch.folds) == 1
        f = branch.frequency
        for i in np.flatnonzero((f[1:] - 800.0) * (f[:-1] - 800.0) < 0):
            share = (800.0 - f[i]) / (f[i + 1] - f[i])
            guess = (1 - share) * branch.contact[i] + share * branch.contact[i + 1]
            solution = newton.solve(balance, 2 * np.pi * 800.0, guess.reshape(55, 3, -1))
            assert solution.converged
            lifting = int(np.sum(solution.state.cycle.status & SEPARATES > 0))
            computed[lifting] = verify(balance, solution.state, Options(steps=512))
    assert sorted(computed) == [5, 15, 50, 55]
    for result in computed.values():
        assert result.outcome == CONVERGED
        assert max(result.largest, result.waveform["edge"], result.contact) < 0.01


@pytest.mark.parametrize("law", ["jenkins", "coulomb_planar"])
def test_coupled_structure_near_resonance_approaches_time_integration(law):
    errors = []
    for top in (1, 3, 7, 15):
        balance = three_pairs(friction=0.3, static=30.0, shaker=60.0, top=top, law=law).with_samples(
            1024, located=False
        )
        solution = newton.solve_from_rest(balance, FLIPS_AT)
        assert solution.converged
        result = verify(balance, solution.state, Options(steps=2048))
        assert result.outcome == CONVERGED
        assert np.all(solution.state.cycle.status == STICKS | SLIPS | SEPARATES)
        errors.append(max(result.largest, result.contact))
    assert all(b < a for a, b in pairwise(errors))
    assert errors[-1] < 5e-3
