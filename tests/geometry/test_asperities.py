"""Asperities of height maps: caps of known radius and heights, Nayak's random faces, the command, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.rough_faces import Moments, caps, gaussian
from tribodyn.geometry.asperities import identify, summits
from tribodyn.geometry.height_map import HeightMap, mirrored

RADIUS, SPACING_OF_SUMMITS, STEP = 200e-6, 41e-6, 1e-6


def some_heights(n: int = 8) -> np.ndarray:
    """Symmetric, so that levelling finds no tilt."""
    quarter = np.random.default_rng(3).uniform(0.2e-6, 0.6e-6, (n // 2, n // 2))
    half = np.concatenate([quarter, quarter[::-1]])
    return np.concatenate([half, half[:, ::-1]], axis=1)


def test_caps_give_their_radius_density_and_gaps():
    heights = some_heights()
    fit = identify(caps(RADIUS, heights, SPACING_OF_SUMMITS, STEP))
    assert len(fit.height) == heights.size
    assert fit.radius == pytest.approx(RADIUS, rel=1e-4)
    assert fit.density == pytest.approx(1 / SPACING_OF_SUMMITS**2, rel=0.02)  # the rim is left out
    np.testing.assert_allclose(np.sort(fit.gap), np.sort(heights.max() - heights.ravel()), atol=1e-12)


def test_two_faces_of_caps_that_meet_have_half_the_radius_and_both_heights():
    first = caps(RADIUS, some_heights(), SPACING_OF_SUMMITS, STEP)
    single, two_results = identify(first), identify(first, first)
    assert two_results.radius == pytest.approx(RADIUS / 2, rel=1e-4)
    np.testing.assert_allclose(np.sort(two_results.gap), 2 * np.sort(single.gap), atol=1e-12)
    lower = replace(first, z=first.z * (1 - 0.4 * (first.x < first.x.mean()))[:, None])
    turned = identify(lower, mirrored(lower, "x"))
    assert turned.height.std() < 0.8 * identify(lower, lower).height.std()


def test_two_random_faces_of_different_grids_have_the_sum_of_their_moments():
    """Greenwood and Tripp 1970."""
    first, item = gaussian(400, 1e-6, 60e-6, 16e-6, 0.3e-6, 8)
    second, other = gaussian(220, 2e-6, 60e-6, 20e-6, 0.5e-6, 9)
    for result in (identify(first, second), identify(second, first)):
        expected = Moments(item.m0 + other.m0, item.m2 + other.m2, item.m4 + other.m4)
        assert result.radius == pytest.approx(expected.radius, rel=0.05)
        assert result.density == pytest.approx(expected.density, rel=0.08)
        assert result.height.std() == pytest.approx(expected.deviation, rel=0.08)


@pytest.mark.parametrize("shortest", [12e-6, 16e-6])
def test_a_random_face_has_the_summits_that_nayak_counts(shortest):
    face, reference = gaussian(512, 1e-6, 60e-6, shortest, 0.3e-6, 1)
    fit = identify(face)
    assert fit.density == pytest.approx(reference.density, rel=0.05)
    assert fit.radius == pytest.approx(reference.radius, rel=0.05)
    assert fit.height.std() == pytest.approx(reference.deviation, rel=0.05)
    assert fit.height.mean() == pytest.approx(reference.mean, rel=0.05)


def test_cut_off_and_noise_filter_leave_the_roughness_between_them():
    face, reference = gaussian(400, 1e-6, 40e-6, 16e-6, 0.3e-6, 2)
    form = 1e-6 * np.cos(2 * np.pi * face.x / 400e-6)[:, None] + 1e-2 * face.y
    noise = 6e-9 * np.random.default_rng(4).standard_normal(face.z.shape)
    measured = replace(face, z=face.z + form + noise)
    assert identify(measured, cutoff=100e-6).density > 1.2 * reference.density
    assert identify(measured).height.std() > 2 * reference.deviation
    fit = identify(measured, cutoff=100e-6, shortest=5e-6)
    assert fit.density == pytest.approx(reference.density, rel=0.1)
    assert fit.radius == pytest.approx(reference.radius, rel=0.1)
    assert fit.height.std() == pytest.approx(reference.deviation, rel=0.1)


@pytest.mark.parametrize("rows", [2, 11, 101])
def test_a_table_keeps_the_number_of_summits_and_their_mean_gap(rows):
    fit = identify(gaussian(256, 1e-6, 60e-6, 12e-6, 0.3e-6, 5)[0])
    gap, density = fit.table(rows).T
    width = np.full(rows, gap[1])
    width[[0, -1]] /= 2
    assert (width * density).sum() == pytest.approx(fit.density, rel=1e-12)
    assert (width * density * gap).sum() / fit.density == pytest.approx(fit.gap.mean(), rel=1e-12)
    assert gap[-1] == fit.gap.max()


def stepped() -> HeightMap:
    face = gaussian(200, 1e-6, 60e-6, 16e-6, 0.3e-6, 6)[0]
    return replace(face, z=np.round(face.z / 30e-9) * 30e-9)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: identify(stepped()), "its heights come in steps .*: give `shortest`"),
    (lambda: identify(caps(RADIUS, some_heights(4), SPACING_OF_SUMMITS, STEP)), "16 summits are too few"),
    (lambda: identify(caps(RADIUS, np.full((8, 8), 5e-7), SPACING_OF_SUMMITS, STEP)).table(1), "a table of 1 rows"),
    (lambda: summits(HeightMap(*2 * (np.arange(5.0),), np.full((5, 5), np.nan))), "without height"),
])  # fmt: skip
def test_what_has_no_asperities_is_one_sentence(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_heights_in_steps_are_cured_by_the_filter_that_the_sentence_names():
    reference = gaussian(200, 1e-6, 60e-6, 16e-6, 0.3e-6, 6)[1]
    assert identify(stepped(), shortest=8e-6).radius == pytest.approx(reference.radius, rel=0.25)
