"""A published backbone beside a scene: what is read, and how ours stands beside it."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers.command import refusal
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.curves import backbones
from tribodyn.workflows.studies.curves.backbones import published_backbone

TABLE = """[backbone]
source = "others"
modal_amplitude = [1e-6, 1e-5, 1e-4]
frequency_hz = [100, 99, 96]
damping = [1e-3, 2e-3, 4e-3]
"""


def given(folder: Path, text: str) -> scene_file.SceneFile:
    shutil.copy(scene_file.find("beam"), folder / "mine.toml")
    (folder / "mine.published.toml").write_text(text)
    return scene_file.read(str(folder / "mine.toml"))


def test_ours_stands_at_the_published_amplitudes_that_it_has_reached(tmp_path: Path):
    published = published_backbone(given(tmp_path, TABLE))
    assert published is not None
    a = np.geomspace(1e-7, 5e-5, 60)
    curve = SimpleNamespace(converged=a > 0, modal_amplitude=a, frequency=200 - np.log10(a), damping=1e-3 + 0 * a)
    message = backbones.differences_from(curve, published)
    assert message["source"] == "others"
    assert [row["modal_amplitude"] for row in message["rows"]] == [1e-6, 1e-5]
    last = message["rows"][-1]
    assert (last["frequency_hz"], last["damping"], last["shift"]) == (99.0, 2e-3, pytest.approx(-0.01))
    assert last["our_frequency_hz"] == pytest.approx(205.0)
    assert last["our_shift"] == pytest.approx(205 / 206 - 1)
    assert last["our_damping"] == pytest.approx(1e-3)


@pytest.mark.parametrize("change", [("damping", "dumping"), ("[100, 99, 96]", "[100, 99]"), ("1e-5", "1e-7")])
def test_an_incomplete_table_is_one_sentence(tmp_path: Path, change: tuple[str, str], capsys):
    given(tmp_path, TABLE.replace(*change))
    words = [
        "curve", "backbone", str(tmp_path / "mine.toml"), "--from", "1um", "--to", "2um", "--out",
        str(tmp_path / "out"),
    ]  # fmt: skip
    assert "mine.published.toml: [backbone] needs" in refusal(words, capsys)


def test_a_scene_without_one_has_none():
    assert published_backbone(scene_file.read("blade")) is None
