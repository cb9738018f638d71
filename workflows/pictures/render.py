"""Pictures of the part in three dimensions: vibrating in its states, and its worn contact opened."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.pictures import maps, offscreen, opened as book, view as drawing
from tribodyn.workflows.pictures.figures import (
    heading,
    length_unit,
    present,
    pressure_unit,
    save,
    scale_bar,
    status_legend,
)
from tribodyn.workflows.pictures.matplotlib_names import Figure, Image, ImageDraw, mpl
from tribodyn.workflows.pictures.shots import Camera, Layer, frame, place, shoot, show, trimmed
from tribodyn.workflows.pictures.theme import INK, LAYOUT, MOTION_MAP, PALE, PRESSURE_MAP, RED, STYLE, WEAR_MAP
from tribodyn.workflows.result.contact_states import ContactState, has_states, shown_states
from tribodyn.workflows.result.faces import Meeting, bodies, meetings_of, worn_off
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import LARGEST_BEND, size_of


def draw(
    result: Result, folder: Path, deformation: float | None = None, wear: float | None = None,
    formats: Sequence[str] = ("png",), dpi: int | None = None,
) -> list[Path]:  # fmt: skip
    """Write every picture that the result has data for; returns their paths.

    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  RenderingUnavailable"""
    pictures = figures(result, deformation, wear)
    if pictures:
        offscreen.check()
    return [path for name, make in pictures.items() for path in save(make(), folder / name, formats, dpi)]


def figures(
    result: Result, deformation: float | None = None, wear: float | None = None
) -> dict[str, Callable[[], Figure]]:
    """The pictures that a result has data for, by name; see `draw`."""
    if not has_states(result):
        return {}
    pictures: dict[str, Callable[[], Figure]] = {}
    if result.part is not None and result.fields is not None:
        pictures["part"] = partial(part_picture, result, deformation, wear)
    if result.part is not None and result.fields is not None and result.stress_field is not None:
        pictures["stress"] = partial(stress_picture, result, deformation, wear)
    for contact in book.contacts(result):
        name = f"contact_{contact.name}" if contact.name else "contact"
        pictures[name] = partial(contact_picture, result, contact, wear)
    wheel = result.facts.around
    if wheel is not None and result.fields is not None:
        from tribodyn.workflows.pictures import render_wheel  # only wheels need it

        pictures["wheel"] = partial(render_wheel.wheel_picture, result, wheel, deformation)
    return pictures


def part_picture(result: Result, deformation: float | None = None, wear: float | None = None) -> Figure:
    """The part in each shown state at its largest swing, coloured by amplitude, one camera for all."""
    states = [state for state in shown_states(result) if state.field is not None]
    moving = MovingPart(result, deformation, wear)
    images, titles, bars = [], [], []
    for state in states:
        amplitude, vibration = moving.amplitude(state), moving.swing(state)
        scale, highest = moving.vibration_scale(vibration), float(amplitude.max())
        unit, factor = length_unit(highest)
        bars.append((MOTION_MAP, 0.0, factor * highest, f"vibration amplitude / {unit}"))
        points = moving.points(state, scale * vibration)
        view = moving.view(points, factor * amplitude, (0.0, bars[-1][2]))
        images.append(moving.marked(shoot(view, moving.camera, LAYOUT.view), points))
        far = highest > LARGEST_BEND * size_of(result)
        warned = "\nbeyond the linear model" if far else ""
        titles.append((f"{state.label}\n{moving.factors(scale)}{warned}", RED if far else INK))
    return _columns(moving, images, titles, bars, "part at its largest swing, its contact outlined")


def stress_picture(result: Result, deformation: float | None = None, wear: float | None = None) -> Figure:
    """The part at its largest swing in each shown state, by utilisation where it is known, else by stress."""
    moving, stress = MovingPart(result, deformation, wear), present(result.stress_field)
    is_judged = bool(np.isfinite(stress.utilisation).any())
    name = "utilisation of the endurance limit" if is_judged else "largest stress over the cycle (von Mises) / MPa"
    values = np.nan_to_num(stress.utilisation) if is_judged else 1e-6 * stress.largest
    images, titles, bars = [], [], []
    for state in (state for state in shown_states(result) if state.field is not None):
        vibration, shown = moving.swing(state), values[present(state.field)]
        points = moving.points(state, moving.vibration_scale(vibration) * vibration)
        bars.append((PRESSURE_MAP, 0.0, float(shown.max()), name))
        titles.append((f"{state.label}\nlargest {shown.max():.3g}", INK))
        image = shoot(moving.view(points, shown, bars[-1][1:3], PRESSURE_MAP), moving.camera, LAYOUT.view)
        images.append(moving.numbered(image, points[stress.spot[present(state.field)]]))
    return _columns(moving, images, titles, bars, "stress of the part at its largest swing, hot spots numbered")


def _columns(
    moving: "MovingPart",
    images: list[np.ndarray],
    titles: list[tuple[str, str]],
    bars: list[tuple[Any, ...]],
    head: str,
) -> Figure:
    """Images of the moving part side by side, with their titles and colours, and their scale bars."""
    images = trimmed(images)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        wide = max(LAYOUT.column, LAYOUT.least / len(images))
        tall = wide * images[0].shape[0] / images[0].shape[1]
        figure = Figure(figsize=(wide * len(images) + 0.2, tall + 2.0), layout="constrained")
        columns = np.atleast_1d(figure.subplots(1, len(images)))
        for axes, image, (title, color), bar in zip(columns, images, titles, bars, strict=True):
            show(axes, image)
            axes.set_title(title, color=color)
            scale_bar(figure, axes, *bar)
        heading(figure, moving.result, head)
    return figure


def contact_picture(result: Result, contact: Meeting, wear: float | None = None) -> Figure:
    """Both faces of a contact opened like a book, in each shown state: depth in relief, status, mean pressure."""
    opened = book.opened(result, contact)
    states = [opened.restrict(state) for state in shown_states(result)]
    depth = np.stack([state.depth for state in states])
    wear = wear or drawing.wear_scale(contact.patch, depth)
    worn, with_status = bool(depth.max() > 0), [s for s in states if s.status is not None]
    rows = [name for name, is_shown in (("depth", worn), ("status", bool(with_status)), ("pressure", True)) if is_shown]
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(
            figsize=(max(LAYOUT.column * len(states), LAYOUT.least) + 0.2, 2.9 * len(rows) + 0.7), layout="constrained"
        )
        grid = figure.subplots(len(rows), len(states), squeeze=False)
        painted = [[_painted(opened, state, name, wear) for state in states] for name in rows]
        images = trimmed([shoot(view, opened.camera, LAYOUT.book, book.AXES) for line in painted for view, _ in line])
        bars = [bar for line in painted for _, bar in line]
        for axes, image, bar in zip(grid.ravel(), images, bars, strict=True):
            show(axes, image)
            if bar is not None:
                scale_bar(figure, axes, *bar)
        for axes, state in zip(grid[0], states, strict=True):
            axes.set_title(state.label)
        if "status" in rows:
            present = {int(bits) for s in with_status if s.status is not None for bits in s.status}
            status_legend(figure, present, contact.patch.components)
        told_scale = f", depth in relief × {wear:g}" if worn else ""
        heading(figure, result, f"opened {opened.sides}{told_scale}")
    return figure


def _painted(
    contact: book.OpenedContact, state: ContactState, name: str, wear: float
) -> tuple[list[Layer], tuple[Any, ...] | None]:
    """The opened contact showing one quantity of a state, and the scale bar that goes with it."""
    if name == "status":
        none = np.zeros(len(state.depth), int)
        return contact.view(state.depth, wear, book.StatusPaint(none if state.status is None else state.status)), None
    if name == "depth":
        unit, factor = length_unit(float(state.depth.max()))
        values, map_, label = factor * state.depth, WEAR_MAP, f"total wear depth / {unit}"
    else:
        pressure = np.zeros(len(state.depth)) if state.pressure is None else state.pressure
        unit, factor = pressure_unit(float(pressure.max()))
        values, map_, label = factor * pressure, PRESSURE_MAP, f"mean pressure / {unit}"
    low, high = maps.limits(values)
    paint = book.FieldPaint(values, (low, high), map_)
    return contact.view(state.depth, wear, paint), (map_, low, high, label)


class MovingPart:
    """The worn part of a result in motion, and one camera for all its states.

    deformation, wear : factors of displacement and depth, by size where None"""

    def __init__(self, result: Result, deformation: float | None = None, wear: float | None = None):
        part, patch, self.fields = present(result.part), result.patch, present(result.fields)
        self.result, self.part, self.patch, self.deformation = result, part, patch, deformation
        self.size = float(np.ptp(part.points, axis=0).max())
        self.meetings = meetings_of(result)
        static = drawing.at_rest(self.fields.displacement, result.harmonics)
        self.rest_scale = deformation or drawing.rest_scale(static, part.points, bodies(part))
        depth = np.stack([state.depth for state in shown_states(result)])
        self.wear = wear or drawing.wear_scale(patch, depth)
        self.shell = drawing.surface(drawing.grid_of(part))
        self.outline = self.shell.extract_feature_edges(30)
        reach = [part.points + self.rest_scale * s for s in static]
        for s in (drawing.swing(d, result.harmonics) for d in self.fields.displacement):
            reach += [part.points + self.vibration_scale(s) * s, part.points - self.vibration_scale(s) * s]
        self.camera: Camera = frame(np.concatenate(reach), *drawing.looking(result), LAYOUT.view[0] / LAYOUT.view[1])

    def vibration_scale(self, vibration: np.ndarray) -> float:
        """The factor that a vibration (n_node, 3) is drawn with."""
        return self.deformation or drawing.deformation_scale(vibration, self.size)

    def marked(self, image: np.ndarray, points: np.ndarray) -> np.ndarray:
        """An image of this camera with the outline of the contact, hidden or not, ringed where it is small.

        points : (n_node, 3) as drawn"""
        size = image.shape[1], image.shape[0]
        corner = self.patch.faces
        if not len(corner):
            return image
        edges = np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1).reshape(-1, 2)
        edges_once, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        width = max(round(size[0] / 220), 1)
        picture = Image.fromarray(image)
        pen = ImageDraw.Draw(picture)
        at = np.array([place(self.camera, point, size) for point in points[self.patch.nodes]])
        for i, j in edges_once[count == 1]:
            ends = [(at[k][0] * size[0], at[k][1] * size[1]) for k in (i, j)]
            pen.line(ends, fill=RED, width=width)
        low, high = at.min(axis=0) * size, at.max(axis=0) * size
        if np.linalg.norm(high - low) < LAYOUT.ringed * size[0]:
            middle, radius = (low + high) / 2, 0.75 * LAYOUT.ringed * size[0]
            pen.ellipse([*(middle - radius), *(middle + radius)], outline=RED, width=width)
        return np.asarray(picture)

    def numbered(self, image: np.ndarray, points: np.ndarray) -> np.ndarray:
        """An image of this camera with points (n, 3), as drawn, ringed and numbered."""
        size, picture = (image.shape[1], image.shape[0]), Image.fromarray(image)
        pen, radius = ImageDraw.Draw(picture), size[0] // 110
        for number, point in enumerate(points, 1):
            at = np.array(place(self.camera, point, size)) * size
            pen.ellipse([*(at - radius), *(at + radius)], outline=RED, width=max(radius // 4, 1))
            pen.text(tuple(at + radius), str(number), fill=RED, font_size=3 * radius)
        return np.asarray(picture)

    def factors(self, scale: float) -> str:
        """What is exaggerated, for a title."""
        worn = f", depth × {self.wear:g}" if self.result.wear is not None else ""
        return f"drawn: static × {self.rest_scale:g}, vibration × {scale:g}{worn}"

    def terms(self, state: ContactState) -> np.ndarray:
        return np.asarray(self.fields.displacement[present(state.field)])

    def swing(self, state: ContactState) -> np.ndarray:
        return drawing.swing(self.terms(state), self.result.harmonics)

    def amplitude(self, state: ContactState) -> np.ndarray:
        """(n_node,) largest distance from the mean position over the cycle [m]."""
        return np.asarray(np.linalg.norm(drawing.cycle(self.terms(state), self.result.harmonics), axis=1).max(axis=1))

    def points(self, state: ContactState, motion: np.ndarray) -> np.ndarray:
        """(n_node, 3) where wear, rest and a motion (n_node, 3) bring the nodes, as drawn [m]."""
        static = self.rest_scale * drawing.at_rest(self.terms(state), self.result.harmonics)
        return np.asarray(
            self.part.points + static + motion + self.wear * worn_off(self.meetings, state.depth, len(static))
        )

    def view(
        self, points: np.ndarray, values: np.ndarray, limits: tuple[float, float], colors: str = MOTION_MAP
    ) -> list[Layer]:
        """The part with its nodes at points (n_node, 3), coloured by values of the nodes."""
        grid = drawing.grid_of(self.part, points)
        grid.point_data["shown"] = values
        body = drawing.surface(grid, LAYOUT.smooth)
        outline = Layer(self.outline, PALE, edges=False, flat=True)
        return [Layer(body, values=np.asarray(body.point_data["shown"]), map=colors, limits=limits), outline]
