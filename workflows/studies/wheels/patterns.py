"""Patterns of blades that differ, drawn at random: the amplification of each, with contact on every blade.

Each pattern is a run of the studies' engine: rows are on disk as they come, and a killed study resumes. The wheel is
meshed and reduced once in every process."""

import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, INK, ORANGE, RED
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.run.checkpoint import alone_in
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, SceneFile, Source, read_scene
from tribodyn.workflows.studies.files import write_picture
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun, outcome_of
from tribodyn.workflows.studies.many.study_runs import Runner, finish
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels.mistuned_blades import MistunedBlades, asked_of
from tribodyn.workflows.studies.wheels.wheel_model import wheel_scene


def whitehead(n_sectors: int) -> float:
    """Largest amplification of a linear wheel, (1 + sqrt(N)) / 2; Whitehead 1966."""
    return 0.5 * (1 + float(np.sqrt(n_sectors)))


class PatternRun(StudyRun):
    """One pattern of a scene, for any process: that of its number."""

    @property
    def key(self) -> str:
        return f"{super().key} {self.number}"


_ready: tuple[StudyRun, MistunedBlades] | None = None  # of the process


def solve(task: PatternRun) -> RunRow:
    """The row of one pattern; whatever goes wrong in it becomes its row."""
    global _ready
    start = time.process_time()
    with limited(1):
        try:
            wheel = replace(task, number=0)
            if _ready is None or _ready[0] != wheel:
                file = scene_file.parse(task.text, f"{task.name}.toml", task.overrides, task.folder)
                _ready = wheel, MistunedBlades.of(file)
            blades = _ready[1]
            tuned, _ = blades.tuned, blades.ends  # of all patterns
            start = time.process_time()
            highest, blade = blades.peak(blades.pattern(task.number))
        except Exception as error:  # the other patterns go on
            status, sentence = outcome_of(error)
            return RunRow(task.number, task.key, status, " ".join(sentence.split()), {}, time.process_time() - start)
    numbers = {
        "amplification": highest.amplitude / tuned.amplitude,
        "amplitude": highest.amplitude,
        "peak_frequency": highest.state.omega / (2 * np.pi),
        "blade": float(blade),
        "amplitude_alike": tuned.amplitude,
        "solves": float(highest.solves),
    }
    return RunRow(task.number, task.key, "complete", "complete", numbers, time.process_time() - start)


