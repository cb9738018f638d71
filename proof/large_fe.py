"""How the cost of a reduction grows with the mesh, by the ways that the product has.

Everything is measured in a process of its own, so that its peak memory is its own; seconds are processor seconds of one
thread."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from tribodyn.refusal import Refusal
from tribodyn.workflows.run import memory, modelling, part_reduction
from tribodyn.workflows.scene import scene_file

SIZES: dict[str, tuple[int, ...]] = {  # of the beam, name -> elements along it and upwards
    # 13 x 13 contact nodes
    "30k": (24, 6), "100k": (44, 12), "300k": (88, 18), "1M": (170, 36),
    # elements that are cubes, with so many contact nodes along a side
    "36k-cubes": (45, 5, 11), "140k-cubes": (72, 8, 17), "1M-cubes": (144, 16, 33),
}  # fmt: skip
WAYS = {"product": (), "flexibility": ("reduction.method=residual_flexibility",)}  # way -> how the scene asks for it
ONLY_FLEXIBLE = ("1M", "1M-cubes")  # constraint modes of a million DOFs do not fit 24 GB
MODES = 15


@dataclass(frozen=True)
class FeCost:
    """One size of the mesh, by one way.

    way : of WAYS; dofs, masters; assembly, reduction : processor seconds; peak_bytes : memory
    first_hz : lowest frequency of the reduced model without contact"""

    way: str
    dofs: int
    masters: int
    assembly: float
    reduction: float
    peak_bytes: float
    first_hz: float


def run(sizes: Sequence[str], say: Callable[[str], None]) -> list[FeCost]:
    """Measure sizes by name in every way, each in a process of its own; raises Refusal for an unknown size."""
    rows = []
    for size in sizes:
        if size not in SIZES:
            raise Refusal(f'no size "{size}": there are {", ".join(SIZES)}')
        for way in list(WAYS)[size in ONLY_FLEXIBLE :]:
            say(f"{size} DOFs, {way}")
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                rows.append(pool.submit(measure, SIZES[size], way).result())
    return rows


def measure(size: tuple[int, ...], way: str, n_patch: int = 13) -> FeCost:
    """One size of the beam by one way, on one thread."""
    shape = dict(zip(("n_length", "n_height", "n_patch"), (*size, n_patch), strict=False))
    shape |= {"length_grading": 1, "grading": 1} if len(size) > 2 else {}
    changes = [*(f"geometry.{key}={value}" for key, value in shape.items()), f"reduction.modes={MODES}", *WAYS[way]]
    file = scene_file.read("beam_thesis", changes)
    with threadpool_limits(1), TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
        memory.forget_peak()
        clocks = [time.process_time()]
        part = modelling.make_part(file.mesh_scene, mesh, node_sets, file.folder)
        clocks.append(time.process_time())
        reduced = part_reduction.reduce(file.mesh_scene, part)
        clocks.append(time.process_time())
        dofs, masters, frequency = part.system.n_dof, len(reduced.origin.masters), float(reduced.free_frequency[0])
        return FeCost(way, dofs, masters, *np.diff(clocks).tolist(), memory.peak(), frequency)


def as_text(rows: Sequence[FeCost]) -> str:
    """The rows for people."""
    return "\n".join(
        f"{row.dofs:9d} DOFs, {row.masters} masters, {row.way:12} {row.peak_bytes / 1e9:6.2f} GB: assembly "
        f"{row.assembly:.2f} s, reduction {row.reduction:.2f} s; first frequency {row.first_hz:.9g} Hz"
        for row in rows
    )
