"""A wheel of five sectors with four degrees of freedom each, small enough for its monodromy matrix."""

import numpy as np

from tribodyn.fem.cyclic_symmetry import Sector
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.geometry.placement import rotation
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.travelling_wave import on_wheel
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.model import ReductionBasis
from tribodyn.reduction.sector_reduction import ReducedSector
from tribodyn.reduction.wave_model import travelling_wave, wheel_model

N = 5
NONE = np.empty((0, 3), dtype=int)


def sector(components: tuple[str, ...], turning: float = 0.0, n_sectors: int = N) -> ReducedSector:
    """Two faces that move along t1 and n, joined by springs; the right one meets the left one of the next sector.

    turning : Coriolis matrix entry [N s/m]"""
    ground, between = np.diag([1.0e4, 1.6e4, 0.9e4, 1.4e4]), np.array([[8e3, 1.5e3], [1.5e3, 1.2e4]])
    stiffness = ground + np.block([[between, -between], [-between, between]])
    loads = {"shaker": np.array([1.0, 0.3, 0.0, 0.0])}
    outputs = {"tip": np.array([1.0, 0.0, 0.0, 0.0]), "side": np.array([0.0, 0.0, 0.0, 1.0])}
    swirl = np.kron(np.eye(2), np.array([[0.0, -turning], [turning, 0.0]]))
    system = SecondOrderSystem(np.eye(4), stiffness, None, loads, outputs, swirl if turning else None)
    columns = [("t1", "n").index(name) for name in components]
    right, remaining = np.eye(4)[columns], np.eye(4)[[2 + column for column in columns]]
    interface = ContactInterface(
        points=np.zeros((1, 3)), frames=np.eye(3)[None], area=np.ones(1), gap=np.zeros(1), B=right,
        components=components, faces=np.zeros((1, 1), int),
    )  # fmt: skip
    turn = rotation((1, 0, 0), 2 * np.pi / n_sectors)
    full = Sector(system, interface, remaining, NONE, NONE, turn, n_sectors, {"contact": slice(0, 1)})
    return ReducedSector(full, ReductionBasis(np.eye(4), np.zeros(0, int), 0, "", np.inf))


def wave_and_wheel(
    reduced: ReducedSector,
    law: str,
    order: int,
    harmonics: tuple[int, ...],
    force: float,
    damping: float = 0.01,
    gap: float = -2e-3,
    samples: int = 256,
    **numbers: float,
) -> tuple[HarmonicBalance, HarmonicBalance]:
    """One problem twice: a sector under a travelling wave, and the whole wheel; contact pressed by interference."""
    load = Excitation.of({}, {1: {"shaker": force}})
    item, wheel = travelling_wave(reduced, order), wheel_model(reduced)
    item, wheel = (model.with_damping(lambda system, B: modal_damping(system, damping)) for model in (item, wheel))
    basis = HarmonicBasis(harmonics, samples, "located")
    components = reduced.sector.interface.components
    k = [4e3 if name == "t1" else 6e3 for name in components]

    def balance(model, copies, loads):
        contact = ContactParameters.of(components, np.tile(k, (copies, 1)), gap=gap, **numbers)
        return HarmonicBalance.of(model, Joint("contact", law, contact), basis, loads, 400.0)

    n = reduced.sector.n_sectors
    return balance(item, 1, load), balance(wheel, n, on_wheel(load, order, n))


def spread(wheel: HarmonicBalance, coefficients: np.ndarray, order: int, n_sectors: int = N) -> np.ndarray:
    """Coefficients (n, ..., n_coeff) of every sector from those of sector 0 (..., n_coeff)."""
    return np.stack(
        [wheel.basis.shift(coefficients, -2 * np.pi * (order * n % n_sectors) / n_sectors) for n in range(n_sectors)]
    )
