"""The worn part as surfaces that a page can turn, with the fields of its contact in every shown wear row."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.workflows.pictures.exploded import apart
from tribodyn.workflows.pictures.figures import status_name
from tribodyn.workflows.pictures.style import STATUS
from tribodyn.workflows.pictures.view import grid_of, looking, wear_scale
from tribodyn.workflows.report.charts import plain
from tribodyn.workflows.result.faces import bodies, meetings_of, worn_off
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.states import State, shown_states, state_of

MOST_STATES = 25
LIFT = 2e-3  # of the patch, by which the colours of a face lie above it


def solid(result: Result) -> dict[str, Any] | None:
    """Vertices, triangles and fields for the page, lengths in mm; None where the result has no faces of a contact.

    body : x, y, z, i, j, k of the surface of the mesh, and how far each vertex moves when the bodies are drawn apart
    sides : for each face of each contact its pairs, i, j, k over these, and how far it moves with its body
    states : label, for each state moved vertices of the body, positions of the sides, and fields of the pairs
    """
    patch, part = result.patch, result.part
    if not len(patch.faces):
        return None
    states = _states(result)
    meetings = meetings_of(result)
    size = float(np.sqrt(patch.area.sum()))
    factor = wear_scale(patch, np.stack([state.depth for state in states]))
    found: dict[str, Any] = {"worn": result.wear is not None, "factor": factor}
    nodes, offset = np.zeros(0, int), None
    points = patch.points if part is None else part.points
    found["extent"] = plain(np.ptp(points, axis=0) / np.ptp(points, axis=0).max())
    towards, up = looking(result)
    found["camera"] = [plain(1.9 * towards / np.linalg.norm(towards)), plain(up)]
    if part is not None:
        nodes, triangles = _surface(result)
        offset = apart(result)
        found["body"] = {
            "xyz": plain(1e3 * part.points[nodes].T, 6),
            "ijk": triangles.T.tolist(),
            "apart": plain(1e3 * offset[nodes].T, 5) if offset.any() else None,
        }
    sides = [
        (one.pairs, one.patch, face.points, face.outward, face.share, None if offset is None else offset[face.nodes[0]])
        for one in meetings
        for face in one.faces
    ] or [(slice(0, len(patch.area)), patch, patch.points, patch.frames[:, 2], 0.5, None)]
    found["sides"] = [
        {
            "pairs": np.arange(len(patch.area))[pairs].tolist(),
            "ijk": np.concatenate([own.faces[:, [0, k, k + 1]] for k in range(1, own.faces.shape[1] - 1)]).T.tolist(),
            "apart": None if moved is None else plain(1e3 * moved, 5),
        }
        for pairs, own, _, _, _, moved in sides
    ]
    found["states"] = []
    for state in states:
        entry: dict[str, Any] = {"label": state.label, "fields": _fields(result, state)}
        if part is not None:
            moved = factor * worn_off(meetings, state.depth, len(part.points))[nodes]
            there = np.flatnonzero(moved.any(axis=1))
            entry["moved"] = [there.tolist(), plain(1e3 * (part.points[nodes][there] + moved[there]), 6)]
        entry["faces"] = [
            plain(1e3 * (at + (LIFT * size - factor * share * state.depth[pairs, None]) * outward).T, 6)
            for pairs, _, at, outward, share, _ in sides
        ]
        found["states"].append(entry)
    found["status"] = {int(bits): [status_name(bits, patch.components), color] for bits, (_, color) in STATUS.items()}
    return found


def _states(result: Result) -> list[State]:
    """Rows of the wear history, evenly chosen where there are many, or the peaks of a response that does not wear."""
    if result.wear is None or not len(result.wear.cycles):
        return shown_states(result)
    last = len(result.wear.cycles) - 1
    return [state_of(result, int(row)) for row in np.unique(np.linspace(0, last, MOST_STATES).round().astype(int))]


def _fields(result: Result, state: State) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    if result.wear is not None or state.pressure is None:
        found["total wear depth / µm"] = plain(1e6 * state.depth, 5)
    if state.pressure is not None:
        found["mean pressure / MPa"] = plain(1e-6 * state.pressure, 5)
    if result.wear is not None and len(result.wear.cycles):
        found["friction work per cycle and area / J/m²"] = plain(
            result.wear.energy[state.number] / result.patch.area, 5
        )
    if state.status is not None:
        found["status"] = [int(bits) for bits in state.status]
    return found


def _surface(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the mesh on its surface, and the triangles (n, 3) over them; every node of a curved face is a corner."""
    part = result.part
    assert part is not None
    grid = grid_of(part)
    grid.point_data["body"] = bodies(part)
    shell = grid.extract_surface(nonlinear_subdivision=1, algorithm="dataset_surface").triangulate()
    shell = shell.compute_normals(consistent_normals=True, auto_orient_normals=True, split_vertices=False)
    near = _nearest(part.points, bodies(part), np.asarray(shell.points), np.asarray(shell.point_data["body"]))
    nodes, where = np.unique(near, return_inverse=True)
    return nodes, where[shell.faces.reshape(-1, 4)[:, 1:]]


def _nearest(mesh: np.ndarray, body: np.ndarray, points: np.ndarray, of: np.ndarray) -> np.ndarray:
    """For each point the nearest node of the mesh that is of the same body."""
    found = np.zeros(len(points), int)
    for number in np.unique(np.round(of)):
        own, here = np.flatnonzero(body == number), np.round(of) == number
        found[here] = own[cKDTree(mesh[own]).query(points[here])[1]]
    return found
