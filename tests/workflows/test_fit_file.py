"""tribodyn study identify: numbers of a scene that made the measured ones are found again, and bad files end well."""

import tomllib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tribodyn as td
from proof.problems import cycle_at
from tests.helpers.coarse_scenes import BLADE, RIG
from tests.helpers.command import printed_record, refusal
from tests.helpers.fits import fit_by_differences, plain, predict
from tests.helpers.matrix_scene import matrix_folder
from tests.helpers.pages import ROOT, fences
from tests.helpers.structures import BLOCKS
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.fits import fit_file, scene_fit
from tribodyn.workflows.studies.fits.curve_target import FULL, Curve, CurveTarget
from tribodyn.workflows.studies.fits.fit_file import FitTables, MeasuredTarget
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber
from tribodyn.workflows.studies.measured.measurement import Run

BEAM = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3", "reduction.modes=5", "harmonics.samples=32", "harmonics.transitions=sampled",
    "response.points=20", "wear.tolerance=20 %", "wear.at=700 Hz", "wear.motion=balance",
)  # fmt: skip


def found_again(scene, overrides, true, looked, measured):
    """Measure the scene with the true numbers, then look for them from the scene as it stands."""
    reference = {name: MeasuredTarget(value=1.0, **table) for name, table in measured.items()}
    answers = predict(scene_file.read(scene, (*overrides, *true)), reference)
    assert (answers > 0).all()
    task = FitTables.model_validate(
        {
            "parameters": looked,
            "measured": {
                name: {**table, "value": float(answer)}
                for (name, table), answer in zip(measured.items(), answers, strict=True)
            },
        }
    )
    fit = scene_fit.best(scene_file.read(scene, overrides), task, Progress())
    return fit.identification, fit.changes


def test_friction_of_a_scene_of_matrices_is_found_again(tmp_path):
    scene = str(matrix_folder(tmp_path) / "own.toml")
    searched = {"mu": {"keys": ["contact.friction"], "low": 0.1, "high": 0.8}}
    measured = {name: {"of": name, "at": "60 Hz"} for name in ("amplitude", "energy")}
    result, _ = found_again(scene, (), ("contact.friction=0.3",), searched, measured)
    assert result.values == pytest.approx([0.3], rel=1e-3)
    assert result.origin == [0.4]


LOCATED = ("harmonics.transitions=located", "wear=")  # where derivatives are exact
SMALL_BEAM = (*BEAM, *LOCATED, "geometry.n_length=4", "geometry.n_height=2")
AT_700, AT_290 = {"at": "700 Hz", "load": 2.0}, {"at": "290 Hz", "load": 0.5}
SHAKEN = {"rest": {"of": "preload"}, "amplitude": {"of": "amplitude", **AT_290}, "energy": {"of": "energy", **AT_290}}
PLANTED = {  # scene, overrides, what is planted with bounds, what is measured, most trials
    "springs": ("beam", SMALL_BEAM,
        {"contact.tangential_stiffness": (340e6, 100e6, 1e9), "contact.friction": (0.4, 0.1, 0.9)},
        {"amplitude": {"of": "amplitude", **AT_700}, "energy": {"of": "energy", **AT_700}}, 5),
    "material": ("beam", (*SMALL_BEAM, "response.frequency=['1500 Hz', '2600 Hz']"),
        {"material.young": (160e9, 100e9, 300e9), "damping.modal": (0.014, 0.003, 0.05)},
        {"stuck": {"of": "stuck frequency", "mode": 1}, "peak": {"of": "amplitude", "at": "peak", "load": 0.05}}, 6),
    "press": ("beam", SMALL_BEAM,
        {"loads.static.press.value": (15e3, 5e3, 50e3), "contact.friction": (0.65, 0.1, 0.9)},
        {"preload": {"of": "preload", **AT_700}, "energy": {"of": "energy", **AT_700}}, 6),
    "height": ("rig", (*RIG, *LOCATED),
        {"surfaces.mating_height": (2e-6, -5e-6, 5e-6, 1.2e-6), "damping.modal": (0.018, 0.005, 0.06)},
        SHAKEN, 10),
    "platform": ("rig", (*RIG, *LOCATED),
        {"prescribed.platform.displacement": (20e-6, 8e-6, 40e-6), "contact.friction": (0.65, 0.2, 1.5)},
        SHAKEN, 7),
}  # fmt: skip


