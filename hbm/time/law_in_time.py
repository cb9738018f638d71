"""Contact laws that need velocities, as laws that do not: the positions at the two steps before are memory.

The velocity is the difference of second order over three positions (BDF2, Curtiss and Hirschfelder 1952)."""

from dataclasses import dataclass, replace
from functools import cache
from types import ModuleType

import numba
import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint, JointSet


@dataclass(frozen=True)
class TimedJoint(Joint):
    """A joint whose packed parameters end with the time step, and whose memory ends with two positions."""

    @property
    def module(self) -> ModuleType:
        """The law without velocities."""
        return _without_velocity(super().module, len(self.parameters.components))


def timed(balance: HarmonicBalance, step: float) -> HarmonicBalance:
    """The balance with a law that time steps [s] can call; the same where the law needs no velocity."""
    if not balance.contact.needs_velocity and not isinstance(balance.contact.joints[0], TimedJoint):
        return balance
    joint, contact = balance.contact.merge("time integration"), balance.contact
    parameters = replace(joint.parameters, tabulation=np.full((contact.n_pair, 1), step))
    merged = TimedJoint(joint.name, joint.law, parameters, joint.pairs)
    memory = np.zeros((contact.n_pair, merged.n_state))
    memory[:, : balance.memory.shape[1]] = balance.memory
    return replace(balance, contact=JointSet(contact.components, contact.n_pair, (merged,)), memory=memory)


@cache
def _without_velocity(law: ModuleType, n: int) -> ModuleType:
    step, adapted = law.step, ModuleType(law.__name__)

    @numba.njit
    def advance(x, s, p, f, dfx, dfs, dsx, dss):
        """A step; memory : that of the law, the position two steps before, that of the step before."""
        own, dt, force, point = s.size - 2 * n, p[p.size - 1], np.zeros(2 * n), np.zeros(2 * n)
        early, late = s[own : own + n].copy(), s[own + n :].copy()
        if not np.any(s[own:]):  # no step before: at rest
            early, late = x.copy(), x.copy()
        point[:n], point[n:] = x, (3.0 * x - 4.0 * late + early) / (2.0 * dt)
        memory, fx, fs = s[:own].copy(), np.zeros((2 * n, 2 * n)), np.zeros((2 * n, own))
        sx, ss = np.zeros((own, 2 * n)), np.zeros((own, own))
        bits = step(point, memory, p, force, fx, fs, sx, ss)
        for of_x, of_s, by_x, by_s in ((dfx, dfs, fx[:n], fs[:n]), (dsx[:own], dss[:own], sx, ss)):
            rate = by_x[:, n:] / dt
            of_x[:], of_s[:, :own] = by_x[:, :n] + 1.5 * rate, by_s
            of_s[:, own : own + n], of_s[:, own + n :] = 0.5 * rate, -2.0 * rate
        f[:], s[:own], s[own : own + n], s[own + n :] = force[:n], memory, late, x
        for a in range(n):
            dss[own + a, own + n + a] = dsx[own + n + a, a] = 1.0
        return bits

    adapted.step, adapted.__file__ = advance, law.__file__  # type: ignore[attr-defined]
    adapted.n_state = lambda components: law.n_state(components) + 2 * n  # type: ignore[attr-defined]
    return adapted
