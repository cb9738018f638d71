"""When a balance is solved well enough: its relative residual, and the one that the contact forces need."""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numba
import numpy as np

from tribodyn.hbm.contact.contact_law import ContactCycle
from tribodyn.hbm.linearisation import Linearisation


@dataclass(frozen=True)
class CriterionRules:
    """force_accuracy : of the contact forces, required where these stretch their springs far less than x is large
    vibration_accuracy : residual over the vibration, required where the static displacement is far larger: a resonance
        of 0.01 % damping amplifies it by 5000
    least_tolerance : residual over displacement that rounding permits"""

    force_accuracy: float = 1e-4
    vibration_accuracy: float = 1e-6
    least_tolerance: float = 1e-12


CRITERION = CriterionRules()


class Evaluation(Protocol):
    """A balance evaluated at one x; the fields are those of `State`, without the frequency."""

    @property
    def x(self) -> np.ndarray: ...

    @property
    def cycle(self) -> ContactCycle: ...

    @property
    def g(self) -> np.ndarray: ...

    @property
    def residual(self) -> np.ndarray: ...


Frequency = TypeVar("Frequency", contravariant=True)
Evaluated = TypeVar("Evaluated", bound=Evaluation)


class Balance(Protocol[Frequency, Evaluated]):
    """What Newton's method solves: R(x) = 0 at a frequency, or at one for each of several duties.

    reference_stiffness : (n_contact,) stuck springs that the departure g is measured from [N/m]"""

    @property
    def reference_stiffness(self) -> np.ndarray: ...

    def x_lin(self, omega: Frequency) -> np.ndarray: ...

    def evaluate(self, omega: Frequency, x: np.ndarray) -> Evaluated: ...

    def linearise(self, state: Evaluated) -> Linearisation: ...


@dataclass(frozen=True)
class NewtonOptions:
    """How exactly and how long Newton works.

    tolerance : of the residual over the displacement; max_steps : Newton steps; max_products : per direction
    krylov : largest relative residual of a direction; the forcing term asks for less where Newton is fast
    least_motion : take the shortest of all directions that solve the linear problem, by its dense matrix: a body that
        slips on all its faces can be at rest in many places"""

    tolerance: float = 1e-8
    max_steps: int = 40
    max_products: int = 300
    krylov: float = 0.1
    least_motion: bool = False


def relative_residual(state: Evaluation, x_lin: np.ndarray) -> float:
    """|R| / max(|x|, |x_lin|), Euclidean, 1 where only these vanish; invariant to the units."""
    scale = max(euclidean_norm(state.x), euclidean_norm(x_lin))
    return euclidean_norm(state.residual) / scale if scale > 0 else float(state.residual.any())


def euclidean_norm(values: np.ndarray) -> float:
    """The Euclidean norm of all; numpy's own takes ten times as long where they are few."""
    flat = values.ravel()
    return math.sqrt(flat @ flat)


def required_residual(
    balance: Balance[Frequency, Evaluated], state: Evaluated, x_lin: np.ndarray, options: NewtonOptions
) -> float:
    """The relative residual to reach: the tolerance, or less where contact forces or the vibration need it and rounding
    permits."""
    by_forces = CRITERION.force_accuracy * spring_stretch(balance, state, x_lin)
    needed = min(by_forces, required_by_vibration(state, x_lin))
    return min(options.tolerance, max(needed, CRITERION.least_tolerance))


def required_by_vibration(state: Evaluation, x_lin: np.ndarray) -> float:
    """The relative residual that the vibration under its loads needs, where the static displacement is far larger."""
    linear, size = (euclidean_norm(values[..., values.shape[-1] % 2 :]) for values in (x_lin, state.x))
    if linear == 0.0:
        return np.inf
    scale = max(euclidean_norm(state.x), euclidean_norm(x_lin))
    return CRITERION.vibration_accuracy * max(size, linear) / scale


def spring_stretch(balance: Balance[Frequency, Evaluated], state: Evaluated, x_lin: np.ndarray) -> float:
    """The stretch of the contact springs over the displacement; infinite where nothing touches or moves."""
    size = float(_stretch(state.cycle.force.reshape(state.g.shape), balance.reference_stiffness))
    scale = max(euclidean_norm(state.x), euclidean_norm(x_lin))
    return size / scale if size > 0.0 and scale > 0.0 else np.inf


@numba.njit(cache=True)
def _stretch(force, stiffness):
    """The Euclidean norm of forces (n_contact, n) over their springs (n_contact,), those of no spring left out."""
    total = 0.0
    for i in range(len(stiffness)):
        if stiffness[i] > 0.0:
            for value in force[i]:
                total += (value / stiffness[i]) ** 2
    return math.sqrt(total)
