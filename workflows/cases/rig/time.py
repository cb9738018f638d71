"""The rig in time: does its harmonic balance describe the motion that the equations have?

A displacement that is prescribed in harmonic 0 alone has no equation of motion. The same state has one with the force
that the balance found at the platform as a static load: its mean is then free to differ, and the balance solution of
the two problems is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.branch import CONVERGED
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.time_integration import IntegrationFailed, Options
from tribodyn.hbm.verify import verify
from tribodyn.workflows.cases.rig.model import PLATFORM, Cycle, Rig
from tribodyn.workflows.run import modelling, part_reduction, settings

HOLD = "hold"  # the load that takes the place of the height
STEPS, PERIODS, DRIFT = 1024, 200, 1e-5  # per period; periods to settle in; of the state over one period


@dataclass(frozen=True)
class InTime:
    """Time integration beside the balance: energy per cycle [J], preload [N], and how the integration ended.

    amplitude : of the balance's response over that in time, less one
    The numbers are those of the last period, periodic or not; None where there is none.
    """

    energy: float | None
    preload: float | None
    amplitude: float | None
    outcome: str

    @property
    def periodic(self) -> bool:
        """Whether a periodic motion was found."""
        return self.outcome == CONVERGED


def held_by_force(rig: Rig, cycle: Cycle) -> HarmonicBalance:
    """The rig's problem with the static force of a solved cycle at the platform instead of its height."""
    model = rig.model()
    reaction = part_reduction.reaction_of(model.reduced)
    plain = modelling.damped(rig.scene, rig.plain)
    push = np.zeros(plain.system.n_dof)
    force = reaction.force(rig.height, cycle.state.cycle.force[:, :, 0])
    push[reaction.dofs] = force + reaction.support * reaction.shape * rig.height
    system = replace(plain.system, loads={**plain.system.loads, HOLD: push})
    loads = {key: value for key, value in model.balance.excitation.loads.items() if key != (0, PLATFORM)}
    return HarmonicBalance.of(
        replace(plain, system=system),
        model.balance.contact.joints,
        model.balance.basis,
        Excitation({**loads, (0, HOLD): 1.0}),
        settings.response_range(rig.scene)[1],
    )


def in_time(rig: Rig, cycle: Cycle) -> InTime:
    """Integrate from a solved cycle to the periodic motion nearby."""
    options = Options(STEPS, tolerance=DRIFT, max_periods=PERIODS)
    try:
        found = verify(held_by_force(rig, cycle), cycle.state, options)
    except IntegrationFailed as failure:
        return InTime(None, None, None, str(failure))
    amplitude = found.amplitude[settings.OUTPUT]
    return InTime(float(found.motion.energy.sum()), found.motion.preload, amplitude, found.outcome)
