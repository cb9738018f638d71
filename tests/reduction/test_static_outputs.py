"""Outputs of a reduced model move as those of the full matrices at rest, and nearly so below half the first mode."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skfem
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh, splu

from tests.helpers import small_wheel
from tribodyn.fem.constraints import Clamp, NoMeanRotation
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.cyclic_symmetry import wave_system
from tribodyn.fem.load_vectors import BodyForce, Centrifugal, Heating, NodalForce, Pressure
from tribodyn.fem.material import Material
from tribodyn.fem.part import Part, build
from tribodyn.fem.stress import nodal_stress
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.linear import linear_modes, stuck_stiffness
from tribodyn.reduction.omitted_modes import OmittedModes
from tribodyn.reduction.prescribed import hold, prescribe
from tribodyn.reduction.sector_reduction import reduce_sector
from tribodyn.reduction.wave_model import travelling_wave

MATERIAL = Material(70e9, 0.3, 2700.0, expansion=2e-5)
MODES = 4


def random_part(seed: int, clamped: bool = True) -> Part:
    """A block of random sides that touches at one face and is pulled, pressed, accelerated, turned and heated."""
    draw = np.random.default_rng(seed)
    sides, elements = draw.uniform(0.03, 0.2, 3), draw.integers(3, 5, 3)
    edges = [np.linspace(0, side, count + 1) for side, count in zip(sides, elements, strict=True)]
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*edges))
    faces = {
        f"{name}{end}": lambda x, axis=axis, at=end * sides[axis]: np.abs(x[axis] - at) < 1e-9
        for axis, name in enumerate("xyz")
        for end in (0, 1)
    }
    mesh = mesh.with_boundaries(faces)
    x = mesh.doflocs
    touching, pulled = draw.choice(["y0", "y1", "z0", "z1", "x1"], 2, replace=False)
    loads = {
        "pull": NodalForce(pulled, draw.normal(size=3), "area"), "pressure": Pressure(pulled),
        "weight": BodyForce(draw.normal(size=3)), "rotation": Centrifugal(draw.normal(size=3), (0.1, 0.0, 0.0)),
        "heat": Heating(MATERIAL, (), 1 + 10 * draw.normal(size=3) @ x),
    }  # fmt: skip
    outputs = {f"output {i}": NodalForce(face, draw.normal(size=3)) for i, face in enumerate((pulled, pulled, "x1"))}
    return build(
        mesh, {name: np.flatnonzero(face(x)) for name, face in faces.items()}, MATERIAL,
        [Clamp("x0")] if clamped else [],
        [ContactFaces(touching, t1=(0, 1, 0) if touching == "x1" else (1, 0, 0))], loads, outputs,
        held_motions=[] if clamped else [NoMeanRotation((0.0, 1.0, 0.0))],
    )  # fmt: skip


def motions(system: SecondOrderSystem, stiffness, omega: float = 0.0) -> np.ndarray:
    """(n_output, n_load) of a unit of each load."""
    dynamic = csc_matrix(stiffness - omega**2 * system.mass)
    return np.array(list(system.outputs.values())) @ splu(dynamic).solve(np.column_stack([*system.loads.values()]))


def error(result: np.ndarray, exact: np.ndarray) -> float:
    """Largest of any output, over the largest output of the same load."""
    return float((np.abs(result - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())


@pytest.mark.parametrize("seed", range(10))
def test_a_random_part_moves_as_its_full_matrices(seed: int) -> None:
    part = random_part(seed)
    model = craig_bampton(part.system, part.interface, MODES)
    first_mode = 2 * np.pi * linear_modes(part, n=1)[0][0]
    for spring in (0.0, 1e6, 1e10):
        springs = part.interface.stiffness(spring, spring)
        full, reduced = (stuck_stiffness(m.system.stiffness, m.interface.B, springs) for m in (part, model))
        for omega, most in ((0.0, 1e-6), (0.49 * first_mode, 1e-3)):
            exact = motions(part.system, full, omega)
            assert error(motions(model.system, reduced, omega), exact) < most


def test_a_part_with_prescribed_nodes_moves_as_its_full_matrices() -> None:
    part, held = random_part(3), np.array([40, 41])
    model = craig_bampton(part.system, part.interface, MODES, extra_masters=held)
    masters = np.searchsorted(model.origin.masters, held)
    free = np.setdiff1d(np.arange(part.system.n_dof), np.concatenate([held]))
    static = prescribe(model, masters, "height").static
    exact = motions(_of(part.system, free), part.system.stiffness[free][:, free])
    assert error(motions(static, static.stiffness)[:, :-1], exact) < 1e-6


def test_a_part_whose_turning_is_held_moves_as_its_full_matrices() -> None:
    """Its contact springs hold the rest; the force of what is held has a shape too."""
    part = random_part(3, clamped=False)
    springs = part.interface.stiffness(1e7, 1e7)
    model = hold(craig_bampton(part.system, part.interface, MODES, held_rows=part.held_rows), part.held_rows)
    K, n = stuck_stiffness(part.system.stiffness, part.interface.B, springs).toarray(), len(part.held_rows)
    scale = np.abs(K).max() / np.abs(part.held_rows).max()
    bordered = np.block([[K, scale * part.held_rows.T], [scale * part.held_rows, np.zeros((n, n))]])
    loads = np.column_stack([*part.system.loads.values()])
    exact = np.linalg.solve(bordered, np.vstack([loads, np.zeros((n, loads.shape[1]))]))[:-n]
    exact = np.array(list(part.system.outputs.values())) @ exact
    reduced = stuck_stiffness(model.system.stiffness, model.interface.B, springs)
    assert error(motions(model.system, reduced), exact) < 1e-6


@pytest.mark.parametrize("index", [0, 1])
def test_a_wave_moves_as_that_of_the_full_sector(tmp_path: Path, index: int) -> None:
    _, sector = small_wheel.full_sector(tmp_path / "blade.msh", disk_radius=0.03)
    fields = np.random.default_rng(0).normal(size=(2, sector.system.n_dof))
    load, output = (sector.system.mass @ field for field in fields)
    sector = replace(sector, system=replace(sector.system, loads={"body": load}, outputs={"mean": output}))
    springs = sector.interface.stiffness(*small_wheel.STIFFNESS)
    full, B = wave_system(sector, index)
    reduced, b = travelling_wave(reduce_sector(sector, MODES), index).at_index(index)
    exact = motions(full, stuck_stiffness(full.stiffness, B, springs))
    assert error(motions(reduced, stuck_stiffness(reduced.stiffness, b, springs)), exact) < 1e-6


def _of(system: SecondOrderSystem, free: np.ndarray) -> SecondOrderSystem:
    """The system without the other DOFs."""
    rows = [{name: v[free] for name, v in vectors.items()} for vectors in (system.loads, system.outputs)]
    return SecondOrderSystem(system.mass[free][:, free], system.stiffness[free][:, free], None, *rows)


@pytest.mark.parametrize("seed", [3, 5])
def test_stress_converges_with_modes_as_displacement_does(seed: int) -> None:
    """Of the whole part near its second frequency, beside the full matrices; without the modes left out it does not."""
    part = random_part(seed)
    system, springs = part.system, part.interface.stiffness(1e6, 1e6)
    full = csc_matrix(stuck_stiffness(system.stiffness, part.interface.B, springs))
    omega = 0.97 * np.sqrt(np.sort(eigsh(full, 3, csc_matrix(system.mass), sigma=0)[0])[1])
    force = system.loads["pull"]
    exact = splu(csc_matrix(full - omega**2 * system.mass)).solve(force)

    def errors(u: np.ndarray) -> list[float]:
        stress, right = (nodal_stress(part.mesh, MATERIAL, part.field(v)).tensor for v in (u, exact))
        return [np.abs(a - b).max() / np.abs(b).max() for a, b in ((u, exact), (stress, right))]

    for modes in (20, 40, 80):
        model = craig_bampton(system, part.interface, modes)
        stiffness = stuck_stiffness(model.system.stiffness, model.interface.B, springs)
        u = model.reconstruct(np.linalg.solve(stiffness - omega**2 * model.system.mass, model.system.loads["pull"]))
        omitted = OmittedModes.of(model, system)
        complete = u + omitted.displacement(u[:, None], force[:, None], np.array([omega]))[:, 0].real
        assert errors(complete)[1] < errors(u)[0] < errors(u)[1] / 1.2
        rows = np.array([*system.outputs.values()])
        np.testing.assert_allclose(rows @ complete, rows @ u, rtol=1e-9)
