"""Direct time integration of the reduced model with the same contact law, to a periodic state.

The independent check of a harmonic balance: M q'' + C q' + K q + B^T f_c = F(t) is stepped through time by the
generalised alpha method, of second order and unconditionally stable for the linear part, in the modal coordinates of
the structure without contact, all of them, so that nothing is truncated. The law is the same `step` kernel, but nothing
else is shared: no harmonics, no compliance between harmonics, no alternation of domains.
The start (a harmonic balance state, or static equilibrium) and the acceleration of the transient only choose where
the march begins; what is returned is always one plainly integrated period together with the drift over it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from threadpoolctl import threadpool_limits

from tribodyn.hbm import newton, time_step
from tribodyn.hbm.anderson import Anderson
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.branch import CONVERGED
from tribodyn.hbm.harmonics import HarmonicBasis


@dataclass(frozen=True)
class Options:
    """How to integrate.

    steps : time steps per period; the error falls with its square
    spectral_radius : of the method at infinite frequency, 1 for the trapezoidal rule, less damps what is not resolved
    tolerance : periodic when the state changes by less than this over one period, relative to its vibration
    max_periods : periods after which to give up; patience : periods without a smaller drift after which to give up
    accelerate : mix the states of past periods (Anderson) instead of waiting for the transient to decay; finds
        unstable periodic motions, too, from which a plain march would leave
    """

    steps: int = 1024
    spectral_radius: float = 0.8
    tolerance: float = 1e-8
    max_periods: int = 2000
    patience: int = 80
    accelerate: bool = True

    def __post_init__(self) -> None:
        if self.steps < 8:
            raise ValueError(f"steps per period must be at least 8, not {self.steps}")
        if not 0 <= self.spectral_radius <= 1:
            raise ValueError(f"spectral_radius must be between 0 and 1, not {self.spectral_radius}")


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the contact law along one period, for the linearised motion.

    force_x, force_s : (n_step, n_pair, c, c), (n_step, n_pair, c, n_state) force with x and with the memory before
    memory_x, memory_s : (n_step, n_pair, n_state, c), (n_step, n_pair, n_state, n_state) memory after the step
    """

    force_x: np.ndarray
    force_s: np.ndarray
    memory_x: np.ndarray
    memory_s: np.ndarray


@dataclass(frozen=True)
class PeriodicMotion:
    """The last period of a time integration.

    omega : [rad/s]; time : (n_step,) instants from T / n_step to T [s]
    x, force : (n_pair, n_component, n_step) relative displacement [m] and contact force [N]
    outputs : (n_output, n_step) observed outputs [m]
    energy : (n_pair,) work of the tangential contact force over the period, integral of f dx [J]
    preload : mean normal force of the whole contact [N], zero where the law has no normal component
    status : (n_pair,) bits of what happened: STICKS | SLIPS | SEPARATES
    drift : change of the state over the period, relative to the vibration (both as square roots of energy)
    periods : periods integrated in all; iterations : contact iterations per step, on average over the last period
    outcome : "converged" or a sentence
    slopes : derivatives of the law along the period, or None if not asked for
    """

    omega: float
    time: np.ndarray
    x: np.ndarray
    force: np.ndarray
    outputs: np.ndarray
    energy: np.ndarray
    preload: float
    status: np.ndarray
    drift: float
    periods: int
    iterations: float
    outcome: str
    slopes: Slopes | None

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.omega / (2 * np.pi)

    def coefficients(self, series: np.ndarray, basis: HarmonicBasis) -> np.ndarray:
        """Fourier coefficients (..., n_coeff) of a series (..., n_step) of this motion, to stand beside the balance."""
        weight = np.where(basis.order == 0, 1.0, 2.0) / series.shape[-1]
        return series @ (basis.functions(self.omega * self.time) * weight)


class IntegrationFailed(RuntimeError):
    """The contact iteration of a time step did not converge."""


