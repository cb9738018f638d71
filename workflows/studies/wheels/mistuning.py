"""A mistuned wheel: sectors whose stiffnesses deviate, what cyclic symmetry of one sector cannot say.

The same reduced sector as for a travelling wave, once for every sector and each with its own stiffness, joined at the
contacts to one real model of the whole wheel. Memory and time grow with the number of sectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.continuation.branch import Branch, amplitude
from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.plots import axes_of, length_unit
from tribodyn.workflows.pictures.style import INK, WEAR_MAP
from tribodyn.workflows.result.columns import write_columns
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.wheels import wheel as wheels

TOLERANCE = 3e-3  # of the curves between their points


@dataclass(frozen=True)
class Mistuned:
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


def respond(
    file: SceneFile,
    stiffness: Sequence[float] | np.ndarray | None = None,
    spread: float = 0.02,
    seed: int = 1,
    tolerance: float = TOLERANCE,
) -> Mistuned:
    """Response of the scene's wheel over its range of frequencies, beside that of sectors alike.

    stiffness : factor for each sector; drawn with `spread` and `seed` by default
    Raises  SceneError for a scene without [wheel], ValueError for factors that cannot be, SolveFailed
    """
    with limited(file.scene.solver.threads):
        wheel = wheels.build(file)
        n = wheel.n_sectors
        factors = deviations(n, spread, seed) if stiffness is None else checked(stiffness, n)
        frequency = file.scene.response.frequency
        branch = wheels.follow(wheel.whole([float(one) for one in factors]), frequency, tolerance)
        alike = wheels.follow(wheel.wave(), frequency, tolerance)
    rows = [branch.output_names.index(f"{OUTPUT}@{i}") for i in range(n)]
    return Mistuned(factors, branch, amplitude(branch.response[:, rows]), alike)


def write(found: Mistuned, path: Path) -> None:
    """Amplitude of every sector over frequency as comma-separated values."""
    heights = {f"sector_{n}_m": column for n, column in enumerate(found.heights.T)}
    write_columns({"frequency_Hz": found.branch.frequency, **heights}, path)


def picture(found: Mistuned) -> Figure:
    """Amplitude of every sector over frequency, beside that of sectors alike."""
    colours = mpl.colormaps[WEAR_MAP](np.linspace(0.0, 0.92, len(found.stiffness)))
    with axes_of(7.6, 4.6) as (figure, axes):
        unit, scale = length_unit(float(found.heights.max()))
        for n, colour in enumerate(colours):
            label = f"sector {n}: {100 * (found.stiffness[n] - 1):+.1f} %" if len(colours) <= 12 else None
            axes.plot(found.branch.frequency, scale * found.heights[:, n], color=colour, lw=1.2, label=label)
        axes.plot(found.alike.frequency, scale * found.alike.amplitude(OUTPUT), "--", color=INK, label="sectors alike")
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel=f"amplitude / {unit}")
        axes.set_title("Sectors whose stiffnesses deviate")
        axes.legend(fontsize=8, ncols=2)
    return figure
