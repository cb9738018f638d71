"""Properties of the solver over random small models, contact laws, loads and wear runs, by hypothesis.

Wherever the solver says "converged", dense solves with the forces of a plain march of the contact law give back the
same displacement; friction never gives energy away; nothing is nan; no exception but the declared ones is raised.

The test command runs the same few hundred cases every time. More of them, drawn anew at every run:

    TRIBODYN_CASES=5000 pytest tests/test_properties_solver.py tests/test_properties_scenes.py"""

from dataclasses import replace

import numpy as np
from hypothesis import example, given, strategies as st

from proof.hard_settings.extremes_judge import condition
from tests.helpers.contact_draws import LAWS
from tests.helpers.random_problems import (
    Drawn,
    cases,
    contact_forces,
    displacement_under,
    drawn_problems,
    omega_of,
    problem_of,
)
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.aft import CycleNotPeriodic
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.linear.expansion import SingularStuckSystem, UndampedResonance
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem

DECLARED = (SingularStuckSystem, UndampedResonance, CycleNotPeriodic)
TOLERANCE = NewtonOptions().tolerance
SINGLE = float(np.finfo(np.float32).eps) / 2  # rounding of what the frequency multiplies in the compliance
WORN = [(law, components) for law, components in LAWS if "n" in components and law != "cubic_spring"]
# friction work that sampling makes, over the product of force and displacement: factor and order in samples per period
# of the highest harmonic; planar friction lags where its path turns (see hbm.contact.laws.coulomb_planar)
SAMPLING = {"coulomb_planar": (4.0, 1)}
UNCOUPLED = (8.0, 2)


def check(balance: HarmonicBalance, state: State) -> None:
    """A state that counts as converged is finite, balanced, and takes energy from the vibration."""
    for values in (state.x, state.cycle.force, state.residual, balance.outputs(state)):
        assert np.isfinite(values).all()
    base, parameters = balance.excitation.base, balance.contact
    offsets = [parameters.gap, balance.memory, np.zeros(1) if base is None else base]
    tiny = 1e-14 * max(float(np.abs(offset).max(initial=0.0)) for offset in offsets)  # their rounding
    force = contact_forces(balance, state.x)
    remaining = newton.relative_residual(state, balance.x_lin(state.omega)) + 5e-14  # with what rounding adds to it
    rounding = SINGLE + remaining * condition(balance, state.omega)  # infinite where nothing holds it
    if np.isfinite(force).all() and rounding < 1.0:
        size = max(float(np.linalg.norm(v)) for v in (state.x, balance.x_lin(state.omega), offsets[-1]))
        back = displacement_under(balance, state.omega, state.x, force)
        assert np.linalg.norm(back - state.flat) <= (3 * TOLERANCE + rounding) * size + tiny * np.sqrt(back.size)
    path = parameters.tangential
    basis = balance.basis
    travelled = np.maximum(basis.order, 1) * state.x  # harmonic h goes to and fro h times in a cycle
    forces, travels = (np.linalg.norm(values[:, path], axis=2) for values in (state.cycle.force, travelled))
    scale = np.pi * ((forces + tiny * parameters.stiffness[:, path]) * (travels + tiny)).sum(axis=1)
    factor, order = SAMPLING.get(balance.contact.joints[0].law, UNCOUPLED)
    coarse = 0.0 if basis.transitions == "located" else factor * (basis.harmonics[-1] / basis.n_samples) ** order
    assert (balance.energy(state) >= -(1e-10 + coarse) * scale).all()


OVERFLOW = Drawn(  # its first Newton step is so long that the cubic force leaves single precision
    law="cubic_spring", components=("t1", "t2", "n"), n_pair=1, n_extra=0, structure="rigid", damping=None, contact=1.0,
    contact_spread=0.3, friction=0.3, gap=-9.0, gap_sign=0, static=None, dynamic=-3.1, base=None, memory=False,
    harmonics=(0, 1), n_samples=3, transitions="sampled", tuning=1.0, mode=0, seed=0,
)  # fmt: skip


