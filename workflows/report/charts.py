"""What the scripts of a page draw, as plain data: curves as plotly figures, the worn part as surfaces to turn."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.hbm.quantity import StatedQuantity
from tribodyn.workflows.pictures.figures import status_name
from tribodyn.workflows.pictures.loop_plots import loop_size, pair_name
from tribodyn.workflows.pictures.theme import CYCLE, GREY, INK, STATUS
from tribodyn.workflows.pictures.view import grid_of, looking, wear_scale
from tribodyn.workflows.pictures.wear_plots import with_gaps
from tribodyn.workflows.result.answers import histories_of
from tribodyn.workflows.result.contact_states import ContactState, shown_states, state_of
from tribodyn.workflows.result.faces import bodies, meetings_of, worn_off
from tribodyn.workflows.result.number_format import axis_unit
from tribodyn.workflows.result.result import PartMesh, Result

Chart = dict[str, Any]

LOOPS = 3  # pairs whose loops are drawn
MOST_STATES = 25
LIFT = 2e-3  # of the patch, by which the colours of a face lie above it


def charts(results: Sequence[tuple[str, Result]]) -> dict[str, Chart]:
    """Charts by title, each with the curves of all results that have them."""
    charts_by_title = {"Response": _response(results), **_wear(results), "Hysteresis": _loops(results)}
    return {title: chart for title, chart in charts_by_title.items() if chart["data"]}


def _chart(data: list[Chart], x: str, y: str, log: bool = False) -> Chart:
    axis = {"showline": True, "linecolor": INK, "gridcolor": "#dfe2e6", "zeroline": False, "automargin": True}
    layout = {
        "xaxis": {**axis, "title": {"text": x}},
        "yaxis": {**axis, "title": {"text": y}, "type": "log" if log else "linear"},
        "margin": {"l": 60, "r": 12, "t": 10, "b": 45},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "height": 330 + 20 * max(len(data), 2),
        "font": {"color": INK},
        "legend": {"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom"},
        "hovermode": "closest",
        "colorway": list(CYCLE),
    }
    return {"data": data, "layout": layout}


def _line(name: str, x: np.ndarray, y: np.ndarray, **options: Any) -> Chart:
    return {"type": "scatter", "mode": "lines", "name": name, "x": plain(x), "y": plain(y), **options}


def plain(values: np.ndarray, digits: int = 7) -> list[Any]:
    """Numbers with a few digits as JSON has them; nan as null."""
    flat = np.asarray(values, float)
    if flat.ndim > 1:
        return [plain(row, digits) for row in flat]
    return [None if not np.isfinite(v) else float(f"{v:.{digits}g}") for v in flat]


def _response(results: Sequence[tuple[str, Result]]) -> Chart:
    data = []
    for number, (name, result) in enumerate(results):
        color = CYCLE[number % len(CYCLE)]
        linear, frf = result.references, result.response
        if linear is not None:
            hertz = linear.omega / (2 * np.pi)
            options: Chart = {"visible": True if number == 0 else "legendonly"}
            for label, height, dash in (("free", linear.free, "dash"), ("stuck", linear.stuck, "dot")):
                style = {"dash": dash, "color": GREY if label == "free" else INK, "width": 1}
                data.append(_line(f"{name}: {label}", hertz, 1e3 * height, line=style, **options))
        if frf is not None:
            good = frf.converged
            for k, output in enumerate(frf.displacements):
                height = np.where(good, 1e3 * frf.amplitude(output), np.nan)
                options = {"line": {"color": color}} if k == 0 else {"visible": "legendonly"}
                data.append(_line(f"{name}: {output}", frf.frequency, height, **options))
            if result.stability is not None:
                height = np.where(good & ~result.stability.stable, 1e3 * frf.amplitude(frf.output_names[0]), np.nan)
                data.append(_line(f"{name}: unstable", frf.frequency, height, line={"color": "#d55e00", "width": 4}))
        if result.wear is not None and result.wear_steps:
            hertz, height = with_gaps(result.wear, result.wear.omega / (2 * np.pi), 1e3 * result.wear.amplitude)
            data.append(_line(f"{name}: peak under wear", hertz, height, mode="lines+markers", marker={"size": 4}))
    return _chart(data, "frequency / Hz", "amplitude / mm", log=True)


def _wear(results: Sequence[tuple[str, Result]]) -> dict[str, Chart]:
    """A chart over the vibration cycles for each quantity that has a value at every row of the wear."""
    lines: dict[StatedQuantity, list[Chart]] = {}
    for name, result in results:
        if result.wear is None or not result.wear_steps:
            continue
        for quantity, values in histories_of(result).items():
            cycles, shown = with_gaps(result.wear, result.wear.cycles, axis_unit(quantity.unit)[1] * values)
            line = _line(name, cycles, shown, mode="lines+markers", marker={"size": 4})
            lines.setdefault(quantity, []).append(line)
    return {
        f"{quantity.title[:1].upper()}{quantity.title[1:]}": _chart(
            data, "vibration cycles", f"{quantity.label} / {axis_unit(quantity.unit)[0]}"
        )
        for quantity, data in lines.items()
    }


def _loops(results: Sequence[tuple[str, Result]]) -> Chart:
    data = []
    for name, result in results:
        loops, patch = result.loops, result.patch
        if loops is None:
            continue
        size = loop_size(result)
        busiest = int(np.argmax(size.sum(axis=(1, 2))))
        for at, row in enumerate(loops.row):
            for rank, pair in enumerate(np.argsort(-size[at].sum(axis=1))[:LOOPS]):
                c = int(np.argmax(size[at, pair]))
                x, f = loops.displacement[at, pair, c], loops.force[at, pair, c]
                where = f"{pair_name(result, int(pair))}, {patch.components[c]}"
                label = f"{name}: {state_of(result, int(row)).label}, {where}"
                shown = {"visible": True if (at, rank) == (busiest, 0) else "legendonly"}
                data.append(_line(label, 1e6 * np.append(x, x[0]), np.append(f, f[0]), **shown))
    return _chart(data, "relative displacement / µm", "contact force / N")


def solid(result: Result) -> dict[str, Any] | None:
    """Vertices, triangles and fields for the page, lengths in mm; None where the result has no faces of a contact.

    body : x, y, z, i, j, k of the surface of the mesh, and how far each vertex moves when the bodies are drawn apart
    sides : for each face of each contact its pairs, i, j, k over these, and how far it moves with its body
    states : label, for each state moved vertices of the body, positions of the sides, and fields of the pairs"""
    patch, part = result.patch, result.part
    if not len(patch.faces):
        return None
    states = _states(result)
    meetings = meetings_of(result)
    size = float(np.sqrt(patch.area.sum()))
    factor = wear_scale(patch, np.stack([state.depth for state in states]))
    data: dict[str, Any] = {"worn": result.wear is not None, "factor": factor}
    nodes, offset = np.zeros(0, int), None
    points = patch.points if part is None else part.points
    data["extent"] = plain(np.ptp(points, axis=0) / np.ptp(points, axis=0).max())
    towards, up = looking(result)
    data["camera"] = [plain(1.9 * towards / np.linalg.norm(towards)), plain(up)]
    if part is not None:
        nodes, triangles = _surface(result)
        offset = apart(part)
        data["body"] = {
            "xyz": plain(1e3 * part.points[nodes].T, 6),
            "ijk": triangles.T.tolist(),
            "apart": plain(1e3 * offset[nodes].T, 5) if offset.any() else None,
        }
    sides = [
        (
            meeting.pairs,
            meeting.patch,
            face.points,
            face.outward,
            face.share,
            None if offset is None else offset[face.nodes[0]],
        )
        for meeting in meetings
        for face in meeting.faces
    ] or [(slice(0, len(patch.area)), patch, patch.points, patch.frames[:, 2], 0.5, None)]
    data["sides"] = [
        {
            "pairs": np.arange(len(patch.area))[pairs].tolist(),
            "ijk": np.concatenate(
                [patch_of_side.faces[:, [0, k, k + 1]] for k in range(1, patch_of_side.faces.shape[1] - 1)]
            ).T.tolist(),
            "apart": None if offset_of_side is None else plain(1e3 * offset_of_side, 5),
        }
        for pairs, patch_of_side, _, _, _, offset_of_side in sides
    ]
    data["states"] = []
    for state in states:
        entry: dict[str, Any] = {"label": state.label, "fields": _fields(result, state)}
        if part is not None:
            offset_of_side = factor * worn_off(meetings, state.depth, len(part.points))[nodes]
            moving = np.flatnonzero(offset_of_side.any(axis=1))
            entry["moved"] = [moving.tolist(), plain(1e3 * (part.points[nodes][moving] + offset_of_side[moving]), 6)]
        entry["faces"] = [
            plain(1e3 * (at + (LIFT * size - factor * share * state.depth[pairs, None]) * outward).T, 6)
            for pairs, _, at, outward, share, _ in sides
        ]
        data["states"].append(entry)
    data["status"] = {int(bits): [status_name(bits, patch.components), color] for bits, (_, color) in STATUS.items()}
    return data


def _states(result: Result) -> list[ContactState]:
    """Rows of the wear history, evenly chosen where there are many, or the peaks of a response that does not wear."""
    if result.wear is None or not len(result.wear.cycles):
        return shown_states(result)
    last = len(result.wear.cycles) - 1
    return [state_of(result, int(row)) for row in np.unique(np.linspace(0, last, MOST_STATES).round().astype(int))]


def _fields(result: Result, state: ContactState) -> dict[str, list[Any]]:
    fields: dict[str, list[Any]] = {}
    if result.wear is not None or state.pressure is None:
        fields["total wear depth / µm"] = plain(1e6 * state.depth, 5)
    if state.pressure is not None:
        fields["mean pressure / MPa"] = plain(1e-6 * state.pressure, 5)
    if result.wear is not None and len(result.wear.cycles):
        fields["friction work per cycle and area / J/m²"] = plain(
            result.wear.energy[state.number] / result.patch.area, 5
        )
    if state.status is not None:
        fields["status"] = [int(bits) for bits in state.status]
    return fields


def apart(part: PartMesh) -> np.ndarray:
    """(n_node, 3) how far each node moves with its body, away from the middle of the mesh, to show bodies apart [m]."""
    body = bodies(part)
    middles = np.array([part.points[body == number].mean(axis=0) for number in range(body.max() + 1)])
    return np.where(body[:, None] < 0, 0.0, (middles - part.points[body >= 0].mean(axis=0))[body])


def _surface(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the mesh on its surface, and the triangles (n, 3) over them; every node of a curved face is a corner."""
    part = result.part
    assert part is not None
    grid = grid_of(part)
    grid.point_data["body"] = bodies(part)
    shell = grid.extract_surface(nonlinear_subdivision=1, algorithm="dataset_surface").triangulate()
    shell = shell.compute_normals(consistent_normals=True, auto_orient_normals=True, split_vertices=False)
    nearest = _nearest(part.points, bodies(part), np.asarray(shell.points), np.asarray(shell.point_data["body"]))
    nodes, where = np.unique(nearest, return_inverse=True)
    return nodes, where[shell.faces.reshape(-1, 4)[:, 1:]]


def _nearest(mesh: np.ndarray, body: np.ndarray, points: np.ndarray, of: np.ndarray) -> np.ndarray:
    """For each point the nearest node of the mesh that is of the same body."""
    nearest = np.zeros(len(points), int)
    for number in np.unique(np.round(of)):
        mesh_nodes, of_body = np.flatnonzero(body == number), np.round(of) == number
        nearest[of_body] = mesh_nodes[cKDTree(mesh[mesh_nodes]).query(points[of_body])[1]]
    return nearest
