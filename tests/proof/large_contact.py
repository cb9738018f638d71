"""How set-up, memory and seconds grow with thousands of contact DOFs: the beam scene on finer and finer patches.

Every size is measured in a process of its own, so that its peak memory is its own; seconds are processor seconds of one
thread. Craig-Bampton with its dense compliance is measured beside the residual flexibility as far as it fits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tests.helpers.reduced import reduce_part
from tribodyn.fem.factor import factorise
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import natural
from tribodyn.reduction.residual_flexibility import ResidualFlexibility
from tribodyn.workflows.run import memory, modelling, settings
from tribodyn.workflows.scene import scene_file

# name -> nodes along a side, points
SIZES = {"500": (13, 200), "1500": (23, 200), "3k": (31, 200), "12k": (65, 200), "48k": (127, 6)}
DENSE = ("500", "1500", "3k")  # sizes at which Craig-Bampton is measured too
WAYS = {"craig_bampton": 60, "residual_flexibility": 24}  # and its modes
RANGE, HARMONICS, SAMPLES = 200, [0, 1, 2, 3], 100  # points of the scene's range; fewer are taken about its middle
PROBE_HZ, PROBES = 3000.0, 3  # the highest harmonic at the upper end of the range


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


def run(sizes: Sequence[str], say: Callable[[str], None]) -> list[ContactCost]:
    """Measure sizes by name, each way in a process of its own; raises ValueError for a size that is not known."""
    unknown = [size for size in sizes if size not in SIZES]
    if unknown:
        raise ValueError(f'no size "{unknown[0]}": there are {", ".join(SIZES)}')
    rows = []
    for size in sizes:
        theirs: np.ndarray | None = None
        for way, modes in WAYS.items():
            if way == "craig_bampton" and size not in DENSE:
                continue
            say(f"{size} contact DOFs, {way}")
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
                row, forces = alone.submit(measure, *SIZES[size], way, modes).result()
            if theirs is not None and len(theirs) == len(forces):
                off = np.abs(forces - theirs).max(axis=(1, 2, 3)) / np.abs(theirs).max(axis=(1, 2, 3))
                row = ContactCost(**{**asdict(row), "force_difference": float(off.max())})
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
        branch = natural.follow(balance, first, last, options)
        clock.append(time.process_time())
        peak, rest = memory.peak(), reduced.residual
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
        compliance_error=np.nan if rest is None else compliance_error(rest, 2 * np.pi * PROBE_HZ),
        left_out=0.0 if rest is None else rest.left_out,
    )
    return row, _forces(balance, branch)


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
    found = residual.apply(force) + residual.at_contact @ (modal / (residual.squares - omega**2)[:, None])
    residual.__dict__.pop("factor")  # makes room for the other one
    factor = factorise(residual.matrix - omega**2 * residual.mass, definite=False)
    exact = residual.B @ factor.solve(np.asfortranarray(residual.B.T @ force))
    return float(np.max(np.linalg.norm(root * (found - exact), axis=0) / np.linalg.norm(root * exact, axis=0)))


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
        more = "" if np.isnan(r.compliance_error) else f", compliance off by {r.compliance_error:.1e}"
        more += "" if np.isnan(r.force_difference) else f", forces differ by {r.force_difference:.1e}"
        each = r.response_seconds / r.points
        lines.append(
            f"{r.contact_dofs:6d} contact DOFs of {r.full_dofs:7d}, {r.way:20} {r.model_dofs:5d} coordinates "
            f"{r.peak_bytes / 1e9:6.2f} GB: assembly {r.assembly_seconds:.1f} s, set-up {r.setup_seconds:.1f} s, "
            f"{r.converged}/{r.points} points in {r.response_seconds:.1f} s ({each:.2f} s each, "
            f"{r.newton_steps} Newton steps){more}"
        )
    for way in dict.fromkeys(row.way for row in rows):
        own = [row for row in rows if row.way == way]
        if len({row.contact_dofs for row in own}) > 1:
            told = ", ".join(f"{name} {power:.2f}" for name, power in powers(own).items())
            lines.append(f"{way}: powers of the contact DOFs: {told}")
    return "\n".join(lines)
