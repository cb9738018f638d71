"""Optimisation of designs: closed forms whose best trades are known, and the command on a scene that is linear."""

import json
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from scipy.stats import qmc

import tribodyn as td
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.studies.many import study_file
from tribodyn.workflows.studies.many.proposals import EvaluatedRuns, best_trades, promised, propose
from tribodyn.workflows.studies.many.run_task import numbers_of
from tribodyn.workflows.studies.many.study_table import StudyTable

LINEAR = {
    "scene": "beam", "design": "sobol", "runs": 3, "seed": 3,
    "set": ["geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=3", "wear=",
            "harmonics.kept=[0, 1]", "response.points=16", "response.frequency=['1700 Hz', '2600 Hz']",
            "contact.friction=50"],
}  # fmt: skip
FORCE, DAMPING = "loads.harmonic.shake.value", "damping.modal"


def searched(aims, excess, first, count, slopes=True, seed=0):
    """Runs of functions of the unit square, with their derivatives or without, until nothing is to be gained."""
    share = qmc.Sobol(2, seed=seed).random(8)[:first]

    def known():
        def both(s):
            return np.concatenate([aims(s), excess(s)], axis=1)

        by = np.stack([(both(share + h) - both(share - h)) / 8e-6 for h in 1e-6 * np.eye(2)], axis=2)
        m = aims(share).shape[1]
        return EvaluatedRuns(share, both(share)[:, :m], both(share)[:, m:], by if slopes else np.full(by.shape, np.nan))

    while len(share) < count:
        place, gain = propose(known(), lambda s: 4 * (s - 0.5), seed)
        if gain < 1e-3:
            break
        share = np.vstack([share, place])
    return known()


def test_best_trades_are_those_that_none_beats() -> None:
    aims = np.array([[1.0, 3.0], [2.0, 2.0], [3.0, 1.0], [3.0, 3.0], [0.0, 0.0], [2.0, 2.0]])
    allowed = np.array([True, True, True, True, False, True])
    assert best_trades(aims, allowed).tolist() == [0, 1, 5, 2]


def test_a_promise_is_the_improvement_expected() -> None:
    """Against quadrature of it; far below, where it is none, against its asymptotic form."""
    for value, deviation in ((1.0, 0.5), (0.2, 0.3), (-0.4, 0.1), (3.0, 0.5)):
        z = np.linspace(-12, 12, 200001)
        gained = np.maximum(0.3 - value - deviation * z, 0) * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
        result = promised(0.3, np.array([value]), np.array([deviation]))[0]
        assert result == pytest.approx(np.log(np.trapezoid(gained, z)), abs=1e-4)
    far = promised(0.0, np.array([1.0, 2.0]), np.array([1e-3, 1e-3]))
    assert far[0] - far[1] == pytest.approx(1.5e6, rel=1e-4)
    assert promised(np.inf, np.array([1.0, 2.0]), np.ones(2)).tolist() == [-1.0, -2.0]


@pytest.mark.parametrize("seed", range(4))
def test_the_search_goes_on_where_the_process_is_unsure(seed: int) -> None:
    """Branin's function has three lowest places of 0.398, and slopes that lead past them."""

    def branin(s):
        x, y = 15 * s[:, :1] - 5, 15 * s[:, 1:]
        bent = y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6
        return bent**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x) + 10

    result = searched(branin, lambda s: np.zeros((len(s), 0)), 3, 24, seed=seed)
    assert result.aims.min() < 0.41
    assert len(result.share) < 18


def test_two_aims_come_to_their_known_trade() -> None:
    """(2x)^2 + (y - 0.3)^2 against (2x - 1)^2 + (y - 0.3)^2: y = 0.3, x from 0 to 0.5, roots that sum to 1.

    Source  Schaffer 1985, with a second variable"""

    def aims(s):
        off = (s[:, 1] - 0.3) ** 2
        return np.stack([4 * s[:, 0] ** 2 + off, (2 * s[:, 0] - 1) ** 2 + off], axis=1)

    def dominated(rows):
        """Area between the best trades and (1.2, 1.2)."""
        f = rows[best_trades(rows, (rows < 1.2).all(axis=1))]
        return float(np.sum((np.append(f[1:, 0], 1.2) - f[:, 0]) * (1.2 - f[:, 1])))

    full = 1.2 * 1.2 - 1 / 6
    none = lambda s: np.zeros((len(s), 0))  # noqa: E731
    by_values, by_slopes = searched(aims, none, 8, 16, slopes=False), searched(aims, none, 3, 12)
    assert dominated(by_values.aims[:8]) < 0.75 * full
    assert 0.85 * full < dominated(by_values.aims) < full
    assert 0.9 * full < dominated(by_slopes.aims) < full
    assert np.sort(np.abs(by_slopes.share[3:, 1] - 0.3))[4] < 0.02


