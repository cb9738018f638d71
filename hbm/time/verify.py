"""A harmonic balance solution beside direct time integration of the same model: how far they are apart, and why."""

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm import harmonics
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.outcome import Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import PeriodicMotion


@dataclass(frozen=True)
class Verification:
    """Relative differences, balance minus time integration over time integration; outputs by name.

    omega : [rad/s]
    amplitude : vibration amplitude of each output
    waveform : largest difference over the period of each output's vibration, over its largest deflection from the mean
    mean : difference of the static part of each output, over the vibration amplitude (static over static where none)
    contact : largest difference over pairs and time of the vibration of x, over its largest deflection
    energy : dissipated energy of the whole contact; energy_pairs : largest difference of one pair over the whole energy
    preload : static normal force of the whole contact; zero where the law has none
    step_error : of the time integration itself, in amplitude and energy, estimated with half the steps (Richardson);
        nan where no periodic motion was found
    drift, periods : how periodic the time integration is, and after how many periods
    outcome : of the time integration: CONVERGED, or what went wrong
    motion : the last period"""

    omega: float
    amplitude: dict[str, float]
    waveform: dict[str, float]
    mean: dict[str, float]
    contact: float
    energy: float
    energy_pairs: float
    preload: float
    step_error: float
    drift: float
    periods: int
    outcome: Outcome[SolveEnd]
    motion: PeriodicMotion

    @property
    def largest(self) -> float:
        """The largest magnitude among amplitude, energy and preload: what "agrees within one per cent" means."""
        return max(abs(v) for v in (*self.amplitude.values(), self.energy, self.preload))


@single
def verify(balance: HarmonicBalance, state: State, options: Options | None = None) -> Verification:
    """Integrate in time from a balance state to the periodic motion nearby and compare.

    state : converged state of the balance; options : of the time integration
    Raises  what `time_integration.integrate` raises"""
    options = options or Options()
    motion = time_integration.integrate(balance, state.omega, state, options)
    functions = balance.basis.functions(state.omega * motion.time)
    outputs = balance.outputs(state) @ functions.T
    names = balance.compliance.output_names
    ours, theirs = _vibration(outputs), _vibration(motion.outputs)
    x_ours, x_theirs = _vibration(state.x @ functions.T), _vibration(motion.x)
    floor = energy_floor(motion)
    energy = balance.energy(state)
    total_energy = max(abs(motion.energy.sum()), floor)
    balance_amplitude = harmonics.amplitude(balance.outputs(state), balance.basis.harmonics)
    amplitude = [_relative(a, b) for a, b in zip(balance_amplitude, motion.amplitude, strict=True)]
    means = [
        _relative(a, b, scale or abs(b))
        for a, b, scale in zip(outputs.mean(axis=1), motion.outputs.mean(axis=1), motion.amplitude, strict=True)
    ]
    return Verification(
        omega=state.omega,
        amplitude=dict(zip(names, amplitude, strict=True)),
        waveform={
            n: _relative(np.abs(a - b).max(), 0.0, np.abs(b).max()) for n, a, b in zip(names, ours, theirs, strict=True)
        },
        mean=dict(zip(names, means, strict=True)),
        contact=_relative(np.abs(x_ours - x_theirs).max(), 0.0, np.abs(x_theirs).max()),
        energy=float((energy.sum() - motion.energy.sum()) / total_energy) if total_energy > 0 else 0.0,
        energy_pairs=float(np.abs(energy - motion.energy).max() / total_energy) if total_energy > 0 else 0.0,
        preload=_relative(balance.preload(state), motion.preload),
        step_error=_step_error(balance, state, options, motion, total_energy) if motion.periodic else float("nan"),
        drift=motion.drift,
        periods=motion.periods,
        outcome=motion.outcome,
        motion=motion,
    )


def _step_error(
    balance: HarmonicBalance, state: State, options: Options, motion: PeriodicMotion, total_energy: float
) -> float:
    """Error of the time steps in amplitude and energy, from half as many."""
    coarse = time_integration.integrate(balance, state.omega, state, replace(options, steps=options.steps // 2))
    amplitudes = zip(coarse.amplitude, motion.amplitude, strict=True)
    energy = (coarse.energy.sum() - motion.energy.sum()) / total_energy if total_energy > 0 else 0.0
    return float(max(abs(v) / 3 for v in (*(_relative(a, b) for a, b in amplitudes), energy)))


def energy_floor(motion: PeriodicMotion) -> float:
    """Energy [J] that time steps cannot tell from none: their squared angle x the sum of largest force x travel."""
    angle = 2 * np.pi / motion.x.shape[2]
    return angle**2 * float((np.abs(motion.force).max(axis=2) * np.ptp(motion.x, axis=2)).sum())


def _vibration(series: np.ndarray) -> np.ndarray:
    return series - series.mean(axis=-1, keepdims=True)


def _relative(value: float, reference: float, scale: float | None = None) -> float:
    scale = abs(reference) if scale is None else scale
    return float((value - reference) / scale) if scale > 0 else float(value != reference)
