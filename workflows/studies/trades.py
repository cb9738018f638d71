"""What the settings of a scene cost and are worth, as a study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import fspath
from pathlib import Path
from typing import Any

from tribodyn.workflows.errors import choice, trade_table
from tribodyn.workflows.errors import trade as measured
from tribodyn.workflows.errors.trade_table import ANSWERED, NAMES, QUANTITIES, Trade, TradeRow
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies import trade_figure


@dataclass(frozen=True)
class Traded:
    """The table of a trade, kept in a folder. folder : None where it is not kept"""

    table: Trade
    folder: Path | None

    def record(self) -> list[dict[str, Any]]:
        """For machines."""
        trade, names = self.table, QUANTITIES
        orders = {parameter: {name: trade.order(parameter, name) for name in names} for parameter in trade.parameters}
        return [{**plain(asdict(row)), "scene": trade.scene, "order": orders[row.parameter]} for row in trade.rows]

    def lines(self) -> list[str]:
        """For people: errors in per cent of the limit of each parameter, behind ~ the doubt in it; what to use."""
        trade = self.table
        lines = [_line("parameter", "setting", "seconds", "MB", NAMES)]
        for parameter in trade.parameters:
            for row in trade.of(parameter):
                cells = [_cell(row, name) for name in QUANTITIES]
                failure = "" if row.outcome == ANSWERED else f"  {row.outcome}"
                spent, memory = f"{row.seconds:.2f}", f"{row.memory / 1e6:.0f}"
                lines.append(_line(parameter, row.setting[:46], spent, memory, cells) + failure)
            orders = [trade.order(parameter, name) for name in QUANTITIES]
            if any(order is not None for order in orders):
                cells = ["" if order is None else f"order {order:.1f}" for order in orders]
                lines.append(_line(parameter, "", "", "", cells))
        lines.append(f"every parameter alone on {trade.scene} with {'; '.join(trade.base) or 'nothing changed'}")
        lines.append("errors from where the parameter tends to, behind ~ the doubt in that")
        return [*lines, *choice.advice(trade)]

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


def _line(parameter: str, setting: str, seconds: str, memory: str, cells: Sequence[str]) -> str:
    return f"{parameter:15} {setting:46} {seconds:>7} {memory:>6} " + " ".join(f"{cell:>16}" for cell in cells)


def _cell(row: TradeRow, quantity: str) -> str:
    error, doubt = row.errors[quantity], row.doubts[quantity]
    if error is None or doubt is None:
        return ""
    known = f"{100 * error:+.3g}" if error else "0"
    return f"{known} ~{100 * doubt:.2g} %" if doubt else f"{known} %"
