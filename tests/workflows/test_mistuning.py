"""Sectors that differ, on a wheel with a flexible disk, which is not the scene that the study was made for."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm import newton
from tribodyn.hbm.derivatives import cycle_derivatives
from tribodyn.hbm.harmonics import amplitude
from tribodyn.reduction.linear import linear_modes
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.wheels import unequal_sectors, wheel_model as wheels


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel") / "wheel.toml"
    path.write_text(WHEEL, encoding="utf-8")
    return path


def test_drawn_factors_have_the_mean_and_the_spread_asked_for() -> None:
    factors = unequal_sectors.deviations(12, 0.03, 4)
    assert factors.mean() == pytest.approx(1.0)
    assert factors.std() == pytest.approx(0.03)
    np.testing.assert_array_equal(factors, unequal_sectors.deviations(12, 0.03, 4))
    assert not np.allclose(factors, unequal_sectors.deviations(12, 0.03, 5))
    with pytest.raises(ValueError, match="above 0"):
        unequal_sectors.deviations(12, 0.9, 4)


def test_factors_that_move_on_by_a_sector_move_the_amplitudes_on(scene: Path) -> None:
    """Which sector is counted first does not matter but for the phase of the load."""
    wheel = wheels.build(scene_file.read(str(scene)))
    factors, heights = np.array([1.04, 0.97, 1.0, 1.01, 0.99, 1.02]), []
    for turn in (0, 2):
        balance = wheel.whole_wheel([float(factor) for factor in np.roll(factors, turn)])
        solution = newton.solve_from_rest(balance, 2 * np.pi * 402)
        assert solution.converged
        rows = [balance.compliance.output_names.index(f"response@{n}") for n in range(6)]
        heights.append(amplitude(balance.outputs(solution.state)[rows], balance.basis.harmonics))
    assert np.ptp(heights[0]) > 0.02 * heights[0].max()
    np.testing.assert_allclose(heights[1], np.roll(heights[0], 2), rtol=1e-6)


def test_factors_act_on_the_elastic_stiffness_of_a_wheel_that_turns(scene: Path) -> None:
    """As Young's modulus does: the stress that stiffens the wheel is that of its speed."""
    text, factor = str(scene), 1.04
    frequency = []
    for young, of_sectors in ((210, 1.0), (210, factor), (210 * factor, 1.0)):
        file = scene_file.read(text, ("wheel.speed=12000 rpm", f"material.young={young} GPa"))
        frequency.append(linear_modes(wheels.build(file).whole_wheel([of_sectors] * 6).model, n=6)[0])
    at_speed, scaled, harder = frequency
    assert np.abs(scaled - harder).max() < 0.05 * np.abs(np.sqrt(factor) * at_speed - harder).min()


def test_sectors_alike_are_amplified_by_nothing(scene: Path) -> None:
    computed = unequal_sectors.mistuned(scene, np.ones(6))
    assert computed.record()["amplitude"] == pytest.approx(computed.record()["amplitude_alike"], rel=5e-3)
    assert "it has no derivatives by the factors: the response is highest at an end" in computed.lines()[-1]
    assert computed.record()["derivatives"] is computed.amplification is None


SLOW = ("modal='2 %', state='stuck'", "mass=20.0, stiffness='1e-5 s'")


@pytest.mark.parametrize("damping", ["modal='2 %'", *(pytest.param(end, marks=pytest.mark.slow) for end in SLOW)])
def test_derivatives_by_the_factors_are_those_of_other_wheels(scene: Path, damping: str) -> None:
    """Of a wheel that slips at its peak, along a direction in which every sector has a part of its own."""
    nearby = ("contact.friction=0.3", "harmonics.transitions=located", "response.frequency=['822 Hz', '834 Hz']")
    overrides = (*nearby, f"damping={{{damping}}}")
    factors, way = unequal_sectors.deviations(6, 0.02, 1), np.array([0.4, -1.0, 0.7, 0.9, -0.3, -0.6])
    wheel, solved = (
        wheels.build(scene_file.read(str(scene), overrides)),
        unequal_sectors.mistuned(scene, overrides=overrides),
    )
    computed, output = solved.peak.derivatives, f"response@{solved.record()['worst_sector']}"
    assert computed.values[list(computed.names).index("energy")] > 0
    step = 3e-5
    ends = (wheel.whole_wheel([float(end) for end in factors + side * way]) for side in (step, -step))
    up, down = (cycle_derivatives.at_peak(end, computed.state, output, ()).values[:2] for end in ends)
    off, size = computed.slopes[:2] @ way - (up - down) / (2 * step), np.linalg.norm(computed.slopes[:2], axis=1)
    assert (abs(off) < 1e-5 * size).all(), off / size


def test_a_wheel_shows_the_derivatives_of_its_peak(scene: Path, tmp_path: Path) -> None:
    overrides = ("response.frequency=['640 Hz', '680 Hz']",)
    computed = unequal_sectors.mistuned(scene, spread=0.02, overrides=overrides)
    rows = computed.record()["derivatives"]["elasticities"]
    size = [abs(row["amplitude"]) for row in rows.values()]
    assert size == sorted(size, reverse=True)
    assert sum(row["peak_frequency"] for row in rows.values()) == pytest.approx(0.263, abs=0.002)
    assert (
        f"to first order a scatter of 0.1 % of all factors scatters the amplitude by {np.linalg.norm(size) / 10:.3g} %"
        in str(computed)
    )
    assert tmp_path / "derivatives.csv" in computed.write(tmp_path)


def test_damping_by_two_modes_of_a_wheel_has_no_derivatives(scene: Path) -> None:
    pair = ("response.frequency=['640 Hz', '680 Hz']", "damping={ratios=['2 %', '2 %'], modes=[0, 6]}")
    computed = unequal_sectors.mistuned(scene, overrides=pair)
    assert computed.lines()[-1].endswith("give damping.modal, or mass and stiffness")
    by_mode = (pair[0], "damping={modal=['2 %', '1 %']}")
    assert unequal_sectors.mistuned(scene, overrides=by_mode).lines()[-1].endswith("give one for all")


def test_the_command_takes_any_wheel(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.app(["wheel", "mistuned", str(scene), "--spread", "3 %", "--seed", "2", "--out", str(tmp_path), "--json"],
            result_action="return_value")  # fmt: skip
    record = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(record["stiffness"], unequal_sectors.deviations(6, 0.03, 2))
    assert (tmp_path / "mistuned.csv").read_text(encoding="utf-8").startswith("frequency_Hz,sector_0_m")


def test_what_cannot_be_is_one_sentence(scene: Path) -> None:
    with pytest.raises(ValueError, match=r"beam has no \[wheel\]"):
        unequal_sectors.mistuned("beam")
    with pytest.raises(ValueError, match="6 sectors, but there are 2 factors"):
        unequal_sectors.mistuned(scene, [1.0, 1.1])
