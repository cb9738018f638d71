"""A result in words: the lines that `tribodyn show` prints, pairs of a name and a readable value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import first_lost, order_of_line
from tribodyn.workflows.result.verdict import NAMES, UNITS, Change, Refinement, Status, Verdict, loaded

Lines = list[tuple[str, str]]


def lines(result: Result) -> Lines:
    """The numbers of the result, and their errors."""
    return [*numbers(result), *(errors(loaded(result.verdict)) if result.verdict else [])]


def numbers(result: Result) -> Lines:
    """What was modelled and computed, without its errors."""
    found = result.summary()
    threads = result.provenance.get("threads", "1")
    return [
        *_model(result, found),
        *_response(found, order_of_line(result)),
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


def _response(found: dict[str, Any], order: int | None) -> Lines:
    shown: Lines = []
    if found["peak_hz"] is not None:
        shown.append(("frequency", _course(found, "peak_hz", 1, "Hz")))
        if order is not None:
            shown.append(("speed", _course(found, "peak_hz", 60 / order, "rpm")))
        shown.append(("amplitude", _course(found, "peak_m", 1e3, "mm")))
    if found["peak_at_end"]:
        shown.append(("", "no peak: the response is highest at an end of response.frequency, widen it"))
    if found["jumped"]:
        shown.append(("", 'warning: the sweep jumped: behind the fold its peak may be higher; see method "arc_length"'))
    if found["peak_is_stable"] is False and not found["wear_steps"]:
        hertz, height = found["stable_peak_hz"], found["stable_peak_m"]
        below = (
            "no point is stable" if hertz is None else f"highest stable point: {hertz:.5g} Hz, {1e3 * height:.5g} mm"
        )
        shown.append(("", f"this peak is unstable: no vibration remains there; {below}"))
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
        ("preload", _course(found, "preload_N", 1, "N") + ", mean of a cycle"),
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
        shown += f", mean preload {first:.5g} -> {last:.5g} N, largest depth {1e6 * joint['depth_max_m']:.4g} um, "
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
