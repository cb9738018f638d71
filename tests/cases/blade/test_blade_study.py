"""The study of the bladed disk, coarse: its tables and pictures, the Campbell diagram, the mistuned wheel."""

import csv

import numpy as np
import pytest

from proof import __main__ as cli
from proof.cases.blade import study as blade_study
from proof.cases.blade.few_sectors import FEW_SECTORS
from proof.cases.blade.study import Extent
from tests.helpers.coarse_scenes import BLADE as COARSE
from tests.helpers.pictures import assert_not_blank
from tribodyn.hbm import newton
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels.wheel_model import build, critical_speeds

SHORT = Extent(
    orders=(1, 20), loads=(0.02, 1.0), tolerance=0.02, steps=(0.6, 0.4), shown=0.4, frames=2, speeds=2
)  # fmt: skip
FEWER = (*FEW_SECTORS, "geometry.n_span=3", "harmonics.samples=32", "response.points=21")


@pytest.fixture(scope="module")
def blade():
    return build(scene_file.read("blade_thesis", COARSE))


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_study_writes_its_tables_and_pictures(tmp_path):
    rows = []
    paths = blade_study.run("blade_thesis", COARSE, tmp_path, 150.0, rows.append, SHORT)
    pictures = [path for path in paths if path.suffix == ".png"]
    assert {path.stem for path in pictures} == {
        "diagram", "campbell", "orders", "forces", "maps", "backbone", "cycles", "peaks",
    }  # fmt: skip
    for path in pictures:
        assert_not_blank(path)
    peaks = rows_of(tmp_path / "peaks.csv")
    assert [row["what"] for row in peaks] == ["engine_order"] * 2 + ["force_N"] * 2
    little, large = (float(row["peak_Hz"]) for row in peaks[2:])
    assert little > large  # rising excitation leaves the stuck peak towards the free one
    table = rows_of(tmp_path / "trade.csv")
    assert [float(row["step"]) for row in table] == [0.6, 0.4]
    assert {row["end"] for row in table} == {"contact lost at every pair"}
    assert (tmp_path / "trade.md").read_text(encoding="utf-8").count("\n") == 4
    assert any("engine order 20: critical at" in line for line in rows)


def test_diagram_of_blades_alone_and_stuck(blade):
    diagram_rows = blade_study.diagram(blade)
    assert diagram_rows["free"].shape == (21, blade_study.FAMILIES)
    assert np.ptp(diagram_rows["free"][:, 0]) < 1e-6 * diagram_rows["free"].max()  # a rigid disk: free blades are alone
    assert (diagram_rows["stuck"][:, 0] > diagram_rows["free"][:, 0]).all()
    errors = blade_study.reduction_error(blade)
    assert all(error.shape == (6, blade_study.FAMILIES) for error in errors.values())


def test_critical_speeds_are_where_the_order_meets_its_frequency():
    def wave(speed: float) -> np.ndarray:
        return np.array([100 + speed, 500.0])

    assert critical_speeds(wave, 3, 0.0, 100.0) == [(0, pytest.approx(50.0))]
    assert critical_speeds(wave, -6, 0.0, 100.0) == [(0, pytest.approx(20.0)), (1, pytest.approx(500 / 6))]


def test_speed_stiffens_and_loads(blade):
    spinning = blade.at_speed(100.0)
    still, fast = (item.diagram([1], 1, False)[0, 0] for item in (blade, spinning))
    assert fast > 1.02 * still
    assert spinning.wave().excitation.loads[0, "centrifugal"] == pytest.approx((2 * np.pi * 100) ** 2)


def test_highest_maximum_is_not_an_end_of_the_range(blade):
    curve = blade_study.respond(blade.wave().with_load(0.02), (300.0, 380.0), 0.01)
    hertz, height = curve.peak()
    assert hertz == pytest.approx(float(blade.diagram([1], 1, True)[0, 0]), rel=0.02)
    assert height == curve.amplitude().max()


def test_references_carry_the_load_of_their_curve(blade):
    """Hardly shaken the response is the stuck one, and both references grow with the load."""
    little, extra = (blade_study.respond(blade.wave().with_load(load), (150.0, 160.0), 0.01) for load in (1e-3, 1e-2))
    stuck = np.interp(2 * np.pi * little.branch.frequency, little.references.omega, little.references.stuck)
    assert little.amplitude() == pytest.approx(stuck, rel=1e-4)
    for state in ("free", "stuck"):
        assert getattr(extra.references, state) == pytest.approx(10 * getattr(little.references, state), rel=1e-9)


def test_blades_alike_are_a_travelling_wave():
    """The wheel that the mistuned example solves, with no deviation, is the sector: same parts, same answer."""
    blade = build(scene_file.read("blade_thesis", FEWER))
    item, wheel = blade.wave(), blade.whole_wheel()
    exact = newton.NewtonOptions(tolerance=1e-11)
    mine, theirs = (newton.solve_from_rest(balance, 2 * np.pi * 1000, exact) for balance in (item, wheel))
    assert mine.outcome == theirs.outcome == CONVERGED
    pairs = item.contact.n_pair
    for n in range(8):
        expected = waves.at_sector(item.basis, mine.state.x, 2, 8, n)
        result = theirs.state.x[n * pairs : (n + 1) * pairs]
        assert np.abs(result - expected).max() < 1e-6 * np.abs(mine.state.x).max()


def test_mistuned_wheel(tmp_path, capsys):
    words = [word for text in FEWER[-3:] for word in ("--set", text)]
    cli.app(["blade", "mistuned", "--out", str(tmp_path), *words], result_action="return_value")
    message, *paths = capsys.readouterr().out.splitlines()
    names = ["mistuned.csv", "mistuned.png", "derivatives.csv", "derivatives.png"]
    assert sorted(path.rsplit("/", 1)[-1] for path in paths) == sorted(names)
    assert_not_blank(tmp_path / "mistuned.png")
    amplification = float(message.split(": ")[1])
    assert 1.1 < amplification < 0.5 * (1 + np.sqrt(8)) * 1.2  # Whitehead's bound for a linear wheel, and some slack


def test_a_part_alone_has_no_such_study():
    with pytest.raises(ValueError, match=r"beam has no \[wheel\]"):
        build(scene_file.read("beam"))
