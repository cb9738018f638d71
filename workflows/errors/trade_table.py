"""The table of a trade: what each setting of each knob costs and how far it is off, kept in a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.errors.knobs import study_of
from tribodyn.workflows.errors.limit import limit_of
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.result.whole_file import replacing
from tribodyn.workflows.scene.content import code, digests
from tribodyn.workflows.scene.scene_file import SceneFile, first_difference

FORMAT = "tribodyn trade 2"
KEY_VERSION = 2  # of the defaults and meanings of the schema that keys of tables rest on
ANSWERED = "converged"  # in tables: every answer that was asked for is there
QUANTITIES = ("peak_hz", "peak_m", "energy_J", "preload_N", "depth_m", "life_cycles")
NAMES = ("peak frequency", "amplitude", "energy", "preload", "depth", "life")


@dataclass(frozen=True)
class TradeRow:
    """One setting of a knob.

    size : of the setting, larger is finer, nan where it is exact; overrides : of the scene
    values : by QUANTITIES in SI units, None where there is none
    errors : relative to where the knob's values tend to; doubts : how far off that limit itself may be
    seconds : of one processor; share : of the seconds of the base, asked for the same answers
    memory : largest of the process [bytes]; outcome : ANSWERED, or why answers are missing
    """

    knob: str
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

    @property
    def worst(self) -> float:
        """Largest relative error of all quantities; inf where the setting failed."""
        known = [abs(error) for error in self.errors.values() if error is not None]
        return max(known, default=0.0) if self.outcome == ANSWERED else float("inf")


@dataclass(frozen=True)
class Trade:
    """All rows of a scene.

    scene : name; key : of the scene and its study, so that a table of another scene is told; base : overrides under
    which all was measured; base_seconds : of the scene with them
    says : what the key is made of; files : digests of the files that the scene names; code : digest of what computes
    """

    scene: str
    key: str
    base: tuple[str, ...]
    base_seconds: float
    rows: tuple[TradeRow, ...]
    says: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    code: str = ""

    @classmethod
    def begun(cls, file: SceneFile, base: tuple[str, ...], base_seconds: float) -> Trade:
        """The table of a scene before anything is measured."""
        files = digests(file.scene.model_dump(mode="json"), file.folder)
        return cls(file.name, key_of(file), base, base_seconds, (), said_by(file), files, code())

    def changed(self, file: SceneFile, shipped: bool = False) -> str:
        """What is not as it was when the table was measured: of the scene, its files or the program; "" where all is.

        shipped : with the program, whose tests measure some of its rows anew: the code is not compared
        """
        if self.key != key_of(file):
            what = first_difference(self.says, said_by(file)) if self.says else ""
            return f"on another scene than this {file.name}" + (f", {what} differs" if what else "")
        now = digests(file.scene.model_dump(mode="json"), file.folder)
        for name in sorted(self.files.keys() | now.keys()):
            if self.files.get(name) != now.get(name):
                return f"with another content of {name}"
        if not shipped and self.code != code():
            return "by another version of the program"
        return ""

    @property
    def knobs(self) -> tuple[str, ...]:
        """Names of the knobs, in order."""
        return tuple(dict.fromkeys(row.knob for row in self.rows))

    def of(self, knob: str) -> tuple[TradeRow, ...]:
        """Rows of a knob, the finest last."""
        return tuple(row for row in self.rows if row.knob == knob)

    def order(self, knob: str, quantity: str) -> float | None:
        """Observed order of convergence of the finest settings; None where they are too few or do not settle."""
        known = known_of(self.of(knob), quantity)
        order = limit_of(*zip(*known, strict=True)).order if known else float("nan")
        return order if np.isfinite(order) else None


def known_of(rows: Iterable[TradeRow], quantity: str) -> list[tuple[float, float]]:
    """Size and value of the rows that say a quantity, from coarse to fine."""
    return [
        (row.size, value) for row in rows if row.outcome == ANSWERED and (value := row.values[quantity]) is not None
    ]


def key_of(file: SceneFile) -> str:
    """A short name of everything in a scene that its trade depends on; the knobs themselves are not among it."""
    told = json.dumps(said_by(file), sort_keys=True)
    return f"{KEY_VERSION}-{hashlib.sha256(told.encode()).hexdigest()[:16]}"


def said_by(file: SceneFile) -> dict[str, Any]:
    """What a scene says other than by default, but for the knobs.

    A key of the schema that comes later leaves the keys of older tables as they are. Where a default changes its value
    or a key its meaning, KEY_VERSION goes up.
    """
    said: dict[str, Any] = file.scene.model_dump(
        mode="json", exclude_defaults=True, exclude={"scene": True, "pictures": True, "solver": True, "verdict": True}
    )
    own = {text.partition("=")[0] for k in study_of(file).knobs for s in k.settings for text in s.overrides}
    for key in {*KNOB_KEYS, *own}:
        section, _, last = key.partition(".")
        if getattr(file.scene, section, None) is None:
            continue
        table = said.setdefault(section, {})  # a table with knobs alone is the same as one at its defaults
        for place in (table, table.get("parameters")):
            if isinstance(place, dict):
                place.pop(last, None)
    return said


# set by knobs that any scene may have, so that they do not make another scene
KNOB_KEYS = (
    *(f"reduction.{key}" for key in ("modes", "cutoff", "interface_modes", "interface_keep")),
    *(f"harmonics.{key}" for key in ("kept", "samples", "transitions", "tolerance", "highest")),
    *(f"wear.{key}" for key in ("rule", "step", "tolerance", "max_steps")),
    "response.points",
    "response.options",
)


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
        raise ValueError(f'there is no trade table "{path}": make one with tribodyn trade SCENE --out {path}') from None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise ValueError(f'"{path}" is no trade table of this version: make it again with tribodyn trade SCENE')
    rows = [
        TradeRow(
            **{f.name: row[f.name] for f in fields(TradeRow)}
            | {"overrides": tuple(row["overrides"]), "size": _size(row)}
        )
        for row in said["rows"]
    ]
    since = {name: said[name] for name in ("says", "files", "code") if name in said}
    return Trade(said["scene"], said["key"], tuple(said["base"]), said["base_seconds"], tuple(rows), **since)


def _size(row: dict[str, Any]) -> float:
    return float("nan") if row["size"] is None else float(row["size"])
