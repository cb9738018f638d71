"""The published backbones of the beam by a model with the same law, modulus and elements; points off are named."""

from __future__ import annotations

import numpy as np
import pytest

import tribodyn as td

FLAT = {8.94112e-06: 0.09}  # modal amplitude -> how far the damping is off at most, looked into on the beam's page
WAVY = {1.29237e-06: 0.1, 2.47672e-06: 0.22, 4.73142e-06: 0.37, 8.99904e-06: 0.32, 1.40336e-05: 0.08}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "named"), [("brb_published", FLAT), ("brb_published_wavy", WAVY)])
def test_the_backbone_is_the_published_one(name: str, named: dict[float, float]):
    rows = td.studies.backbone(name).record()["published"]["rows"]
    assert len(rows) >= 21
    for row in rows:
        assert row["our_frequency_hz"] == pytest.approx(row["frequency_hz"], rel=0.01)
        off = next((most for a, most in named.items() if np.isclose(a, row["modal_amplitude"], rtol=1e-4)), 0.05)
        assert row["our_damping"] == pytest.approx(row["damping"], rel=off), row["modal_amplitude"]
