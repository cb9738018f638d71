"""What a wear run returns: the contact and the response, wear step by wear step, and when contact changes for good."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Generic, TypeVar

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import Outcome, WearEnd

LARGEST_SHIFT = 0.1  # of a frequency in one step: a peak that moves further is another one
LIFE_SHARE = 1e-3  # of the first preload, where the life that is stated ends unless a scene says where
OF_MOTION = ("spread", "mean_error", "is_stationary", "periods", "moving")  # of a row whose motion was marched in time


class StepScheme(StrEnum):
    """Numerical scheme of the steps of a wear rule."""

    EXPLICIT = "explicit"
    """At the rate of their beginning."""
    IMPLICIT = "implicit"
    """Two implicit stages, see `hbm.wear.sdirk_stages`."""
    UNKNOWN = "unknown"


Number = TypeVar("Number")
Count = TypeVar("Count")


@dataclass(frozen=True)
class _State(Generic[Number, Count]):
    """What one row, or all rows, of a wear run have; see WearHistory."""

    cycles: Number
    cycles_in_step: Number
    depth: np.ndarray
    worn: np.ndarray
    energy: np.ndarray
    preload: Number
    normal_force: np.ndarray
    status: np.ndarray
    omega: Number
    amplitude: Number
    force: np.ndarray
    response: np.ndarray
    solves: Count
    step_error: Number
    work: np.ndarray
    duty_omega: np.ndarray
    duty_displacement: np.ndarray


@dataclass(frozen=True)
class WearRow(_State[float, int]):
    """One wear step; the fields are those of WearHistory, without the row axis.

    worn : (n_pair,) depth that the step wears after this state [m]"""

    preload_at_rest: float = float("nan")
    growth: float = float("nan")
    spread: float = 0.0
    mean_error: float = 0.0
    is_stationary: bool = True
    periods: int = 0
    moving: np.ndarray = field(default_factory=lambda: np.zeros(0))
    duty_response: np.ndarray = field(default_factory=lambda: np.zeros(0))
    bed: np.ndarray | float = 0.0
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def displacement(self) -> np.ndarray:
        """(n_contact, n_coeff) of the first duty [m]."""
        return self.duty_displacement[0]


@dataclass(frozen=True)
class WearHistory(_State[np.ndarray, np.ndarray]):
    """Evolution of a contact under wear; row i is the state solved at the start of wear step i.

    cycles : (n_row,) vibration cycles passed before the row's state
    cycles_in_step : (n_row,) cycles that the state stands for; 0 in the last row, where contact is lost
    depth : (n_row, n_pair) total wear depth of the pair, both surfaces together [m]
    worn : (n_row, n_pair) depth that is worn from this row to the next [m]
    energy : (n_row, n_pair) dissipated energy per cycle [J]
    preload : (n_row,) static normal force of all joints that wear [N]
    normal_force : (n_row, n_pair) mean normal force over the cycle [N]
    status : (n_row, n_pair) bits over one cycle: 1 sticks, 2 slips, 4 separates
    omega : (n_row,) frequency of the cycle [rad/s]
    amplitude : (n_row,) vibration amplitude of the response output [m]
    force : (n_row, n_pair * n_component, n_coeff) Fourier coefficients at the contact [N]
    response : (n_row, n_output, n_coeff) Fourier coefficients of the outputs [m]
    solves : (n_row,) harmonic balance solves spent on the row
    step_error : (n_row,) estimated local error of the step over its tolerance; 0 where the rule has no estimate
    work : (n_row, n_pair) friction work from this row to the next [J]
    duty_omega, duty_displacement : (n_row, n_duty) [rad/s], (n_row, n_duty, n_contact, n_coeff) [m]: every duty of a
        mission; the fields above show the first
    end : why the run ended; its text is a sentence
    preload_at_rest : (n_row,) static normal force of the whole contact without the harmonic loads [N]; nan where the
        end of the run does not depend on it
    growth : (n_row,) of the perturbation of the balance's motion that grows fastest, per radian, by Hill's method, less
        rounding; nan where it is not known, None where it is nowhere
    periods : (n_row,) marched in time, where a machine leaves the motion of the balance: energy, normal_force, preload
        and amplitude then are means over its own, while omega, displacement, force and response stay the balance's, or
        of the last row with a balance where wear in time went on without one; zero elsewhere. None in a run that
        is nowhere marched, as the four below
    spread : (n_row,) standard deviation of the work of a period, over its mean; mean_error : (n_row,) standard error of
        that mean, relative; is_stationary : (n_row,) whether the means came to rest
    moving : (n_row, n) what moved before the row's periods, see hbm.time.mean_motion.Follower; zeros where they began
        in the balance
    duty_response : (n_row, n_duty, n_output, n_coeff) responses of every duty [m]; None where there is one
    bed : (n_row, n_pair) thickness of the worn material that stays in the gap [m]; None where none does
    memory : what the rule remembers from step to step, arrays (n_row, ...) by name, see the rule; empty where nothing
    scheme : of the steps, a `StepScheme`"""

    end: Outcome[WearEnd]
    preload_at_rest: np.ndarray | None = None
    growth: np.ndarray | None = None
    spread: np.ndarray | None = None
    mean_error: np.ndarray | None = None
    is_stationary: np.ndarray | None = None
    periods: np.ndarray | None = None
    moving: np.ndarray | None = None
    duty_response: np.ndarray | None = None
    bed: np.ndarray | None = None
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)
    scheme: str = StepScheme.UNKNOWN.value

    @property
    def in_time(self) -> np.ndarray:
        """(n_row,) whether the row's motion is one in time that a machine makes, and not that of the balance."""
        return np.zeros(len(self.cycles), bool) if self.periods is None else self.periods > 0

    @property
    def opening(self) -> np.ndarray:
        """(n_row, n_pair) what wear adds to the gaps [m]."""
        return self.depth if self.bed is None else self.depth - self.bed

    @property
    def unstable_share(self) -> float | None:
        """Share of the cycles worn along a motion of the balance that a machine leaves; None where it is not known."""
        if self.growth is None:
            return None
        unstable = (self.growth > 0) & ~self.in_time
        return float(self.cycles_in_step[unstable].sum()) / float(self.cycles_in_step.sum() or 1.0)

    @property
    def jumps(self) -> np.ndarray:
        """Rows after which wear went on at another peak."""
        return np.flatnonzero(np.abs(self.omega[1:] / self.omega[:-1] - 1) > LARGEST_SHIFT)

    @property
    def without_balance(self) -> np.ndarray:
        """Rows in time whose balance has no solution: the motion of the row before stays, but not its forces."""
        stays, is_same_force = ((a[1:] == a[:-1]).all(axis=(1, 2)) for a in (self.displacement, self.force))
        return 1 + np.flatnonzero(self.in_time[1:] & stays & ~is_same_force)

    @property
    def scatter(self) -> float:
        """Standard error of the cycles passed by the scatter of the motions in time, relative."""
        if self.mean_error is None:
            return 0.0
        return float(np.linalg.norm(self.cycles_in_step * self.mean_error)) / float(self.cycles_in_step.sum() or 1.0)

    @property
    def frequency(self) -> np.ndarray:
        """(n_row,) frequency of the cycle [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def ended(self) -> WearEnd:
        """Why the run ended."""
        return self.end.kind

    @property
    def displacement(self) -> np.ndarray:
        """(n_row, n_pair * n_component, n_coeff) Fourier coefficients at the contact, first duty [m]."""
        return self.duty_displacement[:, 0]

    def rows(self) -> list[WearRow]:
        """The rows one by one."""
        names = [f.name for f in fields(WearRow) if f.name != "memory" and getattr(self, f.name) is not None]
        return [
            WearRow(
                **{name: getattr(self, name)[i] for name in names},
                memory={name: values[i] for name, values in self.memory.items()},
            )
            for i in range(len(self.cycles))
        ]


def cycles_to_preload(history: WearHistory, share: float = LIFE_SHARE) -> float | None:
    """Cycles after which the preload has fallen to a share of its first value; None if it has not.

    The preload is that at rest where the run ends by it. This is the life that converges with the wear step: the last
    touch of a vibrating contact does not end in finite time, near it the work falls with the power 3/2 of what is left
    to wear. 0 for a contact that touches at no moment, already before it wears."""
    if history.ended is WearEnd.LOST and len(history.cycles) == 1:
        return 0.0
    at_rest = history.preload_at_rest
    if at_rest is None:
        return cycles_to_share(history.cycles, history.preload, share)
    return cycles_to_share(history.cycles, at_rest, share, at_rest=True)


def cycles_to_share(cycles: np.ndarray, preload: np.ndarray, share: float, at_rest: bool = False) -> float | None:
    """The same of any preload (n_row,) [N], such as that of one joint; cycles (n_row,) at which it is known.

    Between rows along the logarithm of the preload; at rest, where the wear falls on it evenly, along itself"""
    rows_below = np.flatnonzero(preload < share * preload[0])
    if len(rows_below) == 0 or rows_below[0] == 0:
        return None
    i = int(rows_below[0])
    high, low, target = (float(force / preload[0]) for force in (preload[i - 1], preload[i], share * preload[0]))
    if at_rest:
        part = (high - target) / (high - low)
    else:
        part = np.log(high / target) / np.log(high / max(low, 1e-3 * target))
    return float(cycles[i - 1] + part * (cycles[i] - cycles[i - 1]))


def rows_to_resume(interrupted: WearHistory | None) -> list[WearRow]:
    """Rows of an interrupted run that steps were taken from; the one that ended it is come to again with its reason."""
    rows = interrupted.rows() if interrupted is not None else []
    return [row for row in rows if row.cycles_in_step > 0]


def history(rows: list[WearRow], end: Outcome[WearEnd], scheme: StepScheme = StepScheme.UNKNOWN) -> WearHistory:
    """Rows put together."""
    marched = any(row.periods for row in rows)
    names = [f.name for f in fields(WearRow) if f.name != "memory" and (marched or f.name not in OF_MOTION)]
    if marched:
        width = max(len(row.moving) for row in rows)
        rows = [replace(row, moving=np.pad(row.moving, (0, width - len(row.moving)))) for row in rows]
    rows = [replace(row, bed=row.bed + 0 * row.depth) for row in rows]  # rows of a run without one have no field
    columns = {name: np.array([getattr(row, name) for row in rows]) for name in names}
    for name in ("preload_at_rest", "growth"):
        if np.isnan(columns[name]).all():
            del columns[name]
    for name, has_any in (("duty_response", columns["duty_response"].size), ("bed", columns["bed"].any())):
        if not has_any:
            del columns[name]
    memory = {name: np.array([row.memory[name] for row in rows]) for name in (rows[0].memory if rows else ())}
    return WearHistory(**columns, end=end, memory=memory, scheme=scheme.value)


def events(
    history: WearHistory, components: tuple[str, ...], gap: np.ndarray, basis: HarmonicBasis
) -> tuple[np.ndarray, np.ndarray]:
    """Cycles (n_pair,) from which on a pair opens in a part of the cycle, and touches no more; nan where that is never.

    Located between rows by a straight line through the penetration of each pair; none without a normal component.
    components : of the contact; gap : (n_pair,) of the unworn contact [m]"""
    if "n" not in components or not len(history.cycles):
        return np.zeros(0), np.zeros(0)
    normal = history.displacement[:, components.index("n") :: len(components)]  # (n_row, n_pair, n_coeff)
    penetration = basis.to_time(normal) - (gap + history.opening)[..., None]
    deepest, shallowest = penetration.max(axis=-1), penetration.min(axis=-1)
    return _crossings(history.cycles, shallowest), _crossings(history.cycles, deepest)


def _crossings(cycles: np.ndarray, value: np.ndarray) -> np.ndarray:
    """(n_pair,) cycles at which a value (n_row, n_pair) last falls below zero to stay; 0 if it never was above."""
    n_row, n_pair = value.shape
    crossings = np.full(n_pair, np.nan)
    for i in range(n_pair):
        above = np.flatnonzero(value[:, i] > 0)
        if len(above) == 0:
            crossings[i] = 0.0
        elif above[-1] + 1 < n_row:
            k = above[-1]
            share = value[k, i] / (value[k, i] - value[k + 1, i])
            crossings[i] = cycles[k] + share * (cycles[k + 1] - cycles[k])
    return crossings


def first(cycles: np.ndarray) -> float | None:
    """The first of some events that was not there from the start."""
    later = cycles[cycles > 0]
    return float(later.min()) if len(later) else None
