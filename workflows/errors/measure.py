"""The table of measured changes: one state of the scene followed from its own model to a finer one, step by step.

Modes, then mesh and contact grid, then harmonics are refined, each on top of the one before, so that the rows of single
refinements sum, with their signs, to the combined one. A refinement that meets a limit of the options is not measured.
Matrices have no mesh: modes and harmonics, and the steps of wear, are all that can be refined in them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_point import NoPeak
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_preload, cycles_to_share
from tribodyn.hbm.wear.machine_motion import left_aside
from tribodyn.hbm.wear.step_control import Tolerance, step_error
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors import refine, states
from tribodyn.workflows.errors.options import DEFAULT, Options
from tribodyn.workflows.errors.states import Answers, State, relative
from tribodyn.workflows.result import summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Change, Refinement
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.wear import Wear

OF_STATE = ("peak_frequency", "amplitude", "energy", "preload")
OF_WEAR = ("depth", "life")
FINER = 8  # times the samples, for a law that cannot locate its transitions: the error falls with their square
SETTLED = 1e-2  # residual over that of the start: a step alone is half of the way where few samples are far off
REFUSALS = (NoPeak, ValueError, RuntimeError)


@dataclass
class Table:
    """Rows as they are measured.

    first : the scene's own unworn state, None without one, as `why` says
    ratio : of the refined mesh, None where that was not solved; worn_ratio : of the mesh that was worn beside it
    last : the state of the combined refinement on that mesh
    """

    rows: list[Change] = field(default_factory=list)
    first: State | None = None
    why: str = ""
    ratio: float | None = None
    worn_ratio: float | None = None
    last: State | None = None

    def add(self, refinement: Refinement, before: Answers, after: Answers, how: str) -> None:
        """What a refinement changed in a state."""
        for name, value in before.items():
            self.rows.append(Change(refinement, name, value, after[name], relative(value, after[name]), how))

    def refuse(self, refinement: Refinement, why: str, quantities: tuple[str, ...] = OF_STATE) -> None:
        """A refinement that was not measured."""
        self.rows += [Change(refinement, name, None, None, None, why) for name in quantities]


def measure(
    file: SceneFile, model: Model, result: Result, say: Callable[[str], None], options: Options = DEFAULT
) -> Table:
    """All rows of a finished result; say : called with what is refined next."""
    table = Table()
    try:
        table.first = states.first_state(file, model.balance, result)
    except REFUSALS as refusal:
        table.why = str(refusal)
        return table
    finer, ratio, why = refined(file, table.first, result, options)
    if finer is None:
        _on_own_mesh(file, why, table, say)
    else:
        _step_by_step(file, finer, ratio, table, say)
    _estimates(file, model, table, result, options)
    if result.wear_steps and file.scene.wear is not None:
        _worn(file, finer, why, table, result, options)
    return table


def refined(file: SceneFile, first: State, result: Result, options: Options) -> tuple[SceneFile | None, float, str]:
    """The scene with more elements and modes as far as the limits allow, its ratio, and why there is none.

    Where no finer mesh is allowed, one coarser than the scene's own stands in for it, with a ratio below 1
    """
    contact = first.balance.contact.stiffness.size
    coefficients = 2 * first.top(options) + 1
    why = ""
    for ratio in (*options.ratios, 1 / options.coarser):
        try:
            finer, actual = refine.mesh(file, ratio)
        except refine.NoMesh as refusal:
            return None, 1.0, str(refusal)
        if ratio < 1 <= actual:
            break  # a given mesh can only be cut
        dofs, unknowns = actual**3 * result.facts.full_dofs, actual**2 * contact * coefficients
        if dofs > options.max_dofs:
            why = f"the refined mesh has some {dofs:.2g} DOFs, above the limit of {options.max_dofs:g}"
        elif unknowns > options.max_unknowns:
            why = f"the refined balance has some {unknowns:.2g} unknowns, above the limit of {options.max_unknowns:g}"
        else:
            return refine.modes(finer, options.modes) or finer, actual, ""
    return None, 1.0, why


def _step_by_step(file: SceneFile, finer: SceneFile, ratio: float, table: Table, say: Callable[[str], None]) -> None:
    """Modes, mesh, harmonics, each on top of the one before; the last is the combined refinement."""
    own = table.first
    assert own is not None
    before = (_more_modes(file, table, say) or own).answers
    say(f"a mesh with {ratio:.2g} times the elements")
    how = f"{ratio:.3g} times the elements along every edge"
    kept = own.balance.basis.harmonics
    try:
        there = states.unworn(finer, modelling.build(finer, Progress(), kept), own.site)
    except REFUSALS as refusal:
        table.refuse(Refinement.MESH, f"{how}: {refusal}")
        table.refuse(Refinement.COMBINED, f"{how}: {refusal}")
        return
    table.add(Refinement.MESH, before, there.answers, how)
    last = _more_harmonics(there, table, say)
    if last is None:
        table.refuse(Refinement.COMBINED, table.rows[-1].how)
        return
    table.ratio, table.last = ratio, last
    table.add(Refinement.COMBINED, own.answers, last.answers, f"{how}, more modes, harmonics 0 to {own.top()}")


def _on_own_mesh(file: SceneFile, why: str, table: Table, say: Callable[[str], None]) -> None:
    """What can be refined where the mesh cannot, as `why` says: all that there is where there is none."""
    own = table.first
    assert own is not None
    last = _more_harmonics(_more_modes(file, table, say) or own, table, say)
    if last is None or not isinstance(file.scene, MatrixScene):
        table.refuse(Refinement.COMBINED, why if last else table.rows[-1].how)
    else:
        table.add(Refinement.COMBINED, own.answers, last.answers, f"more modes, harmonics 0 to {own.top()}")


def _more_modes(file: SceneFile, table: Table, say: Callable[[str], None]) -> State | None:
    """The own state with more modes, followed from its own solution; None where the scene has no number of modes."""
    own = table.first
    assert own is not None
    other = refine.modes(file, DEFAULT.modes)
    if other is None:
        return None
    say("more modes")
    try:
        model = modelling.build(other, Progress(), own.balance.basis.harmonics)
        balance = model.balance.with_load(_load(file))
        point = own.site.next(balance, own.here.state.omega, own.here.state.x)
        if not point.solution.converged:
            raise SolverFailure(str(point.solution.outcome))
    except REFUSALS as refusal:
        table.refuse(Refinement.MODES, str(refusal))
        return None
    found = State(own.cycles, balance, own.site, point)
    table.add(Refinement.MODES, own.answers, found.answers, f"{DEFAULT.modes} times as many modes")
    return found


def _load(file: SceneFile) -> float:
    wear = file.scene.wear
    return 1.0 if wear is None else wear.duties[0].load


def _more_harmonics(state: State, table: Table, say: Callable[[str], None]) -> State | None:
    """A state with more harmonics, followed from its own solution, from the next to the highest ones."""
    how = f"harmonics 0 to {state.top()}"
    say(how)
    try:
        found = states.widened(state, state.top())
    except REFUSALS as refusal:
        table.refuse(Refinement.HARMONICS, f"{how}: {refusal}")
        return None
    table.add(Refinement.HARMONICS, state.answers, found.answers, how)
    return found


def _estimates(file: SceneFile, model: Model, table: Table, result: Result, options: Options) -> None:
    """What the contact law, the wear rule and its motions estimate of themselves."""
    own = table.first
    assert own is not None
    error = float(sampling_error(own.balance, own.here.state.omega, own.here.state.x))
    for name in OF_STATE[1:]:
        table.rows.append(Change(Refinement.SAMPLES, name, None, None, error, "estimate: located transitions"))
    wear = file.scene.wear
    if wear is not None and result.wear is not None and result.wear_steps:
        told = Tolerance(wear.tolerance, result.facts.delta_max_m or np.nan)  # known where steps are error-controlled
        found = step_error(result.wear, told if wear.rule == "error_controlled" else None)
        for name, one in (("depth", found.depth), ("life", found.cycles)):
            table.rows.append(Change(Refinement.WEAR_STEPS, name, None, None, float(one), "estimate of the wear rule"))
        if result.wear.in_time.any():  # scatter puts cycles off, not the depth of a contact worn through
            how = "standard error of means in time"
            table.rows.append(Change(Refinement.MOTION, "life", None, None, result.wear.scatter, how))
            problem = wear_run.wear_problem(file.scene, file.folder, model.balance)
            aside = abs(left_aside(problem, result.wear, options.looks))
            how = "periodic motions that an irregular one passed by"
            table.rows.append(Change(Refinement.OTHER_MOTION, "life", None, None, aside, how))


def _worn(file: SceneFile, finer: SceneFile | None, why: str, table: Table, result: Result, options: Options) -> None:
    """Depth and life of the whole run on another mesh, with more modes, harmonics and wear steps.

    The refined mesh is taken where the work allows it, else one coarser than the scene's own, whose run takes about as
    much work as the scene's. Matrices, which have no mesh, are worn as they are.
    """
    own, wear = table.first, result.wear
    assert own is not None
    assert wear is not None
    life = summary.life(result)
    if life is None:
        table.refuse(Refinement.COMBINED, "no life has ended", OF_WEAR)
        return
    top = own.top(options)
    periods = 0 if wear.periods is None else wear.periods.sum()  # marched with as many steps, whatever the harmonics
    work = float(wear.solves.sum() * (2 * top + 1) + periods) * own.balance.contact.stiffness.size
    bare = isinstance(file.scene, MatrixScene)
    ratio = 1.0 if bare else table.ratio or options.ratios[0]
    if bare and work > options.max_wear:
        table.refuse(Refinement.COMBINED, f"finer wear takes work above the limit of {options.max_wear:g}", OF_WEAR)
        return
    if bare:
        finer = refine.modes(file, options.modes) or file
    elif finer is None or (ratio > 1 and work * ratio**2 > options.max_wear):
        finer, ratio = refine.mesh(file, 1 / options.coarser)
        if ratio >= 1:
            table.refuse(Refinement.COMBINED, why or "the mesh is given and can only be cut", OF_WEAR)
            return
        finer = refine.modes(finer, options.modes) or finer
    steps = options.wear_steps if ratio >= 1 else 1.0
    other = refine.wear(refine.harmonics(finer, top), steps)
    how = "" if bare else f"{ratio:.3g} times the elements along every edge, "
    how += f"more modes, harmonics 0 to {top}" + (f", {steps:g} times the wear steps" if steps > 1 else "")
    try:
        begun = table.last if ratio == table.ratio else None
        depth, there = worn_through(other, modelling.build(other, Progress()), begun)
    except REFUSALS as refusal:
        table.refuse(Refinement.COMBINED, f"{how}: {refusal}", OF_WEAR)
        return
    table.worn_ratio = None if bare else ratio
    pairs = (("depth", float(result.depth_after(-1).max()), depth), ("life", life, there))
    table.rows += [Change(Refinement.COMBINED, name, a, b, relative(a, b), how) for name, a, b in pairs]


def worn_through(file: SceneFile, model: Model, begun: State | None = None) -> tuple[float, float]:
    """Largest depth [m] and life [cycles] of a scene worn as it says, from an unworn state of its mesh and harmonics.

    begun : that state, None where it is looked for. Raises RuntimeError where no life ends
    """
    wear = file.scene.wear
    assert wear is not None
    basis = model.balance.basis
    at = None if begun is None else (begun.here.state.omega, begun.balance.basis.transfer(begun.here.state.x, basis))
    worn = wear_run.worn_out(file, model, wear.lost_below, at)
    life = life_of(worn, model, wear)
    if worn.ended.failed or life is None:
        raise SolverFailure(str(worn.end))
    return float((worn.depth[-1] + worn.worn[-1]).max()), life


def life_of(worn: WearHistory, model: Model, wear: Wear) -> float | None:
    """Life [cycles] of a wear run as `summary.life` has that of a result; None where it has not ended."""
    share = wear.lost_below or LIFE_SHARE
    if wear.lost_of != "any":
        return cycles_to_preload(worn, share)
    forces = (worn.normal_force[:, pairs].sum(axis=1) for pairs in model.reduced.joints.values())
    lives = [cycles_to_share(worn.cycles, force, share) for force in forces]
    return min((life for life in lives if life is not None), default=None)


def sampling_error(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Estimated relative error of the vibration of the worst output, caused by sampled contact forces.

    balance : solved at omega [rad/s] by x (n_pair, n_component, n_coeff) [m]
    The solution is put into a balance that locates its transitions, on more samples, and solved again; it is relative
    to the vibration there, inf where Newton finds none, from rest neither.
    """
    fine = balance.with_samples(max(FINER * balance.basis.n_samples, 128), balance.contact.locates)
    here, there = balance.evaluate(omega, x, jacobian=False), fine.evaluate(omega, x, jacobian=False)
    left = newton.relative_residual(there, fine.x_lin(omega))
    options = NewtonOptions()
    closer = replace(options, tolerance=max(SETTLED * left, newton.RULES.least_tolerance))
    found = newton.solve(fine, omega, x, closer)
    if not found.converged and found.history[-1] > options.tolerance:  # too far off to be a start
        found = newton.solve_from_rest(fine, omega)
        if not found.converged:
            return float("inf")
    dynamic = balance.basis.order > 0
    moved = fine.outputs(found.state)[:, dynamic]
    size, change = (np.linalg.norm(y, axis=1) for y in (moved, moved - balance.outputs(here)[:, dynamic]))
    floor = 1e-2 * size.max(initial=0.0)  # a quiet output is measured against the liveliest one
    return float((change / np.maximum(size, floor)).max()) if floor > 0 else 0.0
