"""What a scene asks of the solver: frequency range, continuation and Newton options, places, mission, wear step."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from tribodyn.hbm import continuation
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.continuation.operating_condition import AtPeakRatio
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.wear import law as wear_law, wear_rule
from tribodyn.hbm.wear.wear_problem import Duty
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import references
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.user_files import is_user_file
from tribodyn.workflows.scene.wear import Place

OUTPUT = "response"


def check_names(scene: Scene, own_files: bool = True) -> None:
    """Raise ValueError where a law or a method of a scene does not fit it, before anything is built.

    own_files : run files beside the scene for it, which a plan must not do"""
    for contact in scene.joints.values():
        if own_files or not is_user_file(contact.law):
            contact_law.require_components(contact.law_name, contact.components)
    if own_files or not is_user_file(scene.response.method):
        response_options(scene)
    if scene.wear is not None and (own_files or not is_user_file(scene.wear.law)):
        wear_law.load(scene.wear.law_name)
    if scene.wear is not None and (own_files or not is_user_file(scene.wear.rule)):
        wear_rule.load(scene.wear.rule_name)


def response_options(scene: Scene) -> Any:
    """Options of the scene's continuation method; raises ValueError where the method refuses them."""
    kind = continuation.load(scene.response.method_name).Options
    general = {"n_points": scene.response.points, "newton": newton_options(scene)}
    names = {option.name for option in fields(kind)}
    return kind(**{name: value for name, value in general.items() if name in names} | scene.response.options)


def response_range(scene: Scene) -> tuple[float, float]:
    """Lowest and highest frequency of the response [rad/s]."""
    low, high = scene.response.range
    return 2 * np.pi * low, 2 * np.pi * high


def highest_frequency(scene: Scene) -> float:
    """Highest frequency that is asked for, of the response or of a place where cycles are taken [rad/s]."""
    worn = () if scene.wear is None else scene.wear.duties
    return 2 * np.pi * max([scene.response.range[1], *(duty.at.frequency or 0.0 for duty in worn)])


def newton_options(scene: Scene) -> NewtonOptions:
    """How exactly every balance is solved."""
    return NewtonOptions(tolerance=scene.solver.tolerance)


def peak_of(scene: Scene) -> AtPeak:
    """The resonance peak within the range of the response."""
    return AtPeak(OUTPUT, *response_range(scene), scene.response.points, newton=newton_options(scene))


def mission(scene: Scene, highest: float = np.inf) -> tuple[Duty, ...]:
    """Where the cycles that wear are taken: the scene's one place, or the duties of its mission.

    highest : amplitude of the largest linear response, see `AtPeak` [m]"""
    return tuple(Duty(site_of(scene, duty.at, highest), duty.share, duty.load) for duty in scene.wear_table.duties)


def site_of(scene: Scene, place: Place, highest: float = np.inf) -> AtFrequency | AtPeak | AtPeakRatio:
    """A place of the scene's response; highest : as for `mission`."""
    if place.frequency is not None:
        return AtFrequency(OUTPUT, 2 * np.pi * place.frequency, newton_options(scene))
    assert place.peak is not None
    peak = replace(peak_of(scene), linear_bound=highest)
    return peak if place.peak == 1.0 else AtPeakRatio(peak, place.peak)


def depth_scale(scene: Scene, approach: np.ndarray, area: np.ndarray) -> float:
    """Depth that errors of wear are measured by and steps are a share of, delta_max [m]; nan where none is needed.

    approach : (n_pair,) by which the static loads press the faces into each other without contact [m]; area : [m2]
    Raises  Refusal where delta_max is needed and the scene has none"""
    if scene.wear_table.accuracy_share is None:  # its steps do not depend on delta_max
        return float("nan")
    delta_max = references.delta_max(scene, approach, area)
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise Refusal(
            "wear.step: a share of delta_max needs static loads that press the contact of a part held without it; "
            'give a depth such as "50 um" and rule = "thesis"'
        )
    return delta_max
