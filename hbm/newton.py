"""Newton-Krylov for the balance: inexact directions, a line search, a direct fallback, and an outcome."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar, cast

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.criterion import (
    CRITERION,
    Balance,
    Evaluated,
    Evaluation,
    Frequency,
    NewtonOptions,
    relative_residual,
    required_residual,
    spring_stretch,
)
from tribodyn.hbm.linearisation import NEARLY_ALL
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.reduction.residual_flexibility import FlexibleModel, ResidualFlexibility


@dataclass(frozen=True)
class NewtonRules:
    """What Newton takes for zero, for rounding, and for too large; see docs/developers/ablations.md."""

    unresisted: float = 1e-9  # singular value over the largest of a Jacobian whose motion counts as not resisted
    most_dense: int = 3000  # unknowns up to which the dense Jacobian serves where Krylov steps fail at rest
    most_direct: int = 25000  # unknowns up to which it serves where Krylov steps fail elsewhere: 5 GB
    most_corrections: int = 8  # of a residual flexibility
    closer: float = 0.1  # what a step is to leave over what comes after it, with a residual flexibility
    force_unknown: float = 1e-2  # error of the contact forces from which on a small residual is no solution
    shortest: float = 4e-4  # share of a Newton step that is tried
    support: float = 1e-3  # contact force over that of the stuck contact from which on the structure leans on it


RULES = NewtonRules()
CURES = "more damping, a softer contact, fewer harmonics or a larger static load make it easier"


@dataclass(frozen=True)
class Strides:
    """first : step; growth : of a step that succeeds; shortest : step that is not tried any more."""

    first: float = 0.25
    growth: float = 1.5
    shortest: float = 1e-3


STRIDES = Strides()  # of a load, of an opening, of a decimal logarithm


Solvable = TypeVar("Solvable", bound=Evaluation, covariant=True)


@dataclass(frozen=True)
class Solved(Generic[Solvable]):
    """Where Newton ended.

    outcome : CONVERGED, or what went wrong
    steps, products : Newton steps and Krylov products spent
    history : relative residual after each step, the start first"""

    state: Solvable
    outcome: Outcome[SolveEnd]
    steps: int
    products: int
    history: tuple[float, ...]

    @property
    def converged(self) -> bool:
        """Whether the residual is below the tolerance."""
        return self.outcome == CONVERGED


Solution = Solved[State]
"""Where Newton ended on a `HarmonicBalance`."""


@single
def solve(
    balance: Balance[Frequency, Evaluated], omega: Frequency, start: np.ndarray, options: NewtonOptions | None = None
) -> Solved[Evaluated]:
    """Solve the balance at one frequency.

    omega : [rad/s]; start : (n_pair, n_component, n_coeff) first guess [m]
    Returns where Newton ended; its state is the best met, also where it did not converge. Where a contact barely
    touches while it swings far, a residual small beside x is not small beside the stretch of its springs: Newton then
    continues until it is, as far as rounding lets it
    Source  inexact Newton with the forcing term of Eisenstat and Walker 1996, choice 2"""
    options = options or NewtonOptions()
    if isinstance(balance, HarmonicBalance) and isinstance(omega, float):
        model = balance.model
        if isinstance(model, FlexibleModel) and model.residual.left_out <= NEARLY_ALL:
            return cast(Solved[Evaluated], _solve_with_remainder(balance, model.residual, omega, start, options))
    return _solve(balance, omega, balance.evaluate(omega, start), options)


def _solve_with_remainder(
    balance: HarmonicBalance, residual: ResidualFlexibility, omega: float, start: np.ndarray, options: NewtonOptions
) -> Solution:
    """The same with a residual flexibility R: Newton solves with what is known of it, then R is asked for more.

    It is known of forces that were asked for before, and bounded by the largest share left out of what the forces
    differ from these: where the bound is small enough, nothing is asked for. Too many corrections, each smaller by
    about what the modes leave out, give way to Newton's method on all"""
    steps, products, is_solved = 0, 0, False
    x_lin = balance.x_lin(omega)
    history: tuple[float, ...] = ()
    cache = [] if balance.recalled is None else balance.recalled
    approximate = replace(balance, remainder=lambda g: residual.recalled(g, cache))
    state = approximate.evaluate(omega, start)
    for _ in range(2 * RULES.most_corrections):
        lacking = residual.lacking(state.g, cache)
        unsure, error = residual.at_most(lacking, state.flat), relative_residual(state, x_lin)
        target, history = required_residual(balance, state, x_lin, options), (*history, error + unsure)
        if error + unsure <= target:
            return Solved(state, CONVERGED, steps, products, history)
        if not np.isfinite(unsure):
            break
        if is_solved:
            without = state.residual + residual.recalled(state.g, cache)
            residual.ask(state.g, cache, RULES.closer * target / unsure * float(np.linalg.norm(lacking)))
            state = replace(state, residual=without - residual.recalled(state.g, cache))
        else:
            closer = RULES.closer * max(target, min(unsure, error))
            newton_result = _solve(approximate, omega, state, replace(options, tolerance=closer))
            steps, products, state = steps + newton_result.steps, products + newton_result.products, newton_result.state
            if not newton_result.converged:
                return replace(newton_result, steps=steps, products=products)
        is_solved = not is_solved
    newton_result = _solve(balance, omega, balance.evaluate(omega, state.x), options)
    return replace(newton_result, steps=steps + newton_result.steps, products=products + newton_result.products)


