"""Blades that differ: the balance of a whole wheel with contact on every blade, at the cost of its reduced sector.

Sectors differ in stiffness on a few shapes (`hbm.linear.mistuned_compliance`) and in any parameter of their contacts.
Rows of the contact and outputs "<name>@<sector>" are those of the whole wheel, sector by sector."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NoReturn, cast

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint, JointSet
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.mistuned_compliance import MistunedCompliance
from tribodyn.hbm.linear.nominal_wheel import NominalWheel
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.wave_model import WaveModel, as_wave
from tribodyn.refusal import Refusal

Change = Callable[[Joint, np.ndarray], Joint]
"""Makes the parameters of a joint of sectors that differ from its own and the sector (n_pair,) of each pair."""


@dataclass(frozen=True)
class MistunedModel(ReducedModel):
    """All sectors of a wheel whose blades differ: no harmonic has a system of its own."""

    has_one_system: ClassVar[bool] = False
    has_motion_in_time: ClassVar[bool] = False

    def at_harmonic(self, h: int) -> NoReturn:
        raise Refusal("sectors that differ have no system of one harmonic: stability and integration in time need one")


@dataclass(frozen=True)
class MistunedWheel:
    """Sectors nominal, ready to be made different.

    wave : balance of one sector under a travelling wave, whose model has the outputs `ports`, see
        `reduction.nominal_modes.with_ports`"""

    wave: HarmonicBalance
    ports: tuple[str, ...]

    @property
    def n_sectors(self) -> int:
        """Number of sectors."""
        return self.nominal.n_sectors

    @property
    def model(self) -> WaveModel:
        """The model of the wave."""
        return as_wave(self.wave.model)

    @cached_property
    def nominal(self) -> NominalWheel:
        """The linear side of sectors nominal, made once."""
        wave = self.wave
        return NominalWheel(self.model, wave.contact.stiffness, wave.basis, wave.excitation, wave.omega_max, self.ports)

    @cached_property
    def _model(self) -> MistunedModel:
        n, wave = self.n_sectors, self.model
        i = wave.interface
        faces = np.concatenate([i.faces + k * i.n_pair for k in range(n)])
        all_pairs = replace(
            i, points=np.tile(i.points, (n, 1)), frames=np.tile(i.frames, (n, 1, 1)), area=np.tile(i.area, n),
            gap=np.tile(i.gap, n), B=np.tile(np.asarray(i.B), (n, 1)), faces=faces,
        )  # fmt: skip
        return MistunedModel(wave.system, all_pairs, wave.origin, free_frequency=wave.free_frequency)

    def balance(self, deviation: np.ndarray, change: Change | None = None) -> HarmonicBalance:
        """The wheel with relative deviations (N,) of stiffness, and contacts that are the sector's or changed ones.

        Raises  Refusal for deviations that cannot be"""
        wave = self.wave
        # to a balance it is what a ContactCompliance is; what needs matrices of a harmonic is refused by the model
        compliance = cast(ContactCompliance, MistunedCompliance(self.nominal, wave.basis, deviation))
        joints = wave.contact.repeat(self.n_sectors)
        if change is not None:
            size = wave.contact.n_pair
            joints = tuple(change(joint, joint.rows // size) for joint in joints)
        contact = JointSet.of(self._model, joints)
        memory = np.tile(wave.memory, (self.n_sectors, 1))
        at_rest = None if wave.at_rest is None else np.tile(wave.at_rest, (self.n_sectors, 1))
        return HarmonicBalance(
            self._model, contact, wave.basis, wave.excitation, wave.omega_max, memory, compliance, wave.load_factor,
            at_rest,
        )  # fmt: skip
