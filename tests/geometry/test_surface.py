"""Measured surfaces: readers, repairs, the ISO filter, nodes and gap; and what garbage is told."""

import struct
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tribodyn.geometry.height_map import HeightMap, centred, facing_gap, level, mirrored, onto_nodes, synthetic_pair
from tribodyn.geometry.height_map_files import read
from tribodyn.geometry.map_repair import check, fill_holes, remove_outliers, repair, split

MICRO = 1e-6


def surface(shape=(60, 90), step=20e-6, seed=1, rough=0.2e-6):
    """A tilted, wavy, rough face."""
    random = np.random.default_rng(seed)
    x, y = (np.arange(n) * step for n in shape)
    z = 3e-3 * x[:, None] - 1e-3 * y + 2e-6 * np.cos(2 * np.pi * x / 0.9e-3)[:, None]
    return HeightMap(x, y, z + rough * random.standard_normal(shape), "face")


def rig_nodes():
    x, y = np.meshgrid(np.linspace(-1e-3, 1e-3, 5), np.linspace(-2.5e-3, 2.5e-3, 11), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()])


# ---- readers ----


def with_hole():
    face = surface((7, 5))
    face.z[2, 3] = np.nan
    return face


def write_xyz(path, face):
    x, y = np.meshgrid(face.x, face.y, indexing="ij")
    rows = np.column_stack([x.ravel(), y.ravel(), face.z.ravel()]) / MICRO
    rows = np.random.default_rng(0).permutation(rows[np.isfinite(rows[:, 2])])
    np.savetxt(path, rows, header="X Y Z in um", fmt="%.10g")


def sdf_text(face, version="ISO-1.0", **changes):
    entries = {
        "ManufacID": "test", "CreateDate": "010120260000", "ModDate": "010120260000", "NumPoints": len(face.x),
        "NumProfiles": len(face.y), "Xscale": 20e-6, "Yscale": 20e-6, "Zscale": MICRO, "Zresolution": -1,
        "Compression": 0, "DataType": 7, "CheckType": 0,
    }  # fmt: skip
    entries |= changes
    profiles = face.z.T[::-1] if version == "BCR-1.0" else face.z.T
    values = ["BAD" if np.isnan(value) else f"{value / MICRO:.12g}" for value in profiles.ravel()]
    head = "".join(f"{key:12s}= {value}\r\n" for key, value in entries.items() if value is not None)
    return f"a{version}\r\n{head}*\r\n" + "\r\n".join(values) + "\r\n*\r\nOperator = me\r\n*\r\n"


def sdf_binary(face, version, kind, code, bad):
    scale = 1e-10
    profiles = face.z.T[::-1] if version == "BCR-1.0" else face.z.T
    stored = np.where(np.isnan(profiles), bad, np.rint(profiles / scale)).astype(kind)
    count = "II" if version == "ISO-2.0" else "HH"
    head = struct.pack(
        f"<8s10s12s12s{count}4d3B", f"b{version}".encode(), b"test", b"010120260000", b"010120260000",
        len(face.x), len(face.y), 20e-6, 20e-6, scale, -1.0, 0, code, 0,
    )  # fmt: skip
    return head + stored.tobytes() + b"trailer"


def through_xyz(folder):
    write_xyz(folder / "face.xyz", with_hole())
    return read(folder / "face.xyz", lateral_unit=MICRO, height_unit=MICRO)


def through_matrix(folder):
    rows = [";".join(f"{value / MICRO:.12g}".replace(".", ",") for value in profile) for profile in with_hole().z.T]
    (folder / "face.csv").write_text("height in um\n" + "\n".join(rows))
    return read(folder / "face.csv", spacing=(20e-3, 20e-3), lateral_unit=1e-3, height_unit=MICRO)


def through_sdf_text(folder, version="ISO-1.0"):
    (folder / "face.sdf").write_bytes(sdf_text(with_hole(), version).encode())
    return read(folder / "face.sdf")


def through_sdf_binary(folder, *arguments):
    (folder / "face.sdf").write_bytes(sdf_binary(with_hole(), *arguments))
    return read(folder / "face.sdf")


@pytest.mark.parametrize(("reader", "arguments"), [
    (through_xyz, ()),
    (through_matrix, ()),
    (through_sdf_text, ("ISO-1.0",)),
    (through_sdf_text, ("BCR-1.0",)),
    (through_sdf_binary, ("ISO-1.0", "<i4", 6, -(2**31))),
    (through_sdf_binary, ("ISO-2.0", "<f8", 7, -np.finfo(float).max)),
    (through_sdf_binary, ("BCR-1.0", "<i4", 6, 2**31 - 1)),
])  # fmt: skip
def test_every_format_gives_the_same_map(reader, arguments, tmp_path):
    face, back = with_hole(), reader(tmp_path, *arguments)
    np.testing.assert_allclose(back.x, face.x, atol=1e-15)
    np.testing.assert_allclose(back.y, face.y, atol=1e-15)
    np.testing.assert_allclose(back.z, face.z, atol=1e-10)  # the holes are in the same place too


