"""The table of measured changes: one state of the scene solved again with one setting after the other refined.

Harmonics are refined on the scene's own mesh by what its contact force requires; modes, and on top of them mesh and
contact grid, with the harmonics of the scene. A refinement that meets a limit is not measured. Matrices have no mesh:
modes and harmonics, and the steps of wear, are all that can be refined in them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, names_with_error, of_wear_with_error
from tribodyn.hbm.wear import wear_rule
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.hbm.wear.steady_motion import untaken_periodic_share
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import contact_springs, ladders, operating_states, refine
from tribodyn.workflows.errors.operating_states import OperatingState, Values, relative_change
from tribodyn.workflows.errors.refinement_limits import DEFAULT, RefinementLimits
from tribodyn.workflows.result.answers import worn_contact
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement
from tribodyn.workflows.run import modelling, settings, wear_run
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile

NOT_SOLVED = (Refusal, SolverFailure)
"""What a finer model may answer instead of a value; anything else is a defect of the program and ends the run."""

FINER = 8  # times the samples, for a law that cannot locate its transitions: the error falls with their square
CONVERGED_SHARE = 1e-2  # residual over that of the start: a step alone is half of the way where few samples are far off
FEWEST_SAMPLES = 128


@dataclass
class ChangeTable:
    """Rows of a finished result as they are measured; say : called with what is refined next.

    first : state of the scene before wear, None without one, as `reason` says
    ratio : of the refined mesh, None where that was not solved; worn_ratio : of the mesh of the refined wear run
    last : the state on that mesh; wear_harmonics : of the refined wear run
    in_time : values of the state before wear along a motion in time that contradicts it, empty where none does"""

    file: SceneFile
    model: Model
    result: Result
    say: Callable[[str], None]
    limits: RefinementLimits
    rows: list[MeasuredChange] = field(default_factory=list)
    first: OperatingState | None = None
    reason: str = ""
    ratio: float | None = None
    worn_ratio: float | None = None
    last: OperatingState | None = None
    wear_harmonics: tuple[int, ...] = ()
    in_time: Values = field(default_factory=dict)

    @property
    def names_of_wear(self) -> tuple[str, ...]:
        """Names of the quantities of the whole wear whose errors are stated."""
        return tuple(quantity.name for quantity in of_wear_with_error(worn_contact(self.result)))

    def of(self, quantity: str) -> list[MeasuredChange]:
        """Rows of a quantity."""
        return [row for row in self.rows if row.quantity == quantity]

    def take_motion(self, values: Values, scatter: Values, mesh: tuple[Refinement, Values, str] | None = None) -> None:
        """Put values in time in place of those of the balance, whose harmonics and samples then do not matter.

        scatter : relative, of means and time steps
        mesh : row, values in time on another mesh, and which; None where not measured"""
        balance = {Refinement.HARMONICS, Refinement.SAMPLES, *((Refinement.MODES, Refinement.MESH) if mesh else ())}
        self.rows = [row for row in self.rows if row.quantity not in values or row.refinement not in balance]
        self.in_time = values
        for name, relative in scatter.items():
            self.estimate(Refinement.MOTION, [name], relative, "means in time and their steps")
        if mesh:
            self.add(mesh[0], values, *mesh[1:])

    def add(
        self, refinement: Refinement, values: Values, refined: Values, text: str, remaining: Values | None = None
    ) -> None:
        """What a refinement changed; remaining : relative changes that it leaves out."""
        for name, value in values.items():
            change = relative_change(value, refined[name]) + (remaining or {}).get(name, 0.0)
            self.rows.append(MeasuredChange(refinement, name, value, refined[name], change, text))

    def estimate(self, refinement: Refinement, quantities: Iterable[str], relative: float | None, text: str) -> None:
        """A relative change that was estimated without a second solution; None: not measured, as the text says."""
        self.rows += [MeasuredChange(refinement, name, None, None, relative, text) for name in quantities]

    @contextmanager
    def refusals(self, refinement: Refinement, text: str = "", names: Sequence[str] = ()) -> Iterator[None]:
        """A refinement is not measured where its model has no solution; text : before the reason."""
        try:
            yield
        except NOT_SOLVED as refusal:
            self.estimate(refinement, names or names_with_error(CycleQuantity), None, f"{text}{refusal}")

    def refine_harmonics(self, first: OperatingState) -> None:
        """The harmonics that the contact force requires, on the mesh of the scene."""
        self.say("harmonics that the contact force requires")
        harmonics = first.balance.basis.harmonics
        self.wear_harmonics = tuple(range(harmonics[0], max(harmonics[-1] + 3, 6)))
        with self.refusals(Refinement.HARMONICS):
            state, remaining = operating_states.refine_harmonics(first, self.limits)
            text = f"harmonics {', '.join(map(str, state.balance.basis.harmonics))}, and what they leave out"
            self.add(Refinement.HARMONICS, first.values, state.values, text, remaining)

    def refine_modes(self, first: OperatingState) -> OperatingState:
        """The first state with more modes, followed from its own solution; itself without more of them."""
        if (finer := refine.modes(self.file, self.limits.modes)) is None:
            return first
        self.say("more modes")
        wear, state = self.file.scene.wear, first
        with self.refusals(Refinement.MODES):
            model = modelling.build(finer, Progress(), first.balance.basis.harmonics)
            balance = model.balance.with_load(1.0 if wear is None else wear.duties[0].load)
            point = first.site.solve_near(balance, first.point.state.omega, first.point.state.x)
            state = operating_states.require_solved(replace(first, balance=balance, point=point))
            self.add(Refinement.MODES, first.values, state.values, f"{self.limits.modes} times as many modes")
        return state

    def finer_scene(self, first: OperatingState) -> tuple[SceneFile | None, float, str]:
        """The scene with more elements and modes as far as the limits allow, its ratio, and why there is none.

        Where no finer mesh is allowed, one coarser than that of the scene stands in for it, with a ratio below 1"""
        reason, limits = "", self.limits
        for ratio in (*limits.ratios, 1 / limits.coarser):
            try:
                finer, actual = refine.mesh(self.file, ratio)
            except refine.NoMesh as refusal:
                return None, 1.0, str(refusal)
            if ratio < 1 <= actual:
                break  # an imported mesh can only be cut
            dofs, unknowns = actual**3 * self.result.facts.full_dofs, actual**2 * first.balance.n_unknown
            if dofs > limits.max_dofs:
                reason = f"the refined mesh has {dofs:.2g} DOFs, above the limit of {limits.max_dofs:g}"
            elif unknowns > limits.max_unknowns:
                reason = f"the refined balance has {unknowns:.2g} unknowns, above the limit of {limits.max_unknowns:g}"
            else:
                return refine.modes(finer, limits.modes) or finer, actual, ""
        return None, 1.0, reason

    def refine_mesh(self, finer: SceneFile, ratio: float, state: OperatingState) -> None:
        """Another mesh and contact grid, on top of more modes."""
        text = f"{ratio:.3g} times the elements along every edge"
        self.say(text)
        with self.refusals(Refinement.MESH, f"{text}: "):
            model = modelling.build(finer, Progress(), state.balance.basis.harmonics)
            self.last = operating_states.unworn_state(finer, model, state.site)
            self.ratio = ratio
            self.add(Refinement.MESH, state.values, self.last.values, text)

    def add_estimates(self, first: OperatingState) -> None:
        """What the contact law, the wear rule and its motions in time estimate of themselves."""
        file, worn = self.file, self.result.wear
        error = sampling_error(first.balance, first.point.state.omega, first.point.state.x)
        sampled = [name for name in first.values if name != operating_states.place_of_peak()]
        self.estimate(Refinement.SAMPLES, sampled, error, "estimate: located transitions")
        if not isinstance(first.site, AtFrequency):
            for name, relative in operating_states.changes_near_peak(first, settings.peak_of(file.scene)).items():
                self.estimate(Refinement.PLACE, [name], relative, "as far from it as its search may end")
        if file.scene.wear is None or worn is None or not self.result.wear_steps:
            return
        rule = wear_rule.load(file.scene.wear.rule_name).Rule
        steps = rule.error(worn, wear_run.rule_settings(file.scene, self.result.facts.delta_max or np.nan))
        durations = [q.name for q in of_wear_with_error(worn_contact(self.result)) if q.error is ErrorKind.DURATION]
        for name in self.names_of_wear:
            relative = float(steps.cycles if name in durations else steps.depth)
            self.estimate(Refinement.WEAR_STEPS, [name], relative, "estimate of the wear rule")
        if worn.in_time.any():  # scatter changes the cycles, not the depth of a contact that is worn through
            self.estimate(Refinement.MOTION, durations, worn.scatter, "standard error of means in time")
            problem = wear_run.wear_problem(file.scene, self.model.balance)
            difference = abs(untaken_periodic_share(problem, worn, self.limits.searched_rows))
            text = "periodic motions that the irregular one did not take"
            self.estimate(Refinement.OTHER_MOTION, durations, difference, text)

    def refine_springs(self, first: OperatingState) -> None:
        """What springs do that stand for a closed contact: stiffer and stiffer ones, to their limit."""
        closed = [name for name, contact in self.file.scene.joints.items() if contact.springs == "closed"]
        if not closed:
            return
        self.say("stiffer springs of the contact")
        if self.result.wear_steps:
            self.estimate(Refinement.SPRINGS, self.names_of_wear, None, "wear with stiffer springs is not measured")
        with self.refusals(Refinement.SPRINGS):
            factors, states = zip(*contact_springs.stiffened(first, closed, self.limits), strict=True)
            highest = states[-1].balance.basis.harmonics[-1]
            text = f"springs up to {factors[-1]:g} times as stiff, harmonics to {highest}"
            for name, value in first.values.items():
                values = [state.values[name] for state in states]
                limit = ladders.springs_limit(factors, values, self.limits.floor)
                if limit is None:
                    self.estimate(Refinement.SPRINGS, [name], None, f"{text}, without a limit yet")
                else:
                    doubt = max(limit.doubt, relative_change(values[-1], limit.value))
                    change = relative_change(value, limit.value) + doubt
                    self.rows.append(MeasuredChange(Refinement.SPRINGS, name, value, limit.value, change, text))

    def refine_wear(self, finer: SceneFile | None, reason: str, first: OperatingState, wear: WearHistory) -> None:
        """Quantities of the whole wear on another mesh, with more modes, harmonics and wear steps.

        The refined mesh is taken where the work allows it, else one coarser than that of the scene, whose run takes
        about as much work as the run of the scene. Matrices, which have no mesh, are worn as they are."""
        values = operating_states.worn_values(worn_contact(self.result))
        if values is None:
            self.estimate(Refinement.COMBINED, self.names_of_wear, None, "no life has ended")
            return
        file, limits, harmonics = self.file, self.limits, self.wear_harmonics
        periods = 0 if wear.periods is None else wear.periods.sum()  # steps go without harmonics
        work = float(wear.solves.sum() * (2 * len(harmonics) - 1) + periods) * first.balance.contact.stiffness.size
        no_mesh = isinstance(file.scene, MatrixScene)
        ratio = 1.0 if no_mesh else self.ratio or limits.ratios[0]
        if no_mesh and work > limits.max_wear:
            text = f"finer wear takes work above the limit of {limits.max_wear:g}"
            self.estimate(Refinement.COMBINED, self.names_of_wear, None, text)
            return
        if no_mesh:
            finer = refine.modes(file, limits.modes) or file
        elif finer is None or (ratio > 1 and work * ratio**2 > limits.max_wear):
            finer, ratio = refine.mesh(file, 1 / limits.coarser)
            if ratio >= 1:
                text = reason or "the mesh is imported and can only be cut"
                self.estimate(Refinement.COMBINED, self.names_of_wear, None, text)
                return
            finer = refine.modes(finer, limits.modes) or finer
        steps = limits.wear_steps if ratio >= 1 else 1.0
        refined = refine.wear(refine.harmonics(finer, harmonics), steps)
        text = "" if no_mesh else f"{ratio:.3g} times the elements along every edge, "
        text += f"more modes, harmonics {', '.join(map(str, harmonics))}"
        text += f", {steps:g} times the wear steps" if steps > 1 else ""
        with self.refusals(Refinement.COMBINED, f"{text}: ", self.names_of_wear):
            start = self.last if ratio == self.ratio else None
            worn = operating_states.worn_by(refined, modelling.build(refined, Progress()), start)
            self.add(Refinement.COMBINED, values, operating_states.values_through(worn), text)
            self.worn_ratio = None if no_mesh else ratio
            if self.in_time:
                self.take_motion(self.in_time, {}, (Refinement.COMBINED, operating_states.values_before(worn), text))


def measure_changes(
    file: SceneFile, model: Model, result: Result, say: Callable[[str], None], limits: RefinementLimits = DEFAULT
) -> ChangeTable:
    """All rows of a finished result; say : called with what is refined next."""
    table = ChangeTable(file, model, result, say, limits)
    try:
        first = table.first = operating_states.first_state(file, model.balance, result)
    except NOT_SOLVED as refusal:
        table.reason = str(refusal)
        return table
    table.refine_harmonics(first)
    state = table.refine_modes(first)
    finer, ratio, reason = table.finer_scene(first)
    if finer is not None:
        table.refine_mesh(finer, ratio, state)
    elif not isinstance(file.scene, MatrixScene):
        table.estimate(Refinement.MESH, names_with_error(CycleQuantity), None, reason)
    table.add_estimates(first)
    table.refine_springs(first)
    worn = worn_contact(result)
    if worn is not None and worn.history.in_time[:1].any():
        values = operating_states.values_before(worn)
        if any(relative_change(first.values[name], value) > limits.floor for name, value in values.items()):
            table.take_motion(values, dict.fromkeys(values, worn.history.scatter))
    if result.wear is not None and result.wear_steps and file.scene.wear is not None:
        table.refine_wear(finer, reason, first, result.wear)
    return table


def sampling_error(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Estimated relative error of the vibration of the worst output, caused by sampled contact forces.

    balance : solved at omega [rad/s] by x (n_pair, n_component, n_coeff) [m]
    The solution is put into a balance that locates its transitions, on more samples, and solved again. The error is
    relative to the vibration there, inf where Newton finds none, from rest neither."""
    n_samples = max(FINER * balance.basis.n_samples, FEWEST_SAMPLES)
    fine = balance.with_samples(n_samples, balance.contact.is_event_based)
    state, start = balance.evaluate(omega, x, jacobian=False), fine.evaluate(omega, x, jacobian=False)
    residual = newton.relative_residual(start, fine.x_lin(omega))
    options = NewtonOptions()
    loose = replace(options, tolerance=max(CONVERGED_SHARE * residual, newton.CRITERION.least_tolerance))
    solution = newton.solve(fine, omega, x, loose)
    if not solution.converged and solution.history[-1] > options.tolerance:  # too far off to be a start
        solution = newton.solve_from_rest(fine, omega)
        if not solution.converged:
            return float("inf")
    dynamic = balance.basis.order > 0
    vibration = fine.outputs(solution.state)[:, dynamic]
    change = vibration - balance.outputs(state)[:, dynamic]
    sizes, changes = (np.linalg.norm(y, axis=1) for y in (vibration, change))
    floor = 1e-2 * sizes.max(initial=0.0)  # a quiet output is measured against the liveliest one
    return float((changes / np.maximum(sizes, floor)).max()) if floor > 0 else 0.0
