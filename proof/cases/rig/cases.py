"""What the study of the fretting rig computes: everything that the thesis tells about its rig in numbers or as a trend.

Frequencies before and after the fit of the joints, the prescribed height, energy per cycle against shaker force, wear
to the loss of the preload for three mating heights, responses and loops at five stages of wear, and whether these
cycles are those that time integration finds."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from proof.cases.rig import fit as rig_fit
from proof.cases.rig.joints import Joints, joints_of
from proof.cases.rig.model import Cycle, Rig
from proof.cases.rig.published import MATING_HEIGHTS, STUCK_COMPLEX, TABLE_5_3
from proof.cases.rig.wear import RigWear, loop, wear_down
from proof.problems import contact_patch, follow_arc_length, linear_references, state_at
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.time.stepper import IntegrationFailed, Options as TimeOptions
from tribodyn.hbm.time.verify import verify
from tribodyn.workflows.result.result import Patch, References
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.scene_file import SceneFile

STEPS, PERIODS, DRIFT = 1024, 200, 1e-5  # in time: per period; to settle in; of the state over one period
STAGES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the volume worn when the preload is lost
CLEARANCE = 1e-4  # mating height that leaves the faces apart [m]
STUCK_PRELOAD = 150.0  # beyond which the experiment saw no relative displacement [N]
READINGS: tuple[tuple[int, ...], ...] = ((0, 1, 2, 3), (0, 1, 2))
"""Harmonics: 0 to 3, and "3 harmonics including the 0th"."""


@dataclass(frozen=True)
class Height:
    """A platform height [m] with the preload and the force at the screws that it makes [N], at rest."""

    height: float
    preload: float
    reaction: float


@dataclass(frozen=True)
class InTime:
    """Time integration beside the balance: energy per cycle [J], preload [N], and how the integration ended.

    amplitude : of the balance's response over that in time, less one
    The numbers are those of the last period, periodic or not; None where there is none."""

    energy: float | None
    preload: float | None
    amplitude: float | None
    outcome: str
    periodic: bool = False


@dataclass(frozen=True)
class Stage:
    """A stage of wear: row of the history; its cycle, and the same in time; response; loop as `wear.loop`."""

    row: int
    cycle: Cycle
    in_time: InTime
    response: Branch
    sliding: np.ndarray
    friction: np.ndarray


@dataclass(frozen=True)
class Study:
    """All that was computed.

    before, after : (n_published,) frequencies with rigid joints, and with those of the scene [Hz]
    stuck_complex : of ours nearest to the fifth stuck mode [Hz]
    cycles : harmonics -> shaker force [N] -> cycle; tight : the cycle under STUCK_PRELOAD
    apart : largest relative difference of the response without contact to the open rig's
    runs : one per mating height; the first is that of the scene, whose stages these are
    other : the first one with the other reading of the harmonics; seconds : of processor time"""

    before: np.ndarray
    after: np.ndarray
    stuck_complex: float
    heights: tuple[Height, ...]
    apart: float
    cycles: Mapping[tuple[int, ...], Mapping[float, Cycle]]
    tight: Cycle
    runs: tuple[RigWear, ...]
    other: RigWear
    stages: tuple[Stage, ...]
    references: References
    patch: Patch
    coefficient: float
    friction: float
    seconds: float


def compute(file: SceneFile, tell: Callable[[str], None]) -> Study:
    """Everything, for the rig's scene or one like it; minutes. tell : called with a sentence on what is under way.

    Raises  NoSolution where a state or a wear step was not found"""
    clock = time.process_time()
    with threadpool_limits(1):
        scene = file.mesh_scene
        assert scene.wear is not None
        tell("frequencies before and after the fit of the joints")
        joints = joints_of(file)
        before, after = joints.frequencies(rig_fit.rigid()), joints.frequencies({})
        rig = Rig.of(file)
        tell("prescribed height")
        heights = tuple(_height(rig, share * rig.height) for share in (0.0, 1 / 3, 2 / 3, 1.0, 4 / 3))
        tell("energy per cycle against shaker force")
        cycles = {saved: _energies(rig.with_harmonics(saved)) for saved in READINGS}
        stiffness = heights[-1].preload / heights[-1].height
        tight = rig.with_height(STUCK_PRELOAD / stiffness).cycle()
        runs = tuple(wear_down(rig, shift, tell) for shift in MATING_HEIGHTS)
        tell(f"the other reading of the harmonics, 0 to {READINGS[1][-1]}")
        other = wear_down(rig.with_harmonics(READINGS[1]), 0.0, tell)
        stages = tuple(_stage(rig, runs[0], share, tell) for share in STAGES)
        model = rig.model()
        references = linear_references(model.balance, *scene.response.frequency)
        return Study(
            before, after, _stuck_complex(joints), heights, apart(rig, references), cycles, tight, runs, other, stages,
            references, contact_patch(model.balance), scene.wear.numbers["coefficient"],
            scene.contact.numbers["friction"],
            time.process_time() - clock,
        )  # fmt: skip


def _stuck_complex(joints: Joints) -> float:
    frequency = joints.modes({}, stuck=True).frequency
    return float(frequency[np.argmin(np.abs(frequency - STUCK_COMPLEX))])


def _height(rig: Rig, height: float) -> Height:
    still = rig.with_height(height).at_rest()
    return Height(height, still.preload, still.reaction)


def _energies(rig: Rig) -> dict[float, Cycle]:
    return {force: rig.with_force(force).cycle() for force in TABLE_5_3}


def apart(rig: Rig, references: References) -> float:
    """Largest relative difference of the response of faces held apart to that of the linear open rig."""
    loose, subset = rig.with_mating_height(-CLEARANCE), slice(None, None, len(references.omega) // 8)
    values = np.array([loose.cycle(float(omega / (2 * np.pi))).amplitude for omega in references.omega[subset]])
    return float(np.max(np.abs(values / references.free[subset] - 1)))


def _stage(rig: Rig, run: RigWear, share: float, tell: Callable[[str], None]) -> Stage:
    row = run.nearest(share)
    opened = rig.with_opening(run.history.depth[row])
    model = opened.model()
    balance = model.balance
    tell(f"response and time integration after {run.history.cycles[row]:.3g} cycles")
    response = follow_arc_length(rig.file, balance)
    state = state_at(balance, 2 * np.pi * rig.frequency, run.history.displacement[row])
    cycle = opened.told(model, state)
    return Stage(row, cycle, in_time(opened, cycle), response, *loop(rig.model().balance, run.history, row))


def in_time(rig: Rig, cycle: Cycle) -> InTime:
    """Integrate from a solved cycle to the periodic motion nearby."""
    options = TimeOptions(STEPS, tolerance=DRIFT, max_periods=PERIODS)
    try:
        result = verify(rig.model().balance, cycle.state, options)
    except IntegrationFailed as failure:
        return InTime(None, None, None, str(failure))
    amplitude = result.amplitude[OUTPUT]
    energy = float(result.motion.energy.sum())
    return InTime(energy, result.motion.preload, amplitude, str(result.outcome), result.motion.periodic)


def solved(branch: Branch) -> np.ndarray:
    """(n_point,) whether each point was solved."""
    return branch.converged
