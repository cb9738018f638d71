"""Scenes: what is wrong is one sentence that names the key; conversions happen once."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tribodyn.workflows.run import planning, settings
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError, read
from tribodyn.workflows.scene.scene_values import unusual_values

WRONG = {
    "contact.normal_stifness=3": ["unknown key contact.normal_stifness", "did you mean normal_stiffness?", "friction"],
    "contact.normal_stiffness=-5 N/um": ["contact.normal_stiffness", "above 0", "-5 N/um"],
    "contact.friction=20 mm": ["contact.friction", "a number", "which is a length"],
    "contact.t1=k": ["contact.t1", "axis"],
    "contact.t1=[0,0,0]": ["contact.t1", "not all zero"],
    'contact.components=["t1","q"]': ["contact.components[1]", "'t2'", "'q'"],
    "contact=": ["contact is missing"],
    "material=": ["material is missing"],
    "loads.static.press.valu=3": ["unknown key loads.static.press.valu", "did you mean value?"],
    "loads.harmonic.shake.value=10 mm": ["loads.harmonic.shake.value", "a force"],
    "loads.harmonic={}": ["loads", "at least one harmonic load"],
    "wear.step=0": ["wear.step", "above 0"],
    "wear.step=5 N": ["wear.step", "share of delta_max"],
    "wear.at=somewhere": ["wear.at", '"peak"'],
    "wear.at=1e9 Hz": ["wear.at", "below 1e+08"],
    "wear.at=3 mm of peak": ["wear.at", '"98 % of peak"'],
    'wear={law="energy", coefficient="2e3 um3/J"}': ["wear", "step", "thesis"],
    "wear.rule=guess": ["wear.rule", "'thesis'"],
    "wear.max_steps=-1": ["wear.max_steps", "at least 0"],
    "harmonics.kept=[0, 3.5]": ["harmonics.kept[1]", "whole number"],
    "harmonics.kept=[0]": ["harmonics", "rising harmonic numbers"],
    "harmonics.samples=2": ["harmonics.samples", "at least 4"],
    "reduction.cutoff=3 kHz": ["reduction", "either modes", "cutoff"],
    "response.frequency=[600, 300]": ["response", "low below high"],
    "response.frequency=300 Hz": ["response.frequency", "a list"],
    "response.options.points=9": ["unknown key response.options.points", "did you mean n_points?", "refinements"],
    "response.options.refinements=2.5": ["response.options.refinements", "whole number"],
    "response.options.n_points=1": ["response.options.n_points", "at least 2"],
    'response={group="response",direction="y",frequency=[1,2],method="arc_length",options={angle="3 mm"}}': [
        "response.options.angle",
        "an angle",
    ],
    "solver.tolerance=0": ["solver.tolerance", "above 0"],
    "damping.mass=1 1/s": ["damping", "either modal"],
    "scene.title=3": ["scene.title", "a text in quotes"],
    "geometry=3": ["geometry", "a table"],
    "geometry.lenght=1": ["unknown key geometry.lenght", "did you mean length?"],
    "geometry.n_patch=12": ["geometry.n_patch", "odd"],
    "geometry.length=20 N": ["geometry.length", "a length"],
    "geometry.part=bim": ["no part 'bim'", "beam"],
    "geometry.part=": ["geometry", 'mesh = "file.msh"'],
    "foo.bar=3": ["unknown key foo", "geometry", "wear"],
    "pictures.plots=1": ["pictures.plots", "true or false"],
}


@pytest.mark.parametrize("override", WRONG)
def test_wrong_scene_is_one_sentence_with_its_key(override: str) -> None:
    with pytest.raises(SceneError) as caught:
        read("beam", [override])
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.startswith("beam.toml: ")
    for word in WRONG[override]:
        assert word in sentence


UNUSUAL = {
    "material.young=210 MPa": "material.young = 2.1e+08 Pa is unusual (1e+09 to 1.3e+12 Pa): check it and its unit",
    "material.poisson=-0.9": "material.poisson = -0.9 is unusual (0 to 0.5)",
    "material.density=7.86": "material.density = 7.86 kg/m3 is unusual",
    "contact.friction=50": "contact.friction = 50 is unusual (0 to 1.5)",
    "wear.coefficient=2e3": "wear.coefficient = 2000 m3/J is unusual",
    "wear.at=2 MHz": "wear.at.frequency = 2e+06 Hz is unusual",
    "damping.modal=50 %": "damping.modal = 0.5 is unusual (0 to 0.2)",
    "loads.static.press.value=20 GN": "loads.static.press.value = 2e+10 N is unusual",
}


@pytest.mark.parametrize("override", UNUSUAL)
def test_an_unusual_number_is_noted_with_its_key(override: str) -> None:
    (note,) = unusual_values(read("beam", [override]).scene)
    assert note.startswith(UNUSUAL[override])


@pytest.mark.parametrize("name", scene_file.names())
def test_the_shipped_scenes_have_usual_numbers(name: str) -> None:
    assert unusual_values(read(name).scene) == []


@pytest.mark.parametrize("override", ["x", "=3", "a.=3"])
def test_override_needs_key_and_value(override: str) -> None:
    with pytest.raises(SceneError, match=r"--set expects section\.key=value"):
        read("beam", [override])


def test_no_such_scene_lists_those_there_are() -> None:
    with pytest.raises(SceneError, match="the scenes are beam"):
        read("bim")
    with pytest.raises(SceneError, match=r'no scene file "nowhere/bim\.toml"'):
        read("nowhere/bim.toml")


def test_broken_toml_says_where(tmp_path) -> None:
    path = tmp_path / "broken.toml"
    for text, words in (("[scene\n", "line 1"), ("x = " + "[" * 9999, "recursion"), ("x = " + "9" * 9999, "digits")):
        path.write_text(text)
        with pytest.raises(SceneError, match=rf"broken\.toml is not valid TOML.*{words}"):
            read(str(path))


def test_values_arrive_in_si_units() -> None:
    scene = read("beam").scene
    assert scene.loads.static["press"].value == 20e3
    assert scene.loads.static["press"].direction == (0.0, 0.0, -1.0)
    assert scene.contact.tangential_stiffness == 470e6
    assert scene.contact.normal_stiffness == 583e6
    assert scene.geometry.parameters["length"] == 0.2
    assert scene.geometry.parameters["n_patch"] == 7
    assert read("beam_thesis").scene.geometry.parameters["n_patch"] == 13
    assert scene.wear.numbers["coefficient"] == 2e-15
    assert scene.wear.step.share == 0.1


def test_overrides_change_add_and_take_out() -> None:
    scene = read("beam", ["reduction.modes=", "reduction.cutoff=5 kHz", "wear.step=50 um", "wear.at=430 Hz"]).scene
    assert scene.reduction.modes is None
    assert scene.reduction.cutoff == 5e3
    assert scene.wear.step.depth == 50e-6
    assert scene.wear.at.frequency == 430.0
    wear = read("beam", ["wear.at=98 % of peak"]).scene.wear
    assert wear.at.peak == 0.98


def test_a_mission_shares_its_cycles_out() -> None:
    mission = 'wear.mission=[{at = "peak", share = "60 %"}, {at = "400 Hz", share = 0.4, load = "50 %"}]'
    wear = read("beam", ["wear.at=", mission]).scene.wear
    assert [duty.share for duty in wear.mission] == [0.6, 0.4]
    assert wear.mission[1].load == 0.5
    with pytest.raises(SceneError, match="either at or mission"):
        read("beam", [mission])
    with pytest.raises(SceneError, match=r"sum to 1, got 0\.9"):
        read("beam", ["wear.at=", mission.replace("60", "50")])


def test_a_sweep_takes_its_cycles_in_proportion_to_the_frequency() -> None:
    wear = read("beam", ["wear.at=400 Hz to 800 Hz in 4"]).scene.wear
    assert [duty.at.frequency for duty in wear.duties] == [450.0, 550.0, 650.0, 750.0]
    assert [duty.share for duty in wear.duties] == pytest.approx([f / 2400 for f in (450, 550, 650, 750)])
    equal = read("beam", ['wear.at={start = "400 Hz", stop = "0.8 kHz", points = 4}']).scene.wear
    assert equal.duties == wear.duties
    outside = read("beam", ["wear.at=1 kHz to 5 kHz in 4"]).scene
    assert settings.highest_frequency(outside) == 2 * np.pi * 4500
    assert settings.highest_frequency(read("beam").scene) == settings.response_range(outside)[1]
    item = read("beam", ["wear.at=410 Hz"]).scene.wear
    assert [duty.share for duty in item.duties] == [1.0]
    for wrong in ("800 Hz to 400 Hz", "400 Hz to much", "400 Hz to 800 Hz in few", "400 Hz to 800 Hz in 1"):
        with pytest.raises(SceneError):
            read("beam", [f"wear.at={wrong}"])


@pytest.mark.parametrize("name", scene_file.names())
def test_every_scene_reads_and_survives_json(name: str) -> None:
    scene = read(name).scene
    assert type(scene).model_validate_json(scene.model_dump_json()) == scene
    assert scene_file.title(name) == scene.scene.title


@pytest.mark.parametrize(("scene", "override", "sentence"), [
    ("beam", "wear.at={}", "wear.at: expected either frequency or peak"),
    ("blade", "contact.group=[]", "contact.group: expected a longer list"),
    ("beam", "response.points=1000000", "response.points: expected a value at most 20000"),
    ("beam", "material.young=1e-300", "got 1e-300: give 0, or more than 1e-60"),
    ("beam", "contact.normal_stiffness=1e-300", "got 1e-300: give 0, or more than 1e-60"),
    ("beam", 'damping.modal="1e-300 %"', 'got "1e-300 %": give 0, or more than 1e-60'),
])  # fmt: skip
def test_what_fuzz_has_found_is_refused(scene: str, override: str, sentence: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene_file.read(scene, [override])
    assert sentence in str(caught.value)


def test_the_scene_of_a_result_of_another_version_is_refused_in_one_sentence() -> None:
    record = json.loads(read("beam").scene.model_dump_json())
    assert scene_file.from_json(json.dumps(record)) == read("beam").scene
    with pytest.raises(SceneError, match=r"of another version of tribodyn \(.*colour\): run it again"):
        scene_file.from_json(json.dumps(record | {"colour": 1}))


def test_a_plan_of_a_mesh_that_is_too_large_is_extrapolated(monkeypatch: pytest.MonkeyPatch) -> None:
    file = scene_file.read("beam", ("geometry.n_patch=41", "geometry.n_length=60"))
    measured = planning.plan(file)
    monkeypatch.setattr(planning, "COSTS", replace(planning.COSTS, largest=800.0))
    estimated = planning.plan(file)
    assert not measured.remarks
    assert "extrapolated from two coarser ones" in estimated.remarks[0]
    for name in ("elements", "nodes", "full_dofs", "contact_pairs"):
        assert getattr(estimated, name) == pytest.approx(getattr(measured, name), rel=0.4), name
