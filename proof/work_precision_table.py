"""What work and precision of the motion come to: a table, a picture and a file."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from proof.work_precision import (
    FOUND,
    IN_TIME,
    LIFE,
    LOCATED,
    SAMPLED,
    Candidate,
    WorkPrecision,
)
from tribodyn.workflows.errors.limit import Limit
from tribodyn.workflows.pictures.figures import axes_of, log_axis, named
from tribodyn.workflows.pictures.style import BLUE, GREEN, GREY, ORANGE
from tribodyn.workflows.result.store import replacing
from tribodyn.workflows.result.summary import plain

FORMAT = "tribodyn work and precision 1"
SETTLED = 0.01  # doubt about a limit above which this is said not to be known
FLOOR = 1e-7  # relative errors below this are drawn here
LOOKS = {LOCATED: (BLUE, "o-"), SAMPLED: (GREEN, "s--"), IN_TIME: (ORANGE, "^-"), LIFE: (BLUE, "o-")}
UNITS = {"energy": "J", "amplitude": "m", "preload": "N", LIFE: "cycles"}
TITLES = {"energy": "friction work per cycle", "amplitude": "amplitude", "preload": "mean normal force", LIFE: "life"}


def save(found: WorkPrecision, path: Path) -> None:
    """Write all candidates as JSON."""
    with replacing(path) as new:
        new.write_text(json.dumps({"format": FORMAT, **plain(asdict(found))}, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> WorkPrecision:
    """Read what `save` wrote; raises ValueError for anything else."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        said = None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise ValueError(f'"{path}" holds no work and precision of this version: give --out another name')
    rows = tuple(Candidate(**row) for row in said["rows"])
    own = {f.name: said[f.name] for f in fields(WorkPrecision)}
    return WorkPrecision(**own | {"rows": rows, "overrides": tuple(said["overrides"]), "names": tuple(said["names"])})


def as_records(found: WorkPrecision) -> list[dict[str, Any]]:
    """The candidates for JSON, with their errors."""
    names = (*found.names, LIFE)
    return [
        asdict(row) | {"scene": found.scene, "errors": {n: found.error(row, n) for n in names if n in row.values}}
        for row in found.rows
    ]


def as_text(found: WorkPrecision) -> str:
    """The table for people, with the limits that the errors are relative to."""
    lines = [f"{'':20} {'harmonics, steps':>16} {'seconds':>8}" + "".join(f"{n:>13} {'error':>9}" for n in found.names)]
    for row in found.rows:
        names = (LIFE,) if row.kind == LIFE else found.names
        size = f"{row.size}" if row.kind == IN_TIME else f"0 to {row.size}"
        cells = "".join(f"{row.values[n]:13.6g} {_percent(found.error(row, n))}" for n in names if n in row.values)
        end = "" if row.outcome == FOUND else f"  {row.outcome}"
        lines.append(f"{row.kind:20} {size:>16} {row.seconds:8.3g}{cells}{end}")
    lines.append(f"{found.scene} at {found.place:.6g} Hz with {'; '.join(found.overrides) or 'nothing changed'}")
    return "\n".join([*lines, *_limits(found)])


def _percent(error: float | None) -> str:
    return "" if error is None else f"{100 * error:8.3f} %"


def _limits(found: WorkPrecision) -> list[str]:
    """Sentences about where the candidates tend to."""
    lines = []
    for name in (*found.names, LIFE):
        ours, theirs = found.reference(name), found.limit(IN_TIME, name)
        if ours is None:
            continue
        told = f"{TITLES[name]}: limit of the harmonics {_told(ours, name)}"
        if ours.doubt > SETTLED:
            told += f", not settled to {100 * SETTLED:g} %"
        if theirs is not None:
            told += f", of the time steps {_told(theirs, name)}: {100 * (theirs.value / ours.value - 1):+.3f} %"
        elif name != LIFE:
            told += "; time integration has found no periodic motion"
        lines.append(told)
    return lines


def _told(limit: Limit, name: str) -> str:
    return f"{limit.value:.6g} {UNITS[name]} (doubt {100 * limit.doubt:.2g} %)"


def picture(found: WorkPrecision) -> Figure:
    """Error against seconds of the two quantities that tell most, every candidate a curve with its sizes.

    A dotted line is the doubt about the limit, which is in every error
    """
    with axes_of(10.0, 4.2, columns=2) as (figure, panes):
        for pane, name in zip(panes, found.drawn, strict=True):
            limit = found.reference(name)
            doubt = 0.0 if limit is None or not np.isfinite(limit.doubt) else limit.doubt
            for kind, (colour, look) in LOOKS.items():
                if rows := [row for row in found.of(kind) if name in row.values]:
                    error = [max(abs(found.error(row, name) or 0.0) + doubt, FLOOR) for row in rows]
                    pane.plot([row.seconds for row in rows], error, look, color=colour, label=kind, markersize=5)
                    for row, height in zip(rows, error, strict=True):
                        at, beside = (row.seconds, height), (-4, -10) if kind == SAMPLED else (4, 3)
                        pane.annotate(f"{row.size}", at, beside, textcoords="offset points", fontsize=8, color=colour)
            seconds = [row.seconds for row in found.rows if name in row.values]
            log_axis(pane.xaxis, min(seconds, default=0.0), max(seconds, default=0.0))
            notes = [f"not settled: the limit is known to {100 * doubt:.0f} % only"] if doubt > SETTLED else []
            pane.set(yscale="log", xlabel="\n".join(["seconds of one processor", *notes, *_missing(found, name)]))
            pane.set_title(named(found.scene, TITLES[name]))
            pane.axhline(max(doubt, FLOOR), color=GREY, linestyle=":", linewidth=1)
        panes[0].set_ylabel("relative error, with the doubt about the limit in it")
        panes[0].legend(loc="best", fontsize=9)
    return figure


def _missing(found: WorkPrecision, name: str) -> list[str]:
    """Candidates of a panel without an answer, one line for each kind."""
    lines = []
    for kind in LOOKS:
        sizes = [row.size for row in found.of(kind) if name not in row.values and (kind == LIFE) == (name == LIFE)]
        if sizes:
            unit = "steps" if kind == IN_TIME else "harmonics"
            lines.append(f"no {kind if kind == LIFE else f'motion by {kind}'} with {', '.join(map(str, sizes))} {unit}")
    return lines