class TimeStepper:
    """One problem made ready for time stepping at one frequency.

    lam, damping : modal stiffness (n,) and damping, (1, n) where it is diagonal, else (n, n), with unit modal mass
    U, O : (n_contact, n), (n_output, n) contact and output maps; compliance : (n_contact, n_contact) of one step
    load : (n_step, n) weighted modal load; base : (n_step, n_pair, c) motion of body 2
    Raises  ValueError for models whose harmonics see different systems, or whose mass matrix is singular
    """

    def __init__(self, balance: HarmonicBalance, omega: float, options: Options):
        model = balance.model
        if model.per_harmonic is not None:
            raise ValueError(
                "time integration needs one system for all harmonics: a cyclic part or a displacement prescribed in "
                "harmonic 0 alone has no equation of motion in time"
            )
        self.balance, self.omega, self.options = balance, omega, options
        system = model.system
        try:
            self.lam, phi = sla.eigh(np.asarray(system.stiffness), np.asarray(system.mass))
        except np.linalg.LinAlgError:
            raise ValueError(
                "time integration needs a positive definite mass matrix: give every coordinate some mass"
            ) from None
        self.n_pair, self.c = balance.contact.stiffness.shape
        self.U = np.ascontiguousarray(np.asarray(model.interface.B) @ phi)
        names = balance.compliance.output_names
        self.O = np.array([system.outputs[name] @ phi for name in names]).reshape(len(names), len(phi))
        full = np.zeros_like(phi) if system.damping is None else phi.T @ np.asarray(system.damping) @ phi
        own = np.abs(np.diag(full))
        self.diagonal = bool(
            np.all(np.abs(full - np.diag(np.diag(full))) <= 1e-9 * np.sqrt(np.outer(own, own)) + 1e-13 * own.max())
        )
        self.damping = np.diag(full)[None].copy() if self.diagonal else np.ascontiguousarray(full)
        self._full_damping = full
        rho = options.spectral_radius
        am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        gamma, beta = 0.5 - am + af, 0.25 * (1 - am + af) ** 2
        self.h = 2 * np.pi / omega / options.steps
        self.scheme = (self.h, am, af, beta, gamma)
        effective = (1 - am) * np.eye(len(phi)) + (1 - af) * self.h * (gamma * full + beta * self.h * np.diag(self.lam))
        self.inverse = 1 / np.diag(effective)[None] if self.diagonal else np.ascontiguousarray(np.linalg.inv(effective))
        through = self.inverse[0][:, None] * self.U.T if self.diagonal else self.inverse @ self.U.T
        self.compliance = np.ascontiguousarray((1 - af) * beta * self.h**2 * (self.U @ through))
        joint = balance.contact.only("time integration")
        self.law = time_step.pointer(joint.module.step)
        self.packed = joint.parameters.packed()
        self._load_coefficients = balance.loaded(self._modal_load(phi))
        samples = self._samples(self._load_coefficients)  # (n, n_step), at t_1 .. t_n_step
        self.load = np.ascontiguousarray(((1 - af) * samples + af * np.roll(samples, 1, axis=1)).T)
        base = balance.excitation.base
        self._base = np.zeros((len(self.U), balance.basis.n_coeff)) if base is None else balance.loaded(base)
        self.base = np.ascontiguousarray(self._samples(self._base).T).reshape(options.steps, self.n_pair, self.c)

    def _modal_load(self, phi: np.ndarray) -> np.ndarray:
        amplitudes = np.zeros((len(phi), len(self.balance.basis.harmonics)), complex)
        for (h, name), value in self.balance.excitation.loads.items():
            if h in self.balance.basis.harmonics:
                load = phi.T @ self.balance.model.system.loads[name]
                amplitudes[:, self.balance.basis.harmonics.index(h)] += value * load
        return self.balance.basis.to_real(amplitudes)

    def _samples(self, coefficients: np.ndarray) -> np.ndarray:
        """(..., n_step) values at t_1 .. t_n_step."""
        n = self.options.steps
        return coefficients @ self.balance.basis.functions(2 * np.pi * np.arange(1, n + 1) / n).T

    def start_from(self, state: State, at_rest: bool = False) -> Motion:
        """The motion at t = 0 of a balance state, every coordinate in equilibrium with its contact forces.

        at_rest : leave out all but harmonic 0
        """
        basis = self.balance.basis
        k = self.balance.compliance.k
        pull = k[:, None] * (state.flat + self._base) - state.cycle.force.reshape(len(k), -1)
        force = basis.to_complex(self._load_coefficients + self.U.T @ pull)
        stuck = np.diag(self.lam) + self.U.T @ (k[:, None] * self.U)
        eta, v = np.zeros(len(self.lam)), np.zeros(len(self.lam))
        for i, h in enumerate(basis.harmonics):
            if at_rest and h > 0:
                break
            s = 1j * h * self.omega
            amplitude = np.linalg.solve(stuck + s * self._full_damping + s * s * np.eye(len(stuck)), force[:, i])
            eta += amplitude.real
            v += (s * amplitude).real
        x = np.moveaxis(self._samples(state.flat).reshape(self.n_pair, self.c, -1), 2, 0)
        memory, _ = time_step.memory_after(self.law, np.ascontiguousarray(x), self.packed, self.balance.memory)
        return self.motion(eta, v, None, memory)

    def motion(self, eta: np.ndarray, v: np.ndarray, a: np.ndarray | None, memory: np.ndarray) -> Motion:
        """A motion at t = 0 with its contact forces; the acceleration from equilibrium where it is not given."""
        x = (self.U @ eta).reshape(self.n_pair, self.c) - self.base[-1]
        n_state = memory.shape[1]
        f, slope = np.zeros_like(x), np.zeros((self.n_pair, self.c, self.c))
        unused = [
            np.zeros((self.n_pair, *shape)) for shape in ((self.c, n_state), (n_state, self.c), (n_state, n_state))
        ]
        time_step.evaluate(self.law, x, memory.copy(), self.packed, f, slope, *unused)
        if a is None:
            load = self._load_coefficients @ self.balance.basis.functions(np.zeros(()))
            drag = self.damping[0] * v if self.diagonal else self.damping @ v
            a = load - drag - self.lam * eta - self.U.T @ f.ravel()
        return Motion(eta.copy(), v.copy(), a.copy(), x, f, memory.copy(), slope)

    def period(self, start: Motion, with_slopes: bool = False) -> tuple[Motion, Record]:
        """March one period from t = 0; raises IntegrationFailed."""
        n, n_pair, c, n_state = self.options.steps, self.n_pair, self.c, start.memory.shape[1]
        end = start.copy()
        xs, fs, ys = np.empty((n, n_pair, c)), np.empty((n, n_pair, c)), np.empty((n, len(self.O)))
        bits = np.zeros(n_pair, np.int64)
        m = n if with_slopes else 0
        slopes = tuple(
            np.zeros((m, n_pair, *shape)) for shape in ((c, c), (c, n_state), (n_state, c), (n_state, n_state))
        )
        factor = time_step.refactor(self.compliance, end.slope)
        failed, speed, spent, _ = time_step.march(
            self.law, self.packed, self.scheme, self.lam, self.damping, self.inverse, self.diagonal, self.U,
            self.O, self.compliance, self.load, self.base, end.eta, end.v, end.a, end.x, end.f, end.memory, factor,
            end.slope, xs, fs, ys, bits, slopes,
        )  # fmt: skip
        if failed >= 0:
            raise IntegrationFailed(
                f"the contact iteration did not converge in step {failed} of {n}: take more steps per period"
            )
        return end, Record(xs, fs, ys, bits, speed, spent / n, Slopes(*slopes) if with_slopes else None)