def test_other_formats_go_through_the_optional_reader(tmp_path, monkeypatch):
    face = surface((6, 5))
    (tmp_path / "face.sur").write_bytes(b"DIGITAL SURF")
    monkeypatch.setitem(sys.modules, "surfalize", None)
    with pytest.raises(ValueError, match=r"tribodyn\[surfaces\]"):
        read(tmp_path / "face.sur")

    loaded = SimpleNamespace(data=face.z.T / MICRO, step_x=20.0, step_y=20.0)  # micrometres, rows along y
    stand_in = SimpleNamespace(Surface=SimpleNamespace(load=lambda path: loaded))
    monkeypatch.setitem(sys.modules, "surfalize", stand_in)
    np.testing.assert_allclose(read(tmp_path / "face.sur").z, face.z, rtol=1e-12)


def test_a_real_digital_surf_file(tmp_path):
    surfalize = pytest.importorskip("surfalize")
    face = surface((40, 30))
    surfalize.Surface(face.z.T / MICRO, 20.0, 20.0).save(tmp_path / "face.sur")
    np.testing.assert_allclose(read(tmp_path / "face.sur").z, face.z, atol=1e-12)


# ---- repairs ----


def test_levelling_takes_the_plane_and_nothing_else():
    face = surface(rough=0.0)
    x, y = np.meshgrid(face.x, face.y, indexing="ij")
    levelled = level(replace(face, z=face.z + 5e-3 * x + 7e-3 * y + 1e-4))
    np.testing.assert_allclose(levelled.z, level(face).z, atol=1e-18)
    for weight in (np.ones_like(x), x, y):
        assert abs((weight * levelled.z).sum()) < 1e-12 * (abs(weight) * abs(face.z)).sum()


def test_spikes_are_taken_out_and_reported():
    face = surface()
    spiked = face.z.copy()
    places = [(3, 4), (30, 50), (31, 50), (59, 89)]
    for k, place in enumerate(places):
        spiked[place] += (-1) ** k * 40e-6
    cleaned, message = remove_outliers(replace(face, z=spiked))
    assert sorted(map(tuple, np.argwhere(np.isnan(cleaned.z)))) == places
    assert len(message) == 1
    assert "4 spikes" in message[0]
    assert remove_outliers(face) == (face, [])


def test_holes_are_filled_without_overshoot_and_planes_are_kept():
    face = surface(rough=0.0)
    x, y = np.meshgrid(face.x, face.y, indexing="ij")
    plane = 1e-3 * x - 2e-3 * y
    holed = plane.copy()
    holed[10:20, 30:45] = np.nan
    holed[40, 60] = np.nan
    filled, message = fill_holes(replace(face, z=holed))
    np.testing.assert_allclose(filled.z, plane, atol=1e-15)
    assert "151 points" in message[0]
    rim = surface()
    rim.z[:8, :8] = np.nan  # a corner: the surface goes on from its rim
    corner, _ = fill_holes(rim)
    neighbourhood = np.concatenate([rim.z[8, :9], rim.z[:9, 8]])
    assert neighbourhood.min() <= corner.z[:8, :8].min()
    assert corner.z[:8, :8].max() <= neighbourhood.max()


# ---- filter ----


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_filter_passes_waves_as_iso_16610_says(ratio):
    cutoff, step = 0.4e-3, 10e-6
    x, y = np.arange(400) * step, np.arange(120) * step
    wave = np.cos(2 * np.pi * x / (ratio * cutoff))[:, None] + np.zeros_like(y)
    waviness, roughness = split(HeightMap(x, y, wave), cutoff)
    inner = slice(60, -60)
    transmitted = (waviness.z[inner] * wave[inner]).sum() / (wave[inner] ** 2).sum()
    # ISO 16610-21: one half at the cut-off
    assert transmitted == pytest.approx(np.exp(-np.log(2) / ratio**2), abs=2e-3)
    np.testing.assert_allclose(waviness.z + roughness.z, wave, atol=1e-15)


