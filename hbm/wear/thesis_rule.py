"""The wear step rule of the thesis: Z cycles at once, as many as let the deepest pair wear by a given depth.

Source  Tamatam 2021, eq. 3.29-3.31 and figure 3.6.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.evolution import (
    WearProblem,
    assess,
    reason_to_stop,
    row_of,
    state_of,
)
from tribodyn.hbm.wear.history import WearHistory, WearRow, history, rows_to_resume
from tribodyn.hbm.wear.preload_at_rest import PreloadAtRest
from tribodyn.refusal import Refusal


@single
def evolve(
    problem: WearProblem,
    step_depth: float,
    max_steps: int = 10000,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
) -> WearHistory:
    """Wear the contact until it is lost.

    step_depth : largest depth that one step may wear, v_w,max [m]; Z is floored to whole cycles, but at least one
    on_row : called with each finished row, for checkpoints and progress
    resume : rows of an interrupted run of the same problem; the run resumes after them, to the same numbers
    Returns the history; its `end` says why it stopped, also where a solve failed
    """
    if not step_depth > 0:
        raise Refusal("the wear step must be a positive depth")
    rows = rows_to_resume(resume)
    before = state_of(problem, rows[-1]) if rows else None
    depth = rows[-1].depth + rows[-1].worn if rows else np.zeros_like(problem.area)
    cycles = rows[-1].cycles + rows[-1].cycles_in_step if rows else 0.0
    at_rest = PreloadAtRest(problem)
    end = WearEnd.STEPS_DONE.say(f" {max_steps} wear steps")
    while len(rows) < max_steps:
        state = at_rest.of(assess(problem, depth, cycles, before))
        reason = reason_to_stop(problem, state, rows, step_depth)
        whole = 0.0 if reason else max(1.0, float(np.floor(step_depth / state.rate.max())))  # eq. 3.30
        rows.append(row_of(problem, state, whole, whole * state.rate, whole * state.work))
        if on_row is not None:
            on_row(rows[-1])
        if reason:
            end = reason
            break
        depth = depth + rows[-1].worn  # eq. 3.31, total of both surfaces
        cycles += whole
        before = state
    return history(rows, end)
