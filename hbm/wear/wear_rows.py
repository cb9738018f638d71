"""A wear state as a row of the history, and back, so that a run resumes bit for bit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.wear.history import WearRow
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, worn_state


def row_of(
    problem: WearProblem,
    state: WearState,
    cycles_in_step: float = 0.0,
    worn: np.ndarray | float = 0.0,
    work: np.ndarray | float = 0.0,
    step_error: float = 0.0,
    memory: Mapping[str, np.ndarray] | None = None,
) -> WearRow:
    """The history row of a state, with what its step wears [m] and dissipates [J]; the first duty is what it shows."""
    balance, point = problem.in_duty(problem.mission[0], state.depth), state.points[0]
    solved, shape = point.state, (-1, point.state.x.shape[2])
    row = WearRow(
        cycles=state.cycles,
        cycles_in_step=cycles_in_step,
        depth=state.depth,
        worn=np.broadcast_to(worn, state.depth.shape),
        energy=np.maximum(balance.energy(solved), 0.0),
        preload=problem.preload_of(state),
        normal_force=balance.normal_force(solved),
        status=solved.cycle.status,
        omega=solved.omega,
        amplitude=point.amplitude,
        force=solved.cycle.force.reshape(shape),
        response=point.response,
        solves=state.solves,
        step_error=step_error,
        memory=memory or {},
        work=np.broadcast_to(work, state.depth.shape),
        duty_omega=np.array([p.state.omega for p in state.points]),
        duty_displacement=np.stack([p.state.x.reshape(shape) for p in state.points]),
        duty_response=np.stack([p.response for p in state.points]) if len(state.points) > 1 else np.zeros(0),
        preload_at_rest=state.preload_at_rest,
        growth=state.growth,
        bed=balance.contact.of_pairs("bed"),
    )
    means = state.means
    if means is None:
        return row
    of_motion = {name: getattr(means, name) for name in ("energy", "normal_force", "amplitude", "spread", "moving")}
    return replace(row, **of_motion, mean_error=means.error, periods=means.periods, is_stationary=means.is_stationary)


def state_of(problem: WearProblem, row: WearRow) -> WearState:
    """The state that a row was made from, solved points included, so that a run resumes bit for bit."""
    points = []
    for i, duty in enumerate(problem.mission):
        balance = problem.in_duty(duty, row.depth)
        x = row.duty_displacement[i].reshape(len(row.depth), -1, balance.basis.n_coeff)
        state = balance.evaluate(float(row.duty_omega[i]), x)
        outcome = newton.Solution(state, CONVERGED, 0, 0, ())
        points.append(OperatingPoint(outcome, row.amplitude, balance.outputs(state), 0))
    return worn_state(problem, row.depth, row.cycles, points, row.solves)
