"""The study of the shrouded bladed disk: ./tribodyn prove blade study.

Figures 4.11 to 4.17 and table 4.4 of the thesis with ours: nodal diameters, engine orders, rising excitation, wear
until the shrouds are lost for several wear steps; and a Campbell diagram where a highest speed is given."""

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from proof.cases.blade import figures as blade_figures
from proof.problems import delta_max, linear_references, result_of, wear as wear_down, worn
from proof.wear_steps import published_wear_steps
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.workflows.pictures.wheel_diagrams import campbell as plot_campbell
from tribodyn.workflows.result.result import References
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneError, read_scene
from tribodyn.workflows.studies.wheels.wheel_model import Wheel, build as build_wheel, campbell, follow

FULL_DIAMETERS = (0, 1, 2, 5, 10, 20)  # that are held against the full sector
FAMILIES = 4
PUBLISHED = published_wear_steps(read_scene("blade"))  # table 4.4


@dataclass(frozen=True)
class Extent:
    """How much of the study is done.

    orders : engine orders; loads : factors on the scene's excitation; tolerance : of the curves between their points
    steps : largest depths of a wear step over delta_max, the finest last; shown : the one whose course is drawn
    frames : worn states that maps and curves are drawn of; speeds : of the Campbell diagram up to the highest"""

    orders: tuple[int, ...] = (1, 2, 3, 5, 8, 12, 20)
    loads: tuple[float, ...] = (0.02, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0)
    tolerance: float = 1e-3
    steps: tuple[float, ...] = (0.1, 0.05, 0.02, 0.01, 0.005, 0.0025)
    shown: float = 0.05
    frames: int = 6
    speeds: int = 7


@dataclass(frozen=True)
class Curve:
    """A response with its linear references."""

    branch: Branch
    references: References

    def amplitude(self) -> np.ndarray:
        """(n_point,) of the response [m]."""
        return self.branch.amplitude(OUTPUT)

    def peak(self) -> tuple[float, float]:
        """Frequency [Hz] and amplitude [m] of the highest maximum, or of the highest end where there is none."""
        height = self.amplitude()
        inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:])) + 1
        best = inner[height[inner].argmax()] if len(inner) else height.argmax()
        return float(self.branch.frequency[best]), float(height[best])


@dataclass(frozen=True)
class Worn:
    """A wear run. seconds, processor : of the clock and of one processor."""

    step: float
    history: WearHistory
    seconds: float
    processor: float


@dataclass(frozen=True)
class TradeRow:
    """A row of table 4.4 with life added; errors are against the finest published step, life's against the finest."""

    step: float
    seconds: float
    processor_seconds: float
    wear_steps: int
    hbm_solves: int
    depth_mm: float
    depth_error: float
    cycles: float
    life: float
    life_error: float
    end: str


