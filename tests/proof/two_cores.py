"""One response on one core and on two, where it is followed from both ends: the beam scene, two sizes of contact.

Upwards, as a run follows it, and downwards, as the thesis does: a start from rest is easy at one end and may not be at
the other, and two processes make both.

Clock seconds, the two by turns and the least of each: other work on the machine can only add to them. Processor seconds
of the longer process, from the same repeats, tell the same where the machine is not free.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from multiprocessing import active_children
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import two_ends
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.processes import FORKS
from tribodyn.hbm.threads import limited, usable
from tribodyn.workflows.run import memory, modelling, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

CASES = {13: ("0+1", "0+3"), 23: ("0+1", "0+3")}  # nodes along each side of the patch -> harmonics
POINTS, SAMPLES, REPEATS = 200, 100, 3
LOOKED = 10  # steps after which the memory of the second process is looked at
COMPARED = 10  # every so many of the common frequencies are refined and compared


@dataclass(frozen=True)
class CoresCost:
    """One response over the range of the scene.

    harmonics : such as "0+3", 0 to 3; upwards : from the lowest to the highest frequency, or back
    points, newton_steps : of the curves on one core and on two
    one, two : clock seconds, least of the repeats; processor : seconds of the process on one core, and of those from
        the start and from the stop on two, least each; from_rest : of the first point at the start and at the stop
    difference : largest, of the contact displacement at common frequencies, both refined to rounding, relative to its
        largest value; own_bytes : memory that the second process has besides what it shares with the first
    reached : whether both curves reach the stop and all points converged
    """

    contact_dofs: int
    harmonics: str
    upwards: bool
    points: tuple[int, int]
    newton_steps: tuple[int, int]
    one: float
    two: float
    processor: tuple[float, float, float]
    from_rest: tuple[float, float]
    difference: float
    own_bytes: float
    reached: bool

    @property
    def ratio(self) -> float:
        """Of the clock."""
        return self.one / self.two

    @property
    def processor_ratio(self) -> float:
        """Of one process over the longer of two."""
        return self.processor[0] / max(self.processor[1:])


def run(say: Callable[[str], None]) -> list[CoresCost]:
    """Every case; raises ValueError where there are no two cores."""
    if usable(2) < 2 or not FORKS:
        raise ValueError("two cores are needed, of a system that can fork: this process has one")
    rows = []
    for n_patch, harmonics in CASES.items():
        say(f"{n_patch} x {n_patch} contact nodes, model")
        of, low, high = _problem(n_patch)
        for kept in harmonics:
            say(f"harmonics {kept}")
            balance = of(kept)
            rows += [measure(balance, kept, *way) for way in ((low, high), (high, low))]
    return rows


def _problem(n_patch: int) -> tuple[Callable[[str], HarmonicBalance], float, float]:
    """The beam scene's balance for chosen harmonics, and its range [rad/s]; mesh and reduction are made once."""
    file = scene_file.read("beam_thesis", [f"geometry.n_patch={n_patch}"])
    with limited(1), TemporaryDirectory() as folder:
        model = modelling.build(file, Path(folder), Progress())
    b = model.balance

    def of(harmonics: str) -> HarmonicBalance:
        basis = HarmonicBasis(tuple(range(int(harmonics[2:]) + 1)), SAMPLES)
        return HarmonicBalance.of(model.reduced, b.contact.joints, basis, b.excitation, b.omega_max)

    return of, *settings.response_range(file.scene)


def measure(balance: HarmonicBalance, harmonics: str, start: float, stop: float) -> CoresCost:
    """The same response on one core and on two, by turns."""
    rest = []
    for omega in (start, stop):  # also compiles outside the clock
        newton.solve_from_rest(balance, omega)
        clock = time.process_time()
        newton.solve_from_rest(balance, omega)
        rest.append(time.process_time() - clock)
    times = {1: np.full(3, np.inf), 2: np.full(3, np.inf)}
    branches: dict[int, Branch] = {}
    options = natural.Options(n_points=POINTS)
    own, calls = [0.0], itertools.count(1)

    def look(done: int, wanted: int) -> None:
        if next(calls) % LOOKED == 0:
            own.extend(memory.own(process.pid) for process in active_children() if process.pid is not None)

    for _ in range(REPEATS):
        for cores, least in times.items():
            before = _seconds()
            with limited(cores):
                branches[cores] = two_ends.follow(natural, balance, start, stop, options, look)
            times[cores] = np.minimum(least, _seconds() - before)
    one, two = branches[1], branches[2]
    return CoresCost(
        contact_dofs=balance.compliance.n_contact,
        harmonics=harmonics,
        upwards=start < stop,
        points=(len(one.omega), len(two.omega)),
        newton_steps=(int(one.newton_steps.sum()), int(two.newton_steps.sum())),
        one=float(times[1][0]),
        two=float(times[2][0]),
        processor=(float(times[1][1]), float(times[2][1]), float(times[2][2])),
        from_rest=(rest[0], rest[1]),
        difference=_difference(balance, one, two),
        own_bytes=float(np.nanmax(own)),
        reached=str(one.end) == str(two.end) and bool(one.converged.all() and two.converged.all()),
    )


def _seconds() -> np.ndarray:
    """Seconds of the clock, of this process and of those that it has ended."""
    used = os.times()
    return np.array([time.perf_counter(), time.process_time(), used.children_user + used.children_system])


def _difference(balance: HarmonicBalance, one: Branch, two: Branch) -> float:
    """Largest relative difference of two curves where they have a frequency in common, both refined to rounding."""
    omega, here, there = np.intersect1d(one.omega, two.omega, return_indices=True)
    shape, exact, found = (balance.contact.n_pair, -1, balance.basis.n_coeff), NewtonOptions(1e-12), 0.0
    for i in range(0, len(omega), COMPARED):
        starts = (one.contact[here[i]], two.contact[there[i]])
        a, b = (newton.solve(balance, omega[i], start.reshape(shape), exact).state.x for start in starts)
        found = max(found, float(np.abs(a - b).max() / np.abs(a).max()))
    return found


def as_records(rows: Sequence[CoresCost]) -> list[dict[str, object]]:
    """The rows for JSON."""
    return [asdict(row) | {"ratio": row.ratio, "processor_ratio": row.processor_ratio} for row in rows]


def as_text(rows: Sequence[CoresCost]) -> str:
    """The rows for people."""
    lines = [
        "contact DOFs  harmonics   way   points   Newton   one core  two cores  ratio   "
        "processor: one / from start, from stop  ratio  from rest      largest difference  own memory"
    ]
    for r in rows:
        points, steps = ("/".join(str(n) for n in pair) for pair in (r.points, r.newton_steps))
        alone, start, stop = r.processor
        way, lost = "up" if r.upwards else "down", "" if r.reached else "  NOT ALL CONVERGED"
        lines.append(
            f"{r.contact_dofs:12d} {r.harmonics:>10} {way:>5} {points:>8} {steps:>8} "
            f"{r.one:8.2f} s {r.two:8.2f} s {r.ratio:6.2f} {alone:16.2f} / {start:.2f}, {stop:.2f} s "
            f"{r.processor_ratio:15.2f}  {r.from_rest[0]:.2f}, {r.from_rest[1]:.2f} s {r.difference:12.1e} "
            f"{r.own_bytes / 1e6:17.0f} MB{lost}"
        )
    lines.append(f"least of {REPEATS} repeats by turns; largest difference at every {COMPARED}th common frequency")
    return "\n".join(lines)
