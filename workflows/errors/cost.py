"""What a scene answers and what the answer costs: peak, energy, preload, depth and life; seconds and memory."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

from tribodyn.hbm.continuation.operating_point import AtFrequency, NoPeak, OperatingPoint
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.workflows.errors.trade_table import ANSWERED, QUANTITIES
from tribodyn.workflows.run import curve, memory, modelling, pipeline, settings, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile


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
    memory.forget_peak()
    with threadpool_limits(1):
        model = modelling.build(file, Progress())
        balance, interface = model.balance, model.reduced.interface
        depth = energy = np.zeros(interface.n_pair)
        outcome = ANSWERED
        try:
            point = _peak(file, model, refined)
            outcome = str(point.solution.outcome)
            if point.solution.converged:
                energy = balance.energy(point.state)
                values["peak_hz"] = point.state.omega / (2 * np.pi)
                values["peak_m"] = point.amplitude
                values["energy_J"] = float(energy.sum()) or None  # a contact without friction has no error in energy
                values["preload_N"] = balance.preload(point.state) or None
            if wears and file.scene.wears:
                worn = wear_run.worn_out(file, model)
                life = cycles_to_preload(worn)
                if life is None:
                    outcome = str(worn.end)
                else:
                    depth = depth_at(worn, life)
                    values["depth_m"], values["life_cycles"] = float(depth.max()), life
        except (RuntimeError, NoPeak) as failure:
            outcome = str(failure)
    spent, needed = process_time() - clock, memory.peak()
    flat = (interface.points - interface.points.mean(axis=0)) @ interface.frames.mean(axis=0)[:2].T
    return Measured(values, flat, interface.area, depth, energy, spent, needed, outcome)


def depth_at(worn: WearHistory, cycles: float) -> np.ndarray:
    """Depth (n_pair,) [m] after a number of cycles."""
    return np.array([np.interp(cycles, worn.cycles, pair) for pair in worn.depth.T])


def _peak(file: SceneFile, model: modelling.Model, refined: bool) -> OperatingPoint:
    """The highest point of the response in the scene's range."""
    balance, site = model.balance, settings.peak_of(file.scene)
    branch = curve.follow_response(file.scene, balance, lambda share, note: None)
    pipeline.check_branch(branch)
    height = branch.amplitude(settings.OUTPUT)
    best = int(np.argmax(np.where(branch.converged, height, -1.0)))
    x = balance.shaped(branch.contact[best])
    omega = float(branch.omega[best])
    if refined:
        return site.next(balance, omega, x)
    return AtFrequency(settings.OUTPUT, omega, site.newton).next(balance, omega, x)
