"""Exact derivatives at a point of a response or a life, by keys of a scene."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.derivatives import cycle_derivatives
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.quantity import CycleQuantity, with_error
from tribodyn.hbm.wear import tangent
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import settings, wear_run
from tribodyn.workflows.run.parameter_variation import ParameterVariation
from tribodyn.workflows.run.scene_numbers import moves_nodes
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.wear import Place

Advance = Callable[[float, str], None]


def changes_of(
    varying: ParameterVariation, values: Mapping[str, float], advance: Advance, without: dict[str, str] | None
) -> Iterator[ParameterChange]:
    """Of every key but those of wear laws; one without a derivative goes into `without`, where that is given."""
    for i, (key, value) in enumerate(values.items()):
        advance(i / len(values), key)
        try:
            if key in varying.numbers:
                yield varying.change(key, value)
        except (NoDerivative, Refusal) as reason:
            if without is None:
                raise
            without[key] = str(reason)


def life_share(scene: Scene) -> float:
    """Of the first preload, where the life that a result states ends."""
    return LIFE_SHARE if scene.wear is None else scene.wear.lost_below or LIFE_SHARE


def of_life(
    varying: ParameterVariation, worn: WearHistory, changes: Iterator[ParameterChange], values: Mapping[str, float]
) -> Derivatives:
    scene, by_key = varying.scene, wear_run.law_numbers(varying.scene)
    problem = wear_run.wear_problem(scene, varying.model.balance)
    numbers = {key: by_key[key][1:3] for key in values if key in by_key}
    return tangent.of_life(problem, worn, changes, numbers, life_share(scene))


def of_branch(
    scene: Scene, balance: HarmonicBalance, branch: Branch, changes: Iterator[ParameterChange],
    at: float | None = None, output: str = settings.OUTPUT,
) -> Derivatives:  # fmt: skip
    """At a frequency [Hz], or along the highest peak of a response."""
    options = settings.newton_options(scene)
    fits = branch.amplitude(output) if at is None else -np.abs(branch.frequency - at)
    nearest = int(np.argmax(np.where(branch.converged, fits, -np.inf)))
    if at is None and nearest in (0, len(branch.omega) - 1):
        raise NoDerivative(branch.no_peak(output))
    x = balance.shaped(branch.contact[nearest])
    state = balance.evaluate(branch.omega[nearest] if at is None else 2 * np.pi * at, x)
    take = cycle_derivatives.at_peak if at is None else cycle_derivatives.at_frequency
    return take(balance, state, output, changes, wear_run.coefficients(scene), options)


def of_summary(
    varying: ParameterVariation, result: Result, names_of_keys: Sequence[str]
) -> dict[tuple[str, str], float]:
    """Derivatives of numbers of a finished run, of its first state and its life, by some keys of its scene.

    Returns (number, key) -> d number / d key, SI units, as far as these are exact"""
    scene, response, worn, slopes = varying.scene, result.response, result.wear, dict[tuple[str, str], float]()
    scene_numbers = {key: number.value for key, number in varying.numbers.items()}
    in_wear = {key: value for key, (value, *_) in wear_run.law_numbers(scene).items()}
    values, wear_values = ({key: of[key] for key in names_of_keys if key in of} for of in (scene_numbers, in_wear))
    values = {key: v for key, v in values.items() if not moves_nodes(varying.numbers[key]) or varying.is_linear(key)}
    joints = varying.model.balance.contact.joints
    gaps = {"contact.gap" if joint.name == "contact" else f"contacts.{joint.name}.gap": joint.rows for joint in joints}
    gaps = {key: rows for key, rows in gaps.items() if key in names_of_keys}
    if not (values or wear_values or gaps):
        return slopes

    def add(find: Callable[[], Derivatives], columns: Mapping[str, str]) -> None:
        """Put the slopes of a point into the table; columns : quantity -> its column."""
        with suppress(Refusal, SolverFailure):  # no derivative here, or no model with a changed parameter
            point = find()
            by_key = {key: point.slopes[:, i] for i, key in enumerate(point.parameters)}
            by_key |= {key: point.by_gap[:, rows].sum(axis=1) for key, rows in gaps.items()}
            for at, name in enumerate(point.names):
                if name in columns:
                    slopes.update({(columns[name], key): float(column[at]) for key, column in by_key.items()})

    places = [Place(peak=1.0)] if scene.wear is None else [duty.at for duty in scene.wear.duties]
    changes = partial(changes_of, varying, values, lambda *_: None, {})
    firsts = {quantity.name: f"{quantity.name}_first" for quantity in with_error(CycleQuantity)}
    if response is not None and len(places) == 1 and places[0].peak in (None, 1.0):
        add(lambda: of_branch(scene, varying.model.balance, response, changes(), places[0].frequency), firsts)
    if worn is not None:
        add(lambda: of_life(varying, worn, changes(), wear_values), {"life": "life"})
    return slopes
