"""The bracket: its volume, its faces, and what it refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof import bracket
from tribodyn.fem.surface import surface
from tribodyn.geometry import mesh


@pytest.mark.parametrize("holes", [0, 3])
def test_volume_and_faces_are_those_of_the_drawing(holes: int, tmp_path: Path) -> None:
    p = replace(bracket.Parameters(), holes=holes, n_length=6)
    bracket.build(p, tmp_path / "bracket.msh")
    body, sets = mesh.read(tmp_path / "bracket.msh")
    octagon = 8 * (p.hole / 2) ** 2 / 2 * np.sin(np.pi / 4)
    legs = p.length * p.thickness * p.width + (p.height - p.thickness) * p.thickness * p.width
    assert mesh.quality(body).volume == pytest.approx(legs - holes * octagon * p.thickness, rel=1e-9)
    areas = {
        "back": p.height * p.width - holes * octagon,
        "pad": p.pad_length * p.width, "top": p.pad_length * p.width,
        "end": p.thickness * p.width, "side": p.thickness * p.pad_length,
    }  # fmt: skip
    for name, area in areas.items():
        assert surface(body, body.boundaries[name], vertices_only=True).area.sum() == pytest.approx(area, rel=1e-9)
    assert set(areas) <= set(sets)


def test_holes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"geometry\.hole is 0\.03"):
        bracket.Parameters(hole=0.03)
    with pytest.raises(ValueError, match=r"geometry\.thickness is 0\.09"):
        bracket.Parameters(thickness=0.09)
