"""One's own matrices: where they touch and by which law, reduced, balanced, followed, integrated and worn.

Units are SI and frequencies in Hz, in what is given and in the `frequency` of what comes back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tribodyn.hbm import continuation, harmonics
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import nonlinear_modes as modes
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods.arc_length import solve_along_load
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import Outcome, SolveEnd
from tribodyn.hbm.stability import branch_stability
from tribodyn.hbm.time import time_integration as time, verify
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.wear.history import WearHistory, WearRow
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.refusal import Refusal

HZ = 2 * np.pi  # rad/s of one Hz


@dataclass(frozen=True)
class Cycle:
    """One periodic vibration as the harmonic balance has it.

    state : what was solved; outcome : why the solve ended; its text is a sentence"""

    problem: HarmonicBalance
    state: State
    outcome: Outcome[SolveEnd]

    @property
    def converged(self) -> bool:
        """Whether it is a solution."""
        return self.outcome.kind is SolveEnd.CONVERGED

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.state.omega / HZ

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """Output -> (n_coeff,) Fourier coefficients [x_0, a_1, b_1, ...] [m]."""
        return dict(zip(self.problem.compliance.output_names, self.problem.outputs(self.state), strict=True))

    def amplitude(self, output: str) -> float:
        """Half the range of an output over the cycle [m]."""
        return float(harmonics.amplitude(self.outputs[output], self.problem.basis.harmonics))

    @property
    def displacement(self) -> np.ndarray:
        """(n_pair, n_component, n_coeff) relative displacement at the contacts [m]."""
        return self.state.x

    @property
    def force(self) -> np.ndarray:
        """(n_pair, n_component, n_coeff) contact force [N]."""
        return self.state.cycle.force

    @property
    def status(self) -> np.ndarray:
        """(n_pair,) bits over the cycle: 1 sticks, 2 slips, 4 separates."""
        return self.state.cycle.status

    @property
    def energy(self) -> np.ndarray:
        """(n_pair,) friction work per cycle [J]."""
        return self.problem.energy(self.state)

    @property
    def preload(self) -> dict[str, float]:
        """Joint -> static normal force [N]."""
        return self.problem.preload_by_joint(self.state)


@dataclass(frozen=True)
class HertzBalance:
    """A harmonic balance with frequencies in Hz: from `Structure.balance`, or `Balance(build(scene).balance)`.

    problem : the same in rad/s, as the solver has it; newton : how exactly it is solved"""

    problem: HarmonicBalance
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    @property
    def up_to(self) -> float:
        """Highest excitation frequency [Hz]."""
        return self.problem.omega_max / HZ

    def with_load(self, factor: float) -> HertzBalance:
        """The same with all loads but the static ones times a factor."""
        return replace(self, problem=self.problem.with_load(factor))

    def with_gap(self, gap: np.ndarray) -> HertzBalance:
        """The same with another gap of every pair (n_pair,) [m], as wear makes it."""
        return replace(self, problem=self.problem.with_gap(gap))

    def solve(self, frequency: float) -> Cycle:
        """The vibration at one frequency [Hz], looked for from rest."""
        solution = solve_along_load(self.problem, HZ * frequency, self.newton)
        return Cycle(self.problem, solution.state, solution.outcome)

    def peak(self, start: float, stop: float, output: str | None = None) -> Cycle:
        """The highest resonance of an output, the first by default, between two frequencies [Hz]."""
        point = AtPeak(self._output(output), HZ * start, HZ * stop, newton=self.newton).solve(self.problem)
        return Cycle(self.problem, point.state, point.solution.outcome)

    def response(
        self,
        start: float,
        stop: float,
        points: int | None = None,
        method: str = "natural",
        **options: Any,
    ) -> Branch:
        """The response from one frequency to another [Hz] by a continuation method; downwards where start > stop.

        points : for the methods that take them; options : of the method, see its `Options`
        Raises  Refusal for methods and options that do not exist"""
        module = continuation.load(method)
        chosen = {**({} if points is None else {"n_points": points}), **options, "newton": self.newton}
        try:
            method_options = module.Options(**chosen)
        except TypeError as wrong:
            raise Refusal(f"continuation {method}: {wrong}") from None
        branch: Branch = module.follow(self.problem, HZ * start, HZ * stop, method_options)
        return branch

    def stability(self, branch: Branch) -> branch_stability.BranchStability:
        """Stability of every point of a response of this balance, and its bifurcations, by Hill's method."""
        return branch_stability.stability_along(self.problem, branch)

    def nonlinear_mode(
        self, start: float, stop: float, mode: int = 0, output: str | None = None, points: int = 40
    ) -> modes.Backbone:
        """Frequency and damping of a nonlinear mode between two amplitudes [m] of an output; static loads act."""
        return modes.backbone(
            self.problem, start, stop, mode, self._output(output), modes.BackboneOptions(points, newton=self.newton)
        )

    def integrate(self, frequency: float, start: Cycle | None = None, **options: Any) -> time.PeriodicMotion:
        """The periodic motion at a frequency [Hz] by integration in time, from a cycle of the balance or from rest.

        options : of hbm.time.stepper.Options, such as steps=1024 a period"""
        return time.integrate(self.problem, HZ * frequency, None if start is None else start.state, Options(**options))

    def verify(self, cycle: Cycle, **options: Any) -> verify.Verification:
        """A cycle beside integration in time from it; options : as `integrate`."""
        return verify.verify(self.problem, cycle.state, Options(**options))

    def wear(
        self,
        law: JointWear | Mapping[str, JointWear],
        *,
        at: float | tuple[float, float],
        step: float | None = None,
        tolerance: float | None = None,
        scale: float | None = None,
        output: str | None = None,
        max_steps: int = 100,
        lost_below: float = 0.0,
        on_row: Callable[[WearRow], None] | None = None,
        resume: WearHistory | None = None,
    ) -> WearHistory:
        """Wear the contacts.

        law : such as wear_law("energy", coefficient=2e-15), for all contacts or by their names; others do not wear
        at : frequency of the cycles [Hz], or the range (start, stop) whose resonance of `output` they follow
        step : largest depth of one explicit step [m]; or tolerance : local error of an implicit one, a share of the
            depth `scale` [m]
        lost_below : share of the first preload at which the run ends; resume : history to continue"""
        name = self._output(output)
        if isinstance(at, tuple):
            site: AtPeak | AtFrequency = AtPeak(name, HZ * at[0], HZ * at[1], newton=self.newton)
        else:
            site = AtFrequency(name, HZ * at, self.newton)
        problem = WearProblem(self.problem, (Duty(site),), law, self.problem.model.interface.area, lost_below)
        if step is not None and tolerance is None and scale is None:
            return evolve(thesis.Rule(problem, step), max_steps, on_row, resume)
        if step is None and tolerance is not None and scale is not None:
            rule = error_controlled.Rule(problem, Tolerance(tolerance, scale))
            return evolve(rule, max_steps, on_row, resume)
        raise Refusal("wear needs either step, or tolerance with the depth scale that it is a share of")

    def _output(self, output: str | None) -> str:
        names = self.problem.compliance.output_names
        if output is not None and output not in names:
            raise Refusal(f"there is no output '{output}': there are {', '.join(names)}")
        return output or names[0]
