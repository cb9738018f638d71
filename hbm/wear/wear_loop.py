"""The wear run: from the unworn contact, step by step, until it is lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.history import WearHistory, WearRow, history, rows_to_resume
from tribodyn.hbm.wear.preload_at_rest import PreloadAtRest
from tribodyn.hbm.wear.run_end import reason_to_stop
from tribodyn.hbm.wear.wear_rows import state_of
from tribodyn.hbm.wear.wear_rule import WearRule
from tribodyn.hbm.wear.wear_state import WearState, assess


@single
def evolve(
    rule: WearRule,
    max_steps: int = 10000,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
) -> WearHistory:
    """Wear a contact by a rule until it is lost.

    on_row : called with each finished row, for checkpoints and progress
    resume : history of an interrupted run of the same problem; the run continues after it, to the same numbers
    Returns the history; its `end` says why the run stopped, also where a solve failed
    """
    problem, rows = rule.problem, rows_to_resume(resume)
    end = WearEnd.STEPS_DONE.say(f" {max_steps} wear steps")
    at_rest = PreloadAtRest(problem)

    def initial_state() -> WearState:
        return _state_after(rule, rows) if rows else assess(problem, np.zeros_like(problem.area), 0.0, None)

    following = initial_state
    while len(rows) < max_steps:
        state = rule.observe(at_rest.of(following()), rows)
        reason = reason_to_stop(problem, state, rows, rule.least_depth)
        if reason:
            rows.append(rule.last_row(state))
        else:
            step = rule.step(state, rows)
            rows.append(step.row)
            following, reason = step.following, step.failure
        if on_row is not None:
            on_row(rows[-1])
        if reason:
            end = reason
            break
    worn = history(rows, end, rule.SCHEME)
    return replace(worn, end=end.kind.say(end.detail + rule.remarks(worn)))


def _state_after(rule: WearRule, rows: list[WearRow]) -> WearState:
    """The state after the last stored row. It is not stored: its step is taken again, to the same bits."""
    *earlier, last = rows
    state = state_of(rule.problem, last)
    state = replace(state, solves=0, growth=last.growth, preload_at_rest=last.preload_at_rest)
    return rule.step(rule.restore(state, last, earlier), earlier).following()
