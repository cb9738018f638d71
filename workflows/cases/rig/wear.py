"""Wear of the fretting rig until its preload is used up, and what the thesis tells about it.

Two preloads differ: the static force of the vibrating contact, which hammers once it lifts off in each cycle and then
carries a mean force without any interference, and the force that is left when the shaker stops. The second one is the
static preload of the thesis; a run here ends where that is lost.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.evolution import WearState, assess
from tribodyn.hbm.wear_history import WearHistory
from tribodyn.hbm.wear_history import history as joined
from tribodyn.workflows.cases.rig.model import NoSolution, Rig
from tribodyn.workflows.run import settings, wear_run
from tribodyn.workflows.run.references import free_deflection

STRIDE = 8  # wear steps between two looks at the preload at rest
WORN = 0.1e-6  # depth from which on a pair counts as worn [m]: what a profilometer tells from noise


@dataclass(frozen=True)
class RigWear:
    """A wear run of the rig at a fixed frequency.

    shift : mating height over that of the scene [m]; rest : (n_row,) preload when the shaker stops [N]
    area : (n_pair,) [m2]; points : (n_pair, 2) along the beam and along the sliding direction [m]
    end : sentence that says why the run ended; seconds : of processor time
    """

    shift: float
    history: WearHistory
    rest: np.ndarray
    area: np.ndarray
    points: np.ndarray
    end: str
    seconds: float

    @property
    def lost(self) -> bool:
        """Whether the preload was used up."""
        return self.end.startswith("preload at rest")

    @property
    def spent(self) -> np.ndarray:
        """(n_row,) friction work before each row [J]."""
        return np.concatenate([[0.0], np.cumsum(self.history.work.sum(axis=1))[:-1]])

    @property
    def volume(self) -> np.ndarray:
        """(n_row,) worn volume of both faces [m3]."""
        return np.asarray(self.history.depth @ self.area)

    @property
    def energy(self) -> np.ndarray:
        """(n_row,) friction work per cycle [J]."""
        return np.asarray(self.history.energy.sum(axis=1))

    @property
    def worn_share(self) -> np.ndarray:
        """(n_row,) worn part of the face."""
        return np.asarray((self.history.depth > WORN) @ self.area / self.area.sum())

    def slope(self) -> float:
        """Worn volume per friction work by linear regression through all rows [m3/J]."""
        return float(np.polyfit(self.spent, self.volume, 1)[0])

    def at_cycles(self, cycles: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values of rows (n_row,) at numbers of cycles; nan beyond the end."""
        return np.interp(cycles, self.history.cycles, values, right=np.nan)

    def nearest(self, share: float) -> int:
        """The row whose worn volume is nearest to a share of that at the end."""
        return int(np.argmin(np.abs(self.volume - share * self.volume[-1])))


def wear_down(rig: Rig, shift: float, tell: Callable[[str], None]) -> RigWear:
    """Wear the rig by the rule of its scene until the preload at rest has fallen to the scene's `lost_below`.

    shift : mating height over that of the scene [m]; tell : called with a sentence as the run goes on
    Raises  NoSolution where a wear step fails
    """
    wear, clock = rig.scene.wear, time.process_time()
    assert wear is not None
    rig = rig.with_mating_height(shift)
    balance, still = rig.model().balance, rig.with_force(0.0).model().balance
    problem, quiet = (wear_run.wear_problem(rig.scene, rig.folder, b) for b in (balance, still))
    area = problem.area
    limit = settings.step_limit(rig.scene, free_deflection(balance), area)
    history: WearHistory | None = None
    rest: list[float] = []
    resting: WearState | None = None
    while True:
        count = min(len(rest) + STRIDE, wear.max_steps)
        history = wear_run.evolve(problem, wear, limit, count, resume=history)
        if history.end.startswith("solve failed"):
            raise NoSolution(f"mating height {shift * 1e6:+.3g} um, wear step {len(history.cycles)}: {history.end}")
        for depth in history.depth[len(rest) :]:
            resting = assess(quiet, depth, 0.0, resting)
            if resting.failure:
                raise NoSolution(f"mating height {shift * 1e6:+.3g} um, at rest, step {len(rest)}: {resting.failure}")
            rest.append(still.preload(resting.points[0].state))
        tell(
            f"mating height {shift * 1e6:+.3g} um: step {len(rest)}, {history.cycles[-1]:.3g} cycles, "
            f"preload {rest[-1]:.3g} N at rest"
        )
        below = np.flatnonzero(np.array(rest) < wear.lost_below * rest[0])
        if len(below) or len(rest) >= wear.max_steps or history.cycles_in_step[-1] == 0:
            break
    rows = len(rest) if not len(below) else int(below[0]) + 1
    end = f"preload at rest fell below {wear.lost_below:.3g} of its first value" if len(below) else history.end
    kept = history_of(history, rows)
    points = rig.plain.interface.points
    in_plane = (points - points.mean(axis=0))[:, :2]
    return RigWear(shift, kept, np.array(rest[:rows]), area, in_plane, end, time.process_time() - clock)


def history_of(history: WearHistory, rows: int) -> WearHistory:
    """The first rows of a history."""
    return joined(history.rows()[:rows], history.end)


def loop(balance: HarmonicBalance, history: WearHistory, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean sliding displacement of the patch [m] and whole friction force [N] over the cycle of a row.

    balance : the unworn problem
    """
    shape = (balance.contact.n_pair, -1, balance.basis.n_coeff)
    worn = balance.with_gap(balance.contact.gap + history.depth[row])
    x, f = worn.contact.history(history.displacement[row].reshape(shape), worn.basis, worn.memory)
    share = balance.model.interface.area / balance.model.interface.area.sum()
    return np.asarray(share @ x[:, 0]), np.asarray(f[:, 0].sum(axis=0))
