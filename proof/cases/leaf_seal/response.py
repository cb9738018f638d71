"""The response of one configuration of the leaf seal: curve with folds, stability, chosen points, chattering, wear."""

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from proof.chatter import Chatter, chatter
from proof.problems import follow_response, impact_work, state_at
from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.stability.branch_stability import BranchStability, stability_along
from tribodyn.hbm.wear.laws.impact import loading_work
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run.modelling import build
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneFile

LINEAR, SEPARATING = 0.85, 1.12  # frequencies of the linear points, over those where separation begins and ends
LINER_NODE = OUTPUT  # the lower corner, which moves most where the leaf chatters
WEAR_COEFFICIENT = 2e-15  # [m3/J], that of the thesis's friction contacts put to impacts (ours)


@dataclass(frozen=True)
class LeafResponse:
    """A configuration and its response curve.

    springs : name of a pin, which is also an output, -> stiffness [N/m]; seat : bearing area of a pin [m2]
    seconds : processor time of model and curve [s]"""

    part: Part
    balance: HarmonicBalance
    branch: Branch
    springs: dict[str, float]
    seat: float
    seconds: float

    @cached_property
    def stability(self) -> BranchStability:
        """Stability along the curve, by Hill's method."""
        return stability_along(self.balance, self.branch)

    def state(self, point: int) -> State:
        """The solved state of a point of the curve."""
        return state_at(self.balance, self.branch.omega[point], self.branch.contact[point])

    def status(self) -> np.ndarray:
        """(n_point, n_pair) status bits along the curve."""
        return np.stack([self.state(i).cycle.status for i in range(len(self.branch.omega))])

    def chosen(self) -> list[int]:
        """Five points as the thesis picks them: linear, three where contact is lost for a while, linear again.

        The middle one is where most pairs separate and the leaf moves most; the outer ones lie well outside of the
        range of frequencies in which anything separates. Where nothing does, the points lie around the peak."""
        branch = self.branch
        height = branch.amplitude(LINER_NODE)
        peak = int(np.argmax(height))
        separating = np.flatnonzero((self.status() & SEPARATES).any(axis=1) & (self.status() & STICKS).any(axis=1))
        low, high = branch.omega[peak] * LINEAR, branch.omega[peak] * SEPARATING
        first = last = peak
        if len(separating):
            first, last = int(separating[0]), int(separating[-1])
            peak = int(separating[np.argmax(height[separating])])
            low, high = branch.omega[first] * LINEAR, branch.omega[last] * SEPARATING

        def nearest(start: int, stop: int, omega: float) -> int:
            return start + int(np.argmin(np.abs(branch.omega[start : stop + 1] - omega)))

        return [
            nearest(0, first, low),
            nearest(first, peak, 0.75 * branch.omega[first] + 0.25 * branch.omega[peak]),
            peak,
            nearest(peak, last, 0.5 * (branch.omega[peak] + branch.omega[last])),
            nearest(last, len(branch.omega) - 1, high),
        ]

    def chatter(self, point: int) -> Chatter:
        """Openings, closings and impact velocities at a point of the curve."""
        return chatter(self.balance, self.state(point))

    def impact_work(self, point: int) -> np.ndarray:
        """(n_pair,) work of impacts per cycle [J]."""
        return impact_work(self.balance, self.state(point))

    def pin_work(self, point: int) -> dict[str, float]:
        """Work per cycle that the leaf puts into the spring of each pin, which rubs and hammers its seat [J]."""
        work = {}
        for name, stiffness in self.springs.items():
            row = self.branch.response[point, self.branch.output_names.index(name)]
            stretch = self.balance.basis.to_time(row)
            work[name] = float(loading_work(stiffness * stretch, stretch))
        return work

    def wear_rates(self, point: int, coefficient: float = WEAR_COEFFICIENT) -> tuple[np.ndarray, np.ndarray]:
        """Wear depth per cycle of every pair (n_pair,) and of every pin (n_pin,) by the law of impacts [m]."""
        pins = np.array(list(self.pin_work(point).values()))
        return coefficient * self.impact_work(point) / self.part.interface.area, coefficient * pins / self.seat


def respond(file: SceneFile) -> LeafResponse:
    """Build the model of a configuration and follow its response as far as it goes, see Branch.end.

    Raises  SolveFailed where not even the first point of the curve is found"""
    start = time.process_time()
    scene = file.mesh_scene
    model = build(file, Progress())
    balance, part = model.balance, model.part
    assert part is not None
    branch = follow_response(file, balance)
    seconds = time.process_time() - start
    if not branch.converged[-1]:  # only the last point of a branch may be unsolved
        if len(branch.omega) == 1:
            raise SolveFailed(f"the frequency response {branch.end}")
        branch = _without_last(branch)
    pins = {name: spring.stiffness for name, spring in scene.springs.items()}
    leaf = scene.geometry.parameters
    return LeafResponse(part, balance, branch, pins, leaf["pin_width"] * leaf["thickness"], seconds)


def _without_last(branch: Branch) -> Branch:
    """A branch without its last point."""
    names = ("omega", "response", "contact", "energy", "outcome", "newton_steps", "parameter")
    return replace(branch, **{name: getattr(branch, name)[:-1] for name in names})