def _solve(
    balance: Balance[Frequency, Evaluated], omega: Frequency, state: Evaluated, options: NewtonOptions
) -> Solved[Evaluated]:
    """The same with Newton's method alone, from a state evaluated with its derivative."""
    x_lin = balance.x_lin(omega)
    x_lin = x_lin if x_lin.any() else state.x  # without any load the start gives the scale
    error = relative_residual(state, x_lin)
    history = [error]
    forcing = 1e-3
    products = 0
    for step in range(1, options.max_steps + 1):
        goal = required_residual(balance, state, x_lin, options)
        if error <= goal:
            break
        if not np.isfinite(error):
            return Solved(state, SolveEnd.NOT_FINITE.say(), step - 1, products, tuple(history))
        linear = balance.linearise(state)
        target = max(min(forcing, options.krylov), 0.3 * goal / error, 1e-12)
        try:
            with np.errstate(over="raise"):
                if options.least_motion:
                    shortest = np.linalg.lstsq(linear.dense(), -state.residual.ravel(), RULES.unresisted)[0]
                    direction, spent, reached = shortest.reshape(state.residual.shape), 0, 0.0
                else:
                    direction, spent, reached = linear.solve(-state.residual, target, options.max_products)
        except FloatingPointError:  # a slope too steep for the single precision of the products
            spent, reached = 0, np.inf
        products += spent
        stalled = reached > max(10 * target, 0.5)
        if stalled and error <= options.tolerance:
            break
        if stalled and balance.reference_stiffness.size * state.residual.shape[1] > RULES.most_direct:
            remainder = f" relative residual {error:.1e}, {spent} products leave {reached:.0%} of it"
            return Solved(state, SolveEnd.NO_DIRECTION.say(remainder), step, products, tuple(history))
        if stalled:  # the direct way
            try:
                direction = np.linalg.solve(linear.dense(), -state.residual.ravel()).reshape(state.residual.shape)
            except np.linalg.LinAlgError:  # nothing holds the contact in some direction
                reason = SolveEnd.SINGULAR.say(f" {error:.1e}")
                return Solved(state, reason, step, products, tuple(history))
        state, new_error = _search(balance, omega, state, direction, error, x_lin)
        history.append(new_error)
        if new_error >= error * (1 - 1e-10):
            if new_error <= options.tolerance:
                break
            return Solved(state, SolveEnd.NO_DESCENT.say(f" {error:.1e}"), step, products, tuple(history))
        forcing = 0.5 * (new_error / error) ** 1.5
        error = new_error
    outcome = CONVERGED
    if error > options.tolerance:
        outcome = SolveEnd.STEPS_SPENT.say(f" {options.max_steps} steps: {error:.1e}")
    off = error / spring_stretch(balance, state, x_lin)
    stuck = balance.reference_stiffness[:, None] * x_lin.reshape(state.g.shape)  # the contact carries a share of that
    leans = float(np.linalg.norm(state.cycle.force)) > RULES.support * float(np.linalg.norm(stuck))
    doubtful = error <= options.tolerance and off > CRITERION.force_accuracy and leans
    if doubtful and (off > RULES.force_unknown or _unheld(balance, state)):
        far = float(np.abs(state.x).max())
        outcome = SolveEnd.SLIDES_AWAY.say(
            f" {far:.1e} m, and its forces are known to {off:.1%} only: nothing holds it"
        )
    return Solved(state, outcome, len(history) - 1, products, tuple(history))


