"""What a continuation steps in: the frequency, or any number that a balance can be made from.

A `Parameter` turns a value into a balance and the frequency to solve it at, and knows d R / d value at fixed x. Every
continuation takes either a balance (it then steps in frequency) or a Parameter."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State

FREQUENCY, LOAD = "frequency", "load factor"
DIFFERENCE_STEP = 1e-6  # of central differences: near the cube root of rounding


@dataclass(frozen=True)
class Parameter:
    """One number that a problem depends on.

    name : what it is called in results, such as "load factor"
    make : value -> balance
    omega : frequency at which the balance is solved [rad/s]; None where the value itself is the frequency"""

    name: str
    make: Callable[[float], HarmonicBalance]
    omega: float | None

    def place(self, value: float) -> tuple[HarmonicBalance, float]:
        """The balance and the frequency [rad/s] that belong to a value."""
        return self.make(value), value if self.omega is None else self.omega

    def slope(self, value: float, state: State) -> np.ndarray:
        """(n_contact, n_coeff) d R / d value at fixed x: closed form for the frequency, central difference else."""
        if self.omega is None:
            return self.make(value).frequency_slope(state)[0]
        high = self.make(value + DIFFERENCE_STEP).evaluate(self.omega, state.x, jacobian=False)
        low = self.make(value - DIFFERENCE_STEP).evaluate(self.omega, state.x, jacobian=False)
        return (high.residual - low.residual) / (2 * DIFFERENCE_STEP)

    def say(self, value: float) -> str:
        """The value as it stands in a sentence; frequencies in Hz."""
        if self.name == FREQUENCY:
            return f"{value / (2 * np.pi):.6g} Hz"
        return f"{self.name} {value:.6g}"


def of(problem: HarmonicBalance | Parameter) -> Parameter:
    """The parameter itself, or the frequency of a balance, whose curve recalls what its points asked for."""
    if isinstance(problem, Parameter):
        return problem
    recording = replace(problem, recalled=[])
    return Parameter(FREQUENCY, lambda _: recording, None)


def load(balance: HarmonicBalance, omega: float) -> Parameter:
    """Factor on the harmonics >= 1 of the excitation, at one frequency [rad/s]."""
    return Parameter(LOAD, balance.with_load, omega)
