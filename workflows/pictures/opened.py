"""A contact opened like a book: both faces side by side, seen from where they met, in the axes t1, t2, n of the patch.

Body 1 is not moved; body 2, or the ground where that is not meshed, is turned by half a turn about an edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.workflows.pictures.shots import Camera, Layer, frame
from tribodyn.workflows.pictures.theme import BODY, BODY_2, EDGE, LAYOUT, STATUS
from tribodyn.workflows.pictures.view import grid_of, polygons
from tribodyn.workflows.result.contact_states import ContactState
from tribodyn.workflows.result.faces import Face, Meeting, bodies, meetings_of
from tribodyn.workflows.result.result import PartMesh, Patch, Result

Paint = Callable[[Patch, np.ndarray], list[Layer]]
"""Layers that show something on a face whose pairs lie at points (n_pair, 3)."""

AXES = ("t1", "t2", "n")
MARGIN = 0.35  # of the size of the patch, what is shown around it
THICK = 0.5  # of its size, how deep the bodies are cut off


@dataclass(frozen=True)
class OpenedContact:
    """What does not change over a series: where the faces lie and how they are looked at.

    contact : with its pairs and faces; part : of the result; split : share of the depth on body 1
    flat : (n_pair, 2) along t1, t2 [m]; size : of the patch [m]
    fold_axis : which of t1, t2 the book opens along, hinge : the place of its hinge there [m]
    bounds : lowest and highest t1, t2 of what is shown [m]"""

    contact: Meeting
    part: PartMesh | None
    split: float
    flat: np.ndarray
    size: float
    fold_axis: int
    hinge: float
    bounds: tuple[np.ndarray, np.ndarray]
    camera: Camera

    @property
    def sides(self) -> str:
        """What stands where, for a title."""
        across = "body 2" if len(self.contact.faces) > 1 else "ground"
        return f"{f'contact {self.contact.name}'.strip().replace('_', ' ')}: body 1 in front, {across} behind"

    def restrict(self, state: ContactState) -> ContactState:
        """A state, of this contact's pairs."""
        return state.of(self.contact.pairs)

    def view(self, depth: np.ndarray, scale: float, paint: Paint) -> list[Layer]:
        """Both faces worn by a depth (n_pair,) that is drawn `scale` times as large, and painted."""
        contact, layers = self.contact, list[Layer]()
        for number, share in enumerate((self.split, 1 - self.split)):
            face = contact.faces[number] if number < len(contact.faces) else None
            block = self._block(face, number == 0, scale * depth)
            points = np.column_stack(
                [self.flat, (0.0 if face is None else -scale * share) * depth + LAYOUT.lift * self.size]
            )
            if number:
                block.points = self._turned(np.asarray(block.points), -1)
                points = self._turned(points, 1)
            layers.append(Layer(block.extract_surface(algorithm="dataset_surface"), color=(BODY, BODY_2)[number]))
            layers += paint(contact.patch, points)
        return layers

    def _turned(self, points: np.ndarray, sign: int) -> np.ndarray:
        """Points of body 2 after it is opened; sign : -1 where their n still points as body 1's does."""
        turned = points.copy()
        turned[:, self.fold_axis] = 2 * self.hinge - turned[:, self.fold_axis]
        turned[:, 2] *= sign
        return turned

    def _block(self, face: Face | None, is_below: bool, depth: np.ndarray) -> Any:
        """The elements near a face in the axes of the patch, worn, or a plate where no body is meshed."""
        pv = package("pyvista")

        patch, part = self.contact.patch, self.part
        sign = -1.0 if is_below else 1.0
        (x0, y0), (x1, y1) = self.bounds
        if face is None or part is None:
            return pv.Box((x0, x1, y0, y1, *sorted((0.0, sign * 0.2 * self.size)))).cast_to_unstructured_grid()
        points = part.points + face.worn_off(depth, len(part.points))
        points = points if face.turn is None else points @ face.turn
        local = (points - patch.points.mean(axis=0)) @ patch.frames.mean(axis=0).T
        body = bodies(part)
        mine = (body[part.cells] == body[face.nodes[0]]).all(axis=1)
        low, high = local[part.cells].min(axis=1), local[part.cells].max(axis=1)
        is_near = ((high > [x0, y0, -THICK * self.size]) & (low < [x1, y1, THICK * self.size])).all(axis=1)
        cells = part.cells[mine & is_near & (sign * (low + high)[:, 2] > -0.2 * self.size)]
        grid = grid_of(part, local, cells)
        cut = grid.clip_box((x0, x1, y0, y1, -THICK * self.size, THICK * self.size), invert=False)
        return cut if cut.n_points else self._block(None, is_below, depth)


