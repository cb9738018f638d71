"""How set-up, memory and seconds grow with thousands of contact DOFs: the beam scene on finer and finer patches.

Every size is measured in a process of its own, so that its peak memory is its own; seconds are processor seconds of one
thread. Craig-Bampton with its dense compliance is measured beside the residual flexibility as far as it fits.

The roofline (see `bench`) is that of the parts of a curve by residual flexibility. Where contact rows are eliminated
last, a solution in them reads the lower triangle of their dense factor twice.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from threadpoolctl import threadpool_limits

from proof.bench import Machine, Work
from tests.helpers.reduced import reduce_part
from tribodyn.fem.factor import Pardiso, factorise
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.linear import all_harmonics
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.hbm.linearisation import Linearisation
from tribodyn.reduction import residual_flexibility
from tribodyn.reduction.residual_flexibility import FlexibleModel, ResidualFlexibility
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import memory, modelling, settings
from tribodyn.workflows.scene import scene_file

# name -> nodes along a side, points
SIZES = {"500": (13, 200), "1500": (23, 200), "3k": (31, 200), "12k": (65, 200), "48k": (127, 6)}
DENSE = ("500", "1500", "3k")  # sizes at which Craig-Bampton is measured too
WAYS = {"craig_bampton": 60, "residual_flexibility": 24}  # and its modes
RANGE, HARMONICS, SAMPLES = 200, [0, 1, 2, 3], 100  # points of the scene's range; fewer are taken about its middle
PROBE_HZ, PROBES = 3000.0, 3  # the highest harmonic at the upper end of the range
WATCHED: dict[str, tuple[Any, str]] = {  # what a curve by residual flexibility is made of
    "contact": (JointSet, "cycle"),
    "slopes": (Linearisation, "g_slope"),
    "products": (all_harmonics, "nearly_displaced"),
    "modes": (CompliancePoint, "nearly"),
    "rest": (ResidualFlexibility, "apply"),
    "factor": (residual_flexibility, "solve_selected"),
}


@dataclass(frozen=True)
class Part:
    """A part of a curve, a point: calls, seconds, bytes read, operations, and the least seconds of these."""

    name: str
    calls: float
    seconds: float
    bytes: float
    flops: float
    limit: float


@dataclass(frozen=True)
class ContactCost:
    """One size by one way.

    way : reduction.method; contact_dofs, full_dofs, model_dofs; assembly_seconds; setup_seconds : from matrices to the
    harmonic balance; response_seconds : of the points
    points, converged, newton_steps : of the curve; peak_bytes : largest memory of the process
    compliance_error : of the contact compliance at PROBE_HZ, undamped, against a factor of K_s - omega^2 M of the whole
        part, relative; nan where it was not made
    left_out : share of the flexibility that Newton's directions do without
    force_difference : of the contact forces at every tenth point from those of the other way, relative; nan for none
    parts : of the curve by residual flexibility; in the contact law only the bytes are counted
    """

    way: str
    contact_dofs: int
    full_dofs: int
    model_dofs: int
    assembly_seconds: float
    setup_seconds: float
    response_seconds: float
    points: int
    converged: int
    newton_steps: int
    peak_bytes: float
    compliance_error: float
    left_out: float
    force_difference: float = np.nan
    parts: tuple[Part, ...] = field(default_factory=tuple)


def run(sizes: Sequence[str], say: Callable[[str], None]) -> list[ContactCost]:
    """Measure sizes by name, each way in a process of its own; raises ValueError for a size that is not known."""
    unknown = [size for size in sizes if size not in SIZES]
    if unknown:
        raise Refusal(f'no size "{unknown[0]}": there are {", ".join(SIZES)}')
    rows = []
    for size in sizes:
        theirs: np.ndarray | None = None
        for way, modes in WAYS.items():
            if way == "craig_bampton" and size not in DENSE:
                continue
            say(f"{size} contact DOFs, {way}")
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                row, forces = pool.submit(measure, *SIZES[size], way, modes).result()
            if theirs is not None and len(theirs) == len(forces):
                off = np.abs(forces - theirs).max(axis=(1, 2, 3)) / np.abs(theirs).max(axis=(1, 2, 3))
                row = replace(row, force_difference=float(off.max()))
            theirs = forces
            rows.append(row)
    return rows


def measure(n_patch: int, points: int, way: str, modes: int) -> tuple[ContactCost, np.ndarray]:
    """One response of the beam with n_patch x n_patch contact nodes, and its contact forces at every tenth point."""
    changes = [f"geometry.n_patch={n_patch}", f"harmonics.kept={HARMONICS}", f"harmonics.samples={SAMPLES}"]
    changes += [f'reduction.method="{way}"', f"reduction.modes={modes}"]
    file = scene_file.read("beam_thesis", changes)
    scene = file.mesh_scene
    with threadpool_limits(1), TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
        clock = [time.process_time()]
        part = modelling.make_part(scene, mesh, node_sets)
        clock.append(time.process_time())
        reduced = reduce_part(scene, part)
        balance = modelling.make_model(scene, part, reduced).balance
        clock.append(time.process_time())
        low, high = settings.response_range(scene)
        step = (high - low) / (RANGE - 1)
        first = high - step * ((RANGE - points) // 2)
        last = first - step * (points - 1)
        options = natural.Options(n_points=points, newton=settings.newton_options(scene))
        natural.follow(balance, high, high - 1e-6 * step, natural.Options(n_points=2))  # compiles outside the clock
        clock.append(time.process_time())
        spent: dict[str, list[float]] = {}
        with watched(spent):
            branch = natural.follow(balance, first, last, options)
        clock.append(time.process_time())
        peak, remainder = memory.peak(), reduced.residual if isinstance(reduced, FlexibleModel) else None
        parts = () if remainder is None else _parts(balance, spent, len(branch.omega))  # before its factor is let go
    row = ContactCost(
        way=way,
        contact_dofs=balance.compliance.n_contact,
        full_dofs=part.system.n_dof,
        model_dofs=reduced.system.n_dof,
        assembly_seconds=clock[1] - clock[0],
        setup_seconds=clock[2] - clock[1],
        response_seconds=clock[4] - clock[3],
        points=len(branch.omega),
        converged=int(branch.converged.sum()),
        newton_steps=int(branch.newton_steps.sum()),
        peak_bytes=peak,
        compliance_error=np.nan if remainder is None else compliance_error(remainder, 2 * np.pi * PROBE_HZ),
        left_out=0.0 if remainder is None else remainder.left_out,
        parts=parts,
    )
    return row, _forces(balance, branch)


@contextmanager
def watched(spent: dict[str, list[float]]) -> Iterator[None]:
    """Adds calls and seconds of each of WATCHED."""

    def counting(plain: Callable[..., Any], entry: list[float]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            clock = time.process_time()
            result = plain(*arguments, **options)
            entry[0] += 1
            entry[1] += time.process_time() - clock
            return result

        return call

    with ExitStack() as stack:
        for name, (owner, attribute) in WATCHED.items():
            plain = getattr(owner, attribute)
            stack.enter_context(patch.object(owner, attribute, counting(plain, spent.setdefault(name, [0, 0.0]))))
        yield


def _parts(balance: HarmonicBalance, spent: dict[str, list[float]], points: int) -> tuple[Part, ...]:
    """The parts of a curve of so many points, `rest` and `modes` shared out to factor and modes."""
    n, m, r = balance.compliance.n_contact, balance.basis.n_coeff, balance.compliance.groups[0][0].n_mode
    assert isinstance(balance.model, FlexibleModel)
    remainder = balance.model.residual
    read = 4 * len(np.unique(remainder.B.indices)) ** 2  # of the factor, each of two times
    if isinstance(remainder.factor, Pardiso) and not remainder.factor._selects:
        read = 1024 * int(remainder.factor._solver.get_iparm(Pardiso.SIZE))
    blocks, calls = (
        balance.contact.n_pair * (n // balance.contact.n_pair * m) ** 2,
        {k: c for k, (c, _) in spent.items()},
    )
    core = 16 * len(balance.basis.dynamic) * r**2
    seconds = {name: took for name, (_, took) in spent.items()}
    seconds["modes"] += seconds["rest"] - seconds["factor"]
    calls["modes"] += calls["rest"]
    works = {
        "contact": ("contact law", 8 * blocks, {}),
        "slopes": ("slopes of pairs", 8 * blocks, {8: 2 * blocks}),
        "products": ("products of GMRES", 8 * n * r + core, {4: 4 * n * r * m, 8: core // 2}),
        "modes": ("modes in double", 16 * n * r + core, {8: 4 * n * r * m + core // 2}),
        "factor": ("solutions with the factor", 2 * read, {8: read * m // 2}),
    }
    machine = Machine.measured()
    return tuple(
        Part(
            name=name,
            calls=calls[of] / points,
            seconds=seconds[of] / points,
            bytes=calls[of] * read / points,
            flops=calls[of] * sum(flops.values()) / points,
            limit=machine.seconds(Work(name, int(calls[of]), read, flops)) / points,
        )
        for of, (name, read, flops) in works.items()
    )


def _forces(balance: HarmonicBalance, branch: Branch) -> np.ndarray:
    """Contact forces (n, n_pair, n_component, n_coeff) [N] at every tenth of the points."""
    shape = balance.contact.stiffness.shape
    at = range(0, len(branch.omega), 10)
    states = [branch.contact[i].reshape(*shape, -1) for i in at]
    return np.stack([balance.contact.cycle(x, balance.basis, balance.memory, False).force for x in states])


def compliance_error(residual: ResidualFlexibility, omega: float) -> float:
    """Relative error of the undamped contact compliance at omega [rad/s] against a factor of K_s - omega^2 M."""
    root = np.sqrt(residual.stiffness)[:, None]
    force = root * np.random.default_rng(1).standard_normal((len(root), PROBES))
    modal = residual.at_contact.T @ force
    displacement = residual.apply(force) + residual.at_contact @ (modal / (residual.squares - omega**2)[:, None])
    residual.__dict__.pop("factor")  # makes room for the other one
    factor = factorise(residual.matrix - omega**2 * residual.mass, definite=False)
    exact = residual.B @ factor.solve(np.asfortranarray(residual.B.T @ force))
    return float(np.max(np.linalg.norm(root * (displacement - exact), axis=0) / np.linalg.norm(root * exact, axis=0)))


def powers(rows: Sequence[ContactCost]) -> dict[str, float]:
    """Exponents over the contact DOFs, least squares in the logarithms: of set-up, seconds a point, and memory."""
    size = np.log([row.contact_dofs for row in rows])
    of = {
        "set-up": [row.setup_seconds for row in rows],
        "seconds a point": [row.response_seconds / row.points for row in rows],
        "memory": [row.peak_bytes for row in rows],
    }
    return {name: float(np.polyfit(size, np.log(y), 1)[0]) for name, y in of.items()}


def as_records(rows: Sequence[ContactCost]) -> list[dict[str, Any]]:
    """The rows for JSON."""
    return [asdict(row) for row in rows]


def as_text(rows: Sequence[ContactCost]) -> str:
    """The rows for people, with exponents where a way has several sizes."""
    lines = []
    for r in rows:
        remarks = "" if np.isnan(r.compliance_error) else f", compliance off by {r.compliance_error:.1e}"
        remarks += "" if np.isnan(r.force_difference) else f", forces differ by {r.force_difference:.1e}"
        each = r.response_seconds / r.points
        lines.append(
            f"{r.contact_dofs:6d} contact DOFs of {r.full_dofs:7d}, {r.way:20} {r.model_dofs:5d} coordinates "
            f"{r.peak_bytes / 1e9:6.2f} GB: assembly {r.assembly_seconds:.1f} s, set-up {r.setup_seconds:.1f} s, "
            f"{r.converged}/{r.points} points in {r.response_seconds:.1f} s ({each:.2f} s each, "
            f"{r.newton_steps} Newton steps){remarks}"
        )
        lines += _roofline(r)
    for way in dict.fromkeys(row.way for row in rows):
        of_way = [row for row in rows if row.way == way]
        if len({row.contact_dofs for row in of_way}) > 1:
            exponents = ", ".join(f"{name} {power:.2f}" for name, power in powers(of_way).items())
            lines.append(f"{way}: powers of the contact DOFs: {exponents}")
    return "\n".join(lines)


def _roofline(row: ContactCost) -> list[str]:
    """A line for each part of a point, and how near they are to what the machine lets them take."""
    lines = [
        f"  {p.name:25} {p.calls:4.1f} a point, {p.bytes / 1e6:6.0f} MB, {p.flops / 1e6:6.0f} MFlop: "
        f"{1e3 * p.limit:6.1f} of {1e3 * p.seconds:6.1f} ms at least"
        for p in row.parts
    ]
    if row.parts:
        each, limit = row.response_seconds / row.points, sum(p.limit for p in row.parts)
        lines.append(f"  roofline of all: {1e3 * limit:.0f} of {1e3 * each:.0f} ms, {limit / each:.0%}")
    return lines
