"""Pseudo arc length: closed-form folds, kinks, corners, several pairs, parameters, and where it ends."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from tests.helpers.continuation_models import Duffing, Lifting, pressed_slab, rubbing_mass, rubbing_pairs
from tests.helpers.verification_models import random_structure
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.curve_stepper import CurveStepper
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.hbm.continuation.methods.arc_length import Options
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis


def test_duffing_has_both_folds_where_its_discriminant_vanishes():
    duffing = Duffing()
    exact = duffing.folds()
    up = arc_length.follow(duffing.balance(), 0.5, 5.0)
    down = arc_length.follow(duffing.balance(), 5.0, 0.5)
    for branch, far in ((up, 5.0), (down, 0.5)):
        assert branch.omega[-1] == far
        assert str(branch.end).startswith("reached")
        assert branch.converged.all()
        assert len(branch.omega) < 150
        np.testing.assert_allclose(np.sort(branch.omega[list(branch.folds)]), exact, rtol=1e-8)
        amplitude = branch.amplitude("mass")
        assert np.abs(duffing.defect(branch.omega, amplitude)).max() < 1e-5
        middle = (branch.omega[:-1] - 2.0) * (branch.omega[1:] - 2.0) < 0
        assert middle.sum() == 3  # the curve passes each frequency between the folds three times
    low = np.argsort(down.amplitude("mass")[list(down.folds)])
    assert down.omega[down.folds[low[1]]] > down.omega[down.folds[low[0]]]  # hardening: the high fold lies right


def test_lifting_mass_softens_and_folds_as_in_closed_form():
    lifting = Lifting()
    precise = {"method": "bounded", "options": {"xatol": 1e-10}}
    lower = minimize_scalar(lambda a: lifting.omega(a, -1), bounds=(3.0, 5.1), **precise).fun
    upper = -minimize_scalar(lambda a: -lifting.omega(a, -1), bounds=(0.17, 0.6), **precise).fun
    exact = [lower, upper]
    for way in ((0.5, 4.0), (4.0, 0.5)):
        branch = arc_length.follow(lifting.balance(transitions="located"), *way)
        assert branch.omega[-1] == way[1]
        np.testing.assert_allclose(np.sort(branch.omega[list(branch.folds)]), exact, rtol=1e-8)
        assert len(branch.omega) < 200


@pytest.mark.parametrize(("n_samples", "tip"), [(16, 9.0), pytest.param(64, 5.27, marks=pytest.mark.slow)])
def test_corners_of_a_coarsely_sampled_contact_do_not_stop_the_walk(n_samples, tip):
    """Few samples turn the smooth curve into a zigzag whose corners turn by up to 170 degrees."""
    folds = []
    for start, stop in ((0.5, 4.0), (4.0, 0.5)):
        branch = arc_length.follow(Lifting().balance(n_samples=n_samples), start, stop)
        assert branch.omega[-1] == stop, branch.end
        assert branch.converged.all()
        np.testing.assert_allclose(branch.amplitude("mass").max(), tip, rtol=0.01)
        folds.append(branch.omega[list(branch.folds)])
    fewer, extra = sorted(folds, key=len)  # a small tooth may be stepped over
    assert len(fewer) >= 8
    assert np.abs(fewer[:, None] / extra - 1).min(axis=1).max() < 1e-8


def test_several_pairs_with_friction_and_lift_trace_the_same_curve_both_ways():
    balance = pressed_slab()
    up = arc_length.follow(balance, 2300.0, 6000.0)
    down = arc_length.follow(balance, 6000.0, 2300.0)
    assert up.omega[-1] == 6000.0
    assert down.omega[-1] == 2300.0
    assert len(up.folds) == 6
    np.testing.assert_allclose(np.sort(up.omega[list(up.folds)]), np.sort(down.omega[list(down.folds)]), rtol=1e-7)
    for branch in (up, down):  # every point solves the balance
        for i in range(0, len(branch.omega), 10):
            x = branch.contact[i].reshape(4, 3, -1)
            state = balance.evaluate(branch.omega[i], x, jacobian=False)
            assert newton.relative_residual(state, balance.x_lin(branch.omega[i])) < 1.01e-8


def test_where_the_curve_is_single_valued_it_is_the_natural_one():
    friction, pairs = rubbing_mass((0, 1, 2, 3)), rubbing_pairs((0, 1, 3))
    for balance, low, high in ((friction, 0.3, 4.0), (pairs, 200.0, 900.0)):
        for way in ((low, high), (high, low)):
            arc = arc_length.follow(balance, *way)
            assert str(arc.end).startswith("reached")
            assert arc.folds == ()
            start = newton.solve_from_rest(balance, way[0]).state.x
            for omega, contact in zip(arc.omega, arc.contact, strict=True):  # stepped at the same frequencies
                solution = newton.solve(balance, omega, start)
                assert solution.converged
                start = solution.state.x
                np.testing.assert_allclose(solution.state.flat, contact, atol=1e-5 * np.abs(contact).max())
            assert len(arc.omega) < 120


def test_slip_is_part_of_the_friction_curves_above():
    branch = arc_length.follow(rubbing_mass(), 0.3, 4.0)
    assert branch.energy.max() > 0.1 * 0.3 * branch.amplitude("mass").max()


def test_sharp_resonances_and_infinite_ones():
    sharp = arc_length.follow(Duffing(zeta=1e-5, cubic=0.0).balance(), 0.5, 2.0)
    assert sharp.omega[-1] == 2.0
    assert sharp.amplitude("mass").max() > 0.95 * 0.3 / 2e-5
    assert len(sharp.omega) < 250
    undamped = arc_length.follow(Duffing(zeta=0.0, cubic=0.0).balance(), 0.5, 2.0)
    assert "grows without bound" in str(undamped.end)
    np.testing.assert_allclose(undamped.omega[-1], 1.0, atol=1e-6)


def test_units_change_nothing():
    numbers = []
    for length in (1e-9, 1.0, 1e9):
        branch = arc_length.follow(Duffing().balance(length=length), 0.5, 5.0)
        numbers.append((len(branch.omega), branch.folds))
        np.testing.assert_allclose(branch.amplitude("mass").max() / length, 2.83, rtol=0.01)
    assert numbers[0] == numbers[1] == numbers[2]


def test_folds_in_the_load_are_extremes_of_the_load_over_amplitude():
    duffing, omega = Duffing(), 2.0

    def load(amplitude):
        stiffness = 1 - omega**2 + 0.75 * amplitude**2
        return amplitude * np.hypot(stiffness, 2 * duffing.zeta * omega) / duffing.force

    upper = minimize_scalar(load, bounds=(1.5, 2.5), method="bounded", options={"xatol": 1e-10}).fun
    lower = -minimize_scalar(lambda a: -load(a), bounds=(0.5, 1.6), method="bounded", options={"xatol": 1e-10}).fun
    path = parameter.load(duffing.balance(), omega)
    for start, stop in ((0.0, 12.0), (12.0, 0.0)):
        branch = arc_length.follow(path, start, stop)
        assert branch.parameter_name == "load factor"
        assert str(branch.end) == f"reached load factor {stop:g}"
        assert np.all(branch.omega == omega)
        np.testing.assert_allclose(np.sort(branch.parameter[list(branch.folds)]), [upper, lower], rtol=1e-8)
        np.testing.assert_allclose(load(branch.amplitude("mass")), branch.parameter, atol=1e-6)


def test_closed_curve_beside_the_main_one_is_recognised():
    """Middle and lower response exist together up to the fold in the load; a load that dips below makes an island."""
    omega, balance = 2.0, Duffing().balance()
    branch = arc_length.follow(parameter.load(balance, omega), 0.0, 12.0)
    fold = branch.parameter[list(branch.folds)].max()
    island = Parameter("detuning", lambda v: balance.with_load(fold - 0.5 + v * v), omega)
    guess = newton.solve_from_rest(*island.place(0.0)).state.x
    ring = arc_length.follow(island, 0.0, 1.0, Options(bounds=(-2.0, 2.0), guess=guess))
    assert str(ring.end).startswith("closed curve")
    assert len(ring.folds) == 2
    np.testing.assert_allclose(np.abs(ring.parameter[list(ring.folds)]), np.sqrt(0.5), rtol=1e-7)


def test_derivative_with_respect_to_the_load():
    structure = random_structure(3, seed=1)
    k = np.full((3, 3), 5e6)
    parameters = ContactParameters.of(("t1", "t2", "n"), k, friction=0.3)
    excitation = Excitation.of({"static": 1500.0}, {1: {"shaker": 2500.0}})
    basis = HarmonicBasis((0, 1, 2), 64, "located")
    balance = HarmonicBalance.of(structure, Joint("contact", "jenkins", parameters), basis, excitation, 2000.0)
    omega = 450.0
    base = newton.solve_from_rest(balance, omega)
    assert base.converged
    path, at, change = parameter.load(balance, omega), 1.0, 0.01
    shifted = newton.solve(*path.place(at + change), base.state.x, newton.NewtonOptions(tolerance=1e-11))
    back = newton.solve(*path.place(at - change), base.state.x, newton.NewtonOptions(tolerance=1e-11))
    metric = Metric(float(np.linalg.norm(base.state.x)), change)
    up = Direction(np.zeros_like(base.state.flat), 1.0)
    tangent = bordered.tangent(path, at, base.state, up, metric, newton.NewtonOptions(), 1e-10)
    slope = (shifted.state.flat - back.state.flat) / (2 * change)
    np.testing.assert_allclose(tangent.x / tangent.p, slope, atol=0.01 * np.abs(slope).max())
    branch = natural.follow(path, at, at + change, natural.Options(n_points=3))
    assert branch.parameter[-1] == at + change
    np.testing.assert_allclose(branch.contact[-1], shifted.state.flat, atol=1e-6 * np.abs(base.state.x).max())


def test_bordered_solve_is_that_of_the_full_matrix_and_regular_at_a_fold():
    balance = pressed_slab()
    path = parameter.of(balance)
    branch = arc_length.follow(balance, 6000.0, 4800.0)
    i = branch.folds[0]
    state = balance.evaluate(branch.omega[i], branch.contact[i].reshape(4, 3, -1))
    linear, slope = balance.linearise(state), path.slope(branch.omega[i], state)
    rng = np.random.default_rng(0)
    metric = Metric(1e-5, 100.0)
    border = Direction(1e-5 * rng.normal(size=slope.shape), 30.0)
    rhs = 1e-5 * rng.normal(size=slope.shape)
    result, _ = bordered.solve(linear, slope, border, metric, (rhs, 0.7), 1e-12, 500)
    defect = linear.dense() @ result.x.ravel() + slope.ravel() * result.p - rhs.ravel()
    assert np.linalg.norm(defect) < 1e-5 * np.linalg.norm(rhs)
    active = np.isin(np.arange(len(slope)), linear.rows)
    masked = Direction(np.where(active[:, None], border.x, 0.0), border.p)
    np.testing.assert_allclose(metric.dot(masked, result), 0.7, rtol=1e-8)
    scale = np.linalg.svd(linear.dense(), compute_uv=False)
    assert scale[-1] < 1e-3 * scale[0]  # while without border it is nearly singular here


def test_a_first_solution_is_found_along_the_load_where_rest_fails():
    """At 2.4 rad/s the lifting mass rests on the upper curve only, behind folds in the load."""
    balance, omega = Lifting().balance(transitions="located"), 2.4
    assert not newton.solve_from_rest(balance, omega).converged
    solution = arc_length.solve_along_load(balance, omega)
    assert solution.converged
    amplitude = float(np.hypot(*solution.state.x[0, 0, 1:]))
    np.testing.assert_allclose(Lifting().omega(amplitude, 1), omega, rtol=1e-6)


def test_a_guess_starts_on_another_branch():
    duffing = Duffing()
    full = arc_length.follow(duffing.balance(), 0.5, 5.0)
    upper = int(np.flatnonzero(full.omega[: full.folds[0]] < 2.4)[-1])
    start, guess = full.omega[upper], full.contact[upper].reshape(1, 1, -1)
    branch = arc_length.follow(duffing.balance(), start, 0.5, Options(guess=guess))
    assert branch.omega[-1] == 0.5
    assert branch.folds == ()
    np.testing.assert_allclose(branch.amplitude("mass")[0], full.amplitude("mass")[upper], rtol=1e-7)


def test_it_says_where_it_ends():
    balance = Duffing().balance()
    small = arc_length.follow(balance, 0.5, 5.0, Options(max_points=10))
    assert str(small.end) == f"ended at {small.frequency[-1]:.6g} Hz: 10 points were allowed"
    high = Duffing(zeta=0.005, force=0.6).balance()
    back = arc_length.follow(high, 4.0, 0.2)
    assert str(back.end) == f"turned back to {4.0 / (2 * np.pi):.6g} Hz"
    assert back.omega[-1] == 4.0
    impatient = arc_length.follow(high, 4.0, 0.2, Options(patience=5))
    messages, _, furthest = str(impatient.end).removesuffix(" Hz").rpartition(" ")
    assert messages.endswith("5 points brought it hardly further than")
    assert float(furthest) == pytest.approx(impatient.frequency.min(), rel=arc_length.ArcLengthRules.headway)
    assert impatient.frequency.argmin() + 6 <= len(impatient.omega) < len(back.omega)
    with pytest.raises(ValueError, match="start and stop are the same"):
        arc_length.follow(balance, 2.0, 2.0)
    with pytest.raises(ValueError, match="outside of the bounds"):
        arc_length.follow(balance, 2.0, 3.0, Options(bounds=(2.5, 4.0)))
    with pytest.raises(ValueError, match="min_step <= step"):
        Options(step=1.0)
    with pytest.raises(ValueError, match="max_points"):
        Options(max_points=1)
    observed = []
    arc_length.follow(balance, 0.5, 1.0, on_point=lambda done, expected, _: observed.append((done, expected)))
    assert all(expected >= done > 0 for done, expected in observed)
    assert [done for done, _ in observed] == sorted(done for done, _ in observed)


def test_an_unsolved_start_is_said(monkeypatch):
    # without a Newton step the curve over the load, which is tried last, is a walk in place: few points will do
    monkeypatch.setattr(arc_length, "Options", partial(Options, max_points=50))
    balance = Duffing().balance()
    hopeless = replace(Options(), newton=newton.NewtonOptions(max_steps=0))
    branch = arc_length.follow(balance, 0.5, 5.0, hopeless)
    assert str(branch.end).startswith(f"ended at {0.5 / (2 * np.pi):.6g} Hz: not converged")
    assert not branch.converged[0]


def test_a_gap_in_the_curve_is_stepped_over_and_named(monkeypatch):
    """The walk is made to lose the curve once; both folds behind the gap are found all the same."""
    advance, calls = arc_length.CurveStepper.advance, []

    def lose_it_once(stepper):
        calls.append(stepper)
        return [] if len(calls) == 5 else advance(stepper)

    monkeypatch.setattr(arc_length.CurveStepper, "advance", lose_it_once)
    duffing = Duffing()
    branch = arc_length.follow(duffing.balance(), 0.5, 5.0)
    assert str(branch.end).startswith("reached")
    assert "; stepped over gaps in the curve at " in str(branch.end)
    assert calls[5] is not calls[4]  # a new walk from behind the gap
    assert np.all(np.diff(branch.omega[:7]) > 0)
    np.testing.assert_allclose(np.sort(branch.omega[list(branch.folds)]), duffing.folds(), rtol=1e-8)


def test_a_walk_that_always_lands_astray_with_steps_that_do_not_get_shorter_ends(monkeypatch):
    """As behind a corner far away: going back shortens nothing there, and went on for ever."""
    went_back = []

    def same_again(stepper, index):
        went_back.append(index)
        assert len(went_back) < 100
        stepper._point = stepper.segments[index].start
        del stepper.segments[index:]

    monkeypatch.setattr(CurveStepper, "arrives", lambda *arguments: False)
    monkeypatch.setattr(CurveStepper, "rewind", same_again)
    branch = arc_length.follow(Duffing().balance(), 0.5, 0.6)
    assert went_back
    assert str(branch.end).endswith("the curve jumps to another branch there")
