"""Direct time integration of the reduced model with the same contact law, to a periodic state.

The independent check of a harmonic balance: M q'' + C q' + K q + B^T f_c = F(t) is stepped through time in the modal
coordinates of the structure without contact, exactly but for the contact forces, which count by their mean over a step
(hbm.time.time_step). The law is the same `step` kernel, but nothing else is shared: no harmonics, no compliance between
harmonics, no alternation of domains.
The start (a harmonic balance state, or static equilibrium) and the acceleration of the transient only choose where
the march begins; what is returned is always one plainly integrated period together with the drift over it.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import compiled_law
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import time_step, wave_in_time
from tribodyn.hbm.time.hold import Hold
from tribodyn.hbm.time.period_search import Period, PeriodSearch
from tribodyn.hbm.time.time_step import Moving, Record

RESOLVED = 1.0  # omega h of a mode from which on its inertia is left out


@dataclass(frozen=True)
class Options:
    """How to integrate.

    steps : time steps per period; the error falls with its square
    tolerance : periodic when the state changes by less than this over one period, relative to its vibration
    max_periods : periods after which to give up; patience : periods without a smaller drift after which to give up
    accelerate : mix the states of past periods (Anderson) instead of waiting for the transient to decay; finds
        unstable periodic motions, too, from which a plain march would leave. A slider that never slips in the periodic
        motion then stands where the load path of the balance left it, else where the transient did
    """

    steps: int = 1024
    tolerance: float = 1e-8
    max_periods: int = 2000
    patience: int = 80
    accelerate: bool = True

    def __post_init__(self) -> None:
        if self.steps < 8:
            raise ValueError(f"steps per period must be at least 8, not {self.steps}")


@dataclass(frozen=True)
class PeriodicMotion:
    """The last period of a time integration.

    omega : [rad/s]; time : (n_step,) instants from T / n_step to T [s]
    x, force : (n_pair, n_component, n_step) relative displacement [m] and contact force [N]
    outputs : (n_output, n_step) observed outputs [m]
    energy : (n_pair,) work of the tangential contact force over the period, integral of f dx [J]
    preload : mean normal force of the whole contact [N], zero where the law has no normal component
    off : (k,) mean of each coordinate that is prescribed in harmonic 0, less what is prescribed [m]
    status : (n_pair,) bits of what happened: STICKS | SLIPS | SEPARATES
    drift : change of the state over the period, relative to the vibration (both as square roots of energy)
    periods : periods integrated in all; iterations : contact iterations per step, on average over the last period
    outcome : CONVERGED, or what went wrong
    slopes : derivatives of the law along the period, see `time_step.Record`, or None if not asked for
    """

    omega: float
    time: np.ndarray
    x: np.ndarray
    force: np.ndarray
    outputs: np.ndarray
    energy: np.ndarray
    preload: float
    off: np.ndarray
    status: np.ndarray
    drift: float
    periods: int
    iterations: float
    outcome: Outcome[SolveEnd]
    slopes: np.ndarray | None

    @property
    def periodic(self) -> bool:
        """Whether the motion repeats itself to the tolerance."""
        return self.outcome.kind is SolveEnd.CONVERGED

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def amplitude(self) -> np.ndarray:
        """(n_output,) vibration amplitude of each output, the root of twice its mean square [m]."""
        swing: np.ndarray = np.sqrt(2 * self.outputs.var(axis=1))
        return swing

    def coefficients(self, series: np.ndarray, basis: HarmonicBasis) -> np.ndarray:
        """Fourier coefficients (..., n_coeff) of a series (..., n_step) of this motion, to stand beside the balance."""
        weight = np.where(basis.order == 0, 1.0, 2.0) / series.shape[-1]
        return series @ (basis.functions(self.omega * self.time) * weight)


@dataclass(frozen=True)
class LeftAlone:
    """What a plain march does, without a search for what repeats itself, over its later half.

    energy, energy_spread : friction work of the whole contact per period, mean and standard deviation [J]
    amplitude, amplitude_spread : (n_output,) of each output in a period, likewise [m]
    drift : change of the state over the last period, as of a `PeriodicMotion`; periods : marched in all
    """

    energy: float
    energy_spread: float
    amplitude: np.ndarray
    amplitude_spread: np.ndarray
    drift: float
    periods: int


class IntegrationFailed(RuntimeError):
    """The contact iteration of a time step did not converge."""


class TimeStepper:
    """One problem made ready for time stepping at one frequency.

    n_dynamic : modes of the structure without contact that move dynamically, the lowest ones with omega h < RESOLVED;
        the others follow statically, so that all of them count and the more of them move the finer the steps are
    lam, damping : of the modes that move, (n_dynamic,) and (n_dynamic, n_dynamic), with unit modal mass
    linear, contact : see `time_step`; static : (n_contact, n_contact) compliance W of the modes that follow
    modes : of the structure without contact, where another stepper of the same model has them already
    hold : what holds a displacement that is prescribed in harmonic 0; None where there is none
    Raises  ValueError for models whose harmonics see different systems but for such a displacement, or whose mass
        matrix is singular
    """

    def __init__(
        self,
        balance: HarmonicBalance,
        omega: float,
        options: Options,
        modes: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        model = balance.model
        model.require_masters("time integration")
        if model.per_harmonic is not None and model.info.reaction is None:
            raise ValueError(
                "time integration needs one system for all harmonics: a cyclic part alone has no equation of motion in "
                "time"
            )
        self.balance, self.omega, self.options = balance, omega, options
        system = model.system
        self.modes = modes or _free_modes(system)
        lam, phi = self.modes
        self.h = 2 * np.pi / omega / options.steps
        m = self.n_dynamic = max(1, int(np.sum(lam < (RESOLVED / self.h) ** 2)))
        self.lam, moving, rest = lam[:m], phi[:, :m], phi[:, m:] / np.sqrt(lam[m:])
        self.n_pair, self.c = balance.contact.stiffness.shape
        B = np.asarray(model.interface.B)
        U, follows = np.ascontiguousarray(B @ moving), B @ rest
        self.static = follows @ follows.T
        rate = system.velocity_matrix
        full = np.zeros((m, m)) if rate is None else moving.T @ np.asarray(rate) @ moving
        self.damping = full
        self.flow = np.zeros((m, m)) if system.circulatory is None else moving.T @ system.circulatory @ moving
        flow = None if system.circulatory is None else self.flow
        own = np.abs(np.diag(full))
        off = np.abs(full - np.diag(np.diag(full)))
        diagonal = flow is None and bool(np.all(off <= 1e-9 * np.sqrt(np.outer(own, own)) + 1e-13 * own.max()))
        names = balance.compliance.output_names
        rows = np.array([system.outputs[name] for name in names]).reshape(len(names), len(phi))
        basis = balance.basis
        force = balance.loaded(self._load(len(phi)))  # (n, n_coeff)
        self._modal_load = moving.T @ force
        samples = basis.functions(2 * np.pi * np.arange(1, options.steps + 1) / options.steps)
        base = balance.excitation.base
        self._base = np.zeros((len(B), basis.n_coeff)) if base is None else balance.loaded(base)
        E, Q, kick = _exact_step(self.lam, full, flow, diagonal, self.h, self._modal_load, basis, omega)
        static = int(basis.has_static)
        self.hold = Hold.of(balance, force[:, :static].sum(axis=1), self._base[:, :static].sum(axis=1))
        at = np.zeros((len(phi), 0)) if self.hold is None else self.hold.at
        rows = np.concatenate([rows, at.T])
        outputs = np.concatenate([rows @ moving, np.zeros((len(rows), m)), -(rows @ rest) @ follows.T], axis=1)
        self.rest = follows @ (rest.T @ force) - self._base  # (n_contact, n_coeff)
        output_rest = (rows @ rest) @ (rest.T @ force)
        modal = moving.T @ at
        self._of_hold = modal, Q @ modal, follows @ (rest.T @ at), (rows @ rest) @ (rest.T @ at)
        self.linear = time_step.Linear(
            E, Q, U, np.ascontiguousarray(outputs), np.ascontiguousarray(np.roll(samples, 1, axis=0) @ kick.T),
            np.ascontiguousarray(samples @ self.rest.T), np.ascontiguousarray(samples @ output_rest.T),
        )  # fmt: skip
        compliance = 0.5 * U @ (Q[:m] @ U.T) + self.static
        symmetric = system.gyroscopic is None and system.circulatory is None
        compliance = 0.5 * (compliance + compliance.T) if symmetric else compliance.T
        self._meet(np.ascontiguousarray(compliance))

    def _meet(self, compliance: np.ndarray) -> None:
        """Take up the contact of the balance; compliance : of a step, as in `time_step.Contact`."""
        joint = self.balance.contact.merged("time integration")
        components = joint.parameters.components
        normal = components.index("n") if "n" in components else -1
        self.contact = time_step.Contact(joint.parameters.packed(), joint.parameters.gap, normal, compliance)
        self.law = compiled_law.pointer(joint.module.step)

    def worn(self, balance: HarmonicBalance) -> TimeStepper:
        """The same for a balance that differs in its gaps alone."""
        other = copy(self)
        other.balance = balance
        other._meet(self.contact.A)
        return other

    def _load(self, n: int) -> np.ndarray:
        """(n, n_coeff) coefficients of the loads."""
        basis = self.balance.basis
        amplitudes = np.zeros((n, len(basis.harmonics)), complex)
        for (h, name), value in self.balance.excitation.loads.items():
            if h in basis.harmonics:
                amplitudes[:, basis.harmonics.index(h)] += value * self.balance.model.system.loads[name]
        return basis.to_real(amplitudes)

    def start_from(self, state: State, at_rest: bool = False, added: float = 0.0) -> Moving:
        """What moves at t = 0 in a balance state, every coordinate in equilibrium with its contact forces.

        at_rest : leave out all but harmonic 0; added : damping ratio of the term - 2 zeta w M q' that sustains a
            nonlinear mode
        """
        basis, m = self.balance.basis, self.n_dynamic
        contact_force = state.cycle.force.reshape(len(self.static), -1)
        hold = np.zeros(0) if self.hold is None else self.hold.in_balance(state)
        force = basis.to_complex(self._modal_load - self.linear.U.T @ contact_force)
        eta, v = np.zeros(m), np.zeros(m)
        for i, h in enumerate(basis.harmonics):
            if h == 0:
                eta += self._at_rest(state, hold)
            elif not at_rest:
                s = 1j * h * self.omega
                amplitude = np.linalg.solve(
                    np.diag(self.lam + s * s - 2 * added * self.omega * s) + s * self.damping + self.flow, force[:, i]
                )
                eta += amplitude.real
                v += (s * amplitude).real
        angles = 2 * np.pi * np.arange(1, self.options.steps + 1) / self.options.steps
        x = (state.x @ basis.functions(angles).T).transpose(2, 0, 1)
        memory = self.memory_of(np.ascontiguousarray(x))
        return self.moving(np.concatenate([eta, self.h * v]), memory, x[-1], state.cycle.force[..., 0], hold)

    def _at_rest(self, state: State, hold: np.ndarray) -> np.ndarray:
        """Modal coordinates of harmonic 0, by the stuck system: without contact a part may be loose."""
        k, U = self.balance.compliance.k, self.linear.U
        modal, _, rest, _ = self._of_hold
        pull = k * (state.flat[:, 0] - self.rest[:, 0] - rest @ hold) - state.cycle.force.reshape(len(k), -1)[:, 0]
        pull += k * (self.static @ state.cycle.force.reshape(len(k), -1)[:, 0])
        found: np.ndarray = np.linalg.solve(
            np.diag(self.lam) + self.flow + U.T @ (k[:, None] * U),
            self._modal_load[:, 0] + modal @ hold + U.T @ pull,
        )
        return found

    def memory_of(self, x: np.ndarray) -> np.ndarray:
        """Memory of the periodic cycle of x (n_step, n_pair, c) that begins where the balance's load path does."""
        memory: np.ndarray = time_step.memory_after(self.law, x, self.contact, self.balance.memory)[0]
        return memory

    def moving(self, z: np.ndarray, memory: np.ndarray, x: np.ndarray, f: np.ndarray, hold: np.ndarray) -> Moving:
        """What moves at t = 0 from z = (eta, h v), memory and hold, with guesses for x and f (n_pair, c)."""
        x, f, s = np.array(x), np.array(f), np.array(memory)
        x_free = self.linear.U @ z[: self.n_dynamic] + self.rest @ self.balance.basis.functions(np.zeros(()))
        x_free += self._of_hold[2] @ hold
        contact = self.contact._replace(A=self.static)
        closed = np.zeros(self.n_pair, bool)
        _, rounds, _ = time_step.solve_contact(
            self.law, contact, x_free, x.copy(), closed, s, x, f, float(np.abs(x).max()), np.zeros_like(self.static)
        )
        if rounds < 0:
            raise IntegrationFailed("the contact has no equilibrium to start from")
        s, bits = time_step.memory_after(self.law, x[None], self.contact, s)
        return Moving(z.copy(), x, f, s, bits, np.array(hold))

    def period(self, start: Moving, with_slopes: bool = False) -> tuple[Moving, Record, int, float]:
        """March one period from t = 0.

        Returns what moves after it, its record, the rounds of the contact solver and the largest modal speed
        Raises  IntegrationFailed
        """
        n, n_pair, c, n_state = self.options.steps, self.n_pair, self.c, start.memory.shape[1]
        end = Moving(*(np.array(part) for part in start))
        record = Record(
            np.empty((n, n_pair, c)), np.empty((n, n_pair, c)), np.empty((n, len(self.linear.outputs))),
            np.zeros(n_pair, np.int64), np.zeros((n if with_slopes else 0, n_pair, c + n_state, 2 * c + n_state)),
        )  # fmt: skip
        linear = self.linear
        if self.hold is not None:
            _, kick, rest, output_rest = self._of_hold
            linear = linear._replace(
                kick=linear.kick + kick @ start.hold,
                rest=linear.rest + rest @ start.hold,
                output_rest=linear.output_rest + output_rest @ start.hold,
            )
        failed, spent, speed = time_step.march(self.law, self.contact, linear, end, record)
        if failed >= 0:
            raise IntegrationFailed(
                f"the contact iteration did not converge in step {failed} of {n}: take more steps per period"
            )
        return end, record, spent, speed / self.h


