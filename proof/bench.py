"""The solver against the dense algorithm of the thesis: tables 7.1 to 7.3 on the beam scene, both in one run.

Both follow the same frequencies with the same predictor, contact law, samples and tolerance. The dense one is timed on
windows of consecutive points spread over the range, started from the fast one's solution outside the clock; the ratio
compares the two on just these points. Both are repeated and the least time of each point is taken: what else the
machine does can only add to it.

The roofline is what the matrix products of a curve would take at least: for each kind of product the larger of its
bytes at the rate at which this core sums an array that fits no cache, and of its operations at the rate of large square
products.
Source  Williams, Waterman and Patterson, CACM 52(4) (2009) 65, doi 10.1145/1498765.1498785"""

from __future__ import annotations

import cProfile
import pstats
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

from proof.dense import DenseBalance
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.threads import limited
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

POINTS, SAMPLES, TOLERANCE = 200, 100, 1e-8  # thesis 7.6
REPEATS, DENSE_REPEATS = 7, 3  # of the whole curve, of each dense point: it takes hundreds of times as long
THESIS_SECONDS = {"0+1": 150.0, "0+3": 1002.0}  # tables 7.1 and 7.2, one core
THESIS_SHARES = {  # contact, balance, inversion in % of one core, tables 7.1 and 7.2
    "0+1": (28.0, 20.0, 46.0),
    "0+3": (6.0, 14.0, 78.0),
}


@dataclass(frozen=True)
class Timing:
    """One line of the benchmark.

    harmonics : such as "0+3", 0 to 3; unknowns : of the dense algorithm, and of ours at the contact
    seconds : of the whole response curve by the compliance form, the sum of the least times of its points, of the
        processor; newton_steps : of it
    repeat_difference : the same from the even and from the odd repeats alone, their relative difference
    ratio : seconds of the dense algorithm over ours on the same dense_points, None without any; dense_seconds : of
        these; dense_lost : points that it did not converge at in 40 steps, which do not count
    max_difference : of the contact displacement, both refined to rounding, relative to its largest value
    contact, balance, direction : share of our time by routine; thesis_seconds : published, one core, or None
    work : matrix products of the curve by kind; products : share of our time that is in these
    roofline : the seconds that `work` takes at least on this machine"""

    harmonics: str
    points: int
    converged: int
    unknowns: int
    dense_unknowns: int
    seconds: float
    repeat_difference: float
    newton_steps: int
    ratio: float | None
    dense_points: int
    dense_lost: int
    dense_seconds: float
    max_difference: float | None
    contact: float
    balance: float
    direction: float
    dense_inversion: float | None
    thesis_seconds: float | None
    work: tuple[Work, ...]
    products: float
    roofline: float


@dataclass(frozen=True)
class Machine:
    """What one core gives: bytes a second from memory, operations a second of large products by bytes of a number."""

    memory: float
    operations: dict[int, float]

    @classmethod
    def measured(cls) -> Machine:
        """The best of several."""
        large, square = np.ones(8_000_000), np.random.default_rng(0).normal(size=(1000, 1000))

        def best(work: Callable[[], object]) -> float:
            durations = []
            for _ in range(REPEATS):
                clock = process_time()
                work()
                durations.append(process_time() - clock)
            return min(durations)

        kinds = [square, square.astype(np.float32)]
        return cls(
            large.nbytes / best(large.sum), {a.itemsize: 2 * len(a) ** 3 / best(lambda a=a: a @ a) for a in kinds}
        )

    def seconds(self, work: Work) -> float:
        """What the work takes at least."""
        compute = sum(flops / self.operations[size] for size, flops in work.flops.items())
        return work.calls * max(compute, work.bytes / self.memory)


@dataclass(frozen=True)
class Work:
    """Products of one kind with matrices of the compliance.

    calls : over the curve; bytes : of the matrices that one call reads; flops : of one call, by bytes of a number"""

    name: str
    calls: int
    bytes: int
    flops: dict[int, int]


def _work(balance: HarmonicBalance, calls: dict[str, int]) -> tuple[Work, ...]:
    """The products of a curve, as `CompliancePoint.apply` and its `jacobian_product` make them."""
    c, m = balance.compliance, balance.basis.n_coeff
    x, n, cores = c.groups[0][0], c.n_contact, len(balance.basis.dynamic)
    matrix, powers = x.columns[:n], x.single[:n]
    core, solved = 16 * cores * x.n_mode**2, 8 * cores * x.n_mode**2
    exact = {8: 2 * m * (matrix.size + x.to_ports.size) + solved, 4: 2 * (m - balance.basis.has_static) * powers.size}
    nearly = {8: solved, 4: 2 * m * (n * n + 2 * n * x.n_mode)}
    return (
        Work("evaluation", calls["apply"], matrix.nbytes + powers.nbytes + x.to_ports.nbytes + core, exact),
        Work("Krylov product", calls["product"], x.w0_single.nbytes + 2 * x.b_single.nbytes + core, nearly),
    )


