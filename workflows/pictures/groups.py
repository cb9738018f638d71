"""The bodies of a file or scene with their groups in colour, from two sides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.fem.assembly import Body
from tribodyn.workflows.pictures import offscreen
from tribodyn.workflows.pictures.shots import SHADE
from tribodyn.workflows.pictures.style import BODY, INK, LAYOUT, PAPER
from tribodyn.workflows.pictures.view import polygons

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442", "#7f3c8d", "#8c564b", "#17becf")


def draw(solids: Sequence[Body], path: Path, most: int = 20) -> Path:
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
            covered = np.concatenate([np.asarray(i) for s, _, i in named[:most] if s is solid] or [np.empty(0, int)])
            rest = np.setdiff1d(outer, covered)
            if len(rest):
                view.add_mesh(surface_of(pv, solid.mesh, rest), color=BODY, show_edges=True, **SHADE)
        for i, (solid, _, ids) in enumerate(named[:most]):
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
        labels = [name if len(solids) == 1 else f"{name} of {solid.name}" for solid, name, _ in named[:most]]
        entries = [(label, COLOURS[i % len(COLOURS)]) for i, label in enumerate(labels)]
        tall = min(0.05 * len(entries) + 0.02, 0.95)
        view.add_legend(entries, bcolor=PAPER, face="rectangle", size=(0.95, tall), loc="center left")
    if path.suffix.lower() == ".png":
        view.screenshot(str(path))
    else:
        view.save_graphic(str(path))
    view.close()
    return path


def surface_of(pv: Any, mesh: Any, facets: np.ndarray) -> Any:
    """Some facets of a mesh as pyvista has them."""
    return pv.PolyData(mesh.p.T, polygons(mesh.facets[:, facets].T))
