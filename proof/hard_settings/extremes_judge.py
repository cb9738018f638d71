"""Whether a balance solution may be believed: march_checks against equations that the compliance form never sees.

Every check has the bound that residuals and conditioning give, none is set by what was found."""

from dataclasses import dataclass

import numpy as np

from proof.dense import DenseBalance
from proof.hard_settings.extremes_march import march_checks
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.linear import recovery
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.workflows.errors.change_table import sampling_error
from tribodyn.workflows.errors.refinement_limits import DEFAULT

CONVERGED, REFUSED, WRONG = "converged", "refused", "wrong"  # what is said of a cell
LARGEST_DENSE = 1600  # unknowns up to which the dense reference is solved
DENSE_TOLERANCE = 1e-9  # of the excitation, that the dense reference leaves
NEWTON = NewtonOptions().tolerance  # of the displacement, that the solver leaves
EPSILON = float(np.finfo(float).eps)
PERTURBATION = (
    1e-2  # how far from the solution the dense reference starts where it finds nothing from the free response
)
LOST_WORK = 1e-10  # by rounding, of force times travel
WORK_BY_SAMPLING = 8.0  # of force times travel, for one sample in each period of the highest harmonic
VAGUE = 1e-3  # relative difference that no check may allow
COVERED = 1.1  # true error over the estimated one, which leaves a hundredth of its residual
BENT = 2.0  # by how much contact that changes between two nearby solutions may change the conditioning


@dataclass(frozen=True)
class Verdict:
    """outcome : "converged", "refused" or "wrong"; reason : how it was checked, why it was refused or what is wrong.

    deviation : largest relative difference in the checks; nan where refused"""

    outcome: str
    reason: str
    deviation: float = float("nan")


def solve_and_judge(balance: HarmonicBalance, omega: float) -> tuple[Verdict, Solution]:
    """Solve from rest, as a user gets it, and judge."""
    solution = arc_length.solve_along_load(balance, omega)
    if not solution.converged:
        return Verdict(REFUSED, str(solution.outcome)), solution
    return judged(balance, solution.state), solution


@dataclass(frozen=True)
class Check:
    """One check: relative difference found, and what residuals, rounding and conditioning allow."""

    name: str
    off: float
    allowed: float

    @property
    def failed(self) -> bool:
        """Whether the difference is too large, or a larger one would not have been seen."""
        return not self.off <= min(self.allowed, VAGUE)


def judged(balance: HarmonicBalance, state: State) -> Verdict:
    """Check a state that is said to be converged: forces, equilibrium, the dense reference, linear limits, energy."""
    energy = balance.energy(state)
    if not all(np.all(np.isfinite(a)) for a in (state.x, state.g, balance.outputs(state), energy)):
        return Verdict(WRONG, "a number is not finite")
    gain = _gain(balance, state, energy)
    if gain > 0:
        return Verdict(WRONG, f"a pair gains {gain:.1e} J in each cycle")
    scale = max(float(np.linalg.norm(state.x)), float(np.linalg.norm(balance.x_lin(state.omega))), 1e-300)
    marched = [
        Check(f"{march.name} of a plain march", march.off, march.allowed) for march in march_checks(balance, state)
    ]
    checks = [*marched, _equilibrium(balance, state, scale)]
    remark = ""
    if balance.model.system.n_dof * balance.basis.n_coeff <= LARGEST_DENSE:
        dense = _Dense(balance, state, scale)
        checks += dense.limit()
        solved, remark = dense.solved()
        checks += solved
    for check in checks:
        if check.failed:
            says = f"{check.name}: off by {check.off:.1e}, {check.allowed:.1e} are allowed"
            return Verdict(WRONG, says, check.off)
    return Verdict(CONVERGED, ", ".join(c.name for c in checks) + remark, max(c.off for c in checks[len(marched) :]))


def _gain(balance: HarmonicBalance, state: State, energy: np.ndarray) -> float:
    """Largest energy that a pair gives to the vibration in each cycle, beyond rounding and what sampling makes [J].

    Sampled transitions are late by up to a sample, and the work is wrong by the square of it."""
    tangential, basis = balance.contact.tangential, balance.basis
    travelled = np.maximum(basis.order, 1) * state.x  # harmonic h goes to and fro h times in a cycle
    force, travel = (np.linalg.norm(v[:, tangential], axis=2) for v in (state.cycle.force, travelled))
    coarse = 0.0 if basis.transitions == "located" else WORK_BY_SAMPLING * (basis.harmonics[-1] / basis.n_samples) ** 2
    excess = -energy - (LOST_WORK + coarse) * np.pi * (force * travel).sum(axis=1)
    return float(excess.max())


