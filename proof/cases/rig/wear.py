"""Wear of the fretting rig until its preload is used up, and what the thesis tells about it.

Two preloads differ: the static force of the vibrating contact, which hammers once it lifts off in each cycle and then
carries a mean force without any interference, and the force that is left when the shaker stops. The second one is the
static preload of the thesis; a run here ends where that is lost."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from proof.cases.rig.model import NoSolution, Rig
from proof.problems import state_at, wear, worn
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.wear.history import WearHistory

WORN = 0.1e-6  # depth from which on a pair counts as worn [m]: what a profilometer tells from noise


@dataclass(frozen=True)
class RigWear:
    """A wear run of the rig at a fixed frequency.

    shift : mating height over that of the scene [m]; rest : (n_row,) preload when the shaker stops [N]
    area : (n_pair,) [m2]; points : (n_pair, 2) along the beam and along the sliding direction [m]
    end : sentence that says why the run ended; seconds : of processor time"""

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
        return self.history.ended is WearEnd.LOST_AT_REST

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

    shift : mating height over that of the scene [m]; tell : called with a sentence when the run is done
    Raises  NoSolution where a wear step fails"""
    clock = time.process_time()
    rig = rig.with_mating_height(shift).with_keys("wear.end_at=at_rest")
    balance = rig.model().balance
    history = wear(rig.file, balance)
    name = f"mating height {shift * 1e6:+.3g} um"
    if history.ended.failed:
        raise NoSolution(f"{name}, wear step {len(history.cycles)}: {history.end}")
    preload = history.preload_at_rest
    assert preload is not None
    span = f"{len(preload)} steps, {history.cycles[-1]:.3g} cycles"
    tell(f"{name}: {span}, preload {preload[-1]:.3g} N at rest; {history.end}")
    interface = balance.model.interface
    in_plane = (interface.points - interface.points.mean(axis=0))[:, :2]
    return RigWear(shift, history, preload, interface.area, in_plane, str(history.end), time.process_time() - clock)


def loop(balance: HarmonicBalance, history: WearHistory, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean sliding displacement of the patch [m] and whole friction force [N] over the cycle of a row.

    balance : the unworn problem"""
    current = worn(balance, history.depth[row])
    x, f = current.history(state_at(current, float(history.omega[row]), history.displacement[row]))
    share = balance.model.interface.area / balance.model.interface.area.sum()
    return np.asarray(share @ x[:, 0]), np.asarray(f[:, 0].sum(axis=0))
