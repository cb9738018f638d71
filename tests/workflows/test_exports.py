"""What is exported is read back with the readers of each format, and gives the numbers of the result."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pandas as pd
import pytest
import pyuff
import pyvista as pv
import xarray as xr
from scipy.io import loadmat
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from tests.helpers.command import refusal
from tests.helpers.nodes_of_pairs import node_of_pair
from tests.helpers.synthetic_result import block, result
from tribodyn.reduction import foreign
from tribodyn.workflows.export import formats, result_tables, vtk
from tribodyn.workflows.report import charts
from tribodyn.workflows.result import contact_states, faces, store
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.structure_tables import NamedContact

SMALL = (
    "verdict.enabled=false", "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=2",
    "geometry.n_height=1", "reduction.modes=3", "response.points=5", "wear=",
)  # fmt: skip


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """A real run without wear, small."""
    return pipeline.run(scene_file.read("beam", SMALL), tmp_path_factory.mktemp("small"), Progress())


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the series of the made-up result."""
    folder = tmp_path_factory.mktemp("series")
    assert {path.stem for path in formats.write(result(), ["vtk"], folder)} >= {
        "part_wear", "contact_wear", "part_cycle_0", "contact_cycle_8",
    }  # fmt: skip
    return folder / "vtk"


def test_pandas_reads_every_table_with_all_digits(tmp_path: Path) -> None:
    synthetic = result()
    for path in formats.write(synthetic, ["csv"], tmp_path):
        read = pd.read_csv(path)
        expected = result_tables.tables(synthetic)[path.stem]
        assert list(read.columns) == list(expected)
        for name, column in expected.items():
            np.testing.assert_array_equal(read[name].to_numpy(), column)
    assert {"response", "wear", "wear_of_pairs", "pairs", "loops", "references"} <= {
        path.stem for path in (tmp_path / "csv").iterdir()
    }


def test_scipy_reads_the_matlab_file(tmp_path: Path) -> None:
    synthetic = result()
    (path,) = formats.write(synthetic, ["mat"], tmp_path)
    read = loadmat(path, simplify_cells=True)
    np.testing.assert_array_equal(read["wear"]["cycles"], synthetic.wear.cycles)
    np.testing.assert_array_equal(read["response"]["response_amplitude_m"], synthetic.response.amplitude("response"))
    assert list(read["bifurcations"]["kind"]) == ["fold", "fold"]
    assert read["provenance"]["scene_name"] == "beam"
    assert read["facts"]["delta_max"] == 5e-3