def _search(
    balance: Balance[Frequency, Evaluated], omega: Frequency, state: Evaluated, direction: np.ndarray, error: float,
    x_lin: np.ndarray,
) -> tuple[Evaluated, float]:  # fmt: skip
    """Backtrack until the residual falls; the derivative has kinks, so the best trial is kept if none falls enough.

    Source  parabola through |R|^2, its slope and the last trial, Kelley 1995, 8.3.1"""
    best, best_error = state, error
    length = 1.0
    while length > RULES.shortest:
        with np.errstate(over="ignore", invalid="ignore"):  # steep laws grow beyond all numbers
            trial = balance.evaluate(omega, state.x + length * direction.reshape(state.x.shape))
            trial_error = relative_residual(trial, x_lin)
        if not np.isfinite(trial_error):
            length *= 0.25
            continue
        if trial_error < best_error:
            best, best_error = trial, trial_error
        if trial_error <= (1 - 0.1 * length) * error:
            return trial, trial_error
        bend = (trial_error / error) ** 2 - 1 + 2 * length  # |R|^2 / |R_0|^2 = 1 - 2 l + bend (l / length)^2
        length *= float(np.clip(length / bend, 0.25, 0.5)) if bend > 0 else 0.5
    return best, best_error


def _unheld(balance: Balance[Frequency, Evaluated], state: Evaluated) -> str:
    """What a mean motion that nothing resists does, as where all pairs of a loose body slip; empty where there is none.

    By the columns of the dense Jacobian for harmonic 0, empty too where that is too large"""
    if not isinstance(balance, HarmonicBalance) or not isinstance(state, State):
        return ""
    if not balance.basis.has_static or balance.n_unknown > RULES.most_dense:
        return ""
    contact = balance.contact
    columns = balance.linearise(state).dense().reshape(-1, *state.flat.shape)[..., 0]
    _, resisted, motions = np.linalg.svd(columns, full_matrices=False)
    if resisted[-1] > RULES.unresisted * resisted[0]:
        return ""
    share_of_motion = motions[-1].reshape(state.x.shape[:2]) ** 2
    component = int(share_of_motion.sum(axis=0).argmax())
    share = {joint.name: float(share_of_motion[joint.rows, component].sum()) for joint in contact.joints}
    names = ", ".join(name for name, value in share.items() if value >= sum(share.values()) / len(share))
    return (
        f"every pair of {names or 'the contact'} slips along {contact.components[component]}: hold it by a spring, "
        "press it harder, or give more friction or a smaller load"
    )


@single
def solve_from_rest(
    balance: HarmonicBalance, omega: float, options: NewtonOptions | None = None, static: Solution | None = None
) -> Solution:
    """Solve without a neighbouring solution: from the stuck response, else by raising the vibration load in steps.

    static : the solution without vibration load, searched where it is left out
    The ramp halves its step where Newton fails. Products and steps of the whole way are counted in the Solution."""
    first = solve(balance, omega, balance.stuck(omega), options)
    if first.converged:
        return first
    steps, products = first.steps, first.products
    start = balance.with_load(0.0).stuck(omega)
    options = options or NewtonOptions()
    last = static or solve(balance.with_load(0.0), omega, start, options)
    if not last.converged and balance.n_unknown <= RULES.most_dense:
        thorough = replace(options, least_motion=True, max_steps=2 * options.max_steps)
        last = solve(balance.with_load(0.0), omega, start, thorough)
    factor, attempt = 0.0, last

    def loaded(target: float, _: float) -> bool:
        nonlocal last, attempt, steps, products
        attempt = solve(balance.with_load(target * balance.load_factor), omega, last.state.x, options)
        steps, products = steps + attempt.steps, products + attempt.products
        last = attempt if attempt.converged else last
        return attempt.converged

    if last.converged:
        factor = lead(factor, 1.0, loaded)
    if factor == 1.0:
        return Solution(last.state, CONVERGED, steps, products, last.history)
    if last.converged and (loose := _unheld(balance, last.state) or _unheld(balance, attempt.state)):
        outcome = SolveEnd.NOT_HELD.say(f" {factor:.0%} of the vibration load on: {loose}")
    elif last.converged:
        outcome = first.outcome.kind.say(f"{first.outcome.detail}; load ramp stopped at {factor:.0%}: {CURES}")
    else:
        outcome = SolveEnd.NO_REST.say(f": the part, or a body of it, may tip or slide ({last.outcome})")
    return Solution(first.state, outcome, steps, products, first.history)


def lead(level: float, goal: float, solve: Callable[[float, float], bool], first: float = STRIDES.first) -> float:
    """How far a number of a problem comes from a level, where it is solved, towards its goal.

    solve : whether there is a solution at its first argument beside the one at its second, the level reached so far;
        it keeps what it finds
    first : step
    Source  Allgower and Georg 1990, chapter 1"""
    stride = first
    while level != goal and stride > STRIDES.shortest:
        target = min(level + stride, goal) if goal > level else max(level - stride, goal)
        if solve(target, level):
            level, stride = target, STRIDES.growth * stride
        else:
            stride *= 0.5
    return level