def test_a_limit_is_kept_and_failed_runs_are_not_followed() -> None:
    """Least x + y with x y at least 0.25, where x > 0.8 fails: 1 at (0.5, 0.5)."""

    def aims(s):
        return np.where(s[:, :1] > 0.8, np.nan, s.sum(axis=1, keepdims=True))

    for first, slopes, largest in ((8, False, 18), (4, True, 9)):
        result = searched(aims, lambda s: 0.25 - s.prod(axis=1, keepdims=True), first, 18, slopes)
        best = result.front[0]
        assert result.excess[best] <= 0
        assert result.aims[best, 0] == pytest.approx(1.0, abs=2e-3)
        np.testing.assert_allclose(result.share[best], 0.5, atol=0.05)
        assert len(result.share) <= largest


def test_few_runs_with_derivatives_of_one_aim_say_where_the_next_goes() -> None:
    """Of two aims the other is known by its values alone, which are the same."""
    share, slopes = np.array([[0.5, 0.5], [0.55, 0.5]]), np.full((2, 2, 2), np.nan)
    slopes[:, 0] = [1.0, -1.0]
    evaluated_runs = EvaluatedRuns(share, np.array([[0.0, 0.0], [0.2, 0.0]]), np.zeros((2, 0)), slopes)
    for seed in range(5):
        place, _ = propose(evaluated_runs, lambda s: 4 * (s - 0.5), seed)
        np.testing.assert_allclose(place, [0.0, 1.0], atol=1e-3)


def tables(**more):
    vary = {FORCE: {"distribution": "uniform", "low": "10 N", "high": "20 N"},
            DAMPING: {"distribution": "loguniform", "low": "0.5 %", "high": "2 %"}}  # fmt: skip
    aim = [{"number": "amplitude_first", "want": "low"}]
    return {"study": LINEAR, "vary": vary, "optimise": {"aims": aim, "evaluations": 10, **more}}


def test_the_linear_scene_comes_to_its_corner_and_resumes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Least amplitude of a linear structure: least force and most damping; the command and Python say the same."""
    file, folder = tmp_path / "corner.toml", tmp_path / "found"
    file.write_text(tomli_w.dumps(tables()), encoding="utf-8")
    cli.app(
        ["study", "optimise", str(file), "--workers", "1", "--out", str(folder), "--json"], result_action="return_value"
    )
    statement, rows = json.loads(capsys.readouterr().out), (folder / "rows.jsonl").read_text(encoding="utf-8")
    assert len(statement.pop("files")) == 2
    assert (folder / "optimum.png").stat().st_size > 5000
    optimum = td.studies.optimise(file, folder, workers=1)
    assert optimum.record() == statement == json.loads((folder / "optimum.json").read_text(encoding="utf-8"))
    assert (folder / "rows.jsonl").read_text(encoding="utf-8") == rows
    keys, amplitude = optimum.keys(optimum.best), optimum.values(optimum.best)["amplitude_first"]
    assert keys[FORCE] == pytest.approx(10.0, rel=1e-3)
    assert keys[DAMPING] == pytest.approx(0.02, rel=1e-3)
    assert amplitude == optimum.table.columns["amplitude_first"].min()
    assert len(optimum.table.columns["run"]) <= 6  # each with its derivatives


def test_a_response_that_is_highest_at_its_end_has_no_peak_to_win_with() -> None:
    lower = ["response.frequency=['300 Hz', '350 Hz']"]
    numbers = numbers_of(td.run("beam", overrides=[*LINEAR["set"], "verdict.enabled=false", *lower]))
    assert numbers["peak_at_end"] == 1.0
    assert not {"peak_frequency_first", "amplitude_first", "amplitude_last"} & set(numbers)


def test_a_contact_that_survives_lives_longest() -> None:
    """So does one that never slips, of which no cycle is known; a run that was stopped counts by its cycles."""
    columns = {
        "run": np.arange(1, 5), "status": np.array(["complete"] * 4, dtype=object),
        "life": np.array([5e6, np.nan, np.nan, np.nan]), "cycles": np.array([6e6, 2e6, 3e6, 0.0]),
        "survives": np.array([np.nan, 1.0, np.nan, 1.0]),
    }  # fmt: skip
    values, least = StudyTable("made up", columns, ()).values_of("life")
    assert values.tolist() == [5e6, 5e6, 3e6, 5e6]
    assert least.tolist() == [False, True, True, True]


def test_what_cannot_be_is_one_sentence(tmp_path: Path) -> None:
    def parsed(**changed):
        return study_file.parse({**tables(), **changed}, "s.toml", tmp_path)

    with pytest.raises(SceneError, match=r"optimise\.aims"):
        parsed(optimise={"aims": []})
    with pytest.raises(SceneError, match="needs low or high"):
        parsed(optimise={"limits": [{"number": "peak_frequency_first"}]})
    with pytest.raises(SceneError, match="give a key that does not vary"):
        parsed(study={**LINEAR, "same": {"contact.friction": "nothing"}})
    normal = {"distribution": "normal", "mean": "15 N", "cov": "10 %"}
    with pytest.raises(SceneError, match="needs a range, give low and high"):
        td.studies.optimise({**tables(), "vary": {FORCE: normal}}, tmp_path)
    with pytest.raises(SceneError, match='begins with runs that are drawn, give design = "sobol"'):
        td.studies.optimise({"study": {"scene": "beam", "design": "grid"}, "vary": {FORCE: ["10 N"]}}, tmp_path)
