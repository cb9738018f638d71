"""A result in words: the summary that heads `run`, `show` and the report, and every number of it below."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tribodyn.fem.singularities import KINDS
from tribodyn.hbm.quantity import CurveQuantity, StatedQuantity, WearQuantity, quantity_named
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.result.answers import FIRST, LAST, PEAK, STABLE, Answer, answers_of, cycles_of, wears_at_peak
from tribodyn.workflows.result.model_facts import Stage
from tribodyn.workflows.result.number_format import UNKNOWN, digits, measured, rounded
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import LARGEST_BEND, order_of_line, size_of
from tribodyn.workflows.result.verdict import Refinement, Statement, Status

Lines = list[tuple[str, str]]
TOGETHER = "mesh, modes and harmonics together"
MOST_JOINTS = 4  # named contacts that a summary has a line each for
WIDTH = 16  # of the names in a summary


def brief(result: Result) -> list[str]:
    """The summary of a result: model, response, wear, errors, warnings, each number with the digits it has."""
    statements = {} if result.verdict is None else result.verdict.statements
    unbounded = {name for name, statement in statements.items() if statement.status == Status.UNBOUNDED}
    answers = [
        answer
        for answer in answers_of(result)
        if answer.value is not None and answer.quantity.headline and answer.quantity.name not in unbounded
    ]
    groups = {
        "model": _model_lines(result),
        "response": [*_cycle_lines(result, answers), *_curve_lines(result, answers)],
        "wear": _wear_lines(answers),
        "errors": _error_lines(statements),
    }
    state = result.state.split(":")[0]
    lines = [f"{result.provenance['scene_name']}: {state}, {result.facts.seconds:.0f} s"]
    for name, group in groups.items():
        lines += [f"{name if at == 0 else '':9} {line}".rstrip() for at, line in enumerate(group)]
    lines += [f"warning   {warning}" for warning in warnings(result)]
    return lines + [f"note      {note}" for note in result.facts.notes]


def _model_lines(result: Result) -> list[str]:
    facts = result.facts
    full, model, wheel = facts.full_dofs, facts.model_dofs, facts.around
    pieces = [f"{full} DOFs" if full == model else f"{full} DOFs reduced to {model}"]
    pieces.append(f"{facts.contact_pairs} node pairs in contact")
    if wheel is not None:
        pieces.append(f"{wheel.sectors} sectors, engine order {wheel.engine_order}")
    if result.harmonics:
        pieces.append(f"harmonics {', '.join(map(str, result.harmonics))}")
    modes = {"open": facts.open_frequencies[:3].tolist(), "stuck": facts.stuck_frequencies[:3].tolist()}
    spectra = [f"{condition} {_hertz(lowest)}" for condition, lowest in modes.items() if lowest]
    return ["; ".join(pieces), *([f"modes with the contact {', '.join(spectra)}"] if spectra else [])]


def _hertz(modes: list[float]) -> str:
    return ", ".join(rounded(hertz, 4) if hertz > 1e-4 * max(modes) else "0" for hertz in modes) + " Hz"


def _value(answer: Answer) -> str:
    """The value of an answer with its unit and the digits that its error allows."""
    assert answer.value is not None
    return _number(answer.quantity, answer.value, answer.error)


def _number(quantity: StatedQuantity, value: float, statement: Statement | None) -> str:
    if not quantity.unit:
        return percent(value)
    if statement is None:
        return measured(value, quantity.unit, quantity.digits)
    sought = statement.status == Status.NOT_KNOWN and isinstance(quantity, WearQuantity)
    return measured(value, quantity.unit, digits(statement.error, UNKNOWN if sought else quantity.digits))


def _cycle_lines(result: Result, answers: Sequence[Answer]) -> list[str]:
    """A line for each cycle that the result states numbers of: where it is, and its numbers."""
    place = "peak" if wears_at_peak(result) else "operating point"
    words = {PEAK: "peak", FIRST: place, LAST: place, STABLE: "stable point"}
    suffix = {FIRST: ", before wear" if result.wear_steps else "", LAST: ", at the end of wear"}
    lines = []
    for moment, word in words.items():
        cycle_answers = [answer for answer in answers if answer.moment == moment and not answer.joint]
        if (
            not cycle_answers
            or (moment == LAST and not result.wear_steps)
            or (moment == STABLE and result.summary()["peak_is_stable"] is not False)
        ):
            continue
        frequency, *following = cycle_answers
        is_fixed = word == "operating point"
        word = "highest point" if frequency.reason else word
        head = f"{frequency.value:g} {frequency.quantity.unit}" if is_fixed else _value(frequency)
        values = [head, *(f"{answer.quantity.label} {_value(answer)}" for answer in following)]
        if (order := order_of_line(result)) is not None and frequency.value is not None:
            values.insert(1, f"{60 * frequency.value / order:.{frequency.quantity.digits}g} rpm")
        lines.append(f"{word:{WIDTH}}{', '.join(values)}{suffix.get(moment, '')}")
        states = {answer.error.status for answer in cycle_answers if answer.error is not None}
        if states and states <= {Status.UNSTABLE, Status.CONTRADICTED, Status.UNSETTLED}:
            lines[-1] += "; the motion in time is another one, see errors"
    return lines


def _curve_lines(result: Result, answers: Sequence[Answer]) -> list[str]:
    lines, table = [], result.summary()
    if table["harmonics_error"] is not None:
        lines.append(f"{'harmonics':{WIDTH}}chosen, estimated truncation error {percent(table['harmonics_error'])}")
    numbers = [answer for answer in answers if isinstance(answer.quantity, CurveQuantity)]
    lines += [f"{answer.quantity.title}: {_value(answer)}" for answer in numbers]
    if table["bifurcations"]:
        places = ", ".join(f"{b['kind']} at {measured(b['frequency'], 'Hz', 4)}" for b in table["bifurcations"])
        lines.append(f"{'stability':{WIDTH}}{table['unstable_points']} unstable points; {places}")
    return lines


def _wear_lines(answers: Sequence[Answer]) -> list[str]:
    """A line for each number of the wear, and for each of the first named contacts."""
    wear = [answer for answer in answers if isinstance(answer.quantity, WearQuantity)]
    lines = [
        f"{answer.quantity.label:{WIDTH}}{_value(answer)}{f', {answer.reason}' if answer.reason else ''}"
        for answer in sorted(wear, key=lambda answer: answer.quantity.rank)
        if not answer.joint
    ]
    joints = dict.fromkeys(answer.joint for answer in wear if answer.joint)
    for name in list(joints)[:MOST_JOINTS]:
        values = (f"{answer.quantity.label} {_value(answer)}" for answer in wear if answer.joint == name)
        lines.append(f"  {name}: {', '.join(values)}")
    return lines


def _error_lines(statements: Mapping[str, Statement]) -> list[str]:
    """A table of values, errors and what dominates these; the reasons of what is not known once, below it."""
    lines, reasons = [], dict[str, list[str]]()
    for name, statement in statements.items():
        quantity = quantity_named(name)
        if statement.value is None or statement.error == 0.0:  # given by the scene
            continue
        if statement.stated:
            value = _number(quantity, statement.value, statement)
            by = TOGETHER if statement.dominated_by == Refinement.COMBINED else statement.dominated_by
            lines.append(f"{quantity.label:19} {value:19} {percent(statement.error or 0.0):8} {by or statement.reason}")
            continue
        unknown = statement.status == Status.NOT_KNOWN
        value = _number(quantity, statement.value, statement) if unknown else "not reported"
        lines.append(f"{quantity.label:19} {value:19} {'unknown' if unknown else ''}".rstrip())
        status_text = "" if unknown else f"{statement.status.removeprefix('not reported ').strip('()')}; "
        reasons.setdefault(f"{status_text}{statement.reason}".strip("; "), []).append(quantity.label)
    head = [f"{'':19} {'value':19} {'error':8} dominated by"] if lines else []
    return head + lines + [f"{', '.join(labels)}: {reason}" for reason, labels in reasons.items() if reason]


def warnings(result: Result) -> Iterator[str]:
    """What of a result is to be doubted, in sentences."""
    table, curve = result.summary(), result.response
    if result.stage not in (Stage.COMPLETE, Stage.RESPONSE):
        yield f"this run is not complete: {result.state}"
    if table["peak_at_end"] and curve is not None:
        yield f"no peak: {curve.no_peak(curve.output_names[0])}"
    marks = result.stability
    if marks is not None and curve is not None and (count := int((curve.converged & ~marks.known).sum())):
        yield f"whether {count} points of the response are stable is not known: Hill's method and time do not decide"
    if table["jumped"]:
        yield 'the sweep jumped: behind the fold its peak may be higher; see response.method "arc_length"'
    if table["peak_is_stable"] is False and not result.wear_steps:
        stable = any(answer.moment == STABLE for answer in answers_of(result))
        yield f"this peak is unstable, no vibration remains there{'' if stable else '; no point is stable'}"
    if curve is not None and (table["jumped"] or curve.folds):
        yield "the response has folds or jumps: curves of other motions, detached from it, were not searched for"
    if result.wear is not None:
        yield from _wear_warnings(result, result.wear)
    stress = result.stress_field
    if stress is not None and len(stress.row) and stress.spot_kind[-1].any():
        spots = [f"{spot} ({KINDS[kind]})" for spot, kind in enumerate(stress.spot_kind[-1].tolist(), 1) if kind]
        yield f"stress grows with every finer mesh at hot spot {', '.join(spots)}"
    cycles = cycles_of(result)
    highest = max((cycles[moment][0].amplitude for moment in (FIRST, LAST) if moment in cycles), default=0.0)
    if highest > LARGEST_BEND * size_of(result):
        yield (
            f"{measured(highest, 'm')} on a part of {measured(size_of(result), 'm')} is beyond the linear model: it "
            "says that the amplitude is large, not how large"
        )


def _wear_warnings(result: Result, wear: WearHistory) -> Iterator[str]:
    if wear.in_time[:1].any():
        height, work = measured(wear.amplitude[0], "m", 2), measured(wear.energy[0].sum(), "J", 2)
        yield f"the steady state before wear is unstable: the response goes to {height} and {work} a cycle on average"
    if wear.unstable_share:
        share = percent(wear.unstable_share)
        yield f'the steady state is unstable for {share} of the cycles; wear.motion = "machine" follows the response'
    elif wear.unstable_share is None and result.facts.around is not None and result.wear_steps:
        yield "whether the steady state of the wheel is stable along its wear is not known"
    for row in wear.without_balance[:1]:
        yield f"from {measured(wear.cycles[row], 'cycles')} on maps, loops and films are of the last balance solved"
    for row in wear.jumps:
        previous, following = (measured(hertz, "Hz", 4) for hertz in wear.frequency[row : row + 2])
        cycles_text = measured(wear.cycles[row + 1], "cycles")
        yield f"at {cycles_text} the response jumped from {previous} to {following}, where another resonance dominates"


def lines(result: Result) -> Lines:
    """Every number under the name that `show --json` has for it, and what each refinement changed."""
    table = result.summary()
    changes, units = table.pop("changes"), table.pop("units")
    table |= {f"verdict.{name}": statement for name, statement in (table.pop("verdict") or {}).items()}
    table |= {f"joints.{name}": joint for name, joint in table.pop("joints").items()}
    rows = [
        (f"{name} / {units[name]}" if units.get(name) else name, _text(value))
        for name, value in table.items()
        if value not in (None, [], {})
    ]
    for change in changes:
        relative = change["description"] if change["relative"] is None else percent(change["relative"])
        rows.append((f"{change['refinement']}: {change['quantity']}", relative))
    return rows


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{name} {_text(item)}" for name, item in value.items() if item not in (None, ""))
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def percent(error: float) -> str:
    """A relative error for people."""
    return f"{rounded(100 * error, 2)} %" if error >= 1e-4 else "below 0.01 %"
