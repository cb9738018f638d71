"""The published backbones of the beam by a model with the same law, modulus and elements; points off are named."""

from __future__ import annotations

import numpy as np
import pytest

import tribodyn as td

OFF = {2.48874e-07: 0.065, 3.44668e-07: 0.065}  # flat: amplitude -> how far damping is off at most; see the page


@pytest.mark.slow
@pytest.mark.parametrize(("name", "named"), [("brb_published", OFF), ("brb_published_wavy", {})])
def test_the_backbone_is_the_published_one(name: str, named: dict[float, float]):
    rows = td.studies.backbone(name).record()["published"]["rows"]
    assert len(rows) >= 21
    for row in rows:
        assert row["our_frequency_hz"] == pytest.approx(row["frequency_hz"], rel=0.003)
        off = next((most for a, most in named.items() if np.isclose(a, row["modal_amplitude"], rtol=1e-4)), 0.05)
        assert row["our_damping"] == pytest.approx(row["damping"], rel=off), row["modal_amplitude"]
