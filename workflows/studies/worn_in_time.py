"""The life of a wear run beside the life of its contact along the motion in time, at the same places."""

from __future__ import annotations

import csv
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.mean_motion import MeanOptions
from tribodyn.hbm.wear import in_time
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_share
from tribodyn.hbm.wear.in_time import PlacesOfRun, TimeRow, WearInTime
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, ORANGE
from tribodyn.workflows.result.provenance import rebuilt
from tribodyn.workflows.result.store import Held, held
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies import verification

TOLERANCE = 0.05  # of a wear step in time
SHARES = (0.9, 0.75, 0.5, 0.25, 0.1, 0.01, LIFE_SHARE)  # of the first preload, that are told
LONG_TAIL = 0.1  # share of the first preload, below which the cycles in time are shown only as far as the run's go
COLUMNS = (
    "cycles", "frequency_hz", "preload_n", "energy_j", "spread", "amplitude_m", "depth_m", "mean_off_m", "apart",
    "repeats", "settled", "periods",
)  # fmt: skip


@dataclass(frozen=True)
class LifeInTime:
    """A wear run, and its contact worn along the motion in time.

    steps : per period; tolerance : of a wear step in time; seconds : spent; folder : of table and picture
    """

    run: WearHistory
    found: WearInTime
    steps: int
    tolerance: float
    seconds: float
    folder: Path | None = None

    @property
    def unsettled(self) -> float:
        """Share of the cycles in which the means of the motion had not come to rest."""
        found = self.found
        whole = float(found.cycles_in_step.sum())
        return float(found.cycles_in_step[~found.settled].sum()) / whole if whole > 0 else 0.0

    def at_share(self, share: float) -> tuple[float | None, float | None]:
        """Cycles after which a share of the first preload is left: of the run, and in time."""
        return cycles_to_share(self.run.cycles, self.run.preload, share), self.found.life(share)

    def record(self) -> dict[str, Any]:
        """Numbers for machines."""
        found = self.found
        return {
            "shares": [dict(zip(("share", "run", "time"), (s, *self.at_share(s)), strict=True)) for s in SHARES],
            "scatter": found.scatter,
            "largest_spread": float(found.spread.max()),
            "largest_mean_off_m": float(found.off.max()),
            "unsettled": self.unsettled,
            "steps_per_period": self.steps,
            "tolerance": self.tolerance,
            "periods": int(found.periods.sum()),
            "end": str(found.end),
            "seconds": self.seconds,
            "rows": [dict(zip(COLUMNS, _columns(found, i), strict=True)) for i in range(len(found.cycles))],
        }

    def lines(self) -> list[str]:
        """The comparison for people."""
        found = self.found
        shown = [f"{'preload left':>12} {'run, cycles':>13} {'in time':>13} {'difference':>11}"]
        for share in SHARES:
            ours, theirs = self.at_share(share)
            if ours is None and theirs is None:
                continue
            numbers = [f"{'-':>13}" if v is None else f"{v:13.4g}" for v in (ours, theirs)]
            apart = f"{ours / theirs - 1:11.2%}" if ours is not None and theirs is not None else f"{'-':>11}"
            shown.append(f"{share:12.3g} {' '.join(numbers)} {apart}")
        spread = int(np.argmax(found.spread))
        shown += [
            f"end in time: {found.end}",
            f"work of a period: spread up to {found.spread[spread]:.2g} of its mean, at {found.cycles[spread]:.3g} "
            f"cycles; standard error of the life by it {found.scatter:.2g}",
            f"{self.steps} steps a period, {int(found.periods.sum())} periods, {len(found.cycles)} wear steps of "
            f"tolerance {self.tolerance:g}",
        ]
        if (off := float(found.off.max())) > 0:
            shown.append(f"mean of the prescribed displacement: at most {off:.2g} m from what is prescribed")
        if self.unsettled > 0:
            shown.append(f"for {self.unsettled:.0%} of the cycles the mean work had not come to rest")
        return shown

    @property
    def files(self) -> list[Path]:
        """Table and picture."""
        return [] if self.folder is None else [self.folder / f"wear_in_time.{ending}" for ending in ("csv", "png")]

    def plot(self) -> Figure:
        """Preload and work per cycle over the cycles, of the run and in time, and how long no pair carries a force.

        A dot is the work of one period: there are two where a motion takes two periods, and many where it never repeats
        itself.
        """
        found, run = self.found, self.run
        with axes_of(12.5, 3.8, columns=3) as (figure, (left, middle, right)):
            left.plot(1e-6 * run.cycles, run.preload, color=BLUE, label="run")
            left.plot(1e-6 * found.cycles, found.preload, color=ORANGE, label="in time")
            left.set(xlabel="cycles / 1e6", ylabel="preload / N")
            left.legend(loc="best", fontsize=9)
            middle.plot(1e-6 * run.cycles, run.energy.sum(axis=1), color=BLUE)
            middle.plot(1e-6 * found.cycles, found.energy.sum(axis=1), color=ORANGE)
            dots = np.repeat(found.cycles, found.works.shape[1])
            middle.plot(1e-6 * dots, found.works.ravel(), ".", color=ORANGE, ms=3, alpha=0.6)
            middle.set(xlabel="cycles / 1e6", ylabel="friction work per cycle / J", yscale="log")
            right.plot(1e-6 * found.cycles, found.apart, color=ORANGE)
            right.set(xlabel="cycles / 1e6", ylabel="share of the time with no contact", ylim=(0, 1))
            shown = 1.2 * max(float(run.cycles[-1]), found.life(LONG_TAIL) or 0.0)
            for axes in (left, middle, right):
                axes.set_xlim(0.0, 1e-6 * min(shown, max(float(found.cycles[-1]), float(run.cycles[-1]))))
        return figure