def sampled_honestly(balance: HarmonicBalance, state: State) -> Verdict:
    """Whether the estimated error of sampling covers the true one: against located transitions and more samples.

    The estimate is march_checks to a factor. Above DEFAULT.largest no number is reported, and none is checked."""
    estimate = sampling_error(balance, state.omega, state.x)
    if estimate > DEFAULT.largest:
        says = f"the error estimate of the samples is above {DEFAULT.largest:.0%}, no response is stated"
        return Verdict(REFUSED, f'{says}: take more or harmonics.transitions = "located"')
    fine = balance.with_samples(4096, located=True)
    reference = arc_length.solve_along_load(fine, state.omega, NewtonOptions(tolerance=1e-2 * NEWTON))
    if not reference.converged:
        return Verdict(REFUSED, f"no reference with 4096 samples: {reference.outcome}")
    ours, theirs = balance.outputs(state)[:, 1:], fine.outputs(reference.state)[:, 1:]
    error = float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))
    solved = _Dense(balance, state, float(np.linalg.norm(state.x))).allowed()
    says = f"error by sampling {error:.1e}, estimated {estimate:.1e}"
    return Verdict(CONVERGED if error <= COVERED * estimate + solved else WRONG, says, error)


def _equilibrium(balance: HarmonicBalance, state: State, scale: float) -> Check:
    """Coordinates from M, C, K and the contact forces, harmonic by harmonic: do they move the contact as x says?"""
    shape = (-1, balance.basis.n_coeff)
    x, force = state.x.reshape(shape), state.cycle.force.reshape(shape)
    amplitudes = recovery.coordinates(balance, x, force, state.omega)
    harmonics = balance.basis.harmonics
    displacement = np.stack(
        [balance.model.at_harmonic(h)[1] @ q for h, q in zip(harmonics, amplitudes, strict=True)], axis=-1
    )
    off = float(np.linalg.norm(balance.basis.to_real(displacement) - x) / scale)
    return Check("equilibrium of every coordinate", off, 3 * NEWTON + 100 * EPSILON * condition(balance, state.omega))


def condition(balance: HarmonicBalance, omega: float) -> float:
    """Largest condition number of the stuck dynamic stiffness of any harmonic, unit stiffness in every coordinate."""
    system, b = balance.model.at_harmonic(balance.basis.harmonics[-1])
    damping = np.zeros_like(system.mass) if system.damping is None else system.damping
    stuck = system.stiffness + b.T @ (balance.contact.stiffness.reshape(-1, 1) * b)
    scale = 1 / np.sqrt(np.diag(stuck))
    matrices = [stuck + 1j * h * omega * damping - (h * omega) ** 2 * system.mass for h in balance.basis.harmonics]
    return max(float(np.linalg.cond(scale[:, None] * matrix * scale)) for matrix in matrices)


