"""Peaks of response curves against closed forms, from sharp resonances to folded ones."""

from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.helpers.continuation_models import Duffing, Lifting
from tests.helpers.verification_models import interface, modal_damping
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.curve_peaks import with_peaks
from tribodyn.hbm.continuation.methods import adaptive, arc_length, natural
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import BranchEnd, SolveEnd
from tribodyn.reduction.model import ReducedModel

RANGE = 1.0, 4.0


class StuckOscillator:
    """Two masses, the first on a contact that always sticks; `peak` : height and frequency by direct solution.

    static : load that pulls the contact open instead, for good"""

    def __init__(self, ratio: float, static: float = 0.0):
        mass, stiffness = np.eye(2), np.array([[3.0, -1.0], [-1.0, 4.0]])
        stuck = stiffness + np.diag([0.0 if static else 2.0, 0.0])
        damping, load, row = modal_damping(mass, stuck, ratio), np.array([1.0, 0.3]), np.array([0.2, 1.0])
        system = SecondOrderSystem(mass, stiffness, damping, {"force": load}, {"mass": row})
        joint = Joint("contact", "unilateral", ContactParameters.of(("n",), [[2.0]]))
        if not static:
            law = ContactParameters.of(("t1",), [[2.0]], friction=1e12, normal_load=3.0)
            joint = Joint("contact", "jenkins_constant", law)
        self.balance = HarmonicBalance.of(
            ReducedModel(system, interface(np.eye(2)[:1], joint.parameters.components)),
            joint,
            HarmonicBasis((0, 1), 64, "located"),
            Excitation.of({"force": static}, {1: {"force": 0.5}}),
            20.0,
        )

        def height(omega: float) -> float:
            dynamic = stuck - omega**2 * mass + 1j * omega * damping
            return float(abs(row @ np.linalg.solve(dynamic, 0.5 * load)))

        tops = []
        for mode in np.sqrt(np.linalg.eigvalsh(stuck)):
            best = minimize_scalar(
                lambda e, mode=mode: -height(mode * (1 + e * ratio)), bounds=(-5, 5), method="bounded",
                options={"xatol": 1e-9},
            )  # fmt: skip
            tops.append((-best.fun, mode * (1 + best.x * ratio)))
        self.peak = max(tops)


@pytest.mark.parametrize("ratio", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8])
def test_a_linear_resonance_has_its_height_at_any_damping(ratio: float) -> None:
    problem = StuckOscillator(ratio)
    branch = AtPeak("mass", *RANGE).solve(problem.balance)
    assert branch.solution.converged
    assert branch.amplitude == pytest.approx(problem.peak[0], rel=1e-4)
    assert branch.state.omega == pytest.approx(problem.peak[1], rel=0.05 * ratio + 1e-9)


def test_a_scan_that_ends_on_its_way_is_begun_at_the_other_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where no solution is found behind a fold."""
    problem, follow = StuckOscillator(1e-2), adaptive.follow
    lower = 0.9 * problem.peak[1]

    def ends(balance: HarmonicBalance, start: float, stop: float, options: adaptive.Options) -> Branch:
        if start > stop:
            return follow(balance, start, stop, options)
        return replace(follow(balance, start, lower, options), end=BranchEnd.ENDED.say(" here"))

    monkeypatch.setattr(adaptive, "follow", ends)
    point = AtPeak("mass", *RANGE).solve(problem.balance)
    assert point.solution.converged
    assert point.amplitude == pytest.approx(problem.peak[0], rel=1e-4)


@pytest.mark.parametrize("static", [0.0, -1e9])
@pytest.mark.parametrize("ratio", [5e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("points", [3, 10, 100])
def test_the_peak_of_a_sweep_depends_on_neither_its_points_nor_static_loads(ratio, points, static):
    problem = StuckOscillator(ratio, static)
    branch = natural.follow(problem.balance, *RANGE, natural.Options(n_points=points))
    solved = with_peaks(problem.balance, branch, AtPeak("mass", *RANGE))
    assert np.all(np.diff(solved.omega) > 0)
    assert solved.amplitude("mass").max() == pytest.approx(problem.peak[0], rel=1e-4)
    assert solved.peak("mass") == int(solved.amplitude("mass").argmax())


@pytest.mark.parametrize("failing", [(3,), (4,), (3, 4), range(2, 100)])
def test_a_peak_beside_solves_that_fail_is_found_or_told(failing, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where sliders come to rest: what is near enough then is the peak; without any solve there is none."""
    problem, solve, solves = StuckOscillator(1e-2), newton.solve, count(1)
    branch = natural.follow(problem.balance, *RANGE, natural.Options(n_points=10))

    def some(*arguments: Any) -> newton.Solution:
        result = solve(*arguments)
        return replace(result, outcome=SolveEnd.NO_DESCENT.say()) if next(solves) in failing else result

    monkeypatch.setattr(newton, "solve", some)
    solved = with_peaks(problem.balance, branch, AtPeak("mass", *RANGE))
    assert solved.converged.all()
    if 2 in failing:
        assert solved.peak("mass") is None
        assert "none was found beside the point at" in solved.no_peak("mass")
    else:
        assert solved.amplitude("mass")[solved.peak("mass")] == pytest.approx(problem.peak[0], rel=1e-4)
        assert solved.no_peak("mass") == ""


