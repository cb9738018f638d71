"""Wear at its extremes: steps from tiny to absurd, wear coefficients from none to absurd."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from proof.hard_settings.extremes_judge import CONVERGED, REFUSED, WRONG, Verdict
from proof.hard_settings.extremes_models import Body
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance, first_order_error, measured_error
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.workflows.run.references import free_deflection

STEPS = (1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.2, 0.5, 1.0, 10.0, 1e3, 1e6)  # of delta_max
TOLERANCES = (1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 0.9)
COEFFICIENTS = (0.0, 1e-30, 1e-18, 1e-9, 1.0, 1e9)  # m3/J
ORDINARY = 2e-15  # m3/J
MOST_STEPS, UNKNOWN = 150, 0.5  # UNKNOWN: error of a number of cycles from which on it is no statement
TIGHT = 3e-3  # tolerance of the reference

Cell = tuple[str, str, str, Callable[[], Verdict]]


def cells(*bodies: Body) -> Iterator[Cell]:
    """Cells of both step rules on each body, and of the wear coefficient on the first."""
    for body in bodies:
        for step in STEPS:
            yield body.name, "wear step, thesis", f"{step:g} of delta_max", partial(_thesis, body, step)
        for share in TOLERANCES:
            yield body.name, "wear step, error-controlled", f"tolerance {share:g}", partial(_controlled, body, share)
    for value in COEFFICIENTS:
        yield bodies[0].name, "wear coefficient", f"{value:g} m3/J", partial(_coefficient, bodies[0], value)


def _problem(body: Body, coefficient: float = ORDINARY) -> tuple[WearProblem, float]:
    balance = body.balance(body.ordinary)
    duty = Duty(AtFrequency(balance.compliance.output_names[0], body.ordinary.omega))
    area = body.model.interface.area
    law = JointWear.of("energy", coefficient=coefficient)
    problem = WearProblem(balance, (duty,), law, area, lost_below=0.9 * LIFE_SHARE)
    return problem, float(free_deflection(balance).max())


def _thesis(body: Body, share: float) -> Verdict:
    problem, delta = _problem(body)
    return _judged(body, problem, evolve(thesis.Rule(problem, share * delta), MOST_STEPS))


def _controlled(body: Body, share: float) -> Verdict:
    problem, delta = _problem(body)
    tolerance = Tolerance(share, delta)
    return _judged(body, problem, evolve(error_controlled.Rule(problem, tolerance), MOST_STEPS), tolerance=tolerance)


def _coefficient(body: Body, value: float) -> Verdict:
    """Depth against cycles x coefficient does not depend on the coefficient."""
    problem, delta = _problem(body, value)
    tolerance = Tolerance(0.03, delta)
    worn = evolve(error_controlled.Rule(problem, tolerance), MOST_STEPS)
    return _judged(body, problem, worn, value / ORDINARY, tolerance)


def _judged(
    body: Body, problem: WearProblem, worn: WearHistory, faster: float = 1.0, tolerance: Tolerance | None = None
) -> Verdict:
    """Conservation and monotony, then worn volume beside the reference, within what the run says of its own error."""
    if worn.ended is WearEnd.SOLVE_FAILED:
        return Verdict(REFUSED, str(worn.end))
    if not all(np.all(np.isfinite(a)) for a in (worn.depth, worn.worn, worn.cycles, worn.work, worn.preload)):
        return Verdict(WRONG, "a number is not finite")
    if (worn.worn < 0).any() or (np.diff(worn.depth, axis=0) < 0).any():
        return Verdict(WRONG, "depth falls")
    volume = float(problem.area @ (worn.depth[-1] + worn.worn[-1]))
    by_work = float(problem.numbers("contact")["coefficient"] @ worn.work.sum(axis=0))
    if abs(volume - by_work) > 1e-9 * by_work:
        return Verdict(WRONG, f"volume {volume:.6e} m3 for {by_work:.6e} m3 of work")
    if faster == 0:
        return Verdict(CONVERGED if volume == 0 else WRONG, f"nothing wears: {worn.end}", 0.0)
    estimate = (first_order_error(worn) if tolerance is None else measured_error(worn, tolerance)).cycles
    if estimate >= UNKNOWN:
        says = f"the error estimate of the wear steps is above {UNKNOWN:.0%}, no life is stated"
        return Verdict(REFUSED, f'{says}: take a smaller wear.step or wear.rule = "error_controlled"')
    # at the same volume: how far are the cycles off
    cycles, volumes = worn.cycles * faster, worn.depth @ problem.area
    reach = np.flatnonzero(worn.preload >= LIFE_SHARE * worn.preload[0])[-1]
    expected = _cycles_for(body, float(volumes[reach]))
    off = abs(cycles[reach] / expected - 1) if expected > 0 else 0.0
    says = f"cycles are off by {off:.1e}, estimated {estimate:.1e}; {worn.end}"
    allowed = estimate + measured_error(_reference(body), Tolerance(TIGHT, np.nan)).cycles
    return Verdict(CONVERGED if off <= allowed else WRONG, says, off)


def _cycles_for(body: Body, volume: float) -> float:
    """Cycles that the reference takes to wear a volume [m3]."""
    reference = _reference(body)
    return float(np.interp(volume, reference.depth @ body.model.interface.area, reference.cycles))


def _reference(body: Body) -> WearHistory:
    if body.name not in _references:
        problem, delta = _problem(body)
        _references[body.name] = evolve(error_controlled.Rule(problem, Tolerance(TIGHT, delta)))
    return _references[body.name]


_references: dict[str, WearHistory] = {}  # one for each body, made when first asked for
