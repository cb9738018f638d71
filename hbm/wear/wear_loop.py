"""The wear run: from the unworn contact, step by step, until it is lost."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.wear.history import WearHistory, WearRow, history, rows_to_resume
from tribodyn.hbm.wear.run_end import PreloadAtRest, reason_to_stop
from tribodyn.hbm.wear.wear_problem import WearState, assess
from tribodyn.hbm.wear.wear_rows import state_of
from tribodyn.hbm.wear.wear_rule import WearRule, WearStep

LOCATED = 1e-3  # of depth and cycles, within which the end of a run is located in its last step


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
    Returns the history, whose last row is the state that the run ended at; its `end` says why, also if a solve failed
    """
    problem, rows = rule.problem, rows_to_resume(resume)
    at_rest, n_reported = PreloadAtRest(problem), len(rows)
    step, before = _last_step(rule, rows) if rows else (None, None)

    def report() -> None:
        nonlocal n_reported
        if on_row is not None and len(rows) > n_reported:
            on_row(rows[-1])
        n_reported = len(rows)

    while True:
        following = step.following() if step else assess(problem, np.zeros_like(problem.area), 0.0, None)
        state = rule.observe(at_rest.of(following), rows)
        reason = reason_to_stop(problem, state, rows, rule.least_depth)
        if step and before and reason and step.has_constant_rate and not state.failure:
            share, state = _located_end(rule, before, step.row, rows, state, at_rest)
            parts = {name: share * getattr(step.row, name) for name in ("cycles_in_step", "worn", "work")}
            rows[-1], reason = replace(rows[-1], **parts), reason_to_stop(problem, state, rows, rule.least_depth)
        report()
        if reason is None and len(rows) >= max_steps:
            reason = WearEnd.STEPS_DONE.say(f" {max_steps} wear steps")
        if reason is not None:
            last = rule.last_row(state)
            rows.append(last if last.memory or not rows else replace(last, memory=rows[-1].memory))
            break
        step, before = rule.step(state, rows), state
        rows.append(step.row)
        reason = step.failure
        if reason is not None:
            break
    report()
    worn = history(rows, reason, rule.SCHEME)
    return replace(worn, end=reason.kind.say(reason.detail + rule.remarks(worn)))


def _last_step(rule: WearRule, rows: list[WearRow]) -> tuple[WearStep, WearState]:
    """The step of the last stored row, taken again to the same bits, and the state before it."""
    *earlier, last = rows
    state = state_of(rule.problem, last)
    state = replace(state, solves=0, growth=last.growth, preload_at_rest=last.preload_at_rest)
    state = rule.restore(state, last, earlier)
    return rule.step(state, earlier), state


def _located_end(
    rule: WearRule, before: WearState, row: WearRow, rows: list[WearRow], end: WearState, at_rest: PreloadAtRest
) -> tuple[float, WearState]:
    """Share of a step with a constant rate after which the run ends, by bisection, and the state there.

    before : state that the step is taken from; end : behind the whole step"""
    low, high, solves = 0.0, 1.0, end.solves
    while (high - low) * row.cycles_in_step > 1.0:
        length = max(row.worn.max() / end.depth.max(), row.cycles_in_step / end.cycles)
        if (high - low) * length <= LOCATED:
            break
        share = 0.5 * (low + high)
        depth, cycles = before.depth + share * row.worn, before.cycles + share * row.cycles_in_step
        trial = rule.observe(at_rest.of(assess(rule.problem, depth, cycles, before)), rows)
        solves += trial.solves
        if trial.failure:
            break
        if reason_to_stop(rule.problem, trial, rows, rule.least_depth):
            high, end = share, trial
        else:
            low = share
    return high, replace(end, solves=solves)
