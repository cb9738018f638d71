"""The implicit wear stage: one harmonic balance solve of all duties, the gaps wearing along.

A pair wears by its own friction work alone, so the implicit stage

    depth_i = base_i + cycles gain_i sum over duties of share E_i(x_i, depth_i)

is solved pair by pair inside the contact law. Its derivative couples the duties of one pair and stays block diagonal
over pairs, so the Krylov solver sees nothing new, and the stiffness of pressure against depth is gone.
Source  ours"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactCycle
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.derivatives.derivative_rules import RULES
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.hbm.linearisation import Linearisation

MAX_ITERATIONS = 80
ROUNDING = 4e-16


@dataclass(frozen=True)
class WornState:
    """The stage evaluated at one x, over the duties of a pair, then its components; see `WearingBalance`.

    omegas : of the duties [rad/s]; x, cycle, g, residual : as of a `State`; depth : (n_pair,) that goes with x [m]"""

    omegas: tuple[float, ...]
    x: np.ndarray
    cycle: ContactCycle
    g: np.ndarray
    residual: np.ndarray
    depth: np.ndarray


class _Points:
    """The linear sides of all duties at their frequencies; contact rows run pair, duty, component."""

    def __init__(self, points: Sequence[CompliancePoint], n_component: int):
        self.points = points
        self.n_component = n_component

    @property
    def blocks(self) -> np.ndarray | None:
        """Diagonal blocks for a preconditioner, of one duty alone."""
        return self.points[0].blocks if len(self.points) == 1 else None

    def split(self, rows: np.ndarray) -> list[np.ndarray]:
        """Rows (n * n_duty * n_component, n_coeff) duty by duty."""
        by_duty = rows.reshape(-1, len(self.points), self.n_component, rows.shape[-1])
        return [np.ascontiguousarray(by_duty[:, i]).reshape(-1, rows.shape[-1]) for i in range(len(self.points))]

    def join(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """The inverse of `split`."""
        n_coeff = parts[0].shape[-1]
        blocks = [part.reshape(-1, self.n_component, n_coeff) for part in parts]
        return np.concatenate(blocks, axis=1).reshape(-1, n_coeff)

    def apply(self, g: np.ndarray) -> np.ndarray:
        """Displacement that a departure g causes, every duty at its frequency."""
        return self.join([p.apply(part) for p, part in zip(self.points, self.split(g), strict=True)])

    def nearly(self, g: np.ndarray) -> np.ndarray:
        """`apply` without what a sparse factor would have to be asked for."""
        return self.join([p.nearly(part) for p, part in zip(self.points, self.split(g), strict=True)])

    @property
    def left_out(self) -> float:
        """Largest share of the contact flexibility that `nearly` leaves out."""
        return max(p.left_out for p in self.points)

    def jacobian_product(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """`apply` from and to the rows of whole pairs."""
        products = [p.jacobian_product(self._own_rows(rows)) for p in self.points]
        return lambda v: self.join([f(part) for f, part in zip(products, self.split(v), strict=True)])

    def _own_rows(self, rows: np.ndarray) -> np.ndarray:
        """Contact rows of one duty that belong to rows of whole pairs."""
        pairs = rows.reshape(-1, len(self.points) * self.n_component)[:, 0] // (len(self.points) * self.n_component)
        return (pairs[:, None] * self.n_component + np.arange(self.n_component)).ravel()

    def coarse_part(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """That of every duty, one after the other; see `CompliancePoint.coarse_part`."""
        n_duty = len(self.points)
        duty_rows = self._own_rows(rows)
        parts = [p.coarse_part(duty_rows) for p in self.points]
        r, size = parts[0][0].shape[1], len(parts[0][1])
        u = np.zeros((len(duty_rows) // self.n_component, n_duty, self.n_component, n_duty, r))
        a = np.zeros((n_duty, size, n_duty, size))
        for i, (shapes, compliance) in enumerate(parts):
            u[:, i, :, i] = shapes.reshape(len(u), self.n_component, r)
            a[i, :, i] = compliance
        return u.reshape(len(rows), n_duty * r), a.reshape(n_duty * size, n_duty * size)


class WearingBalance:
    """The balances of a mission over one worn contact, of which every pair wears by its work over `cycles`.

    balances : one per duty, over the same contact and with the gap before any wear; shares : of the cycles
    base : (n_pair,) depth at no work [m]; cycles : that the stage stands for
    gain : (n_pair,) depth per friction work [m/J]
    guess : (n_pair,) depth to look from [m]; each search starts where the last one ended
    x runs over the duties of a pair, then its components: (n_pair, n_duty * n_component, n_coeff); frequencies are a
    tuple, one per duty. `hbm.newton` solves it as any `criterion.Balance`.
    reference_stiffness : (n_pair * n_duty * n_component,) stuck springs [N/m]"""

    def __init__(
        self, balances: Sequence[HarmonicBalance], shares: Sequence[float], base: np.ndarray, cycles: float,
        gain: np.ndarray, guess: np.ndarray,
    ):  # fmt: skip
        self.balances, self.shares, self.base, self.cycles, self.gain = balances, shares, base, cycles, gain
        self._guess = np.maximum(guess, base)
        first = balances[0]
        self._n_component = len(first.contact.components)
        spread = first.reference_stiffness.reshape(-1, 1, self._n_component)
        self.reference_stiffness = np.repeat(spread, len(balances), axis=1).ravel()
        self._normal = first.contact.components.index("n") if "n" in first.contact.components else None

    def at(self, omegas: tuple[float, ...]) -> _Points:
        """The linear sides at the duties' frequencies [rad/s]."""
        return _Points([b.at(omega) for b, omega in zip(self.balances, omegas, strict=True)], self._n_component)

    def x_lin(self, omegas: tuple[float, ...]) -> np.ndarray:
        """Response with every contact stuck and closed [m], as `HarmonicBalance.x_lin`."""
        parts = [b.x_lin(omega) for b, omega in zip(self.balances, omegas, strict=True)]
        return self.at(omegas).join(parts)

    def parts(self, x: np.ndarray) -> list[np.ndarray]:
        """x of every duty from the joined one."""
        return [np.ascontiguousarray(part) for part in np.split(x, len(self.balances), axis=1)]

    def evaluate(self, omegas: tuple[float, ...], x: np.ndarray) -> WornState:
        """The balance at x, every pair at the depth that its own work wears."""
        depth, cycle = self._wear_along(omegas, x)
        flat = x.reshape(-1, x.shape[2])
        g = self.reference_stiffness[:, None] * flat - cycle.force.reshape(flat.shape)
        residual = flat - self.x_lin(omegas) - self.at(omegas).apply(g)
        return WornState(omegas, x, cycle, g, residual, depth)

    def linearise(self, state: WornState) -> Linearisation:
        """d R / d x at a state."""
        return Linearisation(self.at(state.omegas), self.reference_stiffness, state.x, state.cycle)

    def follow(self, state: WornState, moves: np.ndarray) -> np.ndarray:
        """First-order change of x when the duties' frequencies move by `moves` [rad/s], the depths following."""
        spread = []
        for balance, omega, part, move in zip(self.balances, state.omegas, self.parts(state.x), moves, strict=True):
            worn = balance.worn(state.depth)
            spread.append(move * worn.frequency_slope(worn.evaluate(omega, part))[0])
        change, _, _ = self.linearise(state).solve(-self.at(state.omegas).join(spread), 1e-4)
        return change.reshape(state.x.shape)

    def _wear_along(self, omegas: tuple[float, ...], x: np.ndarray) -> tuple[np.ndarray, ContactCycle]:
        """Depth that goes with x, and the contact cycles at it with their derivative along x and depth."""
        parts = self.parts(x)
        depth, samples = self._solve_depth(omegas, parts)
        first = self.balances[0]
        n_coeff = x.shape[2]
        width = self._n_component * n_coeff
        n_pair, n_duty = len(x), len(self.balances)
        force = np.concatenate([s.cycle.force for s in samples], axis=1)
        jacobian = np.zeros((n_pair, n_duty * width, n_duty * width))
        work_slopes = np.zeros((n_pair, n_duty * width))
        column = np.zeros((n_pair, n_duty * width))
        bend, gain = np.ones(n_pair), self.cycles * self.gain
        for i, (share, sample, part) in enumerate(zip(self.shares, samples, parts, strict=True)):
            rows = slice(i * width, (i + 1) * width)
            jacobian[:, rows, rows] = sample.cycle.slope
            column[:, rows] = sample.column
            work_slopes[:, rows] = share * work_slope(first, part, sample.cycle)
            bend = bend + gain * sample.falls
        slope = gain[:, None] * work_slopes / bend[:, None]
        jacobian -= column[:, :, None] * slope[:, None, :]  # a depth acts as a static shift of the normal displacement
        status = samples[0].cycle.status.copy()
        for sample in samples[1:]:
            status |= sample.cycle.status
        return depth, ContactCycle(force, jacobian, status)

    def _solve_depth(self, omegas: tuple[float, ...], parts: Sequence[np.ndarray]) -> tuple[np.ndarray, list[_Sample]]:
        """The depth of every pair by Newton's method inside a bracket, and the cycles at it."""
        size = np.maximum.reduce([np.abs(p).max(axis=(1, 2)) for p in parts])
        depth, low, high = self._guess.copy(), self.base.copy(), np.full_like(self.base, np.inf)
        full = self._sample(omegas, parts, depth, np.arange(len(depth)))
        todo = np.arange(len(depth))
        samples = full
        for _ in range(MAX_ITERATIONS):
            gain = self.cycles * self.gain[todo]
            work = sum(s.work for s in samples)
            miss = depth[todo] - self.base[todo] - gain * work
            bend = 1.0 + gain * sum(s.falls for s in samples)
            low[todo] = np.where(miss < 0, depth[todo], low[todo])
            high[todo] = np.where(miss > 0, depth[todo], high[todo])
            present, lower, upper = depth[todo], low[todo], high[todo]
            trial = present - miss / np.where(bend > 0, bend, 1.0)
            scale = np.maximum(np.maximum(np.abs(present), size[todo]), 1e-300)
            done = (miss == 0) | (np.abs(trial - present) <= ROUNDING * scale) | (upper - lower <= ROUNDING * scale)
            middle = np.where(np.isfinite(upper), 0.5 * (lower + upper), present - miss)
            trial = np.where((trial > lower) & (trial < upper), trial, middle)
            if done.all():
                break
            todo = todo[~done]
            depth[todo] = trial[~done]
            samples = self._sample(omegas, parts, depth, todo)
            full = [sample.updated(todo, part) for sample, part in zip(full, samples, strict=True)]
        self._guess = depth
        return depth, full

    def _sample(
        self, omegas: tuple[float, ...], parts: Sequence[np.ndarray], depth: np.ndarray, pairs: np.ndarray
    ) -> list[_Sample]:
        """Contact cycles of some pairs at a depth, duty by duty, with their share of the work and its derivative."""
        samples = []
        for share, balance, omega, part in zip(self.shares, self.balances, omegas, parts, strict=True):
            x = part[pairs]
            contact = balance.contact.subset(pairs).worn(depth[pairs])
            cycle = contact.cycle(x, balance.basis, balance.memory[pairs], omega=omega)
            t = contact.tangential
            if self._normal is None or not balance.basis.has_static:
                column = np.zeros((len(pairs), cycle.slope.shape[1]))
            else:
                column = (
                    cycle.slope[:, :, self._normal * balance.basis.n_coeff] * contact.of_pairs("opening_slope")[:, None]
                )
            column = column - slope_by_age(replace(balance, contact=contact, memory=balance.memory[pairs]), x, omega)
            work = share * np.maximum(balance.basis.work_per_cycle(cycle.force, x)[:, t].sum(axis=1), 0.0)
            falls = share * balance.basis.work_per_cycle(column.reshape(x.shape), x)[:, t].sum(axis=1)
            samples.append(_Sample(cycle, column, work, np.where(work > 0, falls, 0.0)))
        return samples


