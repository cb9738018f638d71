"""What wears: the contact with its wear laws, and the mission whose cycles wear it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_condition import OperatingCondition
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.wear.law import JointWear
from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.hbm.wear.wear_state import WearState


@dataclass(frozen=True)
class Duty:
    """A part of the mission: `share` of all cycles run at `site`, with the harmonic loads times `load`.

    balance : its own unworn problem over the same contact, as at another speed of rotation; None for the common one
    start : frequency [rad/s] and x (n_pair, n_component, n_coeff) [m] beside its unworn cycle; looked for where None"""

    site: OperatingCondition
    share: float = 1.0
    load: float = 1.0
    balance: HarmonicBalance | None = None
    start: tuple[float, np.ndarray] | None = None

    def first(self, balance: HarmonicBalance) -> OperatingPoint:
        """The cycle without a neighbouring state."""
        if self.start is None:
            return self.site.solve(balance)
        point = self.site.solve_near(balance, *self.start)
        return point if point.solution.converged else self.site.solve(balance)


@dataclass(frozen=True)
class WearProblem:
    """What wears, where the cycles are taken, and by which law.

    balance : the unworn problem; mission : its duties, whose shares sum to one
    wear : how the joints wear, by name; a joint that is not there does not wear. One alone serves all joints
    area : (n_pair,) [m2], of all joints
    lost_below : contact counts as lost when the preload falls below this share of its first value; the last touch
        of a vibrating contact wears ever more slowly, so that the time until it ends has no limit (see README)
    any_joint : whether a single joint whose preload has fallen below that share ends the run
    lost_below_at_rest : the run ends when the preload without the harmonic loads falls to this share of its first
        value, see hbm.wear.preload_at_rest; None: it is not looked at"""

    balance: HarmonicBalance
    mission: tuple[Duty, ...]
    wear: JointWear | Mapping[str, JointWear]
    area: np.ndarray
    lost_below: float = 0.0
    lost_below_at_rest: float | None = None
    any_joint: bool = False

    def __post_init__(self) -> None:
        shares = [duty.share for duty in self.mission]
        if not self.mission or min(shares) < 0 or abs(sum(shares) - 1) > 1e-9:
            raise Refusal(f"the shares of the mission's duties must be >= 0 and sum to 1, not {shares}")
        for duty in self.mission:
            duty_balance = self.balance if duty.balance is None else duty.balance
            if duty_balance.basis != self.balance.basis or duty_balance.contact.n_pair != self.balance.contact.n_pair:
                raise Refusal("every duty of a mission needs the same contact pairs and harmonics")
        if not self.wearing:
            raise Refusal("no joint wears: give at least one of them a wear law")
        if self.lost_below_at_rest is not None and (
            "n" not in self.balance.contact.components or not self.balance.basis.has_static
        ):
            raise Refusal("the preload at rest needs a contact with component n and harmonic 0 among those kept")

    @cached_property
    def wearing(self) -> dict[str, JointWear]:
        """The joints that wear."""
        joints = self.balance.contact.joints
        if isinstance(self.wear, JointWear):
            return {joint.name: self.wear for joint in joints}
        return {self.balance.contact.joint(name).name: wear for name, wear in self.wear.items()}

    def numbers(self, joint: str) -> dict[str, np.ndarray]:
        """The own numbers of a joint's wear law, each (n_pair,) of the joint."""
        n = len(self.balance.contact.joint(joint).rows)
        declared = self.wearing[joint].numbers
        return {name: np.array(np.broadcast_to(np.asarray(v, float), (n,))) for name, v in declared.items()}

    @cached_property
    def pairs(self) -> np.ndarray:
        """Indices of the pairs of the joints that wear."""
        return np.sort(np.concatenate([self.balance.contact.joint(name).rows for name in self.wearing]))

    def preload_of(self, state: WearState) -> float:
        """Mean normal force of the joints that wear in the first duty of a state [N]."""
        return float(self.normal_force(state)[self.pairs].sum())

    def normal_force(self, state: WearState) -> np.ndarray:
        """(n_pair,) mean normal force in the first duty of a state [N]."""
        return self.balance.normal_force(state.points[0].state) if state.means is None else state.means.normal_force

    def in_duty(self, duty: Duty, depth: np.ndarray | None = None) -> HarmonicBalance:
        """The problem of a duty with its loads, worn by a depth (n_pair,) [m]; unworn by default."""
        unworn = self.balance if duty.balance is None else duty.balance
        worn = unworn if depth is None else unworn.with_gap(unworn.contact.gap + depth)
        return worn.with_load(duty.load)
