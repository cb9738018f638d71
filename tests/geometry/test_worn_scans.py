"""Scans before and after wear whose shift, turn, volume and wear coefficient are planted."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import tribodyn as td
from tribodyn.geometry.height_map import HeightMap
from tribodyn.geometry.worn_volume import compare_scans


def crater(seed, walls, n=160, step=4e-6):
    """Scans and volume of a crater with a texture of its own; the second is shifted, turned, tilted, with holes."""
    random = np.random.default_rng(seed)
    face, new = (gaussian_filter(random.standard_normal((n, n)), 3, mode="wrap") for _ in range(2))
    x, y = np.meshgrid(*[np.arange(n) - (n - 1) / 2] * 2, indexing="ij")
    depth = np.clip((0.3 * n - np.hypot(x, y)) / walls, 0, 1)
    worn = face + depth * (np.minimum(face, new - 0.6) - face)
    places = [np.cos(0.02) * a + b * np.sin(0.02) + 3 + (n - 1) / 2 for a, b in ((x, y), (y, -x))]
    moved = map_coordinates(worn, places, order=1, mode="grid-wrap") + 1e-3 * y
    moved[random.random((n, n)) < 0.02] = np.nan
    scans = [1e-5 * z + 5e-8 * random.standard_normal((n, n)) for z in (face, moved)]
    volume = 1e-5 * (face - worn).sum() * step**2
    return *[HeightMap(np.arange(n) * step, np.arange(n) * step, z) for z in scans], volume


@pytest.mark.parametrize("walls", [0.01, 48])
def test_a_planted_volume_is_in_its_interval(walls):
    pristine, worn, volume = crater(1, walls)
    face = compare_scans(pristine, worn)
    assert np.degrees(face.alignment.turn) == pytest.approx(np.degrees(0.02), abs=0.01)
    assert np.hypot(*face.alignment.shift) == pytest.approx(12e-6 * 2**0.5, abs=3e-7)
    assert abs(face.volume - volume) < 1.96 * face.volume_deviation < 0.02 * volume
    assert not face.remarks  # its walls are no spikes


def test_faces_without_a_common_texture_are_doubtful(tmp_path):
    for seed, name in enumerate(("before.txt", "after.txt")):
        np.savetxt(tmp_path / name, crater(seed, 48)[seed].z)
    study = td.studies.worn(tmp_path / "before.txt", tmp_path / "after.txt", work=1.0, spacing=(4e-6, 4e-6))
    assert study.record()["doubtful"] == ["scan"]
    assert "one test, the scatter between tests is not in it\nDOUBTFUL" in str(study)
    assert [path.name for path in study.write(tmp_path)][3:] == ["gap.csv", "wear.toml"]
    assert (tmp_path / "wear.toml").read_text().startswith("# DOUBTFUL")


def test_tests_give_the_coefficient_within_its_interval(tmp_path):
    rows = ["work,volume,error", "100 J,5.6e5 um3,1e4 um3", "200 J,1.09e6 um3,1e4 um3", "300 J,1.66e6 um3,1e4 um3"]
    (tmp_path / "tests.csv").write_text("\n".join(rows))
    low, high = td.studies.worn(tmp_path / "tests.csv").coefficient.interval
    assert low < 5.5e-15 < high < 1.1 * low