def has_aging(contact: JointSet) -> bool:
    """Whether more than a gap changes with wear."""
    return any(joint.parameters.aging is not None for joint in contact.joints)


def slope_by_age(balance: HarmonicBalance, x: np.ndarray, omega: float) -> np.ndarray:
    """(n_pair, n_component * n_coeff) d force / d depth [N/m] at the same x and gap, by what else changes with wear."""
    if not has_aging(balance.contact):
        return np.zeros((len(x), x[0].size))
    step = RULES.gap_step * np.abs(x).max(axis=(1, 2), initial=np.finfo(float).tiny)
    sides = (balance.contact.older(side) for side in (step, -step))
    up, down = (of.cycle(x, balance.basis, balance.memory, jacobian=False, omega=omega).force for of in sides)
    return np.asarray((up - down).reshape(len(x), -1) / (2 * step[:, None]))


def work_slope(balance: HarmonicBalance, x: np.ndarray, cycle: ContactCycle) -> np.ndarray:
    """(n_pair, n_component * n_coeff) d friction work of a pair / d its x, at the gap that it has [N]."""
    basis, t, jac = balance.basis, balance.contact.tangential, cycle.slope
    force_slope = jac.reshape(*x.shape, -1).transpose(0, 3, 1, 2)
    slope = basis.work_per_cycle(force_slope, x[:, None])[:, :, t].sum(axis=2)
    turned = np.zeros_like(x)  # the work of f against a unit of each coefficient of x
    turned[:, t] = -np.pi * (cycle.force @ basis.rate)[:, t]
    return np.asarray(slope + turned.reshape(len(x), -1))


@dataclass(frozen=True)
class _Sample:
    """Contact cycles of one duty; work [J] and falls = -d work / d depth [N] carry the duty's share.

    column : (n_pair, n_component * n_coeff) -d force / d depth [N/m]; of a gap d force / d (static normal motion)"""

    cycle: ContactCycle
    column: np.ndarray
    work: np.ndarray
    falls: np.ndarray

    def updated(self, pairs: np.ndarray, part: _Sample) -> _Sample:
        """This with the rows of some pairs replaced."""
        for target, values in (
            (self.cycle.force, part.cycle.force),
            (self.cycle.slope, part.cycle.slope),
            (self.cycle.status, part.cycle.status),
            (self.column, part.column),
            (self.work, part.work),
            (self.falls, part.falls),
        ):
            target[pairs] = values
        return self
