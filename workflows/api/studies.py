"""What a study takes beyond a run: problems of scenes, their cycles, curves and wear, and pictures in one style.

Frequencies are in Hz on both sides; what comes back from a solver keeps its own omega in rad/s beside.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.law import SEPARATES, SLIPS, STICKS
from tribodyn.hbm.continuation import two_ends
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, WearEnd
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.stability.chatter import Chatter, chatter
from tribodyn.hbm.stability.exponents import BranchStability
from tribodyn.hbm.stability.folds_in_time import Coexisting, FoldInTime, coexisting, fold_in_time, solutions_at
from tribodyn.hbm.time import verify as hbm_verify
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.time.stepper import Options as TimeOptions
from tribodyn.hbm.time.verify import Verification
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.hbm.wear.law import Exposure
from tribodyn.hbm.wear.laws import impact
from tribodyn.reduction.mode_matching import mac, match_kinds, match_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.pictures.maps import draw_field, draw_status, patch_maps
from tribodyn.workflows.pictures.plots import axes_of as plot_axes
from tribodyn.workflows.pictures.plots import length_unit
from tribodyn.workflows.pictures.wheel_diagrams import campbell as plot_campbell
from tribodyn.workflows.pictures.wheel_diagrams import nodal_diameters as plot_nodal_diameters
from tribodyn.workflows.pictures.wheel_diagrams import safe as plot_safe
from tribodyn.workflows.pictures.wheel_diagrams import shades
from tribodyn.workflows.result.result import Patch, References, Result
from tribodyn.workflows.result.whole_file import replacing as write_whole
from tribodyn.workflows.run import curve, memory, references, settings, wear_run
from tribodyn.workflows.run.description import described
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.reuse import Bench, reaction
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene, Scene
from tribodyn.workflows.studies import forces
from tribodyn.workflows.studies.curves.backbones import follow_backbone
from tribodyn.workflows.studies.curves.backbones import picture as plot_backbone
from tribodyn.workflows.studies.fits.identification import Identification, Measured, Parameter
from tribodyn.workflows.studies.fits.identification import fit as identify
from tribodyn.workflows.studies.fits.joint_springs import JointSprings, joint_springs
from tribodyn.workflows.studies.published import published_wear_steps
from tribodyn.workflows.studies.supports import support_wear, support_work
from tribodyn.workflows.studies.variation import Varied, changed, vary
from tribodyn.workflows.studies.wheels import mistuned_wear, mistuning, patterns
from tribodyn.workflows.studies.wheels import wheel as wheels
from tribodyn.workflows.studies.wheels.mistuning import Mistuned
from tribodyn.workflows.studies.wheels.mistuning import picture as plot_mistuned
from tribodyn.workflows.studies.wheels.mistuning import write as write_mistuned
from tribodyn.workflows.studies.wheels.wheel import Wheel, campbell, critical_speeds

__all__ = [
    "CONVERGED",
    "OUTPUT",
    "SEPARATES",
    "SLIPS",
    "STICKS",
    "Bench",
    "Branch",
    "BranchEnd",
    "BranchStability",
    "Chatter",
    "Coexisting",
    "Exposure",
    "FoldInTime",
    "HarmonicBalance",
    "Identification",
    "IntegrationFailed",
    "JointSprings",
    "Measured",
    "Mistuned",
    "Parameter",
    "Part",
    "PartScene",
    "Patch",
    "ReducedModel",
    "References",
    "Scene",
    "State",
    "TimeOptions",
    "Varied",
    "Verification",
    "WearEnd",
    "WearHistory",
    "Wheel",
    "body_forces",
    "build_wheel",
    "campbell",
    "changed",
    "chatter",
    "coexisting",
    "contact_patch",
    "critical_speeds",
    "cycle_at",
    "cycles_to_preload",
    "delta_max",
    "draw_field",
    "draw_status",
    "fold_in_time",
    "follow_adaptive",
    "follow_arc_length",
    "follow_backbone",
    "follow_response",
    "identify",
    "impact_work",
    "joint_springs",
    "length_unit",
    "linear_references",
    "mac",
    "mark_stability",
    "match_kinds",
    "match_modes",
    "mistuned",
    "mistuned_patterns",
    "patch_maps",
    "peak_memory",
    "plot_axes",
    "plot_backbone",
    "plot_campbell",
    "plot_mistuned",
    "plot_nodal_diameters",
    "plot_patterns",
    "plot_safe",
    "published_wear_steps",
    "reaction",
    "result_of",
    "shades",
    "solutions_at",
    "state_at",
    "support_wear",
    "support_work",
    "vary",
    "verify_in_time",
    "wear",
    "wear_mistuned",
    "worn",
    "write_mistuned",
    "write_whole",
]

body_forces = forces.study
build_wheel = wheels.build
mistuned = mistuning.respond
mistuned_patterns = patterns.run
plot_patterns = patterns.picture
wear_mistuned = mistuned_wear.study
mark_stability = exponents.mark
peak_memory = memory.peak


def cycle_at(file: SceneFile, balance: HarmonicBalance, frequency: float) -> State:
    """The vibration cycle at a frequency [Hz], where need be along the curve of solutions over the load.

    Raises  SolveFailed
    """
    options = newton.NewtonOptions(tolerance=file.scene.solver.tolerance)
    solution = arc_length.solve_along_load(balance, 2 * np.pi * frequency, options)
    if not solution.converged:
        raise SolveFailed(f"the cycle at {frequency:.4g} Hz: {solution.outcome}")
    return solution.state


def state_at(balance: HarmonicBalance, omega: float, x: np.ndarray) -> State:
    """The state of contact displacements as branches and wear histories keep them (n_contact, n_coeff), at [rad/s]."""
    return balance.evaluate(omega, x.reshape(balance.contact.n_pair, -1, balance.basis.n_coeff))


def worn(balance: HarmonicBalance, depth: np.ndarray) -> HarmonicBalance:
    """The problem of a contact that has worn by a depth (n_pair,) [m]."""
    return balance.with_gap(balance.contact.gap + depth)


def follow_response(file: SceneFile, balance: HarmonicBalance) -> Branch:
    """The response over the scene's range by the scene's method, as far as it goes, see `Branch.end`."""
    return curve.follow_response(file.scene, balance, lambda done, said: None)


def follow_arc_length(file: SceneFile, balance: HarmonicBalance) -> Branch:
    """The response over the scene's range by arc length, round its folds."""
    low, high = settings.response_range(file.scene)
    options = arc_length.Options(newton=settings.newton_options(file.scene))
    return two_ends.follow(arc_length, balance, low, high, options)