def test_filter_keeps_planes_up_to_the_edges_and_is_direct():
    face = surface((50, 40))
    x, y = np.meshgrid(face.x, face.y, indexing="ij")
    plane = 1e-3 * x + 2e-3 * y + 3 * x * y
    waviness, _ = split(replace(face, z=plane), 0.3e-3)
    np.testing.assert_allclose(waviness.z, plane, atol=1e-12 * plane.max())
    # one point by weighted least squares in both directions, in a corner where the weights are cut off
    waviness, _ = split(face, 0.3e-3)
    i, j = 2, 1
    weights = np.exp(-np.pi * ((x - x[i, j]) ** 2 + (y - y[i, j]) ** 2) / (np.log(2) / np.pi * 0.3e-3**2))
    nearby = (abs(x - x[i, j]) < 0.3001e-3) & (abs(y - y[i, j]) < 0.3001e-3)
    u, v = (x - x[i, j])[nearby] / 1e-4, (y - y[i, j])[nearby] / 1e-4
    terms = np.column_stack([np.ones_like(u), u, v, u * v]) * np.sqrt(weights[nearby])[:, None]
    fitted = np.linalg.lstsq(terms, face.z[nearby] * np.sqrt(weights[nearby]), rcond=None)[0][0]
    assert waviness.z[i, j] == pytest.approx(fitted, rel=1e-9)


# ---- nodes and gap ----


def test_nodes_get_the_mean_over_their_tributary_area():
    x, y = np.arange(-102, 103) * 10e-6, np.arange(-252, 253) * 10e-6
    flat = HeightMap(x, y, np.full((205, 505), 2e-6))
    np.testing.assert_allclose(onto_nodes(flat, rig_nodes()), 2e-6)
    tilted = HeightMap(x, y, 1e-3 * x[:, None] + np.zeros(505))
    heights = onto_nodes(tilted, rig_nodes()).reshape(5, 11)
    # inner nodes see their own place, those at the edge the middle of their half cell
    expected = 1e-6 * np.array([-0.875, -0.5, 0, 0.5, 0.875])
    np.testing.assert_allclose(heights, np.tile(expected[:, None], 11), atol=1e-9)
    bowl = HeightMap(x, y, x[:, None] ** 2 + y**2)
    area = np.outer([0.5, 1, 1, 1, 0.5], [0.5, *[1] * 9, 0.5]).ravel()
    exact = ((1e-3) ** 2 + (2.5e-3) ** 2) / 3
    assert onto_nodes(bowl, rig_nodes()) @ area / area.sum() == pytest.approx(exact, rel=1e-3)


def test_first_touch_and_mating_height():
    first, second = np.array([1.0, 3.0, 2.0]) * MICRO, np.array([0.5, -1.0, 1.5]) * MICRO
    np.testing.assert_allclose(facing_gap(first, second), np.array([2.0, 1.5, 0.0]) * MICRO, atol=1e-20)
    assert facing_gap(first, second, mating_height=3e-6).min() == pytest.approx(-3e-6)
    assert facing_gap(first, second, mating_height=-3e-6).min() == pytest.approx(3e-6)


def test_placing_and_facing():
    face = surface((6, 5))
    assert centred(face).x.mean() == pytest.approx(0.0, abs=1e-12)
    assert centred(face).y[0] == pytest.approx(-centred(face).y[-1])
    np.testing.assert_array_equal(mirrored(face, "x").z[0], face.z[-1])
    with pytest.raises(ValueError, match="give x or y"):
        mirrored(face, "z")


def test_synthetic_pair_touches_at_its_two_ridges():
    first, second = synthetic_pair(7)
    repeated, _ = synthetic_pair(7)
    np.testing.assert_array_equal(first.z, repeated.z)
    assert not np.array_equal(first.z, synthetic_pair(8)[0].z)
    levelled, repairs = zip(*(repair(face, expected_size=(2e-3, 5e-3)) for face in (first, second)), strict=True)
    assert repairs == ((), ())
    waves = [split(face, 0.8e-3) for face in levelled]
    gap = facing_gap(*(onto_nodes(waviness, rig_nodes()) for waviness, _ in waves)).reshape(5, 11)
    assert gap[[0, -1]].mean() < 1.5e-6 < 4e-6 < gap[2].mean()
    assert gap.argmin() // 11 in (0, 4)
    assert waves[0][1].z.std() == pytest.approx(1e-6, rel=0.1)


