"""From a part to the sector of a wheel that it is, full and reduced; where it turns, about its equilibrium at speed.

At speed it has the stress of its deformed state of contact, spin softening and Coriolis forces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.constraints import find_group
from tribodyn.fem.cyclic_symmetry import Sector, seam_map, wave_system
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.matching import Mismatch
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import UNSTABLE, check_stability, coriolis, solve_prestress, spin_softening
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.stiffening import solve_along_friction
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import residual_flexibility
from tribodyn.reduction.sector_reduction import ReducedSector, reduce_sector
from tribodyn.reduction.speed_line import SpeedLine, SpeedLineModel, congruent, reduce_alike
from tribodyn.reduction.wave_model import travelling_wave
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, part_reduction
from tribodyn.workflows.scene.schema import CENTRIFUGAL, MeshScene

SEAM = ("cyclic_right", "cyclic_left")  # what a part calls the faces where its wheel is one piece


def sector(scene: MeshScene, part: Part) -> Sector:
    """The full sector of the scene's wheel, vibrating about its equilibrium where it spins.

    Raises  Refusal where its faces do not match those of its neighbours, or where the disk is left cut open
    """
    wheel = scene.wheel
    assert wheel is not None
    cuts = [tuple(name for name in part.node_sets if name.rpartition(".")[2] == side) for side in SEAM]
    if wheel.seam is None and all(cuts):
        (right, *_), (left_face, *_) = cuts
        raise Refusal(
            f"wheel.seam is missing, but the part has {right} and {left_face}, where its disk would be cut open: "
            f'give wheel.seam = ["{right}", "{left_face}"]'
        )
    try:
        cut = cyclic_symmetry.cut_sector(part, part_reduction.contacts(scene), wheel.sectors, wheel.seam, wheel.axis)
    except Mismatch as miss:
        raise Refusal(
            f"{miss}, and let wheel.sectors = {wheel.sectors} and wheel.axis be those that the part was made for"
        ) from None
    return spun(scene, part, cut) if wheel.speed else cut


def check_sectors(scene: MeshScene) -> None:
    """Raise Refusal where a part of the scene is made for another number of sectors than its wheel has."""
    if scene.wheel is None:
        return
    tables = [table.parameters for table in (*scene.bodies.values(), scene.geometry) if table is not None]
    for parameters in tables:
        made_for = parameters.get("n_blades", scene.wheel.sectors)
        if made_for != scene.wheel.sectors:
            raise Refusal(f"wheel.sectors = {scene.wheel.sectors}, but the part is made for n_blades = {made_for}")


def reduced(scene: MeshScene, full: Sector) -> ReducedSector:
    """A full sector on its contact, seam and load nodes and a few modes: what serves every engine order.

    Raises  Refusal where it cannot stand, by itself or at its speed
    """
    assert scene.wheel is not None
    speed = scene.wheel.speed
    try:
        attached = distributed(scene, full) if speed else ()
        return reduce_sector(full, scene.reduction.modes, scene.reduction.cutoff, attached)
    except Refusal as trouble:
        if not speed:
            raise
        raise Refusal(f"at wheel.speed = {60 * speed:.6g} rpm {trouble}, or let it turn slower") from None


def at_one_speed(scene: MeshScene, part: Part) -> ReducedModel:
    """The model of the wheel's wave at one speed, not damped."""
    assert scene.wheel is not None
    small = reduced(scene, sector(scene, part))
    springs = joints.contact_stiffness(scene, small.model)
    return travelling_wave(small, scene.wheel.engine_order, springs=springs)


def along_speed(scene: MeshScene, part: Part) -> ReducedModel:
    """The model of the wheel's wave on its operating line, not damped: that of the speed in the middle, and `along`.

    The sector is reduced at speeds that halve the intervals of their squares until the frequencies which the others
    foretell at the newest one are right to `LIMITS.speed_spacing_error`, at most seven of them
    Raises  Refusal where it cannot stand at one of them
    """
    wheel = scene.wheel
    assert wheel is not None
    low, high = (frequency / abs(wheel.engine_order) for frequency in scene.operating_range)
    squares = low**2 + (high**2 - low**2) * np.array([0.0, 1.0, 0.5, 0.25, 0.75, 0.125, 0.875])
    turning: list[Sector] = []
    speeds = np.sqrt(squares).tolist()
    for speed in speeds:
        wheel_at_speed = wheel.model_copy(update={"speed": speed, "sweep": None})
        try:
            turning.append(sector(scene.model_copy(update={"wheel": wheel_at_speed}), part))
            if len(turning) == 2:
                settings = (scene.reduction.modes, scene.reduction.cutoff, distributed(scene, turning[0]))
                ends = reduce_alike(turning, *settings)
        except Refusal as trouble:
            raise Refusal(f"at {60 * speed:.6g} rpm of the operating line {trouble}") from None
        if len(turning) == 2:
            springs = joints.contact_stiffness(scene, ends.model)
            stiffness = (ends.sector.system.stiffness,)
            line = SpeedLine(ends, stiffness, (speeds[0],), wheel.engine_order, CENTRIFUGAL, wheel.speed, springs)
        if len(turning) > 1:
            stiffness_there = congruent(turning[-1].system.stiffness, ends.origin.basis)
            error = line.error(speed, stiffness_there) if len(turning) > 3 else np.inf
            line = replace(line, stiffness=(*line.stiffness, stiffness_there), speeds=(*line.speeds, speed))
            if error <= LIMITS.speed_spacing_error:
                break
    static = [cut.prestress for cut in turning if cut.prestress is not None]
    accuracy = {
        "prestress_residual": max(each.residual for each in static),
        "prestress_rotation": max(each.rotation for each in static),
    }
    wave = line(2 * np.pi * abs(wheel.engine_order) * wheel.speed)
    return SpeedLineModel(
        wave.system, wave.interface, wave.origin, wave.joints, wave.free_frequency,
        reduced=replace(wave.reduced, accuracy=accuracy), engine_order=wave.engine_order, index_of=wave.index_of,
        line=line, line_error=error,
    )  # fmt: skip


