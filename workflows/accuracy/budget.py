"""The error budget of a result: what each discretisation contributes, by an estimator, else by the scene's trade."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.sampling import sampling_error
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.wear.step_error import UNKNOWN, step_error
from tribodyn.workflows.accuracy import accuracy
from tribodyn.workflows.accuracy.trade_table import NAMES, QUANTITIES, Trade
from tribodyn.workflows.result.facts import BudgetEntry
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile

# knobs that an estimator covers; Newton's is of the residual, whatever Krylov left of it
ESTIMATED = ("modes", "harmonics", "samples", "newton", "krylov", "points", "wear")
SAME, COARSER = "", "as with the coarser "  # how the setting of a knob stands to the scene's
LOOK = 5  # harmonics beyond the kept ones that the estimate looks at, at the least


def budget(file: SceneFile, balance: HarmonicBalance, result: Result) -> list[BudgetEntry]:
    """The budget of a result with its response, and with its wear where there is any."""
    entries = [*_of_reduction(balance, file), *_of_response(file, balance, result), *_of_wear(file, result)]
    unknown = {entry.source for entry in entries if entry.error is None}
    traded = list(_of_trade(file, [knob for knob in ESTIMATED if knob not in unknown]))
    covered = {entry.source for entry in traded if entry.error is not None}
    return [entry for entry in entries if entry.error is not None or entry.source not in covered] + traded


def with_budget(file: SceneFile, balance: HarmonicBalance, result: Result) -> Result:
    """The result with its budget."""
    return replace(result, budget=tuple(budget(file, balance, result)))


def lines(result: Result) -> list[tuple[str, str]]:
    """The budget as pairs of a name and a readable value, the largest contribution first."""
    entries = sorted(result.budget, key=lambda e: -1.0 if e.error is None else -e.error)
    shown = []
    for entry in entries:
        if entry.error is None:
            value = f"unknown: {entry.by}"
        elif entry.source in ("samples", "wear steps") and entry.error >= UNKNOWN:
            value = f"above {UNKNOWN:.0%} of {entry.quantity}: no {entry.quantity} can be stated ({entry.by})"
        else:
            value = f"{entry.error:.1e} of {entry.quantity} ({entry.by})"
        shown.append((f"  {entry.source}", value))
    return [("error budget", ""), *shown] if shown else []


def _of_reduction(balance: HarmonicBalance, file: SceneFile) -> Iterator[BudgetEntry]:
    info = balance.model.info
    frequency, error = info.free_frequency, info.free_frequency_error
    if frequency is not None and error is not None:
        inside = (frequency <= file.scene.response.frequency[1]) & np.isfinite(error)
        if inside.any():
            worst = float(error[inside].max())
            yield BudgetEntry("modes", "free frequencies", worst, "estimate: omitted modes")
    yield BudgetEntry("compliance", "displacement", float(balance.compliance.error), "estimate: direct solve")


def _of_response(file: SceneFile, balance: HarmonicBalance, result: Result) -> Iterator[BudgetEntry]:
    frf = result.response
    if frf is None:
        return
    good = frf.converged
    height = np.where(good, frf.amplitude(frf.output_names[0]), -1.0)
    best = int(np.argmax(height))
    omega = float(frf.omega[best])
    if not balance.contact.n_pair:  # a linear response
        yield BudgetEntry("points", "peak amplitude", _missed(frf.omega, height, best), "estimate: parabola")
        return
    x = frf.contact[best].reshape(balance.contact.n_pair, len(balance.contact.components), balance.basis.n_coeff)
    state, at_peak = balance.evaluate(omega, x), "response at the peak"
    yield BudgetEntry("newton, krylov", at_peak, _newton_error(balance, state), "estimate: one more step")
    yield BudgetEntry("samples", at_peak, sampling_error(balance, omega, x), "estimate: located, finer")
    top = max(balance.basis.harmonics)
    error: float | None = None
    try:
        if file.scene.verdict.enabled:  # its linear side, the dearest part of a wheel's, then serves here too
            harmonic_choice.widened(balance, harmonic_choice.highest_looked_at(top), harmonic_choice.ROUGH)
        wide = harmonic_choice.widened(balance, top + LOOK, harmonic_choice.ROUGH)
        error = harmonic_choice.estimate(wide, balance.basis.harmonics, omega, x, split=False).error
        how = "estimate: one step with more"
    except ValueError as refusal:
        how = str(refusal)
    if error is not None and error >= UNKNOWN:  # as at a fold, where a step at the same frequency leads anywhere
        error, how = None, f"one step with more harmonics moves it by more than {UNKNOWN:.0%}"
    yield BudgetEntry("harmonics", at_peak, error, how)
    yield BudgetEntry("points", "peak amplitude", _missed(frf.omega, height, best), "estimate: parabola")
    if result.bounds is not None and good.any():
        yield BudgetEntry("load path", "amplitude", float(np.nanmax(result.bounds.spread)), "bounds of residual shear")


def _newton_error(balance: HarmonicBalance, state: State) -> float:
    """Relative change of the outputs by one more Newton step."""
    linear = balance.linearise(state)
    step = linear.solve(-state.residual, 1e-3)[0]
    moved = balance.at(state.omega).outputs(linear.departure_slope(step))
    size = np.linalg.norm(balance.outputs(state))
    return float(np.linalg.norm(moved) / size) if size > 0 else 0.0


def _missed(omega: np.ndarray, height: np.ndarray, best: int) -> float:
    """How far the top of the parabola through the highest point and its neighbours is above it, relative."""
    if not 0 < best < len(omega) - 1 or height[best] <= 0 or min(height[best - 1], height[best + 1]) < 0:
        return 0.0
    w, a = omega[best - 1 : best + 2] - omega[best], height[best - 1 : best + 2]
    if len(np.unique(w)) < 3:
        return 0.0
    curvature, slope, _ = np.polyfit(w, a, 2)
    return float(-(slope**2) / (4 * curvature) / height[best]) if curvature < 0 else 0.0


def _of_wear(file: SceneFile, result: Result) -> Iterator[BudgetEntry]:
    wear = file.scene.wear
    if wear is None or result.wear is None or not result.wear_steps:
        return
    controlled = wear.rule == "error_controlled"
    found = step_error(result.wear, wear.tolerance if controlled else None)
    by = "estimate: the rule's own" if controlled else "estimate: change of the rate over a step"
    yield BudgetEntry("wear steps", "life", found.cycles, by)
    yield BudgetEntry("wear steps", "depth", found.depth, by)


def _of_trade(file: SceneFile, estimated: Sequence[str]) -> Iterator[BudgetEntry]:
    """What the trade has measured of the knobs that no estimator covers here."""
    try:
        trade = accuracy.table_of(file)
    except ValueError as missing:
        yield BudgetEntry("mesh, grid", "", None, str(missing))
        return
    for knob in trade.knobs:
        rows = trade.of(knob)
        if knob in estimated or not rows[-1].tunable:
            continue
        known = [(r, how) for r in rows if (how := _compared(file, r.overrides)) is not None]
        name = knob.replace("_", " ")
        if not known:
            why = f"the trade has finer settings alone, {rows[0].setting} to {rows[-1].setting}"
            yield BudgetEntry(name, "", None, why)
            continue
        row, how = next(((r, how) for r, how in known if how == SAME), known[-1])
        for quantity, label in zip(QUANTITIES, NAMES, strict=True):
            error = _off(trade, knob, row.setting, quantity)
            if error:  # none is left where a knob stands at what it tends to
                yield BudgetEntry(name, label, error, f"trade: {how}{row.setting}")


def _off(trade: Trade, knob: str, setting: str, quantity: str) -> float | None:
    rows = trade.of(knob)
    place = next(i for i, row in enumerate(rows) if row.setting == setting)
    error = accuracy.error_of(rows, place, quantity)
    return error if rows[place].errors[quantity] is not None and np.isfinite(error) else None


def _compared(file: SceneFile, overrides: tuple[str, ...]) -> str | None:
    """SAME where a setting of a knob is what the scene has, COARSER where it has less of everything that it sets.

    None where it is finer, where it sets what is not counted, or where the scene cannot be set so
    """
    try:
        other = file.changed(*overrides).scene
    except SceneError:
        return None
    ours, theirs = file.scene.model_dump(), other.model_dump()
    if file.scene.harmonics.transitions == other.harmonics.transitions == "located":
        del ours["harmonics"]["samples"], theirs["harmonics"]["samples"]  # they find transitions, and move nothing else
    pairs = list(_differences(ours, theirs))
    if not pairs:
        return SAME
    counted = all(type(a) is type(b) is int for a, b in pairs)
    return COARSER if counted and all(b < a for a, b in pairs) else None


def _differences(ours: Any, theirs: Any) -> Iterator[tuple[Any, Any]]:
    """Pairs of values in which two tables differ."""
    if isinstance(ours, dict) and isinstance(theirs, dict) and ours.keys() == theirs.keys():
        for key in ours:
            yield from _differences(ours[key], theirs[key])
    elif ours != theirs:
        yield ours, theirs
