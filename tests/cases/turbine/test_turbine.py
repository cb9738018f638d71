"""The turbine wheel on a coarse mesh: forces balance on every body, every contact has its own wear and life."""

import numpy as np
import pytest
import skfem

import tribodyn as td
from proof.problems import result_of, wear
from tests.helpers.browser import chromium, clicked_zoomed_and_turned
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.workflows.cases.turbine import bladed_sector
from tribodyn.workflows.report import text as in_words
from tribodyn.workflows.studies.forces import BodyForces

COARSE = (
    *("bodies.blade.n_span=2", "bodies.blade.n_along=3", "bodies.blade.n_up=2", "bodies.disk.n_axial=2"),
    *("bodies.blade.n_through=1", "bodies.blade.n_side=1", "harmonics.kept=[0, 1]"),
    *("bodies.damper.n_damper=1", "bodies.blade.hub_radius=200 mm"),
)
__all__ = ["chromium"]
JOINTS = {"root_right", "root_left", "damper_right", "damper_left", "shroud"}


@pytest.fixture(scope="module")
def forces_of() -> dict[str, BodyForces]:
    return {body.name: body for body in td.studies.forces("turbine", overrides=COARSE).bodies}


@pytest.mark.parametrize("body", ["blade", "damper"])
def test_contact_forces_carry_the_centrifugal_load(forces_of: dict[str, BodyForces], body: str) -> None:
    """Forces on a body that only contact holds, to 1e-8."""
    item = forces_of[body]
    assert not item.is_supported
    assert item.imbalance < 1e-8
    assert set(item.joints) == (JOINTS if body == "blade" else {"damper_right", "damper_left"})
    assert forces_of["disk"].is_supported


def test_centrifugal_load_of_the_damper_is_that_of_its_drawing(forces_of: dict[str, BodyForces]) -> None:
    """Mass of the trapezoidal prism times speed squared times the radius of its centre; it moves out by some 1e-3."""
    p, speed, density = bladed_sector.Parameters(), 2 * np.pi * 100, 8200.0
    low, high = (p.gap_bottom + share * (p.gap_top - p.gap_bottom) for share in (p.damper_low, p.damper_high))
    tall = p.platform_height * (p.damper_high - p.damper_low)
    centre = p.under + p.damper_low * p.platform_height + tall * (low + 2 * high) / (3 * (low + high))
    expected = density * p.damper_length * tall * (low + high) / 2 * speed**2 * centre
    assert np.linalg.norm(forces_of["damper"].load) == pytest.approx(expected, rel=2e-3)


def test_the_airfoil_carries_what_is_above_it() -> None:
    """Its mean stress along the span: density, speed squared and radius over the volume above, over the section; what
    friction of shrouds and bending add is below a twentieth."""
    model = td.build(td.read_scene("turbine", (*COARSE, "bodies.blade.n_span=8")))
    state = newton.solve_from_rest(model.balance, 2 * np.pi * 600).state
    computed = model.balance.places[0].stress(model.balance.outputs(state), model.balance.basis)[2, 0]
    (blade,) = (body.mesh for body in model.part.mesh.bodies if body.name == "blade")
    points = skfem.Basis(blade, skfem.ElementHex0(), intorder=4)
    z, volume = np.asarray(points.global_coordinates())[2], points.dx
    force = 8200 * (2 * np.pi * 100) ** 2 * (z * volume)[z > 0.2225].sum()
    assert computed == pytest.approx(force / 241.6e-6, rel=0.05)  # over the section of the drawing [m2]


@pytest.fixture(scope="module")
def worn() -> td.Result:
    """Two wear steps at a frequency, without a response curve."""
    changes = (
        "loads.harmonic.wave.value=1200 N", "wear.at=850 Hz", "wear.max_steps=2", "wear.step=1 um",
        "wear.lost_below=0.9995", "reduction.modes=8",
    )  # fmt: skip
    file = td.read_scene("turbine", (*COARSE, *changes, 'contacts.damper_left.wear={coefficient = "1e4 um3/J"}'))
    model = td.build(file)
    return result_of(file, model.part, model.balance, wear(file, model.balance))


