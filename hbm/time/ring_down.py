"""A free decay in time from a nonlinear mode, and frequency and damping by amplitude from its peaks.

The motion starts in the nonlinear mode and is left alone under the static loads. As in an experiment only one output is
looked at: its maxima and minima, each by the parabola through the samples about it. Half the difference of neighbours
is the amplitude; straight lines through a few of them, in time and in the logarithm of the amplitude, are the frequency
and the damping there.
Source  peak finding and fitting: Jin, Chen, Brake and Song, MSSP 141 (2020) 106479; their spline is a local line here
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import single
from tribodyn.hbm.time.time_integration import IntegrationFailed, Options, TimeStepper

FITTED = 6  # neighbouring half periods of a line
UNEVEN = 0.25  # spread of their lengths from which on the peaks are those of several modes


@dataclass(frozen=True)
class RingDown:
    """A free decay and what its peaks say.

    time : (n,) [s]; displacement : (n,) of the output about its mean [m]
    amplitude : (k,) [m]; omega : (k,) [rad/s]; damping : (k,) logarithmic decrement of a period over 2 pi; all at the
        middles of the lines
    """

    time: np.ndarray
    displacement: np.ndarray
    amplitude: np.ndarray
    omega: np.ndarray
    damping: np.ndarray


@single
def ring_down(balance: HarmonicBalance, mode: Backbone, periods: int, steps: int = 256, least: float = 0.0) -> RingDown:
    """Let the structure swing freely from the last point of its backbone.

    periods : at most so many, of the frequency at the start; steps : per period
    least : amplitude of the output at which to end [m]
    Raises  ValueError for models with no equation of motion in time, IntegrationFailed
    """
    free = balance.with_load(0.0)
    omega = float(mode.omega[-1])
    stepper = TimeStepper(free, omega, Options(steps=steps))
    x = mode.contact[-1].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    moving = stepper.start_from(free.evaluate(omega, x), added=float(mode.damping[-1]))
    row, found = balance.compliance.output_names.index(mode.output), []
    for _ in range(periods):
        moving, record, _, _ = stepper.period(moving)
        found.append(record.y[:, row])
        if np.ptp(found[-1]) < 2 * least:
            break
    displacement = np.concatenate(found)
    if not np.isfinite(displacement).all():
        raise IntegrationFailed("the free decay grows without bound: take more steps per period")
    time = stepper.h * np.arange(1, len(displacement) + 1)
    return from_peaks(time, displacement)


def from_peaks(time: np.ndarray, displacement: np.ndarray) -> RingDown:
    """Frequency and damping by amplitude of a decaying oscillation (n,), sampled at equal steps.

    Raises  ValueError for fewer half periods than one line has, IntegrationFailed where several modes ring
    """
    y = displacement
    turns = np.flatnonzero((y[1:-1] - y[:-2]) * (y[2:] - y[1:-1]) < 0) + 1
    if len(turns) < FITTED + 2:
        raise ValueError(f"a decay of {len(turns)} peaks is too short: {FITTED + 2} are needed")
    step = time[1] - time[0]
    before, at, after = y[turns - 1], y[turns], y[turns + 1]
    bend = before - 2 * at + after
    shift = 0.5 * (before - after) / bend
    instant = time[turns] + step * shift
    height = at - 0.25 * (before - after) * shift
    middle = 0.5 * (instant[1:] + instant[:-1])
    size = np.abs(np.diff(height)) / 2
    rows = np.arange(len(middle) - FITTED + 1)[:, None] + np.arange(FITTED)
    half = np.arange(FITTED) - (FITTED - 1) / 2
    length = np.diff(middle[rows], axis=1)  # half of the time between two maxima, or two minima
    spread = np.ptp(length, axis=1) / length.mean(axis=1)
    if (spread > UNEVEN).any():
        raise IntegrationFailed(
            f"the decay is no single oscillation: its half periods differ by {spread.max():.0%} between neighbours, "
            "because other modes ring too; begin at a smaller amplitude, or end at a larger one"
        )
    omega = np.pi / ((middle[rows] @ half) / (half @ half))
    falling = (np.log(size[rows]) @ half) / (half @ half)  # per half period
    return RingDown(time, y - height.mean(), np.exp(np.log(size[rows]).mean(axis=1)), omega, -falling / np.pi)
