"""Values of the quantities of a whole wear run whose errors are stated: of a result, and of a refined run."""

from __future__ import annotations

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.quantity import WearQuantity, WornContact, with_error
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors.operating_states import OperatingState, Values
from tribodyn.workflows.result.answers import EVENT_SAMPLES, worn_contact
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import wear_run
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.scene.scene_file import SceneFile


def values_of(worn: WornContact) -> Values | None:
    """Quantity -> its value; None where one has none, as where no life has ended."""
    values = {quantity.name: quantity.value(worn) for quantity in with_error(WearQuantity)}
    complete = {name: value for name, value in values.items() if value is not None}
    return complete if len(complete) == len(values) else None


def values_of_result(result: Result) -> Values | None:
    """The same of a result that wears."""
    worn = worn_contact(result)
    return None if worn is None else values_of(worn)


def wear_through(file: SceneFile, model: Model, start: OperatingState | None = None) -> Values:
    """The values of a scene worn as it says; start : see `worn_by`. Raises SolverFailure where no life ends."""
    worn = worn_by(file, model, start)
    values = None if worn.history.ended.failed else values_of(worn)
    if values is None:
        raise SolverFailure(str(worn.history.end))
    return values


def worn_by(file: SceneFile, model: Model, start: OperatingState | None = None) -> WornContact:
    """The contact of a scene worn as it says; start : state of its mesh before wear, None where it is searched."""
    wear, interface = file.scene.wear, model.balance.model.interface
    assert wear is not None
    basis = model.balance.basis
    place = None
    if start is not None:
        place = start.point.state.omega, start.balance.basis.transfer(start.point.state.x, basis)
    return WornContact(
        wear_run.worn_out(file, model, wear.lost_below, place), interface.area, interface.gap, interface.components,
        HarmonicBasis(basis.harmonics, max(EVENT_SAMPLES, 2 * basis.harmonics[-1] + 1)), model.reduced.joints,
        wear.lost_below or LIFE_SHARE, wear.lost_of == "any", wear.split,
    )  # fmt: skip