def spun(scene: MeshScene, part: Part, cut: Sector) -> Sector:
    """The sector `cut` from a part, vibrating about its equilibrium at the scene's speed.

    The stress is that of the static loads with the contact as it settles under it: closed, slipped or open, pair by
    pair
    Raises  Refusal where the contact does not settle or a body can move rigidly, StaticDivergence where the sector
        has no equilibrium, turns far in it, or is unstable in it with its contacts stuck
    """
    wheel = scene.wheel
    assert wheel is not None
    speed = 2 * np.pi * wheel.speed
    material = part_reduction.material(scene, part.mesh)
    mass, _ = assemble(part.mesh, material)
    softening = part.restricted(spin_softening(mass, wheel.axis, speed))
    turning = csr_matrix(part.restricted(coriolis(mass, wheel.axis, speed))) if wheel.coriolis else None

    def stiffened(stiffness: csr_matrix) -> Sector:
        return replace(cut, system=replace(cut.system, stiffness=stiffness, gyroscopic=turning))

    start = stuck_at_rest(scene, stiffened(csr_matrix(cut.system.stiffness + softening)))
    equilibrium = solve_prestress(
        part, material, lambda k: at_rest(scene, stiffened(k)), start, softening, temperature(scene, part)
    )
    spinning = replace(stiffened(equilibrium.stiffness), prestress=equilibrium)
    check_stability(stuck_index_0(scene, spinning))
    return spinning


def stuck_index_0(scene: MeshScene, sector: Sector) -> csr_matrix:
    """Stiffness (m, m) [N/m] of sectors that move alike with their contacts stuck."""
    system, B = wave_system(sector, 0)
    model = ReducedModel(sector.system, sector.interface, joints=sector.joints)
    return stuck_stiffness(system.stiffness, B, joints.contact_stiffness(scene, model))


def stuck_at_rest(scene: MeshScene, sector: Sector) -> np.ndarray:
    """Displacement (n_free,) [m] under the static loads with all contacts stuck where they stand, whatever their gap:
    where a body would slide away that only its stress holds upright, this is where the stress is first taken from.
    """
    stiffness, T = stuck_index_0(scene, sector), seam_map(sector, 0)
    force = sum((v * sector.system.loads[name] for name, v in static_loads(scene).items()), np.zeros(T.shape[0]))
    return np.asarray(T @ factorise(stiffness, definite=False).solve(T.T @ force))


def at_rest(scene: MeshScene, sector: Sector, tolerance: float = 1e-10, samples: int = 16) -> np.ndarray:
    """Displacement (n_free,) [m] under the static loads of the scene, the contact settled; the same in every sector.

    Sectors that move alike need no masters on their seams, as waves of other indices do, and statics no masters on the
    contact: a traction on every pair makes them exact.
    tolerance : of the balance at rest; samples : of a cycle in which nothing moves
    """
    system, B = wave_system(sector, 0)
    static = static_loads(scene)
    still = replace(system, gyroscopic=None, loads={name: system.loads[name] for name in static}, outputs={})
    interface = replace(sector.interface, B=csr_matrix(B))
    springs = joints.contact_stiffness(scene, ReducedModel(still, interface, joints=sector.joints))
    try:
        model = residual_flexibility(still, interface, springs, n_modes=1, clusters=interface.n_pair)
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
    field = full_displacement(balance, state.flat, state.cycle.force.reshape(state.flat.shape), omega)[:, 0]
    return np.asarray(seam_map(sector, 0) @ field)


def distributed(scene: MeshScene, sector: Sector) -> list[str]:
    """Static loads that act on many nodes, whose statics the reduction is to keep exact."""
    static, loads = static_loads(scene), sector.system.loads
    return [name for name in loads if name in static and np.count_nonzero(loads[name]) > LIMITS.point_load]


def static_loads(scene: MeshScene) -> dict[str, float]:
    """Static loads by name."""
    loads = joints.excite(scene, None).loads
    return {name: float(value.real) for (harmonic, name), value in loads.items() if harmonic == 0}


def temperature(scene: MeshScene, part: Part) -> np.ndarray | None:
    """Change of temperature (n_node,) [K] by the static loads of the scene; None where none heats.

    Raises  Refusal for a field from a file
    """
    change = None
    for name, load in scene.loads.static.items():
        if load.field is not None:
            raise Refusal(f"loads.static.{name}: in a wheel that turns, heat whole bodies instead of a field")
        if load.temperature is not None:
            change = np.zeros(len(part.points)) if change is None else change
            heated = [find_group(part.node_sets, body) for body in load.bodies] or [np.arange(len(change))]
            change[np.concatenate(heated)] += load.temperature
    return change
