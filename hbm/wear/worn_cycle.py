"""The cycle of one duty at a state of the wear, and the slopes of its forces and of the depth that it wears."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.continuation.operating_condition import AtPeakRatio
from tribodyn.hbm.derivatives.cycle_derivatives import peak_moves
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.derivatives.parameter_effects import ParameterEffects
from tribodyn.hbm.wear.implicit_stage import has_aging, work_slope
from tribodyn.hbm.wear.sdirk_stages import depth_per_work
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem, WearState, wear_of

if TYPE_CHECKING:
    from tribodyn.hbm.wear.tangent import Tangent


@dataclass(frozen=True)
class WornCycle:
    """The cycle of one duty at a state of the wear, and the slopes of its forces and of the depth that it wears."""

    tangent: Tangent
    duty: Duty
    solved: State
    state: WearState

    @cached_property
    def balance(self) -> HarmonicBalance:
        """Worn."""
        return self.tangent.problem.in_duty(self.duty, self.state.depth)

    @cached_property
    def changes(self) -> list[ParameterChange]:
        """Of the worn contact."""
        unworn, depth = self.tangent.problem.balance, self.state.depth
        return [_worn(change, unworn, self.balance, depth) for change in self.tangent.changes]

    @cached_property
    def law_changes(self) -> list[ParameterChange]:
        """What the numbers of wear laws change of the worn contact, whose age goes with the work."""
        ages, base = has_aging(self.balance.contact), BalanceInputs.of(self.balance)

        def inputs(problem: WearProblem) -> BalanceInputs:
            return BalanceInputs.of(problem.in_duty(self.duty, self.state.depth)) if ages else base

        return [ParameterChange("", step, inputs(up), inputs(down)) for up, down, step in self.tangent.by_law]

    def slopes(self, n: int) -> tuple[np.ndarray, ...]:
        """Changes of force and x (n_pair, n_component * n_coeff, n) at the same x and forces by n columns, d rate / d x
        (n_pair, n_component * n_coeff), d rate (n_pair, n), and d rate (n_pair,) by gap and by depth."""
        effects, problem = ParameterEffects(self.balance, self.solved), self.tangent.problem
        upper, lower = effects.of_gap()
        one_sided, by_work = (
            [(2 * (upper - lower), upper + lower)],
            {w.law for w in problem.wearing.values()} == {"energy"},
        )
        if by_work:  # in closed form by x and gap, which is faster; at a corner both are of the same side
            solved, basis, contact = self.solved, self.balance.basis, self.balance.contact
            gain = self.duty.share * depth_per_work(problem, self.state)
            rate_by_x = gain[:, None] * work_slope(self.balance, solved.x, solved.cycle)
            column = -solved.cycle.slope[:, :, contact.components.index("n") * basis.n_coeff]
            work = basis.work_per_cycle(column.reshape(solved.x.shape), solved.x)[:, contact.tangential]
            by_gap = gain * work.sum(axis=1)
        else:
            by_gap = self._by_gap()
            one_sided.append((self._by_gap(RULES.law_step) - by_gap, by_gap))
            rate_by_x = self._by_x()
        by_depth = by_gap * self.balance.contact.of_pairs("opening_slope")
        if not by_work or has_aging(self.balance.contact):
            by_depth = by_depth + self._by_age()
        if any(np.abs(differ).max() > RULES.corner * np.abs(size).max() for differ, size in one_sided):
            self.tangent.corners.append(self.state.cycles)
        force, x, rate = (np.zeros((*shape, n)) for shape in (rate_by_x.shape, rate_by_x.shape, (len(rate_by_x),)))
        for i, change in enumerate([*self.changes, *self.law_changes]):
            effect = np.mean(effects.of_change(change), axis=0)
            force[..., i], x[..., i] = effect[: 2 * rate_by_x.size].reshape(2, *rate_by_x.shape)
            rate[:, i] = self._by(change)
        for i, (up, down, step) in enumerate(self.tangent.by_law, len(self.changes)):
            rate[:, i] += (self._rate(problem=up) - self._rate(problem=down)) / (2 * step)
        later = RULES.law_step * self.state.cycles  # steps that are longer begin later, too
        aged = (self._rate(later=later) - self._rate(later=-later)) / (2 * RULES.law_step)
        rate[:, len(self.changes) + len(self.tangent.by_law)] = aged
        return force, x, rate_by_x, rate, by_gap, by_depth

    def _rate(
        self,
        balance: HarmonicBalance | None = None,
        x: np.ndarray | None = None,
        problem: WearProblem | None = None,
        deeper: np.ndarray | float = 0.0,
        later: float = 0.0,
    ) -> np.ndarray:
        """(n_pair,) share of the duty in the depth per cycle [m], with something changed."""
        changed, x = balance or self.balance, self.solved.x if x is None else x
        omega = self.solved.omega
        cycle = changed.contact.cycle(x, changed.basis, changed.memory, jacobian=False, omega=omega)
        state = replace(self.solved, x=x, cycle=cycle)
        depth, cycles = self.state.depth + deeper, self.state.cycles + later
        return self.duty.share * wear_of(problem or self.tangent.problem, changed, state, depth, cycles)[0]

    def _by(self, change: ParameterChange) -> np.ndarray:
        """(n_pair,) d rate by a parameter, at the same x."""
        base, sides, problem = self.balance, (change.above, change.below), self.tangent.problem
        slope = np.zeros(len(self.solved.x))
        if any(
            inputs.contact is not base.contact or inputs.memory is not base.memory or inputs.model is not base.model
            for inputs in sides
        ):
            up, down = (
                self._rate(
                    replace(base, contact=inputs.contact, memory=inputs.memory),
                    problem=replace(
                        problem, area=problem.area + inputs.model.interface.area - base.model.interface.area
                    ),
                )
                for inputs in sides
            )
            slope = (up - down) / (2 * change.step)
        return slope if change.contact_part is None else slope + self._by(change.contact_part)

    def _by_gap(self, reach: float = RULES.gap_step) -> np.ndarray:
        """(n_pair,) d rate by the gap at the same x."""
        base, gap, step = self.balance, self.balance.contact.gap, reach * self._size
        up, down = (self._rate(base.with_gap(gap + s)) for s in (step, -step))
        return (up - down) / (2 * step)

    def _by_age(self) -> np.ndarray:
        """(n_pair,) d rate by the depth at the same x and gap, which numbers may go with, or a law ask for."""
        contact, step = self.balance.contact, RULES.gap_step * self._size
        up, down = (self._rate(self.balance.with_contact(contact.older(s)), deeper=s) for s in (step, -step))
        return (up - down) / (2 * step)

    def _by_x(self) -> np.ndarray:
        """(n_pair, n_component * n_coeff) d rate of each pair by its own x, one coefficient of all pairs at a time."""
        x, step = self.solved.x, RULES.gap_step * self._size
        moves = (step[:, None, None] * unit for unit in np.eye(x[0].size).reshape(-1, *x[0].shape))
        return np.stack([(self._rate(x=x + d) - self._rate(x=x - d)) / (2 * step) for d in moves], axis=1)

    @property
    def _size(self) -> np.ndarray:
        """(n_pair,) largest displacement [m]."""
        return np.asarray(np.abs(self.solved.x).max(axis=(1, 2), initial=1e-12))

    def moves(self) -> np.ndarray:
        """(n + 2 n_pair,) d omega of a place that moves with a peak, by changes, gaps and ages, see `peak_moves`."""
        contact, changes = self.balance.contact, [*self.changes, *self.law_changes]
        if not has_aging(contact):
            return np.append(self._moves(self.balance, changes), np.zeros(contact.n_pair))
        aging = self.balance.with_contact(_Ages(contact.components, contact.n_pair, contact.joints))
        return np.append(self._moves(self.balance, changes), self._moves(aging, []))

    def _moves(self, balance: HarmonicBalance, changes: list[ParameterChange]) -> np.ndarray:
        """(n_change + n_pair,) d omega."""
        site, state, ratio = self.duty.site, self.solved, 1.0
        if isinstance(site, AtPeakRatio):
            ratio, state = site.ratio, site.peak_near(balance, state.omega, state.x).state
        try:
            return ratio * peak_moves(balance, state, site.output, changes, site.newton)
        except NoDerivative as reason:
            raise NoDerivative(f"at {self.state.cycles:.4g} cycles {reason}") from None


@dataclass(frozen=True)
class _Ages(JointSet):
    """Joints of which another gap stands for another age."""

    def with_gap(self, gap: np.ndarray) -> JointSet:
        return self.older(gap - self.gap)


def _worn(
    change: ParameterChange, unworn: HarmonicBalance, balance: HarmonicBalance, depth: np.ndarray
) -> ParameterChange:
    """A change of a contact worn by a depth (n_pair,) [m]."""

    def there(posed: BalanceInputs) -> BalanceInputs:
        is_unworn = posed.contact is unworn.contact
        return replace(posed, contact=balance.contact if is_unworn else posed.contact.worn(depth), balance=None)

    twice = None if change.double_step is None else tuple(there(inputs) for inputs in change.double_step)
    touching = None if change.contact_part is None else _worn(change.contact_part, unworn, balance, depth)
    return replace(
        change, above=there(change.above), below=there(change.below), double_step=twice, contact_part=touching
    )
