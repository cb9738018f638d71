"""What one scene answers to the targets of a fit; cycles and wear runs that several numbers share are solved once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import State
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.derivatives import cycle_derivatives
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.quantity import WearQuantity
from tribodyn.hbm.quantity_sources import SolvedCycle, WornContact
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.reduction.linear import linear_modes
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.run import joints, modelling, settings, wear_run
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.wear import Place
from tribodyn.workflows.studies.fits.curve_target import CurveTarget
from tribodyn.workflows.studies.fits.fit_file import Target

Side = tuple[str, float, "SceneAnswers", "SceneAnswers"]


class SceneAnswers:
    """What one scene says; cycles and wear runs that several numbers share are solved once.

    neighbour : of a scene that differs little, from whose cycles those of this one are found"""

    def __init__(self, file: SceneFile, model: modelling.Model, neighbour: SceneAnswers | None = None):
        self.file, self.model, self._near_points = file, model, {} if neighbour is None else neighbour._points
        self._points: dict[tuple[Place, float], OperatingPoint] = {}
        self._derived: dict[tuple[Place | None, float], Derivatives] = {}
        self._runs: dict[float, WearHistory] = {}

    def all_to(self, targets: Mapping[str, Target | CurveTarget]) -> np.ndarray:
        """(n_measured,) its numbers, of a curve one for each point."""
        parts = (
            target.values(self.file, self.model) if isinstance(target, CurveTarget) else [self.to(name, target)]
            for name, target in targets.items()
        )
        return np.concatenate([np.asarray(part, float) for part in parts])

    def slopes(self, target: Target, sides: Sequence[Side]) -> Sequence[float]:
        """Derivatives of a number by parameters.

        sides : name of each, step, and the scene a step above and a step below
        Raises  NoDerivative where a number has none, or none but by running again"""
        if target.mode is not None:
            pairs = [[scene._frequency(target.of == "stuck frequency", target.mode) for scene in s[2:]] for s in sides]
            return [(up - down) / (2 * side[1]) for (up, down), side in zip(pairs, sides, strict=True)]
        if isinstance(target.quantity, WearQuantity):
            raise NoDerivative("a wear run is repeated")
        if (target.at, target.load) not in self._derived:
            self._derived[target.at, target.load] = self._derivatives(target.at, target.load, sides)
        derivatives_at = self._derived[target.at, target.load]
        if target.of not in derivatives_at.names:
            return [0.0] * len(sides)
        return [float(slope) for slope in derivatives_at.slopes[derivatives_at.names.index(target.of)]]

    def _derivatives(self, place: Place | None, load: float, sides: Sequence[Side]) -> Derivatives:
        """Of a cycle at a place, at rest where there is none; raises NoDerivative."""
        balance, options = self.model.balance, settings.newton_options(self.file.scene)
        changes = [
            ParameterChange(name, step, BalanceInputs.of(upper.model.balance), BalanceInputs.of(lower.model.balance))
            for name, step, upper, lower in sides
        ]
        if place is None:
            return cycle_derivatives.at_frequency(
                balance.with_load(0.0), self._state_at_rest, settings.OUTPUT, changes, options=options
            )
        balance, state = balance.with_load(load), self._point(place, load).state
        if place.peak == 1.0:
            return cycle_derivatives.at_peak(balance, state, settings.OUTPUT, changes, options=options)
        derivatives_at = cycle_derivatives.at_frequency(balance, state, settings.OUTPUT, changes, options=options)
        if place.peak is not None:  # beside a peak, and moves with it
            peak = self._point(Place(peak=1.0), load).state
            moves = cycle_derivatives.at_peak(balance, peak, settings.OUTPUT, changes, options=options).slopes[0]
            ride = np.outer(derivatives_at.by_frequency, 2 * np.pi * place.peak * moves)
            derivatives_at = replace(derivatives_at, slopes=derivatives_at.slopes + ride)
        return derivatives_at

    def to(self, name: str, target: Target) -> float:
        """The value of a target in this scene; raises SolveFailed, naming it, where there is none."""
        try:
            if target.quantity is None:
                return self._frequency(target.of == "stuck frequency", target.mode or 1)
            if isinstance(target.quantity, WearQuantity):
                return self._wear(target.quantity, target.left)
            if target.at is None:
                balance, state = self.model.balance, self._state_at_rest
            else:
                balance, state = self.model.balance.with_load(target.load), self._point(target.at, target.load).state
        except SolveFailed as failure:
            raise SolveFailed(f"measured.{name}: {failure}") from None
        value = target.quantity.value(
            SolvedCycle.of(balance, state, settings.OUTPUT, wear_run.coefficients(self.file.scene))
        )
        if value is None:
            raise SolveFailed(f"measured.{name}: the scene has no {target.quantity.label}")
        return value

    def _frequency(self, stuck: bool, mode: int) -> float:
        reduced = self.model.reduced
        if mode > reduced.system.n_dof:
            raise Refusal(f"there is no mode {mode}: the model has {reduced.system.n_dof}")
        springs = joints.contact_stiffness(self.file.scene, reduced) if stuck else None
        return float(linear_modes(reduced, springs, mode)[0][mode - 1])

    @cached_property
    def _state_at_rest(self) -> State:
        still = self.model.balance.with_load(0.0)
        solution = newton.solve_from_rest(still, still.omega_max, settings.newton_options(self.file.scene))
        if not solution.converged:
            raise SolveFailed(f"the contact at rest: {solution.outcome}")
        return solution.state

    def _point(self, where: Place, load: float) -> OperatingPoint:
        if (where, load) not in self._points:
            site = settings.site_of(self.file.scene, where)
            balance, previous, point = self.model.balance.with_load(load), self._near_points.get((where, load)), None
            if previous is not None and previous.state.x.shape == (balance.contact.n_pair, *previous.state.x.shape[1:]):
                point = site.solve_near(balance, previous.state.omega, previous.state.x)
            if point is None or not point.solution.converged:
                point = site.solve(balance)
            if not point.solution.converged:
                raise SolveFailed(point.solution.outcome)
            self._points[where, load] = point
        return self._points[where, load]

    def _wear(self, quantity: WearQuantity, life_share: float) -> float:
        """A quantity of the wear, at the end of the life."""
        if self.file.scene.wear is None:
            raise SceneError(f"{quantity.label} is measured, but the scene has no [wear]")
        if life_share not in self._runs:
            self._runs[life_share] = wear_run.worn_out(self.file, self.model, life_share)
        run, contact = self._runs[life_share], self.model.balance.contact
        life = cycles_to_preload(run, life_share)
        if life is None:
            raise SolveFailed(f"the preload did not fall to {life_share:.3g} of its start: {run.end}")
        worn = WornContact(
            run, self.model.reduced.interface.area, contact.gap, contact.components, self.model.balance.basis,
            {joint.name: slice(int(joint.rows[0]), int(joint.rows[-1]) + 1) for joint in contact.joints}, life_share,
            places=self.model.balance.places, shares=tuple(duty.share for duty in self.file.scene.wear.duties),
        )  # fmt: skip
        if not quantity.grows:
            return float(quantity.value(worn) or 0.0)
        values = [quantity.value(replace(worn, row=row)) or 0.0 for row in range(len(run.cycles))]
        return float(np.interp(life, run.cycles, values))
