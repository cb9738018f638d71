"""Random friction problems that slip, lift and hit: is every response curve followed to its end, from both ends alike?

A problem is a random elastic body on one to three contact pairs with two tangential and one normal component. The
vibrating load is between a tenth of the static one and thirty times it. The curve round one of its resonances is
followed by arc length upwards and downwards. Points are checked by a march of the friction law and a dense solve, which
share nothing with the solver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from time import process_time

import numpy as np
import scipy.linalg as sla

from tribodyn.declarations import Role
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.reduction.model import ReducedModel

HARMONICS = ((0, 1), (0, 1), (0, 1, 2, 3))
SPAN = (0.75, 1.25)  # of the chosen mode's frequency, stuck
MARCHES = (4096, 32768, 131072)  # time steps of the independent check, finer ones where coarser ones miss
CHECKED = 6  # points of a curve that are checked
DEFECT = 3e-4  # of the displacement, that a march may miss; its error falls with its steps
SAME_FOLD = 1e-6  # relative distance of frequencies within which two folds are one
FOLLOWED, REFUSED, WRONG = "followed", "refused", "wrong"
LOADS = (0.0, 0.3, 1.0, 3.0, 10.0)  # vibrating over static load, that the table counts between
ENDS = ((FOLLOWED, 10), (REFUSED, 9), (WRONG, 7))  # with the widths of their columns


@dataclass(frozen=True)
class Problem:
    """A random problem: its balance and the frequencies between which its curve is followed [rad/s].

    load : vibrating over static load; harmonics : highest one kept"""

    balance: HarmonicBalance
    low: float
    high: float
    load: float

    @property
    def harmonics(self) -> int:
        """The highest harmonic."""
        return self.balance.basis.harmonics[-1]


@dataclass(frozen=True)
class Curve:
    """One response curve followed from both ends.

    seed : of the problem; load : vibrating over static load; harmonics : highest one kept; pairs : of the contact
    outcome : "followed", "refused" or "wrong"; reason : why, a sentence
    points, folds : of the way up; lifts : whether a pair separates on it; slips : whether one slips
    defect : largest of the independent residual over the displacement, at the points checked
    seconds : of processor, both ways"""

    seed: int
    load: float
    harmonics: int
    pairs: int
    outcome: str
    reason: str
    points: int
    folds: int
    slips: bool
    lifts: bool
    defect: float
    seconds: float


def problem(seed: int, transitions: str = "located") -> Problem:
    """The random problem of a seed."""
    rng = np.random.default_rng(seed)
    n_pair = int(rng.integers(1, 4))
    n = 3 * n_pair + 3
    modes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    stiffness = (modes * 10 ** rng.uniform(4.0, 6.0, n)) @ modes.T
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    lam, shapes = sla.eigh(stiffness, mass)
    shifted = mass @ shapes
    damping = (shifted * (2 * 10 ** rng.uniform(-2.3, -1.5) * np.sqrt(lam))) @ shifted.T
    press, shake = np.zeros(n), rng.normal(size=n)
    press[2 : 3 * n_pair : 3] = rng.uniform(0.5, 1.5, n_pair)
    system = SecondOrderSystem(mass, stiffness, damping, {"press": press, "shake": shake}, {"tip": np.eye(n)[-1]})
    b = np.eye(3 * n_pair, n)
    points, frames = np.zeros((n_pair, 3)), np.tile(np.eye(3), (n_pair, 1, 1))
    nowhere = np.zeros((0, 4), int)
    face = ContactInterface(("t1", "t2", "n"), points, frames, np.ones(n_pair), np.zeros(n_pair), b, nowhere)
    springs = 10 ** rng.uniform(4.5, 6.0, (n_pair, 3))
    parameters = ContactParameters.of(("t1", "t2", "n"), springs, friction=float(rng.uniform(0.1, 0.8)))
    stuck = np.sqrt(sla.eigh(stiffness + b.T @ (springs.reshape(-1, 1) * b), mass, eigvals_only=True))
    omega = float(stuck[rng.integers(0, min(3, n))])
    load = float(10 ** rng.uniform(-1.0, 1.5))
    harmonics = HARMONICS[int(rng.integers(0, len(HARMONICS)))]
    basis = HarmonicBasis(harmonics, 128, transitions)
    excitation = Excitation.of({"press": 100.0}, {1: {"shake": 100.0 * load / np.sqrt(n)}})
    high = SPAN[1] * omega
    joint = Joint("contact", "jenkins", parameters)
    balance = HarmonicBalance.of(ReducedModel(system, face), joint, basis, excitation, high)
    return Problem(balance, SPAN[0] * omega, high, load)


def run(seeds: Sequence[int], say: Callable[[str], None]) -> list[Curve]:
    """The problems of some seeds."""
    rows = []
    for seed in seeds:
        rows.append(judged(seed))
        say(f"problem {seed}: {rows[-1].outcome}: {rows[-1].reason}")
    return rows


def judged(seed: int, transitions: str = "located") -> Curve:
    """Follow the curve of one problem from both ends, and judge."""
    drawn = problem(seed, transitions)
    clock = process_time()
    up = arc_length.follow(drawn.balance, drawn.low, drawn.high)
    down = arc_length.follow(drawn.balance, drawn.high, drawn.low)
    seconds = process_time() - clock
    status = _status(drawn.balance, up)
    defect = max(checked(drawn.balance, up), checked(drawn.balance, down))
    outcome, reason = verdict(up, down, defect)
    return Curve(
        seed, drawn.load, drawn.harmonics, drawn.balance.contact.n_pair, outcome, reason, len(up.omega), len(up.folds),
        bool(status & 2), bool(status & 4), defect, seconds,
    )  # fmt: skip


def verdict(up: Branch, down: Branch, defect: float) -> tuple[str, str]:
    """What is said of a curve that was followed up and down."""
    if defect > DEFECT:
        return WRONG, f"a point misses the equations of motion by {defect:.1e}"
    lost = [f"{way}: {branch.end}" for way, branch in (("up", up), ("down", down)) if not _whole(branch)]
    if lost:
        return REFUSED, "; ".join(lost)
    if BranchEnd.TURNED_BACK in (up.ended, down.ended):
        return FOLLOWED, f"the curve turns back: {up.end}; {down.end}"
    if not _meet(up, down):
        return FOLLOWED, "two branches that do not meet in the range"
    current, refined = (np.sort(branch.omega[list(branch.folds)]) for branch in (up, down))
    if len(current) != len(refined) or not np.allclose(current, refined, rtol=SAME_FOLD, atol=0.0):
        return WRONG, f"{len(current)} folds upwards and {len(refined)} downwards, or not the same"
    return FOLLOWED, f"reached both ends, {len(current)} folds"


def _whole(branch: Branch) -> bool:
    """Whether a curve was followed to an end of the range without a gap."""
    ends = (BranchEnd.REACHED, BranchEnd.TURNED_BACK, BranchEnd.CLOSED)
    return branch.ended in ends and "gaps" not in branch.end.detail


def _meet(up: Branch, down: Branch) -> bool:
    """Whether each way ends where the other one begins."""
    size = max(float(np.linalg.norm(b.contact[i])) for b in (up, down) for i in (0, -1))
    pairs = ((up.contact[-1], down.contact[0]), (up.contact[0], down.contact[-1]))
    return all(float(np.linalg.norm(a - b)) < 1e-5 * size for a, b in pairs)


def _status(balance: HarmonicBalance, branch: Branch) -> int:
    """What any pair does at any point, as bits: sticks 1, slips 2, separates 4."""
    result = 0
    for omega, x in zip(branch.omega, branch.contact, strict=True):
        state = balance.evaluate(omega, x.reshape(balance.contact.n_pair, 3, -1), jacobian=False)
        result |= int(np.bitwise_or.reduce(state.cycle.status))
    return result


def checked(balance: HarmonicBalance, branch: Branch) -> float:
    """Largest independent residual over the displacement, at converged points spread over the curve."""
    places = np.flatnonzero(branch.converged)
    if len(places) == 0:
        return 0.0
    chosen = places[np.unique(np.linspace(0, len(places) - 1, CHECKED).round().astype(int))]
    for steps in MARCHES:
        forces = marched(balance, branch.contact[chosen], steps)
        worst = max(defect(balance, branch.omega[i], branch.contact[i], f) for i, f in zip(chosen, forces, strict=True))
        if worst <= DEFECT:
            break
    return worst


def marched(balance: HarmonicBalance, x: np.ndarray, steps: int) -> np.ndarray:
    """Coefficients of the contact forces [N] of motions x (n_motion, n_contact, n_coeff) [m], step by step in time.

    Each tangential spring has a slider between walls that the normal force moves; the second cycle repeats"""
    basis, k = balance.basis, balance.contact.stiffness
    friction = balance.contact.number(Role.FRICTION)[:, None]
    angle = 2 * np.pi * np.arange(steps) / steps
    shapes = np.stack([np.ones_like(angle)] + [f(h * angle) for h in basis.dynamic for f in (np.cos, np.sin)], axis=1)
    path = (x @ shapes.T).reshape(len(x), len(k), 3, steps)
    force = np.empty_like(path)
    force[:, :, 2] = np.maximum(k[:, 2:] * path[:, :, 2], 0.0)
    reach = (friction * force[:, :, 2])[:, :, None] / k[:, :2, None]
    low, high = (np.moveaxis(path[:, :, :2] + side * reach, -1, 0).copy() for side in (-1, 1))
    slider, sliders = np.zeros(low.shape[1:]), np.empty_like(low)
    for _ in range(2):
        for j in range(steps):
            slider = np.minimum(np.maximum(slider, low[j]), high[j])
            sliders[j] = slider
    force[:, :, :2] = k[:, :2, None] * (path[:, :, :2] - np.moveaxis(sliders, 0, -1))
    weight = np.where(basis.order == 0, 1.0, 2.0) / steps
    coefficients: np.ndarray = (force.reshape(*x.shape[:2], steps) @ shapes) * weight
    return coefficients


def defect(balance: HarmonicBalance, omega: float, x: np.ndarray, force: np.ndarray) -> float:
    """|x - displacement under the loads and the contact forces| / |x|, both (n_contact, n_coeff).

    Every harmonic is one dense complex solve with the contact springs on both sides"""
    basis, system = balance.basis, balance.model.system
    b, k = np.asarray(balance.model.interface.B), balance.contact.stiffness.reshape(-1, 1)
    push = basis.to_complex(k * x - force)
    back = np.zeros_like(push)
    for position, h in enumerate(basis.harmonics):
        load = sum((v * system.loads[name] for (at, name), v in balance.excitation.loads.items() if at == h), 0j)
        s = 1j * h * omega
        dynamic = system.stiffness + b.T @ (k * b) + s * system.damping + s * s * system.mass
        back[:, position] = b @ np.linalg.solve(dynamic, load + b.T @ push[:, position])
    return float(np.linalg.norm(x - basis.to_real(back)) / np.linalg.norm(x))


def as_text(rows: list[Curve]) -> str:
    """The rows for people: counts by load, then every curve that was not followed."""
    lines = ["vibrating over static load  problems  followed  refused  wrong  with lift-off  with folds  seconds"]
    edges = (*LOADS, np.inf)
    for low, high in pairwise(edges):
        group = [row for row in rows if low <= row.load < high]
        if not group:
            continue
        counts = "".join(f"{sum(row.outcome == end for row in group):{width}d}" for end, width in ENDS)
        span = f"{low:g} to {high:g}" if high < np.inf else f"from {low:g}"
        lifts, folds = sum(row.lifts for row in group), sum(row.folds > 0 for row in group)
        lines.append(f"{span:>26}{len(group):10d}{counts}{lifts:15d}{folds:12d}{sum(r.seconds for r in group):9.0f}")
    lines += [f"problem {row.seed}, {row.outcome}: {row.reason}" for row in rows if row.outcome != FOLLOWED]
    return "\n".join(lines)
