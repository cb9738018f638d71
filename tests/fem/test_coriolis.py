"""Coriolis forces: a rotating ring in closed form, and a wheel whose sectors are joined."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.cyclic_symmetry import Sector, wave_system
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.load_vectors import NodalForce
from tribodyn.fem.material import Material
from tribodyn.fem.modes import turning_frequencies
from tribodyn.fem.part import build
from tribodyn.fem.prestress import coriolis
from tribodyn.reduction.sector_reduction import nodal_diameters

STEEL = Material(210e9, 0.3, 7860.0)
N, RADIUS, DEPTH = 24, 1.0, 0.01
SPEED = 30.0  # rad/s
AXIS = (1, 0, 0)


def ring() -> Sector:
    """One sector of a thin free ring about x, without contact."""
    grid = (np.linspace(-DEPTH / 2, DEPTH / 2, 2), np.linspace(-np.pi / N, np.pi / N, 7), [0.0, DEPTH])
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*grid))
    x, angle, height = mesh.doflocs
    radius = RADIUS - DEPTH / 2 + height
    # left, where the angle is positive, is the side of positive rotation, towards -y
    sets = {"left": np.flatnonzero(angle > np.pi / N - 1e-9), "right": np.flatnonzero(angle < -np.pi / N + 1e-9)}
    sets["middle"] = np.flatnonzero(np.abs(angle) < 1e-9)[:1]
    mesh = replace(mesh, doflocs=np.array([x, -radius * np.sin(angle), radius * np.cos(angle)]))
    watched = {"out": NodalForce("middle", (0, 0, 1))}
    part = build(mesh, sets, STEEL, [], [], watched, watched)
    mass, _ = assemble(mesh, STEEL)
    turning = replace(part.system, gyroscopic=coriolis(mass, AXIS, SPEED))
    return cyclic_symmetry.cut_sector(replace(part, system=turning), [], N, ("right", "left"), AXIS)


@pytest.mark.parametrize("waves", [2, 3, 4])
def test_waves_of_a_rotating_ring_split_as_the_closed_form_says(waves: int) -> None:
    """Inextensional bending of a thin ring: in its own frame the two waves of n lie 4 n speed / (n2 + 1) apart, the one
    against the rotation higher; source: Bryan 1890, Carrier 1945. To 0.1 %."""
    sector = ring()
    with_it, against = (2 * np.pi * nodal_diameters(sector, [index], 6)[0] for index in (waves, -waves))
    still = replace(sector, system=replace(sector.system, gyroscopic=None))
    remainder = 2 * np.pi * nodal_diameters(still, [waves], 6)[0]
    inertia, section = DEPTH**4 / 12, DEPTH**2
    # n waves in the plane of the ring: omega2 = E I n2 (n2 - 1)2 / (rho A R4 (n2 + 1))
    plane = (
        np.sqrt(STEEL.E * inertia / (STEEL.rho * section) * waves**2 * (waves**2 - 1) ** 2 / (waves**2 + 1)) / RADIUS**2
    )
    mode = int(np.abs(remainder - plane).argmin())
    out = remainder[1 - mode]  # bending out of the plane of the ring hardly feels the rotation about its axis
    assert remainder[mode] == pytest.approx(plane, rel=5e-3)
    rows = [values[:2][np.abs(values[:2] - out).argmax()] for values in (with_it, against)]
    assert rows[1] - rows[0] == pytest.approx(4 * waves * SPEED / (waves**2 + 1), rel=1e-3)


def test_frequencies_are_those_of_the_first_order_system() -> None:
    """Against a general eigenvalue solver on the first-order form, complex as a wave sees it."""
    system, _ = wave_system(ring(), 2)
    K, M, G = (np.asarray(m.todense()) for m in (system.stiffness, system.mass, system.gyroscopic))
    n = len(K)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, G)]])
    values = np.linalg.eigvals(companion)
    assert np.abs(values.real).max() < 1e-5 * np.abs(values).max()
    result = np.sort(values.imag[values.imag > 0])[:4]
    assert turning_frequencies(system.stiffness, system.mass, system.gyroscopic, 4) == pytest.approx(result, rel=1e-6)
    assert np.abs(G + G.conj().T).max() == 0.0
