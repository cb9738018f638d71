"""What the settings of a scene cost and are worth, and the grids that settle its answers, as studies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import fspath
from pathlib import Path
from typing import Any

from tribodyn.workflows.errors import choice, trade_table
from tribodyn.workflows.errors import trade as measured
from tribodyn.workflows.errors.trade_table import Trade
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies import convergence as grids
from tribodyn.workflows.studies import trade_figure
from tribodyn.workflows.studies.files import write_files


@dataclass(frozen=True)
class Traded:
    """The table of a trade, kept in a folder. folder : None where it is not kept"""

    table: Trade
    folder: Path | None

    def record(self) -> list[dict[str, Any]]:
        """For machines."""
        return measured.as_records(self.table)

    def lines(self) -> list[str]:
        """For people."""
        return [measured.as_text(self.table), *choice.advice(self.table)]

    @property
    def files(self) -> list[Path]:
        """Table and picture."""
        return [] if self.folder is None else [self.folder / "trade.json", self.folder / "trade.png"]


def trade(
    scene: AnyPath,
    folder: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    most: int = 99,
    overrides: Overrides = (),
    progress: Report = None,
) -> Traded:
    """Measure what each setting costs and what it is worth, against where it tends to on the same scene.

    scene : name of a scene or a .toml file
    folder : folder of trade.json, kept after each setting, and trade.png; results/NAME by default
    settings : setting to measure, can be repeated; the others of an earlier table stay. All by default
    most : values of each setting, the finest ones
    """
    if most < 1:
        raise ValueError(f"--most {most}: a setting needs one value at least")
    place = Path("results") / Path(scene).stem if folder is None else Path(folder)
    path = place / "trade.json"
    earlier = trade_table.load(path) if settings and path.exists() else None

    def keep(table: Trade) -> None:
        trade_table.save(table, path)

    texts, say = override_texts(overrides), reporter(progress).say
    found = measured.run(fspath(scene), settings, texts, say, most, keep, earlier)
    trade_figure.picture(found).savefig(path.with_suffix(".png"))
    return Traded(found, place)


@dataclass(frozen=True)
class Converged:
    """Studies of the grids of a scene."""

    studies: tuple[grids.Study, ...]

    def record(self) -> list[dict[str, Any]]:
        """For machines."""
        return grids.as_records(self.studies)

    def lines(self) -> list[str]:
        """For people."""
        return [grids.as_text(self.studies)]

    def write(self, folder: Path) -> list[Path]:
        """Write a picture of each."""
        pictures = {f"converge_{one.scene}_{one.ladder}": grids.picture(one) for one in self.studies}
        return write_files(folder, {}, pictures)


def converge(scene: AnyPath, *, most: float = 99, overrides: Overrides = (), progress: Report = None) -> Converged:
    """Refine the contact grid and the mesh until the answers settle, and say which grid a per cent needs.

    scene : name of a scene with a study of its grids
    most : finest grid, in nodes along the patch
    """
    return Converged(grids.run(fspath(scene), override_texts(overrides), most, reporter(progress).say))
