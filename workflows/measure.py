"""What a scene answers and what the answer costs: peak, energy, preload, depth and life; seconds and memory."""

from __future__ import annotations

import resource
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

from hbm import error_controlled_rule, thesis_rule
from hbm.branch import CONVERGED
from hbm.evolution import WearProblem
from hbm.operating_point import OperatingPoint
from hbm.wear_history import LIFE_SHARE, WearHistory, cycles_to_preload
from workflows import pipeline
from workflows.progress import Progress
from workflows.references import delta_max, free_deflection
from workflows.scene_file import SceneFile
from workflows.trade_table import QUANTITIES


@dataclass(frozen=True)
class Measured:
    """Answers by QUANTITIES, None where the scene does not ask or the solve failed, as `outcome` says.

    patch : (n_pair, 2) contact nodes in their plane [m]; area : (n_pair,) [m2]
    depth : (n_pair,) at the end of life [m], zeros without wear; energy : (n_pair,) per cycle at the peak [J]
    seconds : of one processor; memory : its peak [bytes]
    """

    values: dict[str, float | None]
    patch: np.ndarray
    area: np.ndarray
    depth: np.ndarray
    energy: np.ndarray
    seconds: float
    memory: float
    outcome: str


def measure(file: SceneFile, wears: bool = True, refined: bool = True) -> Measured:
    """Run a scene as far as its answers need.

    wears : whether depth and life are wanted; refined : whether the peak is refined beyond the points of the curve
    Raises  ValueError for what the scene cannot be
    """
    values: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    clock = process_time()
    _forget_peak()
    with TemporaryDirectory() as folder, threadpool_limits(1):
        model = pipeline.build(file, Path(folder), Progress())
        balance, interface = model.balance, model.reduced.interface
        depth = energy = np.zeros(interface.n_pair)
        outcome = CONVERGED
        try:
            point = _peak(file, model, refined)
            outcome = point.solution.outcome
            if point.solution.converged:
                energy = balance.energy(point.state)
                values["peak_hz"] = point.state.omega / (2 * np.pi)
                values["peak_m"] = point.amplitude
                values["energy_J"] = float(energy.sum()) or None  # a contact without friction has no error in energy
                values["preload_N"] = balance.preload(point.state) or None
            if wears and pipeline.wears(file.scene):
                worn = wear(file, model)
                life = cycles_to_preload(worn)
                if life is None:
                    outcome = worn.end
                else:
                    depth = depth_at(worn, life)
                    values["depth_m"], values["life_cycles"] = float(depth.max()), life
        except RuntimeError as failure:
            outcome = str(failure)
    spent, memory = process_time() - clock, _peak_memory()
    flat = (interface.points - interface.points.mean(axis=0)) @ interface.frames.mean(axis=0)[:2].T
    return Measured(values, flat, interface.area, depth, energy, spent, memory, outcome)


def wear(file: SceneFile, model: pipeline.Model, left: float = LIFE_SHARE) -> WearHistory:
    """Wear by the scene's rule until a share `left` of the preload is left."""
    wanted, balance = file.scene.wear, model.balance
    assert wanted is not None
    area, duties = model.reduced.interface.area, pipeline.mission(file.scene)
    law = pipeline.law_of(file.scene, file.folder)
    problem = WearProblem(balance, duties, law, wanted.coefficient, area, left)
    scale = delta_max(file.scene, free_deflection(balance), area)
    if wanted.rule == "thesis":
        assert wanted.step is not None
        share = wanted.step.share
        limit = wanted.step.depth if share is None else share * scale
        return thesis_rule.evolve(problem, limit or 0.0, wanted.max_steps)
    tolerance = error_controlled_rule.Tolerance(wanted.tolerance, scale)
    return error_controlled_rule.evolve(problem, tolerance, wanted.max_steps)


def depth_at(worn: WearHistory, cycles: float) -> np.ndarray:
    """Depth (n_pair,) [m] after a number of cycles."""
    return np.array([np.interp(cycles, worn.cycles, pair) for pair in worn.depth.T])


def _peak(file: SceneFile, model: pipeline.Model, refined: bool) -> OperatingPoint:
    """The highest point of the response in the scene's range."""
    balance, site = model.balance, pipeline.peak_of(file.scene)
    branch = pipeline.follow_response(file.scene, balance, lambda share, note: None)
    pipeline.check_branch(branch)
    height = branch.amplitude(pipeline.OUTPUT)
    best = int(np.argmax(np.where([outcome == CONVERGED for outcome in branch.outcome], height, -1.0)))
    x = branch.contact[best].reshape(balance.parameters.n_pair, -1, balance.basis.n_coeff)
    omega = float(branch.omega[best])
    if refined:
        return site.next(balance, omega, x)
    return pipeline.AtFrequency(pipeline.OUTPUT, omega, site.newton).next(balance, omega, x)


def _forget_peak() -> None:
    """Let the peak memory of this process count from here on, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _peak_memory() -> float:
    """Largest memory of this process since `_forget_peak` [bytes]; since its start where the system cannot forget."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        unit = 1 if sys.platform == "darwin" else 1024
        return float(unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
