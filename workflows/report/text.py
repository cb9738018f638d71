"""A result in words: the summary that heads `run`, `show` and the report, and every number of it below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.result.facts import Stage
from tribodyn.workflows.result.readable import UNKNOWN, digits, measured, rounded
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import LARGEST_BEND, first_lost, size_of
from tribodyn.workflows.result.verdict import NAMES, UNITS, Change, Refinement, Statement, Status, Verdict, loaded

Lines = list[tuple[str, str]]
MOST_JOINTS = 4  # named contacts that a summary has a line each for


def brief(result: Result) -> list[str]:
    """The summary of a result: model, response, wear, errors, warnings, each number with the digits it has."""
    found, judged = result.summary(), loaded(result.verdict).statements if result.verdict else {}
    groups = {
        "model": _model_in_brief(result, found),
        "response": _response_in_brief(found, judged),
        "wear": _wear_in_brief(result, found, judged) if found["depth_max_m"] is not None else [],
        "errors": _errors_in_brief(judged),
    }
    state = result.state.split(":")[0]
    shown = [f"{result.provenance['scene_name']}: {state}, {found['seconds']:.0f} s"]
    for name, lines in groups.items():
        shown += [f"{name if at == 0 else '':9} {line}".rstrip() for at, line in enumerate(lines)]
    return shown + [f"warning   {warning}" for warning in warnings(result)]


def _model_in_brief(result: Result, found: dict[str, Any]) -> list[str]:
    full, model, around = found["full_dofs"], found["model_dofs"], result.facts.around
    pieces = [f"{full} DOFs" if full == model else f"{full} DOFs reduced to {model}"]
    pieces.append(f"{found['contact_pairs']} node pairs in contact")
    if around is not None:
        pieces.append(f"{around.sectors} sectors, engine order {around.engine_order}")
    if found["harmonics"]:
        pieces.append(f"harmonics {', '.join(map(str, found['harmonics']))}")
    free = ", ".join(rounded(hertz, 4) for hertz in found["free_hz"][:4])
    return ["; ".join(pieces), *([f"modes with the contact open: {free} Hz"] if free else [])]


def _of(judged: dict[str, Statement], name: str, default: int = 3) -> int:
    """Digits of a quantity by its error."""
    one = judged.get(name)
    return default if one is None else digits(one.error, UNKNOWN if one.status == Status.NOT_KNOWN else default)


def _response_in_brief(found: dict[str, Any], judged: dict[str, Statement]) -> list[str]:
    if found["peak_hz"] is None:
        return []
    count = _of(judged, "peak_frequency", 4), _of(judged, "amplitude")
    peaks = [
        f"{measured(hertz, 'Hz', count[0])}, {measured(height, 'm', count[1])}"
        for hertz, height in zip(found["peak_hz"], found["peak_m"], strict=True)
    ]
    shown = [f"peak      {peaks[0]}{', unworn' if found['wear_steps'] else ''}"]
    if found["wear_steps"]:
        shown.append(f"          {peaks[1]}, at the end of wear")
    if found["bifurcations"]:
        places = ", ".join(f"{one['kind']} at {measured(one['hz'], 'Hz', 4)}" for one in found["bifurcations"])
        shown.append(f"stability {found['unstable_points']} unstable points; {places}")
    return shown


def _wear_in_brief(result: Result, found: dict[str, Any], judged: dict[str, Statement]) -> list[str]:
    count, life = _of(judged, "depth"), _of(judged, "life")
    shown = [f"cycles    {measured(found['cycles'], 'cycles', life)}: {found['wear_end'].split(';')[0]}"]
    lost = found["life_cycles"] and measured(found["life_cycles"], "cycles", life)
    if lost and not shown[0].startswith(f"cycles    {lost}:"):
        joint = first_lost(result)
        until = f"{100 * LIFE_SHARE:g} % of the preload is left" if joint is None else f"contact {joint} is lost"
        shown.append(f"life      {lost}, until {until}")
    if found["first_lift_cycles"] is not None:
        shown.append(f"opens     first after {measured(found['first_lift_cycles'], 'cycles', 2)}")
    deepest, mean = (measured(found[key], "m", count) for key in ("depth_max_m", "depth_mean_m"))
    first, last = (measured(force, "N", _of(judged, "preload")) for force in found["preload_N"])
    work = measured(found["energy_J"], "J", UNKNOWN)
    shown.append(f"depth     {deepest} at most, {mean} on average")
    shown.append(f"preload   {first} at first, {last} in the end")
    shown.append(f"worn      {measured(found['volume_m3'], 'm3', count)} by {work} of friction work")
    for name, joint in list(found["joints"].items())[:MOST_JOINTS]:
        if "depth_max_m" in joint:
            until = joint["life_cycles"]
            end = "" if until is None else f", lost after {measured(until, 'cycles', life)}"
            shown.append(f"  {name}: depth {measured(joint['depth_max_m'], 'm', count)}{end}")
    return shown


def _errors_in_brief(judged: dict[str, Statement]) -> list[str]:
    """A table of values, errors and what dominates these; the reasons of what is not known once, below it."""
    shown, reasons = [], dict[str, list[str]]()
    for name, one in judged.items():
        label = NAMES.get(name, name)
        if one.value is None:
            continue
        if one.stated:
            value, error = measured(one.value, UNITS[name], digits(one.error)), percent(one.error or 0.0)
            shown.append(f"{label:15} {value:19} {error:8} {one.dominated_by or one.reason}")
            continue
        known = one.status == Status.NOT_KNOWN
        value = measured(one.value, UNITS[name], UNKNOWN) if known else "not reported"
        error = "unknown" if known else ""
        shown.append(f"{label:15} {value:19} {error}".rstrip())
        why = one.reason if known else f"{one.status.removeprefix('not reported ').strip('()')}; {one.reason}"
        reasons.setdefault(why.strip("; "), []).append(label)
    head = [f"{'':15} {'value':19} {'error':8} dominated by"] if shown else []
    return head + shown + [f"{', '.join(names)}: {why}" for why, names in reasons.items() if why]


def warnings(result: Result) -> Iterator[str]:
    """What of a result is to be doubted, in sentences."""
    found = result.summary()
    if result.stage not in (Stage.COMPLETE, Stage.RESPONSE):
        yield f"this run is not complete: {result.state}"
    if found["peak_at_end"]:
        yield "no peak: the response is highest at an end of response.frequency, widen it"
    if found["jumped"]:
        yield 'the sweep jumped: behind the fold its peak may be higher; see response.method "arc_length"'
    if found["peak_is_stable"] is False and not found["wear_steps"]:
        yield f"this peak is unstable, no vibration remains there; {_stable(found)}"
    if (wear := result.wear) is not None:
        for row in wear.jumps:
            before, after = (measured(hertz, "Hz", 4) for hertz in wear.frequency[row : row + 2])
            when = measured(wear.cycles[row + 1], "cycles")
            yield f"at {when} the response jumped from {before} to {after}, where another resonance dominates"
    heights, size = found["peak_m"] or [0.0], size_of(result)
    if (most := max(heights)) > LARGEST_BEND * size:
        where = "at the end of wear" if most > heights[0] else "at the peak"
        yield (
            f"{measured(most, 'm')} {where} on a part of {measured(size, 'm')} is beyond the linear model: it says "
            "that the amplitude is large, not how large"
        )


def _stable(found: dict[str, Any]) -> str:
    if found["stable_peak_hz"] is None:
        return "no point is stable"
    return f"highest stable point: {found['stable_peak_hz']:.5g} Hz, {1e3 * found['stable_peak_m']:.5g} mm"


def lines(result: Result) -> Lines:
    """The numbers of the result, and their errors."""
    return [*numbers(result), *(errors(loaded(result.verdict)) if result.verdict else [])]


def numbers(result: Result) -> Lines:
    """What was modelled and computed, without its errors."""
    found = result.summary()
    threads = result.provenance.get("threads", "1")
    return [
        *_model(result, found),
        *_response(found),
        *(_wear(result, found) if found["depth_max_m"] is not None else ()),
        *((f"  {name}", _joint(joint)) for name, joint in found["joints"].items()),
        ("computing", f"{found['seconds']:.1f} s on {threads} thread{'s' if threads != '1' else ''}"),
    ]


def _model(result: Result, found: dict[str, Any]) -> Lines:
    full, model = found["full_dofs"], found["model_dofs"]
    shown = [
        ("scene", result.provenance["scene_name"]),
        ("state", result.state),
        ("model", f"{full} DOFs, not reduced" if full == model else f"{full} DOFs reduced to {model}"),
        ("contact", f"{found['contact_pairs']} node pairs, {found['unknowns']} unknowns"),
    ]
    if (around := result.facts.around) is not None:
        shown.append(("wheel", f"{around.sectors} sectors, engine order {around.engine_order}"))
    if found["free_hz"]:
        shown.append(("free modes", ", ".join(f"{hertz:.2f}" for hertz in found["free_hz"][:4]) + " Hz"))
    if found["delta_max_m"] is not None:
        shown.append(("delta_max", f"{1e3 * found['delta_max_m']:.4f} mm"))
    return shown


def _response(found: dict[str, Any]) -> Lines:
    shown: Lines = []
    if found["peak_hz"] is not None:
        shown.append(("frequency", _course(found, "peak_hz", 1, "Hz")))
        shown.append(("amplitude", _course(found, "peak_m", 1e3, "mm")))
    if found["peak_at_end"]:
        shown.append(("", "no peak: the response is highest at an end of response.frequency, widen it"))
    if found["jumped"]:
        shown.append(("", 'warning: the sweep jumped: behind the fold its peak may be higher; see method "arc_length"'))
    if found["peak_is_stable"] is False and not found["wear_steps"]:
        shown.append(("", f"this peak is unstable: no vibration remains there; {_stable(found)}"))
    if found["harmonics"]:
        error = found["harmonics_error"]
        chosen = "" if error is None else f", chosen: estimated truncation error {error:.1e}"
        shown.append(("harmonics", ", ".join(map(str, found["harmonics"])) + chosen))
    if found["response_end"] is not None:
        shown.append(("response", found["response_end"]))
    if found["bifurcations"] is not None:
        places = ", ".join(f"{b['kind']} at {b['hz']:.5g} Hz" for b in found["bifurcations"])
        shown.append(("stability", f"{found['unstable_points']} unstable points; {places or 'no bifurcations'}"))
    if found["shear_spread"] is not None:
        spread, peak = found["shear_spread"], found["shear_spread_at_peak"]
        shown.append(("load path", f"changes the amplitude by up to {spread:.2%}, {peak:.2%} at the peak"))
    return shown


def _wear(result: Result, found: dict[str, Any]) -> Lines:
    life = "contact not lost" if found["separated_cycles"] is None else "contact lost"
    if found["life_cycles"] is not None:
        joint = first_lost(result)
        lost = f"{100 * LIFE_SHARE:g} % of the preload" if joint is None else f"contact {joint} had lost its preload"
        life += f"; life until {lost}: {found['life_cycles']:.4g}"
    events = [("first loss of contact", found["first_lift_cycles"]), ("first pair lost", found["first_loss_cycles"])]
    part, other = (1e9 * volume for volume in found["surface_volumes_m3"])
    deepest, mean = 1e3 * found["depth_max_m"], 1e3 * found["depth_mean_m"]
    return [
        *((name, f"after {count:.4g} cycles") for name, count in events if count is not None),
        ("preload", _course(found, "preload_N", 1, "N")),
        ("cycles", f"{found['cycles']:.4g} ({life})"),
        ("wear depth", f"{deepest:.4f} mm largest, {mean:.4f} mm mean"),
        ("worn volume", f"{1e9 * found['volume_m3']:.5g} mm3: {part:.4g} of body 1, {other:.4g} of the other side"),
        ("friction work", f"{found['energy_J']:.5g} J"),
        ("wear steps", f"{found['wear_steps']} with {found['hbm_solves']} balance solves"),
    ]


def _joint(joint: dict[str, Any]) -> str:
    shown = f"{joint['pairs']} pairs on {1e6 * joint['area_m2']:.5g} mm2"
    if "preload_N" in joint:
        first, last = joint["preload_N"]
        shown += f", preload {first:.5g} -> {last:.5g} N, largest depth {1e6 * joint['depth_max_m']:.4g} um, "
        shown += f"{1e9 * joint['volume_m3']:.4g} mm3, {joint['energy_J']:.4g} J"
        if joint["life_cycles"] is not None:
            shown += f", life {joint['life_cycles']:.4g} cycles"
    return shown


def _course(found: dict[str, Any], name: str, scale: float, unit: str) -> str:
    """The first and the last value of a wear run, or the one of a response."""
    first, last = (float("nan") if value is None else scale * value for value in found[name])
    return f"{first:.5g} {unit}" if found["wear_steps"] == 0 else f"{first:.5g} -> {last:.5g} {unit}"


def errors(verdict: Verdict) -> list[tuple[str, str]]:
    """Values with their errors, as pairs of a name and a readable value."""
    shown = [("errors", "")]
    for name, one in verdict.statements.items():
        label = f"  {NAMES.get(name, name)}"
        if one.value is None:
            shown.append((label, f"none: {one.reason}"))
            continue
        number = f"{one.value:.4g} {UNITS[name]}"
        if one.stated:
            by = f", dominated by {one.dominated_by}" if one.dominated_by else ""
            shown.append((label, f"{number}, error {percent(one.error or 0.0)}{by}"))
        elif one.status == Status.NOT_KNOWN:
            shown.append((label, f"{number}, error not known: {one.reason}"))
        else:
            shown.append((label, f"{one.status}: {one.reason}" if one.reason else one.status))
    return [*shown, *_changes(verdict.changes)]


def _changes(changes: Sequence[Change]) -> list[tuple[str, str]]:
    """What each refinement changed, a line each."""
    shown = [("changes by", "")] if changes else []
    for refinement in Refinement:
        own = [one for one in changes if one.refinement == refinement]
        known = [
            f"{NAMES.get(one.quantity, one.quantity)} {percent(one.relative)}"
            for one in own
            if one.relative is not None
        ]
        if known:
            shown.append((f"  {refinement}", ", ".join(known)))
        elif own:
            shown.append((f"  {refinement}", f"not measured: {own[0].how}"))
    return shown


def percent(error: float) -> str:
    """A relative error for people."""
    return f"{100 * error:.2g} %" if error >= 1e-4 else "below 0.01 %"
