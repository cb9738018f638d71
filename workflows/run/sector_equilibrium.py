"""The sector of a rotating wheel about its static equilibrium.

Its stiffness there includes the stress under the static loads with the contact in equilibrium, and spin softening.
Stress and contact are found in turns: `solve_prestress` takes the stress from a displacement, `static_displacement` the
displacement from the stiffness under that stress. Coriolis forces act unless wheel.coriolis = false."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.cyclic_symmetry import Sector, seam_map, wave_system
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import UNSTABLE, check_stability, coriolis, solve_prestress, spin_softening
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.stiffening import solve_along_friction
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import residual_flexibility
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, part_reduction
from tribodyn.workflows.run.stresses import temperature
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.wheel_scene import WheelScene


def sector_about_equilibrium(scene: WheelScene, part: Part, cut_sector: Sector) -> Sector:
    """The sector `cut_sector` of a part, about its static equilibrium at the scene's speed.

    The stress is that under the static loads, solved together with the contact: each pair is closed, slipped or open.
    Raises  Refusal where no contact state balances the loads, a body is unconstrained, or a file gives temperatures;
        StaticDivergence where the sector has no equilibrium, rotates far in it, or is unstable with its contacts stuck
    """
    for name, load in scene.loads.static.items():
        if load.field is not None:
            raise Refusal(f"loads.static.{name}: in a wheel that turns, heat whole bodies instead of a field")
    wheel, heat = scene.wheel, temperature(scene, part, Path())
    speed = 2 * np.pi * wheel.speed
    material = part_reduction.material(scene, part.mesh)
    mass, _ = assemble(part.mesh, material)
    softening = part.restricted(spin_softening(mass, wheel.axis, speed))
    coriolis_matrix = csr_matrix(part.restricted(coriolis(mass, wheel.axis, speed))) if wheel.coriolis else None

    def stiffened(stiffness: csr_matrix) -> Sector:
        return replace(cut_sector, system=replace(cut_sector.system, stiffness=stiffness, gyroscopic=coriolis_matrix))

    start = stuck_displacement(scene, stiffened(csr_matrix(cut_sector.system.stiffness + softening)))
    equilibrium = solve_prestress(
        part, material, lambda k: static_displacement(scene, stiffened(k)), start, softening, heat
    )
    sector_at_speed = replace(stiffened(equilibrium.stiffness), prestress=equilibrium)
    check_stability(stuck_stiffness_of_index_0(scene, sector_at_speed))
    return sector_at_speed


def stuck_stiffness_of_index_0(scene: MeshScene, sector: Sector) -> csr_matrix:
    """Stiffness (m, m) [N/m] of harmonic index 0, where all sectors move alike, with the contacts stuck."""
    system, B = wave_system(sector, 0)
    model = ReducedModel(sector.system, sector.interface, joints=sector.joints)
    return stuck_stiffness(system.stiffness, B, joints.contact_stiffness(scene, model))


def stuck_displacement(scene: MeshScene, sector: Sector) -> np.ndarray:
    """Displacement (n_free,) [m] under the static loads with all contacts stuck, whatever their gap.

    The first stress is taken from it. A body that only its stress stabilises would otherwise slide away in the first
    pass of `solve_prestress`."""
    stiffness, T = stuck_stiffness_of_index_0(scene, sector), seam_map(sector, 0)
    force = sum((v * sector.system.loads[name] for name, v in static_loads(scene).items()), np.zeros(T.shape[0]))
    return np.asarray(T @ factorise(stiffness, definite=False).solve(T.T @ force))


def static_displacement(scene: MeshScene, sector: Sector, tolerance: float = 1e-10, samples: int = 16) -> np.ndarray:
    """Displacement (n_free,) [m] under the static loads with the contact in equilibrium; the same in every sector.

    The sector is reduced here with residual flexibility, one contact traction per pair. This is exact for statics: it
    needs no masters on the contact, and none on the seams because all sectors move alike.
    tolerance : of the static balance; samples : time samples of the cycle, in which nothing moves"""
    system, B = wave_system(sector, 0)
    static = static_loads(scene)
    static_system = replace(system, gyroscopic=None, loads={name: system.loads[name] for name in static}, outputs={})
    interface = replace(sector.interface, B=csr_matrix(B))
    springs = joints.contact_stiffness(scene, ReducedModel(static_system, interface, joints=sector.joints))
    try:
        model = residual_flexibility(static_system, interface, springs, n_modes=1, clusters=interface.n_pair)
    except SingularStiffness:
        raise StaticDivergence(UNSTABLE) from None
    model = replace(model, joints=dict(sector.joints))
    basis = HarmonicBasis((0, 1), samples)
    contact_joints = joints.make_joints(scene, model)
    omega = 2 * np.pi  # any frequency: nothing vibrates
    balance = HarmonicBalance.of(model, contact_joints, basis, Excitation.of(static), omega)
    options = newton.NewtonOptions(tolerance=tolerance)
    solved = newton.solve_from_rest(balance, omega, options)
    if not solved.converged:
        solved = solve_along_friction(balance, omega, options) or solved
    if not solved.converged:
        raise Refusal(f"the contacts do not settle under the static loads: {solved.outcome}")
    state = solved.state
    displacement = full_displacement(balance, state.flat, state.cycle.force.reshape(state.flat.shape), omega)[:, 0]
    return np.asarray(seam_map(sector, 0) @ displacement)


def static_loads(scene: MeshScene) -> dict[str, float]:
    """Amplitudes of the static loads (harmonic 0) by name."""
    loads = joints.excite(scene, None).loads
    return {name: float(value.real) for (harmonic, name), value in loads.items() if harmonic == 0}
