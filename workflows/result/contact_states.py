"""States of the contact that pictures, reports and exports show: along wear, at response peaks, over a cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.declarations import SLIP_LIMITS
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.result.result import Result

FAINT = 1e-3  # share of the first preload below which a touch is faint
CLOSE = 1e-9  # of the largest force: what counts as none, and as being on the friction limit times 1000


@dataclass(frozen=True)
class ContactState:
    """One vibrating state of the contact.

    label : what a reader calls it; number : row of the wear history, or point of the response curve
    omega : [rad/s]; cycles : before this state
    depth : (n_pair,) total wear [m]; status : (n_pair,) bits over the cycle; pressure : (n_pair,) mean [Pa]
    field : which of result.fields and result.loops belongs to it, None for none"""

    label: str
    number: int
    omega: float
    cycles: float
    depth: np.ndarray
    status: np.ndarray | None
    pressure: np.ndarray | None
    field: int | None

    def of(self, pairs: slice) -> ContactState:
        """The same state of some pairs alone."""
        status = None if self.status is None else self.status[pairs]
        pressure = None if self.pressure is None else self.pressure[pairs]
        return replace(self, depth=self.depth[pairs], status=status, pressure=pressure)


def shown_states(result: Result) -> list[ContactState]:
    """The states that pictures show: of the wear history, else the peaks of the response curve."""
    return [state_of(result, int(number)) for number in result.shown_rows()]


def has_states(result: Result) -> bool:
    """Whether anything is known of the contact in some state."""
    return (result.wear is not None and len(result.wear.cycles) > 0) or result.loops is not None


def state_of(result: Result, number: int) -> ContactState:
    """The state of a wear row, or of a point of the response curve where nothing wears."""
    patch = result.patch
    rows = [] if result.fields is None else result.fields.row.tolist()
    field = rows.index(number) if number in rows else None
    if result.wear is not None and len(result.wear.cycles):
        wear = result.wear
        last = number == len(wear.cycles) - 1 and wear.cycles_in_step[number] == 0
        count = f"{counted(float(wear.cycles[number]))} cycles"
        label = "unworn" if number == 0 else f"end, {count}" if last else f"after {count}"
        return ContactState(
            label,
            number,
            float(wear.omega[number]),
            float(wear.cycles[number]),
            wear.depth[number],
            wear.status[number],
            wear.normal_force[number] / patch.area,
            field,
        )
    assert result.response is not None
    omega = float(result.response.omega[number])
    status = pressure = None
    if result.loops is not None and number in result.loops.row.tolist():
        at = result.loops.row.tolist().index(number)
        status = np.bitwise_or.reduce(instant_status(result, at), axis=1)
        if "n" in patch.components:
            pressure = result.loops.force[at, :, patch.components.index("n")].mean(axis=-1) / patch.area
    none = np.zeros(len(patch.area))
    return ContactState(f"{omega / (2 * np.pi):.4g} Hz", number, omega, 0.0, none, status, pressure, field)


def shown_cycles(wear: WearHistory) -> float:
    """Cycles up to which curves are drawn: all, unless a last faint touch takes more than half of them."""
    last = float(wear.cycles[-1])
    faint = np.flatnonzero(wear.preload < FAINT * wear.preload[0])
    if len(faint) and 0 < wear.cycles[faint[0]] < 0.5 * last:
        return 1.15 * float(wear.cycles[faint[0]])
    return last


def counted(number: float) -> str:
    """A count as 950 or 1.95·10⁷."""
    if number < 1e4:
        return f"{number:.0f}"
    digits, power = f"{number:.2e}".split("e")
    return f"{digits}·10{str(int(power)).translate(str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def slip_limits(result: Result, normal: np.ndarray) -> np.ndarray:
    """Tangential force (n_pair, n_sample) [N] at which pairs slip under a normal force, nan where no law has a limit.

    normal : (n_pair, n_sample) [N]"""
    limit = np.full(normal.shape, np.nan)
    for name, contact in result.scene.joints.items():
        friction, force = (contact.number(role) for role in SLIP_LIMITS)
        if friction is not None or force is not None:
            pairs = result.facts.joints.get(name, slice(None))
            limit[pairs] = (friction or 0.0) * normal[pairs] + (force or 0.0)
    return limit


def instant_status(result: Result, at: int) -> np.ndarray:
    """(n_pair, n_sample) whether each pair sticks, slips or is separated at the instants of a kept loop.

    A closed pair slips where its tangential force is at the limit of its law; without a limit it counts as sticking"""
    loops, patch = result.loops, result.patch
    assert loops is not None
    force = loops.force[at]
    if "n" not in patch.components:
        return np.full(force[:, 0].shape, STICKS)
    return status_of(force, patch.components, slip_limits(result, force[:, patch.components.index("n")]))


def status_of(force: np.ndarray, components: tuple[str, ...], limit: np.ndarray) -> np.ndarray:
    """(n_pair, n_sample) whether each pair sticks, slips or is separated under a force (n_pair, n_component, n_sample).

    limit : (n_pair, n_sample) tangential force at which a pair slips [N], nan where it has none"""
    status = np.full(limit.shape, STICKS)
    tangential = [c for c, name in enumerate(components) if name != "n"]
    normal = force[:, components.index("n")] if "n" in components else None
    largest = float(np.nan_to_num(np.abs(limit if normal is None else normal)).max(initial=1e-300))
    if np.isfinite(limit).any() and tangential:
        slip_force = limit - 1e3 * CLOSE * np.abs(limit) - CLOSE * largest
        largest_component, resultant = (
            np.abs(force[:, tangential]).max(axis=1),
            np.linalg.norm(force[:, tangential], axis=1),
        )
        # where the limit holds for each direction alone, both together may pass it: then they are no sign of slip
        planar = ~(resultant > limit + 1e3 * CLOSE * largest).any(axis=1, keepdims=True)
        status = np.where(np.where(planar, resultant, largest_component) >= slip_force, SLIPS, status)
    return status if normal is None else np.where(normal <= CLOSE * largest, SEPARATES, status)


def over_a_cycle(result: Result, at: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the nodes at equal instants of a period.

    at : which of result.fields
    Returns phase (count,) [rad], displacement (count, n_node, 3) [m], static part included"""
    assert result.fields is not None
    phase = 2 * np.pi * np.arange(count) / count
    basis = HarmonicBasis(result.harmonics, max(2 * result.harmonics[-1] + 1, 3))
    return phase, np.moveaxis(result.fields.displacement[at] @ basis.functions(phase).T, -1, 0)
