"""Stress stiffening against a tensioned beam and the published rotating cantilever."""

import numpy as np
import pytest
import skfem

from tribodyn.fem.constraints import Clamp
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.load_vectors import Centrifugal, NodalForce
from tribodyn.fem.material import Material
from tribodyn.fem.modes import StaticDivergence, modes
from tribodyn.fem.part import build
from tribodyn.fem.prestress import check_stability, solve_prestress, spin_softening

SOFT = Material(E=1e9, nu=0.0, rho=1000.0)
LENGTH, DEPTH = 1.0, 0.01  # slender: shear changes the first frequency by some 1e-4


def beam():
    axes = (np.linspace(0, LENGTH, 21), [0, 2 * DEPTH], [0, DEPTH])
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(*axes)).with_boundaries(
        {"tip": lambda x: x[0] > LENGTH - 1e-9}
    )
    p = mesh.doflocs
    sets = {"root": np.flatnonzero(p[0] < 1e-9), "tip": np.flatnonzero(p[0] > LENGTH - 1e-9)}
    loads = {"pull": NodalForce("tip", (1, 0, 0)), "spin": Centrifugal((0, 0, 1), (0, DEPTH, 0))}
    return build(mesh, sets, SOFT, [Clamp("root")], [ContactFaces("tip", t1=(0, 1, 0), components=("n",))], loads, {})


def loaded(part, force, softening=0):
    """The stiffness of the part in its equilibrium under a force (n_free,)."""
    linear = factorise(part.system.stiffness).solve(force)
    remainder = solve_prestress(part, SOFT, lambda k: factorise(k, definite=False).solve(force), linear, softening)
    check_stability(remainder.stiffness)
    return remainder.stiffness


def test_pull_stiffens_and_push_buckles():
    """omega^2 vanishes at Euler's load P = pi^2 E I / 4 L^2 and starts with the slope of the unloaded mode.

    The slope is P times integral phi'^2 over E I integral phi''^2 = 0.25 pi^2 * 4.6478 / 12.3624 for the cantilever."""
    part = beam()
    I = 2 * DEPTH * DEPTH**3 / 12
    euler = np.pi**2 * SOFT.E * I / (4 * LENGTH**2)
    free, _ = modes(part.system.stiffness, part.system.mass, 1)
    slope = 0.25 * np.pi**2 * 4.6478 / 12.3624
    cases = ((-0.99, 0.01, 2e-3), (0.01, 1 + 0.01 * slope, 3e-5), (-0.01, 1 - 0.01 * slope, 3e-5))
    for share, expected, tolerance in cases:
        omega, _ = modes(loaded(part, share * euler * part.system.loads["pull"]), part.system.mass, 1)
        assert (omega[0] / free[0]) ** 2 == pytest.approx(expected, abs=tolerance)


def test_rotating_cantilever():
    """First flap frequency of a uniform cantilever without hub; Wright et al., J. Appl. Mech. 49, 1982, table 1.

    In units of sqrt(E I / rho A L^4): 3.5160 at rest, 4.1373 at speed 2, 7.3604 at 6, 13.1702 at 12. Edgewise
    stiffening is the same, spin softening takes speed^2 from omega^2."""
    part = beam()
    M, _ = assemble(part.mesh, SOFT)
    unit_flap = np.sqrt(SOFT.E * DEPTH**2 / 12 / SOFT.rho) / LENGTH**2
    for speed, flap in ((2, 4.1373), (6, 7.3604), (12, 13.1702)):
        rate = speed * unit_flap
        softening = spin_softening(M, (0, 0, 1), rate)[part.free][:, part.free]
        spinning = loaded(part, rate**2 * part.system.loads["spin"], softening)
        omega, phi = modes(spinning, part.system.mass, 4)
        size = np.linalg.norm(part.field(phi), axis=0)  # component, mode
        edge = list(size[1] > size[2])
        assert omega[edge.index(False)] / unit_flap == pytest.approx(flap, rel=2e-3)
        # edgewise the section is twice as deep: rest frequency 2 * 3.5160, speed parameter half as large
        stiffened = {2: 3.6817, 6: 4.7973, 12: 7.3604}[speed] * 2
        assert omega[edge.index(True)] / unit_flap == pytest.approx(np.sqrt(stiffened**2 - speed**2), rel=3e-3)


def test_beyond_buckling_and_divergence_there_is_no_frequency():
    """The cantilever that points inward at the rim is pressed by its own centrifugal force and falls over."""
    part = beam()
    euler = np.pi**2 * SOFT.E * (2 * DEPTH * DEPTH**3 / 12) / (4 * LENGTH**2)
    loaded(part, -0.99 * euler * part.system.loads["pull"])
    with pytest.raises(StaticDivergence, match="unstable at rest"):
        loaded(part, -1.01 * euler * part.system.loads["pull"])
    M, K = part.system.mass, part.system.stiffness
    low = modes(K, M, 1)[0][0] ** 2
    for solve in (lambda k: modes(k, M, 2), lambda k: modes(k.toarray(), M.toarray(), 2)):
        with pytest.raises(StaticDivergence, match=r"omega\^2 (= -|is negative)"):
            solve(K - 1e4 * low * M)


@pytest.mark.parametrize("solver", ["superlu", None])
def test_a_definite_factorisation_refuses_an_indefinite_matrix(solver):
    part = beam()
    M, K = part.system.mass, part.system.stiffness
    low = modes(K, M, 1)[0][0] ** 2
    factorise(K - 0.9 * low * M, solver=solver)
    with pytest.raises(SingularStiffness):
        factorise(K - 1.1 * low * M, solver=solver)
