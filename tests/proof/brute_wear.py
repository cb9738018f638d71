"""Lives of random scenes beside brute force: every block of cycles is integrated in time, no balance anywhere.

The driver shares only the law of contact, Jenkins elements on a unilateral normal spring, which it states itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numba
import numpy as np

from tests.helpers.verification_models import random_structure
from tests.proof import scoreboard
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.errors import verdict
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import parse

PAIRS, FREE = 2, 4
SETTLE, MEAN = 60, 40  # cycles of a block: left out, and averaged
DEPTH = 0.02  # largest depth of a block over the largest first penetration
BLOCKS = 600
COEFFICIENT = 2e-15  # [m3/J]
AREA = 5e-6  # [m2]


@dataclass(frozen=True)
class Row:
    """One scene. value, error : what the verdict states; brute : life in time [cycles]; lifts : share of time open."""

    number: int
    value: float | None
    error: float | None
    stated: bool
    reason: str
    brute: float | None
    lifts: float

    @property
    def violated(self) -> bool:
        """Whether a stated error is below the true one."""
        if not self.stated or self.value is None or self.error is None or self.brute is None:
            return False
        return abs(self.value / self.brute - 1) > self.error


@dataclass(frozen=True)
class Drawn:
    """A scene of matrices; k_t, k_n [N/m], static, shaken [N], omega [rad/s]."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    k_t: float
    k_n: float
    mu: float
    static: float
    shaken: float
    omega: float

    def text(self) -> str:
        """The scene for `run`."""
        hertz = self.omega / (2 * np.pi)
        return f"""
[scene]
title = "brute force"
[model]
file = "part.npz"
[contact]
dofs = [[0, 1, 2], [3, 4, 5]]
area = {PAIRS * AREA}
tangential_stiffness = {PAIRS * self.k_t}
normal_stiffness = {PAIRS * self.k_n}
friction = {self.mu}
[loads.static.press]
dofs = [2, 5]
value = {self.static}
[loads.harmonic.shaker]
dofs = [8]
value = {self.shaken}
[response]
dofs = [9]
frequency = [{0.8 * hertz}, {1.2 * hertz}]
points = 10
[harmonics]
kept = [0, 1, 2, 3]
[wear]
coefficient = {COEFFICIENT}
at = {{ frequency = {hertz} }}
max_steps = 80
lost_below = {LIFE_SHARE}
"""


def draw(number: int) -> Drawn:
    """A stiff random structure on two pairs, shaken near its first frequency, from sticking to hammering."""
    rng = np.random.default_rng(number)
    system = random_structure(PAIRS, number, 0.02, FREE).system
    first = float(np.sqrt(np.linalg.eigvals(np.linalg.solve(system.mass, system.stiffness)).real.min()))
    k_t = float(10 ** rng.uniform(5.5, 6.5))
    return Drawn(
        system.mass, system.stiffness, system.damping, k_t, 1.3 * k_t, float(rng.uniform(0.2, 0.6)),
        50.0, float(10 ** rng.uniform(2.0, 3.0)), first * float(rng.uniform(0.6, 1.3)),
    )  # fmt: skip


@numba.njit  # type: ignore[untyped-decorator]
def _march(inverse, stiffness, damping, still, shaken, omega, k_t, k_n, mu, depth, u, v, slider, cycles, steps):  # type: ignore[no-untyped-def]
    """Mean work per cycle (n_pair,) [J], mean normal force [N] and share open; u, v, slider go on in place."""
    work, normal_sum, opened = np.zeros(len(depth)), 0.0, 0
    h = 2 * np.pi / (omega * steps)
    for step in range(cycles * steps):
        force = still + shaken * np.cos(omega * h * step) - stiffness @ u - damping @ v
        for p in range(len(depth)):
            normal = max(k_n * (u[3 * p + 2] - depth[p]), 0.0)
            normal_sum += normal
            opened += normal == 0.0
            force[3 * p + 2] -= normal
            for c in range(2):
                drag = k_t * (u[3 * p + c] - slider[p, c])
                held = min(max(drag, -mu * normal), mu * normal)
                moved = u[3 * p + c] - held / k_t
                work[p] += held * (moved - slider[p, c])
                slider[p, c] = moved
                force[3 * p + c] -= held
        v += h * (inverse @ force)
        u += h * v
    return work / cycles, normal_sum / (cycles * steps), opened / (cycles * steps * len(depth))


def life(one: Drawn, share: float = DEPTH) -> tuple[float | None, float]:
    """Cycles until LIFE_SHARE of the first preload is left, None if it is not reached; largest share of time open."""
    n = len(one.mass)
    still, shaken = np.zeros(n), np.zeros(n)
    still[[2, 5]], shaken[8] = one.static, one.shaken
    stiff = one.stiffness + np.eye(n) * max(one.k_n, one.k_t)
    fastest = float(np.sqrt(np.linalg.eigvals(np.linalg.solve(one.mass, stiff)).real.max()))
    steps = max(400, int(2 * np.pi * fastest / one.omega / 0.2))
    depth, u, v, slider = np.zeros(PAIRS), np.zeros(n), np.zeros(n), np.zeros((PAIRS, 2))
    fixed = (np.linalg.inv(one.mass), one.stiffness, one.damping, still, shaken, one.omega, one.k_t, one.k_n, one.mu)
    cycles, first, before, lifts = 0.0, 0.0, 0.0, 0.0
    largest, taken = 0.0, 0.0
    for block in range(BLOCKS):
        _march(*fixed, depth, u, v, slider, SETTLE * (4 if block == 0 else 1), steps)
        work, preload, opened = _march(*fixed, depth, u, v, slider, MEAN, steps)
        lifts = max(lifts, opened)
        if block == 0:
            first, largest = preload, preload / (PAIRS * one.k_n)
        elif preload < LIFE_SHARE * first:
            low = max(preload, 1e-3 * LIFE_SHARE * first)
            part = np.log(before / (LIFE_SHARE * first)) / np.log(before / low)
            return float(cycles - taken * (1 - part)), lifts
        rate = COEFFICIENT * work / AREA
        if not rate.max() > 0:
            return None, lifts
        taken = share * largest / float(rate.max())
        depth, cycles, before = depth + taken * rate, cycles + taken, preload
    return None, lifts


def run(scenes: int, say: Callable[[str], None]) -> list[Row]:
    """Rows of so many scenes."""
    rows = []
    for number in range(scenes):
        one = draw(number)
        brute, lifts = life(one)
        with TemporaryDirectory() as place:
            np.savez(Path(place) / "part.npz", M=one.mass, K=one.stiffness, C=one.damping)
            try:
                file = parse(one.text(), "brute.toml", (), Path(place))
                result, model = scoreboard.solved(file)
                said = verdict.judge(file, model, result, Progress()).statements["life"]
                row = Row(number, said.value, said.error, said.stated, said.reason, brute, lifts)
            except (ValueError, RuntimeError) as refusal:
                row = Row(number, None, None, False, str(refusal), brute, lifts)
        rows.append(row)
        say(as_text([row]))
    return rows


def as_text(rows: list[Row]) -> str:
    """One line for each scene."""
    return "\n".join(
        f"{r.number:3d} run {r.value} error {r.error} {'stated' if r.stated else 'not stated'} in time {r.brute} "
        f"open {r.lifts:.2f}{' VIOLATED' if r.violated else ''} {r.reason}"
        for r in rows
    )
