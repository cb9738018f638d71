"""A scene before it is run: its bodies, contacts in colour, what is held, loads as arrows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tribodyn.fem.assembly import pieces
from tribodyn.fem.part import Part
from tribodyn.workflows.pictures import offscreen
from tribodyn.workflows.pictures.groups import surface_of
from tribodyn.workflows.pictures.shots import SHADE
from tribodyn.workflows.pictures.style import BODIES, CYCLE, GREY, INK, LAYOUT, PAPER, RED
from tribodyn.workflows.pictures.view import polygons
from tribodyn.workflows.scene.schema import MeshScene

ARROW = 0.18  # length of an arrow over the size of the whole


def draw(scene: MeshScene, part: Part, path: Path) -> Path:
    """Draw an assembled part with the contacts, supports and loads of its scene. Raises RenderingUnavailable"""
    offscreen.check()
    import pyvista as pv

    view = pv.Plotter(off_screen=True, window_size=LAYOUT.apart)
    view.set_background(PAPER)
    size, legend = float(np.linalg.norm(np.ptp(part.points, axis=0))), []
    for number, piece in enumerate(pieces(part.mesh)):
        outer = surface_of(pv, piece.mesh, np.flatnonzero(piece.mesh.f2t[1] < 0))
        view.add_mesh(outer, color=BODIES[number % len(BODIES)], opacity=0.45, **SHADE)
        view.add_mesh(outer.extract_feature_edges(30), color=GREY, line_width=1)
    for number, (name, pairs) in enumerate((part.joints or part.pairs).items()):
        faces, colour = part.interface.faces, CYCLE[number % len(CYCLE)]
        own = faces[((faces >= pairs.start) & (faces < pairs.stop)).all(axis=1)]
        if len(own):
            view.add_mesh(pv.PolyData(part.interface.points, polygons(own)), color=colour, lighting=False)
        else:
            view.add_points(part.interface.points[pairs], color=colour, point_size=9)
        legend.append((f"contact {name}", colour))
    held = np.setdiff1d(np.arange(len(part.points)), part.free // 3)
    if len(held):
        view.add_points(part.points[held], color=INK, point_size=7, render_points_as_spheres=True)
        legend.append(("held", INK))
    for loads, colour, kind in ((scene.loads.static, GREY, "static"), (scene.loads.harmonic, RED, "harmonic")):
        for name, load in loads.items():
            if load.direction is None or not load.group:
                continue
            along, centre = np.asarray(load.direction), part.points[part.node_sets[load.group]].mean(axis=0)
            start = centre - ARROW * size * along
            arrow = pv.Arrow(start=start, direction=along, scale=ARROW * size, shaft_radius=0.03, tip_radius=0.08)
            view.add_mesh(arrow, color=colour)
            legend.append((f"{kind} load {name}", colour))
    for number, (label, colour) in enumerate(legend, 1):
        view.add_text(label, position=(16, LAYOUT.apart[1] - 26 * number), font_size=9, color=colour)
    view.add_axes(color=INK)
    view.view_isometric()
    view.screenshot(str(path))
    view.close()
    return path
