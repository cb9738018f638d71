"""What a continuation steps in: the frequency, or any number that a balance can be made from.

A `Parameter` turns a value into a balance and the frequency to solve it at, and knows d R / d value at fixed x. Every
continuation takes either a balance (it then steps in frequency) or a Parameter."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.refusal import Refusal

FREQUENCY, LOAD = "frequency", "load factor"
DIFFERENCE_STEP = 1e-6  # of central differences, in units of `Parameter.scale`: near the cube root of rounding


@dataclass(frozen=True)
class Parameter:
    """One number that a problem depends on.

    name : what it is called in results, such as "load factor"
    make : value -> balance
    omega : frequency at which the balance is solved [rad/s]; None where the value itself is the frequency
    scale : typical size of the value, for its finite difference
    unit : of the value, for sentences"""

    name: str
    make: Callable[[float], HarmonicBalance]
    omega: float | None
    scale: float = 1.0
    unit: str = ""

    def place(self, value: float) -> tuple[HarmonicBalance, float]:
        """The balance and the frequency [rad/s] that belong to a value."""
        return self.make(value), value if self.omega is None else self.omega

    def slope(self, value: float, state: State) -> np.ndarray:
        """(n_contact, n_coeff) d R / d value at fixed x: closed form for the frequency, central difference else."""
        if self.omega is None:
            return self.make(value).frequency_slope(state)[0]
        step = DIFFERENCE_STEP * self.scale
        high = self.make(value + step).evaluate(self.omega, state.x, jacobian=False)
        low = self.make(value - step).evaluate(self.omega, state.x, jacobian=False)
        return (high.residual - low.residual) / (2 * step)

    def say(self, value: float) -> str:
        """The value as it stands in a sentence; frequencies in Hz."""
        if self.name == FREQUENCY:
            return f"{value / (2 * np.pi):.6g} Hz"
        return f"{self.name} {value:.6g} {self.unit}".strip()


def of(problem: HarmonicBalance | Parameter) -> Parameter:
    """The parameter itself, or the frequency of a balance, whose curve recalls what its points asked for."""
    if isinstance(problem, Parameter):
        return problem
    recording = replace(problem, recalled=[])
    return Parameter(FREQUENCY, lambda _: recording, None)


def load(balance: HarmonicBalance, omega: float) -> Parameter:
    """Factor on the harmonics >= 1 of the excitation, at one frequency [rad/s]."""
    return Parameter(LOAD, balance.with_load, omega)


def gap(balance: HarmonicBalance, omega: float) -> Parameter:
    """Opening added to the gap of every pair alike [m], at one frequency [rad/s]."""
    initial = balance.contact.gap
    scale = _length(balance, omega)
    return Parameter("gap offset", lambda value: balance.with_gap(initial + value), omega, scale, "m")


def wear(balance: HarmonicBalance, omega: float, depth: np.ndarray) -> Parameter:
    """Fraction of a worn depth (n_pair,) [m] that is added to the gap, at one frequency [rad/s].

    Raises ValueError where the depth is zero everywhere"""
    depth = np.asarray(depth, float)
    deepest = float(np.abs(depth).max(initial=0.0))
    if deepest == 0.0:
        raise Refusal("the wear depth to continue in is zero at every pair: give the depth of a worn contact")
    initial = balance.contact.gap
    scale = _length(balance, omega) / deepest
    return Parameter("wear fraction", lambda value: balance.with_gap(initial + value * depth), omega, scale)


def stiffness(balance: HarmonicBalance, omega: float) -> Parameter:
    """Factor on all contact springs, at one frequency [rad/s]."""
    contact = balance.contact
    return Parameter(
        "stiffness factor",
        lambda value: balance.with_contact(
            contact.with_parameters(lambda p: replace(p, stiffness=value * p.stiffness))
        ),
        omega,
    )


def friction(balance: HarmonicBalance, omega: float) -> Parameter:
    """Factor on the limit of friction of every law that has one, at one frequency [rad/s].

    Raises ValueError where none has"""
    contact = balance.contact
    if not contact.has_friction:
        raise Refusal("no contact law here has a coefficient of friction to change")

    def make(value: float) -> HarmonicBalance:
        return balance.with_contact(contact.with_friction_scaled(value))

    return Parameter("friction factor", make, omega)


def _length(balance: HarmonicBalance, omega: float) -> float:
    """Typical displacement: the largest coefficient of the stuck response, or 1 m where there is none."""
    return float(np.abs(balance.x_lin(omega)).max()) or 1.0
