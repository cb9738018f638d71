"""Pictures of stress: the part in colours of its largest stress or of its utilisation, hot spots ringed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tribodyn.workflows.pictures.figures import heading, present, scale_bar
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.shots import place, shoot, show, trimmed, with_room
from tribodyn.workflows.pictures.theme import LAYOUT, PRESSURE_MAP, RED, STYLE
from tribodyn.workflows.result.contact_states import shown_states

if TYPE_CHECKING:
    from tribodyn.workflows.pictures.render import MovingPart


def stress_picture(moving: MovingPart) -> Figure:
    """The part at its largest swing in each shown state, by utilisation where it is known, else by stress."""
    result = moving.result
    stress = present(result.stress_field)
    states = [state for state in shown_states(result) if state.field is not None]
    is_judged = bool(np.isfinite(stress.utilisation).any())
    name = "utilisation of the endurance limit" if is_judged else "largest stress over the cycle (von Mises) / MPa"
    values = np.nan_to_num(stress.utilisation) if is_judged else 1e-6 * stress.largest
    images, marks = [], []
    for state in states:
        vibration = moving.swing(state)
        points = moving.points(state, moving.vibration_scale(vibration) * vibration)
        shown = values[present(state.field)]
        view = moving.view(points, shown, (0.0, float(shown.max())), PRESSURE_MAP)
        images.append(shoot(view, moving.camera, LAYOUT.view))
        marks.append([place(moving.camera, points[node], LAYOUT.view) for node in stress.spot[present(state.field)]])
    cut, corner = with_room(trimmed(images))
    offset = _offset(images)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        wide = max(LAYOUT.column, LAYOUT.least / len(states))
        tall = wide * cut[0].shape[0] / cut[0].shape[1]
        figure = Figure(figsize=(wide * len(states) + 0.2, tall + 2.0), layout="constrained")
        columns = np.atleast_1d(figure.subplots(1, len(states)))
        for axes, state, image, spots in zip(columns, states, cut, marks, strict=True):
            show(axes, image, moving.camera, "xyz", corner)
            for number, (x, y) in enumerate(spots, 1):
                at = np.array([x * LAYOUT.view[0], y * LAYOUT.view[1]]) - offset
                axes.plot(*at, "o", ms=9, mfc="none", mec=RED)
                axes.annotate(str(number), at, (7, 7), textcoords="offset points", color=RED, fontsize=9)
            shown = values[present(state.field)]
            axes.set_title(f"{state.label}\nlargest {shown.max():.3g}")
            scale_bar(figure, axes, PRESSURE_MAP, 0.0, float(shown.max()), name)
        heading(figure, result, "stress of the part at its largest swing, hot spots numbered")
    return figure


def _offset(images: list[np.ndarray]) -> np.ndarray:
    """Pixels (x, y) that `trimmed` takes off the left and the top."""
    ink = np.any([image.min(axis=2) < 250 for image in images], axis=0)
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    return np.maximum([columns[0] - 8, rows[0] - 8], 0) if len(rows) else np.zeros(2)
