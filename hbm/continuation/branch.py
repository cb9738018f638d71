"""What a continuation returns: solution points, the outcome of each, and how the curve ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import SOLVED, BranchEnd, Outcome, SolveEnd

STRESS, GAUGE = "stress ", "gauge "
"""What the names of outputs begin with that are components of stress [Pa], and strains."""


def unit_of(output: str) -> str:
    """Unit of an observed output; empty for a strain."""
    return "Pa" if output.startswith(STRESS) else "" if output.startswith(GAUGE) else "m"


@dataclass(frozen=True)
class Branch:
    """Points of a response curve in the order they were found.

    omega : (n_point,) excitation frequency [rad/s]
    output_names : names of the observed outputs
    response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m], or see `unit_of`
    harmonics : that the coefficients have
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point CONVERGED, BESIDE_PEAK or UNLIMITED (a solution), or what went wrong
    newton_steps : (n_point,) Newton steps spent
    end : why and where the branch ends; its text is a sentence
    folds : indices of the points that are folds, where the branch turns back
    parameter_name : what was stepped; parameter : (n_point,) its values, the same as omega where it is the frequency"""

    omega: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[Outcome[SolveEnd], ...]
    newton_steps: np.ndarray
    end: Outcome[BranchEnd]
    harmonics: tuple[int, ...]
    folds: tuple[int, ...] = ()
    parameter_name: str = "frequency"
    parameter: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def ended(self) -> BranchEnd:
        """Why the branch ends."""
        return self.end.kind

    @property
    def arrived(self) -> bool:
        """Whether the branch came to the value it was to stop at, with jumps or without."""
        return self.ended in (BranchEnd.REACHED, BranchEnd.JUMPED)

    @property
    def converged(self) -> np.ndarray:
        """(n_point,) whether the point is a solution."""
        return np.array([outcome.kind in SOLVED for outcome in self.outcome])

    @property
    def frequency(self) -> np.ndarray:
        """(n_point,) excitation frequency [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def displacements(self) -> tuple[str, ...]:
        """Names of the outputs that are displacements."""
        return tuple(name for name in self.output_names if unit_of(name) == "m")

    def amplitude(self, output: str) -> np.ndarray:
        """(n_point,) vibration amplitude of an output, see `hbm.harmonics.amplitude` [m]."""
        return amplitude(self.response[:, self.output_names.index(output)], self.harmonics)

    def fundamental(self, output: str) -> np.ndarray:
        """(n_point,) complex amplitude a_1 - i b_1 of an output [m]."""
        row = self.response[:, self.output_names.index(output)]
        static = row.shape[1] % 2
        amplitudes: np.ndarray = row[:, static] - 1j * row[:, static + 1]
        return amplitudes

    def height(self, output: str) -> np.ndarray:
        """(n_point,) amplitude of an output [m], -1 at no solution."""
        return np.where(self.converged, self.amplitude(output), -1.0)

    def highest(self, output: str) -> int:
        """The point that head, errors, pictures, tables and studies speak of: the highest of an output, peak or not."""
        return int(np.argmax(self.height(output)))

    def peak(self, output: str) -> int | None:
        """The highest point of an output, None where `no_peak` says why that is none."""
        return None if self.no_peak(output) else self.highest(output)

    def no_peak(self, output: str) -> str:
        """Why the highest point of an output is no peak: an end of the curve, or a higher one not solved; else ""."""
        if self.highest(output) in (0, len(self.omega) - 1):
            return "the response is highest at an end of response.frequency, widen it"
        for i in (self.highest(output) - 1, self.highest(output) + 1):
            if not self.converged[i]:
                return f"the response is highest beside {self.frequency[i]:.5g} Hz, where no solution was found"
        for hertz, end in zip(self.frequency, self.outcome, strict=True):
            if end.kind is SolveEnd.UNLIMITED:
                return str(end)
            if end.kind is SolveEnd.BESIDE_PEAK:
                return f"none was found beside the point at {hertz:.5g} Hz; more response.points"
        return ""

    def inserted(self, at: int, point: BranchPoint) -> Branch:
        """The branch with one more point before point `at`."""
        rows: dict[str, Any] = {
            "omega": point.omega,
            "response": point.response,
            "energy": point.energy,
            "newton_steps": point.steps,
        }
        rows |= {"contact": point.x.reshape(self.contact.shape[1:])}
        if len(self.parameter):
            rows["parameter"] = point.value
        grown: dict[str, Any] = {name: np.insert(getattr(self, name), at, row, axis=0) for name, row in rows.items()}
        outcome = (*self.outcome[:at], point.outcome, *self.outcome[at:])
        return replace(self, **grown, outcome=outcome, folds=tuple(i + (i >= at) for i in self.folds))


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One point of a branch; the fields are those of `Branch`, x (n_pair, n_component, n_coeff) [m]."""

    value: float
    x: np.ndarray
    omega: float
    response: np.ndarray
    energy: float
    outcome: Outcome[SolveEnd]
    steps: int


OnPoint = Callable[[int, int, BranchPoint], None]
"""Called as a branch grows with points done, points expected, and the last point."""


class BranchBuilder:
    """Collects solutions into a Branch.

    parameter : what the continuation steps in
    points : collected so far; value, x : of them; folds : indices of those that are folds"""

    def __init__(self, parameter: Parameter):
        self._parameter = parameter
        self.points: list[BranchPoint] = []
        self.value: list[float] = []
        self.x: list[np.ndarray] = []
        self.folds: list[int] = []

    def add(self, value: float, solution: Solution, fold: bool = False) -> None:
        """Append one solution, converged or not, at a value of the parameter."""
        state = solution.state
        balance, _ = self._parameter.place(value)
        response, energy = balance.outputs(state), float(balance.energy(state).sum())
        self.append(BranchPoint(value, state.x, state.omega, response, energy, solution.outcome, solution.steps), fold)

    def append(self, point: BranchPoint, fold: bool = False) -> None:
        """Append a point that is known already."""
        self.points.append(point)
        self.value.append(point.value)
        self.x.append(point.x)
        if fold:
            self.mark_fold()

    @property
    def stretch(self) -> int:
        """The first point behind the last fold or unsolved point: those before it lie on another leg of the curve."""
        unsolved = (i for i, p in enumerate(self.points[:-1]) if p.outcome.kind is not SolveEnd.CONVERGED)
        return max((-1, *self.folds[-1:], *unsolved)) + 1

    def mark_fold(self) -> None:
        """Mark the last point as a fold."""
        if len(self.value) - 1 not in self.folds:
            self.folds.append(len(self.value) - 1)

    def truncate(self, n_point: int) -> None:
        """Keep the first points only."""
        del self.value[n_point:], self.x[n_point:], self.points[n_point:]
        self.folds = [i for i in self.folds if i < n_point]

    def tell(self, on_point: OnPoint | None, stop: float, max_points: int) -> None:
        """Call `on_point`, where there is one, with points done, points expected at the present pace, the last one."""
        if on_point is not None:
            done, share = len(self.value), abs(self.value[-1] - self.value[0]) / abs(stop - self.value[0])
            on_point(done, max(done, min(max_points, round(done / max(share, 1e-3)))), self.points[-1])

    def finish(self, end: Outcome[BranchEnd]) -> Branch:
        """The branch; `end` says why it ends where it ends."""
        points, x, last = self.points, np.stack(self.x), self._parameter.place(self.value[-1])[0]
        return Branch(
            omega=np.array([p.omega for p in points]),
            output_names=last.compliance.output_names,
            response=np.stack([p.response for p in points]),
            contact=x.reshape(len(x), -1, x.shape[-1]),
            energy=np.array([p.energy for p in points]),
            outcome=tuple(p.outcome for p in points),
            newton_steps=np.array([p.steps for p in points]),
            end=end,
            harmonics=last.basis.harmonics,
            folds=tuple(self.folds),
            parameter_name=self._parameter.name,
            parameter=np.array(self.value),
        )
