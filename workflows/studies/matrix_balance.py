"""One's own matrices: where they touch and by which law, reduced, balanced, followed, integrated and worn.

Units are SI and frequencies in Hz, in what is given and in the `frequency` of what comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from tribodyn.fem.interface import COMPONENTS, ContactInterface, join
from tribodyn.hbm import continuation
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint, joint_transitions
from tribodyn.hbm.continuation import nonlinear_modes as modes
from tribodyn.hbm.continuation.branch import Branch, amplitude as vibration
from tribodyn.hbm.continuation.control import constant_response, driven, phase_resonance
from tribodyn.hbm.continuation.methods.arc_length import solve_along_load
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
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
from tribodyn.reduction import foreign, linear_damping as damping
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.foreign import ForeignMatrices, Terms
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal

HZ = 2 * np.pi  # rad/s of one Hz


@dataclass(frozen=True)
class MatrixContact:
    """A joint: where a structure touches, with its contact law.

    name : unique in a structure; interface : what `Matrices.contact` or `Matrices.contact_rows` makes
    law : name of a contact law; numbers : the law's own, such as {"friction": 0.4}, scalar or (n_pair,)
    tangential_stiffness, normal_stiffness : of the whole joint [N/m], shared by area, or (n_pair,) of each pair
    """

    name: str
    interface: ContactInterface
    law: str = "jenkins"
    tangential_stiffness: float | np.ndarray = 0.0
    normal_stiffness: float | np.ndarray = 0.0
    numbers: Mapping[str, float | np.ndarray] = field(default_factory=dict)

    @property
    def stiffness(self) -> np.ndarray:
        """(n_pair, n_component) contact springs [N/m]."""
        share = self.interface.area / self.interface.area.sum()
        by_component = {"t1": self.tangential_stiffness, "t2": self.tangential_stiffness, "n": self.normal_stiffness}
        columns = [
            by_component[c] * share if np.ndim(by_component[c]) == 0 else by_component[c]
            for c in self.interface.components
        ]
        return np.column_stack([np.broadcast_to(np.asarray(column, float), share.shape) for column in columns])

    def joint(self, pairs: np.ndarray) -> Joint:
        """The joint of a balance whose interface has its pairs at these places."""
        i, numbers = self.interface, dict[str, Any](self.numbers)
        parameters = ContactParameters.of(i.components, self.stiffness, gap=i.gap, **numbers)
        return Joint(self.name, self.law, parameters, pairs)


@dataclass(frozen=True)
class Structure:
    """Matrices with the contacts that hold them, reduced or as they are.

    model : reduced model whose interface has the pairs of all contacts, one contact after the other
    """

    model: ReducedModel
    contacts: tuple[MatrixContact, ...]

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The contacts as joints of the model."""
        ends = np.cumsum([contact.interface.n_pair for contact in self.contacts])
        starts = ends - [contact.interface.n_pair for contact in self.contacts]
        return tuple(c.joint(np.arange(a, b)) for c, a, b in zip(self.contacts, starts, ends, strict=True))

    def frequencies(self, n: int = 10, *, stuck: bool = False) -> np.ndarray:
        """The lowest natural frequencies (n,) [Hz], contacts absent, or closed and stuck."""
        springs = None
        if stuck:
            all_components = self.model.interface.components
            springs = np.concatenate(
                [_wide(c.stiffness, c.interface.components, all_components) for c in self.contacts]
            )
        return linear_modes(self.model, springs, min(n, self.model.system.n_dof))[0]

    def balance(
        self,
        harmonics: Sequence[int] = (0, 1),
        *,
        up_to: float,
        static: Mapping[str, float] | None = None,
        harmonic: Mapping[int, Mapping[str, complex]] | None = None,
        samples: int = 128,
        transitions: str = "auto",
        tolerance: float = 1e-8,
    ) -> HertzBalance:
        """The harmonic balance of the structure under loads.

        up_to : highest excitation frequency that will be asked for [Hz]
        static : load -> N; harmonic : order -> {load -> complex amplitude F of Re F exp(i order w t) [N]}
        samples : time samples of a cycle; transitions : "located" finds stick, slip and lift between them, "sampled"
            does not, "auto" does where every contact law can
        Raises  ValueError for unknown loads, orders that are not kept, laws that do not fit
        """
        chosen = joint_transitions(self.joints) if transitions == "auto" else transitions
        basis = HarmonicBasis(tuple(harmonics), samples, chosen)
        loads = Excitation.of(static, harmonic)
        problem = HarmonicBalance.of(self.model, self.joints, basis, loads, HZ * up_to)
        return HertzBalance(problem, NewtonOptions(tolerance=tolerance))


