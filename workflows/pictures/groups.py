"""The bodies of a file or scene with their groups in colour, and a scene before it is run."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.fem.assembly import Body, pieces
from tribodyn.fem.part import Part
from tribodyn.workflows.pictures import offscreen
from tribodyn.workflows.pictures.shots import SHADE
from tribodyn.workflows.pictures.theme import BODIES, BODY, CYCLE, GREY, INK, LAYOUT, PAPER, RED
from tribodyn.workflows.pictures.view import polygons
from tribodyn.workflows.scene.schema import MeshScene

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442", "#7f3c8d", "#8c564b", "#17becf")
ARROW = 0.18  # length of an arrow over the size of the whole


def draw(solids: Sequence[Body], path: Path, max_groups: int = 20) -> Path:
    """Draw the first face groups of some bodies, each in a colour of its own. Raises RenderingUnavailable"""
    offscreen.check()
    pv = package("pyvista")

    view = pv.Plotter(off_screen=True, shape=(1, 3), col_weights=[3, 3, 1.6], window_size=LAYOUT.groups, border=False)
    named = [(solid, name, ids) for solid in solids for name, ids in (solid.mesh.boundaries or {}).items()]
    for side in (0, 1):
        view.subplot(0, side)
        view.set_background(PAPER)
        for solid in solids:
            outer = np.flatnonzero(solid.mesh.f2t[1] < 0)
            covered = np.concatenate(
                [np.asarray(i) for s, _, i in named[:max_groups] if s is solid] or [np.empty(0, int)]
            )
            uncovered = np.setdiff1d(outer, covered)
            if len(uncovered):
                view.add_mesh(surface_of(pv, solid.mesh, uncovered), color=BODY, show_edges=True, **SHADE)
        for i, (solid, _, ids) in enumerate(named[:max_groups]):
            face = surface_of(pv, solid.mesh, np.asarray(ids))
            view.add_mesh(face, color=COLOURS[i % len(COLOURS)], show_edges=True, **SHADE)
        view.view_isometric()
        if side:
            view.camera.azimuth += 180
            view.camera.elevation -= 60
        view.add_axes(color=INK)
    view.subplot(0, 2)
    view.set_background(PAPER)
    if named:
        labels = [name if len(solids) == 1 else f"{name} of {solid.name}" for solid, name, _ in named[:max_groups]]
        entries = [(label, COLOURS[i % len(COLOURS)]) for i, label in enumerate(labels)]
        tall = min(0.05 * len(entries) + 0.02, 0.95)
        view.add_legend(entries, bcolor=PAPER, face="rectangle", size=(0.95, tall), loc="center left")
    view.screenshot(str(path))
    view.close()
    return path


def surface_of(pv: Any, mesh: Any, facets: np.ndarray) -> Any:
    """Some facets of a mesh as pyvista has them."""
    return pv.PolyData(mesh.p.T, polygons(mesh.facets[:, facets].T))


def draw_scene(scene: MeshScene, part: Part, path: Path) -> Path:
    """Draw an assembled part: contacts in colour, what is held, loads as arrows. Raises RenderingUnavailable"""
    offscreen.check()
    import pyvista as pv

    view = pv.Plotter(off_screen=True, window_size=LAYOUT.scene)
    view.set_background(PAPER)
    size, legend = float(np.linalg.norm(np.ptp(part.points, axis=0))), []
    for number, piece in enumerate(pieces(part.mesh)):
        outer = surface_of(pv, piece.mesh, np.flatnonzero(piece.mesh.f2t[1] < 0))
        view.add_mesh(outer, color=BODIES[number % len(BODIES)], opacity=0.45, **SHADE)
        view.add_mesh(outer.extract_feature_edges(30), color=GREY, line_width=1)
    for number, (name, pairs) in enumerate((part.joints or part.pairs).items()):
        faces, colour = part.interface.faces, CYCLE[number % len(CYCLE)]
        joint_faces = faces[((faces >= pairs.start) & (faces < pairs.stop)).all(axis=1)]
        if len(joint_faces):
            view.add_mesh(pv.PolyData(part.interface.points, polygons(joint_faces)), color=colour, lighting=False)
        else:
            view.add_points(part.interface.points[pairs], color=colour, point_size=9)
        legend.append((f"contact {name}", colour))
    fixed_nodes = np.setdiff1d(np.arange(len(part.points)), part.free // 3)
    if len(fixed_nodes):
        view.add_points(part.points[fixed_nodes], color=INK, point_size=7, render_points_as_spheres=True)
        legend.append(("held", INK))
    for loads, colour, kind in ((scene.loads.static, GREY, "static"), (scene.loads.harmonic, RED, "harmonic")):
        for name, load in loads.items():
            if load.direction is None or not load.group:
                continue
            axis, centre = np.asarray(load.direction), part.points[part.node_sets[load.group]].mean(axis=0)
            start = centre - ARROW * size * axis
            arrow = pv.Arrow(start=start, direction=axis, scale=ARROW * size, shaft_radius=0.03, tip_radius=0.08)
            view.add_mesh(arrow, color=colour)
            legend.append((f"{kind} load {name}", colour))
    for number, (label, colour) in enumerate(legend, 1):
        view.add_text(label, position=(16, LAYOUT.scene[1] - 26 * number), font_size=9, color=colour)
    view.add_axes(color=INK)
    view.view_isometric()
    view.screenshot(str(path))
    view.close()
    return path