def follow_adaptive(balance: HarmonicBalance, frequency: tuple[float, float], tolerance: float) -> Branch:
    """The response over a range [Hz], as dense as the tolerance of the curve between its points asks.

    Raises  SolveFailed where it does not come to the end of the range
    """
    return wheels.follow(balance, frequency, tolerance)


def linear_references(balance: HarmonicBalance, low: float, high: float, output: str = OUTPUT) -> References:
    """Amplitudes of an output with the contact absent and with it stuck, from one frequency to another [Hz]."""
    return references.linear_references(balance, output, 2 * np.pi * low, 2 * np.pi * high)


def delta_max(file: SceneFile, balance: HarmonicBalance) -> float:
    """The depth that wear steps are a share of: how far static loads press the faces together without contact [m]."""
    approach = references.free_deflection(balance)
    return references.delta_max(file.scene, approach, balance.model.interface.area)


def wear(file: SceneFile, balance: HarmonicBalance) -> WearHistory:
    """Wear a problem as the scene's [wear] says, to its end; `WearHistory.end` says why it ended.

    Raises  ValueError for a scene without [wear] or without what its steps are measured by
    """
    wanted = file.scene.wear
    if wanted is None:
        raise ValueError(f"{file.name} has no [wear]: say how it wears")
    at_rest = wanted.end_at == "at_rest"
    problem = wear_run.wear_problem(file.scene, file.folder, balance, wanted.lost_below, at_rest)
    limit = settings.step_limit(file.scene, references.free_deflection(balance), problem.area)
    return wear_run.evolve(problem, wanted, limit, wanted.max_steps)


def impact_work(balance: HarmonicBalance, state: State) -> np.ndarray:
    """(n_pair,) work of impacts at the contact per cycle [J]."""
    n = balance.contact.n_pair
    return impact.impact_work(Exposure(balance, state, np.ones(n), {}, np.zeros(n), 0.0))


def verify_in_time(balance: HarmonicBalance, state: State, options: TimeOptions) -> Verification:
    """Direct time integration from a solved state to the periodic motion nearby, beside the state.

    Raises  IntegrationFailed
    """
    return hbm_verify.verify(balance, state, options)


def contact_patch(balance: HarmonicBalance) -> Patch:
    """The contact as pictures need it."""
    i = balance.model.interface
    nodes = np.full(i.n_pair, -1)
    return Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, references.free_deflection(balance))


def result_of(file: SceneFile, part: Part | None, balance: HarmonicBalance, history: WearHistory) -> Result:
    """A result that holds a wear run, for pictures; no response curve."""
    return replace(described(file, part, balance), wear=history)
