"""Single views of surfaces with their axes, drawn off-screen with pyvista and returned as images.

A coloured surface is drawn without shading, so that its colours are those of its scale; edges show its shape. pyvista
is imported by the functions here."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.workflows.pictures.theme import BLUE, BODY, EDGE, GREEN, INK, PAPER, RED

SHADE = {"ambient": 0.45, "diffuse": 0.6, "specular": 0.0}


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


def shoot(
    view: Sequence[Layer], camera: Camera, size: tuple[int, int] = (960, 720), names: Sequence[str] = "xyz"
) -> np.ndarray:
    """(height, width, 3) image of a view, 8 bits a colour; names : of its axes, which stand in a corner."""
    pv = package("pyvista")

    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    plotter.set_background(PAPER)
    plotter.add_light(pv.Light(light_type="headlight", intensity=1.0))
    for layer in view:
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
    plotter.enable_parallel_projection()
    plotter.enable_anti_aliasing("ssaa")
    plotter.camera.focal_point = camera.centre
    plotter.camera.position = camera.centre + camera.towards * 10 * camera.reach
    plotter.camera.up = camera.up
    plotter.camera.parallel_scale = camera.reach
    plotter.camera.clipping_range = (0.01 * camera.reach, 40 * camera.reach)
    colors = {f"{axis}_color": color for axis, color in zip("xyz", (RED, GREEN, BLUE), strict=True)}
    labels = {f"{axis}label": name for axis, name in zip("xyz", names, strict=True)}
    plotter.add_axes(line_width=5, viewport=(0, 0, 0.3, 0.3), label_size=(0.3, 0.12), color=INK, **colors, **labels)
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


def show(axes: Any, image: np.ndarray) -> None:
    """Show an image, without a frame."""
    axes.imshow(image)
    axes.axis("off")
