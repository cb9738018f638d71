"""The response curve of a scene and what it may ask about it: harmonics, stability, wear."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm import continuation
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import curve_peaks, harmonic_choice
from tribodyn.hbm.continuation.branch import Branch, BranchPoint
from tribodyn.hbm.continuation.harmonic_choice import HarmonicChoice
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.result.number_format import measured, sparkline
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.progress import Advance
from tribodyn.workflows.scene.schema import Scene


def follow_response(
    scene: Scene, balance: HarmonicBalance, advance: Advance | None = None, folds: bool = True
) -> Branch:
    """The response curve of the unworn contact by the scene's continuation method, its highest peaks solved.

    folds : whether a curve on which a sweep jumps is followed round its folds, where its highest peak may be; not where
        the scene itself names a method that sweeps, such as `method = "natural"`"""
    method, options = continuation.load(scene.response.method_name), settings.response_options(scene)
    low, high = settings.response_range(scene)
    request = scene.response
    ends = (low, high) if request.sweep == "up" else (high, low)

    seen: list[tuple[float, float]] = []
    at = balance.compliance.output_names.index(settings.OUTPUT)

    def report(done: int, total: int, point: BranchPoint) -> None:
        assert advance is not None
        seen.append((point.omega, float(amplitude(point.response[at], balance.basis.harmonics))))
        hertz, height = measured(point.omega / (2 * np.pi), "Hz", 4), measured(seen[-1][1], "m")
        advance(done / total, f"{sparkline(*np.array(seen).T)} {hertz}, {height}", seen[-1])

    branch: Branch = method.follow(balance, *ends, options, report if advance else lambda *_: None)
    named = "method" in request.model_fields_set and request.method_name != "adaptive"
    as_swept = named or "sweep" in request.model_fields_set
    if folds and branch.ended is BranchEnd.JUMPED and not as_swept:
        rules = arc_length.ArcLengthRules(max_gaps=0)  # a curve with gaps does not lead from fold to fold
        round_folds = arc_length.Options(rules=rules, newton=settings.newton_options(scene))
        full_curve = arc_length.follow(balance, *ends, round_folds)
        if full_curve.arrived:
            branch = replace(
                full_curve, end=full_curve.end.kind.say(f"{full_curve.end.detail} by arc length: a sweep jumps")
            )
    return curve_peaks.with_peaks(balance, branch, settings.peak_of(scene))


def choose_harmonics(
    balance: HarmonicBalance,
    peak: AtPeak,
    options: harmonic_choice.ChoiceOptions,
    worn_at: Sequence[float] = (),
    n_choices: int = 3,
    same_peak: float = 1e-3,
    small_change: float = 0.1,
) -> HarmonicChoice | None:
    """Harmonics that make the response of every output right to the tolerance of the options where it matters.

    The harmonics chosen move the resonance: it is followed with them, or where they change much searched again, and
    they are chosen anew there. Without a peak they are chosen at the ends of its range and in the middle.
    peak : where the resonance is searched, with the harmonics of the balance at first; worn_at : other frequencies
        [rad/s]; n_choices : times that harmonics are chosen; same_peak : relative distance that counts as none
    small_change : of the response by the harmonics chosen, up to which another peak is not taken to be the highest
    Returns the last choice, None where no solution was found to choose by: the response says where and why"""
    choice, solved_x, places = None, dict[float, np.ndarray](), dict[float, np.ndarray]()
    for _ in range(n_choices):
        tracked = choice is not None and len(places) == 1 and choice.history[0][1] <= small_change
        try:
            point = peak.solve_near(balance, *next(iter(solved_x.items()))) if tracked else peak.solve(balance)
            places = {point.state.omega: point.state.x} if point.solution.converged else {}
        except (NoPeak, SolverFailure) as failure:
            places = failure.spread(balance) if isinstance(failure, NoPeak) else {}
        frequencies = [*(places or np.linspace(peak.start, peak.stop, 3).tolist()), *worn_at]
        if choice is not None and abs(frequencies[0] - choice.omega[0]) <= same_peak * frequencies[0]:
            break
        try:
            choice = harmonic_choice.choose(balance, frequencies, options, solved_x | places)
        except harmonic_choice.NotSolved:
            break
        if not places or choice.harmonics == balance.basis.harmonics:
            break
        balance, solved_x = choice.balance, dict(zip(choice.omega, choice.x, strict=True))
    return choice