def test_damaged_measurement_comes_out_like_the_sound_one():
    sound, _ = synthetic_pair(3)
    damaged = sound.z.copy()
    damaged[np.random.default_rng(5).random(sound.z.shape) < 0.02] = np.nan
    damaged[60:72, 300:330] = np.nan
    damaged[120, 40] = 1e-3
    tilted = damaged + 2e-2 * sound.x[:, None]
    mended, repairs = repair(replace(sound, z=tilted))
    assert len(repairs) == 2
    waviness, expected = split(mended, 0.8e-3)[0], split(repair(sound)[0], 0.8e-3)[0]
    assert abs(waviness.z - expected.z).max() < 0.4e-6
    assert abs(onto_nodes(waviness, rig_nodes()) - onto_nodes(expected, rig_nodes())).max() < 0.15e-6


# ---- garbage ----


def of(**changes):
    face = surface()
    return HeightMap(**({"x": face.x, "y": face.y, "z": face.z, "name": "face"} | changes))


def noise():
    random = np.random.default_rng(0)
    z = surface().z.copy()
    z[random.random(z.shape) < 0.2] += 1e-4
    return of(z=z)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: check(of(z=np.full((60, 90), np.nan))), "no point has a height"),
    (lambda: check(of(z=surface().z * 1e6)), "median slope is .* give the height unit"),
    (lambda: check(of(z=surface().z * 1e-7)), "less than an atom"),
    (lambda: check(of(x=surface().x * 1e6)), "give the lateral unit"),
    (lambda: check(surface(), (2e-3, 5e-3)), "it covers 0.00118 m in x but the contact 0.002 m"),
    (lambda: check(surface(), (1e-4, 1.7e-3)), "are map and unit right"),
    (lambda: of(z=surface().z[:, :-1]), "axes 60 and 90 points"),
    (lambda: of(x=surface().x[:3], z=surface().z[:3]), "too few"),
    (lambda: of(x=surface().x ** 2), "equal steps"),
    (lambda: remove_outliers(noise()), "this is noise"),
    (lambda: fill_holes(of(z=np.where(np.arange(60)[:, None] < 20, np.nan, surface().z))), "33 % of its points"),
    (lambda: split(of(z=with_nan()), 0.3e-3), "fill the holes"),
    (lambda: split(surface(), 5e-3), "cutoff 0.005 m must lie between"),
    (lambda: onto_nodes(surface(), rig_nodes()), "centre it on the patch"),
    (lambda: onto_nodes(surface(), surface().x[:5, None] * [1.0, 1.0]), "on a line"),
    (lambda: facing_gap(np.array([np.nan]), np.zeros(1)), "no height"),
    (lambda: synthetic_pair(1, spacing=0.0), "must be positive"),
])  # fmt: skip
def test_garbage_is_refused_in_one_sentence(call, words):
    with pytest.raises(ValueError, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)


def with_nan():
    z = surface().z.copy()
    z[5, 5] = np.nan
    return z


@pytest.mark.parametrize(("name", "content", "options", "words"), [
    ("none.xyz", None, {}, "there is no height map"),
    ("a.txt", "hello\n", {}, "holds no numbers"),
    ("a.txt", "", {}, "a.txt is empty"),
    ("a.sdf", "", {}, "a.sdf is empty"),
    ("a.sur", "", {}, "a.sur is empty"),
    ("a.txt", "1 2 3\n4 5\n", {}, "lines of 2 to 3 numbers"),
    ("a.txt", "1 2 3\noops 5 6\n", {}, "words in line 2"),
    ("a.txt", "1 2 3 4\n5 6 7 8\n", {}, "give spacing"),
    ("a.txt", "0 0 1\n0 1 2\n1 0 3\n1.37 1 4\n3 0 2\n", {}, "off a regular grid"),
    ("a.txt", "0 0 1\n0 0 1\n1 0 1\n1 1 1\n", {}, "twice"),
    ("a.txt", "1 2\n3 4\n", {"spacing": (1.0, -1.0)}, "two positive steps"),
    ("a.sdf", sdf_text(surface((5, 4)), Zscale=None), {}, "lacks a number for Zscale"),
    ("a.sdf", sdf_text(surface((5, 4)), NumPoints=6), {}, "holds 20 heights but announces 6 x 4"),
    ("a.sdf", sdf_text(surface((5, 4)), Yscale=0), {}, "scale of zero"),
    ("a.sdf", sdf_text(surface((5, 4)), DataType=9), {}, "DataType 9"),
    ("a.sdf", sdf_text(surface((5, 4)), Compression=1), {}, "compressed"),
    ("a.sdf", sdf_text(surface((5, 4))), {"height_unit": MICRO}, "carries its own units"),
    ("a.sdf", "bISO-1.0 short", {}, "ends within its header"),
])  # fmt: skip
def test_bad_files_are_refused_in_one_sentence(name, content, options, words, tmp_path):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=words) as refusal:
        read(tmp_path / name, **options)
    assert "\n" not in str(refusal.value)
