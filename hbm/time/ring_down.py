"""A free decay in time, and frequency and damping by amplitude from its output alone.

The motion starts in a nonlinear mode, or at rest with a hammer's blow, and is left alone under the static loads. As in
an experiment only one output is looked at. In a window of some periods that slides along it, a harmonic whose logarithm
of amplitude and whose phase are straight lines, bent a little, is fitted together with its multiples and the mean:
their slopes are the damping and the frequency. Like a narrow filter the smooth window leaves out other modes that ring
along; peaks do not, and one thousandth of the seventh harmonic's frequency changes the damping between two peaks by per
cents.
Source  damping by amplitude from a decay: Jin, Chen, Brake and Song, MSSP 141 (2020) 106479; their filter and peaks are
one local fit here"""

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.threads import single
from tribodyn.hbm.time.stepper import IntegrationFailed, Options, TimeStepper
from tribodyn.hbm.time.time_step import Moving
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class FitRules:
    """How amplitude, frequency and damping are fitted to a free decay."""

    window: int = 4  # periods of a window
    multiples: tuple[int, ...] = (2, 3)  # of the frequency, fitted along
    refined: int = 4  # rounds in which frequency and damping of a window settle
    ringing: float = 0.05  # of the amplitude, root mean square, from which on what is left over is too much


RULES = FitRules()


@dataclass(frozen=True)
class RingDown:
    """A free decay and what it says.

    time : (n,) [s]; displacement : (n,) of the output about its mean [m]
    amplitude : (k,) half the range of what is fitted [m]; omega : (k,) [rad/s]
    damping : (k,) logarithmic decrement of a period over 2 pi; all at the middles of the windows
    rest : (k,) root mean square of what else rings in a window, over the amplitude"""

    time: np.ndarray
    displacement: np.ndarray
    amplitude: np.ndarray
    omega: np.ndarray
    damping: np.ndarray
    rest: np.ndarray

    @property
    def last(self) -> float:
        """Amplitude in the last period that was marched, half from peak to peak [m]."""
        period = round(2 * np.pi / (self.omega[-1] * (self.time[1] - self.time[0])))
        return float(np.ptp(self.displacement[-period:]) / 2)


@single
def ring_down(balance: HarmonicBalance, mode: Backbone, periods: int, steps: int = 256, least: float = 0.0) -> RingDown:
    """Let the structure swing freely from the last point of its backbone.

    periods : at most so many, of the frequency at the start; steps : per period
    least : amplitude of the output at which to end [m]
    Raises  ValueError for models with no equation of motion in time, IntegrationFailed"""
    free = balance.with_load(0.0)
    omega = float(mode.omega[-1])
    stepper = TimeStepper(free, omega, Options(steps=steps))
    x = balance.shaped(mode.contact[-1])
    moving = stepper.start_from(free.evaluate(omega, x), added=float(mode.damping[-1]))
    row = balance.compliance.output_names.index(mode.output)
    return from_decay(*_marched(stepper, moving, row, periods, least), omega)


@single
def hammer(
    balance: HarmonicBalance, impulse: float, omega: float, output: str, periods: int, steps: int = 256,
    least: float = 0.0,
) -> RingDown:  # fmt: skip
    """Let the structure swing freely after a blow on it at rest.

    impulse : of the blow, where and in which direction the vibrating load acts [N s]; it takes no time, and what is so
        stiff that the time steps leave its inertia out does not feel it
    omega : a guess of the frequency that is looked for [rad/s]; output : in which; else as `ring_down`
    Raises  ValueError where several loads vibrate, or the structure has no equilibrium"""
    struck = [name for (h, name), value in balance.excitation.loads.items() if h and value != 0]
    if len(set(struck)) != 1:
        raise Refusal(f"a blow acts where the one vibrating load does: there are {len(set(struck))}")
    free = balance.with_load(0.0)
    still = newton.solve(free, omega, free.stuck(omega))
    if not still.converged:
        raise Refusal(f"no static equilibrium to be struck in: {still.outcome}")
    stepper = TimeStepper(free, omega, Options(steps=steps))
    moving = stepper.start_from(still.state, at_rest=True)
    m = stepper.n_dynamic
    moving.z[m:] += stepper.h * impulse * (stepper.modes[1][:, :m].T @ np.real(balance.model.system.loads[struck[0]]))
    row = balance.compliance.output_names.index(output)
    return from_decay(*_marched(stepper, moving, row, periods, least), omega, has_other_modes=True)


