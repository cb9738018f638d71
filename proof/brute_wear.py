"""Lives of random scenes beside brute force: every block of cycles is integrated in time, no balance anywhere.

The driver shares only the law of contact, Jenkins elements on a unilateral normal spring, which it states itself."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numba
import numpy as np

from proof.time_limit import TimeUp, processor_seconds
from proof.unseen_scenes import scoreboard
from tests.helpers.verification_models import random_structure
from tribodyn.hbm.wear.history import LIFE_SHARE
from tribodyn.workflows.errors import judgement
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import parse

PAIRS, FREE = 2, 4
SETTLE, MEAN = 40, 20  # cycles of a block: left out, and averaged
DEPTH = 0.02  # largest depth of a block over the farthest that the loads move a pair without contact
FALL = 0.1  # of the preload in one block, expected from the block before
BLOCKS = 500
COEFFICIENT = 2e-15  # [m3/J]
AREA = 5e-6  # [m2]


@dataclass(frozen=True)
class Brute:
    """A scene worn in time. cycles : None where its life does not end, for the reason given; first : preload [N]

    opened : largest share of time that a pair is open; blocks : taken"""

    cycles: float | None
    reason: str
    first: float
    opened: float
    blocks: int


@dataclass(frozen=True)
class Row:
    """One scene.

    value, error, reason : what the verdict says of the life; stated : whether it states it
    brute : the finer of two lives in time; doubt : its difference from the other, relative
    preload : first one of `run` over that in time
    followed : share of the cycles of `run` whose motion it followed in time"""

    number: int
    value: float | None
    error: float | None
    stated: bool
    reason: str
    brute: Brute
    doubt: float | None
    preload: float | None
    followed: float = 0.0

    @property
    def outcome(self) -> str:
        """ "held", "violated", "no life" where it ends neither way, or what else keeps the two from being compared."""
        if self.brute.cycles is None or self.doubt is None:
            return "no life" if self.value is None else "no life in time"
        if self.value is None:
            return "no life of run"
        if not self.stated or self.error is None:
            return "not stated"
        return "violated" if abs(self.value / self.brute.cycles - 1) > self.error + self.doubt else "held"


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
kept = [0, 1, 2, 3, 4, 5]
[wear]
coefficient = {COEFFICIENT}
at = {{ frequency = {hertz} }}
rule = "error_controlled"
motion = "machine"
max_steps = 400
tolerance = "3 %"
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
def _march(inverse, by_u, by_v, still, shaken, omega, k_t, k_n, mu, depth, u, v, slider, cycles, steps):  # type: ignore[no-untyped-def]
    """Mean work per cycle (n_pair,) [J], mean normal force [N] and share open (n_pair,); u, v, slider go on in place.

    inverse : of the mass; by_u, by_v : it times stiffness and damping; still, shaken : it times the loads"""
    n, n_pair = len(u), len(depth)
    work, opened, normal_sum = np.zeros(n_pair), np.zeros(n_pair), 0.0
    h = 2 * np.pi / (omega * steps)
    contact, rate = np.zeros(3 * n_pair), np.zeros(n)
    for step in range(cycles * steps):
        for p in range(n_pair):
            normal = max(k_n * (u[3 * p + 2] - depth[p]), 0.0)
            normal_sum += normal
            opened[p] += normal == 0.0
            contact[3 * p + 2] = normal
            for c in range(2):
                friction = min(max(k_t * (u[3 * p + c] - slider[p, c]), -mu * normal), mu * normal)
                slid = u[3 * p + c] - friction / k_t
                work[p] += friction * (slid - slider[p, c])
                slider[p, c] = slid
                contact[3 * p + c] = friction
        wave = np.cos(omega * h * (step % steps))
        for i in range(n):
            rate[i] = still[i] + shaken[i] * wave
            for j in range(n):
                rate[i] -= by_u[i, j] * u[j] + by_v[i, j] * v[j]
            for j in range(3 * n_pair):
                rate[i] -= inverse[i, j] * contact[j]
        for i in range(n):
            v[i] += h * rate[i]
            u[i] += h * v[i]
    return work / cycles, normal_sum / (cycles * steps), opened / (cycles * steps)


def _stuck(scene: Drawn, still: np.ndarray) -> np.ndarray:
    """Displacement (n,) [m] under the static load, its friction springs without a slip: what no path has changed."""
    u = still
    for _ in range(2**PAIRS):
        springs = np.zeros(len(u))
        for p in range(PAIRS):
            if u[3 * p + 2] > 0:
                springs[3 * p : 3 * p + 3] = scene.k_t, scene.k_t, scene.k_n
        u = np.linalg.solve(scene.stiffness + np.diag(springs), still)
    return u


def life(scene: Drawn, finer: int = 1) -> Brute:
    """Cycles until LIFE_SHARE of the first preload is left. finer : by how much blocks and time steps are smaller.

    Depths go on by the rate of a block and of the one before (Adams and Bashforth's second order)."""
    n = len(scene.mass)
    still, shaken = np.zeros(n), np.zeros(n)
    still[[2, 5]], shaken[8] = scene.static / PAIRS, scene.shaken
    dynamic = scene.stiffness - scene.omega**2 * scene.mass + 1j * scene.omega * scene.damping
    free = np.linalg.solve(scene.stiffness, still) + abs(np.linalg.solve(dynamic, shaken))
    reach = float(free[[2, 5]].max())
    stiff = scene.stiffness + np.eye(n) * max(scene.k_n, scene.k_t)
    fastest = float(np.sqrt(np.linalg.eigvals(np.linalg.solve(scene.mass, stiff)).real.max()))
    steps = finer * max(400, int(2 * np.pi * fastest / scene.omega / 0.15))
    inverse = np.linalg.inv(scene.mass)
    fixed = (inverse, inverse @ scene.stiffness, inverse @ scene.damping, inverse @ still, inverse @ shaken)
    fixed = (*fixed, scene.omega, scene.k_t, scene.k_n, scene.mu)
    depth, u, v, slider = np.zeros(PAIRS), _stuck(scene, still), np.zeros(n), np.zeros((PAIRS, 2))
    _march(*fixed, depth, u, v, slider, 4 * SETTLE, steps)
    cycles, first, before, opened_most, previous_stride = 0.0, 0.0, 0.0, 0.0, 0.0
    earlier = np.zeros(PAIRS)
    for block in range(finer * BLOCKS):
        _march(*fixed, depth, u, v, slider, SETTLE, steps)
        work, preload, opened = _march(*fixed, depth, u, v, slider, MEAN, steps)
        opened_most, rate = max(opened_most, float(opened.max())), COEFFICIENT * work / AREA
        if block == 0:
            first, earlier = preload, rate
        elif preload < LIFE_SHARE * first:
            low = max(preload, 1e-3 * LIFE_SHARE * first)
            part = np.log(before / (LIFE_SHARE * first)) / np.log(before / low)
            return Brute(float(cycles - previous_stride * (1 - part)), "", first, opened_most, block)
        if not rate.max() > 1e-9 * COEFFICIENT * scene.mu * preload * reach / AREA:
            sentence = f"nothing slips any more with {preload / first:.2g} of the preload left"
            return Brute(None, sentence, first, opened_most, block)
        stride = DEPTH / finer * reach / float(rate.max())
        if block and preload < before:
            stride = min(stride, FALL / finer * previous_stride / np.log(before / preload))
        bend = 0.5 * stride / previous_stride if block else 0.0
        depth = depth + stride * np.maximum(rate + bend * (rate - earlier), 0.0)
        cycles, before, previous_stride, earlier = cycles + stride, preload, stride, rate
    return Brute(
        None, f"{before / first:.2g} of the preload is left after {finer * BLOCKS} blocks", first, opened_most, block
    )


def run(scenes: int, say: Callable[[str], None], first: int = 0, seconds: float = 60.0) -> list[Row]:
    """Rows of so many scenes; seconds : of the processor, that `run` may take for one, with its errors."""
    rows = []
    for number in range(first, first + scenes):
        scene = draw(number)
        coarse, brute = life(scene), life(scene, 2)
        both_ended = coarse.cycles is not None and brute.cycles is not None
        row = Row(
            number, None, None, False, "", brute, abs(coarse.cycles / brute.cycles - 1) if both_ended else None, None
        )
        with TemporaryDirectory() as place:
            np.savez(Path(place) / "part.npz", M=scene.mass, K=scene.stiffness, C=scene.damping)
            file = parse(scene.text(), "brute.toml", (), Path(place))
            try:
                with processor_seconds(seconds):
                    result, model = scoreboard.solved(file)
                    statement = judgement.judge(file, model, result, Progress()).statements["life"]
                row = replace(
                    row, value=statement.value, error=statement.error, stated=statement.stated, reason=statement.reason
                )
                if (worn := result.wear) is not None:
                    followed = float(worn.cycles_in_step[worn.in_time].sum() / worn.cycles_in_step.sum())
                    row = replace(row, preload=float(worn.preload[0]) / brute.first, followed=followed)
            except TimeUp:
                row = replace(row, reason=f"its run takes above {seconds:g} s")
            except (ValueError, RuntimeError) as refusal:
                row = replace(row, reason=str(refusal))
        rows.append(row)
        say(as_text([row]))
    return rows


def as_text(rows: list[Row]) -> str:
    """One line for each scene."""

    def shown(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    lines = []
    for r in rows:
        ratio = r.value / r.brute.cycles if r.value and r.brute.cycles else None
        lines.append(
            f"{r.number:3d} in time {shown(r.brute.cycles, '.4g')} +- {shown(r.doubt, '.1%')}, "
            f"run {shown(r.value, '.4g')} +- {shown(r.error, '.1%')}, in time for {r.followed:.0%} of its cycles, "
            f"ratio {shown(ratio, '.3f')}, "
            f"first preload {shown(r.preload, '.4f')}, open {r.brute.opened:.2f}, {r.brute.blocks} blocks: {r.outcome}"
            + "".join(f"; {sentence}" for sentence in (r.brute.reason, r.reason) if sentence)
        )
    return "\n".join(lines)
