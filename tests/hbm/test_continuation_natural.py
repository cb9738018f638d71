"""Natural continuation at folds: it jumps where the closed form has them, says so, and goes on."""

from dataclasses import replace

import numpy as np
import pytest

from proof import branches
from tests.helpers.continuation_models import Duffing, Lifting
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.hbm.continuation.methods.natural import Options
from tribodyn.hbm.outcome import BranchEnd


@pytest.mark.parametrize("n_points", [20, 80])
def test_a_sweep_jumps_at_the_fold_and_says_so(n_points):
    duffing = Duffing()
    low, high = duffing.folds()
    for start, stop, fold in ((0.5, 5.0, high), (5.0, 0.5, low)):
        branch = natural.follow(duffing.balance(), start, stop, Options(n_points=n_points))
        assert branch.omega[-1] == stop
        assert branch.converged.all()
        assert np.all(np.diff(branch.omega) * (stop - start) > 0)
        np.testing.assert_allclose(branch.omega[list(branch.folds)], [fold], rtol=1e-8)
        assert branch.ended is BranchEnd.JUMPED
        amplitude = branch.amplitude("mass")
        assert np.abs(duffing.defect(branch.omega, amplitude)).max() < 1e-5
        at = branch.folds[0]
        assert abs(amplitude[at + 1] - amplitude[at]) > 0.5 * amplitude[at]


def test_a_jump_that_newton_makes_by_itself_is_said():
    """One step lands on the other branch without a failure: what tells is that it does not lead back."""
    branch = natural.follow(Duffing().balance(), 5.0, 0.5, Options(n_points=27, refinements=0))
    assert branch.ended is BranchEnd.JUMPED
    assert not branch.folds
    halved = natural.follow(Duffing().balance(), 5.0, 0.5, Options(n_points=27))
    np.testing.assert_allclose(halved.omega[list(halved.folds)], [Duffing().folds()[0]], rtol=1e-8)


def test_a_lifting_mass_jumps_both_ways_at_the_folds_of_the_arc_length():
    balance = Lifting().balance((0, 1, 2, 3), transitions="located")
    round_them = arc_length.follow(balance, 0.9, 4.0)
    folds = np.sort(round_them.omega[list(round_them.folds)])
    for start, stop in ((0.9, 4.0), (4.0, 0.9)):
        branch = natural.follow(balance, start, stop, Options(n_points=60))
        assert branch.ended is BranchEnd.JUMPED
        assert branch.folds
        for fold in branch.omega[list(branch.folds)]:
            assert np.abs(folds / fold - 1).min() < 1e-8


def test_it_jumps_in_the_load_too():
    path = parameter.load(Duffing().balance(), 2.0)
    folds = arc_length.follow(path, 0.0, 12.0)
    for (start, stop), fold in zip(((0.0, 12.0), (12.0, 0.0)), folds.folds, strict=True):
        branch = natural.follow(path, start, stop, Options(n_points=25))
        assert branch.ended is BranchEnd.JUMPED
        np.testing.assert_allclose(branch.parameter[list(branch.folds)], folds.parameter[fold], rtol=1e-8)


@pytest.mark.parametrize("seed", [13, 30, 34, 87])
def test_planar_friction_at_the_default_samples_is_followed_to_the_end(seed: int) -> None:
    """Two lost their whole curve to a search for a periodic slider, two ended at a value without a solution."""
    problem = branches.problem(seed, "sampled")
    contact = problem.balance.contact
    planar = replace(contact, joints=tuple(replace(joint, law="coulomb_planar") for joint in contact.joints))
    springs = contact.stiffness[:, [0, 0, 2]]
    planar = planar.with_parameters(lambda parameters: replace(parameters, stiffness=springs))
    balance = replace(problem.balance, contact=planar, memory=np.zeros((contact.n_pair, 2)))
    branch = natural.follow(balance, problem.low, problem.high, Options(n_points=41))
    assert branch.omega[-1] == problem.high, branch.end
    unsolved = [f"{hertz:.6g} Hz" for hertz in branch.frequency[~branch.converged]]
    assert all(place in str(branch.end) for place in unsolved)
