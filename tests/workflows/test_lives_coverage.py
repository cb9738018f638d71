"""How often the ends that lives are told with hold the truth: on a scene with five hundred runs as population."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tribodyn.workflows.studies.many import quantiles, study_file
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.quantiles import Sample
from tribodyn.workflows.studies.many.surrogate import Surrogate

CHEAP = (
    "geometry.n_patch=3", "contact.vertices_only=true", "geometry.n_length=3", "geometry.n_height=1",
    "reduction.modes=4", "response.points=10", 'response.frequency=["650 Hz", "750 Hz"]', "wear.rule=thesis",
    "wear.step=30 %", "wear.at=700 Hz", "solver.tolerance=1e-4",
)  # fmt: skip
LIVES = {  # of four pairs of the beam; most end below 2.5e8 or above 4e8 cycles, few between
    "study": {"scene": "beam_thesis", "design": "latin_hypercube", "runs": 500, "seed": 77, "set": list(CHEAP)},
    "vary": {
        "contact.friction": {"distribution": "normal", "mean": 0.5, "cov": "10 %", "low": 0.3, "high": 0.7},
        "contact.tangential_stiffness": {
            "distribution": "lognormal", "median": "470 N/um", "cov": "20 %", "low": "215 N/um", "high": "1030 N/um",
        },
        "loads.static.press.value": {
            "distribution": "normal", "mean": "20 kN", "cov": "5 %", "low": "16 kN", "high": "24 kN",
        },
        "loads.harmonic.shake.value": {
            "distribution": "normal", "mean": "10 kN", "cov": "5 %", "low": "8 kN", "high": "12 kN",
        },
        "wear.coefficient": {
            "distribution": "lognormal", "median": "2e3 um3/J", "cov": "30 %",
            "low": "600 um3/J", "high": "6.6e3 um3/J",
        },
    },
}  # fmt: skip
SHARES, CONFIDENCE, RUNS, SETS = (0.1, 0.5, 0.9), 0.9, 64, 20


@pytest.fixture(scope="module")
def population(tmp_path_factory: pytest.TempPathFactory) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and logarithms of the lives of five hundred runs."""
    lives = td.studies.grid(LIVES, tmp_path_factory.mktemp("population")).columns
    values = np.asarray(lives["life"], float)
    has = np.isfinite(values)
    space = ParameterSpace.of(study_file.parse(LIVES, "population.toml", Path()))
    return space.coordinates(space.points_of(lives))[has], np.log(values[has])


def sampled(points: np.ndarray, surrogate: Surrogate) -> Sample:
    mean, deviation = surrogate.mean_and_deviation(points)
    o = np.argsort(mean)
    return Sample(points[o], points[o], np.full(len(o), 1 / len(o)), mean[o], deviation[o])


@pytest.mark.slow
def test_ends_of_the_beams_lives_hold_as_often_as_they_say(population: tuple[np.ndarray, np.ndarray]) -> None:
    points, lives = population
    draw, fixed = np.random.default_rng(5), {share: 0 for share in SHARES}
    for _ in range(SETS):
        base = draw.choice(len(lives), RUNS, replace=False)
        surrogate = Surrogate.fitted(points[base], lives[base])
        sample = sampled(points, surrogate)
        for share in SHARES:
            by_surrogate = np.quantile(quantiles.drawn(sample, surrogate, share), [0.05, 0.95])
            by_count = quantiles.counted(
                sample, surrogate.values[:, None], surrogate.left_out[:, None], share, CONFIDENCE
            )
            low, high = min(by_surrogate[0], by_count[0]), max(by_surrogate[1], by_count[1])
            fixed[share] += bool(low <= np.quantile(lives, share) <= high)
    print({f"P{100 * share:g}": f"{count} of {SETS}" for share, count in fixed.items()})
    assert min(fixed.values()) >= 0.8 * SETS


@pytest.mark.slow
def test_added_runs_tell_p10_within_five_percent(population: tuple[np.ndarray, np.ndarray]) -> None:
    points, lives = population
    truth, draw, fixed, errors, runs = np.quantile(lives, 0.1), np.random.default_rng(6), 0, [], []
    for _ in range(SETS):
        items = list(draw.choice(len(lives), RUNS, replace=False))
        while True:
            surrogate = Surrogate.fitted(points[items], lives[items])
            draws = quantiles.drawn(sampled(points, surrogate), surrogate, 0.1)
            low, high = np.quantile(draws, [0.05, 0.95])
            if (len(items) > RUNS and high - low <= 2 * np.log1p(0.05)) or len(items) >= 200:
                break
            remaining = np.setdiff1d(np.arange(len(lives)), items)
            extra = quantiles.next_runs(sampled(points[remaining], surrogate), surrogate, 0.1, 8)
            items += [int(remaining[np.argmin(((points[remaining] - point) ** 2).sum(1))]) for point in extra]
        fixed += bool(low <= truth <= high)
        errors.append(np.median(draws) - truth)
        runs.append(len(items))
    off = np.sqrt(np.mean(np.square(errors)))
    print(f"held in {fixed} of {SETS}, off by {off:.3f} r.m.s., {min(runs)} to {max(runs)} runs")
    assert fixed >= 0.8 * SETS
    assert max(runs) < 200
