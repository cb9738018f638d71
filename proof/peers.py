"""Curves of this program beside those of pyHarm, on problems that both can state, one thread each.

A chain of masses, each with a Jenkins element of constant limit force to the ground, or one mass on a cubic spring:
pseudo arc length with the same harmonics, samples and tolerance. Steps of pyHarm are the longest with which it has at
least as many points. Every point of pyHarm is solved again here, from its own coefficients.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from tests.helpers.continuation_models import Duffing
from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import SolverFailure

SAMPLES, TOLERANCE = 128, 1e-8
LIMIT, SPRING, NORMAL = 0.1, 0.5, 5.0  # limit force, tangential and normal stiffness of a Jenkins element
STEPS, PATIENCE = (0.3, 0.2, 0.15, 0.1, 0.05), 60.0  # arc lengths of pyHarm, and seconds to try one


@dataclass(frozen=True)
class Race:
    """Least processor seconds of a curve in both programs, and how far solutions at the same frequencies differ."""

    problem: str
    harmonics: int
    points: int
    seconds: float
    their_points: int
    their_seconds: float
    difference: float

    @property
    def ratio(self) -> float:
        """Their time over ours."""
        return self.their_seconds / self.seconds


def chain(n: int, harmonics: int) -> tuple[HarmonicBalance, dict[str, Any]]:
    """n masses in a row, each pressed on a Jenkins element: here, and as pyHarm is told."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    damping, zero, rows = 0.01 * stiffness, np.zeros((n, n)), np.zeros((2 * n, 2 * n))
    rows[np.arange(0, 2 * n, 2), np.arange(n)] = rows[np.arange(1, 2 * n, 2), n + np.arange(n)] = 1.0
    loads = {"force": np.eye(2 * n)[0], "press": np.concatenate([np.zeros(n), np.ones(n)])}
    matrices = [np.block([[a, zero], [zero, np.eye(n)]]) for a in (np.eye(n), stiffness, damping)]
    system = SecondOrderSystem(*matrices, loads, {"first": np.eye(2 * n)[0]})
    parameters = ContactParameters.of(("t1", "n"), np.tile([SPRING, NORMAL], (n, 1)), friction=1.0)
    excitation = Excitation.of({"press": LIMIT * (1 + NORMAL) / NORMAL}, {1: {"force": 0.1}})
    basis = HarmonicBasis(tuple(range(harmonics + 1)), SAMPLES, "sampled")
    model = ReducedModel(system, interface(rows, ("t1", "n")))
    balance = HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 2.5)
    element = {"type": "Jenkins", "k": SPRING, "mu": 1.0, "N0": LIMIT}
    description = {"stiffness": stiffness.tolist(), "damping": damping.tolist(), "force": 0.1, "range": [0.05, 2.5]}
    return balance, {**description, "element": element, "harmonics": harmonics}


def duffing(harmonics: int) -> tuple[HarmonicBalance, dict[str, Any]]:
    """One mass on a cubic spring."""
    description = {"stiffness": [[1.0]], "damping": [[0.04]], "force": 0.3, "range": [0.5, 5.0], "harmonics": harmonics}
    balance = Duffing().balance(tuple(range(harmonics + 1)), SAMPLES)
    return balance, {**description, "element": {"type": "CubicSpring", "k": 1.0}}


def run(python: Path, say: Callable[[str], None]) -> list[Race]:
    """Both programs in turn; python : an interpreter with pyHarm."""
    rows = []
    for name, (balance, description) in {
        "Duffing oscillator": duffing(7),
        "one mass with friction": chain(1, 7),
        "three masses with friction": chain(3, 3),
        "five masses with friction": chain(5, 3),
    }.items():
        say(name)
        branch, seconds = _ours(balance, description["range"])
        theirs = _theirs(python, description, len(branch.omega))
        differs = max(_difference(balance, w, np.array(x)) for w, x in zip(theirs["omega"], theirs["x"], strict=True))
        points = len(theirs["omega"])
        rows.append(
            Race(name, description["harmonics"], len(branch.omega), seconds, points, theirs["seconds"], differs)
        )
    return rows


def _ours(balance: HarmonicBalance, over: list[float]) -> tuple[Branch, float]:
    seconds = []
    options = arc_length.Options(newton=newton.NewtonOptions(tolerance=TOLERANCE))
    for _ in range(5):
        fresh = balance.with_harmonics(balance.basis.harmonics)  # which keeps nothing of the curve before
        began = time.process_time()
        branch = arc_length.follow(fresh, over[0], over[1], options)
        seconds.append(time.process_time() - began)
    return branch, min(seconds)


def _theirs(python: Path, problem: dict[str, Any], points: int) -> dict[str, Any]:
    """Their curve with the longest steps that give as many points; raises RuntimeError with what they say."""
    single_thread = {
        name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    }

    def answer(step: float, repeat: int, seconds: float | None = None) -> dict[str, Any]:
        told_all = {**problem, "samples": SAMPLES, "tolerance": TOLERANCE, "step": step, "repeat": repeat}
        script = Path(__file__).with_name("peers_pyharm.py")
        done = subprocess.run(
            [python.absolute(), script.resolve()], input=json.dumps([told_all]), timeout=seconds, capture_output=True,
            text=True, env={**os.environ, **single_thread}, cwd=gettempdir(),  # where it writes a file of its own
        )  # fmt: skip
        if done.returncode:
            raise SolverFailure(f"pyHarm ended with: {done.stderr.strip().splitlines()[-1]}")
        answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])[0]
        return answer

    def enough(step: float) -> bool:
        try:
            return len(answer(step, 1, PATIENCE)["omega"]) >= points
        except subprocess.TimeoutExpired:  # it halves steps without an end
            return False

    return answer(next(filter(enough, STEPS), STEPS[-1]), 3)


def _difference(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Of their coefficients x (n_coeff, n) and the solution here that they lead to, over its largest."""
    guess = np.array(balance.stuck(omega))
    guess[:, 0] = x.T
    solution = newton.solve(balance, omega, guess, newton.NewtonOptions(tolerance=1e-12))
    ours = solution.state.x[:, 0]
    return float(np.abs(ours - x.T).max() / np.abs(ours).max())


def as_records(rows: list[Race]) -> list[dict[str, Any]]:
    """One object for each problem."""
    return [{**asdict(r), "ratio": r.ratio} for r in rows]


def as_text(rows: list[Race]) -> str:
    """The table."""
    head = "problem                     harmonics  points   seconds   points   seconds    ratio   differs by at most"
    lines = [
        f"{r.problem:28s} 0 to {r.harmonics} {r.points:8d} {r.seconds:9.3f} {r.their_points:8d} {r.their_seconds:9.3f}"
        f" {r.ratio:8.1f} {r.difference:10.1e}"
        for r in rows
    ]
    return "\n".join([f"{'':45s}tribodyn   {'':10s} pyHarm", head, *lines])
