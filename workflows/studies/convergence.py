"""Convergence with the settings of a scene: how far each is from where its answers tend to, and what it costs.

The limit is Richardson's, a power of the size fitted to the three finest settings, where they settle. Contact forces
have kinks where the contact begins to slip and to lift, and it is chance where these lie between the nodes: answers
scatter with the grid. A ladder may have each grid with its nodes placed otherwise too, as settings of the same size."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import fspath
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.quantity import names_with_error, quantity_named
from tribodyn.refusal import Refusal
from tribodyn.workflows.errors.ladder_table import SOLVED, LadderRow, LadderTable, LadderTables, measure_ladders
from tribodyn.workflows.errors.ladders import SPRINGS
from tribodyn.workflows.pictures.matplotlib_names import Figure, NullFormatter, mpl
from tribodyn.workflows.pictures.theme import GREY, STYLE
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, override_texts
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

TARGET_ERROR = 0.01
FLOOR = 1e-8  # errors below this are drawn here
MARKERS = "osD^v<>PX*hp"


@dataclass(frozen=True, repr=False)
class Convergence(StudyResult):
    """The settings of a scene, measured."""

    table: LadderTables

    def record(self) -> list[dict[str, Any]]:
        """For machines: one row for each setting, with its errors and what is doubtful about their limits."""
        return [_record(self.table.scene, ladder, row) for ladder in self.table.ladders for row in ladder.rows]

    def lines(self) -> list[str]:
        """For people: tables, limits with their orders, the setting that a wanted accuracy needs."""
        texts = [line for ladder in self.table.ladders for line in _lines(ladder)]
        base = "; ".join(self.table.base) or "nothing changed"
        return [
            *texts,
            "in brackets: error from where the setting tends to, behind ~ the doubt in that",
            f"each setting alone, the others as {self.table.scene} has them with {base}",
        ]

    def plot(self) -> Figure:
        """Error in amplitude, energy and life, as far as there are any, against seconds."""
        table, quantities = self.table, ("amplitude", "energy", "life")
        shown = [q for q in quantities if any(q in ladder.limits for ladder in table.ladders)] or ["amplitude"]
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=(4.2 * len(shown) + 1.6, 4.0), layout="constrained")
            panes = figure.subplots(1, len(shown), squeeze=False)[0]
            colours = mpl.colormaps["tab20"].colors
            for pane, quantity in zip(panes, shown, strict=True):
                for i, ladder in enumerate(table.ladders):
                    points = [
                        (row.solved.seconds, b) for row in ladder.rows if (b := ladder.bound(row, quantity)) is not None
                    ]
                    seconds, errors = zip(*points, strict=True) if points else ((), ())
                    style = {"color": colours[i % 20], "marker": MARKERS[i % len(MARKERS)], "linestyle": "none"}
                    label = ladder.ladder.name.replace("_", " ")
                    pane.plot(seconds, np.maximum(errors, FLOOR), label=label, markersize=5, **style)
                pane.set_xscale("log")  # before its formatter
                pane.axhline(TARGET_ERROR, color=GREY, linestyle=":", linewidth=1)
                pane.xaxis.set_minor_formatter(NullFormatter())
                pane.set(yscale="log", xlabel="seconds of one processor", title=f"{table.scene}: {_name(quantity)}")
            panes[0].set_ylabel("relative error, with the doubt in it")
            handles = panes[0].get_legend_handles_labels()
            panes[-1].legend(*handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        return figure

    def write(self, folder: Path) -> list[Path]:
        """Write a picture of what the settings cost."""
        return write_files(folder, {}, lambda: {f"converge_{self.table.scene}": self.plot()})


def converge(
    scene: AnyPath, *, settings: Sequence[str] = (), most: int = 99, overrides: Overrides = (), progress: Report = None
) -> Convergence:
    """Measure how far each setting of a scene is from where its answers tend to, and what it costs.

    scene : name of a scene or a .toml file, with its own ladders of grids and settings in NAME.study.toml beside it
    settings : ladder to measure, can be repeated. All by default
    most : settings of each ladder, the coarsest ones"""
    if most < 1:
        raise Refusal(f"--most {most}: a ladder needs one setting at least")
    texts, say = override_texts(overrides), reporter(progress).say
    return Convergence(measure_ladders(fspath(scene), settings, texts, say, most))


def _record(scene: str, ladder: LadderTable, row: LadderRow) -> dict[str, Any]:
    measured = row.solved
    return plain(
        {
            "scene": scene, "ladder": ladder.ladder.name, "setting": row.setting.label, "size": row.setting.size,
            "of_the_scene": row.setting.label == ladder.scene_setting, "overrides": list(row.setting.overrides),
            "pairs": measured.pairs,
            "values": measured.values, "errors": {q: ladder.error(row, q) for q in names_with_error()},
            "bounds": {q: ladder.bound(row, q) for q in names_with_error()},
            "orders": {q: limit.order for q, limit in ladder.limits.items()},
            "seconds": measured.seconds, "memory": measured.memory, "outcome": measured.outcome,
            "shares": measured.shares and dict(zip(("open", "stick", "slip"), measured.shares, strict=True)),
        }
    )  # fmt: skip


def _lines(ladder: LadderTable) -> Iterator[str]:
    shown = [q for q in names_with_error() if q in ladder.limits]
    width = max(len(ladder.ladder.name), *(len(row.setting.label) for row in ladder.rows))
    yield _line(ladder.ladder.name.ljust(width), "pairs", "seconds", "MB", [_name(q) for q in shown], "")
    for row in ladder.rows:
        measured = row.solved
        end = "" if measured.outcome == SOLVED else f"  {measured.outcome}"
        if measured.shares is not None and ladder.ladder.name == SPRINGS:
            end += "  open {:.3f}, stick {:.3f}, slip {:.3f}".format(*measured.shares)
        cells = [_cell(ladder, row, q) for q in shown]
        numbers = str(measured.pairs), f"{measured.seconds:.2f}", f"{measured.memory / 1e6:.0f}"
        yield _line(row.setting.label.ljust(width), *numbers, cells, end)
    limits = [f"{ladder.limits[q].value:.5g} ({_order(ladder.limits[q].order)})" for q in shown]
    yield _line("limit".ljust(width), "", "", "", limits, "")
    for q in shown:
        enough = ladder.coarsest(q, TARGET_ERROR)
        needed = "a finer setting than these" if enough is None else f"{enough.setting.label} or finer"
        yield f"{TARGET_ERROR:.0%} on {_name(q)} needs {needed}; the limit is known to {ladder.limits[q].doubt:.2g}"
    for row in ladder.rows:
        if row.setting.label == ladder.scene_setting and shown:
            bounds = {q: b for q in shown if (b := ladder.bound(row, q)) is not None}
            missed = [_name(q) for q, b in bounds.items() if b > TARGET_ERROR]
            verdict = (
                f"misses {TARGET_ERROR:.0%} on {', '.join(missed)}"
                if missed
                else f"is good for {TARGET_ERROR:.0%} on all"
            )
            errors = ", ".join(f"{_name(q)} {b:.2g}" for q, b in bounds.items())
            yield f"the setting of the scene, {ladder.scene_setting}, {verdict}: {errors}"


def _line(setting: str, pairs: str, seconds: str, memory: str, cells: Sequence[str], end: str) -> str:
    return f"{setting} {pairs:>6} {seconds:>8} {memory:>6} " + " ".join(f"{cell:>24}" for cell in cells) + end


def _name(quantity: str) -> str:
    return quantity_named(quantity).label


def _cell(ladder: LadderTable, row: LadderRow, quantity: str) -> str:
    value, error = row.solved.values[quantity], ladder.error(row, quantity)
    if value is None or error is None:
        return ""
    doubt = ladder.limits[quantity].doubt
    return f"{value:.5g} ({100 * error:+.2g}{f' ~{100 * doubt:.2g}' if doubt else ''} %)"


def _order(order: float) -> str:
    return "scattered" if np.isnan(order) else f"order {order:.1f}"
