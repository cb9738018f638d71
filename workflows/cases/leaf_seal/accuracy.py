"""What harmonics buy on the leaf seal, beside time integration: tribodyn leaf accuracy.

The two folds of the main resonance are found in time too, by bisection: the highest frequency at which there is a low
periodic motion, and the lowest at which there is a high one. Where three solutions share a frequency, plain marches in
time are started at each of them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from tribodyn.hbm import newton, stability, time_integration
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.branch import CONVERGED
from tribodyn.hbm.time_integration import Options, PeriodicMotion
from tribodyn.workflows.cases.leaf_seal.figures import MICRO, draw_curve
from tribodyn.workflows.cases.leaf_seal.response import LINER_NODE, LeafResponse, respond
from tribodyn.workflows.pictures.style import BLUE, GREEN, INK, ORANGE, RED, STYLE
from tribodyn.workflows.scene import scene_file

HARMONICS = (1, 3, 5, 9)
HILL = 5  # harmonics of the solutions whose stability is compared with time integration
SEARCH = Options(steps=512, tolerance=1e-7, max_periods=400)
MARCH = replace(SEARCH, accelerate=False, max_periods=800, patience=800)
LEFT = 0.3  # change of amplitude, relative, that means that a motion has left its branch
BISECTIONS, BRACKET = 8, 0.02


@dataclass(frozen=True)
class Edge:
    """The end of a branch in time integration. omega : [rad/s]; amplitude : of the last motion on it [m]."""

    omega: float
    amplitude: float


@dataclass(frozen=True)
class Coexisting:
    """A solution that shares its frequency with others.

    amplitude : of the lower corner by harmonic balance; in_time : after a march of `periods` that began there [m]
    stays : whether the march ended where it began; growth : largest real part of Hill's exponents [1/s]
    """

    amplitude: float
    stable: bool
    growth: float
    in_time: float
    periods: int
    stays: bool


def with_harmonics(top: int) -> LeafResponse:
    """The response of the scene with harmonics 0 to `top`."""
    return respond(scene_file.read("leaf_seal", (f"harmonics.kept={list(range(top + 1))}",)))


def amplitude(balance: HarmonicBalance, motion: PeriodicMotion) -> float:
    """Vibration amplitude of the lower corner in time integration, as hbm.branch.amplitude counts it [m]."""
    series = motion.outputs[balance.compliance.output_names.index(LINER_NODE)]
    return float(np.sqrt(2) * series.std())


def march(balance: HarmonicBalance, state: State, omega: float, options: Options = MARCH) -> PeriodicMotion:
    """Time integration from a balance state, at a frequency that may be another than its own."""
    return time_integration.integrate(balance, omega, balance.evaluate(omega, state.x), options)


def solutions_at(response: LeafResponse, omega: float) -> list[State]:
    """All solutions of the curve at one frequency, in the order of the curve."""
    balance, branch = response.balance, response.branch
    beyond = branch.omega - omega
    found = []
    for i in np.flatnonzero(beyond[:-1] * beyond[1:] < 0):
        share = beyond[i] / (beyond[i] - beyond[i + 1])
        x = (1 - share) * branch.contact[i] + share * branch.contact[i + 1]
        solution = newton.solve(balance, omega, x.reshape(balance.contact.n_pair, -1, balance.basis.n_coeff))
        if solution.converged:
            found.append(solution.state)
    return found


def edge(response: LeafResponse, fold: int, high: bool) -> Edge:
    """Where, in time, the low or the high branch ends that a fold of the balance ends."""
    balance, branch = response.balance, response.branch
    at_fold = response.state(fold)
    inside, outside = (branch.omega[fold] * (1 + side * BRACKET) for side in ((1, -1) if high else (-1, 1)))
    last = float(branch.amplitude(LINER_NODE)[fold])
    for _ in range(BISECTIONS):
        omega = 0.5 * (inside + outside)
        there = solutions_at(response, omega)
        own, other = (there[-1], there[0]) if high else (there[0], there[-1])
        if len(there) == 1:  # behind the fold
            own = at_fold
        motion = march(balance, own, omega, SEARCH)
        moved = motion.coefficients(motion.x, balance.basis)
        if motion.outcome == CONVERGED and np.linalg.norm(moved - own.x) < np.linalg.norm(moved - other.x):
            inside, last = omega, amplitude(balance, motion)
        else:
            outside = omega
    return Edge(inside, last)


def coexisting(response: LeafResponse, low: float, high: float) -> tuple[float, list[Coexisting]]:
    """The first of some frequencies at which two stable solutions and an unstable one share it, with a march from each.

    low, high : frequencies of the folds [rad/s]
    Returns the frequency [rad/s] and the solutions; none where the frequencies between the folds hold no such three
    """
    balance = response.balance
    for omega in np.linspace(low, high, 24)[1:-1]:
        states = solutions_at(response, omega)
        hill = [stability.stability(balance, state) for state in states]
        if [one.stable for one in hill] != [True, False, True]:
            continue
        found = []
        for state, one in zip(states, hill, strict=True):
            row = balance.outputs(state)[balance.compliance.output_names.index(LINER_NODE)]
            motion = march(balance, state, omega)
            ours, theirs = float(np.linalg.norm(row[1:])), amplitude(balance, motion)
            growth, stays = float(one.exponents.real.max()), abs(theirs / ours - 1) < LEFT
            found.append(Coexisting(ours, one.stable, growth, theirs, motion.periods, stays))
        return float(omega), found
    return float("nan"), []


def resonance(response: LeafResponse) -> tuple[int, int, float]:
    """The folds at the upper and the lower end of the main resonance, and its peak amplitude [m]."""
    upper, lower = response.branch.folds[0], response.branch.folds[1]
    return upper, lower, float(response.branch.amplitude(LINER_NODE).max())


def errors(responses: dict[int, LeafResponse], upper: Edge, lower: Edge) -> list[dict[str, float]]:
    """Folds and peak for every number of harmonics, with relative errors against time integration."""
    rows = []
    for top, response in responses.items():
        first, second, peak = resonance(response)
        folds = response.branch.omega[[first, second]]
        rows.append(
            {
                "harmonics": top,
                "unknowns": response.balance.n_unknown,
                "upper_fold_hz": folds[0] / (2 * np.pi),
                "upper_fold_error": folds[0] / upper.omega - 1,
                "lower_fold_hz": folds[1] / (2 * np.pi),
                "lower_fold_error": folds[1] / lower.omega - 1,
                "peak_m": peak,
                "peak_error": peak / lower.amplitude - 1,
                "seconds": response.seconds,
            }
        )
    return rows


def table(rows: Sequence[dict[str, float]], upper: Edge, lower: Edge) -> str:
    """The errors as people read them."""
    lines = ["harmonics  unknowns  upper fold / Hz   error    lower fold / Hz   error     peak / um    error   seconds"]
    for row in rows:
        cells = "".join(
            f"{row[f'{name}_fold_hz']:13.3f} {100 * row[f'{name}_fold_error']:+9.3f} %  " for name in ("upper", "lower")
        )
        lines.append(
            f"0..{row['harmonics']:<6.0f} {row['unknowns']:8.0f} {cells} {MICRO * row['peak_m']:10.2f} "
            f"{100 * row['peak_error']:+8.2f} % {row['seconds']:8.1f}"
        )
    hertz, resolution = 2 * np.pi, 2 * BRACKET / 2**BISECTIONS
    lines.append(
        f"in time   {'':9}{upper.omega / hertz:13.3f}   {'':10}{lower.omega / hertz:15.3f}   {'':10}"
        f"{MICRO * lower.amplitude:12.2f}   folds in time are known to {100 * resolution:.2f} %"
    )
    return "\n".join(lines)


def figure_of(responses: dict[int, LeafResponse], marks: Sequence[tuple[float, float]]) -> Figure:
    """Curves of all harmonics around the main resonance, and amplitudes met in time integration.

    marks : frequency [rad/s] and amplitude [m]
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8, 5), layout="constrained")
        axes = figure.subplots()
        for (top, response), color in zip(responses.items(), (RED, ORANGE, GREEN, BLUE), strict=False):
            hertz, height = response.branch.frequency, MICRO * response.branch.amplitude(LINER_NODE)
            label = f"harmonics 0..{top}"
            if top <= HILL:  # beyond, the eigenvalue problems get large and tell nothing new
                draw_curve(axes, hertz, response.stability.stable, height, color, lw=1.3, label=label)
            else:
                axes.plot(hertz, height, color=color, lw=0.8, label=label)
        omega, height = np.array(marks).T
        axes.plot(omega / (2 * np.pi), MICRO * height, "o", color=INK, ms=5, mfc="none", label="time integration")
        folds = [response.branch.omega[i] for response in responses.values() for i in resonance(response)[:2]]
        axes.set_xlim(0.9 * min(folds) / (2 * np.pi), 1.1 * max(folds) / (2 * np.pi))
        axes.set(yscale="log", xlabel="frequency / Hz", ylabel="amplitude of the lower corner / µm")
        axes.set_title("Harmonics of the leaf seal's main resonance (dotted: unstable)")
        axes.legend(fontsize=9)
    return figure


