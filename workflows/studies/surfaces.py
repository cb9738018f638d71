"""The asperities of measured faces, as the contact law `rough` takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from tribodyn.geometry import height_map_files
from tribodyn.geometry.asperities import Asperities, identify
from tribodyn.geometry.height_map import HeightMap, mirrored
from tribodyn.refusal import Refusal
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.scene.fields import Length, quantity
from tribodyn.workflows.studies.study_result import StudyResult

Face = HeightMap | str | PathLike[str]


@dataclass(frozen=True, repr=False)
class FaceAsperities(StudyResult):
    """Asperities with the table of the contact law `rough`. rows : of the table"""

    asperities: Asperities
    rows: int

    def record(self) -> dict[str, Any]:
        asperities = self.asperities
        return {
            "summits": len(asperities.height),
            "radius_m": asperities.radius,
            "density_per_m2": asperities.density,
            "deviation_m": float(asperities.height.std()),
            "mean_height_m": float(asperities.height.mean()),
            "largest_gap_m": float(asperities.gap.max()),
            "repairs": list(asperities.repairs),
        }

    def lines(self) -> list[str]:
        """For people; the last one is for the table of a contact."""
        asperities = self.asperities
        return named_lines(
            [
                ("summits", f"{len(asperities.height)} on {asperities.area:.3g} m2"),
                ("radius", f"{asperities.radius:.4g} m"),
                ("density", f"{asperities.density:.4g} 1/m2"),
                ("deviation", f"{asperities.height.std():.4g} m, of their heights"),
                ("mean height", f"{asperities.height.mean():.4g} m, above the mean plane"),
                *(("repaired", sentence) for sentence in asperities.repairs),
                ("for a contact", f'law = "rough", table = "asperities.csv", radius = "{asperities.radius:.6g} m"'),
            ]
        )

    def write(self, folder: Path) -> list[Path]:
        """Write asperities.csv for the key `table` of a contact."""
        folder.mkdir(parents=True, exist_ok=True)
        path, header = folder / "asperities.csv", "gap m, asperities per m2 and m of gap"
        np.savetxt(path, self.asperities.table(self.rows), delimiter=",", header=header, fmt="%.9g")
        return [path]


def asperities(
    first: Face,
    second: Face | None = None,
    *,
    cutoff: Length | None = None,
    shortest: Length | None = None,
    mirror: Literal["x", "y"] | None = None,
    spacing: Annotated[Sequence[float] | None, quantity("m")] = None,
    lateral_unit: Length = 1.0,
    height_unit: Length = 1.0,
    rows: int = 101,
) -> FaceAsperities:
    """Find the asperities of a rough face, or of two that touch: the numbers and the table of the contact law `rough`.

    first : height map: text, SDF, or what the optional package surfalize reads
    second : height map of the face that touches it; a plane by default
    cutoff : wavelength above which waves are no roughness, such as 0.8mm; only the mean plane is taken off by default
    shortest : wavelength below which waves are noise of the instrument; all are kept by default
    mirror : axis of the second map that is reversed before it faces the first
    spacing : steps along x and y of text files that hold a matrix of heights, such as "1um, 1um"
    lateral_unit : unit of lateral coordinates in text files, such as 1um
    height_unit : unit of heights in text files, such as 1um
    rows : rows of the table
    Raises  Refusal: a map that cannot be one, heights in steps, too few summits"""
    if spacing is not None and len(spacing) != 2:
        raise Refusal('--spacing: give two steps, along x and y, such as "1um, 1um"')
    for option, unit in (("--lateral-unit", lateral_unit), ("--height-unit", height_unit)):
        if not unit > 0:
            raise Refusal(f"{option} {unit:g}: give a unit of length such as 1um")
    steps = None if spacing is None else (spacing[0], spacing[1])

    def face(of: Face) -> HeightMap:
        if isinstance(of, HeightMap):
            return of
        return height_map_files.read(Path(of), spacing=steps, lateral_unit=lateral_unit, height_unit=height_unit)

    other = None if second is None else face(second)
    if mirror is not None:
        if other is None:
            raise Refusal("mirror reverses the second face, and there is one face only: leave it out")
        other = mirrored(other, mirror)
    return FaceAsperities(identify(face(first), other, cutoff, shortest), rows)
