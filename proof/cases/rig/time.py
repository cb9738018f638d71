"""The rig in time: does its harmonic balance describe the motion that the equations have?"""

from dataclasses import dataclass

from proof.cases.rig.model import Cycle, Rig
from tribodyn.hbm.time.stepper import IntegrationFailed, Options as TimeOptions
from tribodyn.hbm.time.verify import verify
from tribodyn.workflows.run.settings import OUTPUT

STEPS, PERIODS, DRIFT = 1024, 200, 1e-5  # per period; periods to settle in; of the state over one period


@dataclass(frozen=True)
class InTime:
    """Time integration beside the balance: energy per cycle [J], preload [N], and how the integration ended.

    amplitude : of the balance's response over that in time, less one
    The numbers are those of the last period, periodic or not; None where there is none."""

    energy: float | None
    preload: float | None
    amplitude: float | None
    outcome: str
    periodic: bool = False


def in_time(rig: Rig, cycle: Cycle) -> InTime:
    """Integrate from a solved cycle to the periodic motion nearby."""
    options = TimeOptions(STEPS, tolerance=DRIFT, max_periods=PERIODS)
    try:
        result = verify(rig.model().balance, cycle.state, options)
    except IntegrationFailed as failure:
        return InTime(None, None, None, str(failure))
    amplitude = result.amplitude[OUTPUT]
    energy = float(result.motion.energy.sum())
    return InTime(energy, result.motion.preload, amplitude, str(result.outcome), result.motion.periodic)
