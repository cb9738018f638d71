"""Flutter from a scene: which waves of the wheel, and the limit cycle that friction makes of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.wheel_scene import FLOW, WHEEL
from tribodyn.reduction.flow import Flow, aeroelastic
from tribodyn.reduction.wave_model import travelling_wave
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.run import modelling
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.studies.wheels import flutter, wheel_model as wheels

COEFFICIENTS = {0: 0.012j, 1: 0.012 + 0.002j, -1: -0.012 + 0.002j}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel") / "wheel.toml"
    text = WHEEL.replace("friction = 5.0", "friction = 0.3").replace('"2 %"', '"0.1 %"') + FLOW
    path.write_text(text, encoding="utf-8")
    return path


def test_waves_of_a_scene_have_the_eigenvalues_of_its_coefficients(scene: Path) -> None:
    """Also by nodal diameter, which is the same flow written otherwise."""
    file = scene_file.read(str(scene))
    computed = flutter.flutter(file).eigenvalues
    wheel = wheels.build(file)
    calm = modelling.damped(wheel.scene, travelling_wave(wheel.reduced, 1))
    expected = aeroelastic(calm, wheel.springs, Flow(COEFFICIENTS))
    assert computed == pytest.approx(expected, rel=1e-9)
    assert min(value.real for value in computed.values()) < 0 < max(value.real for value in computed.values())
    waves = [[j, (c := Flow(COEFFICIENTS).of_index(j, 6)).real, c.imag] for j in range(-2, 4)]
    repeated = flutter.flutter(file.changed("flow.influence=", f"flow.by_diameter={waves}")).eigenvalues
    assert repeated == pytest.approx(computed, rel=1e-9)


def test_a_limit_cycle_needs_no_load(scene: Path) -> None:
    """Time keeps it, and the balance in the flow holds there without harmonic loads and without added damping."""
    result = flutter.flutter(scene, 1e-6, 1e-3, points=20)
    flutters = {index for index, ratio in result.damping.items() if ratio < 0}
    assert set(result.cycles) == flutters
    cycles = [cycle for cycles, _ in result.cycles.values() for cycle in cycles]
    assert any(cycle.is_stable for cycle in cycles)
    for cycle in cycles:
        assert 1e-6 < cycle.amplitude < 1e-3
        moving = np.linalg.norm(cycle.state.flat[:, 1:])
        assert np.linalg.norm(cycle.state.residual) < 1e-4 * moving
    for cycles_of_wave, reason in result.cycles.values():
        assert cycles_of_wave or "the motion decays at all of them" in reason
    assert sum("limit cycle of wave" in line for line in result.lines()) == len(cycles)
    assert len(result.record()["limit_cycles"]) == len(cycles)


def test_the_command_tells_which_waves_flutter(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.app(["wheel", "flutter", str(scene), "--out", str(tmp_path), "--json"], result_action="return_value")
    record = json.loads(capsys.readouterr().out)
    assert {wave["index"] for wave in record["waves"]} == set(range(-2, 4))
    assert any(wave["damping"] < 0 for wave in record["waves"])
    assert (tmp_path / "flutter.png").stat().st_size > 5000
    assert (tmp_path / "flutter.csv").read_text(encoding="utf-8").startswith("index,frequency_Hz,damping")
    with pytest.raises(ValueError, match="give both amplitudes"):
        flutter.flutter(scene, 1e-6)


@pytest.mark.parametrize(("changes", "said"), [
    (("flow.by_diameter=[[0, 0, 0.01]]",), "either influence or by_diameter"),
    (("flow.influence=", "flow.by_diameter=[[0, 0, 0.01]]"), "a row for each of the 6 waves"),
    (("flow.influence=[[1, 0, 0.1], [1, 0, 0.2]]",), "a row is there twice"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(scene: Path, changes: tuple[str, ...], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        scene_file.read(str(scene), changes)


def test_a_scene_without_flow_is_refused() -> None:
    with pytest.raises(SceneError, match=r"blade has no \[flow\]"):
        flutter.flutter("blade")
