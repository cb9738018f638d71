"""Mistuned wheels at low damping: how many patterns of blades are solved, and some of them against the dense wheel."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import patterns
from tribodyn.workflows.studies.wheels import wheel as wheels

DAMPING = ("0.05 %", "0.1 %", "0.5 %")
DIFFER = '\n[mistuning]\nfrequency = "1 %"\nfamilies = 3\nleft_out = 1e-6\n'
STATES = {
    "open": ("contact.gap='1 mm'", "response.frequency=['190 Hz', '240 Hz']", "loads.harmonic.wave.value='0.1 N'"),
    "slipping": (
        "contact.friction=0.3",
        "response.frequency=['560 Hz', '720 Hz']",
        "loads.harmonic.wave.value='20 N'",
    ),
    "stuck": ("contact.friction=5.0", "response.frequency=['560 Hz', '720 Hz']", "loads.harmonic.wave.value='0.1 N'"),
}
EXACT = newton.NewtonOptions(tolerance=1e-10)


@dataclass(frozen=True)
class Group:
    """Patterns of one damping and one state of the contacts.

    solved : patterns whose highest peak is found; failed : the sentence of each other one, by number
    dense_error : largest relative difference of blade amplitudes at a peak from the dense wheel, nan if none was asked
    """

    damping: str
    state: str
    solved: int
    failed: dict[int, str]
    dense_error: float

    def line(self) -> str:
        """For people."""
        said = "".join(f"\n    pattern {number}: {sentence}" for number, sentence in self.failed.items())
        of = self.solved + len(self.failed)
        return f"{self.damping:7} {self.state:9} {self.solved} of {of} solved, dense {self.dense_error:.1e}{said}"


def groups(count: int, dense: int, states: tuple[str, ...] = tuple(STATES)) -> Iterator[Group]:
    """Solve `count` patterns of each damping and state, and compare the first `dense` of each with the dense wheel."""
    for damping in DAMPING:
        for state in states:
            asked = (*STATES[state], f"damping.modal='{damping}'")
            blades = patterns.Blades.of(scene_file.parse(WHEEL + DIFFER, "wheel.toml", asked, Path()))
            wheel, failed, errors = wheels.build(blades.file), dict[int, str](), [np.nan]
            for number in range(1, count + 1):
                pattern = blades.pattern(number)
                try:
                    point, _ = blades.peak(pattern)
                except (ValueError, RuntimeError, np.linalg.LinAlgError) as error:
                    failed[number] = f"{type(error).__name__}: {error}"
                    continue
                if number <= dense:
                    errors.append(from_dense(wheel, blades, pattern, point.state.omega, point.state.x))
            yield Group(damping, state, count - len(failed), failed, float(np.fmax.reduce(errors)))


def from_dense(
    wheel: wheels.Wheel, blades: patterns.Blades, pattern: patterns.Pattern, omega: float, x: np.ndarray
) -> float:
    """Largest relative difference of blade amplitudes at omega [rad/s], from contact displacement x, inf if unsolved.

    The dense wheel has the damping of sectors alike, which the wheel on its sector has by definition.
    """
    n = blades.wheel.n_sectors
    alike, own = wheel.whole([1.0] * n), wheel.whole([float(1 + one) for one in pattern.stiffness])
    system = replace(own.model.system, damping=alike.model.system.damping)
    model, load = replace(own.model, system=system), own.excitation
    dense = HarmonicBalance.of(model, own.contact.joints, own.basis, load, blades.wheel.wave.omega_max)
    heights = []
    for balance in (blades.balance(pattern), dense):
        solution = newton.solve(balance, omega, x, EXACT)
        if not solution.converged:
            return float("inf")
        rows = [balance.compliance.output_names.index(f"response@{k}") for k in range(n)]
        heights.append(amplitude(balance.outputs(solution.state)[rows]))
    return float(np.abs(heights[0] - heights[1]).max() / heights[1].max())


if __name__ == "__main__":
    for group in groups(int(sys.argv[1]), int(sys.argv[2])):
        print(group.line(), flush=True)
