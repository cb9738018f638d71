"""NLstep's beam as a scene of matrices without mass at its contact, and what the springs there do."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import tribodyn as td
from proof.bench import problem as problems, tribodyn_columns
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.workflows.errors import contact_springs, ladders
from tribodyn.workflows.errors.change_table import ChangeTable
from tribodyn.workflows.errors.judgement import total_error
from tribodyn.workflows.errors.operating_states import OperatingState
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import convergence
from tribodyn.workflows.studies.verification import verify

RIGID = 7.06024391e-5  # amplitude of NLstep at 46 Hz [m]

BEAM = """
model = {file = "nlstep.npz", names = {mass = "beam_M", stiffness = "beam_K", damping = "beam_D"}}
harmonics = {kept = [0, 1, 2, 3]}
verdict = {enabled = false}
[contact]
dofs = [[0]]
components = ["t1"]
law = "jenkins_constant"
tangential_stiffness = 2.84380788e11
friction = 1.0
normal_load = "1500 N"
area = "1 cm2"
[loads.harmonic.force]
vector = {variable = "beam_F"}
value = "1 N"
[response]
vector = {variable = "beam_row"}
frequency = ["36 Hz", "46 Hz"]
points = 6
"""


@pytest.fixture
def beam(tmp_path: Path) -> Path:
    shutil.copy(Path(__file__).parents[1] / "hbm" / "nlstep.npz", tmp_path)
    scene = tmp_path / "beam.toml"
    scene.write_text(BEAM)
    return scene


def test_a_contact_without_mass_runs_and_is_verified_without_springs(beam: Path) -> None:
    result = td.run(beam)
    matrices = dict(np.load(beam.with_name("nlstep.npz")))
    matrices["beam_M"][0, 0] = 1e-4
    np.savez(beam.with_name("nlstep.npz"), **matrices)
    light = td.run(beam)
    assert result.summary()["amplitude"]["first"] == pytest.approx(light.summary()["amplitude"]["first"], rel=1e-5)
    rigid = verify(result, 46.0, law="rigid")
    assert rigid.integration.motion.amplitude[0] == pytest.approx(RIGID, rel=5e-3)


def test_springs_of_a_closed_contact_have_a_stated_error(beam: Path) -> None:
    """It is by the limit of stiffer ones, which is NLstep's amplitude; springs of a compliance have none."""
    balance, site = td.build(scene_file.read(beam)).balance, AtFrequency("response", 2 * np.pi * 46.0)
    first = OperatingState(0.0, balance, site, site.solve(balance))

    def measured(springs: str, most: int) -> ChangeTable:
        file, run = scene_file.read(beam, [f"contact.springs={springs}"]), cast(Any, SimpleNamespace(wear_steps=0))
        table = ChangeTable(file, cast(Any, None), run, lambda _: None, replace(DEFAULT, max_unknowns=most))
        table.refine_springs(first)
        return table

    assert not measured("compliance", 64).rows
    (row,) = measured("closed", 64).of("amplitude")
    assert row.description == "springs up to 64 times as stiff, harmonics to 31"
    assert row.refined == pytest.approx(RIGID, rel=2e-3)
    harmonics = MeasuredChange(Refinement.HARMONICS, "amplitude", None, None, 0.0, "")
    error, _ = total_error([row, harmonics], None)
    assert (error or 0.0) > abs((row.value or 0.0) / RIGID - 1)
    few = measured("closed", 15).of("amplitude")
    assert total_error([*few, harmonics], None) == (
        None,
        "springs up to 4 times as stiff, harmonics to 7, without a limit yet",
    )


@pytest.mark.parametrize("ratio", [0.7, 1.5])
def test_den_hartog_has_his_numbers_in_the_limit(ratio: float) -> None:
    """A mass that slides all the time: springs and harmonics both err by per cents, their limit by 0.02 %.

    Source  Den Hartog 1931; stretch and lag are those of an undamped mass"""
    problem = problems.read("den_hartog_slides")
    structure = tribodyn_columns.balance_of(problem)
    start = structure.solve(ratio / (2 * np.pi))
    site = AtFrequency("output", ratio)
    first = OperatingState(0.0, structure.problem, site, site.solve_near(structure.problem, ratio, start.state.x))
    limits, factors, amplitudes = replace(DEFAULT, max_unknowns=300), list[float](), list[float]()
    for factor, state in contact_springs.stiffened(first, ["jenkins_constant"], limits):
        factors.append(factor)
        amplitudes.append(
            td.matrices.Cycle(state.balance, state.point.state, state.point.solution.outcome).amplitude("output")
        )
    stretch, lag = 1 / (1 - ratio**2), np.sin(np.pi / ratio) / (ratio * (1 + np.cos(np.pi / ratio)))
    exact = np.sqrt(stretch**2 - (0.5 * lag) ** 2)
    errors = np.abs(np.array(amplitudes) / exact - 1)
    assert errors[0] > 0.02
    assert errors[1:] / errors[:-1] == pytest.approx(0.5, abs=0.02)
    limit = ladders.springs_limit(factors, amplitudes, DEFAULT.floor)
    assert limit is not None
    assert limit.value == pytest.approx(exact, rel=2e-4)
    assert limit.order == pytest.approx(1.0, abs=0.05)  # by the root of the stiffness


def test_a_ladder_of_springs_has_its_harmonics_and_shares(beam: Path) -> None:
    ladder = convergence.converge(str(beam), settings=["contact_stiffness"], most=2)
    first, second = ladder.record()
    assert [first["setting"], second["setting"], first["of_the_scene"]] == ["1 x", "4 x", True]
    assert "harmonics.kept=[0, 1, 2, 3, 4, 5, 6, 7]" in second["overrides"]
    assert sum(second["shares"].values()) == pytest.approx(1.0)
    assert second["shares"]["slip"] > 0.5
    assert f"slip {second['shares']['slip']:.3f}" in ladder.lines()[2]
