"""Only what a scene asks for: unknowns, stored arrays, factorisations, systems and imports of every scene, counted.

Every scene runs once in a process of its own, on a mesh file, shortened where its length is not what counts."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.helpers.matrix_scene import matrix_folder
from tests.helpers.verification_models import random_structure
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.workflows.result import summary
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

ROOT = Path(__file__).parents[2]
ALWAYS = {"facts", "frf", "patch", "provenance", "references"}
DRAWN = {"fields", "loops", "part"}
WEAR = {"wear"} | DRAWN
RUNS: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "beam": (
        (
            "harmonics.kept=[0, 1]", "geometry.n_patch=5", "response.points=6", "wear.max_steps=2",
            "wear.at=peak", "wear.motion=balance",
        ),
        # systems : linear systems that the harmonics see; extra : masters that are neither contact nor modes
        {"pairs": 25, "components": 3, "coefficients": 3, "systems": 1, "groups": ALWAYS | WEAR | {"wear/memory"}},
    ),
    "beam, nothing drawn": (
        (
            "harmonics.kept=[0, 1]", "geometry.n_patch=5", "response.points=6", "wear.max_steps=2",
            "pictures.plots=false", "pictures.renders=false", "wear.at=peak", "wear.motion=balance",
        ),
        {"pairs": 25, "components": 3, "coefficients": 3, "systems": 1, "groups": ALWAYS | {"wear", "wear/memory"}},
    ),
    "leaf_seal_thesis": (("response.frequency=[250, 300]",),
        {"pairs": 126, "components": 1, "coefficients": 3, "systems": 1, "groups": ALWAYS | {"stability"} | DRAWN}),
    "rig_thesis": (
        ("response.method='natural'", "response.points=2", "response.frequency=[250, 252]", "wear="),
        # harmonic 0 has the platform's height prescribed, the others do not
        {"pairs": 55, "components": 3, "coefficients": 7, "systems": 2, "groups": ALWAYS | DRAWN},
    ),
    "blade_thesis": (
        ("response.points=4", "wear.max_steps=1"),
        # every harmonic of a travelling wave sees its own nodal diameter
        {"pairs": 20, "components": 3, "coefficients": 3, "systems": 2, "groups": ALWAYS | WEAR},
    ),
}  # fmt: skip


def on_a_mesh_file(name: str, overrides: tuple[str, ...], folder: Path) -> list[str]:
    """Overrides that take the scene's mesh from a file instead of its part."""
    geometry = [text for text in overrides if text.startswith("geometry.")]
    file = scene_file.read(name, geometry)
    modelling.make_mesh(file, folder)
    inputs = file.mesh_scene.geometry
    axes = ", ".join(f"{group} = {json.dumps(letters)}" for group, letters in inputs.fixed_axes.items())
    turning = "" if inputs.no_turning is None else f", no_turning = {json.dumps(inputs.no_turning)}"
    mesh = f"mesh = {json.dumps(str(folder / 'mesh.msh'))}, fixed = {json.dumps(list(inputs.fixed))}"
    return [f"geometry={{{mesh}, fixed_axes = {{{axes}}}{turning}}}", *(t for t in overrides if t not in geometry)]


@pytest.fixture(scope="module")
def probe() -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "tests.helpers.run_probe"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process


@pytest.fixture(scope="module", params=RUNS)
def run(
    request: pytest.FixtureRequest, probe: subprocess.Popen[str], tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict[str, Any], dict]:
    """What a run told and what is expected of it."""
    overrides, expected = RUNS[request.param]
    name = request.param.split(",")[0]
    arguments = on_a_mesh_file(name, overrides, tmp_path_factory.mktemp(name))
    asks, says = probe.stdin, probe.stdout
    assert asks is not None
    print(json.dumps([name, [*arguments, "verdict.enabled=false"]]), file=asks, flush=True)
    return json.loads(says.readline()), expected


def test_a_run_models_and_keeps_what_its_scene_asks_for(run: tuple[dict[str, Any], dict]) -> None:
    messages, expected = run
    assert messages["state"].startswith("complete")
    # no pictures where none are asked for
    assert set(messages["imported"]) <= {"gmsh"}  # which reads its own files
    # one model, one factorisation: modes, static shapes and error estimates share it
    assert (messages["models"], len(messages["factorised"])) == (1, 1)
    assert messages["systems"] == expected["systems"]
    pairs, components, coefficients = (expected[name] for name in ("pairs", "components", "coefficients"))
    assert (messages["pairs"], messages["components"], messages["coefficients"]) == (pairs, components, coefficients)
    assert messages["unknowns"] == pairs * components * coefficients
    # a slider for each tangential component, none where contact is normal alone
    assert messages["memory"] == pairs * (components - 1)
    assert messages["arrays"]["frf/contact"][1:] == [pairs * components, coefficients]
    assert set(messages["groups"]) == expected["groups"]


