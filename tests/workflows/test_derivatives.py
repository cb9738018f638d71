"""tribodyn study derivatives: exact laws of scaling, scenes solved again, and what cannot be."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.coarse_scenes import BEAM, BLADE, RIG
from tests.helpers.command import refusal
from tests.helpers.steps_again import elasticity_anew, exactly
from tribodyn.hbm.derivatives import cycle_derivatives
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.threads import limited
from tribodyn.hbm.wear import tangent
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import references, settings, wear_run
from tribodyn.workflows.run.parameter_variation import ParameterVariation
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.scene_numbers import geometry_keys, keys, with_value
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.derivatives_at_points import of_summary

LOCATED = "harmonics.transitions=located"
COARSE = {
    "beam": (*BEAM, "geometry.n_patch=5", "response.method=adaptive", LOCATED),
    "blade": (*BLADE, "response.method=adaptive"),
    "rig": (*RIG, LOCATED),
}
OVER = 'over="temperature", at=["0 K", "200 K", "400 K"], values='
HOT = (f"contact.friction={{{OVER}[0.5, 0.45, 0.3]}}", "contact.tangential_stiffness="
       f'{{{OVER}["470 N/um", "440 N/um", "350 N/um"]}}')  # fmt: skip
HOT_BEAM = (*COARSE["beam"], "wear=", *HOT)
COARSE["warmed beam"] = (*HOT_BEAM, 'loads.static.hot={temperature="150 K"}', "material.expansion='1e-5 1/K'")
AT_800_HZ = (*BEAM, "wear.motion=balance", "wear.at=800 Hz", LOCATED)


@pytest.fixture(scope="module")
def beam():
    return td.studies.derivatives("beam", overrides=COARSE["beam"])


def test_the_laws_of_scaling_hold(beam):
    """Of a contact of Jenkins elements without gap: all loads times c are all displacements times c.

    All mass times c, damping as a ratio, is all time times sqrt(c); all stiffness times c, loads too, time over sqrt(c)
    """
    rows, names = beam.elasticities, beam.derivatives.names
    expected = {"peak_frequency": 0.0, "amplitude": 1.0, "rms": 1.0, "phase": 0.0, "energy": 2.0, "preload": 1.0}
    expected["wear_rate"] = 2.0
    loads = sum(row for key, row in rows.items() if key.startswith("loads."))
    np.testing.assert_allclose(loads, [expected[name] for name in names], atol=2e-6)
    heavier = [-0.5 if name == "peak_frequency" else 0.0 for name in names]
    np.testing.assert_allclose(rows["material.density"], heavier, atol=1e-6)
    stiffer = sum(row for key, row in rows.items() if key.endswith(("_stiffness", "young")))
    softens = {"peak_frequency": 0.5, "amplitude": -1.0, "rms": -1.0, "energy": -1.0, "wear_rate": -1.0}
    np.testing.assert_allclose(stiffer, [softens.get(name, 0.0) for name in names], atol=1e-5)


LENGTHS = tuple(f"geometry.{name}" for name in ("length", "width", "height", "patch_length"))


def similar(rows, lengths, rest):
    """What all lengths times c make, with springs by c, forces by c^2 and what `rest` says."""
    powers = dict.fromkeys(lengths, 1) | {key: 1 for key in rows if key.endswith("_stiffness")}
    powers |= {key: 2 for key in rows if key.startswith("loads.")} | rest
    return sum(power * rows[key] for key, power in powers.items())


def test_the_law_of_similarity_holds_of_lengths():
    """Bodies that are alike have time and displacements by c, work by c^3, forces by c^2."""
    file = scene_file.read("beam", COARSE["beam"])
    computed = td.studies.derivatives(file, only=(*keys(file.scene), *LENGTHS))
    expected = {"peak_frequency": -1.0, "amplitude": 1.0, "rms": 1.0, "phase": 0.0, "energy": 3.0, "preload": 2.0}
    expected["wear_rate"] = 3.0
    total = similar(computed.elasticities, LENGTHS, {})
    np.testing.assert_allclose(total, [expected[name] for name in computed.derivatives.names], atol=2e-6)


@pytest.mark.slow
def test_rows_of_studies_go_by_lengths_whose_mesh_stays_the_same(monkeypatch):
    """One that the mesh does not follow takes nothing from the others."""
    without = (*COARSE["beam"], "wear=", "verdict.enabled=false")
    file, shifted = scene_file.read("beam", without), ParameterVariation.nodes_moved

    def refused(self, key):
        if key == "geometry.height":
            raise NoDerivative("another mesh")
        return shifted(self, key)

    monkeypatch.setattr(ParameterVariation, "nodes_moved", refused)
    expected = ["geometry.length", "geometry.height", "contact.friction"]
    result = of_summary(ParameterVariation(file, Progress()), td.run("beam", overrides=without), expected)
    assert {key for _, key in result} == {"geometry.length", "contact.friction"}
    path = td.studies.derivatives(file, only=("geometry.length",)).derivatives
    assert result["peak_frequency_first", "geometry.length"] == pytest.approx(path.slopes[0, 0], rel=1e-6)


@pytest.mark.slow
def test_the_law_of_similarity_holds_of_a_life():
    """At a given frequency, which takes the density by 1 / c^2: c times as deep in the same life."""
    file = scene_file.read("beam", AT_800_HZ)
    computed = td.studies.derivatives(file, of="life", only=(*keys(file.scene), *LENGTHS))
    total = similar(computed.elasticities, LENGTHS, {"material.density": -2})
    np.testing.assert_allclose(total, [0.0, 1.0, 3.0], atol=2e-5)


@pytest.mark.parametrize(("name", "change", "key", "sentence"), [
    ("beam", "geometry.patch_length=99.9999 mm", "geometry.patch_length", "keep it below half of geometry.length"),
    pytest.param("rig", LOCATED, "geometry.contact_width", "what meets at the contact", marks=pytest.mark.slow),
])  # fmt: skip
def test_a_length_whose_mesh_does_not_stay_the_same_is_refused(name, change, key, sentence):
    """Beside a limit there is no part; heights of a measured face are other ones where its nodes move."""
    varying = ParameterVariation(scene_file.read(name, (*COARSE[name], change)), Progress())
    with pytest.raises(NoDerivative, match=sentence):
        varying.nodes_moved(key)


def test_a_response_that_is_highest_at_an_end_has_no_derivatives_of_a_peak():
    with pytest.raises(SolveFailed, match="the response is highest at an end"):
        td.studies.derivatives("beam", overrides=(*COARSE["beam"], "response.frequency=['380 Hz', '500 Hz']"))


@pytest.mark.parametrize("name", scene_file.names())
def test_a_scene_with_another_value_is_the_one_that_would_be_read(name):
    file = scene_file.read(name)
    for key, value in keys(file.scene).items():
        other = 1.01 * value
        changed = file.changed(f"{key}={other!r}").scene
        assert with_value(file.scene, key.split("."), other) == changed, key


@pytest.mark.slow
@pytest.mark.parametrize("modes", ["6", "30"])
def test_the_law_of_scaling_holds_of_springs_that_the_reduction_follows(modes):
    """All stiffness times c and the force that shakes: at the same displacements time goes by 1 / sqrt(c)."""
    computed = td.studies.derivatives("rig", overrides=(*COARSE["rig"], f"reduction.modes={modes}"))
    rows = computed.elasticities
    total = sum(row for key, row in rows.items() if key.endswith((".stiffness", ".young", "shaker.value")))
    expected = {"peak_frequency": 0.5, "energy": 1.0, "preload": 1.0, "wear_rate": 1.0}
    np.testing.assert_allclose(total, [expected.get(name, 0.0) for name in computed.derivatives.names], atol=1e-5)


def test_it_is_told_in_words_numbers_and_a_picture(beam, tmp_path):
    assert beam.seconds > 0
    lines = beam.lines()
    assert any("contact.friction" in line for line in lines)
    record = json.loads(json.dumps(beam.record()))
    friction = record["derivatives"]["contact.friction"]["amplitude"]
    ratio = friction * 0.5 / record["quantities"]["amplitude"]
    assert record["elasticities"]["contact.friction"]["amplitude"] == pytest.approx(ratio)
    assert all(path.stat().st_size > 0 for path in beam.write(tmp_path))
    names = (beam.derivatives.names[0], "life", *beam.derivatives.names[2:])
    marked = replace(beam.derivatives, names=names, corner=np.ones_like(beam.derivatives.corner))
    assert sum("the table is that of one side" in line for line in replace(beam, derivatives=marked).lines()) == 1


@pytest.mark.parametrize(("name", "only", "step", "order"), [
    ("beam", ("contact.friction", "damping.modal"), 1e-4, 1),
    ("blade", ("contact.friction", "damping.modal"), 2e-5, 1),
    ("warmed beam", ("loads.static.hot.temperature",), 1e-4, 1),
    pytest.param("rig", ("contact.friction", "damping.modal"), 2e-5, 1, marks=pytest.mark.slow),
    pytest.param("beam", ("geometry.length", "geometry.height"), 1e-4, 2, marks=pytest.mark.slow),
    pytest.param("blade", ("geometry.span", "geometry.shroud_angle"), 3e-5, 1, marks=pytest.mark.slow),
    pytest.param("rig", ("geometry.height", "geometry.thickness"), 1e-3, 2, marks=pytest.mark.slow),
])  # fmt: skip
def test_derivatives_of_a_scene_are_those_of_scenes_solved_again(name, only, step, order):
    """At a fixed frequency, and along the peak."""
    file = scene_file.read(name.split()[-1], COARSE[name])
    path = td.studies.derivatives(file, only=only).derivatives
    value, omega = keys(file.scene) | geometry_keys(file.scene), path.state.omega
    fixed = td.studies.derivatives(file, at=omega / (2 * np.pi), only=path.parameters).derivatives

    def solved(key, factor):
        with limited(1):
            balance = ParameterVariation(file.changed(f"{key}={value[key] * factor!r}"), Progress()).model.balance
            refined = cycle_derivatives.at_frequency(balance, fixed.state, "response", ())
            return refined.values, cycle_derivatives.at_peak(balance, path.state, "response", ()).values

    floor = 0.2 if "geometry.shroud_angle" in only else 0.1  # below it differences are rounding; of this one, 3e-6
    for i, key in enumerate(path.parameters):
        sides = {factor: solved(key, factor) for factor in (1 + step, 1 - step, 1 + step / 2, 1 - step / 2)}
        for selection, result, error in ((0, fixed, 1e-5), (1, path, 1e-5)):
            wide, narrow = ((sides[1 + h][selection] - sides[1 - h][selection]) / (2 * h) for h in (step, step / 2))
            count = len(wide)  # all but the wear rate
            # second derivatives jump where a transition comes or goes: by small steps the error is linear in them
            difference = (2**order * narrow - wide) / (2**order - 1) / result.values[:count]
            elasticity = result.slopes[:count, i] * value[key] / result.values[:count]
            size = np.maximum(np.abs(difference), floor)
            assert (np.abs(elasticity - difference) <= error * size).all(), (key, elasticity, difference)


def test_a_temperature_acts_through_the_numbers_of_its_table():
    computed = td.studies.derivatives("beam", overrides=(*HOT_BEAM, "contact.temperature=150 K"))
    rows, value = computed.elasticities, computed.at
    parts = {"contact.friction": -0.05 / 200, "contact.tangential_stiffness": -30e6 / 200}
    chain = sum(slope * 150 / value[key] * rows[key] for key, slope in parts.items())
    np.testing.assert_allclose(rows["contact.temperature"], chain, atol=2e-6)


def test_at_a_row_of_its_table_a_temperature_has_two_derivatives():
    """By the slopes of the table above the row and below it; all other keys keep theirs."""
    at_row = td.studies.derivatives("beam", overrides=(*HOT_BEAM, "contact.temperature=200 K"))
    computed = at_row.derivatives
    i, amplitude = computed.parameters.index("contact.temperature"), computed.names.index("amplitude")
    assert at_row.corners == ("contact.temperature",)
    for side, friction, stiffness in ((computed.above, -0.15, -90e6), (computed.below, -0.05, -30e6)):
        parts = {"contact.friction": friction, "contact.tangential_stiffness": stiffness}
        chain = sum(slope * side[amplitude, computed.parameters.index(key)] for key, slope in parts.items())
        assert side[amplitude, i] * 200 == pytest.approx(chain, rel=1e-5)
    assert {"material.young", "contact.friction"} <= at_row.at.keys()


def test_at_the_end_of_its_table_a_temperature_has_no_derivative():
    overrides = (*HOT_BEAM, "contact.temperature=400 K")
    computed = td.studies.derivatives("beam", overrides=overrides)
    assert "contact.friction" in computed.at
    assert "contact.temperature" not in computed.at
    assert any("without contact.temperature" in line and "extend it" in line for line in computed.lines())
    with pytest.raises(ValueError, match="extend it"):
        td.studies.derivatives("beam", overrides=overrides, only=("contact.temperature",))


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "overrides"), [("beam", AT_800_HZ), ("blade", BLADE)], ids=["beam", "blade"])
def test_the_laws_of_scaling_hold_for_a_life(scene, overrides):
    """All loads times c: c times as deep in a life over c. All stiffness and mass times c: over c as deep, as long."""
    computed = td.studies.derivatives(scene, of="life", overrides=overrides)
    rows = computed.elasticities
    loads = sum(row for key, row in rows.items() if key.startswith("loads."))
    body = sum(row for key, row in rows.items() if key.endswith(("stiffness", "young", "density")))
    np.testing.assert_allclose([loads, body], [[-1, 1, 1], [0, -1, -1]], atol=2e-5)
    np.testing.assert_allclose(rows["wear.coefficient"], [-1, 0, 0], atol=1e-9)
    assert computed.lines()[0].startswith("life ")


@pytest.mark.slow
@pytest.mark.parametrize(("site", "changes"), [
    ({}, ("wear.at=200 Hz", "wear.motion=balance", "loads.harmonic.wave.value=20 kN")),
    ({"tolerance": 1e-6}, ("damping.modal=3 %",)),
], ids=["frequency", "peak"])  # fmt: skip
def test_derivatives_of_the_blades_life_are_those_of_its_steps_taken_again(site, changes):
    file, key, share = scene_file.read("blade", (*BLADE, *changes)), "contact.friction", 0.3

    def varying(factor=1.0):
        return ParameterVariation(file.changed(f"{key}={0.5 * factor!r}"), Progress())

    def problem_of(factor):
        return exactly(wear_run.wear_problem(file.scene, varying(factor).model.balance, share), **site)

    with limited(1):
        base, problem = varying(), problem_of(1.0)
        scale = settings.depth_scale(file.scene, references.free_deflection(base.model.balance), problem.area)
        worn = evolve(wear_run.rule_of(file.scene, problem, scale), file.scene.wear.max_steps)
        result = tangent.of_life(problem, worn, [base.change(key, 0.5)], {}, share)
        elasticity = result.slopes[:, 0] * 0.5 / result.values
        difference = elasticity_anew(worn, share, problem_of, elasticity[0])
    np.testing.assert_allclose(elasticity, difference, rtol=1e-5, atol=5e-6)


@pytest.mark.parametrize(("words", "sentence"), [
    (("--of", "life", "--set", "wear.at=800 Hz", "--at", "1 Hz"), "--at is a frequency of --of response"),
    (("--only", "contact.color"), "contact.color is no number that a response depends on"),
])  # fmt: skip
def test_what_is_missing_is_one_sentence(capsys, words, sentence):
    assert sentence in refusal(["study", "derivatives", "beam", *words], capsys)


def test_quantities_of_a_call_have_units_as_on_the_command_line():
    with pytest.raises(ValueError, match="expected a frequency"):
        td.studies.derivatives("beam", at="20 um")
