"""Single views of surfaces, drawn off-screen with pyvista and returned as images, and their axes drawn by matplotlib.

A coloured surface is drawn without shading, so that its colours are those of its scale; edges show its shape. The axes
of a view stand in a corner of the image that is empty. pyvista is imported by the functions here."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.workflows.pictures.theme import BLUE, BODY, EDGE, GREEN, LAYOUT, PAPER, RED

SHADE = {"ambient": 0.45, "diffuse": 0.6, "specular": 0.0}
OF_AXES = (RED, GREEN, BLUE)


@dataclass(frozen=True)
class Layer:
    """A surface of a view: in one colour and shaded, or coloured by values (n_point,) and unshaded.

    edges : whether its sharp edges are drawn; flat : unshaded though in one colour"""

    mesh: Any
    color: str = BODY
    values: np.ndarray | None = None
    map: str = "viridis"
    limits: tuple[float, float] = (0.0, 1.0)
    edges: bool = True
    flat: bool = False


@dataclass(frozen=True)
class Camera:
    """Parallel view of what lies within reach of a point.

    centre : (3,) [m]; towards : (3,) from there to the camera; up : (3,); reach : half the height of the view [m]"""

    centre: np.ndarray
    towards: np.ndarray
    up: np.ndarray
    reach: float


@dataclass(frozen=True)
class View:
    """Layers, and edges besides them."""

    layers: list[Layer]
    lines: list[Any] = field(default_factory=list)


def shoot(view: View, camera: Camera, size: tuple[int, int] = (960, 720)) -> np.ndarray:
    """(height, width, 3) image of a view, 8 bits a colour."""
    pv = package("pyvista")

    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    plotter.set_background(PAPER)
    plotter.add_light(pv.Light(light_type="headlight", intensity=1.0))
    for layer in view.layers:
        if not layer.mesh.n_points:
            continue
        if layer.values is None:
            plotter.add_mesh(layer.mesh, color=layer.color, lighting=not layer.flat, **SHADE)
        else:
            mesh = layer.mesh.copy()
            mesh.point_data["shown"] = np.asarray(layer.values, float)
            low, high = layer.limits
            plotter.add_mesh(
                mesh, scalars="shown", cmap=layer.map, clim=(low, high if high > low else low + 1.0),
                lighting=False, show_scalar_bar=False,
            )  # fmt: skip
        if layer.edges:
            sharp = layer.mesh.extract_feature_edges(30, manifold_edges=False, non_manifold_edges=False)
            if sharp.n_points:
                plotter.add_mesh(sharp, color=EDGE, line_width=1.6, lighting=False)
    for line in view.lines:
        plotter.add_mesh(line, color="#9aa1ab", line_width=1.2, lighting=False)
    plotter.enable_parallel_projection()
    plotter.enable_anti_aliasing("ssaa")
    plotter.camera.focal_point = camera.centre
    plotter.camera.position = camera.centre + camera.towards * 10 * camera.reach
    plotter.camera.up = camera.up
    plotter.camera.parallel_scale = camera.reach
    plotter.camera.clipping_range = (0.01 * camera.reach, 40 * camera.reach)
    image = np.asarray(plotter.screenshot(return_img=True))[..., :3]
    plotter.close()
    return image


def frame(points: np.ndarray, towards: np.ndarray, up: np.ndarray, aspect: float, margin: float = 1.12) -> Camera:
    """The camera that sees all points (n, 3) from a side; aspect : width of the view over its height."""
    towards = towards / np.linalg.norm(towards)
    up = up - towards * (up @ towards)
    up /= np.linalg.norm(up)
    right = np.cross(up, towards)
    projected = points @ np.stack([right, up, towards]).T
    low, high = projected.min(axis=0), projected.max(axis=0)
    middle = (low + high) / 2
    centre = middle[0] * right + middle[1] * up + middle[2] * towards
    width, height, deep = high - low
    reach = 0.5 * margin * max(height, width / aspect, 1e-12)
    return Camera(centre, towards, up, max(reach, deep / 30))


def trimmed(images: list[np.ndarray], keep: int = 8) -> list[np.ndarray]:
    """Images of one size without the white margin that all of them have."""
    ink = np.any([image.min(axis=2) < 250 for image in images], axis=0)
    rows, columns = np.flatnonzero(np.any(ink, axis=1)), np.flatnonzero(np.any(ink, axis=0))
    if not len(rows):
        return images
    part = slice(max(rows[0] - keep, 0), rows[-1] + keep), slice(max(columns[0] - keep, 0), columns[-1] + keep)
    return [image[part] for image in images]


def place(camera: Camera, point: np.ndarray, size: tuple[int, int]) -> tuple[float, float]:
    """Where a point (3,) of a view lies in its image: share of the width from the left, of the height from the top."""
    right = np.cross(camera.up, camera.towards)
    x, y = (point - camera.centre) @ np.stack([right, camera.up]).T / (2 * camera.reach)
    return 0.5 + x * size[1] / size[0], 0.5 - y


def with_room(images: Sequence[np.ndarray]) -> tuple[list[np.ndarray], tuple[float, float]]:
    """Images of one size with an empty corner for the axes, a strip added below where they have none.

    Returns the images and the middle of the corner's box [pixels]"""
    box = room(images[0])
    ink = np.any([image.min(axis=2) < 250 for image in images], axis=0)
    height, width = ink.shape
    for top, left_edge in ((height - box, 0), (height - box, width - box), (0, 0), (0, width - box)):
        if not ink[top : top + box, left_edge : left_edge + box].any():
            return list(images), (left_edge + box / 2, top + box / 2)
    strip = np.full((box, width, 3), 255, np.uint8)
    return [np.concatenate([image, strip]) for image in images], (box / 2, height + box / 2)


