"""Two bodies, one of which is held at a height that harmonic 0 prescribes and presses on the other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.fem.interface import COMPONENTS, ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.model import ReducedModel

N_PAIR = 3
PLATFORM = np.array([21, 22])  # coordinates of body 2 that are held
OMEGA = 2 * np.pi * 47.0


def two_bodies(seed: int = 3) -> ReducedModel:
    """A chain of masses in three dimensions on springs, and above it a second one; three node pairs between them.

    Body 1 is held by springs, body 2 only sideways and, in the direction of its height, by springs of 4e5 N/m at
    coordinates 21 and 22."""
    random = np.random.default_rng(seed)
    n1, n2 = 12, 12
    n = n1 + n2

    def body(size: int) -> np.ndarray:
        root = random.normal(size=(size, size))
        return root @ root.T / size

    M = np.zeros((n, n))
    M[:n1, :n1], M[n1:, n1:] = np.eye(n1) + 0.2 * body(n1), np.eye(n2) + 0.2 * body(n2)
    K = np.zeros((n, n))
    K[:n1, :n1] = 2e5 * (body(n1) + 0.3 * np.eye(n1))
    rise = np.zeros(n2)  # rigid motion of body 2 along the contact normal and its height
    rise[[2, 5, 8]] = 1.0
    rise[[9, 10]] = 1.0
    stiff = 4e5 * (body(n2) + 0.3 * np.eye(n2))
    keep = np.eye(n2) - np.outer(rise, rise) / (rise @ rise)
    K[n1:, n1:] = keep @ stiff @ keep  # no force resists the rise but the support
    K[PLATFORM, PLATFORM] += 4e5
    B = np.zeros((3 * N_PAIR, n))
    B[np.arange(9), np.arange(9)] = 1.0
    B[np.arange(9), n1 + np.arange(9)] = -1.0
    B[2::3] *= -1.0  # body 1 approaches along -z
    loads = {"shaker": np.eye(n)[9]}
    system = SecondOrderSystem(M, K, None, loads, {"tip": np.eye(n)[10]})
    system = replace(system, damping=modal_damping(system, 0.02))
    interface = ContactInterface(
        COMPONENTS, np.zeros((N_PAIR, 3)), np.tile(np.eye(3), (N_PAIR, 1, 1)), np.array([1.0, 2.0, 1.0]),
        np.zeros(N_PAIR), B, np.zeros((0, 4), int),
    )  # fmt: skip
    return ReducedModel(system, interface)


def problem(
    model: ReducedModel,
    height: float,
    force: float,
    gap: Sequence[float] = (0.0, 1e-5, -1e-5),
    harmonics: tuple[int, ...] = (0, 1, 2, 3),
    friction: float = 0.4,
) -> HarmonicBalance:
    """Their contact under a shaker force [N], at a height [m]."""
    parameters = ContactParameters.of(
        COMPONENTS, np.full((N_PAIR, 3), 3e5), friction=friction, gap=np.asarray(gap, float)
    )
    excitation = Excitation.of({"height": height}, {1: {"shaker": force}})
    return HarmonicBalance.of(
        model, Joint("contact", "jenkins", parameters), HarmonicBasis(harmonics, 128), excitation, 2 * OMEGA
    )
