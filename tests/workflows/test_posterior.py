"""Posteriors of numbers of a scene: against a closed form, and a planted truth is found in its credible interval."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.command import leave
from tests.helpers.fits import predict
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.fits import posterior, posterior_sampling
from tribodyn.workflows.studies.fits.fit_file import Target
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber
from tribodyn.workflows.studies.many.distributions import Distribution, Marginal

pytest.importorskip("emcee")

SLOPES = np.array([[1.0, 0.5], [-0.4, 1.5], [0.8, 0.8]])  # d ln(number) / d ln(parameter)
ERRORS = np.array([0.05, 0.08, 0.05])
BOX = (FitParameter("a", 0.5, 2.0, (1.0,)), FitParameter("b", 0.5, 2.0, (1.0,)))
TRUE = np.log([1.1, 0.9])


def linear(values: Mapping[str, float]) -> np.ndarray:
    """Three measured numbers and one that follows, linear in the logarithms."""
    z = np.log([values["a"], values["b"]])
    return np.exp(np.append(SLOPES @ z, 2 * z[0] - z[1]))


def measured(noise: np.ndarray) -> list[MeasuredNumber]:
    values = np.exp(SLOPES @ TRUE + noise)
    return [
        MeasuredNumber(f"m{i}", float(v), error=float(e)) for i, (v, e) in enumerate(zip(values, ERRORS, strict=True))
    ]


def test_a_linear_problem_has_its_normal_posterior() -> None:
    noise = np.array([0.03, -0.05, 0.02])
    computed = posterior.sample(BOX, measured(noise), linear, {"follows": "N"})
    weights = SLOPES / ERRORS[:, None]
    covariance = np.linalg.inv(weights.T @ weights)
    mean = covariance @ weights.T @ ((SLOPES @ TRUE + noise) / ERRORS)
    samples = np.log(computed.samples)
    assert samples.mean(axis=0) == pytest.approx(mean, abs=0.1 * covariance[0, 0] ** 0.5)
    assert np.cov(samples.T) == pytest.approx(covariance, rel=0.15, abs=0.05 * covariance[0, 0])
    slope = np.array([2.0, -1.0])
    follows = np.log(computed.predicted["follows"])
    assert follows.mean() == pytest.approx(slope @ mean, abs=0.1 * follows.std())
    assert follows.std() == pytest.approx(np.sqrt(slope @ covariance @ slope), rel=0.1)
    assert computed.doubts == []
    assert computed.plot().axes


def test_a_prior_counts_and_what_is_not_told_is_said() -> None:
    only_a = [MeasuredNumber("m", 1.2, error=0.1)]
    prior = {"a": Marginal.of(Distribution(distribution="lognormal", median=1.0, cov="10 %"))}
    computed = posterior.sample(BOX, only_a, lambda values: np.array([values["a"]]), priors=prior)
    width = np.sqrt(np.log1p(0.01))
    share = width**2 / (width**2 + 0.01)
    assert np.log(computed.samples[:, 0]).mean() == pytest.approx(share * np.log(1.2), abs=0.01)
    assert np.log(computed.samples[:, 0]).std() == pytest.approx(np.sqrt(share) * 0.1, rel=0.1)
    assert any(doubt.startswith("b: the numbers say little") for doubt in computed.doubts)


def test_trials_that_fail_are_left_out_and_too_many_end_it() -> None:
    def fails_above(limit: float) -> posterior_sampling.Trial:
        def trial(values: Mapping[str, float]) -> np.ndarray:
            if values["a"] > limit:
                raise SolveFailed("no peak")
            return linear(values)[:3]

        return trial

    computed = posterior.sample(BOX, measured(np.zeros(3)), fails_above(1.6))
    assert computed.failed > 0
    assert np.median(computed.samples[:, 0]) == pytest.approx(1.1, rel=0.05)
    with pytest.raises(SolveFailed, match="narrow the bounds; the last: no peak"):
        posterior.sample(BOX, measured(np.zeros(3)), fails_above(0.7))
    with pytest.raises(ValueError, match=r"measured.m.error: a posterior needs the error"):
        posterior.sample(BOX, [MeasuredNumber("m", 1.0)], linear)


BEAM = (
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=4",
    "harmonics.samples=32", "harmonics.transitions=sampled", "response.points=10", "wear.tolerance=30 %",
    "wear.at=peak", "wear.motion=machine",
)  # fmt: skip
TRUTH = ("contact.tangential_stiffness=300e6", "contact.friction=0.42")
ASKED = {
    "mode": {"of": "stuck frequency", "mode": 1},
    "energy": {"of": "energy", "at": "700 Hz", "load": 2.0},
}
AHEAD = {"amplitude": {"of": "amplitude", "at": "700 Hz", "load": 1.5}}


def test_a_planted_truth_of_a_scene_is_in_its_interval(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    two_results = {name: Target.model_validate(table) for name, table in (ASKED | AHEAD).items()}
    truth = predict(scene_file.read("beam", (*BEAM, *TRUTH)), two_results)
    off = (1 + 0.004, 1 - 0.03)  # what was measured misses the truth by some of its errors
    task = {
        "parameters": {
            "k_t": {"keys": ["contact.tangential_stiffness"], "low": "150 N/um", "high": "600 N/um"},
            "mu": {"keys": ["contact.friction"], "low": 0.2, "high": 0.7, "ratio": False},
        },
        "measured": {
            name: {**table, "value": float(value * factor), "error": error}
            for (name, table), value, factor, error in zip(ASKED.items(), truth, off, ("0.5 %", "5 %"), strict=False)
        },
        "predict": AHEAD,
    }
    result = td.studies.posterior("beam", task, trials=48, overrides=list(BEAM))
    for summary, value in zip(result.summaries(), (300e6, 0.42, truth[2]), strict=True):
        assert summary.low < value < summary.high, summary.name
    assert result.doubts == []
    # the file says the same by the command
    lines = ["[parameters.mu]", 'keys = ["contact.friction"]', "low = 0.2", "high = 0.7", "[measured.energy]"]
    lines += ['of = "energy"', 'at = "700 Hz"', "load = 2.0", f"value = {float(truth[1])}"]
    (tmp_path / "fit.toml").write_text("\n".join(lines))
    words = ["study", "posterior", "beam", str(tmp_path / "fit.toml"), "--trials", "8"]
    words += [word for text in (*BEAM, TRUTH[0]) for word in ("--set", text)]
    code, _, error = leave(words, capsys)
    assert code == 2
    assert "measured.energy.error: a posterior needs the error" in error
    (tmp_path / "fit.toml").write_text("\n".join([*lines, 'error = "2 %"']))
    code, out, _ = leave([*words, "--json"], capsys)
    assert code == 0
    message = json.loads(out)["summaries"][0]
    assert message["low"] < 0.42 < message["high"]
