"""The published backbones of the beam by a model with the same law, modulus and elements; points off are named."""

from __future__ import annotations

from pathlib import Path
from shutil import copy

import numpy as np
import pytest

import tribodyn as td
from tribodyn.workflows.scene import scene_file

OFF = {2.48874e-07: 0.065, 3.44668e-07: 0.065}  # flat: amplitude -> how far damping is off at most; see the page
PUBLISHED = [  # what the published model has, in place of what brb_flat has
    "contacts.lap.law=rough_sliders", "contacts.lap.face_centres=true", "materials.steel.elements=linear_reduced",
    "materials.steel.young=192.31 GPa", "materials.steel.poisson=0.3",
    *(f"bodies.{half}.{count}" for half in ("lower", "upper") for count in ("n_lap=2", "n_length=16")),
]  # fmt: skip


@pytest.fixture
def wavy(tmp_path: Path) -> Path:
    """The scene of the flat lap beside the published backbone of the wavy one, and the files that it names."""
    shipped = scene_file.find("brb_flat")
    for name in ("asperities.csv", "waviness.csv"):
        copy(shipped.parent / name, tmp_path)
    copy(Path(__file__).with_name("wavy.published.toml"), tmp_path)
    return Path(copy(shipped, tmp_path / "wavy.toml"))


def assert_published(scene: str, overrides: list[str], off: dict[float, float]) -> None:
    """Frequency within 0.3 %, damping within 5 % or what `off` allows at an amplitude."""
    rows = td.studies.backbone(scene, overrides=overrides).record()["published"]["rows"]
    assert len(rows) >= 21
    for row in rows:
        assert row["our_frequency_hz"] == pytest.approx(row["frequency_hz"], rel=0.003)
        allowed = next(
            (largest for a, largest in off.items() if np.isclose(a, row["modal_amplitude"], rtol=1e-4)), 0.05
        )
        assert row["our_damping"] == pytest.approx(row["damping"], rel=allowed), row["modal_amplitude"]


@pytest.mark.slow
def test_the_backbone_of_the_flat_lap_is_the_published_one():
    assert_published("brb_flat", PUBLISHED, OFF)


@pytest.mark.slow
def test_the_backbone_of_the_wavy_lap_is_the_published_one(wavy: Path):
    extra = ["contacts.lap.gap_map=waviness.csv", "response.frequency=['170 Hz', '205 Hz']"]
    assert_published(str(wavy), [*PUBLISHED, *extra], {})
