"""The wear of one wheel of blades that differ: every blade's contacts wear by their own work, and feed back."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_condition import AtPeakRatio, OperatingCondition
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.threads import limited
from tribodyn.hbm.wear.history import WearHistory, WearRow
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import WearProblem
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import film
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.render_wheel import MistunedWheelFilm, WheelState
from tribodyn.workflows.pictures.theme import WEAR_MAP
from tribodyn.workflows.result.model_facts import Around
from tribodyn.workflows.run import references, settings, wear_run
from tribodyn.workflows.run.description import part_mesh
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.scene.source import Overrides, Source, read_scene
from tribodyn.workflows.studies.files import where_it_can_be, write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels.mistuned_blades import MistunedBlades, asked_of
from tribodyn.workflows.studies.wheels.wheel_model import wheel_scene

IMAGES = 32  # of a film


@dataclass(frozen=True, repr=False)
class MistunedWear(StudyResult):
    """A worn wheel.

    blades : the wheel; number : of its pattern; history : of all pairs, sector by sector; blade : whose peak is tracked
    volume : (n_row, N) worn by then at the contacts of every sector [m3]; heights : (n_row, N) amplitudes [m]
    preload : (n_row, N) mean normal force of the contacts of every sector [N]; formats : of films"""

    blades: MistunedBlades
    number: int
    blade: int
    history: WearHistory
    volume: np.ndarray
    heights: np.ndarray
    preload: np.ndarray
    formats: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """For people."""
        h, last = self.history, -1
        texts = [f"pattern {self.number}: {len(h.cycles)} wear steps, {h.cycles[last]:.4g} cycles, {h.end}"]
        for row, state in ((0, "unworn"), (last, "worn")):
            heights, preload = self.heights[row], self.preload[row]
            texts.append(
                f"{state}: {heights.max():.4g} m at blade {heights.argmax()}, {heights.max() / heights.mean():.4f} of "
                f"the mean of all blades; preload of a blade {preload.min():.5g} to {preload.max():.5g} N"
            )
        low, high = 1e9 * self.volume[last].min(), 1e9 * self.volume[last].max()
        return [*texts, f"worn volume of a blade: {low:.4g} to {high:.4g} mm3"]

    def record(self) -> dict[str, object]:
        """For machines."""
        h = self.history
        return {
            "pattern": self.number,
            "blade": self.blade,
            "end": str(h.end),
            "cycles": h.cycles.tolist(),
            "volume": self.volume[-1].tolist(),
            "preload": [self.preload[0].tolist(), self.preload[-1].tolist()],
            "amplitude": [self.heights[0].tolist(), self.heights[-1].tolist()],
        }

    def write(self, folder: Path) -> list[Path]:
        """Write mistuned_wear.csv, of every blade over the cycles, its picture, and pictures and films of the wheel."""
        h = self.history
        columns: dict[str, np.ndarray] = {"cycles": h.cycles, "peak_frequency_Hz": h.omega / (2 * np.pi)}
        for name, values in (("amplitude_m", self.heights), ("volume_m3", self.volume), ("preload_N", self.preload)):
            columns |= {f"{name}@{k}": column for k, column in enumerate(values.T)}
        written = write_files(folder, {"mistuned_wear": columns}, {"mistuned_wear": self.plot()})
        shown = [self.state(0), self.state(-1)]
        return written + where_it_can_be(lambda: write_wheel(self.blades, shown, folder, self.formats))

    def state(self, row: int) -> WheelState:
        """The wheel at a wear step."""
        h, balance = self.history, self.blades.balance(self.blades.pattern(self.number))
        omega = float(h.omega[row])
        motion = nodes(self.blades, balance, h.displacement[row], h.force[row], omega)
        label = f"pattern {self.number}, {h.cycles[row]:.3g} cycles, {omega / (2 * np.pi):.4g} Hz"
        return WheelState(label, motion, self.heights[row], self.volume[row])

    def plot(self) -> Figure:
        """Amplitude, preload and worn volume of every blade as the wheel wears."""
        with axes_of(10.0, 3.8, columns=3, share=False) as (figure, axes):
            blades, cycles = np.arange(self.volume.shape[1]), self.history.cycles
            unit, scale = length_unit(float(self.heights.max()))
            shown = (
                (scale * self.heights, f"amplitude / {unit}"),
                (self.preload, "preload / N"),
                (1e9 * self.volume, "worn volume / mm³"),
            )
            for ax, (values, label) in zip(axes, shown, strict=True):
                mesh = ax.pcolormesh(blades, 1e-6 * cycles, values, cmap=WEAR_MAP, shading="nearest")
                figure.colorbar(mesh, ax=ax)
                ax.set(xlabel="blade", title=label)
            axes[0].set_ylabel("million cycles")
        return figure


def pattern_wear(
    scene: Source, pattern: int, *, formats: Sequence[str] = (), overrides: Overrides = (), progress: Report = None
) -> MistunedWear:
    """Wear the wheel of a pattern of blades that differ: every blade's contacts wear by their own work.

    By the [wear] of the scene; a peak that it asks for is that of the blade that has the highest one unworn.

    scene : name of a scene with [wheel], [mistuning] and [wear], or a .toml file
    pattern : number of the pattern, from 1
    formats : formats of a film, gif or mp4: made of the worn wheel over one cycle; none by default
    Raises  SceneError where the scene lacks a table; SolveFailed"""
    file, report = read_scene(scene, overrides), reporter(progress)
    wear_settings = file.mesh_scene.wear
    asked_of(file)
    if wear_settings is None:
        raise SceneError(f"{file.name} has no [wear]: there is nothing to wear the blades by")

    def on_row(row: WearRow) -> None:
        report.say(f"{row.cycles:.4g} cycles, {1e6 * row.depth.max():.4g} um")

    with limited(file.scene.solver.threads):
        blades = MistunedBlades.of(file)
        n, drawn = blades.wheel.n_sectors, blades.pattern(pattern)
        balance = blades.balance(drawn)
        _, blade = blades.peak(drawn)
        sector = wear_run.wear_problem(file.scene, file.folder, blades.wheel.wave, wear_settings.lost_below)
        output = f"{OUTPUT}@{blade}"
        duties = [replace(duty, site=_of_output(duty.site, output)) for duty in settings.mission(file.scene)]
        area = np.tile(sector.area, n)
        scale = settings.depth_scale(file.scene, references.free_deflection(blades.wheel.wave), sector.area)
        problem = WearProblem(balance, tuple(duties), sector.wear, area, sector.lost_below, None, sector.any_joint, n)
        history = evolve(wear_run.rule_of(file.scene, problem, scale), wear_settings.max_steps, on_row)
    names = list(balance.compliance.output_names)
    rows = [names.index(f"{OUTPUT}@{k}") for k in range(n)]
    per = (len(history.cycles), n, -1)
    volume = (history.depth * area).reshape(per).sum(axis=2)
    preload = history.normal_force.reshape(per).sum(axis=2)
    heights = amplitude(history.response[:, rows], balance.basis.harmonics)
    return MistunedWear(blades, pattern, blade, history, volume, heights, preload, tuple(formats))


def _of_output(site: OperatingCondition, output: str) -> OperatingCondition:
    if isinstance(site, AtPeakRatio):
        return replace(site, peak=replace(site.peak, output=output))
    return replace(site, output=output)


def write_wheel(
    blades: MistunedBlades, states: Sequence[WheelState], folder: Path, formats: Sequence[str] = ()
) -> list[Path]:
    """Write mistuned_wheel.png, and a film over one cycle in some formats; returns their paths.

    Raises  Refusal for a part that has no mesh of one kind; RenderingUnavailable"""
    mesh, info = part_mesh(blades.part), wheel_scene(blades.file).wheel
    if mesh is None:
        raise Refusal("this part has bodies of different elements: its wheel cannot be drawn")
    wheel = Around(info.sectors, info.engine_order, np.array(info.axis, float))
    harmonics = blades.wheel.wave.basis.harmonics
    wheel_film = MistunedWheelFilm(blades.file.name, wheel, mesh, harmonics, states, IMAGES if formats else 1)
    folder.mkdir(parents=True, exist_ok=True)
    wheel_film.figure.savefig(drawing := folder / f"{wheel_film.name}.png")
    films = film.encode(film.drawn(wheel_film), folder / wheel_film.name, formats) if formats else []
    return [drawing, *films]


def nodes(
    blades: MistunedBlades, balance: HarmonicBalance, displacement: np.ndarray, force: np.ndarray, omega: float
) -> np.ndarray:
    """Displacement (N, n_node, 3, n_coeff) of every blade [m]."""
    full = blades.wheel.full_displacement(blades.reduced, balance, displacement, force, omega)
    return np.stack([blades.part.field(blade_motion) for blade_motion in full])
