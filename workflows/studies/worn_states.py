"""A wear run beside direct time integration of the same reduced model, at states spread over its cycles."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.time.time_integration import FreeMotion
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.theme import BLUE, GREEN, ORANGE
from tribodyn.workflows.result.provenance import rebuilt
from tribodyn.workflows.result.store import ResultSource, result_of
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.fields import Frequency
from tribodyn.workflows.scene.source import Overrides, override_texts
from tribodyn.workflows.studies import verification
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.verification import TimeComparison

HEADER = (
    f"{'row':>4} {'cycles':>11} {'Hz':>9} {'run [J]':>11} {'balance [J]':>11} {'time [J]':>11} {'difference':>11} "
    f"{'its steps':>9} {'stable':>7}   left alone [J]"
)


def spread(wear: WearHistory, count: int) -> list[int]:
    """The rows nearest to the middles of `count` equal parts of the cycles."""
    parts = (np.arange(count) + 0.5) / count * wear.cycles[-1]
    return sorted({int(np.argmin(np.abs(wear.cycles - cycles))) for cycles in parts})


@dataclass(frozen=True, repr=False)
class WornStates(StudyResult):
    """States of a wear run beside time integration, by row of the run.

    comparisons : by row, or why there is none; marches : what a plain march does, where the motion is unstable or there
        is no comparison, if it could be marched
    """

    wear: WearHistory
    comparisons: Mapping[int, TimeComparison | str]
    marches: Mapping[int, FreeMotion]

    def record(self) -> dict[str, Any]:
        """For machines; `comparison` as that of one state, `left_alone_J` mean and spread."""
        rows = []
        for row, comparison in self.comparisons.items():
            motion, compared = self.marches.get(row), isinstance(comparison, TimeComparison)
            rows.append(
                {
                    "row": row, "cycles": float(self.wear.cycles[row]), "frequency_hz": float(self.wear.frequency[row]),
                    "energy_of_run_J": float(self.wear.energy[row].sum()),
                    "comparison": comparison.record() if isinstance(comparison, TimeComparison) else None,
                    "left_alone_J": None if motion is None else [motion.energy, motion.energy_spread],
                    "no_comparison": None if compared else comparison,
                }
            )  # fmt: skip
        return {"states": rows}

    def lines(self) -> list[str]:
        """For people."""
        return [HEADER, *map(self._line, self.record()["states"])]

    def _line(self, row: dict[str, Any]) -> str:
        head = f"{row['row']:4d} {row['cycles']:11.4g} {row['frequency_hz']:9.5g} {row['energy_of_run_J']:11.5g}"
        motion_alone = "" if row["left_alone_J"] is None else "   {:.5g} +- {:.2g}".format(*row["left_alone_J"])
        comparison = row["comparison"]
        if comparison is None:
            return f"{head} {'none':>11} {'-':>11} {'-':>11} {'-':>9} {'-':>7}{motion_alone}   {row['no_comparison']}"
        energy, error = comparison["energy"], comparison["step_error"]
        step_error = "-" if error is None else f"{error:.2%}"
        integrated = f"{energy['time_J']:11.5g} {energy['difference']:11.2%}"
        if not self._periodic(row["row"]):
            integrated = f"{'none':>11} {'-':>11}"
        stable = "yes" if comparison["stable"] else "no"
        return f"{head} {energy['balance_J']:11.5g} {integrated} {step_error:>9} {stable:>7}{motion_alone}"

    def _periodic(self, row: int) -> bool:
        comparison = self.comparisons[row]
        return isinstance(comparison, TimeComparison) and comparison.integration.motion.periodic

    def write(self, folder: Path) -> list[Path]:
        """Write verify_states.png."""
        return write_files(folder, {}, {"verify_states": self.plot()})

    def plot(self) -> Figure:
        """Energy per cycle over the cycles: of the run, of time integration, and of the motion that was left alone."""
        millions = 1e-6 * self.wear.cycles
        with axes_of() as (figure, ax):
            ax.plot(millions, self.wear.energy.sum(axis=1), color=BLUE, label="run")
            periodic = {s["row"]: s["comparison"] for s in self.record()["states"] if self._periodic(s["row"])}
            energy = [comparison["energy"]["time_J"] for comparison in periodic.values()]
            ax.plot(millions[list(periodic)], energy, "o", color=ORANGE, label="time integration")
            if self.marches:
                heights, spreads = zip(*((s.energy, s.energy_spread) for s in self.marches.values()), strict=True)
                look = {"fmt": "s", "color": GREEN, "capsize": 3, "label": "left alone, mean and spread"}
                ax.errorbar(millions[list(self.marches)], heights, spreads, **look)
            ax.set(xlabel="cycles / 1e6", ylabel="friction work per cycle / J", yscale="log")
            ax.legend(loc="best")
        return figure


def verify(
    result: ResultSource,
    at: Frequency | None = None,
    *,
    row: int | None = None,
    states: int | None = None,
    steps: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> TimeComparison | WornStates:
    """Check a result against direct time integration of the same model with the same contact law.

    result : folder or file of a result
    at : frequency such as 410Hz; the peak of the response, or the frequency of the row, by default
    row : wear row whose depth the contact has; unworn by default
    states : so many worn states of a wear run, spread over its cycles, one line each
    steps : time steps per period; 256 or 32 for each harmonic by default
    Raises  Refusal: the result has no such row, no wear run or no solution to start from; SolveFailed: no balance
        solution
    """
    result, report = result_of(result), reporter(progress)
    if states is not None and (at is not None or row is not None):
        raise Refusal("expected one of --states, and --at with --row")
    if states is not None and result.wear is None:
        raise Refusal("the result has no wear run: take a scene with [wear]")
    if states is not None and states < 1:
        raise Refusal(f"--states must be at least 1, not {states}")
    file = rebuilt(result, override_texts(overrides))
    with limited(file.scene.solver.threads):
        unworn = modelling.build(file, report, result.harmonics).balance
    if states is None or result.wear is None:
        omega = None if at is None else 2 * np.pi * at
        return verification.held_against(result, file.scene, unworn, omega, row, steps, report)
    comparisons: dict[int, TimeComparison | str] = {}
    motions: dict[int, FreeMotion] = {}
    for row in spread(result.wear, states):
        try:
            comparison = verification.held_against(result, file.scene, unworn, None, row, steps, report)
            comparisons[row], motion = comparison, comparison.left_alone
        except (SolveFailed, IntegrationFailed) as error:
            comparisons[row], motion = str(error), None
            with suppress(IntegrationFailed):
                motion = verification.march_alone(result, file.scene, unworn, row, steps)
        if motion is not None:
            motions[row] = motion
    return WornStates(result.wear, comparisons, motions)
