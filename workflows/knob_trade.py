"""The trade of a scene: every setting of every knob against the finest of that knob, with what it costs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from hbm.branch import CONVERGED
from workflows import scene_file
from workflows.knobs import Knob, Setting, chosen, knobs_of, study_of
from workflows.measure import NAMES, QUANTITIES, Measured, measure
from workflows.scene import Scene

FORMAT = "tribodyn trade 1"
TRADES = Path(__file__).parent / "trades"
BASE = "base"
ROUNDING = 1e-9  # relative difference below which no order can be told


@dataclass(frozen=True)
class Row:
    """One setting of a knob.

    size : of the setting, larger is finer, nan without a measure; overrides : of the scene
    values : by measure.QUANTITIES in SI units, None where there is none; errors : relative to the knob's reference
    seconds : of one processor; memory : largest of the process [bytes]; outcome : "converged" or a sentence
    reference : whether this is the setting that the others are held against
    """

    knob: str
    setting: str
    size: float
    overrides: tuple[str, ...]
    values: dict[str, float | None]
    errors: dict[str, float | None]
    seconds: float
    memory: float
    outcome: str
    reference: bool
    tunable: bool

    @property
    def worst(self) -> float:
        """Largest relative error of all quantities; inf where the setting failed."""
        known = [abs(error) for error in self.errors.values() if error is not None]
        return max(known, default=0.0) if self.outcome == CONVERGED else float("inf")


@dataclass(frozen=True)
class Trade:
    """All rows of a scene.

    scene : name; key : of the scene and its study, so that a table of another scene is told; base : overrides under
    which all was measured; base_seconds : of the scene with them
    """

    scene: str
    key: str
    base: tuple[str, ...]
    base_seconds: float
    rows: tuple[Row, ...]

    @property
    def knobs(self) -> tuple[str, ...]:
        """Names of the knobs, in order."""
        return tuple(dict.fromkeys(row.knob for row in self.rows))

    def of(self, knob: str) -> tuple[Row, ...]:
        """Rows of a knob, the reference last."""
        return tuple(row for row in self.rows if row.knob == knob)

    def order(self, knob: str, quantity: str) -> float | None:
        """Observed order: minus the slope of log error over log size; None where errors are too few or rounding."""
        points = [(row.size, abs(row.errors[quantity] or 0.0)) for row in self.of(knob) if not row.reference]
        usable = [(size, error) for size, error in points if np.isfinite(size) and size > 0 and error > ROUNDING]
        if len(usable) < 2:
            return None
        size, error = np.log(np.array(usable)).T
        return float(-np.polyfit(size, error, 1)[0])


def run(
    scene: str, names: Sequence[str], overrides: Sequence[str], say: Callable[[str], None], most: int = 99
) -> Trade:
    """Measure knobs of a scene, all that it has where none is named.

    overrides : of the scene, on top of its study's base; most : settings of each knob, the reference included
    Raises  ValueError for a knob that the scene does not have
    """
    study = study_of(scene_file.find(scene).stem)
    base = (*study.base, *overrides)
    file = scene_file.read(scene, base)
    knobs = chosen(knobs_of(file, study), names)
    once = measure(file)
    say(f"{BASE}: {once.seconds:.1f} s, {once.outcome}")
    rows: list[Row] = []
    for knob in knobs:
        rows += _rows_of(scene, knob, knob.settings[-most:], base, say)
    return Trade(file.name, key_of(scene_file.read(scene, overrides).scene), base, once.seconds, tuple(rows))


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


def key_of(scene: Scene) -> str:
    """A short name of everything in a scene that its trade depends on; the knobs themselves are not among it."""
    said = scene.model_dump(mode="json", exclude={"scene": True, "pictures": True, "solver": True})
    for section, keys in KNOB_KEYS.items():
        for key in keys:
            if isinstance(said.get(section), dict):
                said[section].pop(key, None)
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:16]


KNOB_KEYS = {  # set by generic knobs, so that they do not make another scene
    "reduction": ("modes", "interface_modes", "interface_keep"),
    "harmonics": ("kept", "samples", "transitions", "tolerance", "highest"),
    "response": ("points",),
    "wear": ("rule", "step", "tolerance", "max_steps"),
}


def pareto(rows: Iterable[Row], quantity: str) -> list[Row]:
    """Rows that no other row beats in both seconds and error, the fastest first."""
    front: list[Row] = []
    best = float("inf")
    for row in sorted((r for r in rows if r.errors.get(quantity) is not None), key=lambda r: r.seconds):
        error = abs(row.errors[quantity] or 0.0)
        if error < best:
            front.append(row)
            best = error
    return front


def save(trade: Trade, path: Path) -> None:
    """Write a trade as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"format": FORMAT, **_plain(asdict(trade))}, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> Trade:
    """Read what `save` wrote; raises ValueError for anything else."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise ValueError(f'there is no trade table "{path}": make one with tribodyn trade SCENE --out {path}') from None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise ValueError(f'"{path}" is no trade table of this version: make it again with tribodyn trade SCENE')
    rows = [
        Row(**{f.name: row[f.name] for f in fields(Row)} | {"overrides": tuple(row["overrides"]), "size": _size(row)})
        for row in said["rows"]
    ]
    return Trade(said["scene"], said["key"], tuple(said["base"]), said["base_seconds"], tuple(rows))


def _size(row: dict[str, Any]) -> float:
    return float("nan") if row["size"] is None else float(row["size"])


def _plain(value: Any) -> Any:
    """JSON has no nan."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def as_records(trade: Trade) -> list[dict[str, Any]]:
    """The rows for JSON, with the observed orders of their knob."""
    orders = {knob: {name: trade.order(knob, name) for name in QUANTITIES} for knob in trade.knobs}
    return [{**_plain(asdict(row)), "scene": trade.scene, "order": orders[row.knob]} for row in trade.rows]


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
