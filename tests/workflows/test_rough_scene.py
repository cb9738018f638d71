"""The rough law and a preload without friction, said in a scene: the beam pressed on a rough ground."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tribodyn as td
from tribodyn.hbm.contact.contact_law import SLIPS, STICKS
from tribodyn.workflows.scene import scene_file

SMALL = {
    "harmonics.kept": [0, 1], "geometry.n_patch": 3, "geometry.n_length": 3, "geometry.n_height": 1,
    "reduction.modes": 4, "wear": None, "verdict.enabled": False, "harmonics.samples": 32,
}  # fmt: skip
ROUGH = {
    "contact.law": "rough", "contact.table": "asperities.csv", "contact.tangential_stiffness": None,
    "contact.normal_stiffness": None, "contact.young": "200 GPa", "contact.poisson": 0.3, "contact.radius": "1.4 mm",
    "contact.yield_stress": "330 MPa", "contact.tangent_modulus": "620 MPa",
}  # fmt: skip
FRICTIONLESS = {"preload.frictionless": True}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    height = np.linspace(0, 20e-6, 41)
    np.savetxt(tmp_path / "asperities.csv", np.column_stack([height, np.full(41, 1e6 / 20e-6)]), delimiter=",")
    copy = tmp_path / "pad.toml"
    copy.write_text(scene_file.find("beam").read_text(encoding="utf-8"), encoding="utf-8")
    return copy


def balance(scene: Path, *changes: dict[str, Any]) -> Any:
    overrides: dict[str, Any] = {}
    for change in (SMALL, *changes):
        overrides |= change
    return td.build(scene, overrides=overrides).balance


@pytest.mark.parametrize("law", [{}, ROUGH], ids=["jenkins", "rough"])
def test_a_preload_without_friction_carries_the_load_without_shear(scene: Path, law: dict[str, Any]) -> None:
    resting = balance(scene, law, FRICTIONLESS)
    omega = 2 * np.pi * 400.0
    still = resting.with_load(0.0)
    state = still.evaluate(omega, still.stuck(omega))
    assert np.abs(state.cycle.force[:, :2, 0]).max() < 1e-9 * state.cycle.force[:, 2, 0].max()
    assert np.linalg.norm(state.residual) < 1e-8 * np.linalg.norm(state.x)
    assert not (state.cycle.status & SLIPS).any()
    assert (state.cycle.status & STICKS).any()


def test_the_stuck_springs_of_a_rough_face_are_its_tangents_at_rest(scene: Path) -> None:
    nominal, resting = balance(scene, ROUGH), balance(scene, ROUGH, FRICTIONLESS)
    assert resting.at_rest is not None
    kn = resting.contact.stiffness[:, 2]
    assert np.ptp(kn / nominal.contact.stiffness[:, 2]) > 0.05  # the pressure is uneven
    gap = resting.contact.gap
    h = 1e-11
    basis = resting.basis

    def force(shift: float) -> np.ndarray:
        x = np.zeros((len(gap), 3, basis.n_coeff))
        x[:, :, 0] = resting.at_rest
        x[:, 2, 0] += shift
        return resting.contact.cycle(x, basis, resting.memory, False).force[:, 2, 0]

    unloading = (force(0.0) - force(-h)) / h
    np.testing.assert_allclose(kn, unloading, rtol=2e-2)


@pytest.mark.parametrize(("change", "words"), [
    ({"contact.table": None}, "contact.table is missing"),
    ({"contact.table": "nowhere.csv"}, "there is no file"),
    ({"contact.normal_stiffness": "1 N/um"}, "has no meaning where it follows from a punch or the law"),
    ({"contact.gap_map": "nowhere.csv"}, "there is no file"),
])  # fmt: skip
def test_what_a_rough_contact_cannot_be_is_one_sentence(scene: Path, change: dict[str, Any], words: str) -> None:
    with pytest.raises(td.SceneError, match=words):
        td.read_scene(scene, ROUGH | change)


def test_a_map_of_openings_becomes_the_gap(scene: Path) -> None:
    x = np.linspace(0.17, 0.21, 9)
    rows = [(a, b, 0.0, 1e-6 + 1e-4 * (a - 0.18)) for a in x for b in np.linspace(-0.02, 0.03, 9)]
    np.savetxt(scene.parent / "tilted.csv", rows, delimiter=",")
    gap = balance(scene, {"contact.gap_map": "tilted.csv", "contact.gap": None}).contact.gap
    assert gap.min() == pytest.approx(0.0, abs=1e-15)
    assert gap.max() == pytest.approx(1e-4 * 0.02, rel=1e-9)
