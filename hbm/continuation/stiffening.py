"""A first solution without a neighbouring one: by stiffening the contact, or by way of more friction.

Contacts far stiffer than the body that lift and slip have forces that change by their own size over displacements far
below that of the body. Two things then fail: Newton from rest, whose first steps open and close every pair in turn, and
its directions, whose products are of single precision: what the free structure resists is lost beside the springs.
Here directions come from the dense Jacobian in double precision, steps are damped by how far the next direction would
go (which no scaling of the equations changes), and from springs so soft that Newton solves them at once the logarithm
of the largest stiffness that a spring may have is raised in steps as long as that converges, each start extrapolated
from the last two: a spring that is soft already keeps its own. The departure from stuck is measured from springs no
stiffer than the body. From the contact's own, 1e8 times stiffer, the motion of a pair that lifts would come with eight
digits less. The end is held to the same tolerance as any other solution, measured so.
Source  damping by the natural level function: Deuflhard 2004, Newton Methods for Nonlinear Problems, 3.3"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.expansion import SingularStuckSystem
from tribodyn.hbm.linear.linear_side import compliance_of
from tribodyn.hbm.newton import NewtonOptions, Solution, lead
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.reference_springs import body_stiffness
from tribodyn.hbm.threads import single
from tribodyn.reduction.residual_flexibility import FlexibleModel

ROUGH = (3.0, 2.5, 2.0, 1.5, 1.0, 0.5)  # decimal logarithms of friction over its own, tried in turn
SLIDING_STEPS = 400  # of Newton on the whole way to its own friction


@dataclass(frozen=True)
class StiffeningRules:
    """How far the contact is softened, and when the end is a solution; see docs/developers/ablations.md.

    decades : by which the springs are softened at most
    most_steps : of Newton on the whole way; hasty : of them at one stiffness: those that converge take fewer
    agrees : residual at the end from the contact's own springs, whose compliance is known less well beside them
    closer : tolerance at the end over the wanted one: a step more, as a soft support multiplies what is left
    least_length : of a damped step
    closeness : next step over the displacement at the end: beside stiff springs a residual alone says too little
    rounding : relative change of the displacement that may be rounding
    force_known : change of the contact forces by that, beyond which they are not known"""

    decades: int = 13
    most_steps: int = 600
    hasty: int = 24
    agrees: float = 1e-6
    closer: float = 1e-3
    least_length: float = 1e-4
    closeness: float = 1e-6
    rounding: float = 1e-15
    force_known: float = 1e-5


RULES = StiffeningRules()


@single
def solve_along_stiffness(balance: HarmonicBalance, omega: float, options: NewtonOptions) -> Solution | None:
    """A solution at one frequency [rad/s], None where there is no way to it or the dense Jacobian is too large."""
    if balance.n_unknown > newton.RULES.most_dense or not isinstance(balance.compliance, ContactCompliance):
        return None  # the compliance of a wheel whose sectors differ is one of its own springs
    spent, soft = 0, None
    hasty = replace(options, max_steps=min(options.max_steps, RULES.hasty))
    path: list[tuple[float, np.ndarray]] = []  # levels and solutions of the way so far

    def solved(level: float, start: np.ndarray | None = None) -> bool:
        nonlocal soft, spent
        try:
            soft = _softened(balance, level, soft)
        except SingularStuckSystem:  # so soft that what the contact alone holds counts as free
            return False
        soft_state, steps = _damped(soft, omega, soft.stuck(omega) if start is None else start, hasty)
        spent += steps
        if soft_state is not None:
            path.append((level, soft_state.x))
        return soft_state is not None

    def stiffer(target: float, level: float) -> bool:
        x = path[-1][1]
        starts = [x]
        if len(path) > 1:
            before, x_before = path[-2]
            starts = [x + (x - x_before) * (target - level) / (level - before), x]
        return spent < RULES.most_steps and any(solved(target, start) for start in starts)

    levels = (-float(decade) for decade in range(RULES.decades + 1))
    first = next((level for level in levels if spent < RULES.most_steps and solved(level)), None)
    if first is None or lead(first, 0.0, stiffer) < 0.0:
        return None
    x = path[-1][1]
    soft = _softened(balance, 0.0, soft)
    closer, steps = _damped(soft, omega, x, replace(options, tolerance=RULES.closer * options.tolerance))
    state = balance.evaluate(omega, x if closer is None else closer.x)
    error = newton.relative_residual(state, balance.x_lin(omega))
    if error > RULES.agrees or _rounded(balance, state) > RULES.force_known:
        return None
    return Solution(state, CONVERGED, spent + steps, 0, (error,))


def _rounded(balance: HarmonicBalance, state: State) -> float:
    """Largest change of a component of the contact forces, over its own size, when x changes by rounding."""
    noise = np.random.default_rng(0).uniform(-1, 1, state.x.shape)
    x = state.x * (1 + RULES.rounding * noise)
    force_change = balance.evaluate(state.omega, x, False).cycle.force - state.cycle.force
    sizes = [
        (np.linalg.norm(force_change[:, i]), np.linalg.norm(state.cycle.force[:, i]))
        for i in range(force_change.shape[1])
    ]
    return max((float(change / size) for change, size in sizes if size > 0), default=0.0)


def _softened(balance: HarmonicBalance, level: float, other: HarmonicBalance | None) -> HarmonicBalance:
    """The same problem with no contact spring stiffer than the stiffest times ten to the level.

    other : one of another level, whose linear side it shares where that is the same"""
    stiffest = float(balance.contact.stiffness.max()) * 10.0**level
    contact = balance.contact.with_parameters(lambda p: replace(p, stiffness=np.minimum(p.stiffness, stiffest)))
    if isinstance(balance.model, FlexibleModel):  # made with springs of its own
        reference = balance.model.residual.stiffness
    else:
        reference = np.minimum(contact.stiffness, body_stiffness(balance.model, balance.basis))
    if other is not None and np.array_equal(other.reference_stiffness, reference.ravel()):
        return other.with_contact(contact)
    compliance = compliance_of(balance.model, reference, balance.basis, balance.excitation, balance.omega_max)
    return replace(balance, contact=contact, compliance=compliance, at_rest=None)


def _damped(
    balance: HarmonicBalance, omega: float, start: np.ndarray, options: NewtonOptions
) -> tuple[State | None, int]:
    """Newton with exact directions; the state, None where it does not converge, and the steps spent."""
    x_lin = balance.x_lin(omega)
    state = balance.evaluate(omega, start)
    for step in range(options.max_steps):
        small = newton.relative_residual(state, x_lin) <= newton.required_residual(balance, state, x_lin, options)
        jacobian = balance.linearise(state).dense()
        if not np.isfinite(jacobian).all():
            return None, step
        factor = sla.lu_factor(jacobian, check_finite=False)
        with np.errstate(all="ignore"):
            direction = sla.lu_solve(factor, -state.residual.ravel(), check_finite=False)
        size, length = float(np.linalg.norm(direction)), 1.0
        is_close = size <= RULES.closeness * float(np.linalg.norm(state.x))
        if not np.isfinite(size) or (small and is_close):
            return (state if small and is_close else None), step
        while length > RULES.least_length:
            trial = balance.evaluate(omega, state.x + length * direction.reshape(state.x.shape))
            following = sla.lu_solve(factor, trial.residual.ravel(), check_finite=False)
            if float(np.linalg.norm(following)) <= (1 - 0.25 * length) * size:
                break
            length *= 0.5
        else:
            return None, step
        state = trial
    return None, options.max_steps


@single
def solve_along_friction(balance: HarmonicBalance, omega: float, options: NewtonOptions) -> Solution | None:
    """A solution at one frequency [rad/s], None where no law has a coefficient of friction or there is no way to it.

    With much friction closed pairs stick, and where they stick is found at once. As friction falls they slide, and the
    solution moves with it. A wedge that a load presses between two bodies is the example: from the stuck state Newton's
    method lets go of one of its faces, and nothing holds it any more."""
    if not balance.contact.has_friction:
        return None
    x, spent, products = balance.stuck(omega), 0, 0
    solution: Solution | None = None

    def rougher(level: float, _: float = np.nan) -> bool:
        nonlocal solution, x, spent, products
        if spent >= SLIDING_STEPS:
            return False
        rough = balance.with_contact(balance.contact.with_friction_scaled(10.0**level))
        solution = newton.solve(rough, omega, x, options)
        spent, products = spent + solution.steps, products + solution.products
        x = solution.state.x if solution.converged else x
        return solution.converged

    first = next((level for level in ROUGH if rougher(level)), None)
    if first is None or lead(first, 0.0, rougher) > 0.0 or solution is None:
        return None
    return replace(solution, steps=spent, products=products)
