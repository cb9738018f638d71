"""Modal stress of a bladed disk against the listing of Ansys (SOLID185), whose origin is in academic_rotor/."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import scipy

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.material import Material
from tribodyn.fem.modes import modes
from tribodyn.fem.part import build
from tribodyn.fem.stress import nodal_stress
from tribodyn.geometry import subdivision
from tribodyn.geometry.sources import foreign_file
from tribodyn.hbm.fatigue import von_mises

FOLDER = Path(__file__).parent / "academic_rotor"
LISTING = np.load(FOLDER / "listing.npz")  # points [in], four flexible frequencies [Hz] by diameter, stress [psi]
INCH, PSI, N = 0.0254, 6894.757293168361, 24
SETS = ((0, 0), (0, 1), (1, 0), (1, 0), (12, 0))  # nodal diameter and flexible mode of each set
# largest stress of von Mises over that of Ansys of the sets 0, 1 and 4, computed by another program
RATIOS = {"linear_full": (0.808, 1.297, 1.278), "linear_incompatible": (1.264, 1.389, 1.386)}


@pytest.mark.parametrize("form", ["linear_bbar", *RATIOS])
def test_stress_and_frequencies(form, tmp_path):
    """In B-bar elements, which the file asks for, those of the listing; in others the ratios of another program."""
    path = tmp_path / "rotor.cdb"
    path.write_bytes(gzip.decompress((FOLDER / "academic_rotor.cdb.gz").read_bytes()))
    source = foreign_file.read(path, "in")
    ((name, body),) = source.bodies.items()
    assert source.formulations[name] == "linear_bbar"
    mesh, _ = subdivision.first_order(body.mesh, body.node_sets, name)
    angle = np.degrees(np.arctan2(mesh.doflocs[1], mesh.doflocs[0]))
    seams = {side: np.flatnonzero(np.abs(angle - at) < 1e-4) for side, at in (("right", -7.5), ("left", 7.5))}
    material = Material(3e7 * PSI, 0.3, 8303.717553, elements=form)
    part = build(mesh, seams, material, [], [], {}, {})
    sector = cyclic_symmetry.cut_sector(part, [], N, ("right", "left"), (0, 0, 1.0))
    _, node = scipy.spatial.cKDTree(mesh.doflocs.T).query(INCH * LISTING["points"])
    for diameter in range(N // 2 + 1) if form == "linear_bbar" else (0, 12):
        system, _ = cyclic_symmetry.wave_system(sector, diameter)
        omega, shapes = modes(system.stiffness, system.mass, 8)[:2]
        flexible = np.flatnonzero(omega > 100)
        if form == "linear_bbar":
            np.testing.assert_allclose(omega[flexible[:4]], 2 * np.pi * LISTING["frequency"][diameter], rtol=1e-6)
        for number in (i for i, item in enumerate(SETS) if item[0] == diameter):
            q = cyclic_symmetry.seam_map(sector, diameter) @ shapes[:, flexible[SETS[number][1]]]
            size = INCH * np.sqrt(PSI * INCH / N * (2 if diameter == 1 else 1))  # mass of the wheel 1 in Ansys's units
            u = part.field(size * q)
            _check(nodal_stress(mesh, material, np.stack([u.real, u.imag], axis=-1)).tensor[node], number, form)


def _check(wave, number, form):
    """Stress (n, 6, 2), real and imaginary, of a wave against a set; the phase of a standing wave is fitted."""
    listed, order = PSI * LISTING["stress"][number].astype(float), [0, 1, 2, 5, 3, 4]
    terms = (wave * [1.0, -1.0])[:, order].reshape(-1, 2)
    phase = np.linalg.lstsq(terms, listed.ravel())[0]
    phase /= np.linalg.norm(phase)
    if form == "linear_bbar":
        np.testing.assert_allclose(terms @ phase, listed.ravel(), atol=1e-6 * PSI * LISTING["largest"][number])
    else:
        ratio = von_mises(wave[..., 0]).max() / (PSI * LISTING["largest"][number])
        assert ratio == pytest.approx(RATIOS[form][number // 2 + number % 2], abs=1e-3)
