"""The Brake-Reuss beam on a coarse mesh: apart, pressed together, along its backbone; with rough faces too."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla

import tribodyn as td
from tests.helpers.command import printed_record, refusal
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions, backbone
from tribodyn.hbm.time import ring_down as time_ring_down
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import linear_references
from tribodyn.workflows.scene import scene_file

FORCE = 3 * 12249.0
COARSE = [
    "contacts.lap.vertices_only=true", "reduction.cutoff=5 kHz",
    *(f"bodies.{half}.n_length=4" for half in ("lower", "upper")), *(f"bodies.bolt_{i}.n_grip=2" for i in (1, 2, 3)),
    *(f"bodies.{ring}_{i}.n_across=1" for ring in ("washer", "disk") for i in (1, 2, 3)),
]  # fmt: skip
WAVY = ["contacts.lap.gap_map=waviness.csv", "response.frequency=['170 Hz', '205 Hz']"]
SCENES = {"plain": ("brb", []), "flat": ("brb_flat", []), "wavy": ("brb_flat", WAVY)}  # faces of the lap


@cache
def built(faces: str) -> modelling.Model:
    """The model with plain, flat rough or wavy rough faces; the part and its reduction are those of the plain ones."""
    name, overrides = SCENES[faces]
    file = scene_file.read(name, [*COARSE, *overrides])
    if faces == "plain":
        return modelling.build(file, Progress())
    plain = built("plain")
    part, _ = modelling.with_surfaces(file, plain.part)
    reduced = replace(
        plain.reduced,
        system=replace(plain.reduced.system, damping=None),
        interface=replace(plain.reduced.interface, gap=part.interface.gap),
    )
    return modelling.make_model(file.scene, part, modelling.damped(file.scene, reduced))


def test_apart_the_halves_slide_along_their_bolts_and_have_the_known_frequencies():
    """70.323, 151.26 and 609.25 Hz are published for linear reduced elements; ours are some per cent stiffer."""
    hertz = built("plain").reduced.free_frequency
    assert (hertz[:7] < 0.1).all()
    np.testing.assert_allclose(hertz[7:10], [70.323, 151.26, 609.25], rtol=0.055)
    np.testing.assert_allclose(hertz[7:10], [73.26, 155.2, 623.2], rtol=0.025)  # our finest mesh


@pytest.mark.parametrize("faces", SCENES)
def test_pressed_together_the_lap_carries_the_bolts_and_six_motions_are_left(faces):
    balance = built(faces).balance
    still = balance.with_load(0.0)
    state = still.evaluate(still.omega_max, still.stuck(still.omega_max))
    force = state.cycle.force[:, 2, 0]
    if faces == "plain":
        force = newton.solve(still, still.omega_max, state.x).state.cycle.force[:, 2, 0]
    assert force.sum() == pytest.approx(FORCE, rel=1e-6)
    system, B, k = balance.model.system, np.asarray(balance.model.interface.B), balance.reference_stiffness
    squares = sla.eigvalsh(system.stiffness + B.T @ (k[:, None] * B), system.mass)
    assert (np.abs(squares[:6]) < 1.0).all()
    assert squares[6] > (2 * np.pi * 150) ** 2
    if faces != "wavy":  # the half turn about y maps the lap onto itself
        points = balance.model.interface.points
        turned = points * [-1, 1, 1]
        partner = np.linalg.norm(points[:, None] - turned[None], axis=2).argmin(axis=1)
        assert np.abs(force - force[partner]).max() < 2e-3 * force.max()


@pytest.mark.parametrize("faces", ["flat", "wavy"])
def test_rough_faces_soften_and_damp_along_the_backbone(faces):
    balance = built(faces).balance
    result = backbone(balance, 2e-8, 6.3e-5, 6, "response", BackboneOptions(14), modal=True)
    assert str(result.end) == "reached the amplitude asked for"
    assert 160 < result.frequency[0] < 210
    assert result.frequency[-1] < 0.97 * result.frequency[0]
    assert result.damping[0] == pytest.approx(0.087e-2, rel=0.05)  # what was measured at small amplitude
    assert result.damping.max() > 10 * result.damping[0]
    assert (np.diff(result.frequency) < 1e-6).all()
    np.testing.assert_allclose(result.modal_amplitude[[0, -1]], [2e-8, 6.3e-5], rtol=1e-9)


def test_the_command_gives_rows_by_modal_amplitude(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch):
    model = built("plain")
    monkeypatch.setattr(modelling, "build", lambda file, *_: model)
    words = ["--points", "4", "--out", str(tmp_path), "--json"]
    record = printed_record(["curve", "backbone", "brb_flat", *words], capsys)  # beside what is published
    rows = record["rows"]
    assert record["published"]["source"] == "Porter and Brake 2023"
    first, last = record["published"]["rows"][0], record["published"]["rows"][-1]
    assert first["frequency_hz"] == 168.5023
    assert last["shift"] == pytest.approx(158.6675 / 168.5023 - 1)
    ours = [row["frequency_hz"] for row in rows]
    assert all(min(ours) <= row["our_frequency_hz"] <= max(ours) for row in (first, last))
    assert set(rows[0]) >= {"modal_amplitude", "frequency_hz", "damping", "amplitude_m", "acceleration_m_s2"}
    first = rows[0]
    swing = (2 * np.pi * first["frequency_hz"]) ** 2 * first["amplitude_m"]
    assert first["acceleration_m_s2"] == pytest.approx(swing, rel=1e-2)
    assert td.scene_names().count("brb_flat") == 1


def test_the_beam_rings_down_from_one_amplitude_to_the_other(capsys, tmp_path, monkeypatch):
    """From --to down to --from, along the backbone of faces that have yielded: frequency 0.1 %, damping 3 %."""
    model, follow, rows = built("flat"), time_ring_down.ring_down, []
    monkeypatch.setattr(modelling, "build", lambda file, *_: model)
    monkeypatch.setattr(time_ring_down, "ring_down", lambda *arguments: rows.append(follow(*arguments)) or rows[-1])
    words = ["--from", "11um", "--to", "16um", "--points", "8", "--steps", "96", "--out", str(tmp_path), "--json"]
    record = printed_record(["curve", "ring-down", "brb_flat", *words], capsys)
    assert record["largest_frequency_difference"] < 1e-3
    assert record["largest_decrement_difference"] < 0.03
    assert record["largest_decrement_difference"] < record["largest_damping_difference"]
    assert record["end"].startswith("fell to the ")
    swing = np.loadtxt(tmp_path / "ring_down.csv", delimiter=",", skiprows=1)[:, 1]
    assert np.ptp(swing[:96]) / 2 == pytest.approx(16e-6, rel=0.03)
    assert 10.5e-6 < np.ptp(swing[-96:]) / 2 < 11.1e-6
    assert rows[0].last < 11.1e-6
    assert "--from below --to" in refusal(["curve", "ring-down", "brb_flat", "--from", "60um", "--to", "40um"], capsys)


def test_references_of_a_beam_that_hangs_free_are_those_of_its_dynamic_stiffness():
    """At some frequencies, free (the halves loose) and stuck, by a direct solve of the whole matrices."""
    balance = built("plain").balance
    result = linear_references(balance, "response", 2 * np.pi * 100, 2 * np.pi * 200)
    system, interface = balance.model.system, balance.model.interface
    B, k = np.asarray(interface.B), balance.contact.stiffness.ravel()
    force = sum(value * system.loads[name] for (order, name), value in balance.excitation.loads.items() if order == 1)
    for at in (0, 137, 400):
        w = result.omega[at]
        stuck = system.stiffness + B.T @ (k[:, None] * B)
        for stiffness, height in ((system.stiffness, result.free), (stuck, result.stuck)):
            dynamic = stiffness - w**2 * system.mass + 1j * w * system.velocity_matrix
            expected = abs(system.outputs["response"] @ np.linalg.solve(dynamic, force))
            assert height[at] == pytest.approx(expected, rel=1e-4)