def test_pyuff_reads_responses(tmp_path: Path) -> None:
    synthetic = result()
    (path,) = formats.write(synthetic, ["uff"], tmp_path)
    sets = pyuff.UFF(str(path)).read_sets()
    response = next(s for s in sets if s["type"] == 58 and s["id1"].startswith("response over force, harmonic 1"))
    assert response["func_type"] == 4
    load = synthetic.scene.loads.harmonic["shake"]
    expected = (synthetic.response.response[:, 0, 1] - 1j * synthetic.response.response[:, 0, 2]) / load.value
    np.testing.assert_allclose(response["data"], expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(response["x"], synthetic.response.frequency, rtol=1e-5)  # single precision in the format


def test_two_forces_are_no_frequency_response_function() -> None:
    synthetic = result()
    loads = synthetic.scene.loads
    harmonic_loads = loads.model_copy(update={"harmonic": {**loads.harmonic, "more": loads.harmonic["shake"]}})
    assert synthetic.driving_force == pytest.approx(1e4)
    assert replace(synthetic, scene=synthetic.scene.model_copy(update={"loads": harmonic_loads})).driving_force is None


def test_paraview_reader_opens_the_series(series: Path) -> None:
    synthetic = result()
    wear, patch, part = synthetic.wear, synthetic.patch, synthetic.part
    reader = pv.PVDReader(series / "contact_wear.pvd")
    np.testing.assert_array_equal(reader.time_values, wear.cycles)
    reader.set_active_time_point(4)
    surface = reader.read()[0]
    np.testing.assert_array_equal(surface.point_data["depth"], wear.depth[4])
    np.testing.assert_array_equal(surface.point_data["status"], wear.status[4])
    np.testing.assert_allclose(surface.cell_data["pressure"], (wear.normal_force[4] / patch.area)[patch.faces].mean(1))
    np.testing.assert_allclose(
        surface.points, patch.points - 0.5 * wear.depth[4][:, None] * patch.frames[:, 2], atol=1e-15
    )
    grid = _read(series / "part_wear.pvd", 8)
    assert grid.n_cells == len(part.cells)
    np.testing.assert_allclose(grid.point_data["depth_on_this_face"][patch.nodes], 0.5 * wear.depth[8])
    np.testing.assert_array_equal(grid.point_data["displacement_b1"], synthetic.fields.displacement[2, ..., 2])
    worn = grid.point_data["worn_off"]
    np.testing.assert_allclose(grid.points - worn, part.points, atol=1e-15)
    assert np.linalg.norm(worn, axis=1).max() == pytest.approx(0.5 * wear.depth[8].max())
    assert grid.field_data["cycles"][0] == wear.cycles[8]


def test_a_cycle_is_the_sum_of_its_harmonics(series: Path) -> None:
    synthetic = result()
    terms = synthetic.fields.displacement[1]
    quarter = _read(series / "part_cycle_4.pvd", vtk.INSTANTS // 4)
    np.testing.assert_allclose(quarter.point_data["displacement"], terms[..., 0] + terms[..., 2], atol=1e-15)


def test_the_contact_over_a_cycle_has_forces_and_status_of_its_instants(series: Path) -> None:
    """Read by VTK itself, as ParaView does; forces are vectors along x, y, z."""
    synthetic = result()
    loops, patch = synthetic.loops, synthetic.patch
    listing = ElementTree.parse(series / "contact_cycle_4.pvd")
    entries = [(float(e.attrib["timestep"]), series / e.attrib["file"]) for e in listing.iter("DataSet")]
    np.testing.assert_allclose([time for time, _ in entries], np.arange(vtk.INSTANTS) / vtk.INSTANTS)
    instant = 5
    sample = instant * loops.force.shape[-1] // vtk.INSTANTS
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(entries[instant][1]))
    reader.Update()
    fields = reader.GetOutput().GetPointData()
    force = vtk_to_numpy(fields.GetArray("contact_force"))
    np.testing.assert_allclose(np.einsum("pcx,px->pc", patch.frames, force), loops.force[1, :, :, sample], atol=1e-9)
    shifted = vtk_to_numpy(fields.GetArray("relative_displacement"))
    np.testing.assert_allclose(
        np.einsum("pcx,px->pc", patch.frames, shifted), loops.displacement[1, :, :, sample], atol=1e-15
    )
    status = vtk_to_numpy(fields.GetArray("status_now"))
    np.testing.assert_array_equal(status, contact_states.instant_status(synthetic, 1)[:, sample])


def _read(listing: Path, number: int) -> pv.DataSet:
    reader = pv.PVDReader(listing)
    reader.set_active_time_point(number)
    return reader.read()[0]


@pytest.mark.parametrize("ending", [".xdmf", ".vtu", ".bdf"])
def test_meshio_reads_the_worn_part(ending: str, tmp_path: Path) -> None:
    synthetic = result()
    path = next(p for p in formats.write(synthetic, ["mesh"], tmp_path, ending) if p.suffix == ending)
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.cells_dict["hexahedron"], synthetic.part.cells)
    displacement = np.abs(mesh.points - synthetic.part.points).max(axis=1)
    np.testing.assert_allclose(
        displacement[synthetic.patch.nodes], 0.5 * synthetic.wear.depth[-1], atol=1e-6 if ending == ".bdf" else 1e-14
    )
    if ending != ".bdf":
        np.testing.assert_allclose(
            mesh.point_data["depth_on_this_face"][synthetic.patch.nodes], 0.5 * synthetic.wear.depth[-1]
        )


