"""Half beam with a lap, bolt, nut and washer: volumes against closed forms, groups, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tribodyn.geometry import bolt, mesh, nut, washer
from tribodyn.workflows.cases.brb import lap_beam

HEXAGON = np.sqrt(3) / 2 * 12.7e-3**2  # area by the width across flats


def build_part(part, path: Path, **changes):
    parameters = replace(part.Parameters(), **changes)
    part.build(parameters, path / "part.msh")
    return *mesh.read(path / "part.msh"), parameters


def disk(diameter: float) -> float:
    return np.pi * diameter**2 / 4


def test_volumes_are_those_of_the_drawing(tmp_path):
    body, _, p = build_part(lap_beam, tmp_path, n_side=4)
    expected = (
        p.width * p.height * (p.length - p.lap) + p.width * p.height / 2 * p.lap - 3 * disk(p.hole) * p.height / 2
    )
    assert mesh.facts(body).volume == pytest.approx(expected, rel=1e-6)
    body, _, q = build_part(bolt, tmp_path)
    assert mesh.facts(body).volume == pytest.approx(disk(q.diameter) * q.length + HEXAGON * q.head_height, rel=3e-4)
    body, _, n = build_part(nut, tmp_path)
    assert mesh.facts(body).volume == pytest.approx((HEXAGON - disk(n.bore)) * n.height, rel=1e-4)
    body, _, w = build_part(washer, tmp_path)
    assert mesh.facts(body).volume == pytest.approx((disk(w.diameter) - disk(w.bore)) * w.thickness, rel=3e-4)


def test_the_lap_meets_itself_turned_by_half_a_turn(tmp_path):
    body, sets, p = build_part(lap_beam, tmp_path)
    lap = body.doflocs.T[sets["lap"]]
    assert np.abs(lap[:, 2]).max() < 1e-12
    turned = lap * [-1, 1, -1]
    distance = np.linalg.norm(lap[:, None] - turned[None], axis=2).min(axis=1)
    assert distance.max() < 1e-12
    pads = [mesh.area(body, body.boundaries[f"pad_{i}"]) for i in (1, 2, 3)]
    np.testing.assert_allclose(pads, disk(p.pad) - disk(p.hole), rtol=1e-3)
    assert mesh.area(body, body.boundaries["lap"]) == pytest.approx(p.lap * p.width - 3 * disk(p.hole), rel=1e-4)
    assert body.doflocs.T[sets["tip"][0]] == pytest.approx([-0.36, 0, 0], abs=1e-12)


@pytest.mark.parametrize(("part", "changes", "words"), [
    (lap_beam, {"pad": 8e-3}, "geometry.pad must lie between"),
    (lap_beam, {"lap": 0.08}, "geometry.lap must exceed"),
    (bolt, {"n_around": 10}, "multiple of 12"),
    (bolt, {"length": 0.03}, "geometry.length must exceed"),
    (nut, {"bore": 9e-3}, "geometry.seat_diameter must lie between"),
    (washer, {"bore": 0.02}, "geometry.bore must be less"),
])  # fmt: skip
def test_what_cannot_be_is_refused(part, changes, words):
    with pytest.raises(ValueError, match=words):
        replace(part.Parameters(), **changes)
