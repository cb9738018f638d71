"""Stress in a scene: at places, by gauges, anywhere; its margin, error, derivatives, files and pictures."""

from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.small_decks import ENDING, Shape, bricks
from tribodyn.fem.stress import nodal_stress
from tribodyn.hbm import newton
from tribodyn.hbm.fatigue import largest_von_mises, over_cycle, utilisation, von_mises
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import integrate
from tribodyn.refusal import Refusal
from tribodyn.workflows.export.vtk import part_grid
from tribodyn.workflows.pictures import plots, render
from tribodyn.workflows.report import text
from tribodyn.workflows.result.contact_states import shown_states
from tribodyn.workflows.result.verdict import Status
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

SCENE = """
[geometry]
part = "block"
length = "60 mm"
width = "10 mm"
height = "8 mm"
n_length = 4
n_width = 2
n_height = 2
fixed = ["x_min"]
[material]
young = "210 GPa"
density = "7860 kg/m3"
expansion = "12e-6 1/K"
[contact]
group = "z_min"
t1 = "x"
law = "jenkins"
friction = 0.3
normal_stiffness = "10 N/um"
tangential_stiffness = "5 N/um"
[loads.static.press]
group = "z_max"
pressure = "0.05 MPa"
[loads.static.warm]
temperature = "5 K"
[loads.harmonic.pull]
group = "x_max"
direction = "y"
value = "20 N"
[response]
frequency = ["1.8 kHz", "2.6 kHz"]
points = 20
[harmonics]
kept = [0, 1, 3]
samples = 128
[damping]
modal = "1 %"
[reduction]
modes = 8
[stress.places.root]
point = ["15 mm", "10 mm", "4 mm"]
[stress.places.middle]
point = ["33 mm", "10 mm", "3 mm"]
[gauges.side]
point = ["15 mm", "10 mm", "4 mm"]
direction = "x"
length = "1 mm"
[fatigue.material]
endurance_limit = "250 MPa"
strength = "600 MPa"
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stress") / "bar.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def run(path: Path) -> td.Result:
    return td.run(path, path.parent / "out", overrides=("verdict.in_time=false",))


def test_places_have_the_stress_of_the_field(run: td.Result, path: Path) -> None:
    """Stress at a node, its strain by the gauge there and the largest of the part follow from the full displacement."""
    model = modelling.build(scene_file.read(path), Progress())
    best = int(np.argmax(run.response.height("response")))
    balance, part = model.balance, model.part
    state = balance.evaluate(run.response.omega[best], balance.shaped(run.response.contact[best]))
    u = part.field(full_displacement(balance, state.flat, state.cycle.force.reshape(state.flat.shape), state.omega))
    heat = np.full(len(u), 5.0)
    field = nodal_stress(part.mesh, modelling.part_reduction.material(scene_file.read(path).mesh_scene), u, heat)
    node = int(np.linalg.norm(part.points - [0.015, 0.01, 0.004], axis=1).argmin())
    place = balance.places[0].stress(balance.outputs(state), balance.basis)
    np.testing.assert_allclose(place, field.tensor[node], atol=1e-9 * np.abs(place).max())
    summary = run.summary()
    largest = largest_von_mises(field.tensor, balance.basis)
    assert summary["largest_stress"]["first"] == pytest.approx(largest.max(), rel=2e-3)
    assert summary["stress"]["first"] == pytest.approx(largest[node], rel=1e-9)
    xx, yy, xy = over_cycle(field.tensor[part.points[:, 2] == 0], balance.basis)[..., [0, 1, 5]].T
    principal = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    assert summary["contact_tension"]["first"] == pytest.approx(principal.max(), rel=2e-3)
    strain = run.response.response[best, run.response.output_names.index("gauge side")]
    slope = field.tensor[node] / 210e9
    expected = slope[0] - 0.3 * (slope[1] + slope[2])
    expected[0] += 12e-6 * 5.0
    np.testing.assert_allclose(strain, expected, atol=0.03 * np.abs(expected).max())


@pytest.mark.parametrize(("change", "off"), [("method=residual_flexibility", 2e-3), ("interface_modes=60", 0.05)])
def test_other_reductions_have_the_same_stress(run: td.Result, path: Path, change: str, off: float) -> None:
    """That of the contact DOFs as they are, though a pair lies on the clamp and has no traction."""
    best = int(np.argmax(run.response.height("response")))
    balance = modelling.build(scene_file.read(path, (f"reduction.{change}",)), Progress(), run.harmonics).balance
    state = newton.solve_from_rest(balance, run.response.omega[best]).state
    rows = [balance.compliance.output_names.index(name) for name in run.response.output_names]
    stress, exact = balance.outputs(state)[rows], run.response.response[best]
    for place in run.facts.places:
        a, b = stress[place.rows], exact[place.rows]
        np.testing.assert_allclose(a, b, atol=off * np.abs(b).max())


def test_errors_margins_and_words(run: td.Result) -> None:
    stated = run.verdict.statements
    assert stated["stress"].stated
    assert stated["utilisation"].stated
    for name in ("largest_stress", "largest_utilisation"):
        assert stated[name].status == Status.UNBOUNDED
        assert "is at the border of a clamp" in stated[name].reason
    assert any("every finer mesh at hot spot 1 (the border of a clamp)" in words for words in text.warnings(run))
    summary = run.summary()
    assert 0 < summary["utilisation"]["first"] <= summary["largest_utilisation"]["first"]
    assert run.stress_field.spot.shape[1] == 3
    lines = "\n".join(text.brief(run))
    assert "largest stress" in lines
    assert "MPa" in lines


def test_it_is_kept_and_drawn(run: td.Result, path: Path) -> None:
    loaded = td.load(path.parent / "out")
    assert loaded.facts.places == run.facts.places
    np.testing.assert_array_equal(loaded.stress_field.largest, run.stress_field.largest)
    assert loaded.summary()["stress"] == run.summary()["stress"]
    figure = render.figures(loaded)["stress"]()
    assert len(figure.axes) >= 2 * len(run.stress_field.row)
    assert plots.figures(loaded)["haigh"](loaded).axes
    data = part_grid(loaded, shown_states(loaded)[-1]).point_data
    largest, principal = data["stress_at_largest"][:, [0, 1, 2, 4, 5, 3]], data["principal_stress"]
    np.testing.assert_allclose(von_mises(largest), data["largest_von_mises"])
    np.testing.assert_allclose(von_mises(np.pad(principal, ((0, 0), (0, 3)))), data["largest_von_mises"])


def test_derivatives(path: Path) -> None:
    """Of stress and utilisation by two loads and friction, against central differences."""
    overrides = ("verdict.enabled=false", "pictures.renders=false", "loads.static.warm=")
    keys = ("loads.harmonic.pull.value", "loads.static.press.pressure", "contact.friction")
    table = td.studies.derivatives(path, only=keys, overrides=overrides).derivatives
    for key, value in zip(keys, (20.0, 5e4, 0.3), strict=True):
        ends = [td.run(path, overrides=(*overrides, f"{key}={value * s}")).summary() for s in (1 + 1e-3, 1 - 1e-3)]
        for name in ("stress", "utilisation"):
            slope = table.slopes[table.names.index(name), table.parameters.index(key)]
            difference = (ends[0][name]["first"] - ends[1][name]["first"]) / (2e-3 * value)
            assert slope == pytest.approx(difference, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [("stress.places.root.point=['15 mm', '20 mm', '4 mm']", r"10 mm outside the part.*nearest, \(15, 10, 4\)"),
     ("fatigue.steel.endurance_limit=200 MPa", "fatigue.steel"),
     ("fatigue.material.diagram=soderberg", "yield_strength"),
     ("fatigue.material.strength=200 MPa", "endurance_limit")],
)  # fmt: skip
def test_refusals(path: Path, change: str, words: str) -> None:
    with pytest.raises(Refusal, match=words):
        td.run(path, overrides=(change, *(("fatigue.steel.strength=600 MPa",) if "steel" in change else ())))


def test_worn_by_two_duties(path: Path) -> None:
    """Miner's sum counts both duties, files keep them; the worn stress over a cycle is that of integration in time."""
    overrides = ("verdict.enabled=false", "pictures.renders=false", "fatigue.material.knee=1e6",
                 "fatigue.material.exponent=4", "fatigue.material.endurance_limit=40 MPa", "wear.coefficient=2e3 um3/J",
                 "wear.step=0.5 um", "wear.rule=thesis", "wear.max_steps=2",
                 "wear.mission=[{at='2.3 kHz', share=0.4}, {at='2.25 kHz', share=0.6, load=0.5}]")  # fmt: skip
    td.run(path, path.parent / "worn", overrides=overrides)
    run = td.load(path.parent / "worn")
    summary, wear = run.summary(), td.load(path.parent / "worn").wear
    basis, place = HarmonicBasis(run.harmonics, 256), run.facts.places[0]
    np.testing.assert_array_equal(wear.duty_response[:, 0], wear.response)
    assert plots.figures(run)["fatigue"](run).axes
    rates = [utilisation(place.stress(r, basis), basis, place.strength) ** 4 @ [0.4, 0.6] for r in wear.duty_response]
    tension, work = run.stress_field.tension[0], wear.energy[0] / (2 * run.patch.area)
    assert summary["ruiz"]["first"] == pytest.approx((tension * work).max())
    assert 0 < summary["smith_watson_topper"]["first"] < tension.max() ** 2 / 210e9 * 1.01
    assert summary["fatigue_damage"] == pytest.approx(np.trapezoid(rates, wear.cycles) / 1e6, rel=2e-2)
    assert summary["service_life"] == pytest.approx(1e6 / rates[0], rel=2e-2)
    model = modelling.build(scene_file.read(path, overrides), Progress(), run.harmonics)
    balance = model.balance.with_gap(model.balance.contact.gap + wear.depth[-1])
    state = balance.evaluate(wear.omega[-1], balance.shaped(wear.displacement[-1]))
    motion = integrate(balance, state.omega, state, Options(512))
    of_time = von_mises((motion.outputs[place.rows] + np.array(place.held_back)[:, None]).T).max()
    assert largest_von_mises(place.stress(balance.outputs(state), basis), basis) == pytest.approx(of_time, rel=1e-2)


