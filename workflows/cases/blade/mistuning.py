"""Blades that differ: a wheel of few sectors whose stiffnesses deviate, what cyclic symmetry cannot say.

The same reduced blade as for a travelling wave, once for every sector and each with its own stiffness, joined at the
shrouds to one real model of the whole wheel:

    blade = blade_model.build(scene_file.read("blade", FEW_SECTORS))
    balance = blade.whole_wheel([1.02, 0.99, 1.0, 0.98, 1.01, 1.0, 0.97, 1.03])

is a harmonic balance like any other, with outputs "response@0", "response@1", ... and the load running round.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.branch import Branch, amplitude
from tribodyn.workflows.cases.blade import model as blade_model
from tribodyn.workflows.cases.blade.figures import shades
from tribodyn.workflows.cases.blade.model import Blade
from tribodyn.workflows.pictures import plots
from tribodyn.workflows.pictures.style import INK
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene import scene_file

FEW_SECTORS = (  # ours: a wheel of eight small blades, coarse
    "wheel.sectors=8",
    "wheel.engine_order=2",
    "geometry.n_blades=8",
    "geometry.hub_radius=60 mm",
    "geometry.span=80 mm",
    "geometry.root_chord=35 mm",
    "geometry.tip_chord=24 mm",
    "geometry.root_thickness=10 mm",
    "geometry.tip_thickness=8 mm",
    "geometry.shroud_angle=35 deg",
    "geometry.contact_length=20 mm",
    "geometry.contact_height=12 mm",
    "geometry.shroud_length=35 mm",
    "geometry.root_height=15 mm",
    "geometry.root_length=50 mm",
    "geometry.n_along=3",
    "geometry.n_up=2",
    "geometry.n_span=4",
    "geometry.n_side=1",
    "geometry.n_root=1",
    'loads.static.untwist_trailing={group = "couple_trailing", direction = "y", value = "4 kN"}',
    'loads.static.untwist_leading={group = "couple_leading", direction = "-y", value = "4 kN"}',
    "loads.harmonic.wave.value=1 kN",
    "reduction.cutoff=20 kHz",
    "response.frequency=[850, 1150]",
)
SPREAD, SEED = 0.02, 1


@dataclass(frozen=True)
class Mistuned:
    """Responses of a wheel and of the same wheel with all blades alike.

    stiffness : (n_sectors,) factors; heights : (n_point, n_sectors) amplitudes of the wheel at its points [m]
    """

    stiffness: np.ndarray
    branch: Branch
    heights: np.ndarray
    alike: Branch

    @property
    def amplification(self) -> float:
        """Largest amplitude of any blade over that of a wheel of blades alike."""
        return float(self.heights.max() / self.alike.amplitude(OUTPUT).max())


def deviations(n_sectors: int, spread: float = SPREAD, seed: int = SEED) -> np.ndarray:
    """Factors (n_sectors,) on the stiffness, normally distributed with a standard deviation and a mean of one."""
    drawn = np.random.default_rng(seed).normal(size=n_sectors)
    drawn -= drawn.mean()
    return np.asarray(1 + spread * drawn / drawn.std())


def respond(blade: Blade, stiffness: Sequence[float], tolerance: float = 3e-3) -> Mistuned:
    """Response of a wheel over the scene's range to its engine order, beside blades alike.

    tolerance : of the curves between their points. Raises  SolveFailed
    """
    frequency = blade.scene.response.frequency
    branch = blade_model.follow(blade.whole_wheel(stiffness), frequency, tolerance)
    alike = blade_model.follow(blade.wave(), frequency, tolerance)
    rows = [branch.output_names.index(f"{OUTPUT}@{n}") for n in range(len(stiffness))]
    return Mistuned(np.asarray(stiffness), branch, amplitude(branch.response[:, rows]), alike)


def picture(found: Mistuned) -> Figure:
    """Amplitude of every blade over frequency, beside that of blades alike."""
    with plots.axes_of(7.6, 4.6) as (figure, axes):
        unit, scale = plots.length_unit(float(found.heights.max()))
        for n, color in enumerate(shades(len(found.stiffness))):
            label = f"blade {n}: {100 * (found.stiffness[n] - 1):+.1f} %"
            axes.plot(found.branch.frequency, scale * found.heights[:, n], color=color, lw=1.2, label=label)
        axes.plot(found.alike.frequency, scale * found.alike.amplitude(OUTPUT), "--", color=INK, label="blades alike")
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel=f"tip amplitude / {unit}")
        axes.set_title("Blades whose stiffnesses deviate")
        axes.legend(fontsize=8, ncols=2)
    return figure


def run(scene: str, overrides: Sequence[str], folder: Path) -> list[Path]:
    """Draw one wheel's deviations, compute its response into a folder, and print what they do."""
    blade = blade_model.build(scene_file.read(scene, (*FEW_SECTORS, *overrides)))
    found = respond(blade, [float(factor) for factor in deviations(blade.reduced.sector.n_sectors)])
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "mistuned.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["frequency_Hz", *(f"blade_{n}_m" for n in range(len(found.stiffness)))])
        table.writerows(np.column_stack([found.branch.frequency, found.heights]).tolist())
    picture(found).savefig(folder / "mistuned.png")
    print(f"largest amplitude over that of blades alike: {found.amplification:.3f}")
    return [folder / "mistuned.csv", folder / "mistuned.png"]
