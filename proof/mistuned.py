"""Mistuned wheels at low damping: how many patterns of blades are solved, and some of them against the dense wheel."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import mistuned_blades, wheel_model as wheels

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
WITHIN = 1e-4  # of the dense wheel
EXACT = newton.NewtonOptions(tolerance=1e-10)


@dataclass(frozen=True)
class Group:
    """Patterns of one damping and one state of the contacts.

    solved : patterns whose highest peak is found, with contacts in this state
    failed : the sentence of each that is refused, by number
    other : what the contacts of a peak do instead of what the state asks, by number
    slipping : least share of pairs that slip in a cycle at a peak, of all patterns
    compared : patterns that were solved on the dense wheel too
    dense_error : largest relative difference of blade amplitudes at their peaks, nan where none was compared
    seconds : of processor for each pattern, without the dense wheel
    """

    damping: str
    state: str
    solved: int
    failed: dict[int, str]
    other: dict[int, str]
    slipping: float
    compared: int
    dense_error: float
    seconds: float

    @property
    def count(self) -> int:
        """Patterns that were tried."""
        return self.solved + len(self.failed) + len(self.other)

    def wrong(self, dense: int) -> bool:
        """Whether a pattern is not solved or not in the state, or one of the first `dense` not as on the dense wheel.

        Never false where nothing was compared
        """
        return self.solved < self.count or self.compared < max(dense, 1) or not self.dense_error <= WITHIN

    def line(self) -> str:
        """For people."""
        text = "".join(f"\n    pattern {n}: {reason}" for n, reason in sorted({**self.failed, **self.other}.items()))
        return (
            f"{self.damping:7} {self.state:9} {self.solved:4} of {self.count:4} solved, {self.slipping:4.0%} of pairs "
            f"slip, {self.compared} dense within {self.dense_error:.1e}, {self.seconds:.2g} s each{text}"
        )


def is_in(state: str, status: np.ndarray) -> bool:
    """Whether contacts with status bits (n_pair,) over a cycle are open, slipping (at least one), or all stuck."""
    if state == "slipping":
        return bool((status & SLIPS).any())
    return bool((status == (SEPARATES if state == "open" else STICKS)).all())


def run(count: int, dense: int, report: Callable[[str], None], states: Sequence[str] = tuple(STATES)) -> list[Group]:
    """All groups, each told as it comes; `count` patterns of each, the first `dense` on the dense wheel too."""
    rows = []
    for group in groups(count, dense, states):
        report(group.line())
        rows.append(group)
    return rows


def as_records(groups: Sequence[Group]) -> list[dict[str, object]]:
    """For machines."""
    return [asdict(group) | {"dense_error": group.dense_error if group.compared else None} for group in groups]


def groups(count: int, dense: int, states: Sequence[str] = tuple(STATES)) -> Iterator[Group]:
    """Solve `count` patterns of each damping and state, and compare the first `dense` of each with the dense wheel."""
    for damping in DAMPING:
        for state in states:
            requested = (*STATES[state], f"damping.modal='{damping}'")
            blades = mistuned_blades.MistunedBlades.of(
                scene_file.parse(WHEEL + DIFFER, "wheel.toml", requested, Path())
            )
            wheel, errors, seconds = wheels.build(blades.file), [np.nan], 0.0
            failed, other, slipping = dict[int, str](), dict[int, str](), [np.nan]
            for number in range(1, count + 1):
                pattern, start = blades.pattern(number), time.process_time()
                try:
                    point, _ = blades.peak(pattern)
                except (ValueError, RuntimeError, np.linalg.LinAlgError) as error:
                    failed[number] = f"{type(error).__name__}: {error}"
                    continue
                finally:
                    seconds += time.process_time() - start
                status = point.state.cycle.status
                slipping.append(float(((status & SLIPS) != 0).mean()))
                if not is_in(state, status):
                    other[number] = f"contacts have status {sorted(set(status.tolist()))}"
                elif number <= dense:
                    errors.append(from_dense(wheel, blades, pattern, point.state.omega, point.state.x))
            yield Group(
                damping,
                state,
                count - len(failed) - len(other),
                failed,
                other,
                float(np.fmin.reduce(slipping)),
                len(errors) - 1,
                float(np.fmax.reduce(errors)),
                seconds / count,
            )


def from_dense(
    wheel: wheels.Wheel,
    blades: mistuned_blades.MistunedBlades,
    pattern: mistuned_blades.Pattern,
    omega: float,
    x: np.ndarray,
) -> float:
    """Largest relative difference of blade amplitudes at omega [rad/s], from contact displacement x, inf if unsolved.

    The dense wheel has the damping of sectors alike, which the wheel on its sector has by definition.
    """
    n = blades.wheel.n_sectors
    equal, base = wheel.whole_wheel([1.0] * n), wheel.whole_wheel([float(1 + item) for item in pattern.stiffness])
    system = replace(base.model.system, damping=equal.model.system.damping)
    model, load = replace(base.model, system=system), base.excitation
    dense = HarmonicBalance.of(model, base.contact.joints, base.basis, load, blades.wheel.wave.omega_max)
    heights = []
    for balance in (blades.balance(pattern), dense):
        solution = newton.solve(balance, omega, x, EXACT)
        if not solution.converged:
            return float("inf")
        rows = [balance.compliance.output_names.index(f"response@{k}") for k in range(n)]
        heights.append(amplitude(balance.outputs(solution.state)[rows]))
    return float(np.abs(heights[0] - heights[1]).max() / heights[1].max())
