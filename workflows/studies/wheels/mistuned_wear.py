"""The wear of one wheel of blades that differ: every blade's contacts wear by their own work, and feed back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.hbm.continuation.sites import BesidePeak, Site
from tribodyn.hbm.threads import limited
from tribodyn.hbm.wear.evolution import WearProblem
from tribodyn.hbm.wear.history import WearHistory, WearRow
from tribodyn.workflows.pictures.plots import axes_of, length_unit
from tribodyn.workflows.pictures.style import WEAR_MAP
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run import references, settings, wear_run
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.studies.wheels.patterns import Blades, asked_of, drawn


@dataclass(frozen=True)
class MistunedWear:
    """A worn wheel.

    number : of its pattern; history : of all pairs, sector by sector; blade : whose peak is tracked
    volume : (n_row, N) worn by then at the contacts of every sector [m3]; heights : (n_row, N) amplitudes [m]
    preload : (n_row, N) mean normal force of the contacts of every sector [N]
    """

    number: int
    blade: int
    history: WearHistory
    volume: np.ndarray
    heights: np.ndarray
    preload: np.ndarray

    def lines(self) -> list[str]:
        """For people."""
        h, last = self.history, -1
        said = [f"pattern {self.number}: {len(h.cycles)} wear steps, {h.cycles[last]:.4g} cycles, {h.end}"]
        for row, when in ((0, "unworn"), (last, "worn")):
            heights, preload = self.heights[row], self.preload[row]
            said.append(
                f"{when}: {heights.max():.4g} m at blade {heights.argmax()}, {heights.max() / heights.mean():.4f} of "
                f"the mean of all blades; preload of a blade {preload.min():.5g} to {preload.max():.5g} N"
            )
        low, high = 1e9 * self.volume[last].min(), 1e9 * self.volume[last].max()
        return [*said, f"worn volume of a blade: {low:.4g} to {high:.4g} mm3"]

    def record(self) -> dict[str, object]:
        """For machines."""
        h = self.history
        return {
            "pattern": self.number,
            "blade": self.blade,
            "end": str(h.end),
            "cycles": h.cycles.tolist(),
            "volume_m3": self.volume[-1].tolist(),
            "preload_N": [self.preload[0].tolist(), self.preload[-1].tolist()],
            "amplitude_m": [self.heights[0].tolist(), self.heights[-1].tolist()],
        }


def study(
    file: SceneFile,
    number: int,
    on_row: Callable[[WearRow], None] | None = None,
    blades: Blades | None = None,
) -> MistunedWear:
    """Wear the wheel of a pattern by the scene's [wear]; a peak that it asks for is that of the blade that has the
    highest one unworn.

    blades : of this file, where they are there already
    Raises  SceneError where the scene lacks [wear] or [mistuning]; SolveFailed
    """
    scene = file.mesh_scene
    asked_of(file)
    if scene.wear is None:
        raise SceneError(f"{file.name} has no [wear]: there is nothing to wear the blades by")
    with limited(scene.solver.threads):
        blades = blades or Blades.of(file)
        n = blades.wheel.n_sectors
        pattern = drawn(asked_of(file), n, number)
        balance = blades.balance(pattern)
        _, blade = blades.peak(pattern)
        one = wear_run.wear_problem(scene, file.folder, blades.wheel.wave, scene.wear.lost_below)
        output = f"{OUTPUT}@{blade}"
        duties = [replace(duty, site=_of_output(duty.site, output)) for duty in settings.mission(scene)]
        area = np.tile(one.area, n)
        approach = references.free_deflection(blades.wheel.wave)
        limit = settings.step_limit(scene, approach, one.area)
        problem = WearProblem(balance, tuple(duties), one.wear, area, one.lost_below, None, one.any_joint, n)
        history = wear_run.evolve(problem, scene.wear, limit, scene.wear.max_steps, on_row)
    names = list(balance.compliance.output_names)
    rows = [names.index(f"{OUTPUT}@{k}") for k in range(n)]
    per = (len(history.cycles), n, -1)
    volume = (history.depth * area).reshape(per).sum(axis=2)
    preload = history.normal_force.reshape(per).sum(axis=2)
    return MistunedWear(number, blade, history, volume, amplitude(history.response[:, rows]), preload)


def _of_output(site: Site, output: str) -> Site:
    if isinstance(site, BesidePeak):
        return replace(site, peak=replace(site.peak, output=output))
    return replace(site, output=output)


def write(found: MistunedWear, path: Path) -> None:
    """Peak, amplitude, worn volume and preload of every blade over the cycles, as comma-separated values."""
    h = found.history
    columns: dict[str, np.ndarray] = {"cycles": h.cycles, "peak_Hz": h.omega / (2 * np.pi)}
    for name, values in (("amplitude_m", found.heights), ("volume_m3", found.volume), ("preload_N", found.preload)):
        columns |= {f"{name}@{k}": column for k, column in enumerate(values.T)}
    write_columns(columns, path)


def picture(found: MistunedWear) -> Figure:
    """Amplitude, preload and worn volume of every blade as the wheel wears."""
    with axes_of(10.0, 3.8, columns=3, share=False) as (figure, axes):
        blades, cycles = np.arange(found.volume.shape[1]), found.history.cycles
        unit, scale = length_unit(float(found.heights.max()))
        shown = (
            (scale * found.heights, f"amplitude / {unit}"),
            (found.preload, "preload / N"),
            (1e9 * found.volume, "worn volume / mm³"),
        )
        for ax, (values, label) in zip(axes, shown, strict=True):
            mesh = ax.pcolormesh(blades, 1e-6 * cycles, values, cmap=WEAR_MAP, shading="nearest")
            figure.colorbar(mesh, ax=ax)
            ax.set(xlabel="blade", title=label)
        axes[0].set_ylabel("million cycles")
    return figure
