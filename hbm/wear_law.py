"""Wear laws: what a law file sees and offers, and how it is found by its name.

A law is a module `hbm/wear/<name>.py` with `depth_rate(exposure) -> (n_pair,)`: total wear depth of each pair per
vibration cycle [m]. Depth is the sum over both surfaces; `Exposure.coefficient` carries the unit that the law states.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

import hbm.wear
from hbm import aft
from hbm.balance import HarmonicBalance, State


@dataclass(frozen=True)
class Exposure:
    """One vibration cycle as a wear law sees it.

    area : (n_pair,) tributary area [m2]; coefficient : (n_pair,) wear coefficient of the law
    depth : (n_pair,) wear depth so far [m]; cycles : vibration cycles so far
    """

    balance: HarmonicBalance
    state: State
    area: np.ndarray
    coefficient: np.ndarray
    depth: np.ndarray
    cycles: float

    @cached_property
    def energy(self) -> np.ndarray:
        """(n_pair,) friction work over the cycle, both tangential directions [J]; rounding below zero is cut off."""
        return np.maximum(self.balance.energy(self.state), 0.0)

    @cached_property
    def normal_force_times_slip(self) -> np.ndarray:
        """(n_pair,) integral of N |ds| over the cycle, s the slip path in the contact plane [J]."""
        parameters, basis = self.balance.parameters, self.balance.basis
        if "n" not in parameters.components:
            raise ValueError("a wear law that needs the normal force cannot serve a contact without a normal component")
        x, f = aft.history(self.balance.law, self.state.x, parameters, basis, self.balance.memory)
        t = parameters.components.index("n")
        k = parameters.stiffness[:, :t, None]
        slider = x[:, :t] - np.divide(f[:, :t], k, out=np.zeros_like(f[:, :t]), where=k > 0)
        step = np.linalg.norm(np.roll(slider, -1, axis=2) - slider, axis=1)
        # geometric mean: a slider that moved while the pair was apart carried no load on the way
        normal = np.sqrt(np.maximum(f[:, t] * np.roll(f[:, t], -1, axis=1), 0.0))
        return np.sum(normal * step, axis=1)


def names() -> list[str]:
    """Names of the wear laws there are."""
    return sorted(m.name for m in pkgutil.iter_modules(hbm.wear.__path__) if not m.name.startswith("_"))


def load(name: str) -> ModuleType:
    """The wear law of this name; raises ValueError with the known names."""
    if name not in names():
        raise ValueError(f"no wear law '{name}': there are {', '.join(names())}")
    return importlib.import_module(f"hbm.wear.{name}")