def test_a_search_that_ends_lower_than_its_point_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on the other side of a jump."""
    problem, within = StuckOscillator(1e-2), AtPeak.solve_between
    branch = natural.follow(problem.balance, *RANGE, natural.Options(n_points=60))

    for share, result in ((1e-6, True), (0.1, False)):

        def lower(site: AtPeak, balance: HarmonicBalance, omega: float, *arguments: Any, share: float = share) -> Any:
            height = branch.amplitude("mass")[np.abs(branch.omega - omega).argmin()]
            return replace(within(site, balance, omega, *arguments), amplitude=(1 - share) * height)

        monkeypatch.setattr(AtPeak, "solve_between", lower)
        solved = with_peaks(problem.balance, branch, AtPeak("mass", *RANGE))
        assert (solved.peak("mass") is not None) is result
        assert (solved.no_peak("mass") == "") is result
        np.testing.assert_array_equal(solved.omega, branch.omega)


@pytest.mark.parametrize("way", [(0.3, 4.5), (4.5, 0.3)])
@pytest.mark.parametrize("steps", [arc_length.Options(), arc_length.Options(step=0.3, max_step=0.6, angle=0.6)])
@pytest.mark.parametrize(("zeta", "force"), [(0.02, 0.1), (0.005, 0.1), (0.05, 0.05)])
def test_the_peak_of_a_folded_curve_has_its_closed_form(zeta, force, steps, way) -> None:
    """At the highest amplitude A of one harmonic omega^2 = k - 2 zeta^2, k = 1 + 3/4 g A^2."""
    duffing = Duffing(zeta, force)
    highest = brentq(lambda a: 4 * zeta**2 * (1 + 0.75 * a * a - zeta**2) - (force / a) ** 2, 1e-3, 1e3)
    branch = arc_length.follow(duffing.balance(), *way, steps)
    solved = with_peaks(duffing.balance(), branch, AtPeak("mass", *way))
    assert solved.amplitude("mass").max() == pytest.approx(highest, rel=2e-6)
    assert AtPeak("mass", *way).solve(duffing.balance()).amplitude == pytest.approx(highest, rel=2e-6)  # downwards, too
    before, after = branch.omega[list(branch.folds)], solved.omega[list(solved.folds)]
    np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize(
    ("method", "options"), [(natural, natural.Options(n_points=40)), (adaptive, adaptive.Options())]
)
@pytest.mark.parametrize("way", [(0.3, 3.0), (3.0, 0.3)])
def test_a_sweep_over_a_fold_ends_as_one_that_jumped(method, options, way) -> None:
    """Hardening and softening: the sweep misses a part of the curve either way, and the branch says so."""
    for balance in (Lifting().balance(), Duffing().balance()):
        assert method.follow(balance, *way, options).ended is BranchEnd.JUMPED
    assert method.follow(Duffing(0.05, 0.02).balance(), *way, options).ended is BranchEnd.REACHED
