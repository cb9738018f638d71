"""The trade of a scene: every setting of every knob against the finest of that knob, with what it costs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from hbm.branch import CONVERGED
from workflows import scene_file
from workflows.knobs import Knob, Setting, chosen, knobs_of, study_of
from workflows.measure import Measured, measure
from workflows.trade_table import NAMES, QUANTITIES, Row, Trade, key_of, plain

BASE = "base"


def run(
    scene: str, names: Sequence[str], overrides: Sequence[str], say: Callable[[str], None], most: int = 99
) -> Trade:
    """Measure knobs of a scene, all that it has where none is named.

    overrides : of the scene, on top of its study's base; most : settings of each knob, the reference included
    Raises  ValueError for a knob that the scene does not have
    """
    name = scene_file.find(scene).stem
    study = study_of(name)
    base = (*study.base, *overrides)
    file = scene_file.read(scene, base)
    knobs = chosen(knobs_of(file, study), names)
    once = measure(file)
    say(f"{BASE}: {once.seconds:.1f} s, {once.outcome}")
    rows: list[Row] = []
    for knob in knobs:
        rows += _rows_of(scene, knob, knob.settings[-most:], base, say)
    return Trade(file.name, key_of(name, scene_file.read(scene, overrides).scene), base, once.seconds, tuple(rows))


def _rows_of(
    scene: str, knob: Knob, settings: Sequence[Setting], base: tuple[str, ...], say: Callable[[str], None]
) -> list[Row]:
    found: list[tuple[Setting, Measured]] = []
    for setting in settings:
        file = scene_file.read(scene, (*base, *setting.overrides))
        try:
            measured = measure(file, knob.wears, knob.refined)
        except ValueError as refusal:  # such as more interface modes than there are contact DOFs
            say(f"{knob.name}: {setting.label}: left out: {refusal}")
            continue
        say(f"{knob.name}: {setting.label}: {measured.seconds:.1f} s, {measured.outcome}")
        found.append((setting, measured))
    if not found:
        return []
    reference = found[-1][1].values
    return [
        Row(
            knob=knob.name,
            setting=setting.label,
            size=setting.size,
            overrides=setting.overrides,
            values=measured.values,
            errors={name: _relative(measured.values[name], reference[name]) for name in QUANTITIES},
            seconds=measured.seconds,
            memory=measured.memory,
            outcome=measured.outcome,
            reference=setting is found[-1][0],
            tunable=knob.tunable,
        )
        for setting, measured in found
    ]


def _relative(value: float | None, reference: float | None) -> float | None:
    return None if value is None or not reference else value / reference - 1


def as_records(trade: Trade) -> list[dict[str, Any]]:
    """The rows for JSON, with the observed orders of their knob."""
    orders = {knob: {name: trade.order(knob, name) for name in QUANTITIES} for knob in trade.knobs}
    return [{**plain(asdict(row)), "scene": trade.scene, "order": orders[row.knob]} for row in trade.rows]


def as_text(trade: Trade) -> str:
    """The table for people: errors in per cent of the reference of each knob."""
    lines = [f"{'knob':15} {'setting':46} {'seconds':>7} {'MB':>6} " + " ".join(f"{name:>14}" for name in NAMES)]
    for knob in trade.knobs:
        for row in trade.of(knob):
            cells = [_cell(row, name) for name in QUANTITIES]
            head = f"{knob:15} {row.setting[:46]:46} {row.seconds:7.2f} {row.memory / 1e6:6.0f} "
            lines.append(head + " ".join(f"{cell:>14}" for cell in cells) + _failure(row))
        orders = [trade.order(knob, name) for name in QUANTITIES]
        if any(order is not None for order in orders):
            cells = ["" if order is None else f"order {order:.1f}" for order in orders]
            lines.append(f"{knob:15} {'':46} {'':7} {'':6} " + " ".join(f"{cell:>14}" for cell in cells))
    lines.append(f"every knob alone on {trade.scene} with {'; '.join(trade.base) or 'nothing changed'}")
    return "\n".join(lines)


def _cell(row: Row, quantity: str) -> str:
    value, error = row.values[quantity], row.errors[quantity]
    if value is None:
        return ""
    return f"{value:.6g}" if row.reference or error is None else f"{100 * error:+.3g} %"


def _failure(row: Row) -> str:
    return "" if row.outcome == CONVERGED else f"  {row.outcome}"
