"""The response of one configuration of the leaf seal: curve with folds, stability, chosen points, chattering, wear."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fem.part import Part
from hbm import stability
from hbm.balance import HarmonicBalance, State
from hbm.branch import CONVERGED, Branch
from hbm.chatter import Chatter, chatter
from hbm.law import SEPARATES, STICKS
from hbm.stability import BranchStability
from hbm.wear import impact
from hbm.wear_law import Exposure
from workflows import pipeline
from workflows.scene_file import SceneFile

LINEAR, APART = 0.85, 1.12  # frequencies of the linear regime over those where separation begins and ends
LINER_NODE = "lower_corner"  # the output that moves most where the leaf chatters


@dataclass(frozen=True)
class LeafResponse:
    """A configuration and its response curve.

    stable : stability of the curve by Hill's method; seconds : processor time of model and curve [s]
    """

    part: Part
    balance: HarmonicBalance
    branch: Branch
    stability: BranchStability
    seconds: float

    def state(self, point: int) -> State:
        """The solved state of a point of the curve."""
        x = self.branch.contact[point].reshape(self.balance.parameters.n_pair, -1, self.balance.basis.n_coeff)
        return self.balance.evaluate(self.branch.omega[point], x)

    def status(self) -> np.ndarray:
        """(n_point, n_pair) status bits along the curve."""
        return np.stack([self.state(i).cycle.status for i in range(len(self.branch.omega))])

    def chosen(self) -> list[int]:
        """Five points as the thesis picks them: linear, three where contact is lost for a while, linear again.

        The middle one is where most pairs separate and the leaf moves most; the outer ones lie well outside of the
        range of frequencies in which anything separates. Where nothing does, the points lie around the peak.
        """
        branch = self.branch
        height = branch.amplitude(LINER_NODE)
        peak = int(np.argmax(height))
        apart = np.flatnonzero((self.status() & SEPARATES).any(axis=1) & (self.status() & STICKS).any(axis=1))
        low, high = branch.omega[peak] * LINEAR, branch.omega[peak] * APART
        first = last = peak
        if len(apart):
            first, last = int(apart[0]), int(apart[-1])
            peak = int(apart[np.argmax(height[apart])])
            low, high = branch.omega[first] * LINEAR, branch.omega[last] * APART
        before = int(np.argmin(np.abs(branch.omega[: first + 1] - low)))
        after = last + int(np.argmin(np.abs(branch.omega[last:] - high)))
        return [before, (first + peak) // 2, peak, (peak + last) // 2, after]

    def chatter(self, point: int) -> Chatter:
        """Openings, closings and impact velocities at a point of the curve."""
        return chatter(self.balance, self.state(point))

    def impact_work(self, point: int) -> np.ndarray:
        """(n_pair,) work of impacts per cycle [J]."""
        n = self.balance.parameters.n_pair
        exposure = Exposure(self.balance, self.state(point), np.ones(n), np.ones(n), np.zeros(n), 0.0)
        return impact.impact_work(exposure)


def respond(file: SceneFile) -> LeafResponse:
    """Build the model of a configuration and follow its response.

    Raises  pipeline.SolveFailed where the curve does not come to its end
    """
    start = time.process_time()
    scene = file.part_scene
    with TemporaryDirectory() as folder:
        mesh, node_sets = pipeline.make_mesh(file, Path(folder))
    part = pipeline.make_part(scene, mesh, node_sets)
    balance = pipeline.make_model(scene, part, pipeline.reduce_part(scene, part)).balance
    branch = pipeline.follow_response(scene, balance, lambda done, said: None)
    seconds = time.process_time() - start
    pipeline.check_branch(branch)
    assert branch.outcome[-1] == CONVERGED
    return LeafResponse(part, balance, branch, stability.mark(balance, branch), seconds)