def diagram(blade: Wheel) -> dict[str, np.ndarray]:
    """Frequencies (n_diameter, family) [Hz] of all nodal diameters, shrouds "free" and "stuck" (figure 4.11)."""
    diameters = range(blade.n_sectors // 2 + 1)
    return {state: blade.diagram(diameters, FAMILIES, state == "stuck") for state in ("free", "stuck")}


def reduction_error(blade: Wheel) -> dict[str, np.ndarray]:
    """Relative error (n_diameter, family) of the reduced sector at FULL_DIAMETERS, against the full one."""
    diameters = [d for d in FULL_DIAMETERS if d <= blade.n_sectors // 2]
    return {
        state: blade.diagram(diameters, FAMILIES, state == "stuck")
        / blade.diagram(diameters, FAMILIES, state == "stuck", full=True)
        - 1
        for state in ("free", "stuck")
    }


def respond(balance: HarmonicBalance, frequency: tuple[float, float], tolerance: float) -> Curve:
    """The response over a range [Hz]."""
    return Curve(follow(balance, frequency, tolerance), linear_references(balance, *frequency))


def span(blade: Wheel, order: int) -> tuple[float, float]:
    """A range [Hz] from below the free to above the stuck first frequency of an engine order's wave."""
    free, stuck = (float(blade.diagram([order], 1, state)[0, 0]) for state in (False, True))
    return 0.9 * free, 1.1 * stuck


def orders(blade: Wheel, extent: Extent) -> dict[int, Curve]:
    """Responses to several engine orders (figure 4.12)."""
    return {
        order: respond(blade.wave(order, span(blade, order)), span(blade, order), extent.tolerance)
        for order in extent.orders
    }


def forces(blade: Wheel, extent: Extent) -> dict[float, Curve]:
    """Responses to rising excitation at fixed preload (figure 4.13)."""
    frequency = blade.scene.response.frequency
    balance = blade.wave(frequency=frequency)
    return {load: respond(balance.with_load(load), frequency, extent.tolerance) for load in extent.loads}


def wear(blade: Wheel, balance: HarmonicBalance, step: float) -> Worn:
    """One run by the thesis's rule until every pair is separated, its step a share of delta_max."""
    clock, processor = time.perf_counter(), time.process_time()
    rule = ("wear.rule=thesis", f"wear.step={step!r}", "wear.lost_below=0", "wear.max_steps=10000")
    history = wear_down(read_scene(blade.file, rule), balance)
    return Worn(step, history, time.perf_counter() - clock, time.process_time() - processor)


def trade(runs: Sequence[Worn]) -> list[TradeRow]:
    """Table 4.4: the reference of the depth is the finest published step, that of the life the finest of all."""
    depths = {run.step: 1e3 * float(run.history.depth[-1].max()) for run in runs}
    lives = {run.step: cycles_to_preload(run.history) or float("nan") for run in runs}
    rows = [step for step in depths if step in PUBLISHED]
    reference = depths[min(rows or depths)]
    return [
        TradeRow(
            step=run.step,
            seconds=round(run.seconds, 1),
            processor_seconds=round(run.processor, 1),
            wear_steps=int(np.count_nonzero(run.history.cycles_in_step)),
            hbm_solves=int(run.history.solves.sum()),
            depth_mm=round(depths[run.step], 4),
            depth_error=depths[run.step] / reference - 1,
            cycles=float(run.history.cycles[-1]),
            life=lives[run.step],
            life_error=lives[run.step] / lives[min(lives)] - 1,
            end=str(run.history.end),
        )
        for run in runs
    ]


def as_text(rows: Sequence[TradeRow]) -> str:
    """Table 4.4 for people and for Markdown, the published one in brackets."""
    lines = [
        "| largest depth of a step | wear steps (thesis) | seconds, of them processor (thesis, 4 cores) | largest "
        "depth, mm (thesis) | error in depth (thesis) | life, million cycles | error in life |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        count, clock, depth, error = PUBLISHED.get(row.step, (None,) * 4)
        lines.append(
            f"| {100 * row.step:g} % | {row.wear_steps}{_bracket(count, 'd')} | {row.seconds:.0f}, "
            f"{row.processor_seconds:.0f}{_bracket(clock, 'd')} | {row.depth_mm:.4f}{_bracket(depth, '.4f')} | "
            f"{100 * row.depth_error:.2f} %{_bracket(None if error is None else 100 * error, '.2f', ' %')} | "
            f"{1e-6 * row.life:.1f} | {100 * row.life_error:.1f} % |"
        )
    return "\n".join(lines)


def _bracket(value: float | None, form: str, unit: str = "") -> str:
    return "" if value is None else f" ({value:{form}}{unit})"


def worn_curves(balance: HarmonicBalance, blade: Wheel, run: Worn, extent: Extent) -> list[tuple[int, Curve]]:
    """Responses of worn states of a run, by wear step (figure 4.15)."""
    frequency = blade.scene.response.frequency
    return [
        (int(row), respond(worn(balance, run.history.depth[row]), frequency, extent.tolerance))
        for row in frames(run.history, extent.frames)
    ]


def frames(history: WearHistory, count: int) -> np.ndarray:
    """Rows of a run that are drawn: the first, the last worn, and others at equal depth between them."""
    last = int(np.count_nonzero(history.cycles_in_step)) - 1
    depth = history.depth[: last + 1].mean(axis=1)
    expected = np.linspace(depth[0], depth[-1], count)
    return np.unique([int(np.abs(depth - value).argmin()) for value in expected])


def run(
    scene: str,
    overrides: Sequence[str],
    folder: Path,
    highest: float | None,
    say: Callable[[str], None],
    extent: Extent,
) -> list[Path]:
    """Run the whole study into a folder; highest : speed of the Campbell diagram [Hz], None for no diagram."""
    file = read_scene(scene, overrides)
    if file.scene.wear is None:
        raise SceneError(f"{file.name} has no [wear]: nothing of its shrouds is lost")
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {}
    with threadpool_limits(1):
        blade = build_wheel(file)
        families = diagram(blade)
        _write_table(folder / "diagram.csv", ("nodal_diameter", *_names(families)), _columns(families))
        drawn["diagram"] = blade_figures.diagram_figure(families)
        for state, errors in reduction_error(blade).items():
            say(f"reduced against full sector, {state}: frequencies at most {100 * np.abs(errors).max():.2g} % off")
        if highest is not None:
            chosen = [o for o in extent.orders if o <= blade.n_sectors // 2]
            speeds, outcome, critical = campbell(blade, highest, extent.speeds, chosen)
            for order in chosen:
                at = [crossing.speed for crossing in critical["stuck"] if crossing.engine_order == order]
                say(f"engine order {order}: critical at {', '.join(f'{60 * s:.0f}' for s in at) or 'no'} rpm, stuck")
            drawn["campbell"] = plot_campbell(speeds, outcome, chosen, critical)
        by_order = orders(blade, extent)
        drawn["orders"] = blade_figures.orders_figure(by_order)
        by_load = forces(blade, extent)
        force = next(iter(blade.scene.loads.harmonic.values())).amplitude
        drawn["forces"] = blade_figures.forces_figure({force * load: curve for load, curve in by_load.items()})
        rows = [("engine_order", float(order), *curve.peak()) for order, curve in by_order.items()]
        rows += [("force_N", force * load, *curve.peak()) for load, curve in by_load.items()]
        _write_table(folder / "peaks.csv", ("what", "value", "peak_Hz", "peak_m"), rows)
        for kind, value, hertz, height in rows:
            say(f"{kind} {value:g}: peak {hertz:.1f} Hz, {1e3 * height:.3f} mm")
        runs, balance = wear_runs(blade, extent, say)
        shown = next((run for run in runs if run.step == extent.shown), runs[0])
        result = result_of(file, blade.part, balance, shown.history)
        drawn["maps"] = blade_figures.maps_figure(result, frames(shown.history, extent.frames))
        drawn["backbone"] = blade_figures.backbone_figure(worn_curves(balance, blade, shown, extent), shown)
        drawn["cycles"] = blade_figures.cycles_figure(shown, PUBLISHED.get(shown.step, (None,))[0])
        drawn["peaks"] = blade_figures.peaks_figure(runs)
    table = trade(runs)
    _write_table(folder / "trade.csv", tuple(asdict(table[0])), [tuple(asdict(row).values()) for row in table])
    (folder / "trade.md").write_text(as_text(table) + "\n", encoding="utf-8")
    paths = []
    for name, figure in drawn.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1])
    return [*paths, folder / "diagram.csv", folder / "peaks.csv", folder / "trade.csv", folder / "trade.md"]


def wear_runs(blade: Wheel, extent: Extent, say: Callable[[str], None]) -> tuple[list[Worn], HarmonicBalance]:
    """Wear to loss of contact with every step of the extent."""
    balance = blade.wave()
    say(f"delta_max {1e3 * delta_max(blade.file, balance):.4f} mm")
    runs = []
    for step in extent.steps:
        runs.append(wear(blade, balance, step))
        history = runs[-1].history
        say(
            f"wear step {100 * step:g} %: {len(history.cycles) - 1} steps, {runs[-1].seconds:.0f} s, "
            f"{1e3 * history.depth[-1].max():.4f} mm, {history.end}"
        )
    return runs, balance


def _names(families: dict[str, np.ndarray]) -> list[str]:
    return [f"{state}_{i + 1}_Hz" for state, values in families.items() for i in range(values.shape[1])]


def _columns(families: dict[str, np.ndarray]) -> list[tuple[object, ...]]:
    together = np.concatenate(list(families.values()), axis=1)
    return [(diameter, *(round(float(hertz), 3) for hertz in row)) for diameter, row in enumerate(together)]


def _write_table(path: Path, names: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(names)
        table.writerows(rows)