@dataclass(frozen=True)
class FieldPaint:
    """A value for each pair, between two limits of a colour map."""

    values: np.ndarray
    limits: tuple[float, float]
    map: str

    def __call__(self, patch: Patch, points: np.ndarray) -> list[Layer]:
        corners, _ = patch.shares(np.column_stack([points, self.values]))
        flat = corners.reshape(-1, 4)
        surface = _quadrangles(flat[:, :3])
        surface.point_data["shown"] = flat[:, 3]
        surface = surface.clean()
        return [Layer(surface, values=np.asarray(surface.point_data["shown"]), map=self.map, limits=self.limits)]


@dataclass(frozen=True)
class StatusPaint:
    """The status of each pair on its share of the face."""

    status: np.ndarray

    def __call__(self, patch: Patch, points: np.ndarray) -> list[Layer]:
        pv = package("pyvista")

        corners, pair = patch.shares(points)
        layers = []
        for bits, (_, color) in STATUS.items():
            drawn_shares = corners[self.status[pair] == bits]
            if len(drawn_shares):
                layers.append(Layer(_quadrangles(drawn_shares.reshape(-1, 3)), color, edges=False, flat=True))
        outline = pv.PolyData(points, polygons(patch.faces)).extract_feature_edges(
            boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
        )
        return [*layers, Layer(outline, EDGE, edges=False, flat=True)]


def _quadrangles(corners: np.ndarray) -> Any:
    """A surface of quadrangles, four points (4 n, 3) each."""
    pv = package("pyvista")

    return pv.PolyData(corners, polygons(np.arange(len(corners)).reshape(-1, 4)))


def contacts(result: Result) -> tuple[Meeting, ...]:
    """The contacts of a result that can be opened: those whose faces look one way, alone where there is one patch."""
    patch = result.patch
    if not len(patch.faces):
        return ()
    meetings = meetings_of(result) or (Meeting("", slice(0, len(patch.area)), patch, ()),)
    return tuple(meeting for meeting in meetings if meeting.patch.in_one_plane)


def opened(result: Result, contact: Meeting, aspect: float = 1.3) -> OpenedContact:
    """An opened contact of a result; aspect : of the view, width over height."""
    flat = contact.patch.flat
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = float(np.sqrt(np.prod(high - low)))
    fold_axis = int(np.argmin(high - low))  # open along the shorter side
    box = (low - MARGIN * size, high + MARGIN * size)
    hinge = float(box[1][fold_axis] + 0.1 * size)
    (x0, y0), (x1, y1) = box
    corners = np.array([[x, y, z] for x in (x0, x1) for y in (y0, y1) for z in (-0.4 * size, 0)])
    other = corners.copy()
    other[:, fold_axis] = 2 * hinge - other[:, fold_axis]
    look = np.array([-0.3, -0.8, 1.0]) if fold_axis == 1 else np.array([-0.8, -0.3, 1.0])
    camera = frame(np.concatenate([corners, other]), look, np.array([0.0, 0, 1]), aspect, 1.05)
    return OpenedContact(contact, result.part, result.facts.share_of_body_1, flat, size, fold_axis, hinge, box, camera)
