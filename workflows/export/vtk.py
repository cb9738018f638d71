"""Part and contact with their fields: for pyvista, as a mesh file, as series for ParaView over wear and over a cycle.

Point coordinates are those of the worn part at rest, not exaggerated; displacements are fields, to warp by in ParaView.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from tribodyn.extras import package
from tribodyn.fem.stress import COMPONENTS
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.view import cycle, grid_of, polygons, swing
from tribodyn.workflows.result.contact_states import ContactState, instant_status, over_a_cycle, shown_states, state_of
from tribodyn.workflows.result.faces import meetings_of, worn_off
from tribodyn.workflows.result.result import Result

if TYPE_CHECKING:
    import pyvista as pv

KIND = {"triquadratic_hexahedron": "hexahedron27", "quadratic_tetra": "tetra10"}  # where meshio has another name
WITH_FIELDS = (".xdmf", ".vtu", ".vtk", ".msh", ".exo", ".e", ".med")
MESH_ONLY = (".bdf", ".nas", ".inp", ".unv", ".mesh", ".cgns")
INSTANTS = 32  # of a period
VOIGT = [COMPONENTS.index(name) for name in ("xx", "yy", "zz", "xy", "yz", "xz")]  # the order of VTK
FULL = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])  # of components in that order, a tensor


def write_mesh(result: Result, folder: Path, ending: str = ".xdmf") -> list[Path]:
    """The part as worn in the last state that is shown, in the format that the ending of its file names.

    Raises  ValueError where the result has no mesh or the format cannot hold it"""
    meshio, path = package("meshio"), folder / f"part{ending}"
    if result.part is None:
        raise Refusal("mesh: this result keeps no mesh; run a scene with a part and pictures.renders = true")
    if path.suffix not in (*WITH_FIELDS, *MESH_ONLY):
        raise Refusal(f'mesh: no format "{path.suffix}": take one of {", ".join((*WITH_FIELDS, *MESH_ONLY))}')
    grid = part_grid(result, shown_states(result)[-1])
    data: dict[str, Any] = {}
    if path.suffix in WITH_FIELDS:
        data = {name: _plain(np.asarray(grid.point_data[name])) for name in grid.point_data}
    kind = KIND.get(result.part.kind, result.part.kind)
    mesh = meshio.Mesh(np.asarray(grid.points), [(kind, result.part.cells)], point_data=data)
    try:
        meshio.write(path, mesh)
    except (meshio.WriteError, KeyError, AssertionError) as error:
        path.unlink(missing_ok=True)
        raise Refusal(f"mesh: {path.suffix} cannot hold {kind} elements ({error}); take .xdmf or .vtu") from None
    return sorted(path.parent.glob(f"{path.stem}.*"))


def _plain(values: np.ndarray) -> np.ndarray:
    return values.astype(float) if values.dtype.kind in "iu" else values


def write_vtk(result: Result, folder: Path) -> list[Path]:
    """wear/ and cycle_N/ with their files, and one .pvd for each series; returns the .pvd files.

    Raises  ValueError where the result has neither faces of its contact nor a mesh"""
    if not len(result.patch.faces) and result.part is None:
        raise Refusal("vtk: the contact of this result has no faces and its part no mesh; nothing can be drawn of it")
    written: list[Path] = []
    if result.wear is not None and len(result.wear.cycles):
        states = [state_of(result, row) for row in range(len(result.wear.cycles))]
        times = [state.cycles for state in states]
        for name, make in (("part", part_grid), ("contact", contact_surface)):
            if _has(result, name):
                written.append(
                    _series(folder, f"{name}_wear", times, [partial(make, result, state) for state in states])
                )
    for state in shown_states(result):
        written += _cycle(result, state, folder)
    return written


def _has(result: Result, name: str) -> bool:
    return result.part is not None if name == "part" else len(result.patch.faces) > 0


def _cycle(result: Result, state: ContactState, folder: Path) -> list[Path]:
    """The series over one period of a state; time is the share of the period."""
    written, times = [], (np.arange(INSTANTS) / INSTANTS).tolist()
    if state.field is not None and result.part is not None:
        _, positions = over_a_cycle(result, state.field, INSTANTS)

        def moving(i: int) -> Any:
            grid = part_grid(result, state)
            grid.point_data["displacement"] = positions[i]
            return grid

        written.append(
            _series(folder, f"part_cycle_{state.number}", times, [partial(moving, i) for i in range(INSTANTS)])
        )
    loops = result.loops
    if loops is not None and state.number in loops.row.tolist() and _has(result, "contact"):
        at = loops.row.tolist().index(state.number)
        samples = loops.force.shape[-1]
        status = instant_status(result, at)

        def touching(i: int) -> Any:
            surface, k = contact_surface(result, state), i * samples // INSTANTS
            surface.point_data["relative_displacement"] = _vectors(result, loops.displacement[at, :, :, k])
            surface.point_data["contact_force"] = _vectors(result, loops.force[at, :, :, k])
            surface.point_data["status_now"] = status[:, k]
            return surface

        if samples % INSTANTS == 0:
            names = [partial(touching, i) for i in range(INSTANTS)]
            written.append(_series(folder, f"contact_cycle_{state.number}", times, names))
    return written


def _vectors(result: Result, components: np.ndarray) -> np.ndarray:
    """Components (n_pair, n_component) along t1, t2, n as vectors (n_pair, 3) along x, y, z."""
    names = ("t1", "t2", "n")
    axes = result.patch.frames[:, [names.index(name) for name in result.patch.components]]
    return np.asarray(np.einsum("pc,pcx->px", components, axes))


def mesh_fields(result: Result, row: int | None = None) -> pv.UnstructuredGrid:
    """The worn part as a pyvista grid, with `part_grid`'s fields and the motion of a state that keeps one.

    row : of the wear history or the response, among `result.fields.row`; the last of them by default
    Point data: vibration (n_node, 3), displacement from the mean position at the largest swing; amplitude (n_node,),
    largest distance from there over the cycle [m]
    Raises  ValueError where the result keeps no mesh or no field at the row"""
    if result.part is None or result.fields is None:
        raise Refusal("the result keeps no fields on a mesh: its scene needs a part, [wear] and pictures.renders")
    rows = result.fields.row.tolist()
    row = rows[-1] if row is None else row
    if row not in rows:
        raise Refusal(f"the result has no field at wear row {row}: it has those at {', '.join(map(str, rows))}")
    grid, displacement = part_grid(result, state_of(result, row)), result.fields.displacement[rows.index(row)]
    grid.point_data["vibration"] = swing(displacement, result.harmonics)
    grid.point_data["amplitude"] = np.linalg.norm(cycle(displacement, result.harmonics), axis=1).max(axis=1)
    return grid


def patch_fields(result: Result, row: int | None = None) -> pv.PolyData:
    """The faces of the contact as `contact_surface` has them in point_data and cell_data, at a wear row, else the last.

    Raises  ValueError where the result has no worn patch with faces"""
    wear = result.wear
    if wear is None or not len(wear.cycles) or not len(result.patch.faces):
        raise Refusal("the result holds no worn patch with faces")
    rows = range(len(wear.cycles))
    if row is not None and row not in rows:
        raise Refusal(f"the result has no wear row {row}: it has 0 to {rows[-1]}")
    return contact_surface(result, state_of(result, rows[-1] if row is None else row))


def part_grid(result: Result, state: ContactState) -> Any:
    """The worn part as a pyvista grid of one state.

    Point data: worn_off (n_node, 3) [m]; depth_on_this_face [m]; face, of the contact, 1, 2 or 0; Fourier coefficients
    displacement_a0, ... (n_node, 3) where the state keeps them [m]
    With stress [Pa]: tensors (n_node, 6) of xx, yy, zz, xy, yz, xz, as ParaView has them: stress_mean over the cycle,
    stress_at_largest at the instant of largest_von_mises, and of that principal_stress (n_node, 3) from the largest
    and hydrostatic_pressure, minus a third of their sum; utilisation, nan where the strength is not known"""
    part = result.part
    assert part is not None
    meetings = meetings_of(result)
    wear_displacement = worn_off(meetings, state.depth, len(part.points))
    grid = grid_of(part, part.points + wear_displacement)
    grid.point_data["worn_off"] = wear_displacement
    depth, contact = np.zeros(len(part.points)), np.zeros(len(part.points), np.int8)
    for meeting in meetings:
        for number, face in enumerate(meeting.faces):
            depth[face.nodes] = face.share * (face.weights @ state.depth[meeting.pairs])
            contact[face.nodes] = number + 1
    grid.point_data["depth_on_this_face"], grid.point_data["face"] = depth, contact
    if state.field is not None and result.fields is not None:
        terms = result.fields.displacement[state.field]
        basis = HarmonicBasis(result.harmonics, 2 * result.harmonics[-1] + 1)
        for k, order in enumerate(basis.order):
            letter = "b" if k and basis.order[k - 1] == order else "a"
            grid.point_data[f"displacement_{letter}{order}"] = terms[..., k]
    stress = None if result.stress_field is None else result.stress_field.of(state.number)
    if stress is not None:
        mean, largest = np.moveaxis(stress.tensor[..., VOIGT], 1, 0)
        principal = np.linalg.eigvalsh(largest[:, FULL])[:, ::-1]
        grid.point_data["stress_mean"], grid.point_data["stress_at_largest"] = mean, largest
        grid.point_data["principal_stress"] = principal
        grid.point_data["hydrostatic_pressure"] = -principal.mean(axis=1)
        grid.point_data["largest_von_mises"] = stress.largest
        grid.point_data["fatigue_utilisation"] = stress.utilisation
    grid.field_data["frequency_Hz"] = [state.omega / (2 * np.pi)]
    grid.field_data["cycles"] = [state.cycles]
    return grid


def contact_surface(result: Result, state: ContactState) -> Any:
    """Body 1's face of the contact as a pyvista surface: fields at its pairs and their means on its faces.

    depth, gap with it [m]; area [m2]; pressure [Pa], mean over the cycle; energy_per_cycle [J]; normal; status, bits of
    hbm.contact.contact_law (1 sticks, 2 slips, 4 separates)"""
    pv = package("pyvista")

    patch = result.patch
    split = result.facts.share_of_body_1
    surface = pv.PolyData(patch.points - split * state.depth[:, None] * patch.frames[:, 2], polygons(patch.faces))
    fields: dict[str, np.ndarray] = {"depth": state.depth, "area": patch.area, "gap": patch.gap + state.depth}
    if state.pressure is not None:
        fields["pressure"] = state.pressure
    if result.wear is not None and len(result.wear.cycles):
        fields["energy_per_cycle"] = result.wear.energy[state.number]
    for name, values in fields.items():
        surface.point_data[name] = values
        surface.cell_data[name] = values[patch.faces].mean(axis=1)
    if state.status is not None:
        surface.point_data["status"] = state.status
    surface.point_data["normal"] = patch.frames[:, 2]
    surface.field_data["frequency_Hz"] = [state.omega / (2 * np.pi)]
    surface.field_data["cycles"] = [state.cycles]
    return surface


def _series(folder: Path, name: str, times: Sequence[float], make: Sequence[Callable[[], Any]]) -> Path:
    """Write the data sets of a series and the .pvd that lists them with their times."""
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "<Collection>",
    ]
    for i, (time, data) in enumerate(zip(times, make, strict=True)):
        grid = data()
        path = place / f"{name}_{i:04d}{'.vtp' if type(grid).__name__ == 'PolyData' else '.vtu'}"
        grid.save(path)
        lines.append(f'<DataSet timestep="{time:.17g}" part="0" file={quoteattr(f"{name}/{path.name}")}/>')
    listing = folder / f"{name}.pvd"
    listing.write_text("\n".join([*lines, "</Collection>", "</VTKFile>", ""]), encoding="utf-8")
    return listing
