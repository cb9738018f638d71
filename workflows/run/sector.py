"""From a part to the sector of a wheel that it is, full and reduced."""

from __future__ import annotations

from tribodyn.fem import cyclic
from tribodyn.fem.cyclic import Sector
from tribodyn.fem.matching import Mismatch
from tribodyn.fem.part import Part
from tribodyn.reduction.cyclic import ReducedSector, reduce_sector
from tribodyn.workflows.run import part_reduction, rotation
from tribodyn.workflows.scene.schema import MeshScene, PartScene
from tribodyn.workflows.scene.structure import StructureScene

SEAM = ("cyclic_right", "cyclic_left")  # what a part calls the faces where its wheel is one piece


def sector(scene: MeshScene, part: Part) -> Sector:
    """The full sector of the scene's wheel, vibrating about its equilibrium where it spins.

    Raises  ValueError where its faces do not match those of its neighbours, or where the disk is left cut open
    """
    wheel = scene.wheel
    assert wheel is not None
    cuts = [tuple(name for name in part.node_sets if name.rpartition(".")[2] == side) for side in SEAM]
    if wheel.seam is None and all(cuts):
        (right, *_), (left, *_) = cuts
        raise ValueError(
            f"wheel.seam is missing, but the part has {right} and {left}, where its disk would be cut open: "
            f'give wheel.seam = ["{right}", "{left}"]'
        )
    try:
        found = cyclic.cut_from(part, part_reduction.contacts(scene), wheel.sectors, wheel.seam, wheel.axis)
    except Mismatch as miss:
        raise ValueError(
            f"{miss}, and let wheel.sectors = {wheel.sectors} and wheel.axis be those that the part was made for"
        ) from None
    return rotation.spun(scene, part, found) if wheel.speed else found


def check_sectors(scene: MeshScene) -> None:
    """Raise ValueError where a part of the scene is made for another number of sectors than its wheel has."""
    if scene.wheel is None:
        return
    tables = list(scene.bodies.values()) if isinstance(scene, StructureScene) else []
    own = scene.geometry if isinstance(scene, PartScene | StructureScene) else None
    given = [table.parameters for table in (*tables, own) if table is not None]
    for parameters in given:
        made_for = parameters.get("n_blades", scene.wheel.sectors)
        if made_for != scene.wheel.sectors:
            raise ValueError(f"wheel.sectors = {scene.wheel.sectors}, but the part is made for n_blades = {made_for}")


def reduced(scene: MeshScene, full: Sector) -> ReducedSector:
    """A full sector on its contact, seam and load nodes and a few modes: what serves every engine order.

    Raises  ValueError where it cannot stand, by itself or at its speed
    """
    assert scene.wheel is not None
    speed = scene.wheel.speed
    try:
        kept = rotation.distributed(scene, full) if speed else ()
        return reduce_sector(full, scene.reduction.modes, scene.reduction.cutoff, kept)
    except ValueError as trouble:
        if not speed:
            raise
        raise ValueError(f"at wheel.speed = {60 * speed:.6g} rpm {trouble}, or let it turn slower") from None
