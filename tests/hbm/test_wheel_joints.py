"""Several joints in a sector of a wheel: between neighbours and between bodies inside the sector."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers import small_wheel as small
from tribodyn.fem import cyclic
from tribodyn.fem.part import Contact
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law import SLIPS, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.cyclic import reduce_sector, travelling_wave
from tribodyn.reduction.damping import modal_damping

EXACT = newton.NewtonOptions(tolerance=1e-13, krylov=1e-6)


def outputs(mesh, node_sets, faces, order):
    """Coefficients of all outputs of a wave whose shroud contact is cut into named joints, and what was slipping."""
    contacts = [Contact(f"right_{i}", (1, 0, 0), f"left_{i}", vertices_only=True, joint=f"joint_{i}") for i in faces]
    _, sector = cyclic.build(mesh, node_sets, small.STEEL, small.CLAMPS, contacts, small.LOADS, small.OUTPUTS, small.N)
    reduced = reduce_sector(sector, n_modes=10)
    model = travelling_wave(reduced, order).with_damping(lambda system, B: modal_damping(system, 0.01))
    k = model.interface.stiffness(*small.STIFFNESS)
    joints = [
        Joint(name, "jenkins", ContactParameters.of(("t1", "t2", "n"), k[pairs], friction=0.3), pairs)
        for name, pairs in model.info.joints.items()
    ]
    assert len(joints) == len(faces)
    balance = HarmonicBalance.of(model, joints, HarmonicBasis((0, 1, 2, 3), 128), small.excitation(), 2 * np.pi * 1000)
    found = newton.solve_from_rest(balance, 2 * np.pi * 310, EXACT)
    assert found.converged
    return balance.outputs(found.state), found.state.cycle.status


@pytest.mark.parametrize("order", [3, 4])
def test_a_face_of_a_wheel_split_into_named_contacts_equals_the_one_contact(tmp_path, order):
    """Acceptance 13.1: nodes on the cuts belong to two joints, each with its share of the area."""
    mesh, node_sets = small.read(tmp_path / "s.msh")
    groups = dict(mesh.boundaries)
    for side in ("right", "left"):
        facets = np.sort(groups[f"shroud_{side}"])
        x = mesh.p[0][mesh.facets[:, facets]].mean(axis=0)
        groups |= {f"{side}_{i}": facets[np.argsort(x)[i : i + 1]] for i in range(len(facets))}
        groups[f"{side}_whole"] = facets
    cut = mesh.with_boundaries(groups)
    one, status = outputs(cut, node_sets, ["whole"], order)
    assert (status & SLIPS).any()
    split, _ = outputs(cut, node_sets, range(len(facets)), order)
    assert len(facets) > 1
    assert np.abs(split - one).max() < 1e-12 * np.abs(one).max()
