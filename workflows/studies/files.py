"""Tables and pictures of a study, written into a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

from tribodyn.extras import MissingPackage
from tribodyn.workflows.pictures.figures import save, write_figure
from tribodyn.workflows.result.number_format import write_columns


def write_picture(plot: Callable[[], Figure], path: Path) -> None:
    """Write one figure; nothing where the package that draws it is missing."""
    with suppress(MissingPackage):
        write_figure(plot(), path)


def write_files(
    folder: Path,
    tables: Mapping[str, Mapping[str, Any]],
    pictures: Callable[[], Mapping[str, Figure]],
    formats: Sequence[str] = ("png",),
) -> list[Path]:
    """Write columns as NAME.csv and figures as NAME.png, or in other formats; returns the files.

    pictures : makes the figures; the tables stand alone where the package that draws them is missing"""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, columns in tables.items():
        write_columns(columns, folder / f"{name}.csv")
        written.append(folder / f"{name}.csv")
    with suppress(MissingPackage):
        written += [path for name, figure in pictures().items() for path in save(figure, folder / name, formats)]
    return written
