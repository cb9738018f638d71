"""Where bodies stand apart, each moved off the one it touches along the normal of their faces: the exploded view."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.figures import present
from tribodyn.workflows.result.faces import bodies, meetings_of
from tribodyn.workflows.result.result import PartMesh, Result


@dataclass(frozen=True)
class Explosion:
    """How bodies are drawn apart.

    gap : between two bodies, of the size of the faces that touch
    one_way : of the area of touching faces; a smaller sum of their normals is a bore, which has no direction
    touch : of the size of the smaller body; faces nearer than this touch"""

    gap: float = 0.8
    one_way: float = 0.3
    touch: float = 1e-3


EXPLOSION = Explosion()


def explosion_offsets(result: Result) -> np.ndarray:
    """(n_node, 3) how far each node moves with its body so that the bodies stand apart, zero where there is one [m]."""
    part = present(result.part)
    body = bodies(part)
    offsets = np.zeros((body.max() + 1, 3))
    if len(offsets) == 1:
        return np.zeros_like(part.points)
    links = _links(result, part, body)
    placed_bodies = {int(np.argmax([np.ptp(part.points[body == b], axis=0).max() for b in range(len(offsets))]))}
    while True:
        open_ = {pair: v for pair, v in links.items() if (pair[0] in placed_bodies) != (pair[1] in placed_bodies)}
        if not open_:
            break
        (first, second), direction = max(open_.items(), key=lambda item: float(np.linalg.norm(item[1])))
        area = float(np.linalg.norm(direction))
        step = EXPLOSION.gap * np.sqrt(area) * direction / area if area > 0 else direction
        if first in placed_bodies:
            offsets[second] = offsets[first] + step
        else:
            offsets[first] = offsets[second] - step
        placed_bodies |= {first, second}
    return np.where(body[:, None] < 0, 0.0, offsets[body])


def _links(result: Result, part: PartMesh, body: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """Bodies that touch -> sum of area times normal out of the first [m2], zero where faces look all ways."""
    links: dict[tuple[int, int], np.ndarray] = {}
    areas: dict[tuple[int, int], float] = {}

    def add(first: int, second: int, direction: np.ndarray, area: float) -> None:
        pair, sign = ((first, second), 1) if first < second else ((second, first), -1)
        links[pair] = links.get(pair, np.zeros(3)) + sign * direction
        areas[pair] = areas.get(pair, 0.0) + area

    for meeting in meetings_of(result):
        if len(meeting.faces) > 1:
            first, second = (int(np.bincount(body[face.nodes]).argmax()) for face in meeting.faces)
            if first != second:
                add(first, second, meeting.patch.area @ meeting.faces[0].outward, float(meeting.patch.area.sum()))
    linked_pairs = set(links)
    shells = [_shell(part, body == b) for b in range(body.max() + 1)]
    for first in range(len(shells)):
        for second in range(first + 1, len(shells)):
            if (first, second) not in linked_pairs:
                direction, area = _touching(shells[first], shells[second])
                if area > 0:
                    add(first, second, direction, area)
    return {key: v if np.linalg.norm(v) > EXPLOSION.one_way * areas[key] else np.zeros(3) for key, v in links.items()}


def _shell(part: PartMesh, mine: np.ndarray) -> Any:
    cells = part.cells[mine[part.cells[:, 0]]]
    shell = drawing.surface(drawing.grid_of(part, cells=cells)).triangulate()
    return shell.compute_normals(consistent_normals=True, auto_orient_normals=True, split_vertices=False)


def _touching(first: Any, second: Any) -> tuple[np.ndarray, float]:
    """Sum of area times normal (3,) of the triangles of a body that lie on another, and their area [m2]."""
    a, b = np.reshape(first.bounds, (3, 2)), np.reshape(second.bounds, (3, 2))
    reach = EXPLOSION.touch * min(float(np.ptp(a, axis=1).max()), float(np.ptp(b, axis=1).max()))
    if (np.maximum(a[:, 0], b[:, 0]) > np.minimum(a[:, 1], b[:, 1]) + reach).any():
        return np.zeros(3), 0.0
    smaller = np.prod(np.ptp(a, axis=1)) < np.prod(np.ptp(b, axis=1))
    small, large, sign = (first, second, 1) if smaller else (second, first, -1)
    middles = small.cell_centers().compute_implicit_distance(large)
    is_near = np.abs(np.asarray(middles["implicit_distance"])) < reach
    area = np.asarray(small.compute_cell_sizes(length=False, volume=False).cell_data["Area"])[is_near]
    return sign * (area @ np.asarray(small.cell_data["Normals"])[is_near]), float(area.sum())
