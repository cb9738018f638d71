"""What harmonics buy on the leaf seal, beside time integration: ./tribodyn prove leaf accuracy.

The two folds of the main resonance are found in time too, by bisection: the highest frequency at which there is a low
periodic motion, and the lowest at which there is a high one. Where three solutions share a frequency, plain marches in
time are started at each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from proof.cases.leaf_seal.figures import MICRO, draw_curve
from proof.cases.leaf_seal.response import LINER_NODE, LeafResponse, respond
from proof.coexisting import Coexisting, coexisting
from tribodyn.hbm.stability.folds_in_time import FoldInTime, fold_in_time
from tribodyn.style import BLUE, GREEN, INK, ORANGE, RED, STYLE
from tribodyn.workflows.scene.source import read_scene

HARMONICS = (1, 3, 5, 9)
HILL = 5  # harmonics of the solutions whose stability is compared with time integration


def with_harmonics(top: int) -> LeafResponse:
    """The response of the scene with harmonics 0 to `top`."""
    return respond(read_scene("leaf_seal_thesis", (f"harmonics.kept={list(range(top + 1))}",)))


def resonance(response: LeafResponse) -> tuple[int, int, float]:
    """The folds at the upper and the lower end of the main resonance, and its peak amplitude [m]."""
    upper, lower = response.branch.folds[0], response.branch.folds[1]
    return upper, lower, float(response.branch.amplitude(LINER_NODE).max())


def errors(responses: dict[int, LeafResponse], upper: FoldInTime, lower: FoldInTime) -> list[dict[str, float]]:
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
                "upper_fold_error": folds[0] / upper.in_time - 1,
                "lower_fold_hz": folds[1] / (2 * np.pi),
                "lower_fold_error": folds[1] / lower.in_time - 1,
                "peak_m": peak,
                "peak_error": peak / lower.amplitude - 1,
                "seconds": response.seconds,
            }
        )
    return rows


def table(rows: Sequence[dict[str, float]], upper: FoldInTime, lower: FoldInTime) -> str:
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
    hertz, resolution = 2 * np.pi, upper.resolution
    lines.append(
        f"in time   {'':9}{upper.in_time / hertz:13.3f}   {'':10}{lower.in_time / hertz:15.3f}   {'':10}"
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


@dataclass(frozen=True)
class Accuracy:
    """What harmonics buy.

    rows : of `errors`; upper, lower : folds in time
    frequency : at which the solutions of HILL harmonics share it [Hz]; picture : its file
    """

    rows: list[dict[str, float]]
    upper: FoldInTime
    lower: FoldInTime
    frequency: float
    solutions: list[Coexisting]
    picture: Path

    def record(self) -> dict[str, object]:
        """For machines."""
        edges = {"upper": self.upper, "lower": self.lower}
        in_time = {
            name: {"hz": solution.in_time / (2 * np.pi), "m": solution.amplitude} for name, solution in edges.items()
        }
        solutions = [asdict(solution) for solution in self.solutions]
        table = {"hz": self.frequency, "harmonics": HILL, "solutions": solutions}
        return {"rows": self.rows, "in_time": in_time, "coexisting": table, "picture": str(self.picture)}

    def text(self) -> str:
        """For people."""
        lines = [table(self.rows, self.upper, self.lower)]
        lines.append(f"solutions at {self.frequency:.2f} Hz with harmonics 0..{HILL}, amplitude of the lower corner:")
        lines += [
            f"  {MICRO * s.amplitude:9.2f} um  {'stable' if s.stable else 'unstable':8} by Hill "
            f"(growth {s.growth:+7.2f} /s), after {s.periods} periods in time {MICRO * s.in_time:9.2f} um: "
            f"{'stays' if s.returns else 'leaves'}"
            for s in self.solutions
        ]
        return "\n".join([*lines, str(self.picture)])


def compute(folder: Path) -> Accuracy:
    """Curves with HARMONICS, folds and coexisting motions in time; draws the curves into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "harmonics.png"
    with threadpool_limits(1):
        responses = {top: with_harmonics(top) for top in HARMONICS}
        finest = responses[HARMONICS[-1]]
        upper, lower = (fold_in_time(finest.balance, finest.branch, fold, LINER_NODE) for fold in resonance(finest)[:2])
        rows = errors(responses, upper, lower)
        hill = responses[HILL]
        folds = [float(hill.branch.omega[i]) for i in resonance(hill)[:2]]
        omega, solutions = coexisting(hill.balance, hill.branch, min(folds), max(folds), LINER_NODE)
        marks = [(upper.in_time, upper.amplitude), (lower.in_time, lower.amplitude)]
        marks += [(omega, solution.in_time) for solution in solutions]
        figure_of(responses, marks).savefig(path)
    return Accuracy(rows, upper, lower, omega / (2 * np.pi), solutions, path)
