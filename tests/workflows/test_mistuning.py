"""Sectors that differ, on a wheel with a flexible disk, which is not the scene that the study was made for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import mistuning, wheel as wheels


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel") / "wheel.toml"
    path.write_text(WHEEL, encoding="utf-8")
    return path


def test_drawn_factors_have_the_mean_and_the_spread_asked_for() -> None:
    factors = mistuning.deviations(12, 0.03, 4)
    assert factors.mean() == pytest.approx(1.0)
    assert factors.std() == pytest.approx(0.03)
    np.testing.assert_array_equal(factors, mistuning.deviations(12, 0.03, 4))
    assert not np.allclose(factors, mistuning.deviations(12, 0.03, 5))
    with pytest.raises(ValueError, match="above 0"):
        mistuning.deviations(12, 0.9, 4)


def test_factors_that_move_on_by_a_sector_move_the_amplitudes_on(scene: Path) -> None:
    """Which sector is counted first does not matter but for the phase of the load."""
    wheel = wheels.build(scene_file.read(str(scene)))
    factors, heights = np.array([1.04, 0.97, 1.0, 1.01, 0.99, 1.02]), []
    for turn in (0, 2):
        balance = wheel.whole([float(factor) for factor in np.roll(factors, turn)])
        solution = newton.solve_from_rest(balance, 2 * np.pi * 402)
        assert solution.converged
        rows = [balance.compliance.output_names.index(f"response@{n}") for n in range(6)]
        heights.append(amplitude(balance.outputs(solution.state)[rows]))
    assert np.ptp(heights[0]) > 0.02 * heights[0].max()
    np.testing.assert_allclose(heights[1], np.roll(heights[0], 2), rtol=1e-6)


def test_sectors_alike_are_amplified_by_nothing(scene: Path) -> None:
    found = mistuning.mistuned(scene, np.ones(6))
    assert found.amplification == pytest.approx(1.0, rel=5e-3)


def test_the_command_takes_any_wheel(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.app(["wheel", "mistuned", str(scene), "--spread", "3 %", "--seed", "2", "--out", str(tmp_path), "--json"],
            result_action="return_value")  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(said["stiffness"], mistuning.deviations(6, 0.03, 2))
    assert (tmp_path / "mistuned.csv").read_text(encoding="utf-8").startswith("frequency_Hz,sector_0_m")


def test_what_cannot_be_is_one_sentence(scene: Path) -> None:
    with pytest.raises(ValueError, match=r"beam has no \[wheel\]"):
        mistuning.mistuned("beam")
    with pytest.raises(ValueError, match="6 sectors, but there are 2 factors"):
        mistuning.mistuned(scene, [1.0, 1.1])
