"""Patterns of blades that differ, drawn and solved by the command; the wear of one of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import WHEEL
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.scene.wheel_tables import Mistuning
from tribodyn.workflows.studies.wheels import mistuned_blades, patterns

CHANGED = {
    '["400 Hz", "404 Hz"]': '["750 Hz", "880 Hz"]',
    "friction = 5.0": "friction = 0.3",
    '"-0.1 mm"': '"-0.2 mm"',
    '"20 N"': '"100 N"',
}
DIFFER = """
[mistuning]
frequency = "1 %"
friction = "10 %"
gap = "5 um"
families = 1
left_out = 0.01
patterns = 2

[wear]
coefficient = "1e5 um3/J"
step = "5 um"
max_steps = 2
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel") / "wheel.toml"
    text = WHEEL
    for before, after in CHANGED.items():
        assert before in text
        text = text.replace(before, after)
    path.write_text(text + DIFFER, encoding="utf-8")
    return path


def test_a_pattern_depends_on_seed_and_number_alone() -> None:
    requested = Mistuning(frequency=0.02, friction=0.1, gap=1e-6, patterns=3)
    extra = requested.model_copy(update={"patterns": 9})
    item, repeated = mistuned_blades.drawn(requested, 400, 7), mistuned_blades.drawn(extra, 400, 7)
    np.testing.assert_array_equal(item.stiffness, repeated.stiffness)
    assert np.sqrt(1 + item.stiffness).std() == pytest.approx(0.02, rel=0.1)
    assert item.friction.std() == pytest.approx(0.1, rel=0.1)
    assert item.gap.std() == pytest.approx(1e-6, rel=0.1)
    assert abs(np.corrcoef(item.stiffness, item.friction)[0, 1]) < 0.2
    assert not np.allclose(item.stiffness, mistuned_blades.drawn(requested, 400, 8).stiffness)


def test_the_command_draws_patterns_and_resumes(scene, tmp_path, capsys):
    words = ["wheel", "patterns", str(scene), "--workers", "1", "--out", str(tmp_path), "--json"]
    cli.app(words, result_action="return_value")
    record = json.loads(capsys.readouterr().out)
    assert record["complete"] == 2
    assert 1.0 < record["largest"] < record["whitehead"] == pytest.approx(0.5 * (1 + np.sqrt(6)))
    assert (tmp_path / "mistuning.png").stat().st_size > 5000
    table = (tmp_path / "patterns.csv").read_text(encoding="utf-8").splitlines()
    assert table[0].startswith("pattern,status,amplification,amplitude,peak_frequency,blade")
    cli.app(words, result_action="return_value")
    assert json.loads(capsys.readouterr().out) == record


def test_blades_alike_amplify_nothing(scene: Path) -> None:
    """The search for the highest peak of the whole wheel finds that of the wave."""
    file = scene_file.read(str(scene), ("mistuning.frequency=0", "mistuning.friction=0"))
    blades = mistuned_blades.MistunedBlades.of(file)
    none = np.zeros(6)
    result, _ = blades.peak(mistuned_blades.Pattern(0, none, none, none))
    assert result.amplitude == pytest.approx(blades.tuned.amplitude, rel=1e-4)
    assert result.state.omega == pytest.approx(blades.tuned.state.omega, rel=1e-4)


def test_what_cannot_be_is_one_sentence(scene: Path, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"blade has no \[mistuning\]"):
        patterns.patterns("blade", tmp_path)
    with pytest.raises(SceneError, match=r"wheel is missing"):
        scene_file.read("beam", ('mistuning.frequency="1 %"',))
    with pytest.raises(SceneError, match=r"mistuning\.frequency"):
        scene_file.read(str(scene), ("mistuning.frequency=2",))
    with pytest.raises(SceneError, match="unknown"):
        mistuned_blades.MistunedBlades.of(scene_file.read(str(scene), ('mistuning.body="blade"',)))
