"""The motion that a machine makes at a worn contact, where it leaves that of the balance, and wear steps along it.

A periodic motion that a push grows on is left, for another one or for one that never repeats itself. Hill's method
says, at little cost, where that may be; there the motion is marched through time from that of the wear state before,
until its means have settled (hbm.time.mean_motion). Where the balance's motion is stable a machine comes to it, within
far fewer periods than a wear step has: on the beam an irregular motion was caught by it after 250 periods and stayed.
The place stays that of the balance, such as its peak.
Pressure reacts to local depth at once, so that dw/dZ = r(w) is stiff. A Rosenbrock step of second order takes an
approximate derivative of r: the rate of a pair in proportion to its normal force, and that by the static stiffness of
the pairs that touch. Its order does not depend on how good the derivative is.
Source  ROS2: Verwer, Spee, Blom and Hundsdorfer 1999, SIAM J. Sci. Comput. 20(4), gamma = 1 - 1/sqrt(2)"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.stability import exponents, hill_problem
from tribodyn.hbm.time.mean_motion import Follower, MeanMotion, MeanOptions
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.hbm.wear.history import WearHistory, WearRow
from tribodyn.hbm.wear.step_control import Tolerance, expected_life
from tribodyn.hbm.wear.wear_problem import Means, WearProblem, WearState, wear_of
from tribodyn.refusal import Refusal

GAMMA = 1 - 1 / np.sqrt(2)
# Unknowns of a balance, of all sectors of a wave, up to which all states are looked at: Hill's method takes less than a
# fifth of the time of a wear step (beam: 73 ms of 0.5 s with 1029)
MOST_UNKNOWNS = 2000


@dataclass(frozen=True)
class MotionRules:
    """What a motion in time is followed with.

    steps : per period at least; per_harmonic : for each harmonic of the balance
    accuracy : standard error of a mean, relative, and difference from the balance's work up to which a periodic motion
        is that of the balance; the errors of many wear steps average out in a life
    most_components : of the contact
    contact : of a motion that is followed everywhere, see `MeanOptions`"""

    steps: int = 128
    per_harmonic: int = 16
    accuracy: float = 5e-2
    most_components: int = 600
    contact: float = 1e-5


RULES = MotionRules()


class SteadyMotion:
    """The motions of all duties, each followed while the contact wears and the balance's own motion is left.

    tolerance : of the steps; always : whether they are followed where the balance's own is kept, too
    Raises  ValueError where they are to be followed always and cannot be"""

    def __init__(self, problem: WearProblem, tolerance: Tolerance, always: bool = False):
        self._problem, self._tolerance, self.always = problem, tolerance, always
        contact = RULES.contact if always else MeanOptions.contact
        self._options = MeanOptions(_steps(problem), accuracy=RULES.accuracy, contact=contact)
        self._followers: list[Follower] = []
        fits = problem.balance.contact.stiffness.size <= RULES.most_components
        self._serves = fits and not problem.balance.model.is_wave
        if always and not self._serves:
            raise Refusal(
                f"a wheel's wave and a contact of more than {RULES.most_components} components are not worn in time"
            )
        self._moving = np.zeros(0)

    @cached_property
    def _stiffness(self) -> np.ndarray:
        """(n_pair, n_pair) static normal forces that fall when gaps open, with every pair closed and stuck [N/m].

        Zero where the contact has no normal component or the balance no harmonic 0"""
        balance = self._problem.balance
        contact, basis = balance.contact, balance.basis
        stiffness = np.zeros((contact.n_pair, contact.n_pair))
        if "n" not in contact.components or not basis.has_static:
            return stiffness
        width = len(contact.components)
        rows = contact.components.index("n") + width * np.arange(contact.n_pair)
        k = balance.reference_stiffness
        point = balance.at(balance.omega_max)
        for i, row in enumerate(rows):
            pull = np.zeros((len(k), basis.n_coeff))
            pull[row, 0] = k[row]
            stiffness[:, i] = -k[rows] * point.apply(pull)[rows, 0]
            stiffness[i, i] += k[row]
        return stiffness

    def restore(self, row: WearRow) -> None:
        """What moved when the row of an interrupted run was come to."""
        if not row.moving.any():
            return
        balances = [self._problem.in_duty(duty, row.depth) for duty in self._problem.mission]
        self._followers = [Follower(self._options) for _ in balances]
        for follower, balance, part in zip(self._followers, balances, np.split(row.moving, len(balances)), strict=True):
            follower.restore(balance, part)

    def follow(self, state: WearState, planned: float) -> WearState:
        """A state of the balance with the rates of the machine's motion; as it is where that is the balance's own.

        planned : cycles of the step from it, 0 where that is not known"""
        if not self._serves or state.failure or not (self.always or state.growth > 0):
            self._followers, self._moving = [], np.zeros(0)
            return state
        self._moving = np.concatenate([f.stored_state() for f in self._followers]) if self._followers else np.zeros(0)
        if not self._followers and not self._begins(state):
            return state
        try:
            marched = self._along(state, state, planned)
        except IntegrationFailed as failure:
            return replace(state, lost=WearEnd.SOLVE_FAILED.say(f" in time: {failure}"))
        difference = abs(float(marched.work.sum() - state.work.sum()))
        if (
            not self.always
            and marched.means_in_time.spread == 0
            and difference <= RULES.accuracy * float(state.work.sum())
        ):
            self._followers, self._moving = [], np.zeros(0)
            return state  # the motion has come back to that of the balance
        return marched

    def step(self, state: WearState, following: WearState, stride: float) -> tuple[WearState, np.ndarray, np.ndarray]:
        """A step from a state, with the balance at the depth that `predicted_depth` predicts.

        Returns the state there with its rates, the depth that wears (n_pair,) and its deviation from a step of first
        order [m]"""
        following = self._along(following, state if following.failure else following, stride)
        matrix, k1 = self._ahead(state, stride)
        k2 = np.linalg.solve(matrix, following.rate - 2 * k1)
        return following, np.maximum(stride * (1.5 * k1 + 0.5 * k2), 0.0), 0.5 * stride * (k1 + k2)

    def predicted_depth(self, state: WearState, stride: float) -> np.ndarray:
        """Depth (n_pair,) [m] at which a step from a state takes its second rate."""
        return state.depth + stride * np.maximum(self._ahead(state, stride)[1], 0.0)

    def _ahead(self, state: WearState, stride: float) -> tuple[np.ndarray, np.ndarray]:
        matrix = np.eye(len(state.depth)) + GAMMA * stride * self._fall(state)
        return matrix, np.linalg.solve(matrix, state.rate)

    def _begins(self, state: WearState) -> bool:
        """March the motion of every duty from the balance; False where there is no equation of motion in time."""
        self._followers = [Follower(self._options) for _ in state.points]
        try:
            for follower, duty, point in zip(self._followers, self._problem.mission, state.points, strict=True):
                follower.start(self._problem.in_duty(duty, state.depth), point.state)
        except Refusal:
            self._followers, self._serves = [], False
        return self._serves

    def _along(self, state: WearState, reference: WearState, stride: float) -> WearState:
        """The state with its means at the frequencies of `near`, as exact as `stride` cycles with them ask for."""
        problem, depth, cycles = self._problem, state.depth, state.cycles
        life = float(expected_life(self._tolerance, cycles, depth)) if stride else np.inf
        accuracy = self._tolerance.share * life / (stride or 1.0) if self.always else None
        means_of_duties: list[MeanMotion] = []
        for follower, duty, point in zip(self._followers, problem.mission, reference.points, strict=True):
            balance = problem.in_duty(duty, depth)

            def wears(motion: PeriodicMotion, balance: HarmonicBalance = balance) -> np.ndarray:
                return _wear(problem, balance, motion, depth, cycles)

            means_of_duties.append(follower.mean(balance, point.state.omega, wears, accuracy))
        shares = [duty.share for duty in problem.mission]
        rate, work = np.sum([s * m.observed for s, m in zip(shares, means_of_duties, strict=True)], axis=0)
        works = np.array([s * float(m.energy.sum()) for s, m in zip(shares, means_of_duties, strict=True)])
        weight = works / works.sum() if works.sum() > 0 else works
        first = means_of_duties[0]
        means = Means(
            energy=first.energy,
            normal_force=first.normal_force,
            amplitude=float(first.amplitude[0]),
            spread=float(weight @ [m.spread for m in means_of_duties]),
            error=float(np.linalg.norm(weight * [m.error for m in means_of_duties])),
            is_stationary=all(m.is_stationary for m in means_of_duties),
            periods=sum(m.periods for m in means_of_duties),
            moving=self._moving,
        )
        return replace(state, rate=rate, work=work, means=means)

    def _fall(self, state: WearState) -> np.ndarray:
        """(n_pair, n_pair) - d rate / d depth, about."""
        force = state.means_in_time.normal_force
        touches = force > 0
        fall = np.zeros((len(force), len(force)))
        stiffness, coupled, separated = (
            self._stiffness[np.ix_(*of)] for of in ((touches, touches), (touches, ~touches), (~touches, ~touches))
        )
        if not touches.all():
            stiffness = stiffness - coupled @ np.linalg.lstsq(separated, coupled.T, rcond=None)[0]
        fall[np.ix_(touches, touches)] = (state.rate[touches] / force[touches])[:, None] * stiffness
        fall *= self._problem.in_duty(self._problem.mission[0], state.depth).contact.of_pairs("opening_slope")
        return fall


def with_growth(problem: WearProblem, state: WearState, always: bool = False) -> WearState:
    """The state with the growth of its perturbations per radian of the vibration, the largest of all its duties.

    Above 0 a perturbation grows: what Hill's method takes for rounding is taken off

    always : of balances of any size, but waves; nan stays where it is not known: no solution, no exponents, too many
        unknowns"""
    balance = problem.balance
    sectors = balance.model.sectors_in_time
    is_small = balance.contact.stiffness.size * balance.basis.n_coeff * sectors <= MOST_UNKNOWNS
    if state.failure or not (is_small or (always and not balance.model.is_wave)):
        return state
    growth = -float("inf")
    try:
        for duty, point in zip(problem.mission, state.points, strict=True):
            floquet = exponents.stability(problem.in_duty(duty, state.depth), point.state)
            growth = max(growth, float(floquet.exponents[0].real) / floquet.omega - hill_problem.GROWS)
    except Refusal:  # a model without exponents
        return state
    return replace(state, growth=growth)


def untaken_periodic_share(problem: WearProblem, worn: WearHistory, looks: int) -> float:
    """Relative change of the cycles of a run, had it worn along periodic motions of the first duty that it passed by.

    An irregular motion may be a transient of some hundred periods, of which its scatter tells nothing, while a wear
    step has 100 000. So a periodic motion that stays is looked for beside the balance's, at `looks` rows: each stands
    for the same share of the cycles that the work of the balance would add or save."""
    rows = [row for row in worn.rows() if row.spread > 0 and row.cycles_in_step > 0]
    balances = [problem.in_duty(problem.mission[0], row.depth) for row in rows]
    states = [b.evaluate(row.omega, b.shaped(row.displacement)) for b, row in zip(balances, rows, strict=True)]
    stride, work_marched = np.array([(row.cycles_in_step, row.energy.sum()) for row in rows]).reshape(-1, 2).T
    work = np.array([np.sum(b.energy(state)) for b, state in zip(balances, states, strict=True)])
    by_balance = np.abs(stride * (work - work_marched)) / np.maximum(work, work_marched)
    total, change = float(by_balance.sum()), 0.0
    for i in np.searchsorted(by_balance.cumsum(), total * (np.arange(looks if total else 0) + 0.5) / looks):
        follower = Follower(MeanOptions(_steps(problem), contact=RULES.contact))
        periodic = follower.periodic_work_near(balances[i], states[i]) or work_marched[i]
        change -= (
            total / looks * stride[i] * (periodic - work_marched[i]) / max(periodic, work_marched[i]) / by_balance[i]
        )
    return change / float(worn.cycles_in_step.sum() or 1.0)


def _steps(problem: WearProblem) -> int:
    return max(RULES.steps, RULES.per_harmonic * problem.balance.basis.harmonics[-1])


def _wear(
    problem: WearProblem, balance: HarmonicBalance, motion: PeriodicMotion, depth: np.ndarray, cycles: float
) -> np.ndarray:
    """(2, n_pair) wear depth [m], by the laws of the joints, and friction work [J] of one period."""

    def state() -> State:
        return balance.evaluate(motion.omega, motion.coefficients(motion.x, balance.basis), jacobian=False)

    return np.stack(wear_of(problem, balance, state, depth, cycles, motion))