def run(quick: bool, say: Callable[[str], None]) -> list[Timing]:
    """The table: 0+1 and 0+3 when quick, else 0+5 too; on one thread."""
    plans = [("0+1", (8, 3)), ("0+3", (2, 2))] if quick else [("0+1", (10, 4)), ("0+3", (4, 2)), ("0+5", (3, 1))]
    problem = _problem()
    rows = []
    with limited(1):
        machine = Machine.measured()
    for harmonics, windows in plans:
        say(f"harmonics {harmonics}")
        with limited(1):
            rows.append(_measure(problem(harmonics), harmonics, windows, machine))
        say(f"{_line(rows[-1])}\n{_limit(rows[-1])}")  # what is measured is not lost where a later row is ended
    return rows


def _problem() -> Callable[[str], HarmonicBalance]:
    """The beam scene's balance for chosen harmonics; mesh and reduction are made once."""
    file = scene_file.read("beam_thesis", ())
    with limited(1):
        model = modelling.build(file, Progress())
    reduced, unworn = model.reduced, model.balance

    def of(harmonics: str) -> HarmonicBalance:
        basis = HarmonicBasis(tuple(range(int(harmonics[2:]) + 1)), SAMPLES)
        b = unworn
        return HarmonicBalance.of(reduced, b.contact.joints, basis, b.excitation, b.omega_max)

    return of


def _measure(balance: HarmonicBalance, harmonics: str, windows: tuple[int, int], machine: Machine) -> Timing:
    low, high = settings.response_range(scene_file.read("beam_thesis", ()).scene)
    options = natural.Options(n_points=POINTS, newton=NewtonOptions(TOLERANCE))
    natural.follow(balance, high, high * 0.999, replace(options, n_points=2))  # compiles outside the clock
    branch, steps = _timed(balance, high, low, options)
    per_point = np.min(steps, axis=0)
    halves = [float(np.min(steps[i::2], axis=0).sum()) for i in (0, 1)]
    profiler = cProfile.Profile(process_time)
    profiler.runcall(natural.follow, balance, high, low, options)
    shares, calls = _shares(pstats.Stats(profiler))
    work = _work(balance, calls)

    dense = DenseBalance(balance)
    targets = np.linspace(high, low, POINTS)
    count, length = windows
    starts = np.linspace(3, POINTS - length - 1, count).astype(int)
    dense_seconds = own_seconds = difference = 0.0
    lost = 0
    for start in starts:
        q = _refined(balance, dense, branch.omega, branch.contact, targets[start - 3 : start])
        for i in range(start, start + length):
            durations = []
            for _ in range(DENSE_REPEATS):
                clock = process_time()
                guess = natural.extrapolate(targets[i - 3 : i], q[-3:], targets[i])
                solution = dense.solve(targets[i], guess, TOLERANCE)
                durations.append(process_time() - clock)
            if solution.outcome != CONVERGED:  # its time is that of no solution
                lost += 1
                q += _refined(balance, dense, branch.omega, branch.contact, targets[i : i + 1])
                continue
            dense_seconds += min(durations)
            own_seconds += per_point[i - 1]
            q.append(solution.q)
        last = targets[start + length - 1]
        if solution.outcome != CONVERGED:
            continue
        contact_state = branch.contact[int(np.argmin(np.abs(branch.omega - last)))].reshape(solution.x.shape)
        exact = newton.solve(balance, last, contact_state, NewtonOptions(1e-12)).state.x
        polished = dense.solve(last, q[-1], 1e-12, max_steps=6).x
        difference = float(np.maximum(difference, np.abs(polished - exact).max() / np.abs(exact).max()))
    p = dense.profile
    return Timing(
        harmonics=harmonics, points=len(branch.omega), converged=int(branch.converged.sum()),
        unknowns=balance.n_unknown, dense_unknowns=balance.model.system.n_dof * balance.basis.n_coeff,
        seconds=float(per_point.sum()), repeat_difference=abs(halves[0] - halves[1]) / min(halves),
        newton_steps=int(branch.newton_steps.sum()), ratio=dense_seconds / own_seconds if own_seconds else None,
        dense_points=count * length - lost, dense_lost=lost, dense_seconds=dense_seconds, max_difference=difference,
        contact=shares["contact"], balance=shares["balance"], direction=shares["direction"],
        dense_inversion=p.inversion / max(p.contact + p.balance + p.inversion, 1e-300),
        thesis_seconds=THESIS_SECONDS.get(harmonics), work=work, products=shares["apply"] + shares["product"],
        roofline=sum(map(machine.seconds, work)),
    )  # fmt: skip


