"""The cheapest settings that meet an error, by the trade that was measured on the scene; the Pareto front of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.workflows.errors.trade_table import ANSWERED, NAMES, QUANTITIES, Trade, TradeRow

OF_WEAR = ("depth_m", "life_cycles")


@dataclass(frozen=True)
class Rules:
    """How settings are chosen.

    wanted : errors of the Pareto front; worth : of the time that a coarser setting must save, since no clock is better
    margin : of the wanted error that all parameters together may use up: they were measured one by one
    """

    wanted: tuple[float, ...] = tuple(float(10**-power) for power in np.arange(0.5, 5, 0.125))
    worth: float = 0.1
    margin: float = 0.7


RULES = Rules()


@dataclass(frozen=True)
class Choice:
    """One row for each parameter; errors : by quantity, the sum over the parameters; seconds : to expect."""

    rows: tuple[TradeRow, ...]
    errors: dict[str, float]
    seconds: float

    @property
    def error(self) -> float:
        """Of the worst quantity."""
        return max(self.errors.values(), default=0.0)


def choose(trade: Trade, wanted: float, quantities: Sequence[str] = QUANTITIES) -> Choice:
    """The cheapest settings whose errors add up to less than the wanted one, in every quantity.

    wanted : relative error, above 0; quantities : that matter, out of trade_table.QUANTITIES
    Errors of different parameters are added without their signs; times are taken to multiply, each over the base's.
    From the most accurate settings each step coarsens the parameter that saves most time for the error it adds.
    Raises  ValueError where even the most accurate settings do not meet it
    """
    asked = [q for q in quantities if any(row.values[q] is not None for row in trade.rows)]
    if not asked:
        raise ValueError(f"the trade of {trade.scene} has no {' or '.join(map(_name, quantities))}")
    ladders = {k: rows for k in trade.parameters if (rows := _usable(trade.of(k), asked))}

    def errors(places: dict[str, int]) -> dict[str, float]:
        return {q: sum(error_of(ladders[k], i, q) for k, i in places.items()) for q in asked}

    def total(places: dict[str, int]) -> float:
        return max(errors(places).values())

    def seconds(places: dict[str, int]) -> float:
        return trade.base_seconds * float(np.prod([ladders[k][i].share for k, i in places.items()]))

    def worst(rows: Sequence[TradeRow], place: int) -> float:
        return max(error_of(rows, place, q) for q in asked)

    place = {k: min(range(len(rows)), key=lambda i, rows=rows: worst(rows, i)) for k, rows in ladders.items()}  # type: ignore[misc]
    if not total(place) <= RULES.margin * wanted:
        raise ValueError(_refusal(trade.scene, wanted, errors(place), ladders, place))
    while True:
        trials = [{**place, k: i} for k, rows in ladders.items() for i in range(len(rows)) if i != place[k]]
        cheaper = [t for t in trials if seconds(t) < (1 - RULES.worth) * seconds(place)]
        allowed = [t for t in cheaper if total(t) <= RULES.margin * wanted]
        if not allowed:
            break
        place = max(allowed, key=lambda t: (1 - seconds(t) / seconds(place)) / max(total(t) - total(place), 1e-9))
    return Choice(tuple(ladders[k][i] for k, i in place.items()), errors(place), seconds(place))


def _refusal(
    scene: str, wanted: float, errors: dict[str, float], ladders: dict[str, list[TradeRow]], place: dict[str, int]
) -> str:
    """Which parameter is to blame for which quantity."""
    quantity = max(errors, key=lambda q: errors[q])
    shares = {name: error_of(ladders[name], i, quantity) for name, i in place.items()}
    name = max(shares, key=lambda k: shares[k])
    least = f"{errors[quantity] / RULES.margin:.2g}" if np.isfinite(errors[quantity]) else "no number"
    setting = ladders[name][place[name]].setting
    return (
        f"the trade of {scene} cannot meet an error of {wanted:.3g}: {_name(quantity)} is known to {least}, of which "
        f"{setting} of {name} leaves {shares[name]:.2g}; give it finer settings in the study of {scene}"
    )


def _name(quantity: str) -> str:
    return NAMES[QUANTITIES.index(quantity)]


def _usable(rows: Sequence[TradeRow], asked: Sequence[str]) -> list[TradeRow]:
    """Settings of a parameter for which all was measured that is asked and that it changes.

    None of a parameter that is another model, or that changes nothing of what is asked
    """
    quantities = {_judged_by(rows, quantity) for quantity in asked}
    known = [q for q in quantities if any(row.values[q] is not None for row in rows)]
    good = [row for row in rows if row.tunable and row.outcome == ANSWERED]
    return [row for row in good if all(row.values[q] is not None for q in known)] if known else []


def _judged_by(rows: Sequence[TradeRow], quantity: str) -> str:
    """The quantity itself; of depth and life of a parameter that was not worn its energy: life goes with the work."""
    if quantity in OF_WEAR and all(row.values[quantity] is None for row in rows):
        return "energy_J"
    return quantity


def error_of(rows: Sequence[TradeRow], place: int, quantity: str) -> float:
    """Error of a setting, with what is doubtful about the limit of its parameter; 0 where that changes nothing."""
    quantity = _judged_by(rows, quantity)
    if all(row.values[quantity] is None for row in rows):
        return 0.0
    error, doubt = rows[place].errors[quantity], rows[place].doubts[quantity]
    return float("inf") if error is None or doubt is None else abs(error) + doubt


def front(trade: Trade, quantity: str) -> list[Choice]:
    """The cheapest settings for smaller and smaller errors in a quantity, as far as the trade has them."""
    found: list[Choice] = []
    for wanted in RULES.wanted:
        try:
            choice = choose(trade, wanted, [quantity])
        except ValueError:
            break
        if not found or choice.error < found[-1].error:
            found = [*(c for c in found if c.seconds < choice.seconds), choice]
    return found


def advice(trade: Trade, wanted: float = 0.01) -> list[str]:
    """One line for each quantity that the scene has: what to use for a wanted error, and what it takes."""
    lines = []
    for quantity, name in zip(QUANTITIES, NAMES, strict=True):
        if not any(row.values[quantity] is not None for row in trade.rows):
            continue
        try:
            found = choose(trade, wanted, [quantity])
        except ValueError as refusal:
            lines.append(f"for {100 * wanted:.3g} % on {name}: {refusal}")
            continue
        settings = ", ".join(row.setting for row in found.rows)
        lines.append(f"for {100 * wanted:.3g} % on {name} use {settings}: {found.seconds:.2g} s")
    return lines