def test_xarray_opens_the_result_file(tmp_path: Path) -> None:
    synthetic = result()
    store.save(tmp_path / "result.h5", synthetic)
    with xr.open_dataset(tmp_path / "result.h5", group="wear", engine="h5netcdf") as wear:
        np.testing.assert_array_equal(wear["depth"], synthetic.wear.depth)
        assert wear["depth"].dims == ("row", "pair")
        assert wear["depth"].attrs["units"] == "m"
    tree = xr.open_datatree(tmp_path / "result.h5", engine="h5netcdf")
    assert set(store.SCHEMA) <= set(tree.children)
    assert bool(tree["stability"]["stable"][0])
    tree.close()


def test_reduced_matrices_are_those_of_the_run(small: Result, tmp_path: Path) -> None:
    model = formats.reduced_model(small)
    expected = formats.arrays(model)
    formats.write(small, ["npz", "matlab"], tmp_path)
    npz = foreign.read_matrices(tmp_path / "npz" / "reduced.npz")
    np.testing.assert_allclose(
        npz.stiffness.toarray(), expected["K"], rtol=1e-12, atol=1e-12 * np.abs(expected["K"]).max()
    )
    np.testing.assert_allclose(npz.mass.toarray(), expected["M"], rtol=1e-12, atol=1e-12 * np.abs(expected["M"]).max())
    exact = {name: (expected[name] + expected[name].T) / 2 for name in "MKC"}
    rebuilt = foreign.read_matrices(tmp_path / "matlab" / "reduced.mat")
    assert rebuilt.damping is not None
    for name, read in zip("MKC", (rebuilt.mass, rebuilt.stiffness, rebuilt.damping), strict=True):
        assert np.array_equal(read.toarray(), exact[name])
    assert npz.damping is not None
    free = np.sort(np.linalg.eigvals(np.linalg.solve(npz.mass.toarray(), npz.stiffness.toarray())).real)
    np.testing.assert_allclose(np.sqrt(free[:2]) / (2 * np.pi), small.facts.open_frequencies[:2], rtol=1e-6)