class _Dense:
    """The dense equations at a state: how far two solutions of them may lie apart, and what they are solved to.

    Two that leave the residuals r and s lie no further apart than |B A^-1| (|r| + |s|), A the Jacobian."""

    def __init__(self, balance: HarmonicBalance, state: State, scale: float):
        self._balance, self._state, self._scale = balance, state, scale
        self._dense = DenseBalance(balance)
        x, force = state.flat, state.cycle.force.reshape(state.flat.shape)
        amplitudes = recovery.coordinates(balance, x, force, state.omega)
        self._q = balance.basis.to_real(np.stack(amplitudes, axis=-1))
        linear = self._dense.dynamic_stiffness(state.omega)
        _, cycle, residual = self._dense.residual(linear, self._q.ravel())
        jacobian = self._dense.jacobian(linear, cycle)
        self._dynamic = np.tile(balance.basis.order > 0, len(state.flat))
        try:
            moves = self._dense.onto_contact(np.linalg.inv(jacobian))
            self._gain = BENT * float(np.linalg.norm(moves, 2))
            self._shake = BENT * float(np.linalg.norm(moves[self._dynamic], 2))
        except np.linalg.LinAlgError:
            self._gain = self._shake = float("inf")
        rounding = 10 * EPSILON * float(np.linalg.norm(np.abs(jacobian) @ np.abs(self._q.ravel())))
        self._residual_norm = float(np.linalg.norm(residual)) + rounding

    def allowed(self, theirs: float = 0.0, vibration: bool = True) -> float:
        """How far another solution that leaves the residual `theirs` [N] may lie apart, relative; vibration : alone."""
        gain = self._shake if vibration else self._gain
        return gain * (self._residual_norm + theirs) / self._scale + 3 * NEWTON

    def limit(self) -> list[Check]:
        """Linear limits of the vibration: every pair stuck and closed through the cycle, or none ever touching.

        The static part of a stuck contact depends on what slipped while the loads came on: it has no such limit."""
        balance, state = self._balance, self._state
        status = state.cycle.status
        system, b = balance.model.at_harmonic(balance.basis.harmonics[-1])
        if np.all(status == SEPARATES):
            stiffness, name = np.asarray(system.stiffness), "the structure without contact"
        elif np.all(status == STICKS) and not balance.contact.gap.any():
            k = balance.contact.stiffness.ravel()
            stiffness, name = system.stiffness + b.T @ (k[:, None] * b), "the structure stuck"
        else:
            return []
        basis, damping = balance.basis, np.zeros_like(system.mass) if system.damping is None else system.damping
        x = np.zeros((len(b), len(basis.harmonics)), complex)
        for (h, name_of_load), value in balance.excitation.loads.items():
            s = 1j * h * state.omega
            q = np.linalg.solve(stiffness + s * damping + s * s * system.mass, value * system.loads[name_of_load])
            x[:, basis.harmonics.index(h)] += b @ q
        off = (basis.to_real(x) - state.x.reshape(len(b), -1))[:, basis.order > 0]
        return [Check(name, float(np.linalg.norm(off) / self._scale), self.allowed())]

    def solved(self) -> tuple[list[Check], str]:
        """The dense Newton from the free response, else from beside the state; and what it says of other solutions."""
        remark = ""
        for start, where in ((self._free(), "from the free response"), (self._perturbed(), "from beside it")):
            if start is None:
                continue
            end = self._solve(start)
            if end is None:
                remark = remark or "; from the free response the dense Newton finds no solution"
                continue
            x, residual = end
            difference = (x - self._state.x).ravel()
            off, shake = (float(np.linalg.norm(part) / self._scale) for part in (difference, difference[self._dynamic]))
            allowed = self.allowed(residual, vibration=False)
            total, vibration = (
                Check(f"dense Newton {where}", off, allowed),
                Check(f"vibration of the dense Newton {where}", shake, self.allowed(residual)),
            )
            if not total.failed:
                return [total], remark
            if not vibration.failed and off <= allowed:
                return [vibration], f"{remark}; the equations leave its static part open by {off:.1e}"
            if self._is_another(x):
                remark = "; from the free response the dense Newton finds another solution, which is in balance too"
                continue
            return [total], remark
        return [], remark

    def _free(self) -> np.ndarray | None:
        linear = self._dense.dynamic_stiffness(self._state.omega)
        try:
            return np.linalg.lstsq(linear, self._dense.force.ravel(), rcond=1e-12)[0].reshape(self._q.shape)
        except np.linalg.LinAlgError:
            return None

    def _perturbed(self) -> np.ndarray:
        return self._q * (1 + PERTURBATION * np.random.default_rng(1).uniform(-1, 1, self._q.shape))

    def _solve(self, start: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Contact displacement and the residual that is left [N]; solved to rounding where that can be."""
        omega, dense = self._state.omega, self._dense
        try:
            solution = dense.solve(omega, start, tolerance=DENSE_TOLERANCE, max_steps=25)
            if not solution.converged:
                return None
            finer = dense.solve(omega, solution.q, tolerance=0.0, max_steps=3)
        except np.linalg.LinAlgError:
            return None
        linear = dense.dynamic_stiffness(omega)
        ends = [
            (candidate.x, float(np.linalg.norm(dense.residual(linear, candidate.q.ravel())[2])))
            for candidate in (solution, finer)
        ]
        return min(ends, key=lambda end: end[1])

    def _is_another(self, x: np.ndarray) -> bool:
        """Whether the compliance form stays where the dense reference ended, solved to rounding."""
        refined = newton.solve(self._balance, self._state.omega, x, NewtonOptions(tolerance=1e-3 * NEWTON))
        drift, distance = (float(np.linalg.norm(refined.state.x - end)) for end in (x, self._state.x))
        return refined.converged and drift < 1e-2 * distance