def room(image: np.ndarray) -> int:
    """Side of the box that the axes of an image stand in [pixels]."""
    smaller, larger = LAYOUT.axes_box
    return round(max(smaller * min(image.shape[:2]), larger * max(image.shape[:2])))


def show(axes: Any, image: np.ndarray, camera: Camera, names: Sequence[str], corner: tuple[float, float]) -> None:
    """Show an image of a camera with its axes, drawn around a corner [pixels]."""
    axes.imshow(image)
    axes.axis("off")
    draw_axes(axes, camera, names, corner, room(image))


def draw_axes(axes: Any, camera: Camera, names: Sequence[str], middle: tuple[float, float], box: float) -> None:
    """Draw the axes of a view on its image; one that is seen from its end is a dot.

    names : of the three axes; middle, box : where they stand, and how much room they have [pixels]"""
    right, towards = np.cross(camera.up, camera.towards), np.asarray(camera.towards)
    projected = np.column_stack([right, -np.asarray(camera.up)])  # pixels count downwards
    length = np.linalg.norm(projected, axis=1)[:, None]
    long = length > LAYOUT.axes_dot
    opposite = -projected.sum(axis=0) / max(float(np.linalg.norm(projected.sum(axis=0))), 1e-9)
    outwards = np.where(long, projected / np.maximum(length, 1e-9), opposite)
    start = np.asarray(middle) - 0.28 * box * np.clip(projected.sum(axis=0), -1, 1)
    ends = start + 0.5 * box * projected
    labels = _spread(start + (0.5 * length + 0.17) * box * outwards, 0.24 * box)
    for i in np.argsort(towards):  # what points to the reader comes last
        if long[i]:
            arrow = {"arrowstyle": "-|>", "color": OF_AXES[i], "lw": 1.3, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", ends[i], start, arrowprops=arrow, annotation_clip=False)
        else:
            axes.plot(*start, "o", color=OF_AXES[i], ms=4)
        axes.text(*labels[i], names[i], color=OF_AXES[i], fontsize=9, ha="center", va="center", fontstyle="italic")


def _spread(places: np.ndarray, least: float) -> np.ndarray:
    """Places (3, 2) moved until no two are nearer than a distance."""
    places = places.copy()
    for _ in range(30):
        for i, j in ((0, 1), (1, 2), (0, 2)):
            between = places[j] - places[i]
            distance = float(np.linalg.norm(between))
            if distance < least:
                direction = between / distance if distance > 1e-9 else np.array([1.0, 0.0])
                places[i] -= direction * (least - distance) / 2
                places[j] += direction * (least - distance) / 2
    return places
