"""Patterns of blades that differ, drawn at random: the amplification of each, with contact on every blade.

Each pattern is a run of the studies' engine: rows are on disk as they come, and a killed study resumes. The wheel is
meshed and reduced once in every process.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tribodyn.fem.constraints import find_group
from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import highest_peak
from tribodyn.hbm.continuation.branch import Branch, amplitude
from tribodyn.hbm.continuation.methods import adaptive, arc_length
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.hbm.mistuned_wheel import MistunedWheel
from tribodyn.hbm.threads import limited
from tribodyn.reduction import nominal_modes as reduction
from tribodyn.reduction.sector_reduction import ReducedSector
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.theme import BLUE, GREY, INK, ORANGE, RED
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.checkpoint import alone_in
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import unknown_key
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.source import AnyPath, Overrides, Source, read_scene
from tribodyn.workflows.scene.wheel_tables import Mistuning
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun, outcome_of
from tribodyn.workflows.studies.many.study_runs import Runner, finish
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels import wheel_model as wheels

FURTHEST = 3.0  # standard deviations at which what is drawn is cut off
SHORTEST, LONGEST = 1e-4, 0.15  # steps of a scan, of its range: beyond a jump it continues


@dataclass(frozen=True)
class Pattern:
    """How the blades of one wheel differ, each (N,): relative stiffness and friction, and gap added [m]."""

    number: int
    stiffness: np.ndarray
    friction: np.ndarray
    gap: np.ndarray


def drawn(mistuning: Mistuning, n_sectors: int, number: int) -> Pattern:
    """One of the patterns of a scene; it depends on the seed and its number alone."""
    normal = np.random.default_rng([mistuning.seed, number]).normal(size=(3, n_sectors))
    frequency, friction, gap = np.clip(normal, -FURTHEST, FURTHEST)
    stiffness = (1 + mistuning.frequency * frequency) ** 2 - 1
    return Pattern(number, stiffness, mistuning.friction * friction, mistuning.gap * gap)


def whitehead(n_sectors: int) -> float:
    """Largest amplification of a linear wheel, (1 + sqrt(N)) / 2; Whitehead 1966."""
    return 0.5 * (1 + float(np.sqrt(n_sectors)))


@dataclass(frozen=True)
class MistunedBlades:
    """The wheel of a scene, ready for any pattern.

    part : the sector; reduced : its reduction, with the shapes in which sectors may deviate among its outputs
    wheel : sectors alike, ready to deviate in these
    """

    file: SceneFile
    part: Part
    reduced: ReducedSector
    wheel: MistunedWheel

    @classmethod
    def of(cls, file: SceneFile) -> MistunedBlades:
        """Mesh and reduce; raises SceneError for a scene without [wheel] or [mistuning]."""
        mistuning = asked_of(file)
        wheel = wheels.build(file)
        K = deviating(wheel, mistuning.body)
        loads = sorted({name for _, name in wheel.wave().excitation.loads})
        shapes = reduction.nominal_shapes(
            wheel.reduced, wheel.springs, K, mistuning.families, loads, mistuning.left_out
        )
        reduced = reduction.with_ports(wheel.reduced, K, shapes)
        wave = replace(wheel, reduced=reduced).wave()
        if mistuning.friction and not wave.contact.has_friction:
            raise SceneError("mistuning.friction: no contact of this scene has friction: leave it out")
        ports = tuple(reduction.port_name(k) for k in range(shapes.shape[1]))
        return cls(file, wheel.part, reduced, MistunedWheel(wave, ports))

    def pattern(self, number: int) -> Pattern:
        """The pattern of this number, from 1; it depends on the seed of the scene and its number alone."""
        if number < 1:
            raise Refusal(f"--pattern {number}: patterns are counted from 1")
        return drawn(asked_of(self.file), self.wheel.n_sectors, number)

    @cached_property
    def tuned(self) -> OperatingPoint:
        """The peak of the wheel of sectors alike; raises SolveFailed."""
        point = settings.peak_of(self.file.scene).solve(self.wheel.wave)
        if not point.solution.converged:
            raise SolveFailed(f"the peak of sectors alike: {point.solution.outcome}")
        return point

    @cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, n_component, n_coeff) of sectors alike at both ends of the range, where patterns begin."""
        tuned_wave, order = self.wheel.wave, self.wheel.model.engine_order
        starts, n = [], self.wheel.n_sectors
        for omega in settings.response_range(self.file.scene):
            x = arc_length.solve_along_load(tuned_wave, omega, settings.newton_options(self.file.scene)).state.x
            starts.append(np.concatenate([at_sector(tuned_wave.basis, x, order, n, k) for k in range(n)]))
        return starts[0], starts[1]

    def balance(self, pattern: Pattern) -> HarmonicBalance:
        """The whole wheel of a pattern."""

        def change(joint: Joint, sector: np.ndarray) -> Joint:
            opened = replace(joint.parameters, gap=joint.parameters.gap + pattern.gap[sector])
            changed = replace(joint, parameters=opened)
            return changed.with_friction_scaled(1 + pattern.friction[sector]) if pattern.friction.any() else changed

        return self.wheel.balance(pattern.stiffness, change)

    def peak(self, pattern: Pattern) -> tuple[OperatingPoint, int]:
        """The highest peak of any blade, and which blade; solves of the whole search are counted.

        Raises  SolveFailed where the response is not followed to its end, rises there, or its peak is not found
        """
        scene = self.file.scene
        balance, names = self.balance(pattern), [f"{OUTPUT}@{n}" for n in range(self.wheel.n_sectors)]
        low, high = settings.response_range(scene)
        scan = adaptive.Options(
            tolerance=asked_of(self.file).tolerance,
            step=0.02,
            max_step=LONGEST,
            min_step=SHORTEST,
            newton=settings.newton_options(scene),
            guess=self.ends[0],
        )

        def tall(branch: Branch) -> np.ndarray:
            return amplitude(branch.response[:, [branch.output_names.index(name) for name in names]])

        def is_past_peak(branch: Branch) -> bool:
            return tall(branch).argmax() // len(names) not in (0, len(branch.omega) - 1)

        # friction softens: from above the response is followed over its peak, and jumps behind it if at all
        branch = adaptive.follow(balance, high, low, replace(scan, guess=self.ends[1], jumps=False))
        if not branch.arrived and is_past_peak(branch):
            lower = adaptive.follow(balance, low, branch.omega[-1], replace(scan, jumps=False))
            is_complete = lower.arrived and tall(lower).max() < tall(branch).max()
        else:
            is_complete = branch.arrived and is_past_peak(branch)
        if not is_complete:
            branch = adaptive.follow(balance, low, high, scan)
            if not branch.arrived:
                raise SolveFailed(f"the frequency response {branch.end}")
            if not is_past_peak(branch):
                raise SolveFailed("the response still rises at an end of response.frequency: extend it")
        heights = tall(branch)
        best, blade = highest_peak.highest(balance, branch, names, settings.peak_of(scene))
        if best is None or best.amplitude < (1 - asked_of(self.file).tolerance) * heights.max():
            raise SolveFailed(f"the highest peak, near {_hertz(branch.omega[heights.argmax() // len(names)])}, is lost")
        return best, blade


