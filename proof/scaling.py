"""How the cost grows with the contact: one response curve of the beam scene for patches of more and more nodes.

Each size is measured in a process of its own, so that its peak memory is its own; seconds are processor seconds of one
thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from tests.helpers.reduced import reduce_part
from tribodyn.hbm.continuation.methods import natural
from tribodyn.workflows.pictures.plots import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY, ORANGE
from tribodyn.workflows.run import memory, modelling, settings
from tribodyn.workflows.scene import scene_file

QUICK, FULL = (5, 9, 13), (5, 9, 13, 19, 25, 31)  # nodes along each side of the patch
HARMONICS, SAMPLES, POINTS = [0, 1, 2, 3], 100, 40


@dataclass(frozen=True)
class SizeCost:
    """One size of the contact.

    n_patch : nodes along each side; contact_dofs : of all pairs; model_dofs : of the reduced model
    reduction_seconds : mesh to reduced model; setup_seconds : contact compliance; response_seconds : the curve
    points, converged : of the curve; newton_steps : spent on it
    compliance_error : relative, against a direct solve; peak_bytes : largest memory of the process
    """

    n_patch: int
    contact_dofs: int
    model_dofs: int
    reduction_seconds: float
    setup_seconds: float
    response_seconds: float
    points: int
    converged: int
    newton_steps: int
    compliance_error: float
    peak_bytes: float


def run(sizes: Sequence[int], say: Callable[[str], None]) -> list[SizeCost]:
    """Measure every size, the smallest first."""
    rows = []
    for n_patch in sorted(sizes):
        say(f"{n_patch} x {n_patch} contact nodes")
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
            rows.append(alone.submit(measure, n_patch).result())
    return rows


def measure(n_patch: int, points: int = POINTS) -> SizeCost:
    """One response curve of the beam scene with n_patch x n_patch contact nodes, on one thread."""
    changes = [f"geometry.n_patch={n_patch}", f"harmonics.kept={HARMONICS}", f"harmonics.samples={SAMPLES}"]
    file = scene_file.read("beam_thesis", changes)
    scene = file.mesh_scene
    with threadpool_limits(1), TemporaryDirectory() as folder:
        clock = [time.process_time()]
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
        part = modelling.make_part(scene, mesh, node_sets)
        reduced = reduce_part(scene, part)
        clock.append(time.process_time())
        balance = modelling.make_model(scene, part, reduced).balance
        clock.append(time.process_time())
        low, high = settings.response_range(scene)
        options = natural.Options(n_points=points, newton=settings.newton_options(scene))
        natural.follow(balance, high, 0.999 * high, natural.Options(n_points=2))  # compiles outside the clock
        clock.append(time.process_time())
        branch = natural.follow(balance, high, low, options)
        clock.append(time.process_time())
    return SizeCost(
        n_patch=n_patch,
        contact_dofs=balance.compliance.n_contact,
        model_dofs=reduced.system.n_dof,
        reduction_seconds=clock[1] - clock[0],
        setup_seconds=clock[2] - clock[1],
        response_seconds=clock[4] - clock[3],
        points=len(branch.omega),
        converged=int(branch.converged.sum()),
        newton_steps=int(branch.newton_steps.sum()),
        compliance_error=balance.compliance.error,
        peak_bytes=memory.peak(),
    )


def slope(rows: Sequence[SizeCost]) -> float:
    """Exponent p of seconds of the response ~ contact_dofs ** p, least squares in the logarithms."""
    x, y = np.log([[row.contact_dofs, row.response_seconds] for row in rows]).T
    return float(np.polyfit(x, y, 1)[0])


def as_records(rows: Sequence[SizeCost]) -> dict[str, object]:
    """The rows and the slope for JSON."""
    return {"rows": [asdict(row) for row in rows], "slope": slope(rows)}


def as_text(rows: Sequence[SizeCost]) -> str:
    """The rows for people."""
    lines = ["  nodes  contact DOFs  reduction   set-up  response  converged  Newton  memory   compliance error"]
    lines += [
        f"{f'{r.n_patch} x {r.n_patch}':>7} {r.contact_dofs:13d} {r.reduction_seconds:8.1f} s {r.setup_seconds:6.1f} s "
        f"{r.response_seconds:7.1f} s {f'{r.converged}/{r.points}':>10} {r.newton_steps:7d} "
        f"{r.peak_bytes / 1e9:5.2f} GB {r.compliance_error:18.1e}"
        for r in rows
    ]
    lines.append(f"the response takes seconds as contact DOFs to the power of {slope(rows):.2f}")
    return "\n".join(lines)


def picture(rows: Sequence[SizeCost]) -> Figure:
    """Seconds of the response and peak memory against contact DOFs, both axes logarithmic."""
    size = np.array([row.contact_dofs for row in rows], float)
    seconds = np.array([row.response_seconds for row in rows])
    with axes_of(9.0, 4.0, columns=2) as (figure, (left, right)):
        power = slope(rows)
        left.plot(size, seconds, "o", color=BLUE, label=f"response, {rows[0].points} points, 0+3")
        fitted = np.exp(np.mean(np.log(seconds) - power * np.log(size)))
        left.plot(size, fitted * size**power, color=BLUE, lw=1.2, label=f"slope {power:.2f}")
        left.plot(size, seconds[0] * (size / size[0]) ** 2, "--", color=GREY, lw=1.2, label="slope 2, quadratic")
        once = [row.reduction_seconds + row.setup_seconds for row in rows]
        left.plot(size, once, "s:", color=ORANGE, label="model, once")
        left.set(xscale="log", yscale="log", xlabel="contact DOFs", ylabel="processor seconds", title="Time")
        left.legend(loc="best", fontsize=8)
        right.plot(size, [row.peak_bytes / 1e9 for row in rows], "o-", color=BLUE)
        right.axhline(4.0, color=GREY, ls="--", lw=1.2)
        right.set(xscale="log", yscale="log", xlabel="contact DOFs", ylabel="peak memory / GB", title="Memory")
    return figure
