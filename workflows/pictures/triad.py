"""The axes of a view, drawn beside what it shows: arrows with names that do not cover each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tribodyn.workflows.pictures.shots import Camera
from tribodyn.workflows.pictures.style import BLUE, GREEN, RED

ROOM, LEAST = 0.2, 0.14  # of the smaller and of the larger side of an image, the box that the axes stand in
SHORT = 0.2  # of its length: an axis seen so much from its end is a dot
COLOURS = (RED, GREEN, BLUE)


def with_room(images: Sequence[np.ndarray]) -> tuple[list[np.ndarray], tuple[float, float]]:
    """Images of one size with an empty corner for the axes, a strip added below where they have none.

    Returns the images and the middle of the corner's box [pixels]
    """
    box = room(images[0])
    ink = np.any([image.min(axis=2) < 250 for image in images], axis=0)
    height, width = ink.shape
    for top, left in ((height - box, 0), (height - box, width - box), (0, 0), (0, width - box)):
        if not ink[top : top + box, left : left + box].any():
            return list(images), (left + box / 2, top + box / 2)
    strip = np.full((box, width, 3), 255, np.uint8)
    return [np.concatenate([image, strip]) for image in images], (box / 2, height + box / 2)


def room(image: np.ndarray) -> int:
    """Side of the box that the axes of an image stand in [pixels]."""
    return round(max(ROOM * min(image.shape[:2]), LEAST * max(image.shape[:2])))


def draw(axes: Any, camera: Camera, names: Sequence[str], middle: tuple[float, float], box: float) -> None:
    """Draw the axes of a view on its image.

    names : of the three axes; middle, box : where they stand, and how much room they have [pixels]
    """
    right = np.cross(camera.up, camera.towards)
    seen = np.column_stack([right, -np.asarray(camera.up)])  # pixels count downwards
    towards = np.asarray(camera.towards)
    start = np.asarray(middle) - 0.28 * box * np.clip(seen.sum(axis=0), -1, 1)
    ends = start + 0.5 * box * seen
    labels = _apart(start + (0.5 * np.linalg.norm(seen, axis=1) + 0.17)[:, None] * box * _unit(seen), 0.24 * box)
    for i in np.argsort(towards):  # what points to the reader comes last
        if np.linalg.norm(seen[i]) > SHORT:
            arrow = {"arrowstyle": "-|>", "color": COLOURS[i], "lw": 1.3, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", ends[i], start, arrowprops=arrow, annotation_clip=False)
        else:
            axes.plot(*start, "o", color=COLOURS[i], ms=4)
        axes.text(*labels[i], names[i], color=COLOURS[i], fontsize=9, ha="center", va="center", fontstyle="italic")


def _unit(seen: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(seen, axis=1)
    away = -seen.sum(axis=0)
    away = away / max(float(np.linalg.norm(away)), 1e-9)
    return np.where(length[:, None] > SHORT, seen / np.maximum(length, 1e-9)[:, None], away)


def _apart(places: np.ndarray, least: float) -> np.ndarray:
    """Places (3, 2) moved until no two are nearer than a distance."""
    places = places.copy()
    for _ in range(30):
        for i, j in ((0, 1), (1, 2), (0, 2)):
            between = places[j] - places[i]
            distance = float(np.linalg.norm(between))
            if distance < least:
                along = between / distance if distance > 1e-9 else np.array([1.0, 0.0])
                places[i] -= along * (least - distance) / 2
                places[j] += along * (least - distance) / 2
    return places
