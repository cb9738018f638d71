"""From a wanted accuracy to the cheapest settings that meet it, by the trade that was measured on the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hbm.branch import CONVERGED
from workflows.scene_file import SceneFile, read
from workflows.trade_table import NAMES, QUANTITIES, TRADES, Row, Trade, key_of, load

MARGIN = 0.7  # of the wanted error that the knobs together may use up: they were measured one by one


@dataclass(frozen=True)
class Choice:
    """One row for each knob; error : sum of their errors in the worst quantity; seconds : to expect."""

    rows: tuple[Row, ...]
    error: float
    seconds: float

    @property
    def overrides(self) -> tuple[str, ...]:
        """Overrides of the scene that set every knob."""
        return tuple(text for row in self.rows for text in row.overrides)

    @property
    def sentence(self) -> str:
        """What is promised and by which settings."""
        settings = ", ".join(row.setting for row in self.rows)
        return f"settings {settings}: expected error {self.error:.2g}, about {self.seconds:.2g} s of one processor"


def choose(trade: Trade, wanted: float, quantities: Sequence[str] = QUANTITIES) -> Choice:
    """The cheapest settings whose errors add up to less than the wanted one, in every quantity.

    wanted : relative error, above 0; quantities : that matter, out of trade_table.QUANTITIES
    Errors of different knobs are added without their signs, times are taken to multiply. From the finest settings each
    step coarsens the knob that saves most time for the error it adds.
    Raises  ValueError where even the finest settings do not meet it
    """
    options = {knob: _usable(trade.of(knob)) for knob in trade.knobs}
    ladders = {knob: rows for knob, rows in options.items() if rows}
    place = {knob: len(rows) - 1 for knob, rows in ladders.items()}

    def total(places: dict[str, int]) -> float:
        return max(sum(error_of(ladders[k], i, q) for k, i in places.items()) for q in quantities)

    def seconds(places: dict[str, int]) -> float:
        spent = trade.base_seconds
        for k, i in places.items():
            spent *= ladders[k][i].seconds / trade.base_seconds
        return spent

    if total(place) > MARGIN * wanted:
        raise ValueError(
            f"an accuracy of {wanted:.3g} is more than the trade of {trade.scene} can promise: its finest settings are "
            f"good to {total(place) / MARGIN:.2g}; measure a finer one with tribodyn trade {trade.scene}"
        )
    while True:
        trials = [{**place, knob: i} for knob, top in place.items() for i in range(top)]
        allowed = [t for t in trials if total(t) <= MARGIN * wanted and seconds(t) < seconds(place)]
        if not allowed:
            break
        place = max(allowed, key=lambda t: (1 - seconds(t) / seconds(place)) / max(total(t) - total(place), 1e-9))
    return Choice(tuple(ladders[k][i] for k, i in place.items()), total(place), seconds(place))


def _usable(rows: Sequence[Row]) -> list[Row]:
    """Settings of a knob that may be chosen, from coarse to fine; none of a knob that is another model."""
    return [row for row in rows if row.tunable and row.outcome == CONVERGED]


def error_of(rows: Sequence[Row], place: int, quantity: str) -> float:
    """Error of a setting; a reference is off by what a first-order knob leaves of the error of the setting before it.

    A reference without a size, such as located transitions, is exact.
    """
    row = rows[place]
    if not row.reference:
        return abs(row.errors[quantity] or 0.0)
    if not place or not np.isfinite(row.size):
        return 0.0
    return abs(rows[place - 1].errors[quantity] or 0.0) * max(rows[place - 1].size, 0.0) / row.size


def advice(trade: Trade, wanted: float = 0.01) -> list[str]:
    """One line for each quantity that the scene has: what to use for a wanted error, and what it takes."""
    lines = []
    for quantity, name in zip(QUANTITIES, NAMES, strict=True):
        if not any(row.errors[quantity] is not None for row in trade.rows):
            continue
        try:
            found = choose(trade, wanted, [quantity])
        except ValueError as refusal:
            lines.append(f"for {wanted:.3g} on {name}: {refusal}")
            continue
        settings = ", ".join(row.setting for row in found.rows)
        lines.append(f"for {100 * wanted:.3g} % on {name} use {settings}: {found.seconds:.2g} s")
    return lines


def table_of(file: SceneFile, path: Path | None = None) -> Trade:
    """The trade of a scene: of `path`, or results/NAME/trade.json, or the one that comes with the program.

    Raises  ValueError where there is none, or where it was measured on another scene
    """
    here = Path("results") / file.name / "trade.json"
    places = [path] if path is not None else [p for p in (here, TRADES / f"{file.name}.json") if p.is_file()]
    for place in places:
        trade = load(place)
        if trade.key == key_of(file.name, file.scene):
            return trade
    if places:
        raise ValueError(
            f"the trade in {places[0]} was measured on another scene than this {file.name}: measure it again with "
            f"tribodyn trade {file.name} and the same --set"
        )
    raise ValueError(f"no trade was measured for {file.name}: measure it with tribodyn trade {file.name}")


def tuned(name: str, overrides: Sequence[str], wanted: float, path: Path | None = None) -> tuple[SceneFile, Choice]:
    """The scene with the cheapest settings that promise a relative error, and the choice."""
    choice = choose(table_of(read(name, overrides), path), wanted)
    return read(name, (*overrides, *choice.overrides)), choice