@dataclass(frozen=True)
class Motion:
    """Everything that the future depends on, at one instant: modal eta, v, a (n,); x, f (n_pair, c); memory; df/dx."""

    eta: np.ndarray
    v: np.ndarray
    a: np.ndarray
    x: np.ndarray
    f: np.ndarray
    memory: np.ndarray
    slope: np.ndarray

    def copy(self) -> Motion:
        """The same motion in arrays of its own."""
        return Motion(*(np.array(getattr(self, name)) for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Record:
    """What one period leaves behind; see `time_step.march`."""

    xs: np.ndarray
    fs: np.ndarray
    ys: np.ndarray
    bits: np.ndarray
    speed: float
    iterations: float
    slopes: Slopes | None


class _StateVector:
    """(eta, v, a, memory) as one vector whose square is an energy, and back."""

    def __init__(self, stepper: TimeStepper):
        rate = np.sqrt(np.maximum(stepper.lam, 0.0) + stepper.omega**2)
        self._stepper = stepper
        self._shape = stepper.balance.memory.shape
        spring = np.sqrt(stepper.balance.contact.stiffness[:, : self._shape[1]]).ravel()
        spring[spring == 0] = 1.0
        self._weight = np.concatenate([rate, np.ones_like(rate), 1 / rate, spring])

    def pack(self, m: Motion) -> np.ndarray:
        return self._weight * np.concatenate([m.eta, m.v, m.a, m.memory.ravel()])

    def unpack(self, z: np.ndarray) -> Motion:
        n = len(self._stepper.lam)
        eta, v, a, memory = np.split(z / self._weight, [n, 2 * n, 3 * n])
        return self._stepper.motion(eta, v, a, memory.reshape(self._shape))


def integrate(
    balance: HarmonicBalance,
    omega: float,
    start: State | None = None,
    options: Options | None = None,
    with_slopes: bool = False,
) -> PeriodicMotion:
    """Integrate the problem of a harmonic balance to its periodic motion at one frequency.

    omega : [rad/s]; start : balance state to start from, or None for rest: the balance's static equilibrium
    with_slopes : record the derivatives of the law along the last period
    Returns the last period, also where it is not periodic within max_periods, as its outcome then says
    Raises  ValueError for models with no equation of motion in time; IntegrationFailed
    """
    options = options or Options()
    with threadpool_limits(1):
        stepper = TimeStepper(balance, omega, options)
        motion = stepper.start_from(start) if start is not None else _rest(stepper)
        return _to_periodic(stepper, motion, options, with_slopes)


def _rest(stepper: TimeStepper) -> Motion:
    still = stepper.balance.with_load(0.0)
    solution = newton.solve(still, stepper.omega, still.stuck(stepper.omega))
    if not solution.converged:
        raise ValueError(f"no static equilibrium to start from ({solution.outcome}): start from a balance state")
    return stepper.start_from(solution.state, at_rest=True)


def _to_periodic(stepper: TimeStepper, motion: Motion, options: Options, with_slopes: bool) -> PeriodicMotion:
    vector = _StateVector(stepper)
    mixing = Anderson(depth=40)
    best, best_at = np.inf, 0
    for periods in range(1, options.max_periods + 1):
        end, record = stepper.period(motion, with_slopes)
        z, image = vector.pack(motion), vector.pack(end)
        change = float(np.linalg.norm(image - z))
        drift = change / record.speed if record.speed > 0 else change
        if drift <= options.tolerance:
            return _result(stepper, record, drift, periods, CONVERGED)
        if drift > 4 * best:
            mixing.forget()
        if drift < 0.9 * best:
            best, best_at = drift, periods
        if periods - best_at >= options.patience:
            break
        motion = vector.unpack(mixing.propose(z, image)) if options.accelerate else end
    hint = "; is the motion stable there (hbm.stability)?" if periods < options.max_periods else ""
    outcome = f"not periodic after {periods} periods: drift {drift:.1e}, smallest {best:.1e}{hint}"
    return _result(stepper, record, drift, periods, outcome)


def _result(stepper: TimeStepper, record: Record, drift: float, periods: int, outcome: str) -> PeriodicMotion:
    components = stepper.balance.contact.components
    before = np.roll(record.xs, 1, axis=0), np.roll(record.fs, 1, axis=0)
    work = 0.5 * ((record.fs + before[1]) * (record.xs - before[0])).sum(axis=0)
    work = work[:, stepper.balance.contact.tangential].sum(axis=1)
    preload = float(record.fs[:, :, components.index("n")].mean(axis=0).sum()) if "n" in components else 0.0
    return PeriodicMotion(
        omega=stepper.omega,
        time=stepper.h * np.arange(1, stepper.options.steps + 1),
        x=np.moveaxis(record.xs, 0, 2),
        force=np.moveaxis(record.fs, 0, 2),
        outputs=record.ys.T,
        energy=work,
        preload=preload,
        status=record.bits,
        drift=drift,
        periods=periods,
        iterations=record.iterations,
        outcome=outcome,
        slopes=record.slopes,
    )
