"""What a number of a run is computed from: a solved cycle, a motion in time, a worn contact, a response curve."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.fatigue import PlaceFatigue, StressOverCycle, StressPlace
from tribodyn.hbm.harmonics import HarmonicBasis, amplitude
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, events

if TYPE_CHECKING:
    from tribodyn.hbm.balance import HarmonicBalance, State
    from tribodyn.hbm.time.mean_motion import MeanMotion

Pairs = slice | np.ndarray


@dataclass(frozen=True)
class SolvedCycle:
    """One vibration cycle: fresh from a balance, or as a result holds it; what a result lacks is None or empty.

    omega : [rad/s]; basis : its harmonics; output : row of the observed output in `response` (n_output, n_coeff) [m]
    amplitude : of that output [m]; preload : mean normal force of the contact [N]
    energy, normal_force : (n_pair,) friction work per cycle [J], mean normal force [N]
    displacement, force : (n_pair, n_component, n_coeff) [m], [N]; components : of the contact, such as t1, t2, n
    joints : name -> its pairs; pairs : that the cycle is asked of, those of one joint or all
    driven : lowest harmonic that is driven; wear_coefficient : (n_pair,) [m3/J]
    places : of the part whose stress is asked for, all or one; whole : computes the stress of all nodes
    area : (n_pair,) of the pairs, where stress is asked for [m2]"""

    omega: float
    basis: HarmonicBasis
    response: np.ndarray
    amplitude: float
    output: int = 0
    preload: float | None = None
    energy: np.ndarray | None = None
    normal_force: np.ndarray | None = None
    displacement: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)))
    force: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)))
    components: tuple[str, ...] = ()
    joints: Mapping[str, Pairs] = field(default_factory=dict)
    pairs: Pairs = field(default_factory=lambda: slice(None))
    joint: str = ""
    driven: int | None = None
    wear_coefficient: np.ndarray | None = None
    places: tuple[StressPlace, ...] = ()
    whole: Callable[[], StressOverCycle] | None = None
    area: np.ndarray | None = None

    @classmethod
    def of(
        cls, balance: HarmonicBalance, state: State, output: str, wear: Mapping[str, float] | None = None
    ) -> SolvedCycle:
        """The cycle of a solved balance; wear : joint -> wear coefficient [m3/J]."""
        contact, basis, response = balance.contact, balance.basis, balance.outputs(state)
        row = balance.compliance.output_names.index(output)
        loaded = [h for h, _ in balance.excitation.loads if h in basis.dynamic] or [basis.dynamic[0]]
        rate, stress = None, balance.stress
        if wear:
            rate = np.zeros(contact.n_pair)
            for joint in contact.joints:
                rate[joint.rows] = wear.get(joint.name, 0.0)
        return cls(
            state.omega, basis, response, float(amplitude(response[row], basis.harmonics)), row, balance.preload(state),
            balance.energy(state), balance.normal_force(state), state.x, state.cycle.force, contact.components,
            {joint.name: joint.rows for joint in contact.joints}, driven=min(loaded), wear_coefficient=rate,
            places=balance.places,
            whole=cache(lambda: stress.of_state(balance, state)) if stress is not None and stress.is_searched else None,
            area=balance.model.interface.area,
        )  # fmt: skip

    @classmethod
    def at_row(
        cls, history: WearHistory, row: int, basis: HarmonicBasis, joints: Mapping[str, slice],
        places: tuple[StressPlace, ...] = (),
    ) -> SolvedCycle:  # fmt: skip
        """The cycle of a row of a wear history; its displacement and force are left out."""
        return cls(
            float(history.omega[row]), basis, history.response[row], float(history.amplitude[row]), 0,
            float(history.preload[row]), history.energy[row], history.normal_force[row], joints=joints, places=places,
        )  # fmt: skip

    @classmethod
    def at_point(
        cls, branch: Branch, point: int, basis: HarmonicBasis, places: tuple[StressPlace, ...] = ()
    ) -> SolvedCycle:
        """The cycle of a point of a response curve, of its first output."""
        height = float(branch.amplitude(branch.output_names[0])[point])
        return cls(float(branch.omega[point]), basis, branch.response[point], height, places=places)

    def of_joint(self, name: str) -> SolvedCycle:
        """The same cycle, asked of one joint alone."""
        return replace(self, pairs=self.joints[name], joint=name)

    def of_place(self, name: str) -> SolvedCycle:
        """The same cycle, asked of one place alone."""
        return replace(self, places=tuple(place for place in self.places if place.name == name))

    def largest_of_pairs(self, numbers: Callable[[StressOverCycle], np.ndarray]) -> dict[int, float]:
        """The node at the pair with the largest of some numbers (n_pair,) -> it; none where stress is not asked for."""
        stress = None if self.whole is None else self.whole()
        pairs = np.arange(0 if stress is None else len(stress.tension))[self.pairs]
        if stress is None or not len(pairs):
            return {}
        of_pairs = numbers(stress)
        best = pairs[of_pairs[pairs].argmax()]
        return {int(stress.face_node[best]): float(of_pairs[best])}

    @cached_property
    def mask(self) -> np.ndarray:
        """(n_pair, 1, 1) 1 for the pairs that the cycle is asked of, else 0."""
        mask = np.zeros((len(self.displacement), 1, 1))
        mask[self.pairs] = 1.0
        return mask


@dataclass(frozen=True)
class Slopes:
    """How a quantity of a cycle moves with the solution.

    by_x, by_force : (n_pair, n_component, n_coeff) by displacement and by contact force, the others fixed
    by_response : (n_output, n_coeff); None where it does not depend on one of these
    by_omega : by the frequency [rad/s]"""

    by_x: np.ndarray | None = None
    by_force: np.ndarray | None = None
    by_response: np.ndarray | None = None
    by_omega: float = 0.0


@dataclass(frozen=True)
class MotionInTime:
    """The motion that integration in time came to.

    means : over its periods; sectors : of the wheel that it spans, 1 for a part
    energy : (n_pair,) friction work per period of one sector [J]; least_energy : below which work is rounding [J]"""

    means: MeanMotion
    sectors: int
    energy: np.ndarray
    least_energy: float


@dataclass(frozen=True)
class WornContact:
    """A wear history with the contact that wore.

    area, gap : (n_pair,) [m2], of the unworn contact [m]; components, joints, pairs : as in SolvedCycle
    basis : harmonics, with samples enough to see a pair open
    life_share : of the first preload, where a life ends; any_joint : whether it ends with the first joint that is lost
    share_of_body_1 : of the depth, that is worn off body 1
    row : of the history, whose state is asked for; None for the end of the run
    places : of the part whose stress is asked for; shares : of the cycles, of the duties of the mission"""

    history: WearHistory
    area: np.ndarray
    gap: np.ndarray
    components: tuple[str, ...]
    basis: HarmonicBasis
    joints: Mapping[str, slice]
    life_share: float = LIFE_SHARE
    any_joint: bool = False
    share_of_body_1: float = 0.5
    pairs: slice = field(default_factory=lambda: slice(None))
    joint: str = ""
    row: int | None = None
    places: tuple[StressPlace, ...] = ()
    shares: tuple[float, ...] = (1.0,)

    def of_joint(self, name: str) -> WornContact:
        """The same wear, asked of one joint alone."""
        return replace(self, pairs=self.joints[name], joint=name)

    @cached_property
    def depth(self) -> np.ndarray:
        """(n_pair,) total depth of the pairs that are asked for [m]."""
        history = self.history
        return np.asarray(history.depth[-1 if self.row is None else self.row])[self.pairs]

    @property
    def work(self) -> np.ndarray:
        """(n_step, n_pair) friction work of the steps, of the pairs that are asked for [J]."""
        return np.asarray(self.history.work[: -1 if self.row is None else self.row, self.pairs])

    @property
    def cycles(self) -> float:
        """Vibration cycles at the end."""
        return float(self.history.cycles[-1])

    @cached_property
    def events(self) -> tuple[np.ndarray, np.ndarray]:
        """Cycles (n_pair,) from which on a pair opens, and touches no more; see `hbm.wear.history.events`."""
        return events(self.history, self.components, self.gap, self.basis)

    @cached_property
    def fatigue(self) -> dict[str, PlaceFatigue]:
        """Fatigue over the wear of the places whose strength is known, by name; motions are those of the balance."""
        rows = slice(None if self.row is None else self.row + 1)
        responses = self.history.response[:, None] if self.history.duty_response is None else self.history.duty_response
        cycles, shares, fatigue = np.asarray(self.history.cycles[rows]), np.array(self.shares), {}
        for place in self.places:
            if place.strength is not None:
                use = place.utilisation(place.stress(responses[rows], self.basis), self.basis)
                fatigue[place.name] = PlaceFatigue(place.strength, cycles, use, shares)
        return fatigue


@dataclass(frozen=True)
class SolvedCurve:
    """A response curve.

    basis : harmonics of its coefficients; places : of the part whose stress is asked for"""

    branch: Branch
    basis: HarmonicBasis | None = None
    places: tuple[StressPlace, ...] = ()
