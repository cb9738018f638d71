"""What proofs take beyond a run: the problem of a scene, its cycles, curves and wear."""

from dataclasses import replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.hbm.wear.law import Exposure
from tribodyn.hbm.wear.laws import impact
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.result.result import Patch, References, Result
from tribodyn.workflows.run import references, response_curve, settings, wear_run
from tribodyn.workflows.run.pipeline import described
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneFile


def cycle_at(file: SceneFile, balance: HarmonicBalance, frequency: float) -> State:
    """The vibration cycle at a frequency [Hz], where need be along the curve of solutions over the load.

    Raises  SolveFailed"""
    options = newton.NewtonOptions(tolerance=file.scene.solver.tolerance)
    solution = arc_length.solve_along_load(balance, 2 * np.pi * frequency, options)
    if not solution.converged:
        raise SolveFailed(f"the cycle at {frequency:.4g} Hz: {solution.outcome}")
    return solution.state


def state_at(balance: HarmonicBalance, omega: float, x: np.ndarray) -> State:
    """The state of contact displacements as branches and wear histories keep them (n_contact, n_coeff), at [rad/s]."""
    return balance.evaluate(omega, x.reshape(balance.contact.n_pair, -1, balance.basis.n_coeff))


def worn(balance: HarmonicBalance, depth: np.ndarray) -> HarmonicBalance:
    """The problem of a contact that has worn by a depth (n_pair,) [m]."""
    return balance.with_gap(balance.contact.gap + depth)


def follow_response(file: SceneFile, balance: HarmonicBalance) -> Branch:
    """The response over the scene's range by the scene's method, as far as it goes, see `Branch.end`."""
    return response_curve.follow_response(file.scene, balance)


def follow_arc_length(file: SceneFile, balance: HarmonicBalance) -> Branch:
    """The response over the scene's range by arc length, round its folds."""
    low, high = settings.response_range(file.scene)
    options = arc_length.Options(newton=settings.newton_options(file.scene))
    return arc_length.follow(balance, low, high, options)


def linear_references(balance: HarmonicBalance, low: float, high: float, output: str = OUTPUT) -> References:
    """Amplitudes of an output with the contact absent and with it stuck, from one frequency to another [Hz]."""
    return references.linear_references(balance, output, 2 * np.pi * low, 2 * np.pi * high)


def delta_max(file: SceneFile, balance: HarmonicBalance) -> float:
    """The depth that wear steps are a share of: how far static loads press the faces together without contact [m]."""
    approach = references.free_deflection(balance)
    return references.delta_max(file.scene, approach, balance.model.interface.area)


def wear(file: SceneFile, balance: HarmonicBalance) -> WearHistory:
    """Wear a problem as the scene's [wear] says, to its end; `WearHistory.end` says why it ended.

    Raises  ValueError for a scene without [wear] or without what its steps are measured by"""
    table = file.scene.wear
    if table is None:
        raise Refusal(f"{file.name} has no [wear]: say how it wears")
    at_rest = table.end_at == "at_rest"
    problem = wear_run.wear_problem(file.scene, balance, table.lost_below, at_rest)
    scale = settings.depth_scale(file.scene, references.free_deflection(balance), problem.area)
    return evolve(wear_run.rule_of(file.scene, problem, scale), table.max_steps)


def impact_work(balance: HarmonicBalance, state: State) -> np.ndarray:
    """(n_pair,) work of impacts at the contact per cycle [J]."""
    n = balance.contact.n_pair
    return impact.impact_work(Exposure(balance, state, np.ones(n), {}, np.zeros(n), 0.0))


def contact_patch(balance: HarmonicBalance) -> Patch:
    """The contact as pictures need it."""
    i = balance.model.interface
    nodes = np.full(i.n_pair, -1)
    return Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, references.free_deflection(balance))


def result_of(file: SceneFile, part: Part | None, balance: HarmonicBalance, history: WearHistory) -> Result:
    """A result that holds a wear run, for pictures; no response curve."""
    return replace(described(file, part, balance), wear=history)
