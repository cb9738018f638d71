"""How the cost of a reduction grows with the mesh: the product in four ways, and plain statements of the same library.

Everything is measured in a process of its own, so that its peak memory is its own; seconds are processor seconds of one
thread."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from tribodyn.fem.factor import factorise
from tribodyn.fem.part import Part
from tribodyn.geometry import parts
from tribodyn.reduction import craig_bampton, residual_flexibility
from tribodyn.reduction.craig_bampton import master_dofs
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import memory, modelling, part_reduction
from tribodyn.workflows.scene import scene_file

SIZES: dict[str, tuple[int, ...]] = {  # of the beam, name -> elements along it and upwards
    # 13 x 13 contact nodes
    "30k": (24, 6), "100k": (44, 12), "300k": (88, 18), "1M": (170, 36),
    # elements that are cubes, with so many contact nodes along a side
    "36k-cubes": (45, 5, 11), "140k-cubes": (72, 8, 17), "1M-cubes": (144, 16, 33),
}  # fmt: skip
# three posts on a plate, each on a joint of faces that do not match, from four mesh files: elements of the plate along
# its three axes, and of a post upwards
ASSEMBLIES = {"assembly": (52, 14, 9, 30)}
PRODUCTS = {  # ways of the product -> how the scene asks for it
    "product": (),
    "flexibility": ("reduction.method=residual_flexibility",),
}
WAYS = ("product", "by hand")
# constraint modes of a million do not fit 24 GB
WAYS_OF_SIZE = dict.fromkeys(("1M", "36k-cubes", "140k-cubes", "1M-cubes"), ("flexibility",))
STAGES = {  # function of a reduction -> what its seconds are told as
    "factorise": "factor", "fixed_interface_modes": "modes", "constraint_modes": "constraint modes",
    "_congruent": "projection", "with_static_shapes": "static shapes",
}  # fmt: skip
MODES = 15


@dataclass(frozen=True)
class FeCost:
    """One size of the mesh, by one way.

    way : of WAYS or PRODUCTS; dofs, masters; seconds : stage -> processor seconds; peak_bytes : memory
    first_hz : lowest frequency of the reduced model without contact, nan where none was made"""

    way: str
    dofs: int
    masters: int
    seconds: dict[str, float]
    peak_bytes: float
    first_hz: float = np.nan


def run(sizes: Sequence[str], say: Callable[[str], None], ways: Sequence[str] = ()) -> list[FeCost]:
    """Measure sizes by name, each way in a process of its own; an assembly by the ways of WAYS.

    ways : those that fit the size by default
    Raises  ValueError for a size or a way that is not known"""
    ways_by_name = dict.fromkeys([*PRODUCTS, *WAYS])
    for way in ways:
        if way not in ways_by_name:
            raise Refusal(f'no way "{way}": there are {", ".join(ways_by_name)}')
    rows = []
    for size in sizes:
        if size not in SIZES | ASSEMBLIES:
            raise Refusal(f'no size "{size}": there are {", ".join(SIZES | ASSEMBLIES)}')
        for way in ways or WAYS_OF_SIZE.get(size, WAYS):
            say(f"{size}{' DOFs' if size in SIZES else ''}, {way}")
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                job = pool.submit(measure, SIZES[size], way) if size in SIZES else None
                rows.append((job or pool.submit(measure_assembly, ASSEMBLIES[size], way)).result())
    return rows


def measure(size: tuple[int, ...], way: str, n_patch: int = 13) -> FeCost:
    """One size of the beam by one way, on one thread."""
    changes = [
        f"geometry.n_length={size[0]}", f"geometry.n_height={size[1]}", f"geometry.n_patch={(*size, n_patch)[2]}",
    ]  # fmt: skip
    changes += ["geometry.length_grading=1", "geometry.grading=1"] if len(size) > 2 else []
    changes += [f"reduction.modes={MODES}", *PRODUCTS.get(way, ())]
    return _measured(lambda folder: scene_file.read("beam_thesis", changes), way)


def measure_assembly(size: tuple[int, int, int, int], way: str) -> FeCost:
    """One size of the assembly by one way, on one thread, from its files on."""
    return _measured(lambda folder: assembly(folder, size), way, files=True)


def _measured(scene_of: Callable[[Path], scene_file.SceneFile], way: str, files: bool = False) -> FeCost:
    """One scene by one way; files : whether the clock starts before its mesh is there."""
    with threadpool_limits(1), TemporaryDirectory() as name:
        folder = Path(name)
        file = scene_of(folder)
        scene = file.mesh_scene
        memory.forget_peak()
        clock = _Clock()
        mesh, node_sets = modelling.make_mesh(file, folder)
        if files:
            clock("files")
        else:
            memory.forget_peak()
            clock = _Clock()
        part = modelling.make_part(scene, mesh, node_sets, file.folder)
        clock("assembly")
        if way in PRODUCTS:
            with _stages() as of_stages:
                reduced = part_reduction.reduce(scene, part)
            clock("rest")
            clock.seconds["rest"] -= sum(of_stages.values())
            masters = len(reduced.origin.masters)
            frequency = reduced.free_frequency
            cost = FeCost(
                way, part.system.n_dof, masters, clock.seconds | of_stages, memory.peak(),
                first_hz=float(frequency[0]),
            )  # fmt: skip
        else:
            cost = _by_hand(part, clock)
    return cost


def assembly(folder: Path, size: tuple[int, int, int, int]) -> scene_file.SceneFile:
    """Three posts on a plate, their meshes written to files in a folder and read by its scene."""
    plate, post = parts.load("block"), parts.load("block")
    plate.build(
        plate.Parameters(0.3, 0.08, 0.05, n_length=size[0], n_width=size[1], n_height=size[2]), folder / "plate.msh"
    )
    post.build(post.Parameters(0.02, 0.02, 0.1, n_length=3, n_width=3, n_height=size[3]), folder / "post.msh")
    steel = "young = 210e9\npoisson = 0.3\ndensity = 7860.0\n"
    text = f"[scene]\ntitle = 'Posts on a plate'\n[materials.steel]\n{steel}"
    text += "[bodies.plate]\nmesh = 'plate.msh'\nmaterial = 'steel'\nfixed = ['x_min']\n"
    for i, at in enumerate((0.061, 0.143, 0.226), 1):
        text += f"[bodies.post_{i}]\nmesh = 'post.msh'\nmaterial = 'steel'\ntranslation = [{at}, 0.031, 0.05]\n"
        text += f"[contacts.joint_{i}]\nfirst = 'post_{i}.z_min'\nsecond = 'plate.z_max'\nt1 = 'x'\n"
        text += "tangential_stiffness = 1e8\nnormal_stiffness = 1e8\nfriction = 0.3\n"
    push = "group = 'post_3.z_max'\ndirection = 'x'\n"
    text += f"[loads.harmonic.shake]\n{push}value = 1.0\n"
    text += f"[response]\n{push}frequency = [100.0, 200.0]\npoints = 3\n[reduction]\nmodes = {MODES}\n"
    return scene_file.parse(text, "assembly.toml", (), folder)


class _Clock:
    """Processor seconds from call to call."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.process_time()

    def __call__(self, stage: str) -> None:
        now = time.process_time()
        self.seconds[stage], self._last = now - self._last, now