def _free_modes(system: SecondOrderSystem) -> tuple[np.ndarray, np.ndarray]:
    matrices = [np.asarray(matrix) for matrix in (system.stiffness, system.mass)]
    if all(np.count_nonzero(matrix) == np.count_nonzero(np.diag(matrix)) for matrix in matrices):
        k, m = (np.diag(matrix) for matrix in matrices)
        if (m > 0).all():
            order = np.argsort(k / m, kind="stable")
            return (k / m)[order], np.diag(1 / np.sqrt(m))[:, order]
    try:
        lam, phi = sla.eigh(np.asarray(system.stiffness), np.asarray(system.mass))
    except np.linalg.LinAlgError:
        raise ValueError(
            "time integration needs a positive definite mass matrix: give every coordinate some mass"
        ) from None
    return lam, phi


def _exact_step(
    lam: np.ndarray,
    damping: np.ndarray,
    flow: np.ndarray | None,
    diagonal: bool,
    h: float,
    load: np.ndarray,
    basis: HarmonicBasis,
    omega: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """E, Q and the kick per coefficient of the loads (2 m, n_coeff) at the start of the step; see `time_step`.

    load : (m, n_coeff) modal load. All are exponentials of the step's motion together with what drives it
    """
    m = len(lam)
    groups = [[i] for i in range(m)] if diagonal else [list(range(m))]
    E, Q, kick = np.zeros((2 * m, 2 * m)), np.zeros((2 * m, m)), np.zeros((2 * m, basis.n_coeff))
    turn = basis.rate * (omega * h)  # of the basis functions within a step
    for g in groups:
        n, rows = len(g), [*g, *(m + i for i in g)]
        size = 2 * n + n + basis.n_coeff
        rate = np.zeros((size, size))
        rate[:n, n : 2 * n] = np.eye(n)
        rate[n : 2 * n, :n] = -(h**2) * np.diag(lam[g])
        rate[n : 2 * n, n : 2 * n] = -h * damping[np.ix_(g, g)]
        if flow is not None:
            rate[n : 2 * n, :n] -= h**2 * flow[np.ix_(g, g)]
        rate[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
        scale = float(np.abs(load[g]).max()) or 1.0
        rate[n : 2 * n, 3 * n :] = load[g] / scale
        rate[3 * n :, 3 * n :] = turn
        whole = sla.expm(rate)
        E[np.ix_(rows, rows)] = whole[: 2 * n, : 2 * n]
        Q[np.ix_(rows, g)] = h**2 * whole[: 2 * n, 2 * n : 3 * n]
        kick[rows] = h**2 * scale * whole[: 2 * n, 3 * n :]
    return E, Q, kick


@single
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
    Of a travelling wave all sectors are marched until it repeats itself, and the first of them is shown; its slopes
    are of all of them
    Returns the last period, also where it is not periodic within max_periods, as its outcome then says
    Raises  ValueError for models with no equation of motion in time; IntegrationFailed
    """
    options = options or Options()
    whole, begin = _in_time(balance, omega, start, options)
    stepper = TimeStepper(whole, omega, options)
    motion = stepper.start_from(begin) if begin is not None else _rest(stepper)
    return _of_sector(balance, _to_periodic(stepper, motion, options, with_slopes))


@single
def leave_alone(
    balance: HarmonicBalance, omega: float, start: State, periods: int, options: Options | None = None
) -> LeftAlone:
    """March from a balance state and see where the motion goes, periodic or not.

    An unstable periodic motion is left, for another one or for one that never repeats itself; means over many periods
    then are what a machine shows
    Raises  ValueError for models with no equation of motion in time; IntegrationFailed
    """
    options = replace(options or Options(), accelerate=False)
    whole, begin = _in_time(balance, omega, start, options)
    assert begin is not None
    stepper = TimeStepper(whole, omega, options)
    search = PeriodSearch(stepper, replace(options, max_periods=periods, patience=periods), False)
    energy, amplitude = [], []
    motion = stepper.start_from(begin)
    for _ in range(periods):
        found = search.step(motion)
        seen = _of_sector(balance, motion_of(stepper, found, search.periods, CONVERGED, motion))
        motion = found.end
        energy.append(float(seen.energy.sum()))
        amplitude.append(seen.amplitude)
    late, swing = np.array(energy[periods // 2 :]), np.array(amplitude[periods // 2 :])
    return LeftAlone(
        energy=float(late.mean()),
        energy_spread=float(late.std()),
        amplitude=swing.mean(axis=0),
        amplitude_spread=swing.std(axis=0),
        drift=found.drift,
        periods=periods,
    )


def _in_time(
    balance: HarmonicBalance, omega: float, start: State | None, options: Options
) -> tuple[HarmonicBalance, State | None]:
    """The problem that has an equation of motion in time, and the start: a wave as the sectors until it repeats."""
    if not wave_in_time.is_wave(balance):
        return balance, start
    whole = wave_in_time.unroll(balance, RESOLVED * options.steps * omega / (2 * np.pi))
    return whole, None if start is None else wave_in_time.state_of(balance, whole, start)


def _of_sector(balance: HarmonicBalance, motion: PeriodicMotion) -> PeriodicMotion:
    """The motion of the first sector of a wave; any other motion is left as it is."""
    if not wave_in_time.is_wave(balance):
        return motion
    pairs, components = slice(0, balance.contact.n_pair), balance.contact.components
    force = motion.force[pairs]
    normal = force[:, components.index("n")].mean(axis=1).sum() if "n" in components else 0.0
    return replace(
        motion,
        x=motion.x[pairs],
        force=force,
        outputs=motion.outputs[: len(balance.compliance.output_names)],
        energy=motion.energy[pairs],
        preload=float(normal),
        status=motion.status[pairs],
    )


def _rest(stepper: TimeStepper) -> Moving:
    still = stepper.balance.with_load(0.0)
    solution = newton.solve(still, stepper.omega, still.stuck(stepper.omega))
    if not solution.converged:
        raise ValueError(f"no static equilibrium to start from ({solution.outcome}): start from a balance state")
    return stepper.start_from(solution.state, at_rest=True)


def _to_periodic(stepper: TimeStepper, motion: Moving, options: Options, with_slopes: bool) -> PeriodicMotion:
    search = PeriodSearch(stepper, options, with_slopes)
    found = search.mix(motion) if options.accelerate else search.march(motion)
    if found.drift <= options.tolerance:
        return motion_of(stepper, found, search.periods, CONVERGED)
    hint = "; is the motion stable there?" if search.periods < options.max_periods else ""
    smallest = search.best.drift
    outcome = SolveEnd.NOT_PERIODIC.say(
        f" {search.periods} periods: drift {found.drift:.1e}, smallest {smallest:.1e}{hint}"
    )
    return motion_of(stepper, found, search.periods, outcome)


def motion_of(
    stepper: TimeStepper,
    period: Period,
    periods: int,
    outcome: Outcome[SolveEnd],
    start: Moving | None = None,
) -> PeriodicMotion:
    """What one marched period shows.

    periods, outcome : as of the `PeriodicMotion`
    start : what moved before it, of a motion that does not repeat itself, where the work of the first step counts from
    """
    record = period.record
    components = stepper.balance.contact.components
    before = np.roll(record.x, 1, axis=0), np.roll(record.f, 1, axis=0)
    if start is not None:
        before[0][0], before[1][0] = start.x, start.f
    work = 0.5 * ((record.f + before[1]) * (record.x - before[0])).sum(axis=0)
    work = work[:, stepper.balance.contact.tangential].sum(axis=1)
    preload = float(record.f[:, :, components.index("n")].mean(axis=0).sum()) if "n" in components else 0.0
    n, hold = len(stepper.balance.compliance.output_names), stepper.hold
    off = np.zeros(0) if hold is None else record.y[:, n:].mean(axis=0) - hold.target
    return PeriodicMotion(
        omega=stepper.omega,
        time=stepper.h * np.arange(1, stepper.options.steps + 1),
        x=np.moveaxis(record.x, 0, 2),
        force=np.moveaxis(record.f, 0, 2),
        outputs=record.y.T[:n],
        energy=work,
        preload=preload,
        off=off,
        status=record.bits,
        drift=period.drift,
        periods=periods,
        iterations=period.rounds / stepper.options.steps,
        outcome=outcome,
        slopes=record.slopes if len(record.slopes) else None,
    )
