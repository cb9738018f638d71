"""States of a result beside what a machine does there: the balance's motion, followed in time until it settles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanOptions
from tribodyn.hbm.time.stepper import Options as TimeOptions
from tribodyn.hbm.time.verify import energy_floor
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors import states
from tribodyn.workflows.errors.options import Options
from tribodyn.workflows.errors.states import Answers, State
from tribodyn.workflows.result import summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Change, Refinement, Status
from tribodyn.workflows.scene.scene_file import SceneFile

STEPS = 256  # per period at least: differences above a tenth of a per cent are told
STEPS_PER_HARMONIC = 32
NOTHING = 1e-12  # share of a work that counts as none


@dataclass(frozen=True)
class Left:
    """A state of the balance beside what a machine does there.

    cycles : of the state; balance, machine : (n_pair,) friction work of either motion per period [J]
    apart : relative differences of the balance's answers, by name
    error : standard error of the machine's whole work, relative; spread : standard deviation of the work of a period
    """

    cycles: float
    balance: np.ndarray
    machine: np.ndarray
    apart: Answers
    error: float
    spread: float

    def judged(self, quantity: str, error: float | None) -> tuple[Status | None, str]:
        """Why a quantity of the unworn contact is not reported, if it is not; error : of the balance, if known."""
        miss = self.apart.get(quantity, 0.0) + self.error
        if error is None or miss <= error:
            return None, ""
        return Status.UNSTABLE if self.spread > 0 else Status.CONTRADICTED, f"of the unworn contact, by {miss:.1%}"


def is_checked(state: State, asked: bool | None, options: Options) -> bool:
    """Whether states are integrated in time; asked : whether the scene wants it; None: where the contact is small."""
    return state.balance.contact.stiffness.size <= options.max_time_components if asked is None else asked


def rows(file: SceneFile, balance: HarmonicBalance, result: Result, options: Options) -> list[Change]:
    """What the life and depth of a result would change along the motions that a machine makes.

    Those of the unworn state, one halfway through the life and one near its end, but for rows that were worn in time.
    Each stands beside the balance with the harmonics of the combined refinement, so that none counts in both rows
    """
    wear = result.wear
    assert wear is not None
    how = "motions that a machine makes beside those of the balance"
    looked = [row for row in (0, *states.later_rows(result)) if not wear.in_time[row]]
    if not looked or summary.life(result) is None:
        return []
    apart: tuple[float | None, float | None] = (None, None)
    try:
        there = [states.worn_state(file, balance, result, row) for row in looked]
        apart = missed([left(states.widened(one, one.top(options))) for one in there], result)
    except (ValueError, RuntimeError) as refusal:  # a motion that does not settle, a row that is not solved again
        how += f": {refusal}"
    names = ("life", "depth")
    return [Change(Refinement.OTHER_MOTION, name, None, None, a, how) for name, a in zip(names, apart, strict=True)]


def missed(looks: Sequence[Left], result: Result) -> tuple[float, float]:
    """How far the work that a machine does at states that it leaves puts life and depth off, relative.

    A depth takes more / less cycles in the ratio of both works, so that a life is off by the mean over its cycles; a
    depth goes with the share of the work that the deepest pair has. A state stands for the rows nearest to it, wear in
    time needs none. So few do not show that they cancel: their amounts are taken.
    """
    wear = result.wear
    assert wear is not None
    counted = slice(0, max(states.later_rows(result), default=0) + 1)
    cycles, deepest = wear.cycles_in_step[counted], int((wear.depth[-1] + wear.worn[-1]).argmax())
    apart = np.subtract.outer(wear.cycles[counted] + cycles / 2, [one.cycles for one in looks])
    works = [(float(one.balance.sum()), float(one.machine.sum())) for one in looks]
    longer = np.array([b / max(m, NOTHING * b) if b or m else 1.0 for b, m in works])  # 1 where both motions rest
    deeper = np.array([_share(one.machine, deepest) / (_share(one.balance, deepest) or np.inf) for one in looks])
    chance = np.array([one.error for one in looks])
    nearest, along = np.abs(apart).argmin(axis=1), ~wear.in_time[counted]

    def off(weight: np.ndarray, ratio: np.ndarray) -> float:
        there = np.where(along, ratio[nearest], 1.0)
        return float(weight @ np.abs(there - 1) / (weight @ there)) if weight @ there > 0 else 0.0

    scatter = float(cycles @ (along * chance[nearest]) / (cycles.sum() or 1.0))
    return off(cycles, longer) + scatter, off(wear.worn[counted, deepest], deeper)


def _share(work: np.ndarray, pair: int) -> float:
    return float(work[pair] / work.sum()) if work.sum() > 0 else 0.0


def left(state: State) -> Left:
    """A state beside what a machine does, of a wave in all sectors until it repeats itself.

    Raises  ValueError where the model has no equation in time; RuntimeError where the motion does not settle
    """
    balance, here = state.balance, state.here.state
    steps = max(STEPS, STEPS_PER_HARMONIC * balance.basis.harmonics[-1])
    follower = Follower(MeanOptions(steps))
    whole, begin = time_integration.in_time(balance, here.omega, here, TimeOptions(steps))
    assert begin is not None
    follower.start(whole, begin)
    found = follower.mean(whole, here.omega, lambda motion: np.array([energy_floor(motion)]))
    if not found.settled:
        raise SolverFailure(f"the motion does not settle in {found.periods} periods")
    sectors = len(found.energy) // balance.contact.n_pair
    machine = found.energy.reshape(sectors, -1).mean(axis=0)
    answers = {
        "amplitude": float(found.amplitude[0]),
        "energy": max(float(machine.sum()), float(found.seen[0]) / sectors),
        "preload": float(found.normal_force.sum() / sectors),
    }
    apart = {name: states.relative(state.answers[name], one) for name, one in answers.items()}
    apart["energy"] = abs(state.answers["energy"] - machine.sum()) / answers["energy"] if answers["energy"] > 0 else 0.0
    work = np.maximum(balance.energy(here), 0.0), np.maximum(machine, 0.0)
    return Left(state.cycles, *work, apart, found.error, found.spread)
