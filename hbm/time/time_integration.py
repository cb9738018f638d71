"""Direct time integration of the reduced model with the same contact law, to a periodic state.

The independent check of a harmonic balance: M q'' + C q' + K q + B^T f_c = F(t) is stepped through time in the modal
coordinates of the structure without contact, exactly but for the contact forces, which count by their mean over a step
(hbm.time.time_step). The law is the same `step` kernel, but nothing else is shared: no harmonics, no compliance between
harmonics, no alternation of domains.
The start (a harmonic balance state, or static equilibrium) and the acceleration of the transient only choose where
the march begins; what is returned is always one plainly integrated period together with the drift over it."""

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.time.period_search import Period, PeriodSearch
from tribodyn.hbm.time.stepper import RESOLVED, Options, TimeStepper
from tribodyn.hbm.time.time_step import Moving
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class PeriodicMotion:
    """The last period of a time integration.

    omega : [rad/s]; time : (n_step,) instants from T / n_step to T [s]
    x, force : (n_pair, n_component, n_step) relative displacement [m] and contact force [N]
    outputs : (n_output, n_step) observed outputs [m]
    energy : (n_pair,) work of the tangential contact force over the period, integral of f dx [J]
    normal_force : (n_pair,) mean over the period [N], zero where the law has no normal component
    supplied, damped : work of the loads, and of the damping and a flow, over the period [J]
    hold_error : (k,) mean of each coordinate that is prescribed in harmonic 0, less what is prescribed [m]
    status : (n_pair,) bits of what happened: STICKS | SLIPS | SEPARATES
    drift : change of the state over the period, relative to the vibration (both as square roots of energy)
    periods : periods integrated in all
    outcome : CONVERGED, or what went wrong
    slopes : derivatives of the law along the period, see `time_step.Record`, or None if not asked for"""

    omega: float
    time: np.ndarray
    x: np.ndarray
    force: np.ndarray
    outputs: np.ndarray
    energy: np.ndarray
    normal_force: np.ndarray
    supplied: float
    damped: float
    hold_error: np.ndarray
    status: np.ndarray
    drift: float
    periods: int
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
    def preload(self) -> float:
        """Mean normal force of the whole contact [N]."""
        return float(self.normal_force.sum())

    @property
    def amplitude(self) -> np.ndarray:
        """(n_output,) vibration amplitude of each output [m]: half its range, of parabolas through its extremes."""
        return 0.5 * (_highest(self.outputs) + _highest(-self.outputs))

    def coefficients(self, series: np.ndarray, basis: HarmonicBasis) -> np.ndarray:
        """Fourier coefficients (..., n_coeff) of a series (..., n_step) of this motion, to stand beside the balance."""
        weight = np.where(basis.order == 0, 1.0, 2.0) / series.shape[-1]
        return series @ (basis.functions(self.omega * self.time) * weight)


def _highest(series: np.ndarray) -> np.ndarray:
    """Maximum (n,) of periodic series (n, n_step), of the parabola through the highest sample and its neighbours."""
    at = series.argmax(axis=1)[:, None] + [-1, 0, 1]
    before, highest, following = np.take_along_axis(series, at % series.shape[1], axis=1).T
    slope, curvature = (following - before) / 2, 2 * highest - before - following
    return np.asarray(highest + np.divide(slope**2, 2 * curvature, out=np.zeros_like(slope), where=curvature > 0))