def test_arrays_of_a_run_are_as_large_as_what_they_hold(run: tuple[dict[str, Any], dict]) -> None:
    messages, expected = run
    arrays, pairs = messages["arrays"], expected["pairs"]
    wears = "wear" in expected["groups"]
    assert (messages["delta_max"] is not None) == wears
    # nothing is stored twice: contact displacement once for each duty, force and work once
    large = {name for name, shape in arrays.items() if name.startswith("wear/") and len(shape) > 2}
    assert large == ({"wear/duty_displacement", "wear/force", "wear/response"} if wears else set())
    if wears:
        rows = arrays["wear/cycles"][0]
        widths = {name: shape[1] for name, shape in arrays.items() if name.startswith("wear/") and len(shape) == 2}
        of_pairs = {f"wear/{name}" for name in ("depth", "worn", "energy", "normal_force", "status", "work")}
        assert all(arrays[name] == [rows, pairs] for name in of_pairs)
        assert all(
            width <= 3 for name, width in widths.items() if name not in of_pairs
        )  # of the duties, two numbers beside
    if "fields/displacement" in arrays:
        assert arrays["fields/displacement"][0] <= 3  # first, middle and last row


COMMAND = """
import sys
from tribodyn.workflows.command import main as cli
try:
    cli.main(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
print(*(name for name in ("pyvista", "vtk", "matplotlib") if name in sys.modules), file=sys.stderr)
"""


def test_the_command_without_pictures_on_a_mesh_file_loads_no_plots(tmp_path: Path) -> None:
    scene = on_a_mesh_file(
        "beam", ("harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1"), tmp_path
    )
    words = ["run", "beam", "--no-pictures", "--out", str(tmp_path / "out")]
    for text in (*scene, "response.points=6", "wear.max_steps=1"):
        words += ["--set", text]
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "result.h5").is_file()
    assert done.stderr.splitlines()[-1] == ""


def matrix_scene(folder: Path, *overrides: str) -> scene_file.SceneFile:
    """The scene of matrices, with a file of them beside it."""
    return scene_file.read(str(matrix_folder(folder) / "own.toml"), ("wear=", "response.points=4", *overrides))


def test_the_static_part_is_there_where_a_static_load_is_and_nowhere_else(tmp_path: Path) -> None:
    file = matrix_scene(tmp_path, "harmonics.kept=[1, 3]")
    with pytest.raises(ValueError, match="load 'press' acts in harmonic 0, which is not kept"):
        modelling.build(file, Progress())
    file = matrix_scene(tmp_path, "harmonics.kept=[1, 3]", "loads.static=")
    result = pipeline.run(file, tmp_path, Progress())
    assert result.response.contact.shape[1:] == (6, 4)
    assert result.facts.unknowns == 6 * 4
    # without x_0 every coefficient vibrates
    cycle = result.response.response[:, 0] @ HarmonicBasis((1, 3), 4096).synthesis.T
    everything = np.ptp(cycle, axis=1).max() / 2
    assert summary.summary(result)["amplitude"]["first"] == pytest.approx(everything, rel=1e-5)


def test_contact_without_friction_state_or_derivative_allocates_neither() -> None:
    model = random_structure(3)
    parameters = ContactParameters.of(("t1", "t2", "n"), np.full((3, 3), 1e6), friction=0.3)
    excitation = Excitation.of({"static": 10.0}, {1: {"shaker": 1.0}})
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 64), excitation, 3e3
    )
    x = balance.stuck(1e3)
    state = balance.evaluate(1e3, x, jacobian=False)
    assert state.cycle.jacobian is None
    # all that is stuck stays out of the linear system: nothing is solved for, nothing is multiplied
    pressed = ContactParameters.of(("t1", "t2", "n"), np.full((3, 3), 1e6), friction=1e6, gap=-1.0)
    linear = balance.with_contact(balance.contact.with_parameters(lambda _: pressed))
    stuck = linear.linearise(linear.evaluate(1e3, x))
    assert len(stuck.active) == len(stuck.rows) == 0
    rhs = np.ones((9, 3))
    solution, products, _ = stuck.solve(rhs, 1e-10)
    np.testing.assert_array_equal(solution, rhs)
    assert products == 0
