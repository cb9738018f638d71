"""The table of a trade: what each setting of each parameter costs and how far it is off, kept in a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.errors.limit import limit_of
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.result.whole_file import replacing
from tribodyn.workflows.scene.content import code, digests
from tribodyn.workflows.scene.scene_file import SceneFile

FORMAT = "tribodyn trade 3"
ANSWERED = "converged"  # in tables: every answer that was asked for is there
QUANTITIES = ("peak_hz", "peak_m", "energy_J", "preload_N", "depth_m", "life_cycles")
NAMES = ("peak frequency", "amplitude", "energy", "preload", "depth", "life")


@dataclass(frozen=True)
class TradeRow:
    """One setting of a parameter.

    size : of the setting, larger is finer, nan where it is exact; overrides : of the scene
    values : by QUANTITIES in SI units, None where there is none
    errors : relative to where the parameter's values tend to; doubts : how far off that limit itself may be
    seconds : of one processor; share : of the seconds of the base, asked for the same answers
    memory : largest of the process [bytes]; outcome : ANSWERED, or why answers are missing
    """

    parameter: str
    setting: str
    size: float
    overrides: tuple[str, ...]
    values: dict[str, float | None]
    errors: dict[str, float | None]
    doubts: dict[str, float | None]
    seconds: float
    share: float
    memory: float
    outcome: str
    tunable: bool


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
    rows: tuple[TradeRow, ...]

    @classmethod
    def begun(cls, file: SceneFile, base: tuple[str, ...], base_seconds: float) -> Trade:
        """The table of a scene before anything is measured."""
        return cls(file.name, key_of(file), base, base_seconds, ())

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(dict.fromkeys(row.parameter for row in self.rows))

    def of(self, parameter: str) -> tuple[TradeRow, ...]:
        """Rows of a parameter, the finest last."""
        return tuple(row for row in self.rows if row.parameter == parameter)

    def order(self, parameter: str, quantity: str) -> float | None:
        """Observed order of convergence of the finest settings; None where they are too few or do not settle."""
        known = known_of(self.of(parameter), quantity)
        order = limit_of(*zip(*known, strict=True)).order if known else float("nan")
        return order if np.isfinite(order) else None


def known_of(rows: Iterable[TradeRow], quantity: str) -> list[tuple[float, float]]:
    """Size and value of the rows that say a quantity, from coarse to fine."""
    return [
        (row.size, value) for row in rows if row.outcome == ANSWERED and (value := row.values[quantity]) is not None
    ]


def key_of(file: SceneFile) -> str:
    """A short name of everything that a trade depends on: the scene, the files that it names, and the program."""
    scene = file.scene.model_dump(mode="json")
    content = json.dumps([scene, digests(scene, file.folder), code()], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def save(trade: Trade, path: Path) -> None:
    """Write a trade as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as new:
        new.write_text(json.dumps({"format": FORMAT, **plain(asdict(trade))}, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> Trade:
    """Read what `save` wrote; raises ValueError for anything else."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise ValueError(f'there is no trade table "{path}": make one with tribodyn study trade SCENE') from None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise ValueError(f'"{path}" is no trade table of this version: make it again with tribodyn study trade SCENE')
    rows = [
        TradeRow(
            **{f.name: row[f.name] for f in fields(TradeRow)}
            | {"overrides": tuple(row["overrides"]), "size": _size(row)}
        )
        for row in said["rows"]
    ]
    return Trade(said["scene"], said["key"], tuple(said["base"]), said["base_seconds"], tuple(rows))


def _size(row: dict[str, Any]) -> float:
    return float("nan") if row["size"] is None else float(row["size"])