def two_blocks(fine: int) -> Result:
    """Two blocks one upon the other, the lower one with a mesh of its own."""
    synthetic = result()
    part, lower_body = synthetic.part, block(fine, fine // 4, 2)
    lower = lower_body.points - [0, 0, np.ptp(lower_body.points[:, 2])]
    blocks = replace(
        part,
        points=np.concatenate([lower, part.points]),
        cells=np.concatenate([lower_body.cells, part.cells + len(lower)]),
    )
    patch = replace(synthetic.patch, nodes=synthetic.patch.nodes + len(lower))
    return replace(synthetic, part=blocks, patch=patch, facts=replace(synthetic.facts, wear_split=0.25))


def test_both_faces_of_a_contact_inside_the_mesh() -> None:
    """Nodes of both blocks stand at the same places."""
    synthetic = two_blocks(8)
    part, patch = synthetic.part, synthetic.patch
    (meeting,) = faces.meetings_of(synthetic)
    first, second = meeting.faces
    np.testing.assert_array_equal(node_of_pair(first), patch.nodes)
    np.testing.assert_allclose(part.points[node_of_pair(second)], patch.points)
    assert (second.nodes < patch.nodes.min()).all()
    assert (first.share, second.share) == (0.25, 0.75)
    displacement = faces.worn_off((meeting,), np.full(len(patch.area), 1e-3), len(part.points))
    np.testing.assert_allclose(displacement[first.nodes, 2], 0.25e-3)  # body 1 lies above, its face is worn upwards
    np.testing.assert_allclose(displacement[second.nodes, 2], -0.75e-3)
    assert len(np.unique(faces.bodies(part))) == 2


def test_a_face_whose_mesh_does_not_match_wears_as_the_pairs_around_its_nodes() -> None:
    """A depth that is linear over the patch is taken off every node of the other face exactly."""
    synthetic = two_blocks(20)
    part, patch = synthetic.part, synthetic.patch
    (meeting,) = faces.meetings_of(synthetic)
    other = meeting.faces[1]
    assert len(other.nodes) == 6 * 6  # x from 0.15 to 0.2 m in steps of 0.01 m, six nodes across
    depth = lambda at: 1e-3 + 5e-3 * (at[:, 0] - 0.15) + 0.01 * at[:, 1]  # noqa: E731
    displacement = faces.worn_off((meeting,), depth(patch.points), len(part.points))
    np.testing.assert_allclose(displacement[other.nodes, 2], -0.75 * depth(part.points[other.nodes]), rtol=1e-9)
    assert not displacement[np.setdiff1d(np.arange(len(part.points)), np.concatenate([other.nodes, patch.nodes]))].any()


def test_bodies_are_drawn_apart() -> None:
    synthetic = two_blocks(20)
    part = synthetic.part
    assert part is not None
    body, offsets = faces.bodies(part), charts.apart(part)
    upper, lower = (body == number for number in body[[synthetic.patch.nodes[0], 0]])
    distance = part.points[upper].mean(axis=0) - part.points[lower].mean(axis=0)
    np.testing.assert_allclose(offsets[upper][0] - offsets[lower][0], distance, atol=1e-12)
    assert result().part is not None
    assert not charts.apart(result().part).any()


def test_status_at_an_instant_is_that_of_the_force() -> None:
    synthetic = result()
    loops, patch = synthetic.loops, synthetic.patch
    force = np.zeros((1, len(patch.area), 3, 4))  # of one state, at four instants
    force[0, 0] = [[0, 4, -5, 0], [0, 4, 0, 0], [10, 10, 10, 0]]  # mu = 0.5: sticks, sticks (5.7 in all), slips, open
    force[0, 1:, 2] = 10.0
    force[0, 2, 0] = 1.0
    status = contact_states.instant_status(
        replace(synthetic, loops=replace(loops, row=loops.row[:1], displacement=force, force=force)), 0
    )
    np.testing.assert_array_equal(status[0], [1, 1, 2, 4])
    np.testing.assert_array_equal(status[1:], 1)


def test_every_named_contact_slips_at_its_own_friction() -> None:
    """Two contacts with 0.5 and 0.1: the same forces stick in the one and slip in the other."""
    synthetic = result()
    n = len(synthetic.patch.area)
    table = {"group": "face", "first": "a", "second": "b"}
    first, second = (NamedContact.model_construct(**table, friction=mu) for mu in (0.5, 0.1))
    contacts = {"first": first, "second": second, "third": NamedContact.model_construct(**table)}
    force = np.zeros((1, n, 3, 2))
    force[..., 0, :], force[..., 2, :] = 1.0, 10.0
    joints = {"first": slice(0, 4), "second": slice(4, 6), "third": slice(6, n)}
    with_contacts = replace(
        synthetic,
        scene=synthetic.scene.model_copy(update={"contact": None, "contacts": contacts}),
        facts=replace(synthetic.facts, joints=joints),
        loops=replace(synthetic.loops, row=synthetic.loops.row[:1], displacement=force, force=force),
    )
    status = contact_states.instant_status(with_contacts, 0)
    assert (status[:4] == 1).all()
    assert (status[4:6] == 2).all()
    assert (status[6:] == 1).all()


@pytest.mark.parametrize(("arguments", "words"), [
    (["--to", "paper"], "--to paper: no such format; there are vtk, csv"),
    (["--to", "mesh", "--mesh-ending", ".docx"], 'no format ".docx"'),
])  # fmt: skip
def test_wrong_wishes_are_one_sentence(arguments, words, tmp_path, capsys):
    store.save(tmp_path / "result.h5", result())
    assert words in refusal(["export", str(tmp_path), *arguments], capsys)
