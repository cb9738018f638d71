"""A parameter of a balance, as the inputs of the balance a step above and a step below it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.excitation import Excitation
from tribodyn.reduction.model import ReducedModel


@dataclass(frozen=True)
class BalanceInputs:
    """What a parameter can change of a balance.

    memory : start of the load path; balance : built from these inputs, where there is one
    same_coordinates : whether the coordinates are those of the solved balance, even with another contact map"""

    model: ReducedModel
    contact: JointSet
    excitation: Excitation
    memory: np.ndarray
    balance: HarmonicBalance | None = None
    same_coordinates: bool = False

    @classmethod
    def of(cls, balance: HarmonicBalance) -> BalanceInputs:
        """Those of a balance."""
        return cls(balance.model, balance.contact, balance.excitation, balance.memory)


@dataclass(frozen=True)
class ParameterChange:
    """A parameter p: the inputs a step above and a step below it.

    double_step : where p acts on the structure, the inputs by two steps, for a difference of order four, which a
        structure near its own resonance needs; empty where the model is linear in p, without corners; None elsewhere
    contact_part : what p changes of the contact besides, whose forces have corners, by a smaller step"""

    name: str
    step: float
    above: BalanceInputs
    below: BalanceInputs
    double_step: tuple[BalanceInputs, ...] | None = None
    contact_part: ParameterChange | None = None
