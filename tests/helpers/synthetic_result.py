"""A made-up result with the shape of a real one, for tests of the store, the summary and the pictures."""

import numpy as np

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, WearEnd
from tribodyn.hbm.stability.branch_stability import BranchStability
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.result.model_facts import ModelFacts, Stage
from tribodyn.workflows.result.result import (
    Fields,
    Loops,
    PartMesh,
    Patch,
    References,
    Result,
    Stress,
)
from tribodyn.workflows.scene.scene_file import read

LENGTH, WIDTH = 0.2, 0.02


def block(nx: int = 8, ny: int = 2, nz: int = 2) -> PartMesh:
    """Straight bar of eight-node bricks along x, top face at z = WIDTH."""
    x, y, z = np.linspace(0, LENGTH, nx + 1), np.linspace(0, WIDTH, ny + 1), np.linspace(0, WIDTH, nz + 1)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), -1).reshape(-1, 3)
    node = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    low, high = slice(None, -1), slice(1, None)
    neighbourhood = [(low, low), (high, low), (high, high), (low, high)]
    cells = [node[i, j, k].ravel() for k in (low, high) for i, j in neighbourhood]
    return PartMesh("hexahedron", points, np.stack(cells, 1))


def patch(part: PartMesh) -> Patch:
    """The bottom nodes under the last quarter of the bar."""
    nodes = np.flatnonzero((part.points[:, 2] == 0) & (part.points[:, 0] >= 0.75 * LENGTH - 1e-12))
    points = part.points[nodes]
    n_y = len(np.unique(points[:, 1]))
    index = np.arange(len(nodes)).reshape(-1, n_y)
    faces = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
    frames = np.tile(np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]]), (len(nodes), 1, 1))
    area = np.full(len(nodes), 0.05 * WIDTH / len(nodes))
    zero = np.zeros(len(nodes))
    return Patch(("t1", "t2", "n"), nodes, points, frames, area, zero, faces, 5e-3 + 0.01 * (points[:, 0] - LENGTH))


def result(n_row: int = 9, nx: int = 8) -> Result:
    """A finished run with `n_row` wear rows."""
    file = read("beam")
    part = block(nx)
    where = patch(part)
    n_pair, t = len(where.area), np.linspace(0, 1, n_row)
    omega = 2 * np.pi * np.linspace(300, 600, 61)
    angle = 2 * np.pi * np.arange(32) / 32
    functions = np.stack([np.ones(32), np.cos(angle), np.sin(angle)], -1)

    def resonance(hertz: float, ratio: float) -> np.ndarray:
        r = omega / (2 * np.pi * hertz)
        return 1e-3 * ratio / (1 - r**2 + 2j * ratio * r)

    slipping = resonance(500, 0.05)
    response = np.stack([0 * omega, slipping.real, -slipping.imag], -1)[:, None]
    frf = Branch(
        omega, ("response",), response, np.zeros((61, 3 * n_pair, 3)), np.abs(slipping), (CONVERGED,) * 61,
        np.full(61, 3), BranchEnd.REACHED.say(" 700 Hz"), (0, 1), (20, 30), "frequency", omega,
    )  # fmt: skip
    rng = np.random.default_rng(1)
    row_response = np.stack([0 * t, 1e-3 * (1 + 4 * t), 1e-4 * t], -1)[:, None]
    displacement = 1e-4 * rng.standard_normal((n_row, 3 * n_pair, 3))
    depth = 5e-3 * t[:, None] * (1 + 0.1 * np.sin(300 * where.points[:, 0]))
    cycles_in_step = np.append(np.linspace(3e6, 1e6, n_row - 1), 0.0)
    energy = np.tile(2 * np.sqrt(1 - t**2)[:, None], n_pair)
    omega_row = 2 * np.pi * (500 - 85 * t)
    wear = WearHistory(
        cycles=np.concatenate([[0.0], np.cumsum(cycles_in_step)[:-1]]), cycles_in_step=cycles_in_step, depth=depth,
        worn=np.diff(depth, axis=0, append=depth[-1:]), energy=energy, preload=6e3 * (1 - t),
        preload_at_rest=5e3 * (1 - t), growth=0.1 * t - 0.05,
        normal_force=np.outer(6e3 * (1 - t), where.area / where.area.sum()),
        status=np.where(t[:, None] * np.ones(n_pair) < 0.6, 3, 6).astype(np.int64), omega=omega_row,
        amplitude=np.hypot(row_response[:, 0, 1], row_response[:, 0, 2]), force=1e6 * displacement,
        response=row_response, solves=np.full(n_row, 4), step_error=np.zeros(n_row),
        work=cycles_in_step[:, None] * energy, duty_omega=omega_row[:, None], duty_response=row_response[:, None],
        duty_displacement=displacement[:, None], end=WearEnd.LOST.say(), spread=0.3 * t, mean_error=0.01 * t,
        is_stationary=np.ones(n_row, bool), periods=(t > 0.5) * 64, moving=np.outer(t, np.arange(5.0)),
        bed=np.zeros_like(depth),
    )  # fmt: skip
    rows = np.array([0, n_row // 2, n_row - 1])
    shape = (part.points[:, 0] / LENGTH) ** 2
    bend = np.zeros((3, len(part.points), 3, 3))
    bend[:, :, 2, 0] = -5e-3 * np.linspace(0.2, 1, 3)[:, None] * shape
    bend[:, :, 1, 1] = 3e-3 * np.linspace(0.4, 1, 3)[:, None] * shape
    loop_x = (displacement.reshape(n_row, n_pair, 3, 3) @ functions.T)[rows]
    spot, stress = np.zeros((len(rows), 1), int), [v * np.ones(bend.shape[:2]) for v in (1e6, 0.5, 0.0, 1e6)]
    of_pairs = [np.full((len(rows), n_pair), value) for value in (1e6, 10.0, 0)]
    stress.append(stress[0][..., None, None] * np.ones((2, 1)) * np.eye(6)[0])  # pulled along x
    loops = Loops(rows, loop_x, np.clip(1e8 * loop_x, -4e2, 4e2))
    stability = BranchStability(
        np.abs(np.arange(61) - 25) > 5, np.full(61, -1.0), omega[[20, 30]], np.array([20.5, 30.5]), ("fold", "fold")
    )
    facts = ModelFacts(seconds=12.5, delta_max=5e-3, unknowns=9 * n_pair, model_dofs=3 * n_pair + 17, harmonics=(0, 1))
    return Result(
        provenance={"scene_name": "beam", "scene_text": file.text}, scene=file.scene, facts=facts, part=part,
        stage=Stage.COMPLETE, patch=where, response=frf, stability=stability, wear=wear, loops=loops,
        references=References(omega, np.abs(resonance(415, 0.01)), np.abs(resonance(530, 0.01))),
        fields=Fields(rows, bend),
        stress_field=Stress(rows, *stress, *of_pairs, spot, np.zeros((len(rows), 1, 3)), spot),
    )  # fmt: skip