@contextmanager
def _stages() -> Iterator[dict[str, float]]:
    """Processor seconds that the functions of STAGES take in a reduction meanwhile."""
    seconds: dict[str, float] = {}

    def timed(function: Any, stage: str) -> Any:
        def call(*args: Any, **named: Any) -> Any:
            start = time.process_time()
            try:
                return function(*args, **named)
            finally:
                seconds[stage] = seconds.get(stage, 0.0) + time.process_time() - start

        return call

    with ExitStack() as patched:
        for module in (craig_bampton, residual_flexibility):
            for name, stage in STAGES.items():
                if hasattr(module, name):
                    patched.enter_context(patch.object(module, name, timed(getattr(module, name), stage)))
        yield seconds


def _split(part: Part) -> tuple[np.ndarray, np.ndarray]:
    masters = np.unique(master_dofs(part.system, part.interface))
    return np.setdiff1d(np.arange(part.system.n_dof), masters), masters


def _by_hand(part: Part, clock: _Clock) -> FeCost:
    """The reduction as plain statements on the same solver, with what it holds at once."""
    s, m = _split(part)
    K, M = csr_matrix(part.system.stiffness), csr_matrix(part.system.mass)
    K_ss, M_ss = K[s][:, s], M[s][:, s]
    factor = factorise(K_ss)
    clock("factor")
    inverse = LinearOperator(K_ss.shape, matvec=factor.solve, dtype=float)
    _, phi = eigsh(K_ss, k=MODES, M=M_ss, sigma=0.0, OPinv=inverse, v0=np.ones(len(s)))
    clock("modes")
    psi = -factor.solve(K[s][:, m].toarray())
    clock("constraint modes")
    basis = np.zeros((part.system.n_dof, len(m) + MODES))
    basis[m, np.arange(len(m))] = 1.0
    basis[s] = np.hstack([psi, phi])
    stiffness, _ = basis.T @ (K @ basis), basis.T @ (M @ basis)
    clock("projection")
    assert stiffness.shape == (len(m) + MODES,) * 2
    return FeCost("by hand", part.system.n_dof, len(m), clock.seconds, memory.peak())


def as_text(rows: Sequence[FeCost]) -> str:
    """The rows for people, with exponents of seconds and memory over DOFs where there are several sizes."""
    lines = []
    for row in rows:
        stages = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in row.seconds.items())
        frequency = "" if np.isnan(row.first_hz) else f"; first frequency {row.first_hz:.9g} Hz"
        lines.append(
            f"{row.dofs:9d} DOFs, {row.masters} masters, {row.way:16} {row.peak_bytes / 1e9:6.2f} GB: {stages}"
            f"{frequency}"
        )
    for way in dict.fromkeys(row.way for row in rows):
        of_way = [row for row in rows if row.way == way]
        if len({row.dofs for row in of_way}) > 1:
            size = np.log([row.dofs for row in of_way])
            powers = [
                np.polyfit(size, np.log(y), 1)[0]
                for y in ([sum(r.seconds.values()) for r in of_way], [r.peak_bytes for r in of_way])
            ]
            lines.append(f"{way}: seconds grow with the power {powers[0]:.2f} of the DOFs, memory with {powers[1]:.2f}")
    return "\n".join(lines)
