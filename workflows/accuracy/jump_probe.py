"""How far more harmonics move the instant at which a wear run goes on at another peak, or whether it would at all.

Energies at the states of a run say nothing about it: which peak wears is decided by a sweep. The sweep is repeated with
more harmonics before and after the instant, until its answer changes; where a run stays at its peak, in the middle of
its life.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.operating_point import AtFrequency, AtPeak
from tribodyn.hbm.continuation.sites import Site
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.error_controlled_rule import jumps
from tribodyn.hbm.wear.evolution import Duty
from tribodyn.hbm.wear.history import WearHistory

MORE = 2  # harmonics beyond the kept ones, and up to those that a sweep below the tracked peak has at the least
LOOKED_AT = 0.5  # of the life, where a run that stays at its peak is asked
SHARES = (0.025, 0.05, 0.1, 0.2, 0.3, 0.4)  # of the life, on the side of the instant where the answer is to change


def life_moved(balance: HarmonicBalance, wear: WearHistory, duty: Duty, life: float) -> float | None:
    """Relative change of a life [cycles] that the first jump of its run makes when more harmonics decide on it.

    By how much of the life the instant moves is bounded by the first of SHARES at which the answer changes. In between
    the contact wears at the slower peak instead of the faster one, which costs that share times 1 - slow / fast.
    None where the peak is not found with more harmonics, or the instant moves further; 0 where the run has no jump
    """
    found = jumps(wear.rows())
    if not found or isinstance(duty.site, AtFrequency):
        return 0.0
    overtaken = _sweep_with_more(balance, wear, duty, found[0], life)
    at_once = overtaken(0.0)
    if at_once is None:
        return None
    if overtaken(-SHARES[-1] if at_once else SHARES[-1]) != (not at_once):  # then no nearer instant need be asked
        return None
    slow, fast = (float(wear.energy[row].sum()) for row in (found[0], found[0] + 1))
    for share in SHARES[:-1]:
        if overtaken(-share if at_once else share) == (not at_once):
            return share * abs(1 - slow / fast)
    return SHARES[-1] * abs(1 - slow / fast)


def peak_above(balance: HarmonicBalance, wear: WearHistory, duty: Duty, life: float) -> str:
    """Where a sweep with more harmonics meets a higher peak than the one that a run without a jump wears at.

    duty : at a peak, not at a frequency that is given
    Empty where it meets none at LOOKED_AT of the life [cycles]. Where it meets one, the contact goes on wearing there,
    and how fast is not known. Raises  ValueError where the tracked peak is lost with more harmonics
    """
    sweep = _Sweep.of(balance, wear, duty)
    row = max(int(np.searchsorted(wear.cycles, LOOKED_AT * life, "right")) - 1, 0)
    met = sweep.at(row, wear.depth[row])
    if met is None:
        raise ValueError(f"the tracked peak is lost with harmonics 0 to {sweep.top}")
    if not met:
        return ""
    return (
        f"with harmonics 0 to {sweep.top} a sweep meets a higher peak at {met / (2 * np.pi):.4g} Hz after "
        f"{wear.cycles[row]:.3g} cycles, and wear goes on there"
    )


def _sweep_with_more(
    balance: HarmonicBalance, wear: WearHistory, duty: Duty, row: int, life: float
) -> Callable[[float], bool | None]:
    """Whether a sweep with more harmonics meets a higher peak, some share of the life after the jump behind a row.

    None where the tracked peak itself is not found
    """
    sweep = _Sweep.of(balance, wear, duty)
    at, known = wear.cycles[: row + 2], wear.depth[: row + 2]
    rate = (known[-1] - known[-2]) / (at[-1] - at[-2])

    def overtaken(share: float) -> bool | None:
        cycles = at[-1] + share * life
        if share > 0:
            depth = known[-1] + rate * share * life
        else:
            depth = np.array([np.interp(cycles, at, pair) for pair in known.T])
        met = sweep.at(row, depth)
        return None if met is None else met > 0

    return overtaken


@dataclass(frozen=True)
class _Sweep:
    """A sweep with more harmonics than a wear run has.

    unworn : (n_pair,) gap [m]; top : highest harmonic
    """

    balance: HarmonicBalance
    kept: HarmonicBasis
    wear: WearHistory
    site: Site
    unworn: np.ndarray
    top: int

    @classmethod
    def of(cls, balance: HarmonicBalance, wear: WearHistory, duty: Duty) -> _Sweep:
        top = max(balance.basis.harmonics[-1] + MORE, AtPeak.scanned)
        wide = harmonic_choice.widened(balance, top)
        wide = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= top)).with_load(duty.load)
        return cls(wide, balance.basis, wear, _searching(duty.site, top), balance.contact.gap, top)

    def at(self, row: int, depth: np.ndarray) -> float | None:
        """Frequency [rad/s] of the higher peak that it meets, 0 if it meets none; None where the tracked peak is lost.

        row : whose motion is close; depth : (n_pair,) [m]
        """
        worn = self.balance.with_gap(self.unworn + depth)
        x = self.kept.transfer(self.wear.displacement[row], worn.basis)
        omega = float(self.wear.omega[row])
        point = self.site.next(worn, omega, x.reshape(worn.contact.n_pair, -1, worn.basis.n_coeff))
        if not point.solution.converged:
            return None
        higher = self.site.overtaken(worn, point)[0]
        return 0.0 if higher is None else higher.state.omega


def _searching(site: Site, top: int) -> Site:
    """A site that looks for higher peaks with all harmonics up to `top`."""
    if isinstance(site, AtPeak):
        return replace(site, scanned=top)
    assert not isinstance(site, AtFrequency)
    return replace(site, peak=replace(site.peak, scanned=top))
