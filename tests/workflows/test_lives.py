"""Lives as distributions: against closed forms, in their confidence, and by the command on a scene."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import stats
from scipy.stats import qmc

import tribodyn as td
from tests.helpers.command import printed_text
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.many import pool, quantiles, study_file, study_pictures
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.quantiles import Sample, influences
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun, slope_column, solve
from tribodyn.workflows.studies.many.surrogate import Surrogate, covariance

PRESS, FRICTION, DAMPING = "loads.static.press.value", "contact.friction", "damping.modal"
VARY = {
    FRICTION: {"distribution": "lognormal", "median": 0.5, "cov": "10 %"},
    PRESS: {"distribution": "lognormal", "median": "20 kN", "cov": "5 %"},
    DAMPING: {"distribution": "lognormal", "median": 0.01, "cov": "20 %"},
}
POWERS = {FRICTION: -2.0, PRESS: -3.0, DAMPING: 0.5}
MEDIAN = 1e8


@pytest.fixture(autouse=True)
def _no_pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """They take longer than all the rest."""
    if "command" not in request.node.name:
        monkeypatch.setattr(study_pictures, "shown", lambda result: ())
        monkeypatch.setattr(td.studies.LifeDistribution, "plot", lambda self: Figure())


def study(vary: dict[str, Any] = VARY, runs: int = 32, seed: int = 3, **overrides: Any) -> dict[str, Any]:
    return {"study": {"scene": "beam", "design": "sobol", "runs": runs, "seed": seed}, "vary": vary, **overrides}


def space(tables: dict[str, Any]) -> ParameterSpace:
    return ParameterSpace.of(study_file.parse(tables, "mine.toml", Path()))


def width(key: str) -> float:
    """Standard deviation of the logarithm of a key, times its power."""
    cov = float(str(VARY[key]["cov"]).removesuffix(" %")) / 100
    return abs(POWERS[key]) * math.sqrt(math.log1p(cov**2))


SCATTER = math.sqrt(sum(width(key) ** 2 for key in VARY))


def exact(share: float) -> float:
    return MEDIAN * math.exp(SCATTER * stats.norm.ppf(share))


def lasts(values: dict[str, float]) -> float:
    medians = {FRICTION: 0.5, PRESS: 20e3, DAMPING: 0.01}
    return MEDIAN * math.prod((values[key] / medians[key]) ** power for key, power in POWERS.items())


def engine(life: Callable[[dict[str, float], StudyRun], dict[str, float] | None], keys: Iterable[str] = VARY) -> Any:
    """In place of the processes: rows with a closed-form life."""

    def finished(tasks: Sequence[StudyRun], workers: int, solve: Any) -> Iterator[RunRow]:
        for task in tasks:
            message = dict(text.split("=", 1) for text in task.overrides)
            numbers = life({key: float(message[key]) for key in keys}, task)
            done = numbers is not None
            yield RunRow(task.number, task.key, "complete" if done else "failed", "told", numbers or {})

    return finished


def planted(seed: int) -> tuple[ParameterSpace, Callable[[np.ndarray], np.ndarray]]:
    """A problem of four lognormal variables with powers, curvature and a wave."""
    draw = np.random.default_rng(seed)
    vary = {
        f"k.{i}": {"distribution": "lognormal", "median": 1.0, "cov": float(draw.uniform(0.05, 0.3))} for i in range(4)
    }
    power, curve = draw.uniform(-3, 3, 4), draw.uniform(-5, 5, 4)

    def log_life(x: np.ndarray) -> np.ndarray:
        z = np.log(x)
        return np.asarray(17 + z @ power + z**2 @ curve + 0.5 * np.sin(6 * z[:, 0] + 2 * z[:, 1]))

    return space(study(vary, seed=seed)), log_life


@pytest.mark.parametrize(("problems", "share"), [(4, 0.5), pytest.param(50, 0.8, marks=pytest.mark.slow)])
def test_the_claimed_confidence_is_kept_on_planted_problems(problems: int, share: float) -> None:
    """Share of problems whose P10 lies in its 90 % interval, and the largest error of its logarithm."""
    inside, errors = [], []
    for seed in range(problems):
        of, log_life = planted(seed)
        points = of.values(qmc.Sobol(4, seed=np.random.default_rng(seed)).random(64))
        surrogate = Surrogate.fitted(of.coordinates(points), log_life(points))
        sample = Sample.of(of, surrogate)
        large, _ = of.draw(17, seed=99)
        truth = float(np.quantile(log_life(large), 0.1))
        low, high = np.quantile(quantiles.drawn(sample, surrogate, 0.1), [0.05, 0.95])
        inside.append(low <= truth <= high)
        errors.append(abs(sample.quantile(0.1) - truth))
    assert np.mean(inside) >= share
    assert np.max(errors) < 0.05


def test_counting_holds_a_quantile_beside_a_jump_that_the_surrogate_smooths() -> None:
    inside = {"surrogate": 0, "counted": 0}
    for seed in range(8):
        of, log_life = planted(seed)

        def jumps(x: np.ndarray, smooth: Any = log_life) -> np.ndarray:
            return np.asarray(smooth(x) + 2.0 * (np.log(x) @ [1.0, 0.5, -0.7, 0.3] > 0))

        points = of.values(qmc.Sobol(4, seed=np.random.default_rng(seed)).random(64))
        surrogate = Surrogate.fitted(of.coordinates(points), jumps(points))
        sample = Sample.of(of, surrogate)
        truth = float(np.quantile(jumps(of.draw(15, seed=99)[0]), 0.5))
        low, high = np.quantile(quantiles.drawn(sample, surrogate, 0.5), [0.05, 0.95])
        inside["surrogate"] += low <= truth <= high
        low, high = quantiles.counted(sample, surrogate.values[:, None], surrogate.left_out[:, None], 0.5, 0.9)
        inside["counted"] += low <= truth <= high
    assert inside["counted"] >= 7 > inside["surrogate"]


def test_quantiles_and_indices_are_those_of_the_closed_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "finished", engine(lambda values, task: {"life": lasts(values)}))
    result = td.studies.lives(study(lives={"model_error": 0.1}), tmp_path)
    for q, name in zip(result.quantiles, ("P10", "P50", "P90"), strict=True):
        assert q.name == name
        assert q.value == pytest.approx(exact(q.share), rel=2e-3)
        assert q.low <= q.value <= q.high
        assert q.low_in_all == pytest.approx(0.91 * q.value, rel=0.01)  # the 5 % quantile of a factor in 0.9 .. 1.1
        assert q.high_in_all == pytest.approx(1.09 * q.value, rel=0.01)
        assert not q.at_least
    assert result.scatter == pytest.approx(SCATTER, rel=2e-3)
    assert [influence.key for influence in result.influences] == sorted(VARY, key=width, reverse=True)
    for influence in result.influences:
        assert influence.first == pytest.approx((width(influence.key) / SCATTER) ** 2, abs=0.01)
        assert influence.total == pytest.approx(influence.first, abs=0.01)
    record = json.loads((tmp_path / "lives.json").read_text())
    assert record["quantiles"][0]["value"] == result.quantiles[0].value


def test_runs_are_added_for_a_rare_life_and_taken_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    requested: list[int] = []

    def life(values: dict[str, float], task: StudyRun) -> dict[str, float]:
        requested.append(task.number)
        full = lasts(values)
        return {"life": full * math.exp(0.2 * math.sin(6 * math.log(full / MEDIAN)))}

    monkeypatch.setattr(pool, "finished", engine(life))
    tables = study(runs=16, lives={"model_error": 0, "within": "4 %", "most": 48})
    result = td.studies.lives(tables, tmp_path, rare=1e-4)
    rare = exact(1e-4)
    truth = rare * math.exp(0.2 * math.sin(6 * math.log(rare / MEDIAN)))
    assert result.quantiles[0].share == 1e-4
    assert result.quantiles[0].value == pytest.approx(truth, rel=0.05)
    assert result.quantiles[0].low <= truth * 1.02
    assert result.quantiles[0].high >= truth * 0.98
    assert 16 < result.runs <= 48
    count = len(requested)
    assert count == result.runs
    repeated = td.studies.lives(tables, tmp_path, rare=1e-4)
    assert len(requested) == count
    assert repeated.quantiles[0] == result.quantiles[0]


def test_what_scales_a_life_is_found_by_two_runs_and_needs_no_others(tmp_path, monkeypatch):
    """A life that jumps with friction and damping alone, times powers of loads and wear coefficient."""
    shake, wear = "loads.harmonic.shake.value", "wear.coefficient"
    vary = VARY | {
        shake: {"distribution": "normal", "mean": "10 kN", "cov": "5 %"},
        wear: {"distribution": "lognormal", "median": "2e3 um3/J", "cov": "30 %"},
    }

    def life(x: dict[str, float], powers: tuple[float, float]) -> float:
        ratio = math.log(x[shake] / x[PRESS] * 2)
        jump = 1.5 * (math.log(x[FRICTION] / 0.5) - ratio > 0.05)
        full = MEDIAN * math.exp(jump - 3 * ratio) * (2e-15 / x[wear]) ** powers[0]
        return full * (20e3 / x[PRESS]) ** powers[1]

    of = space(study(vary))
    tables = study(vary, runs=45, lives={"model_error": 0})
    for powers, scaled in (((1.0, 1.0), 2), ((1.0, 1.2), 1)):
        given = engine(lambda x, task, powers=powers: {"life": life(x, powers)}, vary)
        monkeypatch.setattr(pool, "finished", given)
        result = td.studies.lives(tables, tmp_path / str(scaled))
        assert len(result.scaled) == scaled
        assert result.runs == 48
        if scaled == 2:
            assert result.scaled == ((wear,), (PRESS, shake))
            truth = float(np.quantile([life(of.run_of(x), powers) for x in of.draw(14, seed=99)[0]], 0.1))
            assert result.quantiles[0].value == pytest.approx(truth, rel=0.05)


def test_missing_runs_widen_what_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def life(values: dict[str, float], task: StudyRun) -> dict[str, float] | None:
        return None if task.number % 16 == 0 else {"life": lasts(values)}

    monkeypatch.setattr(pool, "finished", engine(life))
    result = td.studies.lives(study(lives={"model_error": 0}), tmp_path)
    assert result.missing == 2
    ten = result.quantiles[0]
    lost = 2 / 32
    assert ten.low == pytest.approx(exact((0.1 - lost) / (1 - lost)), rel=0.02)
    assert ten.high == pytest.approx(exact(0.1 / (1 - lost)), rel=0.02)


def test_lives_that_did_not_end_are_lower_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit = 1.2 * MEDIAN

    def life(values: dict[str, float], task: StudyRun) -> dict[str, float]:
        base = lasts(values)
        return {"cycles": limit} if base > limit else {"cycles": base, "life": base}

    monkeypatch.setattr(pool, "finished", engine(life))
    result = td.studies.lives(study(runs=64, lives={"model_error": 0}), tmp_path)
    assert [q.at_least for q in result.quantiles] == [False, False, True]
    assert result.quantiles[0].value == pytest.approx(exact(0.1), rel=0.05)
    assert "at least" in result.lines()[-len(VARY) - 2]
    small = td.studies.lives(study(runs=64, lives={"model_error": 0, "shares": [0.8]}), tmp_path / "few")
    assert small.quantiles[0].at_least  # below the lowest bound, but as many as that may survive


def test_indices_of_correlated_variables_are_those_of_a_linear_function() -> None:
    vary = {key: {"distribution": "normal", "mean": 0, "std": 1} for key in ("a", "b")}
    of = space(study(vary, correlations=[{"keys": ["a", "b"], "value": 0.6}]))
    result = {influence.key: influence for influence in influences(of, lambda z: 2 * z[:, 0] + z[:, 1])}
    variance = 4 + 1 + 2 * 2 * 0.6
    assert result["a"].first == pytest.approx((2 + 0.6) ** 2 / variance, abs=0.01)  # E[y | a] = (2 + 0.6) a
    assert result["b"].first == pytest.approx((1 + 2 * 0.6) ** 2 / variance, abs=0.01)
    assert result["a"].total == pytest.approx(4 * (1 - 0.36) / variance, abs=0.01)
    assert result["b"].total == pytest.approx((1 - 0.36) / variance, abs=0.01)


def test_a_surrogate_says_how_far_it_is_off_where_runs_are_left_out() -> None:
    of, log_life = planted(1)
    points = of.draw(5)[0]
    coordinates, values = of.coordinates(points), log_life(points)
    slopes = np.full(coordinates.shape, np.nan)
    slopes[::3, 1] = 0.3  # of some runs, by one coordinate
    for inputs in (None, slopes):
        level = Surrogate.fitted(coordinates, values, inputs)
        missed = []
        for i in range(len(values)):
            remainder = np.arange(len(values)) != i
            remaining = replace(
                level, points=coordinates[remainder], values=values[remainder], slopes=level.slopes[remainder]
            )
            missed.append(values[i] - remaining.mean(coordinates[[i]])[0])
        np.testing.assert_allclose(values - level.left_out, missed, atol=1e-6)


def test_covariances_of_derivatives_are_derivatives_of_covariances() -> None:
    draw = np.random.default_rng(0)
    a, b, log, h = (
        draw.standard_normal((4, 2)), draw.standard_normal((3, 2)), np.array([0.3, -1.0, -9, 0.2, -0.4]), 1e-5,
    )  # fmt: skip

    def of(a: np.ndarray, i: int, b: np.ndarray, j: int) -> np.ndarray:
        return covariance(log, a, np.full(4, i), b, np.full(3, j))

    for i in range(2):
        step = h * np.eye(2)[i]
        for j in (-1, 0, 1):
            by_a, by_b = (
                of(a + step, -1, b, j) - of(a - step, -1, b, j),
                of(a, j, b + step, -1) - of(a, j, b - step, -1),
            )
            np.testing.assert_allclose(of(a, i, b, j), by_a / (2 * h), atol=1e-8)
            np.testing.assert_allclose(of(a, j, b, i), by_b / (2 * h), atol=1e-8)


def test_runs_with_derivatives_say_as_much_as_three_times_as_many() -> None:
    of, log_life = planted(2)
    large = of.draw(10, seed=9)[0]

    def error(runs: int, slopes: bool) -> float:
        points = of.coordinates(of.draw(6)[0][:runs])
        back = lambda c: of.values(stats.norm.cdf(c))  # noqa: E731
        step = 1e-6 * np.eye(4)
        by = np.stack([(log_life(back(points + s)) - log_life(back(points - s))) / 2e-6 for s in step], axis=1)
        lives = Surrogate.fitted(points, log_life(back(points)), by if slopes else None)
        return float(np.std(lives.mean(of.coordinates(large)) - log_life(large)))

    assert error(16, True) < error(48, False)


@pytest.mark.parametrize(("change", "sentence"), [
    ({"lives": {"number": "lifes"}}, 'has no number "lifes": there are life'),
    ({"lives": {"shares": [1.5]}}, "lives.shares"),
    ({"vary": VARY | {"damping.modal": [0.01, 0.02]}}, "vary.damping.modal: expected a distribution"),
    ({"study": {"scene": "beam", "design": "list"}, "vary": {FRICTION: [0.5]}}, "lives are drawn"),
])  # fmt: skip
def test_what_cannot_be_is_refused(change, sentence, tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "finished", engine(lambda values, task: {"life": 1e6}))
    with pytest.raises(ValueError, match=sentence):
        td.studies.lives(study() | change, tmp_path)


def test_the_command_tells_the_verdict_with_the_distribution(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pool, "finished", lambda tasks, workers, solve: map(solve, tasks))
    file = tmp_path / "mine.toml"
    file.write_text(
        '[study]\nscene = "beam"\ndesign = "sobol"\nruns = 8\nset = ["harmonics.kept=[0, 1]", "geometry.n_patch=3", '
        '"geometry.n_length=3", '
        '"geometry.n_height=1", "reduction.modes=4", "response.points=12", "wear=", '
        "\"response.frequency=['500 Hz', '2000 Hz']\"]\n"
        f'[vary]\n{FRICTION} = {{ distribution = "uniform", low = 0.4, high = 0.6 }}\n'
        '[lives]\nnumber = "amplitude_first"\n'
    )
    out = printed_text(["study", "lives", str(file), "--out", str(tmp_path / "out")], capsys)
    assert "verdict on the run at the medians" in out
    assert (tmp_path / "out" / "lives.png").stat().st_size > 5000
    record = json.loads((tmp_path / "out" / "lives.json").read_text())
    assert record["model_error"] > 0
    first = record["quantiles"][0]
    assert first["low_in_all"] < first["low"] <= first["value"] <= first["high"] < first["high_in_all"]
    assert record["influences"][0]["first"] == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_a_life_by_controlled_errors_is_smooth_and_its_row_has_its_derivatives() -> None:
    """Lives of the coarse blade beside each other; by the thesis's steps of 30 % they scatter by a fifth."""
    cheap = (
        "geometry.n_along=3", "geometry.n_up=2", "geometry.n_span=4", "geometry.n_side=1", "geometry.n_root=1",
        "reduction.modes=4", "reduction.cutoff=", "harmonics.kept=[0, 1]", "response.points=10",
        'response.frequency=["290 Hz", "310 Hz"]', "wear.rule=error_controlled", "wear.tolerance=20 %",
        "wear.at=300 Hz", "verdict.enabled=false",
    )  # fmt: skip
    keys, lives = ("contact.friction", "wear.coefficient"), []
    for friction in (0.495, 0.5, 0.505):
        file = scene_file.read("blade", (*cheap, f"contact.friction={friction}"))
        row = solve(StudyRun(1, "blade", file.text, file.overrides, file.folder, keys if friction == 0.5 else ()))
        lives.append(row.numbers["life"])
        if friction == 0.5:
            by_friction, by_coefficient = (row.numbers[slope_column("life", key)] for key in keys)
    assert abs(np.diff(np.log(lives), 2)[0]) < 2e-3
    assert by_coefficient == pytest.approx(-lives[1] / file.scene.wear.numbers["coefficient"], rel=1e-9)
    assert by_friction == pytest.approx((lives[2] - lives[0]) / 0.01, rel=0.05)  # whose steps are not the same
