"""A quantity that nobody foresaw is one file: summary, JSON, text, report, errors, studies, exports, derivatives."""

import ast
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tribodyn.hbm import quantity
from tribodyn.workflows.errors.judgement import total_error
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.export import result_tables
from tribodyn.workflows.report import charts, page, text
from tribodyn.workflows.result.verdict import Refinement
from tribodyn.workflows.studies.many.run_task import numbers_of

NAME = "velocity"
FILE = '''"""Velocity amplitude of the observed output, to first order that of its first harmonic."""

from dataclasses import replace

from tribodyn.hbm.quantities import amplitude
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind


def value(cycle):
    return cycle.omega * cycle.amplitude


def slopes(cycle):
    by_amplitude = amplitude.slopes(cycle)
    return replace(by_amplitude, by_response=cycle.omega * by_amplitude.by_response, by_omega=cycle.amplitude)


QUANTITY = CycleQuantity("velocity amplitude", "m/s", value, error=ErrorKind.CYCLE, slopes=slopes, order=0.02)
'''
SMALL = (
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=4",
    "response.points=20", "harmonics.samples=64", "pictures.renders=false", "wear.tolerance=10 %", "wear.at=peak",
    "wear.motion=balance", "verdict.in_time=false", "wear.max_steps=1",
)  # fmt: skip
ALSO_KEYS = {"amplitude", "cycles", "damping", "depth", "energy", "phase", "preload", "volume"}
"""Words that are keys of a scene, fields of a mesh or columns of other tables too."""
MOST_LITERALS = 15  # lines of the package that name one of the others
MOST_IN_ROOMS = 6  # lines of the rooms that loop over answers that name any


@pytest.fixture(scope="module", autouse=True)
def new_file(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The file of the new quantity, in use for the tests of this module."""
    file = tmp_path_factory.mktemp("quantities") / f"{NAME}.py"
    file.write_text(FILE, encoding="utf-8")
    quantity.use(file)
    yield
    quantity.forget(file)


@pytest.fixture(scope="module")
def result(new_file: None) -> td.Result:
    return td.run("beam", overrides=SMALL)


def expected(result: td.Result) -> float:
    return float(result.wear.omega[0] * result.wear.amplitude[0])


def test_it_stands_in_the_summary_and_in_the_text(result: td.Result) -> None:
    summary = json.loads(json.dumps(result.summary()))
    assert summary[NAME]["first"] == pytest.approx(expected(result))
    assert summary["units"][NAME] == "m/s"
    assert any(f"{NAME} {1:.0f}"[:8] in line and "m/s" in line for line in text.brief(result))
    assert f"{NAME} / m/s" in dict(text.lines(result))


def test_its_error_is_measured(result: td.Result) -> None:
    statement = result.verdict.statements[NAME]
    assert statement.value == pytest.approx(expected(result), rel=1e-3)
    rows = [row for row in result.verdict.changes if row.quantity == NAME and row.relative is not None]
    assert {row.refinement for row in rows} >= {Refinement.MODES, Refinement.HARMONICS, Refinement.SAMPLES}
    error, _ = total_error(rows, result.verdict.ratio, replace(DEFAULT, order=0.02))
    assert statement.error == pytest.approx(error)


def test_it_stands_in_report_and_exports(result: td.Result) -> None:
    assert "Velocity amplitude" in charts.charts([("beam", result)])
    assert "velocity amplitude / m/s, first" in page._headlines(result)
    np.testing.assert_allclose(result_tables.wear(result, result.wear)[f"{NAME}_m/s"][0], expected(result))


def test_it_is_a_column_of_studies(result: td.Result) -> None:
    columns = numbers_of(result)
    assert columns[f"{NAME}_first"] == pytest.approx(expected(result))
    assert f"{NAME}_error" in columns or f"{NAME}_stated" in columns


def test_it_has_derivatives() -> None:
    overrides = (*SMALL, "wear=", "verdict.enabled=false")
    key = "loads.harmonic.shake.value"
    table = td.studies.derivatives("beam", only=(key,), overrides=overrides).derivatives
    velocity, frequency, height = (table.names.index(name) for name in (NAME, "peak_frequency", "amplitude"))
    values, slopes = table.values, table.slopes[:, 0]
    assert values[velocity] == pytest.approx(2 * np.pi * values[frequency] * values[height])
    product = 2 * np.pi * (slopes[frequency] * values[height] + values[frequency] * slopes[height])
    assert slopes[velocity] == pytest.approx(product, rel=1e-6)


def lines_that_name(names: set[str], folders: tuple[str, ...]) -> list[str]:
    """Lines with a literal that is one of the names, outside the folder of quantities."""
    root, lines = Path(td.__file__).parent, set()
    for path in (path for folder in folders for path in sorted((root / folder).resolve().rglob("*.py"))):
        if not {"quantities", "cases"} & set(path.parts):
            nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            lines |= {f"{path.name}:{n.lineno}" for n in nodes if isinstance(n, ast.Constant) and n.value in names}
    return sorted(lines)


def test_few_lines_name_a_quantity() -> None:
    names = set(quantity.FILES.names())
    rooms = tuple(f"workflows/{room}" for room in ("result", "errors", "report", "export", "command", "run"))
    lines = lines_that_name(names - {"cycles", "phase"}, rooms)
    assert len(lines) <= MOST_IN_ROOMS, lines
    lines = lines_that_name(names - ALSO_KEYS, ("hbm", "workflows"))
    assert len(lines) <= MOST_LITERALS, lines