@pytest.mark.parametrize("problem", PLANTED)
def test_planted_numbers_are_found_in_few_trials(problem):
    """From starts that lie 20 to 50 % beside them; differences took 21 to 30 trials (docs/howto/identify.md)."""
    scene, overrides, planted, measured, largest = PLANTED[problem]
    true = {key: value for key, (value, *_) in planted.items()}
    searched = {
        key: {"keys": [key], "low": low, "high": high, "start": list(start)}
        for key, (_, low, high, *start) in planted.items()
    }
    result, _ = found_again(
        scene, overrides, tuple(f"{key}={value!r}" for key, value in true.items()), searched, measured
    )
    off = np.abs(np.array([p.starts[0] for p in result.parameters]) / list(true.values()) - 1)
    assert (off > 0.19).all()
    assert (off < 0.51).all()
    np.testing.assert_allclose(result.values, list(true.values()), rtol=1e-3)
    assert result.evaluations <= largest


def test_the_wear_coefficient_is_found_from_life_and_work():
    """Life and work both go with its inverse, as the volume that is to be worn is given."""
    searched = {"alpha": {"keys": ["wear.coefficient"], "low": "2e2 um3/J", "high": "2e4 um3/J"}}
    measured = {"life": {"of": "life", "left": 0.9}, "work": {"of": "friction_work", "left": 0.9}}
    result, _ = found_again("beam", BEAM, ("wear.coefficient=5e3 um3/J",), searched, measured)
    assert result.values == pytest.approx([5e-15], rel=1e-3)
    assert result.sensitivity.ravel() == pytest.approx([-1.0, -1.0], abs=0.01)


def test_mating_height_is_found_from_the_preload_and_the_part_is_made_once(monkeypatch):
    """From the scene's own zero, where a relative step would have no length; against the rig's own preload."""
    rows = []
    original = modelling.make_mesh
    monkeypatch.setenv("TRIBODYN_CACHE", "off")
    monkeypatch.setattr(modelling, "make_mesh", lambda *args: rows.append(1) or original(*args))
    task = FitTables.model_validate(
        {
            "parameters": {"height": {"keys": ["surfaces.mating_height"], "low": "-5 um", "high": "5 um"}},
            "measured": {"rest": {"of": "preload", "value": "36 N"}},
        }
    )
    fit = scene_fit.best(scene_file.read("rig", RIG), task, Progress())
    computed, changes = fit.identification, fit.changes
    assert len(rows) == 1
    assert 1e-6 < computed.values[0] < 4e-6
    assert changes[0].endswith(" m")
    file = scene_file.read("rig", (*RIG, *changes, "loads.harmonic.shaker.value=0"))
    balance = modelling.build(file, Progress()).balance
    assert balance.preload(cycle_at(file, balance, 290.0)) == pytest.approx(36.0, rel=1e-4)


def test_a_joint_makes_another_reduction_and_a_cycle_is_that_of_the_run(monkeypatch, tmp_path):
    measured = {
        "open": MeasuredTarget(of="open frequency", mode=3, value=300.0),
        "energy": MeasuredTarget(of="energy", at="290 Hz", value=1.0),
        "shaken": MeasuredTarget(of="preload", at="290 Hz", value=31.0),
    }
    rows, answers, original = [], [], modelling.plain_model
    monkeypatch.setenv("TRIBODYN_CACHE", str(tmp_path))
    monkeypatch.setattr(modelling, "plain_model", lambda *args: rows.append(1) or original(*args))
    for overrides in ((), ("springs.base_across.stiffness=5e8",), ("springs.base_across.stiffness=5e8", "wear=")):
        before = len(rows)
        answers.append(predict(scene_file.read("rig", (*RIG, *overrides)), measured))
        assert (len(rows) == before) == ("wear=" in overrides)
    assert answers[1][0] < 0.99 * answers[0][0]
    assert answers[2] == pytest.approx(answers[1])
    file = scene_file.read("rig", RIG)
    balance = modelling.build(file, Progress()).balance
    state = cycle_at(file, balance, 290.0)
    assert answers[0][1:] == pytest.approx([balance.energy(state).sum(), balance.preload(state)], rel=1e-6)


def test_a_wheel_has_the_frequencies_of_its_wave():
    reference = {"first": MeasuredTarget(of="stuck frequency", mode=1, value=341.0)}
    item, pair = (
        predict(scene_file.read("blade_thesis", (*BLADE, f"wheel.engine_order={o}")), reference) for o in (1, 2)
    )
    assert 300 < item[0] < 400 < pair[0] < 550


def test_derivatives_at_zero_and_at_a_bound_are_those_of_the_prediction():
    """An unknown that starts at zero, and one that starts at its upper bound, both find their way."""
    parameters = [FitParameter("x", -1.0, 1.0, (0.0,), ratio=False), FitParameter("y", 1.0, 2.0, (2.0,))]
    result = fit_by_differences(
        parameters,
        [MeasuredNumber("a", 1.3), MeasuredNumber("b", 2.6)],
        lambda v: np.array([1.0 + v["x"], v["y"] * (1 + v["x"])]) * (1 + 1e-7 * np.sin(1e9 * v["x"])),  # rounding
    )
    assert result.values == pytest.approx([0.3, 2.0], rel=1e-3)
    assert result.evaluations < 60


