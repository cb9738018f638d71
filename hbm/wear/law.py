"""Wear laws: what a law file sees and offers, and how it is found by its name.

A law is a module `hbm/wear/<name>.py`, or a file of one's own, with `depth_rate(exposure) -> (n_pair,)`: total wear
depth of each pair per vibration cycle [m], the sum over both surfaces. Its own numbers, such as a wear coefficient, it
declares in `class Parameters` with their units, see `tribodyn.declarations`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tribodyn import declarations
from tribodyn.hbm.balance import ROUNDING
from tribodyn.hbm.contact.aging import Aging, EnergyByDepth, NumberTable
from tribodyn.plugins import PluginKind
from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.hbm.balance import HarmonicBalance, State
    from tribodyn.hbm.contact.joint import Joint
    from tribodyn.hbm.time.time_integration import PeriodicMotion


@dataclass(frozen=True)
class JointWear:
    """How a joint wears.

    law : name of a wear law, or path of its file
    numbers : the law's own before any wear, scalars or (n_pair,) of the joint, in the units that the law declares
    tables : how they change with wear, by their names"""

    law: str
    numbers: Mapping[str, np.ndarray | float]
    tables: Mapping[str, NumberTable] = field(default_factory=dict)

    @classmethod
    def of(cls, law: str, **numbers: np.ndarray | float) -> JointWear:
        """A wear law with its numbers, such as coefficient=2e-15.

        Raises  ValueError where there is no such law, or a number is missing, unknown or out of its limits"""
        values = declarations.complete(declared(law), numbers, f"wear law '{Path(law).stem}'")
        return cls(law, values)

    @property
    def energy(self) -> EnergyByDepth:
        """Friction work per area by depth.

        Raises  Refusal where the law is not that of energy, or its coefficient goes with the depth"""
        table = self.tables.get("coefficient")
        if self.law != "energy" or (table is not None and table.over == "depth"):
            raise Refusal(
                'over = "energy_density" needs the wear law energy with a constant coefficient or one over '
                'energy_density, which tell the work from the depth: give over = "depth"'
            )
        return EnergyByDepth(float(np.mean(self.numbers["coefficient"])), table)

    def at(self, depth: np.ndarray) -> dict[str, np.ndarray | float]:
        """The numbers of pairs worn by a depth (n_pair,) [m]."""
        by_energy = any(table.over == "energy_density" for table in self.tables.values())
        aging = Aging(self.tables, self.energy if by_energy else None)
        return {**self.numbers, **{name: self.numbers[name] * f for name, f in aging.factors(depth).items()}}


@dataclass(frozen=True)
class Exposure:
    """One vibration cycle as a wear law sees it.

    solved : the state, or what forms it
    The law serves one joint; n_pair counts the pairs of that joint.
    area : (n_pair,) tributary area [m2]; numbers : the law's own by name, each (n_pair,)
    depth : (n_pair,) wear depth so far [m]; cycles : vibration cycles so far
    on : name of the joint, the first one by default
    motion : in time, of which this is one period and `state` its part in the balance's harmonics; None for a cycle of
        the balance"""

    balance: HarmonicBalance
    solved: State | Callable[[], State]
    area: np.ndarray
    numbers: Mapping[str, np.ndarray]
    depth: np.ndarray
    cycles: float
    on: str = ""
    motion: PeriodicMotion | None = None

    @cached_property
    def state(self) -> State:
        """The cycle in the balance's harmonics; of a motion in time formed when a law asks for it."""
        return self.solved() if callable(self.solved) else self.solved

    @property
    def joint(self) -> Joint:
        """The joint that wears."""
        contact = self.balance.contact
        return contact.joint(self.on) if self.on else contact.joints[0]

    @property
    def components(self) -> tuple[str, ...]:
        """The components that the joint's contact law sees, in the order t1, t2, n."""
        return self.joint.parameters.components

    @cached_property
    def energy(self) -> np.ndarray:
        """(n_pair,) friction work over the cycle, both tangential directions [J]; rounding below zero is cut off."""
        energy = self.balance.energy(self.state) if self.motion is None else self.motion.energy
        return np.maximum(energy[self.joint.rows], 0.0)

    @property
    def status(self) -> np.ndarray:
        """(n_pair,) bits of what happened in the cycle, see `hbm.contact.contact_law`."""
        return (self.state.cycle if self.motion is None else self.motion).status[self.joint.rows]

    @cached_property
    def history(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] and contact force [N] over the cycle, both (n_pair, n_component, n_samples)."""
        balance, motion = self.balance, self.motion
        if motion is not None:
            at = np.ix_(self.joint.rows, balance.contact.columns(self.joint))
            return motion.x[at], motion.force[at]
        return balance.contact.history_of(self.joint, self.state.x, balance.basis, balance.memory, self.state.omega)

    @cached_property
    def normal_force_times_slip(self) -> np.ndarray:
        """(n_pair,) integral of N |ds| over the cycle, s the slip path in the contact plane [J]."""
        if "n" not in self.components:
            raise Refusal("a wear law that needs the normal force cannot serve a contact without a normal component")
        slider, normal, travel = self._sliders()
        step = np.linalg.norm(np.roll(slider, -1, axis=3) - slider, axis=2)
        step[step <= ROUNDING * travel[:, None, None]] = 0.0  # of a pair that sticks
        # geometric mean: a slider that moved while the pair was apart carried no load on the way
        return np.sum(np.sqrt(normal * np.roll(normal, -1, axis=2)) * step, axis=(1, 2))

    def _sliders(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (n_pair, n_slider, n_tangential, n_samples) [m], loads (n_pair, n_slider, n_samples) [N], and size
        of the displacement (n_pair,) [m]."""
        joint, balance, t = self.joint, self.balance, self.components.index("n")
        if hasattr(joint.module, "slider_positions"):
            x_joint = self.state.x[np.ix_(joint.rows, balance.contact.columns(joint))]
            memory = balance.memory[joint.rows, : joint.n_state]
            slider, normal = joint.module.slider_positions(x_joint, joint.parameters, memory, balance.basis)
            return slider, normal, np.abs(x_joint[:, :t]).sum(axis=(1, 2))
        x, f = self.history
        k = joint.parameters.stiffness[:, :t, None]
        slider = x[:, :t] - np.divide(f[:, :t], k, out=np.zeros_like(f[:, :t]), where=k > 0)
        return slider[:, None], np.maximum(f[:, None, t], 0.0), np.abs(x[:, :t]).max(axis=(1, 2), initial=0.0)


KIND = PluginKind("wear law", "tribodyn.hbm.wear.laws", ("depth_rate",))
names, file_of, load, declared = KIND.names, KIND.file_of, KIND.load, KIND.declared


def depth_rate(name: str, exposure: Exposure) -> np.ndarray:
    """What the law of this name says of a cycle: (n_pair,) wear depth per cycle [m].

    Raises  ValueError where a law of one's own cannot be run or says what is no depth of every pair"""
    law = load(name)
    if not name.endswith(".py"):
        return np.asarray(law.depth_rate(exposure))
    try:
        rate = np.asarray(law.depth_rate(exposure), float)
    except Exception as error:  # of a file of one's own: it may be anything
        raise Refusal(f"wear law file '{name}' cannot be run: {type(error).__name__}: {error}") from error
    if rate.shape != exposure.area.shape:
        raise Refusal(f"wear law file '{name}' gives depths of shape {rate.shape} and not {exposure.area.shape}")
    if np.isfinite(exposure.energy).all() and not np.isfinite(rate).all():
        raise Refusal(f"wear law file '{name}' gives depths that are not finite")
    return rate