@dataclass(frozen=True)
class Cycle:
    """One periodic vibration as the harmonic balance has it.

    state : what was solved; outcome : why the solve ended; its text is a sentence
    """

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
        """Square root of the sum over harmonics of a_h^2 + b_h^2 of an output [m]."""
        return float(vibration(self.outputs[output]))

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

    problem : the same in rad/s, as the solver has it; newton : how exactly it is solved
    """

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
        *,
        control: Literal["force", "amplitude", "phase"] = "force",
        amplitude: float | tuple[float, float] | None = None,
        output: str | None = None,
        **options: Any,
    ) -> Branch:
        """The response from one frequency to another [Hz] by a continuation method; downwards where start > stop.

        points : for the methods that take them; options : of the method, see its `Options`
        control : what the test holds: the force; the fundamental amplitude [m] of an output, the first by default; or
            its lag of a quarter of a cycle, while the amplitude goes from the first to the last of two and the mode at
            rest lies between the frequencies. The force is then the branch's `load_factor`
        Raises  ValueError for methods and options that do not exist
        """
        if control == "phase":
            if not isinstance(amplitude, tuple):
                raise Refusal("control of the phase: give the first and the last amplitude [m], as (1e-6, 1e-3)")
            way = modes.BackboneOptions(points or modes.BackboneOptions.n_points, **options, newton=self.newton)
            low, high = HZ * min(start, stop), HZ * max(start, stop)
            return phase_resonance(self.problem, self._output(output), low, high, *amplitude, way)
        problem = self.problem
        if control == "amplitude":
            if not isinstance(amplitude, (int, float)):
                raise Refusal("control of the amplitude: give the one amplitude [m] that is held")
            problem = constant_response(problem, self._output(output), amplitude)
        module = continuation.load(method)
        chosen = {**({} if points is None else {"n_points": points}), **options, "newton": self.newton}
        try:
            method_options = module.Options(**chosen)
        except TypeError as wrong:
            raise Refusal(f"continuation {method}: {wrong}") from None
        branch: Branch = module.follow(problem, HZ * start, HZ * stop, method_options)
        return driven(problem, branch) if control == "amplitude" else branch

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

        options : of hbm.time.stepper.Options, such as steps=1024 a period
        """
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
        lost_below : share of the first preload at which the run ends; resume : history to continue
        """
        name = self._output(output)
        if isinstance(at, tuple):
            site: AtPeak | AtFrequency = AtPeak(name, HZ * at[0], HZ * at[1], newton=self.newton)
        else:
            site = AtFrequency(name, HZ * at, self.newton)
        problem = WearProblem(self.problem, (Duty(site),), law, self.problem.model.interface.area, lost_below)
        if (step is None) == (tolerance is None) or (tolerance is None) != (scale is None):
            raise Refusal("wear needs either step, or tolerance with the depth scale that it is a share of")
        if step is not None:
            return evolve(thesis.Rule(problem, step), max_steps, on_row, resume)
        assert tolerance is not None
        assert scale is not None
        share = Tolerance(tolerance, scale)
        return evolve(error_controlled.Rule(problem, share), max_steps, on_row, resume)

    def _output(self, output: str | None) -> str:
        names = self.problem.compliance.output_names
        if output is not None and output not in names:
            raise Refusal(f"there is no output '{output}': there are {', '.join(names)}")
        return output or names[0]


def wear_law(name: str, **numbers: float | np.ndarray) -> JointWear:
    """A wear law with its own numbers, such as wear_law("energy", coefficient=2e-15), in the units that it declares.

    Raises  ValueError where there is no such law, or a number is missing or unknown
    """
    return JointWear.of(name, **numbers)


def reduce(
    matrices: ForeignMatrices,
    contacts: MatrixContact | Sequence[MatrixContact],
    *,
    loads: Mapping[str, Terms],
    outputs: Mapping[str, Terms],
    modes: int | None = None,
    cutoff: float | None = None,
    damping_ratio: float | None = None,
) -> Structure:
    """The structure that matrices and contacts make, by Craig-Bampton or as it is.

    loads, outputs : name -> a DOF, {DOF: factor} or a vector (n,); an output is a displacement w^T q
    modes : fixed-interface modes kept, or cutoff : all up to this frequency [Hz]; neither keeps the matrices whole
    damping_ratio : of every mode without contact, where the matrices hold no damping; there may be none at all
    Raises  ValueError for contacts of one name, DOFs that do not exist, two kinds of damping
    """
    touching = (contacts,) if isinstance(contacts, MatrixContact) else tuple(contacts)
    if not touching:
        raise Refusal("a structure needs at least one contact")
    system, interface = matrices.system(loads, outputs), joined([contact.interface for contact in touching])
    if modes is None and cutoff is None:
        model = foreign.reduced_model(system, interface)
    else:
        model = craig_bampton(system, interface, modes, cutoff)
    if damping_ratio is not None:
        if model.system.damping is not None:
            raise Refusal("the matrices hold a damping matrix: give no damping_ratio besides")
        model = model.with_damping(lambda system, rows: damping.modal_damping(system, damping_ratio))
    return Structure(model, touching)


def joined(interfaces: Sequence[ContactInterface]) -> ContactInterface:
    """Interfaces of one model as one, their pairs one after the other; rows that one has not are zero."""
    used = {name for interface in interfaces for name in interface.components}
    components = tuple(name for name in COMPONENTS if name in used)
    wide = []
    for interface in interfaces:
        place = [components.index(name) for name in interface.components]
        rows_of_interface = sp.coo_matrix(interface.B)
        pair, component = np.divmod(rows_of_interface.row, len(place))
        to = pair * len(components) + np.array(place)[component]
        rows = sp.csr_matrix(
            (rows_of_interface.data, (to, rows_of_interface.col)),
            (interface.n_pair * len(components), rows_of_interface.shape[1]),
        )
        wide.append(replace(interface, components=components, B=rows))
    return join(wide)


def _wide(stiffness: np.ndarray, used: tuple[str, ...], components: tuple[str, ...]) -> np.ndarray:
    """Springs (n_pair, n_own) in the columns of all components, zero in the others."""
    wide = np.zeros((len(stiffness), len(components)))
    wide[:, [components.index(name) for name in used]] = stiffness
    return wide
