"""A small body with four pairs that a static load presses and a harmonic one shakes, and its wear problem."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import scipy.linalg as sla

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.reduction.model import ReducedModel

N_PAIR = 4


@cache
def pressed_body() -> ReducedModel:
    """The model, with a full damping matrix."""
    rng = np.random.default_rng(3)
    n = 3 * N_PAIR + 60
    factor = rng.normal(size=(n, n))
    stiffness = 2e6 * factor @ factor.T / n + 1e5 * np.eye(n)
    mass = np.eye(n) + 0.1 * np.diag(rng.random(n))
    lam, phi = sla.eigh(stiffness, mass)
    damping = mass @ phi @ np.diag(2 * 0.02 * np.sqrt(lam)) @ phi.T @ mass
    press, shake = np.zeros(n), np.zeros(n)
    press[2 : 3 * N_PAIR : 3] = 1 / N_PAIR
    shake[0 : 3 * N_PAIR : 3] = 1 / N_PAIR
    system = SecondOrderSystem(mass, stiffness, damping, {"press": press, "shake": shake}, {"tip": shake})
    return ReducedModel(system, interface(np.eye(3 * N_PAIR, n), ("t1", "t2", "n")))


def balance_of(model: ReducedModel, harmonics: tuple[int, ...] = (0, 1, 2, 3), shake: float = 60.0) -> HarmonicBalance:
    stiffness = np.tile([2e5, 2e5, 3e5], (N_PAIR, 1)) * np.linspace(0.7, 1.3, N_PAIR)[:, None]
    parameters = ContactParameters.of(("t1", "t2", "n"), stiffness, friction=0.4)
    basis = HarmonicBasis(harmonics, 64, "located")
    excitation = Excitation.of({"press": 100.0}, {1: {"shake": shake}})
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 1500.0)


def wear_problem(**changes: object) -> WearProblem:
    """Its wear at a fixed frequency with harmonics 0 and 1, until 1 % of the preload is left."""
    inputs: dict = {
        "balance": balance_of(pressed_body(), (0, 1)),
        "mission": (Duty(AtFrequency("tip", 420.0)),),
        "wear": JointWear.of("energy", coefficient=1e-9),
        "area": np.full(N_PAIR, 1e-4),
        "lost_below": 0.01,
    }
    return WearProblem(**(inputs | changes))


def with_factor(balance: HarmonicBalance, name: str, factor: float) -> HarmonicBalance:
    """The balance with a spring or a number of its law times a factor; gaps open by (factor - 1) 0.1 mm."""

    def changed(p: ContactParameters) -> ContactParameters:
        springs = [factor if name == of else 1.0 for of in ("t1", "t2", "n")]
        numbers = {of: factor * value if name == of else value for of, value in p.numbers.items()}
        return replace(p, numbers=numbers, stiffness=p.stiffness * np.array(springs))

    if name == "gap":
        return balance.with_gap(balance.contact.gap + 1e-4 * (factor - 1))
    return balance.with_contact(balance.contact.with_parameters(changed))


@contextmanager
def growth_by_few_modes() -> Iterator[None]:
    """Hill's method with four modes instead of twenty and more: most of a wear run's time on so small a body."""
    with patch.object(exponents, "RULES", replace(exponents.RULES, fewest_modes=4, most_modes=4)):
        yield


def life(worn: WearHistory, share: float = 0.02) -> float:
    """Cycles to a share of the first preload."""
    result = cycles_to_preload(worn, share)
    assert result is not None
    return result
