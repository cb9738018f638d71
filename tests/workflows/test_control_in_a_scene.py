"""Tests under control from a scene: force levels in tables and pictures, and what cannot be."""

from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.command import printed_record, refusal
from tests.helpers.matrix_scene import matrix_folder
from tribodyn.workflows import cases
from tribodyn.workflows.export import formats
from tribodyn.workflows.pictures import plots, response_plots

PLAIN = ("wear.max_steps=0", "verdict.enabled=false", "harmonics.kept=[0, 1]", "response.points=12")


def test_the_amplitude_is_held_and_the_force_is_stored_point_by_point(tmp_path: Path):
    scene = matrix_folder(tmp_path) / "own.toml"
    fixed = (*PLAIN, "response.control=amplitude", "response.amplitude=3 um")
    result = td.run(scene, tmp_path / "out", overrides=fixed)
    loaded = td.load(tmp_path / "out")
    np.testing.assert_array_equal(loaded.response.load_factor, result.response.load_factor)
    assert loaded.response.controlled
    formats.write(loaded, ["csv"], tmp_path)
    with next(tmp_path.rglob("response.csv")).open() as file:
        names = file.readline().strip().split(",")
        rows = np.genfromtxt(file, delimiter=",", converters={names.index("converged"): lambda _: 1.0})
    table = dict(zip(names, rows.T, strict=True))
    a, b = table["response_a1_m"], table["response_b1_m"]
    np.testing.assert_allclose(np.hypot(a, b), 3e-6, rtol=1e-8)
    np.testing.assert_allclose(table["force_N"], 20.0 * table["load_factor"])
    np.testing.assert_allclose(table["response_phase_rad"], np.arctan2(-b, a), atol=1e-12)
    i = int(np.argmin(table["force_N"]))
    assert result.summary()["peak_frequency"]["first"] == pytest.approx(table["frequency_Hz"][i])
    at = f"['{table['frequency_Hz'][i]:.12g} Hz', '121 Hz']"  # constant force of this size has the same amplitude there
    value = f"loads.harmonic.shaker.value={table['force_N'][i]:.12g} N"
    inputs = td.run(scene, None, overrides=(*PLAIN, value, f"response.frequency={at}"))
    assert abs(inputs.response.fundamental("response")[0]) == pytest.approx(3e-6, rel=1e-6)


def test_a_phase_resonance_from_a_scene_lags_by_a_quarter_and_is_drawn(tmp_path: Path):
    scene = matrix_folder(tmp_path) / "own.toml"
    control = ("response.control=phase", 'response.amplitude=["0.1 um", "20 um"]')
    result = td.run(scene, tmp_path / "out", overrides=(*PLAIN, *control))
    frf = result.response
    np.testing.assert_allclose(np.abs(np.angle(frf.fundamental("response"))), np.pi / 2, atol=1e-6)
    np.testing.assert_allclose(np.abs(frf.fundamental("response")), frf.parameter, rtol=1e-8)
    assert frf.parameter[-1] == pytest.approx(20e-6)
    assert "control" in plots.figures(result)
    assert len(response_plots.controlled(result).axes) == 3
    assert result.summary()["peak_at_end"] is None


@pytest.mark.parametrize(("sets", "sentence"), [
    (("response.control=amplitude",), 'expected amplitude = "10 um" with control = "amplitude"'),
    (("response.amplitude=1 um",), 'expected no amplitude with control = "force"'),
    (("response.control=phase", "response.amplitude=1 um"), 'expected amplitude = ["1 um", "1 mm"]'),
    (("response.control=amplitude", "response.amplitude=0 um"), "expected amplitude above 0"),
    (("response.control=amplitude", "response.amplitude=1 um", "response.stability=true"), "no stability"),
    (("response.control=amplitude", "response.amplitude=1 um", "wear.max_steps=1"), "does not wear"),
])  # fmt: skip
def test_what_cannot_be_controlled_is_one_sentence(sets, sentence, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = matrix_folder(tmp_path) / "own.toml"
    words = [word for text in ("wear.max_steps=0", *sets) for word in ("--set", text)]
    assert sentence in refusal(["run", str(scene), *words], capsys)


def test_a_blow_rings_down_and_says_what_rings_along(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = matrix_folder(tmp_path) / "own.toml"
    free = ["--set", "contact.friction=100", "--set", "harmonics.kept=[0, 1]", "--out", str(tmp_path / "out")]
    words = ["curve", "ring-down", str(scene), *free, "--impulse", "1e-4 N s", "--from", "10nm", "--json"]
    rows = printed_record([*words, "--periods", "30"], capsys)["rows"]
    assert rows[0]["amplitude_m"] > rows[-1]["amplitude_m"]
    assert all(row["remainder"] > 0 for row in rows)
    assert "--from" in refusal([*words[:-3]], capsys)


def test_a_scene_without_a_frequency_is_inspected_and_does_not_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = matrix_folder(tmp_path) / "own.toml"
    path.write_text(path.read_text().replace('frequency = ["35 Hz", "120 Hz"]\n', ""))
    err = refusal(["run", str(path)], capsys)
    assert 'response.frequency is missing: give its range, such as ["100 Hz", "200 Hz"]' in err
    text = (Path(cases.__path__[0]) / "beam" / "beam.toml").read_text()
    path.write_text(text.replace('frequency = ["380 Hz", "1200 Hz"]', ""))
    inspected = td.inspect(path, overrides=["geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1"])
    assert inspected.record()["mass_kg"] == pytest.approx(0.2 * 0.02**2 * 7860)
