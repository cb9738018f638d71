"""The scoreboard for people: counts, a table of every quantity of every scene, a histogram."""

import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from proof.unseen_scenes.scoreboard import ROUNDING, Row
from tribodyn.hbm.quantity import names_with_error, quantity_named
from tribodyn.workflows.pictures.theme import BLUE, RED, STYLE

COLUMNS = ("scene", "family", "pairs", "harmonics", "quantity", "value", "stated error", "true error", "dominated by")
SMALLEST, LARGEST = 1e-1, 1e3  # of the ratios that the histogram shows


def overestimates(rows: Sequence[Row], quantity: str | None = None) -> np.ndarray:
    """Stated over true error of every stated error; without those whose true error is rounding."""
    ratios = [
        (statement.error or 0.0) / statement.true
        for row in rows
        for statement in row.judged
        if statement.counted
        and quantity in (None, statement.quantity)
        and statement.true is not None
        and statement.true > ROUNDING
    ]
    return np.array(ratios)


def summary(rows: Sequence[Row]) -> str:
    """Counts of scenes and of stated errors, how many are violated, and by how much they are overestimated."""
    ends = Counter(row.outcome.partition(":")[0] for row in rows)
    families = Counter(row.family for row in rows if any(statement.counted for statement in row.judged))
    lines = [f"{len(rows)} scenes drawn: " + ", ".join(f"{count} {end}" for end, count in ends.most_common())]
    lines.append("with stated errors: " + ", ".join(f"{count} {family}" for family, count in families.items()))
    lines.append(
        f"{'quantity':15} {'errors':>8} {'violated':>8} {'median overestimate':>19} {'not stated':>10} {'not known':>9}"
    )
    for quantity in (*names_with_error(), None):
        of = [s for row in rows for s in row.judged if quantity in (None, s.quantity) and s.value is not None]
        if not of:  # such as stress, which no drawn scene asks for
            continue
        ratios = overestimates(rows, quantity)
        median = f"{np.median(ratios):.2g}" if len(ratios) else "-"
        counts = [sum(statement.counted for statement in of), sum(statement.violated for statement in of)]
        unsaid = [
            sum(not statement.stated for statement in of),
            sum(statement.stated and statement.error is None for statement in of),
        ]
        name = "all" if quantity is None else quantity_named(quantity).label
        lines.append(f"{name:15} {counts[0]:8d} {counts[1]:8d} {median:>19} {unsaid[0]:10d} {unsaid[1]:9d}")
    bounds = [statement for row in rows for statement in row.bound if statement.counted]
    lines.append(f"--accuracy: {len(bounds)} bounds, {sum(statement.violated for statement in bounds)} violated")
    for row, statement in ((r, each) for r in rows for each in (*r.judged, *r.bound) if each.violated):
        name = quantity_named(statement.quantity).label
        lines.append(
            f"violated: {row.family} {row.number}, {name}: stated {statement.error:.2g}, true {statement.true:.2g}"
        )
    return "\n".join(lines)


def write(rows: Sequence[Row], folder: Path) -> None:
    """scoreboard.csv and scoreboard.png into a folder."""
    with (folder / "scoreboard.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for row in rows:
            about = (row.number, row.family, row.n_pair, row.harmonics)
            for s in (statement for statement in row.judged if statement.value is not None):
                error = s.error if s.stated else None
                table.writerow((*about, s.quantity, s.value, error, s.true, s.dominated_by))
    picture(rows).savefig(folder / "scoreboard.png")


def picture(rows: Sequence[Row]) -> Figure:
    """Histogram of stated over true error: left of one an error is violated."""
    ratios = np.clip(overestimates(rows), SMALLEST, LARGEST)
    bins = np.geomspace(SMALLEST, LARGEST, 25)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.4), layout="constrained")
        axes = figure.add_subplot()
        counts, edges = np.histogram(ratios, bins)[0], bins[:-1]
        colours = np.where(edges < 1 - 1e-9, RED, BLUE).tolist()
        axes.bar(edges, counts, 0.96 * np.diff(bins), align="edge", color=colours)
        axes.axvline(1.0, color=RED, lw=1.0)
        axes.set(xscale="log", xlabel="stated error over true error", ylabel="stated errors")
        if len(ratios):
            title = f"{len(ratios)} errors, {int((ratios < 1).sum())} violated, median {np.median(ratios):.2g}"
            exact = sum(statement.counted for row in rows for statement in row.judged) - len(ratios)
            axes.set_title(f"{title}; {exact} more are true to rounding" if exact else title)
    return figure
