"""Wear of rough faces: a rigid block that slides on five of them, beside its differential equation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import rest
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.asperity import asperity
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.reduction.model import ReducedModel

YOUNG, POISSON, RADIUS, MU, YIELD, TANGENT = 192.31e9, 0.3, 1.36493e-3, 0.3, 331.7e6, 620e6
E_STAR = YOUNG / (2 * (1 - POISSON**2))
RATIO = 2 * (1 - POISSON) / (2 - POISSON)
GAP = np.array([0.0, 0.2, 0.4, 0.7, 1.6]) * 1e-6  # the last face does not touch at first
LOAD, COUNT, AREA, WEAR = 200.0, 8, 1e-6, 1e-13  # N, asperities of a face, m2, m3/J


def block() -> HarmonicBalance:
    """A block of 1 kg on all faces at once, asperities of one height, pressed without friction."""
    system = SecondOrderSystem(
        np.eye(2), np.diag([2.01e8, 0.0]), None, {"press": np.array([0.0, 1.0]), "shake": np.array([1.0, 0.0])},
        {"tip": np.array([1.0, 0.0])},
    )  # fmt: skip
    model = ReducedModel(system, interface(np.tile(np.eye(2), (len(GAP), 1)), ("t1", "n")))
    parameters = ContactParameters.of(
        ("t1", "n"), np.full((len(GAP), 2), 1e7), gap=GAP, table=[[0.0, COUNT / AREA]], area=AREA, friction=MU,
        young=YOUNG, poisson=POISSON, radius=RADIUS, deepest=4e-6, yield_stress=YIELD, tangent_modulus=TANGENT,
    )  # fmt: skip
    basis = HarmonicBasis((0, 1), 256)
    excitation = Excitation.of({"press": LOAD}, {1: {"shake": 6000.0}})
    built = HarmonicBalance.of(model, Joint("contact", "rough", parameters), basis, excitation, 1500.0)
    at_rest = rest.displacement(built)
    return replace(built.with_memory(rest.memory(built, at_rest)), at_rest=at_rest)


def test_a_sliding_block_wears_as_its_differential_equation_says() -> None:
    """dw/dZ = WEAR 4 N (X - 0.8 MU d / RATIO) / A, Hertzian asperities that keep the shape the preload gave them.

    The springs of a Hertzian contact carry N d' at depths d' whose mean, weighted with N, is 0.8 d; each slips by the
    swing X less MU d' / RATIO, four times in a cycle."""
    balance = block()
    base = asperity((YOUNG, POISSON, RADIUS, YIELD, TANGENT))
    preloaded = np.maximum(balance.at_rest[:, 1] - GAP, 0.0)
    duty, law = Duty(AtFrequency("tip", 1000.0)), JointWear.of("archard", coefficient=WEAR)
    problem = WearProblem(balance, (duty,), law, np.full(len(GAP), AREA))
    worn = evolve(error_controlled.Rule(problem, Tolerance(0.02, 1e-6)), 14)
    swing = worn.amplitude[0]
    assert worn.amplitude == pytest.approx(swing, rel=1e-3)  # the friction of all faces together does not change

    def forces(z: float, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Depths of the Hertzian contacts [m] and what their faces carry [N]."""
        depth = np.maximum(z - GAP - w, 0.0)
        offset, root = base.flattened(np.maximum(preloaded, depth))
        d = np.maximum(depth - offset, 0.0)
        return d, COUNT * 4 / 3 * E_STAR * root * d**1.5

    def rate(_: float, w: np.ndarray) -> np.ndarray:
        z = brentq(lambda z: forces(z, w)[1].sum() - LOAD, 0.0, 9e-6, xtol=1e-17, rtol=1e-13)
        d, N = forces(z, w)
        return WEAR * 4 * N * (swing - 0.8 * MU * d / RATIO) / AREA

    expected = solve_ivp(rate, (0, worn.cycles[-1]), 0 * GAP, t_eval=worn.cycles, rtol=1e-7, atol=1e-13).y.T
    assert worn.depth == pytest.approx(expected, rel=0, abs=1e-3 * expected.max())
    assert worn.depth[-1].max() > 1.5e-6
    assert worn.normal_force[0, -1] < 2.0
    assert np.ptp(worn.normal_force[-1]) < 0.3 * np.ptp(worn.normal_force[0])  # all wear alike in the end