def _columns(found: WearInTime, i: int) -> tuple[Any, ...]:
    return (
        float(found.cycles[i]),
        float(found.omega[i]) / (2 * np.pi),
        float(found.preload[i]),
        float(found.energy[i].sum()),
        float(found.spread[i]),
        float(found.amplitude[i]),
        float(found.depth[i].max()),
        float(found.off[i]),
        float(found.apart[i]),
        int(found.repeats[i]),
        bool(found.settled[i]),
        int(found.periods[i]),
    )


def wear_in_time(
    result: Held,
    folder: AnyPath | None = None,
    *,
    steps: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> LifeInTime:
    """Wear the contact along the motion in time, at the frequencies of a run, and compare its life with the run's.

    The motion is marched on while the contact wears, with mean wear rates where it does not repeat itself.

    result : folder or file of a result with a wear run
    folder : folder of wear_in_time.csv, a row as soon as it is done, and its picture; none by default
    steps : time steps per period; 256 or 32 for each harmonic by default
    Raises  ValueError: the result has no wear run, or its motion cannot be marched; IntegrationFailed
    """
    result, report = held(result), reporter(progress)
    place = None if folder is None else Path(folder)
    if place is not None:
        place.mkdir(parents=True, exist_ok=True)
    rows = Path(os.devnull) if place is None else place / "wear_in_time.csv"
    if result.wear is None or not result.wear.depth[-1].max() > 0:
        raise ValueError("the result has no wear run in which something wears: take a scene with [wear]")
    start = time.perf_counter()
    file = rebuilt(result, override_texts(overrides))
    scene = file.scene
    assert scene.wear is not None
    with limited(scene.solver.threads):
        balance = modelling.build(file, None, report, result.harmonics).balance
        problem = wear_run.wear_problem(scene, file.folder, balance, scene.wear.lost_below)
        scale = float(result.wear.depth[-1].max())
        steps = steps or verification.steps_of(balance)
        whole = float(problem.area @ result.wear.depth[-1])
        with report.track("wear in time") as advance, rows.open("w", newline="", encoding="utf-8") as file_of_rows:
            table = csv.writer(file_of_rows)
            table.writerow(COLUMNS)

            def on_row(row: TimeRow) -> None:
                one = in_time.together([row], WearEnd.UNFINISHED.say())
                table.writerow(_columns(one, 0))
                file_of_rows.flush()
                advance(
                    float(problem.area @ row.depth) / whole if whole > 0 else 0.0,
                    f"{row.cycles:.3g} cycles, preload {row.preload:.4g} N",
                )

            found = in_time.evolve(
                problem,
                PlacesOfRun(problem, result.wear),
                Tolerance(TOLERANCE, scale),
                MeanOptions(steps),
                on_row=on_row,
            )
    life = LifeInTime(result.wear, found, steps, TOLERANCE, time.perf_counter() - start, place)
    if place is not None:
        life.plot().savefig(place / "wear_in_time.png")
    return life