STEEL = ("fatigue.steel.endurance_limit=40 MPa", "fatigue.steel.strength=600 MPa")
ELBOW = """
[decks.elbow]
file = "elbow.inp"
unit = "mm"
material = "steel"
faces.end = { body = "ALL", normal = "z" }
[materials.steel]
young = "210 GPa"
density = "7860 kg/m3"
[contacts.end]
first = "ALL.end"
second = "ground"
t1 = "x"
normal_stiffness = "0.1 N/um"
tangential_stiffness = "0.1 N/um"
friction = 0.3
[loads.harmonic.pull]
group = "ALL.end"
direction = "x"
value = "2 N"
"""
ELBOW += SCENE[SCENE.index("[response]") : SCENE.index("[stress")].replace(
    '["1.8 kHz", "2.6 kHz"]', '["4.8 kHz", "5.6 kHz"]'
)


def elbow(radius: float) -> Shape:
    """A bar that turns upwards, with an inner corner of a radius [mm]."""

    def shape(u: np.ndarray) -> np.ndarray:
        s, t = u[:, 0], u[:, 2]
        angle = np.clip((s - 0.3) / 0.4, 0, 1) * np.pi / 2
        rounded = 20 * np.array([np.minimum(s, 0.3), np.maximum(s - 0.7, 0)]) / 0.3
        rounded += radius * np.array([np.sin(angle), 1 - np.cos(angle)])
        inner = rounded if radius else 20 * np.array([np.minimum(2 * s, 1), np.maximum(2 * s - 1, 0)])
        share, ends = np.abs(2 * s - 1), np.where(s < 0.5, [[0.0], [-18.0]], [[radius + 26], [radius + 20]])
        x, z = (1 - t) * inner + t * (share * ends + (1 - share) * [[radius + 26], [-6.0]])
        return np.stack([x, 8 * u[:, 1], z], axis=1)

    return shape