def asked_of(file: SceneFile) -> Mistuning:
    """The table [mistuning]; raises SceneError for a scene without it."""
    if file.mesh_scene.mistuning is None:
        raise SceneError(f"{file.name} has no [mistuning]: say how far its blades differ, such as frequency = '1 %'")
    return file.mesh_scene.mistuning


def deviating(wheel: wheels.Wheel, body: str | None) -> np.ndarray:
    """The stiffness (n, n) of the reduced sector that deviates: all of it, or that of one body."""
    reduced: ReducedSector = wheel.reduced
    if body is None:
        return np.asarray(reduced.sector.system.stiffness)
    bodies = [body_of_mesh.name for body_of_mesh in getattr(wheel.part.mesh, "bodies", ()) if body_of_mesh.name]
    if body not in bodies:
        raise SceneError(unknown_key(f"mistuning.body: {body}", bodies))
    if wheel.part.dependence is not None:
        raise SceneError("mistuning.body: bodies that are glued or tied have no stiffness of their own: leave it out")
    nodes = np.zeros(len(wheel.part.points), bool)
    nodes[find_group(wheel.part.node_sets, body)] = True
    free_dofs = np.flatnonzero(np.repeat(nodes, 3)[wheel.part.free])
    basis = reduced.origin.basis[free_dofs]
    return np.asarray(basis.T @ (wheel.full.system.stiffness[free_dofs][:, free_dofs] @ basis))


def _hertz(omega: float) -> str:
    return f"{omega / (2 * np.pi):.5g} Hz"


class PatternRun(StudyRun):
    """One pattern of a scene, for any process: that of its number."""

    @property
    def key(self) -> str:
        """Hash of all that the row depends on."""
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
        "peak_m": highest.amplitude,
        "peak_hz": highest.state.omega / (2 * np.pi),
        "blade": float(blade),
        "peak_alike_m": tuned.amplitude,
        "solves": float(highest.solves),
    }
    return RunRow(task.number, task.key, "complete", "complete", numbers, time.process_time() - start)


@dataclass(frozen=True, repr=False)
class Patterns(StudyResult):
    """What the patterns of a scene came to.

    rows : by number, of all that were asked for; n_sectors : of the wheel; folder : of table and picture
    """

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
        """For machines."""
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
            "peak_alike_m": worst.numbers["peak_alike_m"],
            "seconds": float(sum(row.seconds for row in self.rows)),
        }

    def lines(self) -> list[str]:
        """For people."""
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
        """Patterns that a defect of the program stopped."""
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
    resume: bool = False,
    overrides: Overrides = (),
    progress: Report = None,
) -> Patterns:
    """Draw patterns of blades that differ, and tell how far they amplify; contact acts on every blade of each.

    scene : name of a scene with [wheel] and [mistuning], or a .toml file
    folder : folder of the table and its picture, in which rows are as they come; results/NAME by default
    workers : processes; as many as there are cores by default
    resume : take the rows that the folder holds of the same patterns
    Raises  SceneError
    """
    file, report = read_scene(scene, overrides), reporter(progress)
    folder = Path("results") / file.name if folder is None else Path(folder)
    mistuning, wheel = asked_of(file), file.mesh_scene.wheel
    if wheel is None:
        raise SceneError(f"{file.name} has no [wheel]: this study is for a sector of one")
    runner = Runner(folder, report, workers, resume=resume, retry=resume)
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[int, RunRow] = {}
    with alone_in(folder):
        finish(tasks := tasks_of(file, mistuning.patterns), runner, rows, solve, "patterns", inside=True)
    rows_by_number = Patterns(file.name, wheel.sectors, tuple(rows[task.number] for task in tasks), folder)
    names = ("amplification", "peak_m", "peak_hz", "blade", "solves")
    columns = {name: [row.numbers.get(name, np.nan) for row in rows_by_number.rows] for name in names}
    n_patterns = {
        "pattern": [row.run for row in rows_by_number.rows],
        "status": [row.status for row in rows_by_number.rows],
        **columns,
    }
    write_columns({**n_patterns, "seconds": [row.seconds for row in rows_by_number.rows]}, folder / "patterns.csv")
    if rows_by_number.complete:
        rows_by_number.plot().savefig(folder / "mistuning.png")
    return rows_by_number
