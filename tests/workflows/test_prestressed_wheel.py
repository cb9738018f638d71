"""A wheel that turns rests in an equilibrium of contact and stress; against the whole wheel, merged node by node."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_matrix, kron
from scipy.sparse.linalg import eigsh, splu
from scipy.spatial import cKDTree

from tests.helpers.wheel_scene import WHEEL
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.prestress import geometric_stiffness
from tribodyn.geometry.placement import rotation
from tribodyn.workflows.run import part_reduction
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import wheel_model

FIVE = WHEEL.replace("n_blades = 6", "n_blades = 5").replace("sectors = 6", "sectors = 5")
N, AXIS = 5, (1.0, 0.0, 0.0)


def turning(rpm: float, gap: str) -> wheel_model.Wheel:
    overrides = (f'wheel.speed="{rpm} rpm"', f"contact.gap={gap}", "wheel.coriolis=false")
    return wheel_model.build(scene_file.parse(FIVE, "w.toml", overrides, Path()))


@pytest.mark.parametrize("rpm", [4000, 10000])
def test_an_open_contact_has_no_say_in_the_stress(rpm: float) -> None:
    nearby, far = (turning(rpm, gap) for gap in ("0.2 mm", "20 mm"))
    first = [item.diagram([1], 2, stuck=False) for item in (nearby, far)]
    assert first[0] == pytest.approx(first[1], rel=1e-6)
    accuracy = nearby.reduced.accuracy
    assert accuracy["prestress_residual"] < 1e-7
    assert 0 < accuracy["prestress_rotation"] < 0.05


@pytest.mark.parametrize("rpm", [20000, 60000])
def test_far_deflection_and_divergence_are_refused(rpm: float) -> None:
    with pytest.raises(StaticDivergence):
        turning(rpm, "0.2 mm")


@pytest.mark.parametrize(("gap", "stuck"), [(0.2e-3, False), (-1e-3, True)])
def test_sectors_rest_as_the_whole_wheel_does(gap: float, stuck: bool) -> None:
    """Sectors turned into place and merged by their nodes, each with its own displacement; sliders that hold."""
    rpm = 8000.0
    item = turning(rpm, f"{1e3 * gap} mm")
    part, speed = item.part, 2 * np.pi * rpm / 60
    mesh, material = part.mesh, part_reduction.material(item.scene, part.mesh)
    M, K = assemble(mesh, material)
    count = len(part.points)
    turns = [rotation(AXIS, 2 * np.pi * k / N) for k in range(N)]
    # merge: a node of a left seam is that of the next sector's right one
    right, remaining = (np.asarray(part.node_sets[name]) for name in ("cyclic_right", "cyclic_left"))
    owner = np.arange(N * count)
    for k in range(N):
        refined = cKDTree(part.points[right] @ turns[(k + 1) % N].T)
        distance, selection = refined.query(part.points[remaining] @ turns[k].T)
        assert distance.max() < 1e-9
        owner[k * count + remaining] = (k + 1) % N * count + right[selection]
    _saved, place = np.unique(owner, return_inverse=True)
    merge = kron(csr_matrix((np.ones(N * count), (np.arange(N * count), place))), np.eye(3)).tocsr()
    neighbourhood = block_diag([kron(np.eye(count), R.T) for R in turns]).tocsr()  # to the frame of each sector
    fixed = np.ones(3 * count, bool)
    fixed[part.free] = False
    clamped = np.asarray(merge.T @ np.tile(fixed, N)) > 0  # clamps are whole nodes
    T = (neighbourhood @ merge[:, ~clamped]).tocsr()

    def wheel_of(blocks: list[csr_matrix]) -> csr_matrix:
        return (T.T @ block_diag(blocks) @ T).tocsc()

    normal = kron(np.eye(count), np.diag([0.0, 1.0, 1.0]))
    mass, elastic = wheel_of([M] * N), wheel_of([K - speed**2 * (M @ normal)] * N)
    outward = np.concatenate([(M @ (part.points * [0.0, 1.0, 1.0]).ravel())] * N)
    force = speed**2 * (T.T @ outward)
    if stuck:  # right faces on the left ones of the next sector
        i, k_c = part.interface, np.asarray(item.springs)
        faces = np.flatnonzero(np.isin(np.arange(count), part.node_sets["shroud_right"]))
        rest_of_them = np.asarray(part.node_sets["shroud_left"])
        base = faces[cKDTree(part.points[faces]).query(i.points)[1]]
        separation, nearest = cKDTree(part.points[rest_of_them] @ turns[1]).query(i.points)
        assert separation.max() < 1e-3
        partner = rest_of_them[nearest]
        rows, gaps = [], []
        for k in range(N):
            for pair in range(len(base)):
                frame = i.frames[pair] @ turns[k].T  # rows t1, t2, n, in space
                for c in range(3):
                    row = np.zeros(3 * N * count)
                    row[3 * (k * count + base[pair]) :][:3] = turns[k].T @ frame[c]
                    row[3 * ((k - 1) % N * count + partner[pair]) :][:3] = -turns[(k - 1) % N].T @ frame[c]
                    rows.append(np.sqrt(k_c[pair, c]) * row)
                    gaps.append(np.sqrt(k_c[pair, c]) * (gap if c == 2 else 0.0))
        B = csr_matrix(np.array(rows)) @ T
        elastic, force = (elastic + B.T @ B).tocsc(), force + B.T @ np.array(gaps)
    u, stress = np.zeros(T.shape[1]), 0
    for _ in range(9):
        stress = wheel_of([geometric_stiffness(mesh, material, u_k.reshape(-1, 3)) for u_k in np.split(T @ u, N)])
        u = splu((elastic + stress).tocsc()).solve(force)
    result = np.sqrt(eigsh((elastic + stress).tocsc(), 10, mass, sigma=0.0)[0]) / (2 * np.pi)
    ours = item.diagram([0, 1, 2, 3, 4], 2, stuck, full=True)
    assert np.sort(ours.ravel()) == pytest.approx(np.sort(result), rel=1e-6)
