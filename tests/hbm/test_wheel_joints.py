"""Several joints in a sector of a wheel: between neighbours and between bodies inside the sector."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvalsh

from proof.dense import DenseBalance
from tests.helpers import small_wheel as small
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.prestress import coriolis
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SLIPS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import expansion, travelling_wave as waves
from tribodyn.reduction import linear
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.sector_reduction import reduce_sector
from tribodyn.reduction.wave_model import travelling_wave

EXACT = newton.NewtonOptions(tolerance=1e-13, krylov=1e-6)


def outputs(mesh, node_sets, faces, order):
    """Coefficients of all outputs of a wave whose shroud contact is cut into named joints, and what was slipping."""
    contacts = [
        ContactFaces(f"right_{i}", (1, 0, 0), f"left_{i}", vertices_only=True, joint=f"joint_{i}") for i in faces
    ]
    _, sector = small.sector_of(mesh, node_sets, small.CLAMPS, contacts, small.N)
    reduced = reduce_sector(sector, n_modes=10)
    model = travelling_wave(reduced, order).with_damping(lambda system, B: modal_damping(system, 0.01))
    k = model.interface.stiffness(*small.STIFFNESS)
    joints = [
        Joint(name, "jenkins", ContactParameters.of(("t1", "t2", "n"), k[pairs], friction=0.3), pairs)
        for name, pairs in model.joints.items()
    ]
    assert len(joints) == len(faces)
    balance = HarmonicBalance.of(model, joints, HarmonicBasis((0, 1, 2, 3), 128), small.excitation(), 2 * np.pi * 1000)
    result = newton.solve_from_rest(balance, 2 * np.pi * 310, EXACT)
    assert result.converged
    B = np.asarray(model.interface.B)
    stuck = linear.stuck_stiffness(np.asarray(model.system.stiffness), B, k)
    lam = eigvalsh(stuck, np.asarray(model.system.mass))
    return balance.outputs(result.state), result.state.cycle.status, lam[-1] / lam[0]


@pytest.mark.parametrize("order", [0, 1, 3])
def test_a_face_of_a_wheel_split_into_named_contacts_equals_the_one_contact(tmp_path, order, monkeypatch):
    """Nodes on the cuts belong to two joints, each with its share of the area.

    The expansion of the compliance is asked for more than the 5e-10 that a run needs. All blades alike in order 0 are
    softest beside the springs: what is left there is rounding of its reduced matrices."""
    exact = replace(expansion.RULES, wanted_error=1e-13, rounding=1e-13)
    monkeypatch.setattr(expansion, "RULES", exact)
    mesh, node_sets = small.read(tmp_path / "s.msh")
    groups = dict(mesh.boundaries)
    for side in ("right", "left"):
        facets = np.sort(groups[f"shroud_{side}"])
        x = mesh.p[0][mesh.facets[:, facets]].mean(axis=0)
        groups |= {f"{side}_{i}": facets[np.argsort(x)[i : i + 1]] for i in range(len(facets))}
        groups[f"{side}_whole"] = facets
    cut = mesh.with_boundaries(groups)
    item, status, condition = outputs(cut, node_sets, ["whole"], order)
    assert (status & SLIPS).any()
    split, _, _ = outputs(cut, node_sets, range(len(facets)), order)
    assert len(facets) > 1
    within = max(1e-12, np.finfo(float).eps * condition)
    assert within < 2e-10
    assert np.abs(split - item).max() < within * np.abs(item).max()


SPEED = 900.0  # rad/s: enough to move a response by per cents


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """The small sector on a flexible disk in a turning frame, its stress left out."""
    part, sector = small.full_sector(tmp_path_factory.mktemp("turning") / "s.msh", 0.02)
    mass, _ = assemble(part.mesh, small.STEEL)
    gyroscopic = coriolis(mass, (1, 0, 0), SPEED)[part.free][:, part.free]
    return reduce_sector(replace(sector, system=replace(sector.system, gyroscopic=gyroscopic)), n_modes=10)


def tips(sector, wheel, outputs, everywhere, order):
    """What the wave says of the tip of every sector, and what the whole wheel does."""
    names = list(wheel.compliance.output_names)
    tip = outputs[list(sector.compliance.output_names).index("tip")]
    expected = np.array([waves.at_sector(sector.basis, tip, order, small.N, n) for n in range(small.N)])
    return expected, everywhere[[names.index(f"tip@{n}") for n in range(small.N)]]


def test_linear_waves_with_coriolis_forces_are_the_whole_wheel(turning):
    """Contacts stuck, to 1e-8; waves along and against the rotation differ."""
    heights = []
    for order in (2, -2):
        item, wheel = small.wave_and_wheel(turning, order)
        rows = [balance.at(2 * np.pi * 310).outputs_lin for balance in (item, wheel)]
        expected, refined = tips(item, wheel, *rows, order)
        assert np.abs(refined - expected).max() < 1e-8 * np.abs(expected[:, 1:3]).max()
        heights.append(np.hypot(*expected[0, 1:3]))
    assert abs(heights[1] / heights[0] - 1) > 1e-2


def slipping(balance):
    """The state at 250 Hz, where some pairs slip."""
    solution = newton.solve_from_rest(balance, 2 * np.pi * 250, newton.NewtonOptions(tolerance=1e-11))
    assert solution.converged
    assert (solution.state.cycle.status & SLIPS).any()
    return solution.state


def test_friction_with_coriolis_forces_is_the_whole_wheel(turning):
    """Slipping and separating, to 1e-6, in every sector."""
    item, wheel = small.wave_and_wheel(turning, 1)
    current, everywhere = slipping(item), slipping(wheel)
    expected, refined = tips(item, wheel, item.outputs(current), wheel.outputs(everywhere), 1)
    assert np.abs(refined - expected).max() < 1e-6 * np.abs(expected).max()


def test_unequal_blades_with_coriolis_forces_solve_the_equations_of_the_whole_wheel(turning):
    """The balance of blades that differ against the dense equations of motion, to 1e-6."""
    factors = 1 + np.array([0.03, -0.02, 0.01, -0.04, 0.02, 0.0, -0.01, 0.04])
    _, wheel = small.wave_and_wheel(turning, 1, harmonics=(0, 1), stiffness=factors)
    state = slipping(wheel)
    dense = DenseBalance(wheel)
    q = dense.coordinates_of(state.omega, state.x)
    back = dense.onto_contact(q.ravel()).reshape(state.x.shape)
    assert np.abs(back - state.x).max() < 1e-6 * np.abs(state.x).max()
    heights = np.hypot(*wheel.outputs(state)[:, 1:3].T)
    assert np.ptp(heights[[name.startswith("tip") for name in wheel.compliance.output_names]]) > 0.01 * heights.max()
