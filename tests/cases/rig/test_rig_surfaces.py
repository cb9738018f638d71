"""Height maps that a scene names: sound ones are taken, damaged ones mended and told, garbage ends with exit code 2."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import leave
from tribodyn.geometry.height_map import synthetic_pair
from tribodyn.workflows.scene import scene_file

MICRO = 1e6
SMALL = (
    "geometry.n_contact_length=3", "geometry.n_contact_width=5", "reduction.modes=5", "harmonics.kept=[0, 1]",
    "harmonics.samples=32", "response.method=natural", "response.points=2", "response.frequency=['240 Hz', '242 Hz']",
    "wear=", "verdict.enabled=false", "surfaces.synthetic=", "surfaces.first=face.xyz",
    "surfaces.lateral_unit=1 um", "surfaces.height_unit=1 um",
)  # fmt: skip


def write(folder: Path, damage=lambda z: z, lateral: float = MICRO, height: float = MICRO, cut: int = 0) -> Path:
    """A scene with one face as text x y z in micrometres; `damage` changes the heights."""
    face = synthetic_pair(3, spacing=25e-6)[0]
    x, z = (face.x[: len(face.x) - cut], damage(face.z.copy())[: len(face.x) - cut])
    at = np.stack(np.meshgrid(x, face.y, indexing="ij"), axis=-1).reshape(-1, 2)
    np.savetxt(folder / "face.xyz", np.column_stack([lateral * at, height * z.ravel()]), fmt="%.9g")
    scene = folder / "measured.toml"
    scene.write_text((scene_file.CASES / "rig" / "rig.toml").read_text(encoding="utf-8"), encoding="utf-8")
    return scene


def run(scene: Path, capsys: pytest.CaptureFixture[str], *overrides: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a small run of the scene."""
    words = ["run", str(scene), "--no-pictures", "--out", str(scene.parent / "out")]
    for override in (*SMALL, *overrides):
        words += ["--set", override]
    return leave(words, capsys)


def holes(share):
    def damage(z):
        z[np.random.default_rng(1).random(z.shape) < share] = np.nan
        return z

    return damage


def spikes(share):
    def damage(z):
        z[np.random.default_rng(2).random(z.shape) < share] += 1e-4
        return z

    return damage


@pytest.mark.parametrize(("damage", "repairs"), [
    (lambda z: z, ()),
    (holes(0.03), ("points without height",)),
    (spikes(0.002), ("spikes up to 0.0001", "points without height")),
    (lambda z: z + 2e-2 * np.linspace(0, 2e-3, z.shape[0])[:, None], ()),
], ids=["sound", "holes", "spikes", "tilted"])  # fmt: skip
def test_a_measured_face_is_taken_and_each_repair_is_told(damage, repairs, tmp_path, capsys):
    code, out, err = run(write(tmp_path, damage), capsys)
    assert code == 0, err
    rows = [line for line in out.splitlines() if line.startswith("face.xyz")]
    assert len(rows) == len(repairs)
    assert all(words in line for words, line in zip(repairs, rows, strict=True))


@pytest.mark.parametrize(
    ("change", "overrides", "words"),
    [
        ({"damage": holes(0.5)}, (), "have no height"),
        ({"damage": lambda z: np.full_like(z, np.nan)}, (), "no point has a height"),
        ({"damage": spikes(0.2)}, (), "this is noise"),
        ({"cut": 30}, (), "it covers 0.00125 m in x but the contact 0.002 m"),
        ({"lateral": 1e3}, (), "are map and unit right"),
        ({"lateral": 1e6}, ("surfaces.lateral_unit=1 m",), "give the lateral unit"),
        ({}, ("surfaces.height_unit=1 m",), "give the height unit"),
        ({"height": 1e-6}, (), "less than an atom"),
        ({}, ("surfaces.axes=['t1', 't2']",), "it covers 0.002 m in x but the contact 0.005 m"),
        ({}, ("surfaces.cutoff=20 um",), "must lie between two steps of the grid"),
        ({}, ("surfaces.first=nowhere.xyz",), "there is no height map"),
        ({}, ("surfaces.mating_height=3",), 'give its unit, "3 um"'),
    ],
    ids=["half holes", "nothing", "noise", "too small", "millimetres", "metres", "height", "flat", "turned", "cutoff",
         "no file", "no unit"],
)  # fmt: skip
def test_garbage_is_one_sentence_and_exit_code_2(change, overrides, words, tmp_path, capsys):
    code, _, err = run(write(tmp_path, **change), capsys, *overrides)
    assert code == 2
    sentence = err.strip().splitlines()[-1]
    assert sentence.startswith("tribodyn: ")
    assert words in sentence
    assert sentence.endswith((".", "?"))
