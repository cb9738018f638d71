"""The table of measured changes: one state of the scene followed from its own model to a finer one, step by step.

Modes, then mesh and contact grid, then harmonics are refined, each on top of the one before, so that the rows of single
refinements sum, with their signs, to the combined one. A refinement that meets a limit is not measured. Matrices have
no mesh: modes and harmonics, and the steps of wear, are all that can be refined in them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, StatedQuantity, WearQuantity, with_error
from tribodyn.hbm.wear import wear_rule
from tribodyn.hbm.wear.steady_motion import untaken_periodic_share
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import operating_states, refine, wear_values
from tribodyn.workflows.errors.operating_states import OperatingState, Values, relative_change
from tribodyn.workflows.errors.refinement_limits import DEFAULT, RefinementLimits
from tribodyn.workflows.errors.sampling_error import sampling_error
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile

NOT_SOLVED = (Refusal, SolverFailure)
"""What a finer model may answer instead of a value; anything else is a defect of the program and ends the run."""


@dataclass
class ChangeTable:
    """Rows as they are measured.

    first : state of the scene before wear, None without one, as `reason` says
    ratio : of the refined mesh, None where that was not solved; worn_ratio : of the mesh of the refined wear run
    last : the state of the combined refinement on that mesh
    """

    rows: list[MeasuredChange] = field(default_factory=list)
    first: OperatingState | None = None
    reason: str = ""
    ratio: float | None = None
    worn_ratio: float | None = None
    last: OperatingState | None = None

    def add(self, refinement: Refinement, values: Values, refined: Values, text: str) -> None:
        """What a refinement changed."""
        for name, value in values.items():
            change = relative_change(value, refined[name])
            self.rows.append(MeasuredChange(refinement, name, value, refined[name], change, text))

    def refuse(self, refinement: Refinement, reason: str, kind: type[StatedQuantity] = CycleQuantity) -> None:
        """A refinement that was not measured, for all quantities of a kind."""
        self.rows += [MeasuredChange(refinement, q.name, None, None, None, reason) for q in with_error(kind)]

    def estimate(
        self, refinement: Refinement, quantities: Sequence[StatedQuantity], relative: float, text: str
    ) -> None:
        """A relative change that was estimated without a second solution."""
        self.rows += [MeasuredChange(refinement, q.name, None, None, relative, text) for q in quantities]


def measure_changes(
    file: SceneFile, model: Model, result: Result, say: Callable[[str], None], limits: RefinementLimits = DEFAULT
) -> ChangeTable:
    """All rows of a finished result; say : called with what is refined next."""
    table = ChangeTable()
    try:
        first = table.first = operating_states.first_state(file, model.balance, result)
    except NOT_SOLVED as refusal:
        table.reason = str(refusal)
        return table
    finer, ratio, reason = finer_scene(file, first, result, limits)
    if finer is None:
        _refine_without_mesh(file, first, reason, table, say)
    else:
        _refine_step_by_step(file, finer, ratio, first, table, say)
    _add_estimates(file, model, first, table, result, limits)
    if result.wear_steps and file.scene.wear is not None:
        _refine_wear(file, finer, reason, first, table, result, limits)
    return table


def finer_scene(
    file: SceneFile, first: OperatingState, result: Result, limits: RefinementLimits
) -> tuple[SceneFile | None, float, str]:
    """The scene with more elements and modes as far as the limits allow, its ratio, and why there is none.

    Where no finer mesh is allowed, one coarser than that of the scene stands in for it, with a ratio below 1
    """
    contact = first.balance.contact.stiffness.size
    coefficients = 2 * first.refined_top(limits) + 1
    reason = ""
    for ratio in (*limits.ratios, 1 / limits.coarser):
        try:
            finer, actual = refine.mesh(file, ratio)
        except refine.NoMesh as refusal:
            return None, 1.0, str(refusal)
        if ratio < 1 <= actual:
            break  # an imported mesh can only be cut
        dofs, unknowns = actual**3 * result.facts.full_dofs, actual**2 * contact * coefficients
        if dofs > limits.max_dofs:
            reason = f"the refined mesh has some {dofs:.2g} DOFs, above the limit of {limits.max_dofs:g}"
        elif unknowns > limits.max_unknowns:
            reason = f"the refined balance has some {unknowns:.2g} unknowns, above the limit of {limits.max_unknowns:g}"
        else:
            return refine.modes(finer, limits.modes) or finer, actual, ""
    return None, 1.0, reason


def _refine_step_by_step(
    file: SceneFile, finer: SceneFile, ratio: float, first: OperatingState, table: ChangeTable,
    say: Callable[[str], None],
) -> None:  # fmt: skip
    """Modes, mesh, harmonics, each on top of the one before; the last is the combined refinement."""
    values = (_with_more_modes(file, first, table, say) or first).values
    say(f"a mesh with {ratio:.2g} times the elements")
    text = f"{ratio:.3g} times the elements along every edge"
    harmonics = first.balance.basis.harmonics
    try:
        state = operating_states.unworn_state(finer, modelling.build(finer, Progress(), harmonics), first.site)
    except NOT_SOLVED as refusal:
        table.refuse(Refinement.MESH, f"{text}: {refusal}")
        table.refuse(Refinement.COMBINED, f"{text}: {refusal}")
        return
    table.add(Refinement.MESH, values, state.values, text)
    last = _with_more_harmonics(state, table, say)
    if last is None:
        table.refuse(Refinement.COMBINED, table.rows[-1].description)
        return
    table.ratio, table.last = ratio, last
    text += f", more modes, harmonics 0 to {first.refined_top()}"
    table.add(Refinement.COMBINED, first.values, last.values, text)


def _refine_without_mesh(
    file: SceneFile, first: OperatingState, reason: str, table: ChangeTable, say: Callable[[str], None]
) -> None:
    """What can be refined where the mesh cannot, as `reason` says: all that there is of a scene of matrices."""
    last = _with_more_harmonics(_with_more_modes(file, first, table, say) or first, table, say)
    if last is None or not isinstance(file.scene, MatrixScene):
        table.refuse(Refinement.COMBINED, reason if last else table.rows[-1].description)
    else:
        text = f"more modes, harmonics 0 to {first.refined_top()}"
        table.add(Refinement.COMBINED, first.values, last.values, text)


def _with_more_modes(
    file: SceneFile, first: OperatingState, table: ChangeTable, say: Callable[[str], None]
) -> OperatingState | None:
    """The first state with more modes, followed from its own solution; None where the scene has no number of modes."""
    finer = refine.modes(file, DEFAULT.modes)
    if finer is None:
        return None
    say("more modes")
    wear = file.scene.wear
    try:
        model = modelling.build(finer, Progress(), first.balance.basis.harmonics)
        balance = model.balance.with_load(1.0 if wear is None else wear.duties[0].load)
        point = first.site.solve_near(balance, first.point.state.omega, first.point.state.x)
        if not point.solution.converged:
            raise SolverFailure(str(point.solution.outcome))
    except NOT_SOLVED as refusal:
        table.refuse(Refinement.MODES, str(refusal))
        return None
    state = replace(first, balance=balance, point=point)
    table.add(Refinement.MODES, first.values, state.values, f"{DEFAULT.modes} times as many modes")
    return state


def _with_more_harmonics(
    state: OperatingState, table: ChangeTable, say: Callable[[str], None]
) -> OperatingState | None:
    """A state with more harmonics, followed from its own solution."""
    text = f"harmonics 0 to {state.refined_top()}"
    say(text)
    try:
        refined = operating_states.with_more_harmonics(state, state.refined_top())
    except NOT_SOLVED as refusal:
        table.refuse(Refinement.HARMONICS, f"{text}: {refusal}")
        return None
    table.add(Refinement.HARMONICS, state.values, refined.values, text)
    return refined


def _add_estimates(
    file: SceneFile, model: Model, first: OperatingState, table: ChangeTable, result: Result, limits: RefinementLimits
) -> None:
    """What the contact law, the wear rule and its motions in time estimate of themselves."""
    error = sampling_error(first.balance, first.point.state.omega, first.point.state.x)
    sampled = [q for q in with_error(CycleQuantity) if q.error is not ErrorKind.UNSAMPLED_CYCLE]
    table.estimate(Refinement.SAMPLES, sampled, error, "estimate: located transitions")
    wear = file.scene.wear
    if wear is None or result.wear is None or not result.wear_steps:
        return
    rule = wear_rule.load(wear.rule_name).Rule
    steps = rule.error(result.wear, wear_run.rule_settings(file.scene, result.facts.delta_max or np.nan))
    durations = [q for q in with_error(WearQuantity) if q.error is ErrorKind.DURATION]
    for quantity in with_error(WearQuantity):
        relative = steps.cycles if quantity in durations else steps.depth
        table.estimate(Refinement.WEAR_STEPS, [quantity], float(relative), "estimate of the wear rule")
    if result.wear.in_time.any():  # scatter changes the cycles, not the depth of a contact that is worn through
        table.estimate(Refinement.MOTION, durations, result.wear.scatter, "standard error of means in time")
        problem = wear_run.wear_problem(file.scene, file.folder, model.balance)
        difference = abs(untaken_periodic_share(problem, result.wear, limits.searched_rows))
        text = "periodic motions that the irregular one did not take"
        table.estimate(Refinement.OTHER_MOTION, durations, difference, text)


def _refine_wear(
    file: SceneFile, finer: SceneFile | None, reason: str, first: OperatingState, table: ChangeTable, result: Result,
    limits: RefinementLimits,
) -> None:  # fmt: skip
    """Quantities of the whole wear on another mesh, with more modes, harmonics and wear steps.

    The refined mesh is taken where the work allows it, else one coarser than that of the scene, whose run takes about
    as much work as the run of the scene. Matrices, which have no mesh, are worn as they are.
    """
    wear = result.wear
    assert wear is not None
    values = wear_values.values_of_result(result)
    if values is None:
        table.refuse(Refinement.COMBINED, "no life has ended", WearQuantity)
        return
    top = first.refined_top(limits)
    periods = 0 if wear.periods is None else wear.periods.sum()  # marched with as many steps, whatever the harmonics
    work = float(wear.solves.sum() * (2 * top + 1) + periods) * first.balance.contact.stiffness.size
    no_mesh = isinstance(file.scene, MatrixScene)
    ratio = 1.0 if no_mesh else table.ratio or limits.ratios[0]
    if no_mesh and work > limits.max_wear:
        text = f"finer wear takes work above the limit of {limits.max_wear:g}"
        table.refuse(Refinement.COMBINED, text, WearQuantity)
        return
    if no_mesh:
        finer = refine.modes(file, limits.modes) or file
    elif finer is None or (ratio > 1 and work * ratio**2 > limits.max_wear):
        finer, ratio = refine.mesh(file, 1 / limits.coarser)
        if ratio >= 1:
            text = reason or "the mesh is imported and can only be cut"
            table.refuse(Refinement.COMBINED, text, WearQuantity)
            return
        finer = refine.modes(finer, limits.modes) or finer
    steps = limits.wear_steps if ratio >= 1 else 1.0
    refined = refine.wear(refine.harmonics(finer, top), steps)
    text = "" if no_mesh else f"{ratio:.3g} times the elements along every edge, "
    text += f"more modes, harmonics 0 to {top}" + (f", {steps:g} times the wear steps" if steps > 1 else "")
    try:
        start = table.last if ratio == table.ratio else None
        refined_values = wear_values.wear_through(refined, modelling.build(refined, Progress()), start)
    except NOT_SOLVED as refusal:
        table.refuse(Refinement.COMBINED, f"{text}: {refusal}", WearQuantity)
        return
    table.worn_ratio = None if no_mesh else ratio
    table.add(Refinement.COMBINED, values, refined_values, text)
