"""The table of extremes as a picture: one line for each model and thing varied, one square for each cell."""

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from proof.hard_settings.extremes import Trial, counts
from proof.hard_settings.extremes_judge import CONVERGED, REFUSED, WRONG
from tribodyn.workflows.pictures.theme import BLUE, ORANGE, RED, STYLE

COLOUR = {CONVERGED: BLUE, REFUSED: ORANGE, WRONG: RED}


def picture(rows: Sequence[Trial]) -> Figure:
    """Cells from the first to the last setting of each line, coloured by their outcome."""
    lines = list(dict.fromkeys((row.model, row.varied) for row in rows))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10, 0.8 + 0.21 * len(lines)), layout="constrained")
        axes = figure.add_subplot()
        for outcome, colour in COLOUR.items():
            places = []
            for height, line in enumerate(lines):
                group = [row for row in rows if (row.model, row.varied) == line]
                places += [(i, height) for i, row in enumerate(group) if row.outcome == outcome]
            if places:
                across, down = zip(*places, strict=True)
                axes.scatter(across, down, s=34, marker="s", color=colour, label=outcome)
        axes.set_yticks(range(len(lines)), [f"{model}: {varied}" for model, varied in lines], fontsize=7)
        axes.invert_yaxis()
        axes.grid(visible=False)
        axes.set_xlabel("settings, from the first to the last")
        total = counts(tuple(rows))
        axes.set_title(", ".join(f"{count} {outcome}" for outcome, count in total.items()))
        axes.legend(loc="lower right")
    return figure
