"""Measurements are read in their units and directions, and stand beside what a scene computes."""

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from scipy.io import savemat

import tribodyn as td
from proof.fuzzing.fuzz_damage import bytes_damaged
from tests.helpers.matrix_scene import matrix_folder
from tribodyn.refusal import Refusal
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.export import formats
from tribodyn.workflows.export.result_tables import DataKind, Function, function
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.studies.measured import measurement, reading
from tribodyn.workflows.studies.measured.measurement import Run

SMALL = (
    "harmonics.kept=[0, 1]", "harmonics.samples=32", "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1",
    "reduction.modes=3", "response.points=16", "wear=", "verdict.enabled=false",
)  # fmt: skip
BACKBONE = (*SMALL, "backbone.modal_amplitude=[1e-5, 1e-4]", "backbone.points=5")
MODE = {"mass": 2.0, "hertz": 80.0, "damping": 3e-3}  # of one mode


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A response of our own in the formats that are read again."""
    folder = tmp_path_factory.mktemp("own")
    overrides = (*SMALL, "loads.harmonic.shake.phase=1.1", "loads.harmonic.shake.value=-8000")
    files = formats.write(td.run("beam_thesis", overrides=overrides), ["csv", "mat", "uff"], folder)
    return {path.suffix: path for path in files if path.stem in ("response", "result")} | {"overrides": overrides}


@pytest.mark.parametrize("ending", [".csv", ".mat", ".uff"])
def test_a_response_of_our_own_is_read_again_without_a_difference(ending: str, exported: dict) -> None:
    comparison = td.studies.compare("beam_thesis", exported[ending], overrides=exported["overrides"])
    off = comparison.largest()
    assert off["amplitude_m_difference"] < 1e-10
    assert off["phase_deg_difference"] < 1e-8
    assert len(comparison.rows()) >= 16
    assert not comparison.record()["outside"]
    other = td.studies.compare("beam_thesis", exported[ending], overrides=(*SMALL, "contact.friction=0.3"))
    assert other.largest()["amplitude_m_difference"] > 0.05  # of another scene it differs


def test_a_backbone_and_a_band_are_compared_from_the_command_line(tmp_path: Path, capsys) -> None:
    (path, *_) = td.studies.backbone("beam_thesis", overrides=BACKBONE).write(tmp_path)
    words = ["study", "compare", "beam_thesis", str(path), "--out", str(tmp_path), "--json"]
    words += [word for text in BACKBONE for word in ("--set", text)]
    cli.app([*words, "--band", "contact.friction=0.4", "--band", "contact.friction=0.7"], result_action="return_value")
    record = json.loads(capsys.readouterr().out)
    assert record["kind"] == "backbone"
    assert record["largest"]["frequency_hz_difference"] < 1e-9
    assert record["largest"]["damping_difference"] < 1e-9
    middle = record["rows"][2]
    assert middle["least_damping"] < middle["damping"] < middle["most_damping"]
    assert {Path(name).name for name in record["files"]} == {"compare.csv", "compare.png"}


def swept(force: np.ndarray | float, hertz: np.ndarray) -> np.ndarray:
    """Displacement of the mode under a force."""
    w, w0 = 2 * np.pi * hertz, 2 * np.pi * MODE["hertz"]
    return force / (MODE["mass"] * (w0**2 - w**2 + 2j * MODE["damping"] * w0 * w))


@pytest.mark.parametrize("reference", ["response over force", "force over response"])
def test_units_directions_and_the_phase_are_those_of_the_file(reference: str, tmp_path: Path) -> None:
    """Acceleration against the force in mm/s2, force in kN, degrees: the displacement of a closed form comes back."""
    hertz = np.linspace(79.0, 81.0, 21)
    x = swept(0.4, hertz)
    a = -((2 * np.pi * hertz) ** 2) * x * -1.0  # seen against the direction of the force
    sign = 1 if reference == "response over force" else -1
    columns = {
        "frequency [rad/s]": 2 * np.pi * hertz, "acceleration [mm/s2]": 1e3 * np.abs(a),
        "phase_deg": sign * np.degrees(np.angle(a)), "force [kN]": np.full(21, 4e-4), "run": ["a"] * 21,
    }  # fmt: skip
    path = tmp_path / "sweep.csv"
    write_columns(columns, path)
    path.write_text(f"# direction = -y\n# phase = {reference}\n# a remark\n" + path.read_text(), encoding="utf-8")
    content = reading.read(path)
    assert (content.order, content.direction, content.phased) == (2, (-0.0, -1.0, -0.0), True)
    file = td.read_scene("beam_thesis", SMALL)
    np.testing.assert_allclose(content.runs[0].displacement, -x, rtol=1e-12)
    np.testing.assert_allclose(content.on(file.scene).runs[0].displacement, x, rtol=1e-12)
    point = measurement.resonance(content.on(file.scene).runs[0])
    assert [point.frequency[0], point.damping[0]] == pytest.approx([80.0, 3e-3], rel=1e-9)
    assert point.force[0] == pytest.approx(0.4, rel=0.01)  # 80 Hz is one of the points


def test_a_resonance_bends_with_its_amplitude() -> None:
    """Frequency and damping that change in proportion to the amplitude, along a curve of constant force."""
    hertz = np.linspace(75.0, 85.0, 60)
    x = swept(1.0, hertz)
    for _ in range(400):
        w0 = 2 * np.pi * (80.0 - 0.6 * np.abs(x) / 1e-4)
        zeta = 5e-3 + 4e-3 * np.abs(x) / 1e-4
        w = 2 * np.pi * hertz
        x = 0.9 * x + 0.1 / (MODE["mass"] * (w0**2 - w**2 + 2j * zeta * w0 * w))
    run = Run("", "force", hertz, x, np.ones(60), np.full(60, np.nan), np.full((60, 2), np.nan))
    top = np.abs(x).max() / 1e-4
    point = measurement.resonance(run)
    assert point.frequency[0] == pytest.approx(80.0 - 0.6 * top, rel=1e-6)
    assert point.damping[0] == pytest.approx(5e-3 + 4e-3 * top, rel=1e-6)


def test_a_decay_is_read_as_the_backbone_that_it_follows(tmp_path: Path) -> None:
    time = np.arange(0.0, 1.0, 1 / 4000)
    rate, w = 2.0, 2 * np.pi * 80
    a = -(w**2) * 1e-4 * np.exp(-rate * time) * np.cos(w * time)
    savemat(tmp_path / "decay.mat", {"time_s": time, "acceleration_m_s2": a})
    content = reading.read(tmp_path / "decay.mat")
    (run,) = content.runs
    assert content.decay
    assert content.kind == "backbone"
    np.testing.assert_allclose(run.frequency, 80.0, rtol=1e-6)
    np.testing.assert_allclose(run.damping, rate / w, rtol=1e-3)
    assert run.amplitude.max() == pytest.approx(1e-4, rel=0.06)


def test_matrices_are_compared_in_rows(tmp_path: Path) -> None:
    """The direction of a scene of matrices is its rows; its force is not where its output is."""
    scene = td.read_scene(matrix_folder(tmp_path) / "own.toml", ("response.points=8",))
    write_columns({"frequency_Hz": [50.0, 60.0], "acceleration [g]": [1.0, 2.0]}, tmp_path / "sweep.csv")
    comparison = td.studies.compare(scene, tmp_path / "sweep.csv")
    assert np.isfinite([row["computed_amplitude_m"] for row in comparison.rows()]).all()
    assert not comparison.measured.force_at_output(scene.scene)


def test_a_small_decay_at_the_frequency_and_damping_at_rest_is_that_of_the_scene(tmp_path: Path) -> None:
    """Stuck, the beam is linear: a decay of its own frequency and damping has the decrement that is computed."""
    overrides = (*SMALL, "contact.friction=100", "backbone.modal_amplitude=[1e-6, 1e-5]", "backbone.points=8")
    at_rest = td.studies.backbone("beam_thesis", overrides=overrides).record()
    w, zeta = 2 * np.pi * at_rest["reference_hz"], at_rest["damping"][0]
    time = np.arange(0.0, 24 * 2 * np.pi / w, 2 * np.pi / w / 64)
    size = 0.5 * at_rest["amplitude_m"][-1]
    write_columns(
        {"time_s": time, "displacement_m": size * np.exp(-zeta * w * time) * np.cos(w * time)}, tmp_path / "decay.csv"
    )
    off = td.studies.compare("beam_thesis", tmp_path / "decay.csv", overrides=overrides).largest()
    assert off["frequency_hz_difference"] < 1e-4
    assert off["damping_difference"] < 0.01


def universal(path: Path, *changes: dict[str, Any]) -> Path:
    """Accelerances of 4 along -z from 0 Hz on, as another program writes them, each dataset with changes of its own."""
    file, hertz = pyuff.UFF(str(path)), np.linspace(0.0, 100.0, 9)
    for change in changes:
        entry = function(
            Function.FRF, "tap", "frequency", DataKind.FREQUENCY, "Hz", hertz, DataKind.ACCELERATION, "m/s^2",
            (1 + 1j) * hertz, 4,
        )  # fmt: skip
        file.write_sets(entry | {"rsp_dir": -3, "ref_dir": 3, "ref_node": 1} | change, "add")
    return path


def test_a_universal_file_says_node_and_direction(tmp_path: Path) -> None:
    path = universal(tmp_path / "hammer.uff", {}, {"rsp_node": 7}, {"rsp_node": 7, "rsp_dir": 1})
    with pytest.raises(ValueError, match=r"hammer\.uff: it has 3 measured places.*4, 7.*give node = NUMBER"):
        reading.read(path)
    content = reading.read(path, {"node": "7", "direction": "-z"})
    assert content.per_force
    assert (content.direction, content.force_direction) == ((-0.0, -0.0, -1.0), (0.0, 0.0, 1.0))
    assert content.unused == ("1 lines at 0 Hz, where nothing vibrates",)
    assert reading.read(path, {"node": "7", "direction": "x"}).direction == (1.0, 0.0, 0.0)


def units(length: float, force: float) -> dict[str, Any]:
    """A dataset 164: numbers of the file that are 1 m and 1 N."""
    return {"type": 164, "units_code": 9, "length": length, "force": force, "temp": 1.0, "temp_offset": 0.0}


@pytest.mark.parametrize(("changes", "facts", "factor"), [
    ([{}], {}, 1.0),
    ([{"ordinate_axis_units_lab": "g"}], {}, 9.80665),
    ([{"ordinate_axis_units_lab": "in/sec^2", "orddenom_axis_units_lab": "lbf"}], {}, 0.0254 / 4.4482216152605),
    ([{"abscissa_axis_units_lab": "kHz"}], {}, 1e-6),
    ([units(1e3, 1e3), {"ordinate_axis_units_lab": "NONE"}], {}, 1.0),
    ([units(1.0, 1e3), {"ordinate_axis_units_lab": "NONE"}], {}, 1e3),
    ([{"ordinate_axis_units_lab": "bogus"}], {"unit": "mm/s2/N"}, 1e-3),
    ([{}, {"data": 3 * (1 + 1j) * np.linspace(0.0, 100.0, 9)}], {}, 2.0),  # repeats become their mean
])  # fmt: skip
def test_a_universal_file_has_the_units_of_its_labels(changes, facts, factor, tmp_path):
    (run,) = measurement.merged(reading.read(universal(tmp_path / "tap.uff", *changes), facts)).runs
    hertz = np.linspace(12.5, 100.0, 8)
    np.testing.assert_allclose(run.displacement, -factor * (1 + 1j) * hertz / (2 * np.pi * hertz) ** 2)


@pytest.mark.parametrize(("change", "words"), [
    ({"ordinate_axis_units_lab": "bogus"}, r'"bogus" is not a unit: .* give --fact unit=UNIT'),
    ({"ordinate_axis_units_lab": "mm"}, "in mm, and derivative 2 of a motion by record 9"),
    ({"orddenom_spec_data_type": 12}, "no response over a force"),
    ({"rsp_dir": 4}, "direction: expected an axis .* got 'about 4'"),
    ({"func_type": 6}, "it has no response"),
])  # fmt: skip
def test_a_universal_file_of_something_else_is_refused(change: dict, words: str, tmp_path: Path) -> None:
    with pytest.raises(Refusal, match=words):
        reading.read(universal(tmp_path / "tap.uff", change))


@pytest.mark.parametrize("ending", [".csv", ".uff", ".mat"])
def test_a_damaged_measurement_is_read_or_refused(ending: str, tmp_path: Path) -> None:
    path, rng, hertz = tmp_path / f"own{ending}", np.random.default_rng(0), np.linspace(60.0, 100.0, 9)
    columns = {"frequency_Hz": hertz, "acceleration_m_s2": hertz, "phase_deg": hertz}
    if ending == ".uff":
        universal(path, {})
    else:
        write_columns(columns, path) if ending == ".csv" else savemat(path, columns)
    whole = path.read_bytes()
    for _ in range(8 if ending == ".mat" else 100):  # a MATLAB file is read in a process of its own
        path.write_bytes(bytes_damaged(whole, rng)[0])
        with contextlib.suppress(Refusal):
            reading.read(path)


def test_modes_of_a_universal_file_stand_beside_those_at_rest(tmp_path: Path) -> None:
    file = pyuff.UFF(str(tmp_path / "modes.uff"))
    shape = np.ones(1)
    mode = pyuff.prepare_55(
        model_type=1, id1="NONE", id2="NONE", id3="NONE", id4="NONE", id5="NONE", analysis_type=2, data_ch=2,
        spec_data_type=8, data_type=2, r1=shape, r2=shape, r3=shape, n_data_per_node=3, node_nums=[1], load_case=1,
        mode_n=1, modal_m=0, freq=1500.0, modal_damp_vis=0.02, modal_damp_his=0.0,
    )  # fmt: skip
    file.write_sets(mode, "add")
    comparison = td.studies.compare("beam_thesis", tmp_path / "modes.uff", overrides=SMALL)
    (row,) = comparison.rows()
    at_rest = td.studies.backbone("beam_thesis", 1e-8, 2e-8, points=2, overrides=SMALL).record()["reference_hz"]
    assert row["computed_frequency_hz"] == pytest.approx(at_rest, rel=1e-9)
    assert row["damping"] == pytest.approx(0.02)


SWEEP = "frequency_Hz,displacement_um,force_N,phase_deg\n" + "".join(f"{f},1,1,0\n" for f in range(400, 410))


@pytest.mark.parametrize(("text", "words"), [
    (SWEEP.replace("frequency", "pitch"), "no column frequency or time among pitch_Hz"),
    (SWEEP.replace("displacement_um", "displacement"), r"column displacement: give its unit"),
    (SWEEP.replace("displacement_um", "acceleration [mm]"), "mm is no unit of it"),
    (SWEEP.replace("force_N", "force_Pa"), "column force: expected a force"),
    ("# direction = x\n" + SWEEP, "measured along x, output response of the scene is along y"),
    ("# output = tip\n" + SWEEP, 'output = "tip": the scene has response'),
    ("# heading = x\n" + SWEEP, "unknown key heading"),
    ("# position = 1 m, 0 m, 0 m\n" + SWEEP, "position: measured"),
    (SWEEP.replace("400,1,", "400,0,"), "numbers above 0 in every row"),
    (SWEEP.replace("400,1,1,0\n", "400,1,1\n"), "rows of as many values"),
    (SWEEP.replace("400,1,1,0\n", "400,1,0,0\n"), "column force: expected numbers other than 0"),
    (SWEEP.replace("400,1,1,0\n", "400,,1,0\n"), "column displacement_um has '', which is no number"),
    (SWEEP.replace(",", ";").replace("400;1;", "400;1,x;"), "column displacement_um has '1.x'"),
])  # fmt: skip
def test_what_does_not_fit_is_one_sentence_and_exit_code_2(text: str, words: str, tmp_path: Path, capsys) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text(text, encoding="utf-8")
    sets = [word for item in SMALL for word in ("--set", item)]
    with pytest.raises(SystemExit) as stop:
        cli.main(["study", "compare", "beam_thesis", str(path), *sets, "--quiet"])
    assert stop.value.code == 2
    sentence = capsys.readouterr().err.strip().splitlines()[-1]
    assert sentence.startswith("tribodyn: sweep.csv: ")
    assert words in sentence