PARAMETER = '[parameters.k]\nkeys = ["damping.modal"]\nlow = 0.01\nhigh = 0.06\n'
MEASURED = '[measured.e]\nof = "energy"\nat = "290 Hz"\nvalue = "1 mJ"\n'


@pytest.mark.parametrize(("text", "words"), [
    ("x = [", "is not valid TOML"),
    (PARAMETER, "measured is missing"),
    (MEASURED, "parameters is missing"),
    (PARAMETER.replace("low = 0.01\n", "") + MEASURED, "parameters.k.low is missing"),
    (PARAMETER.replace("high", "highest") + MEASURED, "unknown key parameters.k.highest"),
    (PARAMETER.replace("modal", "modall") + MEASURED, "the scene has no damping.modall: give start"),
    (PARAMETER.replace("damping.modal", "scene.title") + MEASURED, "scene.title is not a number"),
    (PARAMETER.replace("0.01", "0.03") + MEASURED, "between 0.03 and 0.06 but 0.026: give start"),
    (PARAMETER.replace("0.01", '"1 um"').replace("0.06", '"1 N"') + MEASURED, "k.high: expected a length"),
    (PARAMETER.replace("0.01", '"1 um"').replace("0.06", '"3 um"\nstart = ["2 um"]') + MEASURED,
        "damping.modal: expected a number such as"),
    (PARAMETER + MEASURED.replace("energy", "heat"), "of: expected one of open frequency, stuck frequency, "),
    (PARAMETER + MEASURED.replace('at = "290 Hz"\n', ""), 'expected at for of = "energy"'),
    (PARAMETER + MEASURED + "left = 0.5\n", 'expected no left for of = "energy"'),
    (PARAMETER + MEASURED.replace("1 mJ", "1 N"), "measured.e.value: expected an energy"),
    (PARAMETER + MEASURED.replace("1 mJ", "-1 mJ"), "measured numbers above 0"),
])  # fmt: skip
def test_a_bad_file_is_one_sentence_and_exit_code_2(text, words, tmp_path, capsys):
    (tmp_path / "fit.toml").write_text(text, encoding="utf-8")
    arguments = ["study", "identify", "rig", str(tmp_path / "fit.toml"), *(w for o in RIG for w in ("--set", o))]
    sentence = refusal(arguments, capsys)
    assert sentence.startswith("tribodyn: ")
    assert words in sentence


def test_a_life_without_wear_and_a_run_that_stops_early_are_told():
    life = {"life": MeasuredTarget(of="life", left=0.1, value=1e6)}
    with pytest.raises(ValueError, match=r"the scene has no \[wear\]"):
        predict(scene_file.read("beam", (*BEAM, "wear=")), life)
    with pytest.raises(SolveFailed, match=r"measured.life: the preload did not fall to 0.1 .* stopped"):
        predict(scene_file.read("beam", (*BEAM, "wear.max_steps=1")), life)


def test_the_file_that_comes_with_the_program_is_sound_and_the_command_prints(tmp_path, capsys):
    task = fit_file.read(scene_file.CASES / "rig" / "rig.fit.toml")
    assert set(task.parameters) == {"mating_height", "damping"}
    (shown,) = (fence.text for fence in fences(ROOT / "docs/howto/identify.md") if fence.word == "rig.fit.toml")
    assert fit_file.read(tomllib.loads(shown)) == task
    (tmp_path / "fit.toml").write_text(PARAMETER + MEASURED, encoding="utf-8")
    words = ["study", "identify", "rig", str(tmp_path / "fit.toml"), *(w for o in RIG for w in ("--set", o))]
    record = printed_record([*words, "--json"], capsys)
    assert record["set"][0].startswith("damping.modal=")
    assert record["numbers"][0]["measured"] == 1e-3


