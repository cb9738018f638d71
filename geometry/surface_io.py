"""Read a measured height map from a file; its format is recognised by content, else by the ending of its name.

Text:    x y z on each line (any order, a point may be missing), or a matrix of heights, one profile along x per line
SDF:     ISO 25178-71, see surface_sdf
others:  .sur .plu .plux .al3d .x3p .vk4 .opd ... through the package surfalize (GPL-3), if it is installed
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tribodyn.extras import package
from tribodyn.geometry import surface_sdf
from tribodyn.geometry.surface import HeightMap

TEXT_ENDINGS = (".txt", ".xyz", ".csv", ".asc", ".dat", ".tsv", ".prn")
"""Endings read as text; others that are not SDF go to surfalize."""


def read(
    path: str | Path,
    *,
    spacing: tuple[float, float] | None = None,
    lateral_unit: float = 1.0,
    height_unit: float = 1.0,
) -> HeightMap:
    """Read a height map in metres.

    spacing : steps along x and y of a matrix text, in lateral units; None for text with x y z
    lateral_unit, height_unit : metres per unit of a text, 1e-6 for micrometres; other formats know their units
    Raises  ValueError: no such file, an empty one, not a regular grid, a reader that is not installed
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"there is no height map {path}: check the name and the folder")
    with path.open("rb") as stream:
        head = stream.read(16)
    if not head:
        raise ValueError(f"{path.name} is empty: export the height map again")
    is_text = path.suffix.lower() in TEXT_ENDINGS and not surface_sdf.looks_like(head)
    if not is_text and (spacing is not None or lateral_unit != 1.0 or height_unit != 1.0):
        raise ValueError(f"{path.name} carries its own units: leave out spacing, lateral_unit and height_unit")
    if surface_sdf.looks_like(head):
        return surface_sdf.read(path)
    if not is_text:
        return _through_surfalize(path)
    table = _numbers(path)
    if spacing is None:
        if table.shape[1] != 3:
            raise ValueError(f"{path.name} has {table.shape[1]} columns, not x y z: give spacing if it is a matrix")
        x, y, z = _gridded(table, path.name)
    else:
        if not (len(spacing) == 2 and min(spacing) > 0):
            raise ValueError(f"spacing of {path.name} is {spacing}: give two positive steps, along x and along y")
        z = table.T
        x, y = (np.arange(n) * step for n, step in zip(z.shape, spacing, strict=True))
    return HeightMap(x * lateral_unit, y * lateral_unit, z * height_unit, path.name)


def _numbers(path: Path) -> np.ndarray:
    """Rows of numbers; heads and comments before them are passed over; words for a missing height become NaN."""
    text = path.read_text(encoding="utf-8", errors="replace")
    # with semicolons between fields a comma is a decimal point
    text = text.replace(",", ".").replace(";", " ") if ";" in text else text.replace(",", " ")
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith(("#", "%", "*", '"')):
            continue
        try:
            rows.append([_number(word) for word in words])
        except ValueError:
            if rows:
                raise ValueError(f"{path.name} has words in line {number}, after its first heights") from None
    if not rows:
        raise ValueError(f"{path.name} holds no numbers: is it a height map?")
    widths = {len(row) for row in rows}
    if len(widths) > 1:
        raise ValueError(f"{path.name} has lines of {min(widths)} to {max(widths)} numbers: all must be equally long")
    return np.array(rows)


def _number(word: str) -> float:
    return np.nan if word.upper() in ("BAD", "***", "---", "N/A", "NO_DATA") else float(word)


def _gridded(table: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axes and heights (nx, ny) from scattered rows x y z of a regular grid; points that are not listed are NaN."""
    if not np.isfinite(table[:, :2]).all():
        raise ValueError(f"{name} has coordinates that are not numbers")
    axes, places = [], []
    for values in table[:, :2].T:
        ordered = np.unique(values)
        if len(ordered) < 2:
            raise ValueError(f"{name} has a single value in x or y: a height map needs a grid")
        steps = np.diff(ordered)
        step = np.median(steps[steps > 1e-3 * steps.max()])
        count = round((ordered[-1] - ordered[0]) / step) + 1
        place = np.rint((values - ordered[0]) / step).astype(int)
        if np.abs((values - ordered[0]) / step - place).max() > 0.05 or count > 10 * len(table):
            raise ValueError(f"{name} has points off a regular grid of step {step:g}: resample it to a grid")
        axes.append(np.linspace(ordered[0], ordered[-1], count))
        places.append(place)
    cells = places[0] * len(axes[1]) + places[1]
    if len(np.unique(cells)) < len(cells):
        raise ValueError(f"{name} lists a point of the grid twice")
    z = np.full(len(axes[0]) * len(axes[1]), np.nan)
    z[cells] = table[:, 2]
    return axes[0], axes[1], z.reshape(len(axes[0]), len(axes[1]))


def _through_surfalize(path: Path) -> HeightMap:
    surfalize = package("surfalize")
    try:
        surface = surfalize.Surface.load(path)
    except Exception as problem:  # the readers raise what they meet
        raise ValueError(f"{path.name} cannot be read by surfalize: {problem}") from None
    z = np.asarray(surface.data, float).T * 1e-6  # surfalize works in micrometres
    x, y = (np.arange(n) * step * 1e-6 for n, step in zip(z.shape, (surface.step_x, surface.step_y), strict=True))
    return HeightMap(x, y, z, path.name)