def _timed(
    balance: HarmonicBalance, high: float, low: float, options: natural.Options
) -> tuple[Branch, list[np.ndarray]]:
    """The curve, and the seconds of its points in each repeat; the first entry holds the first two points."""
    steps = []
    for _ in range(REPEATS):
        times = [process_time()]

        def on_point(_done: int, _total: int, _point: object, times: list[float] = times) -> None:
            times.append(process_time())

        branch = natural.follow(balance, high, low, options, on_point)
        steps.append(np.diff(times))
    return branch, steps


def _refined(
    balance: HarmonicBalance, dense: DenseBalance, omegas: np.ndarray, contact: np.ndarray, targets: np.ndarray
) -> list[np.ndarray]:
    """Reduced coordinates of the fast solutions at three frequencies, for the dense predictor."""
    coordinates = []
    for omega in targets:
        nearest = int(np.argmin(np.abs(omegas - omega)))
        x = contact[nearest].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
        coordinates.append(dense.coordinates_of(omega, newton.solve(balance, omega, x).state.x))
    return coordinates


def _shares(stats: pstats.Stats) -> tuple[dict[str, float], dict[str, int]]:
    """Share of the profiled time by routine, named as in the thesis: contact, balance, direction of the Newton step.

    Beside them the share and the calls of the matrix products, which are parts of balance and direction"""
    names = {("contact/joint.py", "cycle"): "contact", ("hbm/balance.py", "solve"): "direction"}
    names |= {("linear/compliance.py", of): of for of in ("apply", "product")}
    seconds, calls = dict.fromkeys(names.values(), 0.0), dict.fromkeys(names.values(), 0)
    entries = stats.stats  # type: ignore[attr-defined]
    for (path, _, function), (_, count, _, cumulative, _) in entries.items():
        name = names.get(("/".join(Path(path).parts[-2:]), function))
        if name is not None:
            seconds[name] += cumulative
            calls[name] += count
    total = max(cumulative for *_, cumulative, _ in entries.values())
    shares = {name: value / total for name, value in seconds.items()}
    return shares | {"balance": 1.0 - shares["contact"] - shares["direction"]}, calls


def _line(r: Timing) -> str:
    thesis = f"{r.thesis_seconds:.0f} s" if r.thesis_seconds else "-"
    shares = f"{100 * r.contact:.0f}/{100 * r.balance:.0f}/{100 * r.direction:.0f}"
    published = THESIS_SHARES.get(r.harmonics)
    if published:
        shares += " (thesis " + "/".join(f"{v:.0f}" for v in published) + ")"
    ratio = "-" if r.ratio is None else f"{r.ratio:.1f}"
    return (
        f"{r.harmonics:>9} {r.converged:4d}/{r.points:<4d} {r.seconds:8.2f} {r.repeat_difference:6.0%} "
        f"{r.newton_steps:7d} {ratio:>8} {r.max_difference:19.1e} {thesis:>14}   {shares}"
    )


def _limit(r: Timing) -> str:
    """How near a row is to its roofline, and where the rest of its time is."""
    counts = " and ".join(f"{work.calls / r.points:.1f} {work.name}s" for work in r.work)
    read = sum(work.calls * work.bytes for work in r.work) / r.points
    flops = sum(work.calls * sum(work.flops.values()) for work in r.work) / r.points
    point = r.seconds / r.points
    return (
        f"roofline {r.harmonics}: {counts} a point, {read / 1e6:.0f} MB, {flops / 1e6:.0f} MFlop: "
        f"{1e3 * r.roofline / r.points:.2f} of {1e3 * point:.2f} ms, {r.roofline / r.seconds:.0%}. "
        f"Products take {r.products:.0%} of the time, {r.roofline / (r.products * r.seconds):.0%} of it their limit; "
        f"contact law {r.contact:.0%}; the rest, {1 - r.products - r.contact:.0%}, is between: factors of the cores, "
        "preconditioner, orthogonalisation, calls from Python"
    )


def as_text(rows: list[Timing]) -> str:
    """The rows for people, the thesis's figures beside ours."""
    lines = [
        "harmonics   points   seconds  spread Newton    ratio  largest difference  thesis 1 core   "
        "contact/balance/direction %",
        *map(_line, rows),
    ]
    lines.append(
        f"least of {REPEATS} repeats for each point; spread: the difference of the times from even and from odd repeats"
    )
    lines.append(
        "ratio: seconds of the dense algorithm over ours on the same points "
        f"({', '.join(f'{r.harmonics}: {r.dense_points}' for r in rows)} points)"
    )
    lines += map(_limit, rows)
    missed = [f"{r.dense_lost} at {r.harmonics}" for r in rows if r.dense_lost]
    if missed:
        lines.append(f"the dense algorithm did not converge at further points, which do not count: {', '.join(missed)}")
    return "\n".join(lines)
