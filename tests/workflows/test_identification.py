"""Identification: known parameters are found again, and what the numbers do not determine is said, not hidden."""

import json

import numpy as np
import pytest

from tests.helpers.fits import fit_by_differences as fit
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber


def springs_in_a_row(values):
    """Frequencies of two unit masses between a wall and each other."""
    a, b = values["a"], values["b"]
    return np.sqrt(np.linalg.eigvalsh([[a + b, -b], [-b, b]]))


A, B = 40.0, 9.0
TRUE = springs_in_a_row({"a": A, "b": B})
PAIR = [FitParameter("a", 1.0, 1e3, (10.0,), "N/m"), FitParameter("b", 1.0, 1e3, (10.0, 100.0), "N/m")]


def numbers(values):
    return [MeasuredNumber(f"mode {i}", float(value), "rad/s") for i, value in enumerate(values)]


def test_known_parameters_are_found_from_exact_numbers():
    result = fit(PAIR, numbers(TRUE), springs_in_a_row)
    # a = 18, b = 20 has the same two frequencies: either may be found
    np.testing.assert_allclose(springs_in_a_row(result.named()), TRUE, rtol=1e-6)
    np.testing.assert_allclose(result.before, springs_in_a_row({"a": 10.0, "b": 10.0}))
    assert result.rms < 1e-6
    assert "as many numbers as parameters" in result.report()


def test_columns_of_long_names_do_not_run_together():
    long = "contacts.shroud_of_the_next_blade.tangential_stiffness"
    result = fit(
        [FitParameter(long, 1.0, 1e3, (10.0,))], [MeasuredNumber(long, 4.0, "N/um")], lambda v: np.array([v[long]])
    )
    rows = [line.split() for line in result.report().splitlines() if line.startswith(long)]
    assert [row[0] for row in rows] == [long, long]
    assert float(rows[0][1]) == 10.0
    assert [float(value) for value in rows[1][2:5]] == [4.0, 10.0, pytest.approx(4.0)]


def test_sensitivities_are_those_of_the_closed_form():
    result = fit(
        [FitParameter("k", 1.0, 1e3, (10.0,)), FitParameter("m", 0.1, 10.0, (3.0,))],
        [MeasuredNumber("omega", 4.0), MeasuredNumber("force", 48.0)],
        lambda v: np.array([np.sqrt(v["k"] / v["m"]), v["k"] * v["m"] ** 2]),
    )
    np.testing.assert_allclose(result.sensitivity, [[0.5, -0.5], [1.0, 2.0]], atol=1e-6)
    assert result.named() == pytest.approx({"k": 48 ** (1 / 3) * 16 ** (2 / 3), "m": (48 / 16) ** (1 / 3)}, rel=1e-6)


def test_standard_error_is_that_of_the_mean():
    """Scatter about one constant: the logarithm's standard error is s / sqrt(n)."""
    scatter = 0.05 * np.random.default_rng(2).standard_normal(40)
    result = fit(
        [FitParameter("level", 0.1, 10.0, (1.0,))], numbers(3.0 * np.exp(scatter)), lambda v: np.full(40, v["level"])
    )
    assert result.values[0] == pytest.approx(3.0 * np.exp(scatter.mean()), rel=1e-6)
    assert result.deviation[0] == pytest.approx(scatter.std(ddof=1) / np.sqrt(40), rel=1e-6)
    assert result.verdict(0).startswith("+- ")


def test_weights_pull_towards_the_number_that_counts_more():
    def level(weight):
        measured = [MeasuredNumber("low", 1.0), MeasuredNumber("high", 4.0, weight=weight)]
        return fit([FitParameter("x", 0.1, 10.0, (2.0,))], measured, lambda v: np.full(2, v["x"])).values[0]

    assert level(1.0) == pytest.approx(2.0, rel=1e-6)
    assert level(3.0) == pytest.approx(4 ** (9 / 10), rel=1e-6)


def test_bounds_hold_and_are_told():
    result = fit([FitParameter("x", 1.0, 3.0, (2.0,))], numbers([5.0, 5.0]), lambda v: np.full(2, v["x"]))
    assert result.values[0] == pytest.approx(3.0)
    assert result.values[0] <= 3.0
    assert result.verdict(0) == "at its upper bound"


def test_what_the_numbers_do_not_determine_is_said():
    """Only the product counts: both are open; a parameter without any influence is open too."""
    three = [FitParameter(name, 0.1, 10.0, (1.0,)) for name in ("p", "q", "idle")]
    result = fit(three, numbers([2.0, 2.1, 1.9]), lambda v: np.full(3, v["p"] * v["q"]))
    assert np.isinf(result.deviation).all()
    assert result.report().count("not determined by these numbers") == 3
    record = json.loads(json.dumps(result.record()))
    assert [p["deviation"] for p in record["parameters"]] == [None] * 3


def test_the_best_of_several_starts_is_kept():
    """Two valleys: the start in the wrong one does not decide, and "before" is the first start."""

    def folded(values):
        x = values["x"]
        return np.array([2.0 + (x - 1) ** 2 * (x - 4) ** 2 + 0.3 * (4 - x)])

    result = fit([FitParameter("x", 0.5, 5.0, (1.0, 4.5), ratio=False)], [MeasuredNumber("y", 1.9)], folded)
    assert result.values[0] == pytest.approx(4.0, abs=0.2)
    assert result.before[0] == pytest.approx(folded({"x": 1.0})[0])


@pytest.mark.parametrize(("bumps", "said"), [(0.0, False), (0.02, True), (0.05, False)])
def test_no_start_contradicts_another_where_the_sum_of_squares_is_bumpy(bumps, said):
    """Every start ends at an interval that holds the true number and the best fits from the others."""
    scatter = 0.01 * np.random.default_rng(1).standard_normal(12)

    def curve(values):
        x = values["x"]
        return x ** np.linspace(0.5, 1.0, 12) * (1 + bumps * np.sin(150 * x + np.arange(12)) ** 2)

    measured = numbers(curve({"x": 0.3}) * np.exp(scatter))
    results = [fit([FitParameter("x", 0.1, 0.9, (start,))], measured, curve) for start in (0.12, 0.29, 0.35, 0.85)]
    for result in results:
        for x in (0.3, *(other.values[0] for other in results)):
            assert abs(np.log(result.values[0] / x)) < 2.5 * result.deviation[0]
    assert ("bumpy" in results[0].report()) == said


@pytest.mark.parametrize(("call", "words"), [
    (lambda: FitParameter("k", 2.0, 1.0, (1.5,)), "bounds low < high"),
    (lambda: FitParameter("k", 1.0, 2.0, (3.0,)), "starts between them"),
    (lambda: FitParameter("k", 1.0, 2.0, ()), "starts between them"),
    (lambda: FitParameter("k", 0.0, 2.0, (1.0,)), "a ratio needs bounds above 0"),
    (lambda: fit(PAIR, numbers([1.0, 0.0]), springs_in_a_row), "measured numbers above 0"),
    (lambda: fit(PAIR, numbers([1.0, 2.0, 3.0]), springs_in_a_row), "instead of 3 numbers"),
    (lambda: fit(PAIR, numbers([1.0]), lambda v: np.array([-1.0])), "narrow the bounds"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(call, words):
    with pytest.raises(ValueError, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)