def test_friction_is_found_again_from_a_measured_curve(tmp_path):
    """A response of the scene with other friction, seen as accelerations with their phase; a file with other runs."""
    base = ("beam_thesis", (*BEAM, "harmonics.kept=[0, 1]", "response.points=10", "response.frequency=[700, 1300]"))
    true = td.run(base[0], overrides=(*base[1], "contact.friction=0.38", "wear=", "verdict.enabled=false")).response
    w, x = true.omega, true.response[:, 0, 1] - 1j * true.response[:, 0, 2]
    columns = {"frequency_Hz": w / (2 * np.pi), "acceleration_m_s2": w**2 * np.abs(x), "control": ["force"] * len(w)}
    write_columns({**columns, "phase_deg": np.degrees(np.angle(-x))}, tmp_path / "sweep.csv")
    friction = {"keys": ["contact.friction"], "low": 0.2, "high": 0.8}
    task = {"parameters": {"mu": friction}, "curves": {"sweep": {"file": str(tmp_path / "sweep.csv"), "error": "5 %"}}}
    computed = td.studies.identify(base[0], task, overrides=base[1]).identification
    assert computed.values == pytest.approx([0.38], rel=1e-3)
    assert computed.rms < 1e-3
    assert len(computed.measured) == 2 * len(w)
    assert computed.after[len(w) :] == pytest.approx(np.ones(len(w)), abs=1e-3)  # phases
    assert np.abs(computed.before[len(w) :] - 1).max() > 0.01
    assert computed.measured[0].weight == pytest.approx(0.2)
    task["curves"]["sweep"]["control"] = "response"
    with pytest.raises(td.SceneError, match=r"curves\.sweep: no run has control = response"):
        td.studies.identify(base[0], task, overrides=base[1])


def test_residual_flexibility_is_that_beside_the_springs_of_each_trial():
    """What a reduction without masters leaves out depends on the contact springs; a trial with others has its own."""
    base = (*BEAM, "harmonics.kept=[0, 1]", "reduction.method=residual_flexibility")
    rows = []
    for stiffness in ("470 N/um", "200 N/um"):
        file = scene_file.read("beam_thesis", (*base, f"contact.tangential_stiffness={stiffness}"))
        rows.append(plain(file).residual.stiffness)
        own_part = modelling.part_of(file, Progress())
        fresh = modelling.plain_model(file.mesh_scene, own_part)
        np.testing.assert_array_equal(rows[-1], fresh.residual.stiffness)
    assert not np.array_equal(*rows)


def test_a_joint_of_several_bodies_is_found_again_from_a_measured_curve(tmp_path):
    """The stiffness of a stuck joint; the faces open by a map, which the trials have as a run has it."""
    rows = [f"{x},{y},0.01,{2e-9 * (x > 0.08)}" for x in (0.05, 0.07, 0.09, 0.1) for y in (0.0, 0.02)]
    (tmp_path / "open.csv").write_text("\n".join(rows), encoding="utf-8")
    scene = tmp_path / "blocks.toml"
    scene.write_text(BLOCKS.replace('t1 = "x"', 't1 = "x"\ngap_map = "open.csv"'), encoding="utf-8")
    base = ("harmonics.kept=[0, 1]", "harmonics.samples=32", "response.points=6")
    true = td.run(
        scene, overrides=(*base, "contacts.lap.tangential_stiffness=130 N/um", "verdict.enabled=false")
    ).response
    w, x = true.omega, true.response[:, 0, 1] - 1j * true.response[:, 0, 2]
    columns = {"frequency_Hz": w / (2 * np.pi), "acceleration_m_s2": w**2 * np.abs(x), "control": ["force"] * len(w)}
    write_columns(columns, tmp_path / "sweep.csv")
    task = {
        "parameters": {"kt": {"keys": ["contacts.lap.tangential_stiffness"], "low": "60 N/um", "high": "200 N/um"}},
        "curves": {"sweep": {"file": str(tmp_path / "sweep.csv")}},
    }
    computed = td.studies.identify(scene, task, overrides=base).identification
    assert computed.values == pytest.approx([130e6], rel=1e-3)
    assert computed.rms < 1e-3
    file = scene_file.read(scene, base)
    opened = modelling.build(file, Progress()).reduced.interface.gap
    np.testing.assert_allclose(plain(file).interface.gap, opened, rtol=0, atol=1e-20)
    assert np.ptp(opened) > 1e-9
    assert scene_fit.value_of(file.mesh_scene, "bodies.lower.length") == pytest.approx(0.1)


def test_errors_that_are_given_go_before_those_of_a_curve():
    """A resonance has the standard errors of its fit, which say nothing of what a model leaves out."""
    at, none = np.ones(1), np.full(1, np.nan)
    run = Run("1", "force", 80 * at, 1e-4 * at + 0j, none, 2e-3 * at, np.array([[1e-5, 1e-2]]))
    measured: Any = SimpleNamespace(kind="backbone", runs=(run,))
    for inputs, errors in (
        ({}, [1e-5, 1e-2]),
        ({"error": 0.15}, [1e-5, 0.15]),
        ({"frequency_error": 3e-3}, [3e-3, 1e-2]),
    ):
        numbers = CurveTarget("curve", Curve.model_validate({"file": "a.csv", **inputs}), measured).numbers()
        assert [FULL / number.weight for number in numbers] == pytest.approx(errors)