@pytest.mark.parametrize(("radius", "point"), [(0.0, (20, 4, 0)), (6.0, (24.243, 4, 1.757))])
def test_a_sharp_corner_is_not_stated(radius: float, point: tuple[float, ...], tmp_path: Path) -> None:
    """At a re-entrant edge stress grows without bound; at a fillet it has a value and an error."""
    cards = bricks((20, 1, 4), elbow(radius)) + ENDING[ENDING.index("*BOUNDARY") :]
    (tmp_path / "elbow.inp").write_text(cards, encoding="utf-8")
    place = f"[stress.places.corner]\npoint = {[f'{x} mm' for x in point]}\n"
    (tmp_path / "elbow.toml").write_text(ELBOW + place, encoding="utf-8")
    overrides = ("verdict.in_time=false", "harmonics.kept=[0, 1]")
    run = td.run(tmp_path / "elbow.toml", overrides=overrides)
    statement = run.verdict.statements["stress"]
    assert statement.stated == (radius > 0)
    assert radius or "(20, 4, 0) mm is at a re-entrant edge, 5" in statement.reason
    if not radius:
        with pytest.raises(Refusal, match=r"fatigue\.steel.*fatigue\.ALL"):
            td.run(tmp_path / "elbow.toml", overrides=(*overrides, *STEEL))


def test_no_life_follows_from_a_stress_without_bound(path: Path) -> None:
    """At the border of a clamp neither damage nor life is stated, nor the utilisation along the response."""
    overrides = (
        "verdict.in_time=false", "pictures.renders=false", "wear.coefficient=2e3 um3/J", "wear.step=0.5 um",
        "wear.rule=thesis", "wear.max_steps=1", "fatigue.material.knee=1e6", "fatigue.material.exponent=4",
        "fatigue.material.endurance_limit=40 MPa", "stress.places.root.point=['0 mm', '10 mm', '4 mm']",
    )  # fmt: skip
    run = td.run(path, overrides=overrides)
    for name in ("stress", "utilisation", "service_life", "fatigue_damage", "utilisation_along_response"):
        statement = run.verdict.statements[name]
        assert statement.status == Status.UNBOUNDED
        assert statement.reason.startswith("(0, 10, 4) mm is at the border of a clamp")
    lines = text.brief(run)
    assert not any("Miner's sum is 1" in line for line in lines)
    assert any("service life        not reported" in line for line in lines)
