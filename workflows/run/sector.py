"""From a part to the wave of a wheel: cut the sector out, reduce it, let the wave travel round.

A wheel at rest: `sector` -> `reduced` -> `travelling_wave`. One that turns is cut about its equilibrium at that speed.
One on an operating line is reduced at several speeds alike, see `along_speed`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.cyclic_symmetry import Sector, seam_map, wave_system
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import UNSTABLE, check_stability, coriolis, solve_prestress, spin_softening
from tribodyn.fem.sector_fit import describe_fault
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
from tribodyn.workflows.run.sanity_checks import check_size
from tribodyn.workflows.run.stresses import temperature
from tribodyn.workflows.scene.schema import CENTRIFUGAL, MeshScene
from tribodyn.workflows.scene.wheel_scene import WheelScene

SEAM = ("cyclic_right", "cyclic_left")  # node sets of a part where the wheel continues without contact


def sector(scene: WheelScene, part: Part, start: np.ndarray | None = None) -> Sector:
    """The full sector of the scene's wheel; of a rotating wheel, about its static equilibrium at speed.

    start : (n_free,) displacement [m] near that equilibrium; that with all contacts stuck by default
    Raises  Refusal where the faces do not match those of the neighbours, or where wheel.seam is missing, so that the
        disk would be cut open"""
    wheel = scene.wheel
    seams = [tuple(name for name in part.node_sets if name.rpartition(".")[2] == side) for side in SEAM]
    if wheel.seam is None and all(seams):
        (right, *_), (left_face, *_) = seams
        raise Refusal(
            f"wheel.seam is missing, but the part has {right} and {left_face}, where its disk would be cut open: "
            f'give wheel.seam = ["{right}", "{left_face}"]'
        )
    try:
        cut = cyclic_symmetry.cut_sector(part, part_reduction.contacts(scene), wheel.sectors, wheel.seam, wheel.axis)
    except Refusal:
        check_faces(scene, part.mesh, part.node_sets)  # the part may be that of a scene with another seam
        raise
    if not wheel.speed:
        return cut
    try:
        return sector_about_equilibrium(scene, part, cut, start)
    except StaticDivergence as divergence:
        size = check_size(np.ptp(part.points, axis=0), "give its unit")
        raise StaticDivergence("; ".join([f"at {60 * wheel.speed:.6g} rpm {divergence}", *size])) from None


def check_faces(scene: WheelScene, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> None:
    """Raise Refusal where the faces that meet between sectors say that the wheel turns otherwise than [wheel]."""
    wheel = scene.wheel
    faces = [*([wheel.seam] if wheel.seam else [])]
    faces += [(c.groups[0], c.opposite) for c in scene.joints.values() if c.meets_next and c.opposite is not None]
    for pair in faces:
        if fault := describe_fault(mesh, node_sets, pair, wheel.sectors, wheel.axis):
            raise Refusal(f"wheel: {fault}")


def reduced(scene: WheelScene, full: Sector) -> ReducedSector:
    """Reduce a full sector to its contact, seam and load nodes and a few modes. It serves every engine order.

    Raises  Refusal where the reduction fails; at speed the sentence names the speed"""
    speed = scene.wheel.speed
    try:
        return reduce_sector(full, scene.reduction.modes, scene.reduction.cutoff)
    except Refusal as refusal:
        if not speed:
            raise
        raise Refusal(f"at wheel.speed = {60 * speed:.6g} rpm {refusal}, or let it turn slower") from None


def at_one_speed(scene: WheelScene, part: Part) -> ReducedModel:
    """The travelling wave of the wheel at one speed, without damping."""
    reduced_sector = reduced(scene, sector(scene, part))
    springs = joints.contact_stiffness(scene, reduced_sector.model)
    return travelling_wave(reduced_sector, scene.wheel.engine_order, springs=springs)


def along_speed(scene: WheelScene, part: Part) -> ReducedModel:
    """The travelling wave of the wheel along its operating line (frequency = engine order times speed), undamped.

    The model is that of wheel.speed; it interpolates to any other speed of the line, four at least.
    Raises  Refusal as `speed_line` does"""
    wheel = scene.wheel
    low, high = (frequency / abs(wheel.engine_order) for frequency in scene.operating_range)
    line, error, accuracy = speed_line(scene, part, low, high, 4, LIMITS.speed_spacing_error)
    wave = line(2 * np.pi * abs(wheel.engine_order) * wheel.speed)
    return SpeedLineModel(
        wave.system, wave.interface, wave.origin, wave.joints, wave.free_frequency,
        reduced=replace(wave.reduced, accuracy=accuracy), engine_order=wave.engine_order, index_of=wave.index_of,
        line=line, line_error=error,
    )  # fmt: skip


def speed_line(
    scene: WheelScene, part: Part, first: float, second: float, least: int, tolerance: float
) -> tuple[SpeedLine, float, dict[str, float]]:
    """The sector between two speeds [Hz], the first above 0, with its error at the newest speed and its accuracy.

    The sector is reduced at these two speeds, then at speeds between them, equally spaced in speed^2 and halved, so
    many at `least`, seven at most. This stops when the frequencies interpolated from the other speeds are right at the
    newest speed to the relative tolerance.
    Raises  Refusal where the sector has no equilibrium at one of these speeds"""
    wheel = scene.wheel
    squared_speeds = first**2 + (second**2 - first**2) * np.array([0.0, 1.0, 0.5, 0.25, 0.75, 0.125, 0.875])
    sectors: list[Sector] = []
    speeds = np.sqrt(squared_speeds).tolist()  # [Hz]
    for speed in speeds:
        prestress = sectors[0].prestress if sectors else None
        start = None if prestress is None else (speed / speeds[0]) ** 2 * prestress.displacement
        wheel_at_speed = wheel.model_copy(update={"speed": speed, "sweep": None})
        try:
            sectors.append(sector(scene.model_copy(update={"wheel": wheel_at_speed}), part, start))
            if len(sectors) == 2:
                ends = reduce_alike(sectors, scene.reduction.modes, scene.reduction.cutoff)
        except StaticDivergence:  # names the speed
            raise
        except Refusal as refusal:
            raise Refusal(f"at {60 * speed:.6g} rpm {refusal}") from None
        if len(sectors) == 2:
            springs = joints.contact_stiffness(scene, ends.model)
            stiffness = (ends.sector.system.stiffness,)
            line = SpeedLine(ends, stiffness, (speeds[0],), wheel.engine_order, CENTRIFUGAL, wheel.speed, springs)
        if len(sectors) > 1:
            stiffness_there = congruent(sectors[-1].system.stiffness, ends.origin.basis)
            error = line.error(speed, stiffness_there) if len(sectors) >= least else np.inf
            line = replace(line, stiffness=(*line.stiffness, stiffness_there), speeds=(*line.speeds, speed))
            if error <= tolerance:
                break
    prestresses = [sector_at_speed.prestress for sector_at_speed in sectors if sector_at_speed.prestress is not None]
    accuracy = {
        "prestress_residual": max(each.residual for each in prestresses),
        "prestress_rotation": max(each.rotation for each in prestresses),
    }
    return line, error, accuracy


def sector_about_equilibrium(
    scene: WheelScene, part: Part, cut_sector: Sector, start: np.ndarray | None = None
) -> Sector:
    """The sector `cut_sector` of a part, about its static equilibrium at the scene's speed; start as for `sector`.

    The stress is that under the static loads, solved together with the contact: each pair is closed, slipped or open.
    Stress and contact are found in turns: `solve_prestress` takes the stress from a displacement, `static_displacement`
    the displacement from the stiffness under that stress. Coriolis forces act unless wheel.coriolis = false.
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

    if start is None:
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
    if not sector.interface.n_pair:
        return stuck_displacement(scene, sector)
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