UNDRIVEN = replace(  # at rest in an undamped resonance
    OVERFLOW, law="coulomb_planar", structure="soft", contact=1.3, contact_spread=2.0, dynamic=None, mode=1, seed=1
)
COARSE = replace(  # eleven samples for the work of harmonic 5
    OVERFLOW, law="jenkins", components=("t1", "n"), n_extra=2, structure="clamped", damping=0.01, contact_spread=0.0,
    dynamic=None, base=-9.0, harmonics=(0, 1, 5), n_samples=11, tuning=0.9, seed=123,
)  # fmt: skip
LOOSE = Drawn(  # held by its contact alone, ten thousand times below its frequency: 3e-8 are single precision
    law="cubic_spring", components=("t1", "t2"), n_pair=1, n_extra=4, structure="rigid", damping=0.01, contact=1.0,
    contact_spread=0.0, friction=0.3, gap=-9.0, gap_sign=0, static=None, dynamic=-6.0, base=None, memory=False,
    harmonics=(1,), n_samples=3, transitions="sampled", tuning=0.9, mode=3, seed=0,
)  # fmt: skip


@cases(250)
@given(drawn_problems())
@example(OVERFLOW)
@example(UNDRIVEN)
@example(COARSE)
@example(LOOSE)
def test_what_counts_as_converged_is_in_balance(d: Drawn) -> None:
    try:
        balance = problem_of(d)
        result = newton.solve_from_rest(balance, omega_of(balance))
    except DECLARED:
        return
    assert result.outcome
    assert np.isfinite(result.state.x).all()
    if result.converged:
        check(balance, result.state)


@cases(20)
@given(drawn_problems(), st.sampled_from(("natural", "arc_length")), st.sampled_from((0.8, 1.0, 1.25)))
def test_branches_hold_what_they_say(d: Drawn, method: str, reach: float) -> None:
    try:
        balance = problem_of(d)
        omega = omega_of(balance)
        start, stop = reach * omega, omega / reach if reach != 1.0 else 0.9 * omega
        if method == "natural":
            branch = natural.follow(balance, start, stop, natural.Options(n_points=8))
        else:
            branch = arc_length.follow(balance, start, stop, arc_length.Options(max_points=12))
    except DECLARED:
        return
    assert branch.end
    assert np.isfinite(branch.response).all()
    for i in np.flatnonzero([outcome == CONVERGED for outcome in branch.outcome])[::3]:
        x = branch.contact[i].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
        check(balance, balance.evaluate(branch.omega[i], x))


@cases(30)
@given(
    drawn_problems(WORN),
    st.sampled_from(("energy", "archard", "impact")),
    st.sampled_from(("thesis", "error_controlled")),
    st.sampled_from((1e-3, 1e-6, 0.1, 10.0)),
)
def test_wear_only_grows(d: Drawn, law: str, rule: str, share: float) -> None:
    area, coefficient = np.linspace(1e-6, 2e-6, d.n_pair), 1e-14
    try:
        balance = problem_of(replace(d, harmonics=(0, *(h for h in d.harmonics if h)), static=d.static or 1.0))
        first = newton.solve_from_rest(balance, omega_of(balance))
        if not first.converged:
            return
        site = AtFrequency("tip", omega_of(balance))
        problem = WearProblem(balance, (Duty(site),), JointWear.of(law, coefficient=coefficient), area)
        depth = share * max(np.abs(first.state.x[:, -1, 0]).max(), 1e-12)
        if rule == "thesis":
            history = evolve(thesis.Rule(problem, depth), max_steps=3)
        else:
            history = evolve(error_controlled.Rule(problem, Tolerance(0.1, depth)), max_steps=2)
    except DECLARED:
        return
    except ValueError as refused:
        if rule == "error_controlled" and 'take rule = "thesis"' in str(refused):
            return
        raise
    check_wear(history, problem, law)


def check_wear(history: WearHistory, problem: WearProblem, law: str) -> None:
    """Depth, cycles and work are finite and never fall; by the energy law the worn volume is that of the work."""
    assert history.end
    for values in (history.cycles, history.depth, history.worn, history.work, history.response):
        assert np.isfinite(values).all()
    assert (history.cycles_in_step >= 0).all()
    assert (np.diff(history.cycles) >= 0).all()
    assert (history.worn >= 0).all()
    assert (history.energy >= 0).all()
    assert (np.diff(history.depth, axis=0) >= 0).all()
    np.testing.assert_allclose(history.depth[1:], history.depth[:-1] + history.worn[:-1], rtol=1e-12)
    if law == "energy":
        product = np.linalg.norm(history.force, axis=2) * np.linalg.norm(history.displacement, axis=2)
        rounding = 1e-11 * history.cycles_in_step * product.sum(axis=1)  # [J]
        volume, worked = history.worn @ problem.area, 1e-14 * history.work.sum(axis=1)
        assert (np.abs(volume - worked) <= 1e-6 * worked + 1e-14 * rounding).all()