@dataclass(frozen=True, repr=False)
class Patterns(StudyResult):
    """Result of all patterns of a scene.

    rows : by number, of all that were asked for; n_sectors : of the wheel; folder : of table and picture"""

    name: str
    n_sectors: int
    rows: tuple[RunRow, ...]
    folder: Path

    @cached_property
    def complete(self) -> tuple[RunRow, ...]:
        """Rows of the patterns that were solved."""
        return tuple(row for row in self.rows if row.status == "complete")

    def column(self, name: str) -> np.ndarray:
        """A number of all complete rows."""
        return np.array([row.numbers[name] for row in self.complete])

    def record(self) -> dict[str, object]:
        amplifications = self.column("amplification")
        if not len(amplifications):
            return {"patterns": len(self.rows), "complete": 0}
        p50, p95, p99 = np.percentile(amplifications, (50, 95, 99))
        worst = self.complete[int(amplifications.argmax())]
        return {
            "patterns": len(self.rows),
            "complete": len(amplifications),
            "p50": float(p50),
            "p95": float(p95),
            "p99": float(p99),
            "largest": float(amplifications.max()),
            "largest_pattern": worst.run,
            "largest_blade": int(worst.numbers["blade"]),
            "whitehead": whitehead(self.n_sectors),
            "amplitude_alike": worst.numbers["amplitude_alike"],
            "seconds": float(sum(row.seconds for row in self.rows)),
        }

    def lines(self) -> list[str]:
        summary = self.record()
        lines = [f"{summary['complete']} of {summary['patterns']} patterns of {self.n_sectors} blades solved"]
        lines += [f"pattern {row.run}: {row.status}, {row.sentence}" for row in self.rows if row.status != "complete"]
        if "p50" in summary:
            lines += [
                "largest amplitude of any blade over that of blades alike:",
                f"  half of the wheels below {summary['p50']:.4f}, 95 % below {summary['p95']:.4f}, "
                f"99 % below {summary['p99']:.4f}",
                f"  largest {summary['largest']:.4f}, pattern {summary['largest_pattern']}, "
                f"blade {summary['largest_blade']}; no linear wheel passes {summary['whitehead']:.4f} (Whitehead 1966)",
                f"{summary['seconds']:.4g} s of processor",
            ]
        return lines

    @property
    def defects(self) -> list[str]:
        return [f"pattern {row.run}: {row.sentence}" for row in self.rows if row.status == "defect"]

    @property
    def files(self) -> list[Path]:
        """Table and picture."""
        names = ("patterns.csv", "mistuning.png") if self.complete else ("patterns.csv",)
        return [self.folder / name for name in names]

    def plot(self) -> Figure:
        """How often which amplification was met, with its percentiles and what no linear wheel passes."""
        values, summary = self.column("amplification"), self.record()
        with axes_of(7.6, 4.2) as (figure, axes):
            axes.hist(values, bins="auto" if len(values) > 20 else 10, color=BLUE, alpha=0.8)
            for name, colour in (("p50", INK), ("p95", ORANGE), ("p99", RED)):
                axes.axvline(summary[name], color=colour, label=f"{name.upper()} {summary[name]:.3f}")
            bound = whitehead(self.n_sectors)
            shown = [bound] if bound < 1.5 * values.max() else []  # further out it would squeeze the distribution
            axes.vlines(
                shown, 0, 1, GREY, "--", transform=axes.get_xaxis_transform(), label=f"bound {bound:.3f}, Whitehead"
            )
            axes.set(xlabel="largest amplitude of any blade over that of blades alike", ylabel="patterns")
            axes.set_title(f"{self.name}: {len(values)} patterns of {self.n_sectors} blades")
            axes.legend()
        return figure


def tasks_of(file: SceneFile, count: int) -> list[PatternRun]:
    """The patterns 1 to `count` of a scene, whose rows do not depend on how many there are."""
    remaining = tuple(first for first in file.overrides if first.partition("=")[0].strip() != "mistuning.patterns")
    return [PatternRun(n, file.name, file.text, remaining, file.folder) for n in range(1, count + 1)]


def patterns(
    scene: Source,
    folder: AnyPath | None = None,
    *,
    workers: int | None = None,
    fresh: bool = False,
    overrides: Overrides = (),
    progress: Report = None,
) -> Patterns:
    """Draw patterns of blades that differ, and tell how far they amplify; contact acts on every blade of each.

    scene : name of a scene with [wheel] and [mistuning], or a .toml file
    folder : folder of the table and its picture, in which rows are as they come; results/NAME by default
    workers : processes; as many as there are cores by default
    fresh : draw again the patterns that the folder holds already
    Raises  SceneError"""
    file, report = read_scene(scene, overrides), reporter(progress)
    folder = Path("results") / file.name if folder is None else Path(folder)
    mistuning, wheel = asked_of(file), wheel_scene(file).wheel
    runner = Runner(folder, report, workers, fresh=fresh, retry=True)
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[int, RunRow] = {}
    with alone_in(folder):
        finish(tasks := tasks_of(file, mistuning.patterns), runner, rows, solve, "patterns", inside=True)
    result = Patterns(file.name, wheel.sectors, tuple(rows[task.number] for task in tasks), folder)
    names = ("amplification", "amplitude", "peak_frequency", "blade", "solves")
    columns = {name: [row.numbers.get(name, np.nan) for row in result.rows] for name in names}
    runs = {"pattern": [row.run for row in result.rows], "status": [row.status for row in result.rows]}
    ends = {"seconds": [row.seconds for row in result.rows], "cause": [row.sentence for row in result.rows]}
    write_columns({**runs, **columns, **ends}, folder / "patterns.csv")
    if result.complete:
        write_picture(result.plot, folder / "mistuning.png")
    return result