@pytest.mark.slow  # the report of another wheel, the blade, is always clicked
def test_the_report_is_clicked_zoomed_and_turned(worn, chromium, tmp_path, monkeypatch):
    clicked_zoomed_and_turned(chromium, "turbine", worn, tmp_path, monkeypatch)


def test_every_contact_is_told_by_itself(worn: td.Result) -> None:
    result = worn
    joints = result.summary()["joints"]
    assert set(joints) == JOINTS
    worn = {name: joint for name, joint in joints.items() if joint["friction_work"] > 0}
    assert {"shroud", "damper_left"} <= set(worn)
    for name, joint in worn.items():
        coefficient = 1e-14 if name == "damper_left" else 2e-14
        assert joint["volume"] == pytest.approx(coefficient * joint["friction_work"], rel=1e-9)
    assert all(joint["pairs"] > 0 for joint in joints.values())
    for total in ("friction_work", "volume"):
        assert result.summary()[total] == pytest.approx(sum(joint[total] for joint in joints.values()), rel=1e-12)
    assert "joints.shroud" in dict(in_words.lines(result))
    lives = []
    for name, pairs in result.facts.joints.items():
        preload, life = result.wear.normal_force[:, pairs].sum(axis=1), joints[name]["life"]
        assert (life is None) == (preload.min() >= 0.9995 * preload[0])
        if life is not None:
            assert np.interp(life, result.wear.cycles, preload) == pytest.approx(0.9995 * preload[0], rel=1e-5)
            lives.append(life)
    assert result.summary()["life"] == min(lives)  # the first joint that is lost ends the run


STOP = 'springs.stop={group="damper.wedge_right", direction="x", stiffness="1 N/um"}'


@pytest.mark.parametrize("stop", [(), (STOP,)])
def test_dampers_without_shrouds_run_held_along_the_axis_or_are_refused(stop: tuple[str, ...]) -> None:
    """Shaken hard, a damper slips along the axis at every pair, and only a stop holds it there."""
    balance = td.build(td.read_scene("turbine", (*COARSE, "contacts.shroud=", "wear=", *stop))).balance
    gentle, hard = (arc_length.solve_along_load(balance.with_load(load), 2 * np.pi * 780) for load in (1.0, 4.0))
    assert gentle.converged
    assert hard.converged == bool(stop)
    if not stop:
        assert "every pair of damper_right, damper_left slips along t1" in str(hard.outcome)


@pytest.mark.parametrize(("change", "sentence"), [
    ("bodies.blade.gap_top=30 mm", r"gap_top is 0.03: give less than geometry.gap_bottom"),
    ("bodies.blade.bulb_width=10 mm", r"bulb_width is 0.01: give more than geometry.neck_width"),
    ("bodies.disk.neck_height=3 mm", r"neck_height is 0.003: give more than .*, or the posts of the disk end"),
    ("bodies.disk.disk_radius=180 mm", r"disk_radius is 0.18: give a radius below .* the bottom of the slot"),
    ("bodies.damper.damper_length=60 mm", r"damper_length is 0.06: give at most geometry.platform_length"),
    ("wheel.sectors=23", "does not bring .*: give wheel.sectors = 24"),
    ("wheel.seam=", r'wheel.seam is missing, .* \["disk.cyclic_right", "disk.cyclic_left"\]'),
    ("wheel=", "sector is for a"),
    ('masses.m={at="blade.tip", mass="1 g"}', "wheel.speed: there is a lumped mass at blade.tip"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(change: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence) as raised:
        td.build(td.read_scene("turbine", (*COARSE, change)))
    assert "\n" not in str(raised.value)
