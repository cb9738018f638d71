"""A result in words: the summary that heads `run`, `show` and the report, and every number of it below."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tribodyn.workflows.result.facts import Stage
from tribodyn.workflows.result.readable import UNKNOWN, digits, measured, rounded
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import LARGEST_BEND, first_lost, life_ends, order_of_line, size_of, worn_at_peak
from tribodyn.workflows.result.verdict import NAMES, UNITS, Refinement, Statement, Status

Lines = list[tuple[str, str]]
TOGETHER = "mesh, modes and harmonics together"
MOST_JOINTS = 4  # named contacts that a summary has a line each for


def brief(result: Result) -> list[str]:
    """The summary of a result: model, response, wear, errors, warnings, each number with the digits it has."""
    found, judged = result.summary(), result.verdict.statements if result.verdict else {}
    groups = {
        "model": _model_in_brief(result, found),
        "response": _response_in_brief(result, found, judged),
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
    modes = {"open": found["free_hz"][:3], "stuck": found["stuck_hz"][:3]}
    known = [f"{how} {_hertz(lowest)}" for how, lowest in modes.items() if lowest]
    return ["; ".join(pieces), *([f"modes with the contact {', '.join(known)}"] if known else [])]


def _hertz(modes: list[float]) -> str:
    return ", ".join(rounded(hertz, 4) if hertz > 1e-4 * max(modes) else "0" for hertz in modes) + " Hz"


def _of(judged: dict[str, Statement], name: str, default: int = 3) -> int:
    """Digits of a quantity by its error."""
    one = judged.get(name)
    sought = one is not None and one.status == Status.NOT_KNOWN and name in ("depth", "life")
    return default if one is None else digits(one.error, UNKNOWN if sought else default)


def _response_in_brief(result: Result, found: dict[str, Any], judged: dict[str, Statement]) -> list[str]:
    if found["peak_hz"] is None:
        return []
    count = _of(judged, "peak_frequency", 4), _of(judged, "amplitude")
    given = found["wear_steps"] and not worn_at_peak(result)
    peaks = [
        f"{f'{hertz:g} Hz' if given else measured(hertz, 'Hz', count[0])}, {measured(height, 'm', count[1])}"
        for hertz, height in zip(found["peak_hz"], found["peak_m"], strict=True)
    ]
    shown = [f"peak      {peaks[0]}{', unworn' if found['wear_steps'] else ''}"]
    if found["wear_steps"] and not given:
        shown.append(f"          {peaks[1]}, at the end of wear")
    elif given:
        shown = [f"worn at   {peaks[0]}, unworn", f"          {peaks[1]}, at the end of wear"]
        if (frf := result.response) is not None and (top := frf.peak(frf.output_names[0])) is not None:
            highest = measured(frf.frequency[top], "Hz", 4), measured(frf.amplitude(frf.output_names[0])[top], "m")
            shown.insert(0, f"peak      {', '.join(highest)}, unworn")
    if (order := order_of_line(result)) is not None:
        speeds = [f"{60 * hertz / order:.{count[0]}g} rpm" for hertz in found["peak_hz"]]
        shown.append(f"speed     {speeds[0]}" + (f", {speeds[1]} at the end of wear" if found["wear_steps"] else ""))
    if found["load_factor"] is not None:
        ends = [abs(result.driving_force or 1.0) * factor for factor in found["load_factor"]]
        force = [f"{end:.3g} times the loads" if result.driving_force is None else measured(end, "N") for end in ends]
        shown.append(f"force     {force[0]} to {force[1]}, found")
    if found["harmonics_error"] is not None:
        shown.append(f"harmonics chosen, estimated truncation error {percent(found['harmonics_error'])}")
    if found["shear_spread"] is not None:
        spread, there = percent(found["shear_spread"]), percent(found["shear_spread_at_peak"])
        shown.append(f"load path changes the amplitude by up to {spread}, {there} at the peak")
    if found["bifurcations"]:
        places = ", ".join(f"{one['kind']} at {measured(one['hz'], 'Hz', 4)}" for one in found["bifurcations"])
        shown.append(f"stability {found['unstable_points']} unstable points; {places}")
    return shown


def _wear_in_brief(result: Result, found: dict[str, Any], judged: dict[str, Statement]) -> list[str]:
    count, life = _of(judged, "depth"), _of(judged, "life")
    shown = [f"cycles    {measured(found['cycles'], 'cycles', life)}: {found['wear_end'].split(';')[0]}"]
    lost = found["life_cycles"] and measured(found["life_cycles"], "cycles", life)
    if lost and not shown[0].startswith(f"cycles    {lost}:"):
        joint, (share, whose) = first_lost(result), life_ends(result)
        until = f"{100 * share:g} % of the {whose} is left" if joint is None else f"contact {joint} is lost"
        shown.append(f"life      {lost}, until {until}")
    if found["first_lift_cycles"] is not None:
        shown.append(f"opens     first after {measured(found['first_lift_cycles'], 'cycles', 2)}")
    deepest, mean = (measured(found[key], "m", count) for key in ("depth_max_m", "depth_mean_m"))
    first, last = (measured(force, "N", _of(judged, "preload")) for force in found["preload_N"])
    work = measured(found["energy_J"], "J", UNKNOWN)
    shown.append(f"depth     {deepest} at most, {mean} on average")
    shown.append(f"preload   {first} at first, {last} in the end, means of a cycle")
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
        label = NAMES[name]
        if one.value is None or (name == "peak_frequency" and one.error == 0.0):  # given by the scene
            continue
        if one.stated:
            value, error = measured(one.value, UNITS[name], digits(one.error)), percent(one.error or 0.0)
            by = TOGETHER if one.dominated_by == Refinement.COMBINED else one.dominated_by or one.reason
            shown.append(f"{label:15} {value:19} {error:8} {by}")
            continue
        known = one.status == Status.NOT_KNOWN
        value = measured(one.value, UNITS[name], _of(judged, name)) if known else "not reported"
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
    if found["peak_at_end"] and (frf := result.response) is not None:
        yield f"no peak: {frf.no_peak(frf.output_names[0])}"
    if found["jumped"]:
        yield 'the sweep jumped: behind the fold its peak may be higher; see response.method "arc_length"'
    if found["peak_is_stable"] is False and not found["wear_steps"]:
        yield f"this peak is unstable, no vibration remains there; {_stable(found)}"
    if (wear := result.wear) is not None:
        if wear.in_time[:1].any():
            height, work = measured(wear.amplitude[0], "m", 2), measured(wear.energy[0].sum(), "J", 2)
            what = "peak" if worn_at_peak(result) else "motion"
            yield f"the unworn {what} is unstable: a machine leaves it for {height} and {work} a cycle on average"
        if found["unstable_cycles"]:
            share = percent(found["unstable_cycles"])
            yield f'the motion is unstable for {share} of the cycles; wear.motion = "machine" follows a machine there'
        elif found["unstable_cycles"] is None and result.facts.around is not None and found["wear_steps"]:
            yield "whether the wheel stays at the motion that it wears along is not known"
        for row in wear.without_balance[:1]:
            yield f"from {measured(wear.cycles[row], 'cycles')} on maps, loops and films are of the last balance solved"
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
    """Every number under the name that `show --json` has for it, and what each refinement changed."""
    found = result.summary()
    changes = found.pop("changes")
    found |= {f"verdict.{name}": one for name, one in (found.pop("verdict") or {}).items()}
    found |= {f"joints.{name}": one for name, one in found.pop("joints").items()}
    shown = [(name, _shown(value)) for name, value in found.items() if value not in (None, [], {})]
    for one in changes or ():
        relative = one["how"] if one["relative"] is None else percent(one["relative"])
        shown.append((f"{one['refinement']}: {one['quantity']}", relative))
    return shown


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{name} {_shown(one)}" for name, one in value.items() if one not in (None, ""))
    if isinstance(value, list):
        return ", ".join(map(_shown, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def percent(error: float) -> str:
    """A relative error for people."""
    return f"{100 * error:.2g} %" if error >= 1e-4 else "below 0.01 %"