def run(folder: Path, as_json: bool = False) -> None:
    """Print the table, or JSON for machines, and draw the curves into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "harmonics.png"
    with threadpool_limits(1):
        responses = {top: with_harmonics(top) for top in HARMONICS}
        finest = responses[HARMONICS[-1]]
        first, second, _ = resonance(finest)
        upper, lower = edge(finest, first, high=False), edge(finest, second, high=True)
        rows = errors(responses, upper, lower)
        if not as_json:
            print(table(rows, upper, lower), flush=True)
        hill = responses[HILL]
        folds = [hill.branch.omega[i] for i in resonance(hill)[:2]]
        omega, solutions = coexisting(hill, min(folds), max(folds))
        marks = [(upper.omega, upper.amplitude), (lower.omega, lower.amplitude)]
        marks += [(omega, one.in_time) for one in solutions]
        figure_of(responses, marks).savefig(path)
    hertz = omega / (2 * np.pi)
    if as_json:
        edges = {"upper": upper, "lower": lower}
        in_time = {name: {"hz": one.omega / (2 * np.pi), "m": one.amplitude} for name, one in edges.items()}
        found = {"hz": hertz, "harmonics": HILL, "solutions": [asdict(one) for one in solutions]}
        print(json.dumps({"rows": rows, "in_time": in_time, "coexisting": found, "picture": str(path)}, indent=2))
        return
    print(f"solutions at {hertz:.2f} Hz with harmonics 0..{HILL}, amplitude of the lower corner:")
    for one in solutions:
        print(
            f"  {MICRO * one.amplitude:9.2f} um  {'stable' if one.stable else 'unstable':8} by Hill "
            f"(growth {one.growth:+7.2f} /s), after {one.periods} periods in time {MICRO * one.in_time:9.2f} um: "
            f"{'stays' if one.stays else 'leaves'}"
        )
    print(path)
