"""Pictures of the field: what an engine order excites, where it meets a mode, lives on Weibull paper."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from proof.cases.blade.few_sectors import FEW_SECTORS
from tests.helpers.command import printed_record, refusal
from tests.helpers.pictures import assert_not_blank
from tests.helpers.synthetic_result import result
from tribodyn.reduction.wave_model import Crossing, diameter_of
from tribodyn.workflows.pictures import loop_plots, maps, wheel_diagrams
from tribodyn.workflows.studies.wheels.wheel_model import crossings


@pytest.mark.parametrize("n_sectors", [7, 8])
def test_an_engine_order_excites_the_diameter_that_its_samples_have(n_sectors: int) -> None:
    """A wave sampled at the sectors, decomposed by a discrete Fourier transform."""
    for order in range(3 * n_sectors):
        samples = np.exp(2j * np.pi * order * np.arange(n_sectors) / n_sectors)
        place = int(np.argmax(np.abs(np.fft.fft(samples))))
        assert diameter_of(order, n_sectors) == min(place, n_sectors - place)


def constant(frequency: float) -> Callable[[float], np.ndarray]:
    return lambda _: np.array([frequency])


def test_orders_in_space_excite_waves_against_the_rotation_up_to_half_the_sectors() -> None:
    """Of four sectors order 1 is the wave -1, and order 3, through the sectors, the wave 1; none is above four."""
    waves = {"stuck": {0: constant(100.0), 1: constant(120.0), 2: constant(150.0), -1: constant(126.0)}}
    met = crossings(waves, 4, range(-1, -5, -1), 20.0, 200.0)["stuck"]
    assert {m.engine_order: m.frequency for m in met} == pytest.approx({-1: 126.0, -2: 150.0, -3: 120.0, -4: 100.0})
    assert [m.diameter for m in met] == [1, 2, 1, 0]
    assert [m.engine_order for m in crossings(waves, 4, range(-4, 0), 38.0, 70.0)["stuck"]] == [-3]


@pytest.mark.parametrize("known", [0, 1])
def test_a_campbell_diagram_has_no_entry_without_a_curve(known: int) -> None:
    """Not of the contact free where its frequencies are known at no speed, or at rest alone."""
    speeds = np.array([0.0, 50.0, 100.0])
    stuck = np.full((3, 1, 2), [150.0, 300.0])
    free = np.where(np.arange(3)[:, None, None] < known, 0.0, np.full_like(stuck, np.nan))
    waves = {"free": free, "stuck": stuck}
    met = {"stuck": [Crossing(-2, 2, 0, 75.0, 150.0)]}
    figure = wheel_diagrams.campbell(speeds, waves, (-2,), met)
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert shown == ["stuck, wave -2", "critical, stuck"]
    figure = wheel_diagrams.campbell(speeds, {**waves, "free": stuck / 2}, (-2,), {})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["free", "stuck, wave -2"]


def test_a_campbell_diagram_has_each_wave_and_line_once() -> None:
    stuck = np.full((3, 2, 1), 150.0)
    waves = {"free": np.full_like(stuck, np.nan), "stuck": stuck}
    figure = wheel_diagrams.campbell(np.array([0.0, 50.0, 100.0]), waves, (-2, 2), {})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stuck, wave -2", "stuck, wave 2"]
    assert [line.get_linestyle() for line in figure.axes[0].lines] == ["--", "-", ":"]


def test_the_command_draws_the_modes_of_a_wheel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = [word for text in (*FEW_SECTORS, "geometry.n_span=3") for word in ("--set", text)]
    speeds = ["--from", "3000rpm", "--to", "9000rpm", "--speeds", "2", "--families", "2", "--order", "1", "2"]
    record = printed_record(["wheel", "modes", "blade", *changes, *speeds, "--out", str(tmp_path), "--json"], capsys)
    assert {Path(name).name for name in record["files"]} == {
        "nodal_diameters.csv", "safe.csv", "campbell.csv", "nodal_diameters.png", "safe.png", "campbell.png",
    }  # fmt: skip
    for name in record["files"]:
        if name.endswith(".png"):
            assert_not_blank(Path(name))
    stuck, free = (np.array(record["families_hz"][state]) for state in ("stuck", "free"))
    assert stuck.shape == (5, 2)
    assert (stuck >= free * (1 - 1e-9)).all()  # springs can only stiffen
    for matched in record["met"]["stuck"]:
        assert matched["diameter"] == diameter_of(matched["engine_order"], 8)
        assert 50.0 <= matched["speed"] <= 150.0
        assert matched["frequency"] == pytest.approx(-matched["engine_order"] * matched["speed"])


def test_a_part_without_a_wheel_has_no_diagrams(capsys: pytest.CaptureFixture[str]) -> None:
    assert "has no [wheel]" in refusal(["wheel", "modes", "beam"], capsys)


def test_status_over_wear_and_loops_of_chosen_pairs() -> None:
    inputs = result()
    assert inputs.wear is not None
    figure = maps.status_maps(inputs, 5)
    assert len([axes for axes in figure.axes if axes.collections]) == 5
    assert len(loop_plots.hysteresis(inputs, [0, 2]).axes) == 6
    with pytest.raises(ValueError, match="this contact has pairs 0 to"):
        loop_plots.hysteresis(inputs, [1000])
