"""From a wanted accuracy to the cheapest settings that meet it, by the trade that was measured on the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.workflows.errors.trade_table import ANSWERED, NAMES, QUANTITIES, Trade, TradeRow

OF_WEAR = ("depth_m", "life_cycles")
WANTED = tuple(float(10**-power) for power in np.arange(0.5, 5, 0.125))  # errors of the Pareto front
WORTH = 0.1  # of the time that a coarser setting must save: the clock is no better, and coarse ones are less robust
MARGIN = 0.7  # of the wanted error that the knobs together may use up: they were measured one by one


class Refused(ValueError):
    """An accuracy that cannot be promised; quantity : that is known worst."""

    def __init__(self, sentence: str, quantity: str):
        super().__init__(sentence)
        self.quantity = quantity


@dataclass(frozen=True)
class Choice:
    """One row for each knob; errors : by quantity, the sum over the knobs; seconds : to expect.

    given : knobs left out; missed : why some quantities are not promised, if there are any
    """

    rows: tuple[TradeRow, ...]
    errors: dict[str, float]
    seconds: float
    given: tuple[str, ...] = ()
    missed: str = ""

    @property
    def error(self) -> float:
        """Of the worst quantity."""
        return max(self.errors.values(), default=0.0)

    @property
    def overrides(self) -> tuple[str, ...]:
        """Overrides of the scene that set every knob."""
        return tuple(text for row in self.rows for text in row.overrides)

    @property
    def sentence(self) -> str:
        """What is promised and by which settings."""
        settings = ", ".join(row.setting for row in self.rows)
        errors = ", ".join(f"{_name(quantity)} {error:.1e}" for quantity, error in self.errors.items())
        left = f"; the error by {', '.join(self.given)} is not counted" if self.given else ""
        sure = (
            f"settings {settings}: expected error {errors}{left}; about {self.seconds:.2g} s of one processor "
            "for model, response and wear, stability and error budget apart"
        )
        return f"{sure}; nothing else is promised: {self.missed}" if self.missed else sure


def choose(trade: Trade, wanted: float, quantities: Sequence[str] = QUANTITIES, given: Sequence[str] = ()) -> Choice:
    """The cheapest settings whose errors add up to less than the wanted one, in every quantity.

    wanted : relative error, above 0; quantities : that matter, out of trade_table.QUANTITIES
    given : knobs that stay as the scene has them and whose error is not counted
    Errors of different knobs are added without their signs; times are taken to multiply, each over the base's. From
    the most accurate settings each step coarsens the knob that saves most time for the error it adds.
    Raises  Refused where even the most accurate settings do not meet it
    """
    asked = [q for q in quantities if any(row.values[q] is not None for row in trade.rows)]
    if not asked:
        raise ValueError(f"the trade of {trade.scene} has no {' or '.join(map(_name, quantities))}")
    unknown = [knob for knob in given if knob not in trade.knobs]
    if unknown:
        raise ValueError(f'the trade of {trade.scene} has no knob "{unknown[0]}", but {", ".join(trade.knobs)}')
    ladders = {k: rows for k in trade.knobs if k not in given and (rows := _usable(trade.of(k), asked))}

    def errors(places: dict[str, int]) -> dict[str, float]:
        return {q: sum(error_of(ladders[k], i, q) for k, i in places.items()) for q in asked}

    def total(places: dict[str, int]) -> float:
        return max(errors(places).values())

    def seconds(places: dict[str, int]) -> float:
        return trade.base_seconds * float(np.prod([ladders[k][i].share for k, i in places.items()]))

    def worst(rows: Sequence[TradeRow], place: int) -> float:
        return max(error_of(rows, place, q) for q in asked)

    place = {k: min(range(len(rows)), key=lambda i, rows=rows: worst(rows, i)) for k, rows in ladders.items()}  # type: ignore[misc]
    if not total(place) <= MARGIN * wanted:
        raise _refusal(trade.scene, wanted, errors(place), ladders, place)
    while True:
        trials = [{**place, knob: i} for knob, rows in ladders.items() for i in range(len(rows)) if i != place[knob]]
        allowed = [t for t in trials if total(t) <= MARGIN * wanted and seconds(t) < (1 - WORTH) * seconds(place)]
        if not allowed:
            break
        place = max(allowed, key=lambda t: (1 - seconds(t) / seconds(place)) / max(total(t) - total(place), 1e-9))
    return Choice(tuple(ladders[k][i] for k, i in place.items()), errors(place), seconds(place), tuple(given))


def _refusal(
    scene: str, wanted: float, errors: dict[str, float], ladders: dict[str, list[TradeRow]], place: dict[str, int]
) -> Refused:
    """Which knob is to blame for which quantity."""
    quantity = max(errors, key=lambda q: errors[q])
    shares = {knob: error_of(ladders[knob], i, quantity) for knob, i in place.items()}
    knob = max(shares, key=lambda k: shares[k])
    met = [_name(q) for q, error in errors.items() if error <= MARGIN * wanted]
    least = f"{errors[quantity] / MARGIN:.2g}" if np.isfinite(errors[quantity]) else "no number"
    instead = f', or ask for --accuracy "{100 * wanted:.3g} % of {", ".join(met)}"' if met else ""
    if max(error - error_of(ladders[knob], place[knob], q) for q, error in errors.items()) <= MARGIN * wanted:
        instead += f', or add "given {knob}" to leave it as the scene has it and its error out'
    sentence = (
        f"an accuracy of {wanted:.3g} is more than the trade of {scene} can promise: {_name(quantity)} is known to "
        f"{least}, of which {ladders[knob][place[knob]].setting} of knob {knob} leaves {shares[knob]:.2g}; "
        f"give that knob finer settings in the study of {scene} and measure them with tribodyn trade"
        f"{instead}"
    )
    return Refused(sentence, quantity)


def _name(quantity: str) -> str:
    return NAMES[QUANTITIES.index(quantity)]


def _usable(rows: Sequence[TradeRow], asked: Sequence[str]) -> list[TradeRow]:
    """Settings of a knob for which all was measured that is asked and that the knob has a say in.

    None of a knob that is another model, or that has no say in anything that is asked.
    """
    quantities = {_judged_by(rows, quantity) for quantity in asked}
    said = [q for q in quantities if any(row.values[q] is not None for row in rows)]
    good = [row for row in rows if row.tunable and row.outcome == ANSWERED]
    return [row for row in good if all(row.values[q] is not None for q in said)] if said else []


def _judged_by(rows: Sequence[TradeRow], quantity: str) -> str:
    """The quantity itself; of depth and life of a knob that was not worn its energy, as life goes with the work."""
    if quantity in OF_WEAR and all(row.values[quantity] is None for row in rows):
        return "energy_J"
    return quantity


def error_of(rows: Sequence[TradeRow], place: int, quantity: str) -> float:
    """Error of a setting, with what is doubtful about the limit of its knob; 0 where the knob has no say in it.

    A knob whose settings were not worn is judged by its energy: life is in proportion to the work per cycle.
    """
    quantity = _judged_by(rows, quantity)
    if all(row.values[quantity] is None for row in rows):
        return 0.0
    error, doubt = rows[place].errors[quantity], rows[place].doubts[quantity]
    return float("inf") if error is None or doubt is None else abs(error) + doubt


def front(trade: Trade, quantity: str) -> list[Choice]:
    """The cheapest settings for smaller and smaller errors in a quantity, as far as the trade can promise them."""
    found: list[Choice] = []
    for wanted in WANTED:
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
