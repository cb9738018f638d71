"""Answers: every number that a result states, with its error and what a reader should know of it.

Summary, JSON, text, report, exports and the tables of studies are loops over them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.continuation.parameter import FREQUENCY
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.quantity import (
    CurveQuantity,
    CycleQuantity,
    SolvedCurve,
    SolvedCycle,
    StatedQuantity,
    WearQuantity,
    WornContact,
    quantities_of,
)
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory
from tribodyn.workflows.result.verdict import Statement
from tribodyn.workflows.scene.wear import Place

if TYPE_CHECKING:
    from tribodyn.workflows.result.result import Result

FIRST, LAST, PEAK, STABLE, RUN = "first", "last", "peak", "stable", ""
"""Moments: before wear (at the peak of a response that does not wear), at the end of wear; at the peak of the response
where wear is taken at another frequency; at its highest stable point; of the whole run."""
VALUE_TOLERANCE = 0.01  # relative difference of a value and of that of its statement, which is solved again
EVENT_SAMPLES = 256  # of a cycle, to see whether a pair opens


@dataclass(frozen=True)
class Answer:
    """One number of a result.

    joint : named contact or place that it is of, empty for the whole; moment : FIRST, LAST, PEAK, STABLE or RUN
    value : None where there is none; error : what the verdict says of it, None without
    reason : what a reader should know, such as where a life ends, or why this is no peak; empty for nothing"""

    quantity: StatedQuantity
    joint: str
    moment: str
    value: float | None
    error: Statement | None = None
    reason: str = ""

    @property
    def column(self) -> str:
        """Its name in a table, such as "peak_frequency_first", "life", "depth of shroud"."""
        name = f"{self.quantity.name}_{self.moment}" if self.moment else self.quantity.name
        return f"{name} of {self.joint}" if self.joint else name

    @property
    def is_peak(self) -> bool:
        """Whether it is no number of a cycle at an end of the response, which is no peak."""
        return not (isinstance(self.quantity, CycleQuantity) and self.reason)


def answers_of(result: Result) -> tuple[Answer, ...]:
    """Every number of a result that its scene gives rise to; value None for one of a run that has none."""
    return (*_of_cycles(result), *_of_wear(result), *_of_curve(result))


def values_by_name(answers: Sequence[Answer]) -> dict[str, float | dict[str, float] | None]:
    """Name -> value of a whole run, or {moment: value} of its cycles; None where there is none."""
    table: dict[str, float | dict[str, float] | None] = {}
    for answer in answers:
        name, value = answer.quantity.name, answer.value
        if answer.moment and value is not None:
            moments = table.get(name)
            table[name] = {**(moments if isinstance(moments, dict) else {}), answer.moment: value}
        elif not answer.moment or name not in table:
            table[name] = value
    return table


def cycles_of(result: Result) -> dict[str, tuple[SolvedCycle, str]]:
    """When -> the cycle that a result states numbers of, and why it is no peak, empty where it is one."""
    wear, curve = result.wear, result.response
    cycles: dict[str, tuple[SolvedCycle, str]] = {}
    if curve is not None:
        output = curve.output_names[0]
        best, basis = curve.highest(output), _basis(result)
        no_peak = curve.no_peak(output) if curve.parameter_name == FREQUENCY else ""
        peak = _with_stress(result, SolvedCycle.at_point(curve, best, basis, result.facts.places), best)
    if wear is not None and len(wear.omega):
        if curve is not None and not no_peak and not wears_at_peak(result):
            cycles[PEAK] = peak, ""
        rows = {FIRST: 0, LAST: len(wear.omega) - 1}
        cycles |= {moment: (_cycle_at(result, wear, row), "") for moment, row in rows.items()}
    elif curve is not None:
        cycles[FIRST] = peak, no_peak
    if curve is not None and result.stability is not None:
        height = np.where(curve.converged & result.stability.stable, curve.amplitude(output), -1.0)
        if height.max() >= 0:
            best = int(np.argmax(height))
            cycles[STABLE] = SolvedCycle.at_point(curve, best, basis, result.facts.places), ""
    return cycles


def wears_at_peak(result: Result) -> bool:
    """Whether a result wears at a peak, not at a frequency that its scene gives."""
    wear = result.scene.wear
    return wear is None or not isinstance(wear.at, Place) or wear.at.frequency is None


def worn_contact(result: Result, row: int | None = None) -> WornContact | None:
    """The wear of a result, None without; row : of its history, for numbers before its end."""
    wear, table = result.wear, result.scene.wear
    if wear is None or not len(wear.cycles):
        return None
    samples = max(EVENT_SAMPLES, 2 * result.harmonics[-1] + 1)
    return WornContact(
        wear, result.patch.area, result.patch.gap, result.patch.components, HarmonicBasis(result.harmonics, samples),
        result.facts.joints, (0.0 if table is None else table.lost_below) or LIFE_SHARE,
        table is not None and table.lost_of == "any", result.facts.share_of_body_1, row=row,
        places=result.facts.places, shares=() if table is None else tuple(duty.share for duty in table.duties),
    )  # fmt: skip


def histories_of(result: Result) -> dict[StatedQuantity, np.ndarray]:
    """Quantity -> (n_row,) its values along the wear, of those that have them; empty without wear."""
    wear = result.wear
    if wear is None or not len(wear.cycles):
        return {}
    rows = range(len(wear.cycles))
    cycles = [_cycle_at(result, wear, row) for row in rows]
    tables: dict[StatedQuantity, list[float | None]] = {
        quantity: [quantity.value(cycle) for cycle in cycles] for quantity in quantities_of(CycleQuantity)
    }
    worn = [contact for row in rows if (contact := worn_contact(result, row)) is not None]
    growing = [quantity for quantity in quantities_of(WearQuantity) if quantity.grows]
    tables |= {quantity: [quantity.value(contact) for contact in worn] for quantity in growing}
    return {quantity: np.array(values, float) for quantity, values in tables.items() if None not in values}


def _of_cycles(result: Result) -> Iterator[Answer]:
    cycles = cycles_of(result)
    statements = _statements(result)
    for quantity in quantities_of(CycleQuantity):
        values = {moment: quantity.value(cycle) for moment, (cycle, _) in cycles.items()}
        if all(value is None for value in values.values()):
            yield Answer(quantity, "", FIRST, None)
        for moment, value in values.items():
            if value is not None:
                statement = statements.get(quantity.name)
                error = statement if moment == FIRST and _is_value_of(statement, value) else None
                yield Answer(quantity, "", moment, value, error, reason=cycles[moment][1])
        for joint in _joints(result) if quantity.by_joint else ():
            for moment in (FIRST, LAST):
                if moment in cycles and cycles[moment][0].joints:
                    yield Answer(quantity, joint, moment, quantity.value(cycles[moment][0].of_joint(joint)))
        for place in result.facts.places if quantity.by_place and len(result.facts.places) > 1 else ():
            for moment, (cycle, reason) in cycles.items():
                yield Answer(quantity, place.name, moment, quantity.value(cycle.of_place(place.name)), reason=reason)


def _of_wear(result: Result) -> Iterator[Answer]:
    worn, statements = worn_contact(result), _statements(result)
    for quantity in quantities_of(WearQuantity):
        for joint in ("", *(_joints(result) if quantity.by_joint and worn is not None else ())):
            contact = worn.of_joint(joint) if worn is not None and joint else worn
            value = None if contact is None else quantity.value(contact)
            remark = quantity.remark(contact) if contact is not None and quantity.remark and value is not None else ""
            yield Answer(quantity, joint, RUN, value, None if joint else statements.get(quantity.name), reason=remark)


def _of_curve(result: Result) -> Iterator[Answer]:
    curve, statements = solved_curve(result), _statements(result)
    for quantity in quantities_of(CurveQuantity):
        value = None if curve is None else quantity.value(curve)
        yield Answer(quantity, "", RUN, value, statements.get(quantity.name))


def solved_curve(result: Result) -> SolvedCurve | None:
    """The response curve of a result, None where it has none."""
    branch = result.response
    return None if branch is None else SolvedCurve(branch, _basis(result), result.facts.places)


def _joints(result: Result) -> list[str]:
    return [name for name, pairs in result.facts.joints.items() if len(result.patch.area[pairs])]


def _statements(result: Result) -> Mapping[str, Statement]:
    return {} if result.verdict is None else result.verdict.statements


def _is_value_of(statement: Statement | None, value: float) -> bool:
    """Whether a statement is about a value; it is not where the row is of a motion in time, not of the balance."""
    expected = None if statement is None else statement.value
    return expected is not None and isclose(expected, value, rel_tol=VALUE_TOLERANCE)


def _basis(result: Result) -> HarmonicBasis:
    return HarmonicBasis(result.harmonics, 2 * result.harmonics[-1] + 1)


def _cycle_at(result: Result, wear: WearHistory, row: int) -> SolvedCycle:
    cycle = SolvedCycle.at_row(wear, row, _basis(result), result.facts.joints, result.facts.places)
    return _with_stress(result, cycle, row)


def _with_stress(result: Result, cycle: SolvedCycle, number: int) -> SolvedCycle:
    """The cycle of a row or point with the stress of the whole part, where the result holds it."""
    field = result.stress_field
    stress = None if field is None or not field.spot.shape[1] else field.of(number)
    return cycle if stress is None else replace(cycle, whole=lambda: stress, area=result.patch.area)
