"""Measured faces from Python, as the command `tribodyn asperities` reads them."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Literal

from tribodyn.geometry import surface_io
from tribodyn.geometry.asperities import Asperities, identify
from tribodyn.geometry.surface import HeightMap
from tribodyn.geometry.surface_pair import mirrored

Face = HeightMap | str | PathLike[str]


def asperities(
    first: Face,
    second: Face | None = None,
    *,
    cutoff: float | None = None,
    shortest: float | None = None,
    mirror: Literal["x", "y"] | None = None,
    spacing: tuple[float, float] | None = None,
    lateral_unit: float = 1.0,
    height_unit: float = 1.0,
) -> Asperities:
    """The asperities of a rough face against a plane, or of two faces against each other: see `Asperities`.

    first, second : height maps or files of them;  cutoff, shortest : wavelengths [m] between which the roughness is
    mirror : axis of the second map that is reversed before it faces the first
    spacing, lateral_unit, height_unit : of text files, steps along x and y, and what one unit is in metres
    Raises  ValueError: a map that cannot be one, heights in steps, too few summits
    """
    options = {"spacing": spacing, "lateral_unit": lateral_unit, "height_unit": height_unit}

    def face(of: Face) -> HeightMap:
        return of if isinstance(of, HeightMap) else surface_io.read(Path(of), **options)  # type: ignore[arg-type]

    other = None if second is None else face(second)
    if mirror is not None:
        if other is None:
            raise ValueError("mirror reverses the second face, and there is one face only: leave it out")
        other = mirrored(other, mirror)
    return identify(face(first), other, cutoff, shortest)
