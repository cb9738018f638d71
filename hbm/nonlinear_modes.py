"""Nonlinear modes: backbone of frequency and damping against amplitude, by the extended periodic motion concept.

    M q'' + (C - 2 zeta w M) q' + K q + B^T f_c(x) = F_0

is periodic for the pair (w, zeta) at which the added, mass-proportional term balances what the contact and C dissipate.
Amplitude and phase are fixed by the coordinate of a reference mode, phi^T M q_1 = a, real. The linear side is solved
directly in all modes of the stuck structure (bordered by the reference mode, so that it stays regular in resonance),
since the added term changes it at every point; the unknowns are the contact displacements, w and zeta, by Newton-GMRES.
Source  Krack 2015, Computers & Structures 154; the bordered elimination of the structure is ours
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as sla
from threadpoolctl import threadpool_limits

from hbm import law as contact_law
from hbm import newton
from hbm.balance import HarmonicBalance
from hbm.branch import CONVERGED
from hbm.krylov import gmres
from hbm.law import SEPARATES, ContactCycle
from hbm.newton import NewtonOptions


@dataclass(frozen=True)
class Options:
    """n_points : amplitudes, equidistant in the logarithm; refinements : times a failed step may be halved."""

    n_points: int = 40
    refinements: int = 6
    newton: NewtonOptions = field(default_factory=NewtonOptions)


@dataclass(frozen=True)
class Backbone:
    """One nonlinear mode.

    amplitude : (n_point,) of the chosen output as the reference mode alone would move it [m]
    omega : (n_point,) natural frequency [rad/s]; damping : (n_point,) modal damping ratio, structure and contact
    output_names, response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m]
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point "converged" or a sentence; newton_steps : (n_point,)
    reference_omega : of the mode at rest, stuck where the static load keeps the contact closed [rad/s]
    end : sentence that says where and why the backbone ends
    """

    amplitude: np.ndarray
    omega: np.ndarray
    damping: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[str, ...]
    newton_steps: np.ndarray
    reference_omega: float
    end: str


@dataclass(frozen=True)
class _Point:
    """x (n_pair, c, n_coeff), omega, zeta at amplitude a, and what they give.

    residual : of x, omega and zeta, scaled; eta : complex modal amplitudes (n, n_harmonic)
    """

    a: float
    x: np.ndarray
    omega: float
    zeta: float
    cycle: ContactCycle
    eta: np.ndarray
    residual: np.ndarray
    factors: list[tuple[np.ndarray, np.ndarray]]

    @property
    def error(self) -> float:
        return float(np.linalg.norm(self.residual))


def backbone(
    balance: HarmonicBalance,
    start: float,
    stop: float,
    mode: int = 0,
    output: str | None = None,
    options: Options | None = None,
) -> Backbone:
    """Follow one nonlinear mode from a small to a large amplitude (or back).

    balance : its vibration load plays no part, its static load does
    start, stop : amplitudes [m] of `output` (the first by default) in the reference mode
    mode : number of the reference mode, from 0, among the modes about the static equilibrium
    Raises  ValueError for models whose harmonics see different systems, unknown outputs, no static equilibrium
    """
    options = options or Options()
    with threadpool_limits(1):
        problem = _Problem(balance, mode, output)
        if not (start > 0 and stop > 0):
            raise ValueError(f"the amplitudes of a backbone must be > 0, not {start} and {stop}")
        wanted = np.geomspace(start, stop, options.n_points) / problem.per_amplitude
        solved = [_newton(problem, problem.first_guess(wanted[0]), options.newton)]
        for a in wanted[1:]:
            if solved[-1][1] != CONVERGED:
                break
            _step(problem, solved, a, options, options.refinements)
        return problem.result(solved)


_Solved = tuple[_Point, str, int]


def _step(problem: _Problem, solved: list[_Solved], a: float, options: Options, halvings: int) -> None:
    """Append the point at a, through points in between where it fails; the last one says so if all fails."""
    attempt = _newton(problem, _predict(problem, [s[0] for s in solved[-3:]], a), options.newton)
    if attempt[1] != CONVERGED and halvings > 0:
        _step(problem, solved, float(np.sqrt(solved[-1][0].a * a)), options, halvings - 1)
        if solved[-1][1] == CONVERGED:
            _step(problem, solved, a, options, halvings - 1)
        return
    solved.append(attempt)


def _predict(problem: _Problem, last: list[_Point], a: float) -> _Point:
    """Extrapolate static part, vibration over amplitude, omega and zeta in the logarithm of the amplitude."""
    t = np.log([p.a for p in last])
    weights = [np.prod((np.log(a) - np.delete(t, i)) / (t[i] - np.delete(t, i))) for i in range(len(t))]
    scale = [np.where(problem.basis.order == 0, 1.0, a / p.a) for p in last]
    x = sum(w * p.x * s for w, p, s in zip(weights, last, scale, strict=True))
    omega = sum(w * p.omega for w, p in zip(weights, last, strict=True))
    zeta = sum(w * p.zeta for w, p in zip(weights, last, strict=True))
    return problem.evaluate(a, x, omega, zeta)


def _newton(problem: _Problem, point: _Point, options: NewtonOptions) -> _Solved:
    for step in range(options.max_steps):
        if point.error <= options.tolerance:
            return point, CONVERGED, step
        direction = problem.direction(point, max(min(1e-3, point.error), 1e-10), options.max_products)
        best = point
        length = 1.0
        for _ in range(10):
            trial = problem.moved(point, length * direction)
            best = min(best, trial, key=lambda p: p.error)
            if trial.error <= (1 - 0.1 * length) * point.error:
                break
            length *= 0.5
        if best is point:
            return point, f"no descent from relative residual {point.error:.1e}", step + 1
        point = best
    if point.error <= options.tolerance:
        return point, CONVERGED, options.max_steps
    return point, f"not converged in {options.max_steps} steps: {point.error:.1e}", options.max_steps


class _Problem:
    """The autonomous problem in modes of the stuck structure."""

    def __init__(self, balance: HarmonicBalance, mode: int, output: str | None):
        model, self.balance, self.basis = balance.model, balance, balance.basis
        if model.per_harmonic is not None:
            raise ValueError(
                "nonlinear modes need one system for all harmonics: this model has one of its own per harmonic"
            )
        if 1 not in self.basis.harmonics:
            raise ValueError("nonlinear modes need harmonic 1 among the harmonics")
        system, b = model.system, np.asarray(model.interface.B)
        names = balance.compliance.output_names
        if not names or (output is not None and output not in names):
            raise ValueError(
                f"no output '{output}' to measure the amplitude: the model has {', '.join(names) or 'none'}"
            )
        self.k = balance.compliance.k
        mass = np.asarray(system.mass)
        self.lam, phi = sla.eigh(np.asarray(system.stiffness) + b.T @ (self.k[:, None] * b), mass)
        self.n = len(self.lam)
        self.U = b @ phi
        self.O = np.array([system.outputs[name] @ phi for name in names])
        self.damping = np.zeros_like(mass) if system.damping is None else phi.T @ np.asarray(system.damping) @ phi
        static = sum(
            (v * system.loads[name] for (h, name), v in balance.excitation.loads.items() if h == 0), np.zeros(self.n)
        )
        base = balance.excitation.base
        self.base = np.zeros(len(b)) if base is None or not self.basis.has_static else base[:, 0]
        self.static_load = phi.T @ np.real(static) + self.U.T @ (self.k * self.base)
        self.rest, apart = self._static_state()
        squares, shapes = np.linalg.eigh(np.diag(self.lam) - self.U[apart].T @ (self.k[apart, None] * self.U[apart]))
        if not 0 <= mode < self.n:
            raise ValueError(f"there is no mode {mode}: the model has modes 0 to {self.n - 1}")
        if squares[mode] <= 1e-8 * squares[-1]:
            raise ValueError(f"mode {mode} is a rigid-body motion at rest: choose one that vibrates")
        self.reference, self.reference_omega = shapes[:, mode], float(np.sqrt(squares[mode]))
        moved = self.O @ self.reference
        self.per_amplitude = float(abs(moved[0 if output is None else names.index(output)]))
        if self.per_amplitude <= 1e-9 * np.abs(self.O).max():
            raise ValueError(f"output '{output or names[0]}' does not move in mode {mode}: choose another output")

    def _static_state(self) -> tuple[np.ndarray, np.ndarray]:
        """x at rest, and which contacts are open there."""
        still = self.balance.with_load(0.0)
        solution = newton.solve(still, still.omega_max, still.stuck(still.omega_max))
        if not solution.converged:
            raise ValueError(f"no static equilibrium for a nonlinear mode to vibrate about: {solution.outcome}")
        apart = solution.state.cycle.status & SEPARATES > 0
        return solution.state.x, np.repeat(apart, solution.state.x.shape[1])

    def first_guess(self, a: float) -> _Point:
        x = self.rest.copy()
        x[:, :, int(self.basis.has_static)] += a * (self.U @ self.reference).reshape(x.shape[:2])
        zeta = float(self.reference @ self.damping @ self.reference) / (2 * self.reference_omega)
        return self.evaluate(a, x, self.reference_omega, zeta)

    def _scales(self, a: float) -> np.ndarray:
        """(n_contact, n_coeff) what a displacement is measured by: x_0 by the static one, the rest by the amplitude."""
        vibration = a * np.linalg.norm(self.U @ self.reference)
        still = np.linalg.norm(self.rest[:, :, 0]) if self.basis.has_static else 0.0
        one = np.where(self.basis.order == 0, vibration + still, vibration)
        return np.broadcast_to(one, (len(self.k), self.basis.n_coeff))

    def evaluate(self, a: float, x: np.ndarray, omega: float, zeta: float) -> _Point:
        cycle = contact_law.cycle(self.balance.law, x, self.balance.parameters, self.basis, self.balance.memory)
        flat = x.reshape(-1, self.basis.n_coeff)
        g = self.k[:, None] * flat - cycle.force.reshape(flat.shape)
        factors = []
        for h in self.basis.harmonics:
            s = 1j * h * omega
            d = s * self.damping + np.diag(self.lam + s * s - 2 * zeta * omega * s)
            border = self.reference if h == 1 else np.zeros(self.n)
            corner = 0.0 if h == 1 else 1.0
            factors.append(sla.lu_factor(np.block([[d, border[:, None]], [border[None], np.array([[corner]])]])))
        rhs = np.zeros((self.n + 1, len(self.basis.harmonics)), complex)
        rhs[:-1] = self.U.T @ self.basis.to_complex(g)
        if self.basis.has_static:
            rhs[:-1, 0] += self.static_load
        rhs[-1, self.basis.harmonics.index(1)] = a
        eta, mismatch = self._solve(factors, rhs)
        move = self.basis.to_real(self.U @ eta)
        if self.basis.has_static:
            move[:, 0] -= self.base
        residual = self._pack(a, flat - move, mismatch)
        return _Point(a, x, omega, zeta, cycle, eta, residual, factors)

    def _solve(self, factors: list[tuple[np.ndarray, np.ndarray]], rhs: np.ndarray) -> tuple[np.ndarray, complex]:
        """Modal amplitudes, and what is missing along the reference mode in harmonic 1."""
        out = np.stack([sla.lu_solve(f, rhs[:, i]) for i, f in enumerate(factors)], axis=1)
        return out[:-1], out[-1, self.basis.harmonics.index(1)]

    def _pack(self, a: float, x: np.ndarray, mismatch: complex) -> np.ndarray:
        relative = mismatch / (self.reference_omega**2 * a)
        return np.concatenate([(x / self._scales(a)).ravel(), [relative.real, relative.imag]])

    def direction(self, p: _Point, tolerance: float, max_products: int) -> np.ndarray:
        """Newton direction for (x, omega / reference, zeta), x in its scales."""
        jac = p.cycle.jacobian
        assert jac is not None
        scales = self._scales(p.a)
        by_omega, by_zeta = self._slopes(p)

        def product(y: np.ndarray) -> np.ndarray:
            d = y[:-2].reshape(scales.shape) * scales
            dg = self.k[:, None] * d - np.matmul(jac, d.reshape(len(jac), -1, 1)).reshape(d.shape)
            rhs = np.zeros((self.n + 1, len(self.basis.harmonics)), complex)
            rhs[:-1] = self.U.T @ self.basis.to_complex(dg)
            eta, mismatch = self._solve(p.factors, rhs)
            out = self._pack(p.a, d - self.basis.to_real(self.U @ eta), mismatch)
            return out + y[-2] * by_omega + y[-1] * by_zeta

        return gmres(product, -p.residual, tolerance, max_products)[0]

    def _slopes(self, p: _Point) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the residual by omega / reference and by zeta."""
        h = np.asarray(self.basis.harmonics)
        through = self.damping @ p.eta
        changes = (
            1j * h * through + (-2 * h**2 * p.omega - 4j * p.zeta * h * p.omega) * p.eta,
            (-2j * h * p.omega**2) * p.eta,
        )
        found = []
        for change, unit in zip(changes, (self.reference_omega, 1.0), strict=True):
            rhs = np.concatenate([-unit * change, np.zeros((1, len(h)))])
            eta, mismatch = self._solve(p.factors, rhs)
            found.append(self._pack(p.a, -self.basis.to_real(self.U @ eta), mismatch))
        return found[0], found[1]

    def moved(self, p: _Point, y: np.ndarray) -> _Point:
        d = (y[:-2].reshape(self._scales(p.a).shape) * self._scales(p.a)).reshape(p.x.shape)
        return self.evaluate(p.a, p.x + d, p.omega + y[-2] * self.reference_omega, p.zeta + y[-1])

    def result(self, solved: list[_Solved]) -> Backbone:
        points = [p for p, _, _ in solved]
        amplitude = np.array([p.a for p in points]) * self.per_amplitude
        work = [float(self.basis.work_per_cycle(p.cycle.force, p.x).sum()) for p in points]
        last = solved[-1][1]
        end = f"reached {amplitude[-1]:.6g} m" if last == CONVERGED else f"ended at {amplitude[-1]:.6g} m: {last}"
        return Backbone(
            amplitude=amplitude,
            omega=np.array([p.omega for p in points]),
            damping=np.array([p.zeta for p in points]),
            output_names=self.balance.compliance.output_names,
            response=np.stack([self.basis.to_real(self.O @ p.eta) for p in points]),
            contact=np.stack([p.x.reshape(-1, self.basis.n_coeff) for p in points]),
            energy=np.array(work),
            outcome=tuple(outcome for _, outcome, _ in solved),
            newton_steps=np.array([steps for _, _, steps in solved]),
            reference_omega=self.reference_omega,
            end=end,
        )
