"""From a part to the wave of a wheel: cut the sector out, reduce it, let the wave travel round.

A wheel at rest: `sector` -> `reduced` -> `travelling_wave`. One that turns is cut about its equilibrium at that speed,
see sector_equilibrium. One on an operating line is reduced at several speeds alike, see `along_speed`."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.cyclic_symmetry import Sector
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.fem.sector_fit import describe_fault
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.sector_reduction import ReducedSector, reduce_sector
from tribodyn.reduction.speed_line import SpeedLine, SpeedLineModel, congruent, reduce_alike
from tribodyn.reduction.wave_model import travelling_wave
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, part_reduction
from tribodyn.workflows.run.sanity_checks import check_size
from tribodyn.workflows.run.sector_equilibrium import sector_about_equilibrium
from tribodyn.workflows.scene.schema import CENTRIFUGAL
from tribodyn.workflows.scene.wheel_scene import WheelScene

SEAM = ("cyclic_right", "cyclic_left")  # node sets of a part where the wheel continues without contact


def sector(scene: WheelScene, part: Part) -> Sector:
    """The full sector of the scene's wheel; of a rotating wheel, about its static equilibrium at speed.

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
    cut = cyclic_symmetry.cut_sector(part, part_reduction.contacts(scene), wheel.sectors, wheel.seam, wheel.axis)
    if not wheel.speed:
        return cut
    try:
        return sector_about_equilibrium(scene, part, cut)
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

    The model is that of wheel.speed; it interpolates to any other speed of the line. The sector is reduced at the two
    ends of the range, then at speeds between them, equally spaced in speed^2 and halved. This stops when the
    frequencies interpolated from the other speeds are right at the newest speed to `LIMITS.speed_spacing_error`: four
    speeds at least, seven at most.
    Raises  Refusal where the sector has no equilibrium at one of these speeds"""
    wheel = scene.wheel
    low, high = (frequency / abs(wheel.engine_order) for frequency in scene.operating_range)
    squared_speeds = low**2 + (high**2 - low**2) * np.array([0.0, 1.0, 0.5, 0.25, 0.75, 0.125, 0.875])
    sectors: list[Sector] = []
    speeds = np.sqrt(squared_speeds).tolist()  # [Hz]
    for speed in speeds:
        wheel_at_speed = wheel.model_copy(update={"speed": speed, "sweep": None})
        try:
            sectors.append(sector(scene.model_copy(update={"wheel": wheel_at_speed}), part))
            if len(sectors) == 2:
                ends = reduce_alike(sectors, scene.reduction.modes, scene.reduction.cutoff)
        except Refusal as refusal:
            raise Refusal(f"at {60 * speed:.6g} rpm of the operating line {refusal}") from None
        if len(sectors) == 2:
            springs = joints.contact_stiffness(scene, ends.model)
            stiffness = (ends.sector.system.stiffness,)
            line = SpeedLine(ends, stiffness, (speeds[0],), wheel.engine_order, CENTRIFUGAL, wheel.speed, springs)
        if len(sectors) > 1:
            stiffness_there = congruent(sectors[-1].system.stiffness, ends.origin.basis)
            error = line.error(speed, stiffness_there) if len(sectors) > 3 else np.inf
            line = replace(line, stiffness=(*line.stiffness, stiffness_there), speeds=(*line.speeds, speed))
            if error <= LIMITS.speed_spacing_error:
                break
    prestresses = [sector_at_speed.prestress for sector_at_speed in sectors if sector_at_speed.prestress is not None]
    accuracy = {
        "prestress_residual": max(each.residual for each in prestresses),
        "prestress_rotation": max(each.rotation for each in prestresses),
    }
    wave = line(2 * np.pi * abs(wheel.engine_order) * wheel.speed)
    return SpeedLineModel(
        wave.system, wave.interface, wave.origin, wave.joints, wave.free_frequency,
        reduced=replace(wave.reduced, accuracy=accuracy), engine_order=wave.engine_order, index_of=wave.index_of,
        line=line, line_error=error,
    )  # fmt: skip