@dataclass(frozen=True)
class FreeMotion:
    """What a plain march does, without a search for what repeats itself, over its later half.

    energy, energy_spread : friction work of the whole contact per period, mean and standard deviation [J]
    amplitude, amplitude_spread : (n_output,) of each output in a period, likewise [m]
    drift : change of the state over the last period, as of a `PeriodicMotion`; periods : marched in all"""

    energy: float
    energy_spread: float
    amplitude: np.ndarray
    amplitude_spread: np.ndarray
    drift: float
    periods: int


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
    Raises  Refusal for models with no equation of motion in time; IntegrationFailed"""
    options, balance = options or Options(), balance.standing(omega)
    full_balance, begin = in_time(balance, omega, start, options)
    stepper = TimeStepper(full_balance, omega, options)
    motion = stepper.start_from(begin) if begin is not None else _rest(stepper)
    return _of_sector(balance, _to_periodic(stepper, motion, options, with_slopes))


@single
def march_freely(
    balance: HarmonicBalance, omega: float, start: State, periods: int, options: Options | None = None,
    added: float = 0.0,
) -> FreeMotion:  # fmt: skip
    """March from a balance state and see where the motion goes, periodic or not.

    added : damping ratio that sustains the start where it is a point of a nonlinear mode, gone at t = 0
    An unstable periodic motion is left, for another one or for one that never repeats itself; means over many periods
    then are what a machine shows
    Raises  Refusal for models with no equation of motion in time; IntegrationFailed"""
    options, balance = replace(options or Options(), accelerate=False), balance.standing(omega)
    full_balance, begin = in_time(balance, omega, start, options)
    assert begin is not None
    stepper = TimeStepper(full_balance, omega, options)
    search = PeriodSearch(stepper, replace(options, max_periods=periods, patience=periods), False)
    energy, amplitude = [], []
    motion = stepper.start_from(begin, added=added)
    for _ in range(periods):
        departed = search.step(motion)
        observed = _of_sector(balance, motion_of(stepper, departed, search.periods, CONVERGED, motion))
        motion = departed.end
        energy.append(float(observed.energy.sum()))
        amplitude.append(observed.amplitude)
    late, swing = np.array(energy[periods // 2 :]), np.array(amplitude[periods // 2 :])
    return FreeMotion(
        energy=float(late.mean()),
        energy_spread=float(late.std()),
        amplitude=swing.mean(axis=0),
        amplitude_spread=swing.std(axis=0),
        drift=departed.drift,
        periods=periods,
    )


def in_time(
    balance: HarmonicBalance, omega: float, start: State | None, options: Options
) -> tuple[HarmonicBalance, State | None]:
    """The problem that has an equation of motion in time, and the start: a wave as the sectors until it repeats."""
    if not balance.model.is_wave:
        return balance, start
    from tribodyn.hbm.time import wave_in_time  # only wheels need it

    full_balance = wave_in_time.unroll(balance, RESOLVED * options.steps * omega / (2 * np.pi))
    return full_balance, None if start is None else wave_in_time.state_of(balance, full_balance, start)


def _of_sector(balance: HarmonicBalance, motion: PeriodicMotion) -> PeriodicMotion:
    """The motion of the first sector of a wave; any other motion is left as it is."""
    if not balance.model.is_wave:
        return motion
    pairs = slice(0, balance.contact.n_pair)
    n_sector = len(motion.energy) // balance.contact.n_pair
    return replace(
        motion,
        supplied=motion.supplied / n_sector,
        damped=motion.damped / n_sector,
        x=motion.x[pairs],
        force=motion.force[pairs],
        outputs=motion.outputs[: len(balance.compliance.output_names)],
        energy=motion.energy[pairs],
        normal_force=motion.normal_force[pairs],
        status=motion.status[pairs],
    )


def _rest(stepper: TimeStepper) -> Moving:
    still = stepper.balance.with_load(0.0)
    solution = newton.solve(still, stepper.omega, still.stuck(stepper.omega))
    if not solution.converged:
        raise Refusal(f"no static equilibrium to start from ({solution.outcome}): start from a balance state")
    return stepper.start_from(solution.state, at_rest=True)


def _to_periodic(stepper: TimeStepper, motion: Moving, options: Options, with_slopes: bool) -> PeriodicMotion:
    search = PeriodSearch(stepper, options, with_slopes)
    period = search.mix(motion) if options.accelerate else search.march(motion)
    if period.drift <= options.tolerance:
        return motion_of(stepper, period, search.periods, CONVERGED)
    hint = "; is the motion stable there?" if search.periods < options.max_periods else ""
    smallest = search.best.drift
    outcome = SolveEnd.NOT_PERIODIC.say(
        f" {search.periods} periods: drift {period.drift:.1e}, smallest {smallest:.1e}{hint}"
    )
    return motion_of(stepper, period, search.periods, outcome)


def motion_of(
    stepper: TimeStepper, period: Period, periods: int, outcome: Outcome[SolveEnd], start: Moving | None = None
) -> PeriodicMotion:
    """What one marched period shows.

    periods, outcome : as of the `PeriodicMotion`
    start : what moved before it, of a motion that does not repeat itself, where the work of the first step counts from
    """
    record = period.record
    components = stepper.balance.contact.components
    x, f = record.x, record.f
    x0, f0 = (x[-1], f[-1]) if start is None else (start.x, start.f)
    late = stepper.linear.late
    work = late * f[1:] + (1 - late) * f[:-1]
    work *= x[1:] - x[:-1]
    work = work.sum(axis=0) + (late * f[0] + (1 - late) * f0) * (x[0] - x0)
    # what the springs of a motion that does not repeat itself store is no friction work
    k = stepper.balance.contact.stiffness
    work -= np.divide(f[-1] ** 2 - f0**2, 2 * k, out=np.zeros_like(work), where=k > 0)
    work = work[:, stepper.balance.contact.tangential].sum(axis=1)
    normal = record.f[:, :, components.index("n")].mean(axis=0) if "n" in components else np.zeros(len(work))
    supplied, damped = stepper.work(record)
    n, hold = len(stepper.balance.compliance.output_names), stepper.hold
    hold_error = np.zeros(0) if hold is None else record.y[:, n:].mean(axis=0) - hold.target
    return PeriodicMotion(
        omega=stepper.omega,
        time=stepper.h * np.arange(1, stepper.options.steps + 1),
        x=np.moveaxis(record.x - stepper.series * record.f, 0, 2),
        force=np.moveaxis(record.f, 0, 2),
        outputs=record.y.T[:n],
        energy=work,
        normal_force=normal,
        supplied=supplied,
        damped=damped,
        hold_error=hold_error,
        status=record.bits,
        drift=period.drift,
        periods=periods,
        outcome=outcome,
        slopes=record.slopes if len(record.slopes) else None,
    )
