"""A mistuned wheel: sectors whose stiffnesses deviate, what cyclic symmetry of one sector cannot say.

The same reduced sector as for a travelling wave, once for every sector and each with its own stiffness, joined at the
contacts to one real model of the whole wheel. Memory and time grow with the number of sectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.continuation.branch import Branch, amplitude
from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.plots import axes_of, length_unit
from tribodyn.workflows.pictures.style import INK, WEAR_MAP
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.fields import Number, quantity
from tribodyn.workflows.scene.source import Overrides, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels import wheel as wheels

TOLERANCE = 3e-3  # of the curves between their points


@dataclass(frozen=True, repr=False)
class Mistuned(StudyResult):
    """Responses of a wheel, and of the same wheel with all sectors alike.

    stiffness : (n_sectors,) factors; heights : (n_point, n_sectors) amplitudes of the wheel at its points [m]
    """

    stiffness: np.ndarray
    branch: Branch
    heights: np.ndarray
    alike: Branch

    @property
    def amplification(self) -> float:
        """Largest amplitude of any sector over that of a wheel of sectors alike."""
        return float(self.heights.max() / self.alike.amplitude(OUTPUT).max())

    def record(self) -> dict[str, object]:
        """For machines."""
        worst = int(np.argmax(self.heights.max(axis=0)))
        return {
            "stiffness": self.stiffness.tolist(),
            "amplification": self.amplification,
            "worst_sector": worst,
            "peak_m": float(self.heights.max()),
            "peak_alike_m": float(self.alike.amplitude(OUTPUT).max()),
        }

    def lines(self) -> list[str]:
        """For people."""
        return [
            "factors on the stiffness: " + ", ".join(f"{factor:.4f}" for factor in self.stiffness),
            f"largest amplitude over that of sectors alike: {self.amplification:.3f}",
        ]

    def write(self, folder: Path) -> list[Path]:
        """Write mistuned.csv, the amplitude of every sector over frequency, and mistuned.png."""
        heights = {f"sector_{n}_m": column for n, column in enumerate(self.heights.T)}
        columns = {"frequency_Hz": self.branch.frequency, **heights}
        return write_files(folder, {"mistuned": columns}, {"mistuned": self.plot()})

    def plot(self) -> Figure:
        """Amplitude of every sector over frequency, beside that of sectors alike."""
        colours = mpl.colormaps[WEAR_MAP](np.linspace(0.0, 0.92, len(self.stiffness)))
        with axes_of(7.6, 4.6) as (figure, axes):
            unit, scale = length_unit(float(self.heights.max()))
            for n, colour in enumerate(colours):
                label = f"sector {n}: {100 * (self.stiffness[n] - 1):+.1f} %" if len(colours) <= 12 else None
                axes.plot(self.branch.frequency, scale * self.heights[:, n], color=colour, label=label)
            alike = scale * self.alike.amplitude(OUTPUT)
            axes.plot(self.alike.frequency, alike, "--", color=INK, label="sectors alike")
            axes.set(yscale="log", xlabel="frequency / Hz", ylabel=f"amplitude / {unit}")
            axes.set_title("Sectors whose stiffnesses deviate")
            axes.legend(ncols=2)
        return figure


def deviations(n_sectors: int, spread: float, seed: int) -> np.ndarray:
    """Factors (n_sectors,) on the stiffness, drawn from a normal distribution, then shifted and scaled.

    Their mean is one and their standard deviation is `spread`, exactly; the same seed gives the same factors.
    Raises  ValueError for a spread that makes a factor zero or less
    """
    drawn = np.random.default_rng(seed).normal(size=n_sectors)
    drawn -= drawn.mean()
    return checked(1 + spread * drawn / drawn.std(), n_sectors)


def checked(factors: Sequence[float] | np.ndarray, n_sectors: int) -> np.ndarray:
    """Factors as an array; raises ValueError where there is not one above zero for each sector."""
    values = np.asarray(factors, float)
    if values.shape != (n_sectors,):
        raise ValueError(f"the wheel has {n_sectors} sectors, but there are {values.size} factors: give one for each")
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise ValueError("a factor on the stiffness of a sector must be a number above 0")
    return values


def mistuned(
    scene: Source,
    stiffness: Annotated[Sequence[float] | None, quantity("")] = None,
    *,
    spread: Number = 0.02,
    seed: int = 1,
    overrides: Overrides = (),
) -> Mistuned:
    """Solve all sectors of a wheel at once, their stiffnesses a little apart, beside sectors alike.

    scene : name of a scene with a [wheel], or a .toml file
    stiffness : factor on the stiffness of every sector, such as "1.02, 0.99, 1, 0.98"; drawn by default
    spread : standard deviation of the factors that are drawn, such as "2 %"
    seed : seed of the draw; the same seed gives the same factors
    Raises  SceneError for a scene without [wheel], ValueError for factors that cannot be, SolveFailed
    """
    file = read_scene(scene, overrides)
    with limited(file.scene.solver.threads):
        wheel = wheels.build(file)
        n = wheel.n_sectors
        factors = deviations(n, spread, seed) if stiffness is None else checked(stiffness, n)
        frequency = file.scene.response.range
        branch = wheels.follow(wheel.whole([float(one) for one in factors]), frequency, TOLERANCE)
        alike = wheels.follow(wheel.wave(), frequency, TOLERANCE)
    rows = [branch.output_names.index(f"{OUTPUT}@{i}") for i in range(n)]
    return Mistuned(factors, branch, amplitude(branch.response[:, rows]), alike)