def _marched(
    stepper: TimeStepper, moving: Moving, row: int, periods: int, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and output [m] of periods marched, until it swings less than `least`."""
    marched = []
    for _ in range(periods):
        moving, record, _, _ = stepper.period(moving)
        marched.append(record.y[:, row])
        if np.ptp(marched[-1]) < 2 * least:
            break
    displacement = np.concatenate(marched)
    if not np.isfinite(displacement).all():
        raise IntegrationFailed("the free decay grows without bound: take more steps per period")
    return stepper.h * np.arange(1, len(displacement) + 1), displacement


def from_decay(time: np.ndarray, displacement: np.ndarray, omega: float, has_other_modes: bool = False) -> RingDown:
    """Frequency and damping by amplitude of a decaying oscillation (n,), sampled at equal steps.

    omega : a guess of its frequency [rad/s]
    has_other_modes : whether other modes may be excited, too, which `rest` then states; those within half of the
        frequency disturb
    Raises  ValueError for a decay that is too short, IntegrationFailed where several modes ring"""
    step = time[1] - time[0]
    period = 2 * np.pi / (omega * step)
    n = round(RULES.window * period)
    if len(time) < n + period:
        raise Refusal(
            f"a decay of {len(time) / period:.1f} periods is too short for its damping: {RULES.window + 1} are needed"
        )
    inside = (np.arange(n) + 0.5) / n - 0.5  # time from the middle, over the window
    weight = np.cos(np.pi * inside)  # root of Hann's window
    rate, rows = 1j * omega, []
    for start in range(0, len(time) - n + 1, max(1, round(period / 2))):
        observed = displacement[start : start + n]
        for _ in range(RULES.refined):
            size, multiples, slope, remaining = _fitted(observed, rate * step * n, inside, weight)
            rate += slope / (size * step * n)
        if not has_other_modes and not remaining < RULES.ringing * abs(size):
            raise IntegrationFailed(
                f"the decay is no single oscillation: {remaining / abs(size):.0%} of its amplitude are "
                f"harmonics above {RULES.multiples[-1]} or other modes; "
                "begin at a smaller amplitude, or end at a larger one"
            )
        swing = float(amplitude(np.array([size.real, -size.imag, *multiples]), (1, *RULES.multiples)))
        rows.append((swing, rate.imag, -rate.real / rate.imag, remaining / swing))
    return RingDown(time, displacement - displacement.mean(), *np.array(rows).T)


def _fitted(
    observed: np.ndarray, rate: complex, inside: np.ndarray, weight: np.ndarray
) -> tuple[complex, np.ndarray, complex, float]:
    """Complex amplitude of exp(rate t) at the middle, coefficients of its multiples, slope of the amplitude over the
    window, and root mean square of the rest."""
    carrier = np.exp(rate * inside)
    parts = [
        carrier,
        carrier * inside,
        carrier * inside**2,
        *(np.exp(1j * m * rate.imag * inside) for m in RULES.multiples),
    ]
    columns = np.column_stack([np.ones_like(inside), inside, *(c for p in parts for c in (p.real, -p.imag))])
    fit = np.linalg.lstsq(columns * weight[:, None], observed * weight, rcond=None)[0]
    equilibrium = float(np.sqrt(np.mean((weight * (observed - columns @ fit)) ** 2)))
    turned = np.tile([1.0, -1.0], len(RULES.multiples))  # columns are those of a - ib
    return complex(fit[2], fit[3]), turned * fit[8:], complex(fit[4], fit[5]), equilibrium
