"""Tables and pictures of a study, written into a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

from tribodyn.workflows.pictures.figures import save
from tribodyn.workflows.result.number_format import write_columns


def write_files(
    folder: Path,
    tables: Mapping[str, Mapping[str, Any]],
    pictures: Mapping[str, Figure],
    formats: Sequence[str] = ("png",),
) -> list[Path]:
    """Write columns as NAME.csv and figures as NAME.png, or in other formats; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, columns in tables.items():
        write_columns(columns, folder / f"{name}.csv")
        written.append(folder / f"{name}.csv")
    return [*written, *(path for name, figure in pictures.items() for path in save(figure, folder / name, formats))]
