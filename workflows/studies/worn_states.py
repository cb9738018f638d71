"""A wear run beside direct time integration of the same reduced model, at states spread over its cycles."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.time.time_integration import LeftAlone
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREEN, ORANGE
from tribodyn.workflows.result.provenance import rebuilt
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.store import Held, held
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import Overrides, override_texts
from tribodyn.workflows.studies import verification
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.verification import Comparison


@dataclass(frozen=True)
class WornState:
    """A row of a wear run and what time integration says.

    energy : per cycle, as the run took it [J]; found : None where there is no comparison, for the reason `why`
    left_alone : what a plain march does, where the motion is unstable or there is no comparison, if it could be marched
    """

    row: int
    cycles: float
    hertz: float
    energy: float
    found: Comparison | None
    left_alone: LeftAlone | None
    why: str = ""

    @property
    def time_energy(self) -> float:
        """Energy per cycle of the motion that was integrated [J]; nan where none is periodic."""
        periodic = self.found is not None and self.found.found.motion.periodic
        return float(self.found.found.motion.energy.sum()) if self.found is not None and periodic else float("nan")

    def record(self) -> dict[str, Any]:
        """Numbers for machines; `comparison` as that of one state, `left_alone_J` mean and spread."""
        alone = self.left_alone
        return {
            "row": self.row,
            "cycles": self.cycles,
            "frequency_hz": self.hertz,
            "energy_of_run_J": self.energy,
            "comparison": None if self.found is None else self.found.record(),
            "left_alone_J": None if alone is None else [alone.energy, alone.energy_spread],
            "no_comparison": self.why or None,
        }

    def line(self) -> str:
        """One line of the table."""
        head = f"{self.row:4d} {self.cycles:11.4g} {self.hertz:9.5g} {self.energy:11.5g}"
        seen = self.left_alone
        alone = "" if seen is None else f"   {seen.energy:.5g} +- {seen.energy_spread:.2g}"
        if self.found is None:
            return f"{head} {'none':>11} {'-':>11} {'-':>11} {'-':>9} {'-':>7}{alone}   {self.why}"
        told = self.found.record()
        energy, error = told["energy"], told["step_error"]
        periodic = self.found.found.motion.periodic
        integrated = f"{energy['time_J']:11.5g} {energy['difference']:11.2%}" if periodic else f"{'none':>11} {'-':>11}"
        own = "-" if error is None else f"{error:.2%}"
        return f"{head} {energy['balance_J']:11.5g} {integrated} {own:>9} {'yes' if told['stable'] else 'no':>7}{alone}"


HEADER = (
    f"{'row':>4} {'cycles':>11} {'Hz':>9} {'run [J]':>11} {'balance [J]':>11} {'time [J]':>11} {'difference':>11} "
    f"{'its steps':>9} {'stable':>7}   left alone [J]"
)


def spread(wear: WearHistory, count: int) -> list[int]:
    """The rows nearest to the middles of `count` equal parts of the cycles."""
    parts = (np.arange(count) + 0.5) / count * wear.cycles[-1]
    return sorted({int(np.argmin(np.abs(wear.cycles - cycles))) for cycles in parts})


@dataclass(frozen=True)
class WornStates:
    """States of a wear run beside time integration."""

    result: Result
    states: tuple[WornState, ...]

    def record(self) -> dict[str, Any]:
        """For machines."""
        return {"states": [state.record() for state in self.states]}

    def lines(self) -> list[str]:
        """For people."""
        return [HEADER, *(state.line() for state in self.states)]

    def write(self, folder: Path) -> list[Path]:
        """Write verify_states.png."""
        return write_files(folder, {}, {"verify_states": self.plot()})

    def plot(self) -> Figure:
        """Energy per cycle over the cycles: of the run, of time integration, and of the motion that was left alone."""
        assert self.result.wear is not None
        with axes_of() as (figure, ax):
            ax.plot(1e-6 * self.result.wear.cycles, self.result.wear.energy.sum(axis=1), color=BLUE, label="run")
            millions = [1e-6 * state.cycles for state in self.states]
            ax.plot(millions, [s.time_energy for s in self.states], "o", color=ORANGE, label="time integration")
            alone = [(1e-6 * s.cycles, s.left_alone) for s in self.states if s.left_alone is not None]
            if alone:
                at, seen = zip(*alone, strict=True)
                heights, spreads = [s.energy for s in seen], [s.energy_spread for s in seen]
                ax.errorbar(at, heights, spreads, fmt="s", color=GREEN, capsize=3, label="left alone, mean and spread")
            ax.set(xlabel="cycles / 1e6", ylabel="friction work per cycle / J", yscale="log")
            ax.legend(loc="best")
        return figure


def verify_states(
    result: Held, states: int, *, steps: int | None = None, overrides: Overrides = (), progress: Report = None
) -> WornStates:
    """Check so many states of a wear run, spread over its cycles, against direct time integration.

    result : folder or file of a result with a wear run
    states : number of the states
    steps : time steps per period; 256 or 32 for each harmonic by default
    Raises  ValueError: the result has no wear run, or less than one state is asked for
    """
    result, report = held(result), reporter(progress)
    if result.wear is None:
        raise ValueError("the result has no wear run: take a scene with [wear]")
    if states < 1:
        raise ValueError(f"--states must be at least 1, not {states}")
    file = rebuilt(result, override_texts(overrides))
    with limited(file.scene.solver.threads):
        unworn = modelling.build(file, report, result.harmonics).balance
    found = []
    for row in spread(result.wear, states):
        comparison, alone, why = None, None, ""
        try:
            comparison = verification.held_against(result, file.scene, unworn, None, row, steps, report)
            alone = comparison.left_alone
        except (SolveFailed, IntegrationFailed) as error:
            why = str(error)
            with suppress(IntegrationFailed):
                alone = verification.alone(result, file.scene, unworn, row, steps)
        wear = result.wear
        at = (float(wear.cycles[row]), float(wear.frequency[row]), float(wear.energy[row].sum()))
        found.append(WornState(row, *at, comparison, alone, why))
    return WornStates(result, tuple(found))
