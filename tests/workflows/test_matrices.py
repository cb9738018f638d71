"""Models that come as matrices: a scene of a file and DOF lists, end to end, and its rooms one by one."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import printed_text, refusal
from tests.helpers.matrix_scene import SCENE, matrix_folder
from tests.helpers.verification_models import random_structure
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import thesis
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.reduction.foreign import read_matrices, reduced_model
from tribodyn.workflows.result import store
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import parse, read


def test_a_scene_of_matrices_runs_to_wear_and_pictures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = ["--set", "verdict.enabled=false"]
    out = printed_text(["run", str(folder / "own.toml"), "--out", str(folder / "out"), *short], capsys)
    assert "18 DOFs; 2 node pairs" in out
    assert (folder / "out" / "pictures" / "frf.png").is_file()
    assert (folder / "out" / "pictures" / "hysteresis.png").is_file()
    result = store.load(folder / "out" / "result.h5")
    assert result.state == "complete: stopped after 4 wear steps"
    assert result.response.output_names == ("response", "mid")
    assert set(result.response.outcome) == {CONVERGED}
    assert result.wear.worn[:-1].max(axis=1) == pytest.approx(1e-6, rel=1e-3)  # the step of the scene, whole cycles
    # worn volume is the coefficient times the friction work
    assert result.wear.worn.sum(0) @ np.full(2, 5e-6) == pytest.approx(2e-15 * result.wear.work.sum(), rel=1e-12)
    for command in (["show", "--json"], ["draw"], ["verify", "--at", "60 Hz", "--steps", "128", "--json"]):
        out = printed_text([command[0], str(folder / "out"), *command[1:]], capsys)
    assert json.loads(out)["frequency_hz"] == pytest.approx(60)
    out = printed_text(["plan", str(folder / "own.toml")], capsys)
    assert "2 node pairs" in out


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scene and its matrices, and with lists that a scene may name."""
    return matrix_folder(tmp_path)


def test_the_scene_is_the_same_as_the_rooms_in_turn(folder: Path) -> None:
    """Matrices, contact, balance, response and wear made one by one give what the scene gives.

    With located transitions: sampled ones put kinks into the curve, among which rounding chooses the peak."""
    matrices = read_matrices(folder / "part.npz")
    system = matrices.system(loads={"press": {2: 0.5, 5: 0.5}, "shaker": 8}, outputs={"tip": 9})
    contact = matrices.contact([[0, 1, 2], [3, 4, 5]], components=("t1", "t2", "n"), area=1e-5)
    springs = contact.stiffness(tangential=2e6, normal=3e6)
    joint = Joint("contact", "jenkins", ContactParameters.of(contact.components, springs, friction=0.4))
    excitation = Excitation.of({"press": 50.0}, {1: {"shaker": 20.0}})
    basis = HarmonicBasis((0, 1, 2, 3), transitions="located")
    balance = HarmonicBalance.of(reduced_model(system, contact), joint, basis, excitation, omega_max=900.0)
    ours = natural.follow(balance, 200.0, 800.0, natural.Options(n_points=60))
    wear = WearProblem(
        balance, (Duty(AtPeak("tip", 200.0, 800.0)),), JointWear.of("energy", coefficient=2e-15), contact.area
    )
    history = evolve(thesis.Rule(wear, 1e-6), max_steps=5)
    overrides = [
        f"response.frequency=['{200 / (2 * np.pi)!r} Hz', '{800 / (2 * np.pi)!r} Hz']", "response.points=60",
        "wear.max_steps=5", "harmonics.transitions=located", "verdict.enabled=false",
    ]  # fmt: skip
    result = pipeline.run(read(str(folder / "own.toml"), overrides), folder, Progress())
    assert result.response is not None
    theirs = result.response
    common = np.isin(theirs.omega, ours.omega)  # the scene's curve has its solved peaks, too
    assert theirs.amplitude("response")[common] == pytest.approx(ours.amplitude("tip"), rel=1e-6)
    assert theirs.amplitude("response").max() >= ours.amplitude("tip").max()
    assert result.wear.cycles == pytest.approx(history.cycles, rel=3e-5)  # within the resolution of peaks
    assert result.wear.depth == pytest.approx(history.depth, rel=1e-5)


def test_lists_may_stand_in_the_file_and_be_reduced(folder: Path) -> None:
    written = modelling.build(read(str(folder / "own.toml")), Progress()).balance
    named = [
        "contact.dofs={variable = 'touching'}", "contact.area={variable = 'areas'}",
        "contact.points={variable = 'corners'}", "response.dofs=", "response.vector={variable = 'tip'}",
        "reduction.modes=8",
    ]  # fmt: skip
    # every mode kept: Craig-Bampton is exact
    reduced = modelling.build(read(str(folder / "own.toml"), named), Progress())
    assert reduced.part is None
    assert reduced.reduced.interface.points[1, 0] == 1e-3
    stuck = [balance.compliance.at(300.0) for balance in (written, reduced.balance)]
    assert stuck[1].x_lin == pytest.approx(stuck[0].x_lin, rel=1e-7)
    assert stuck[1].outputs_lin == pytest.approx(stuck[0].outputs_lin, rel=1e-7)


def test_damping_is_that_of_the_files_or_of_the_scene(folder: Path) -> None:
    inputs = modelling.build(read(str(folder / "own.toml"), ["model.names.damping=C"]), Progress())
    assert inputs.reduced.system.damping == pytest.approx(random_structure(2, n_extra=12).system.damping)
    with pytest.raises(ValueError, match=r"hold a damping matrix: leave \[damping\] out"):
        modelling.build(read(str(folder / "own.toml"), ["damping.modal=1 %"]), Progress())


BAD = {
    "no file": ("model.file=gone.npz", "there is no file"),
    "no variable": ("contact.dofs={variable = 'faces'}", "has no variable 'faces'"),
    "no whole numbers": ("contact.dofs={variable = 'half'}", "not whole"),
    "no such DOF": ("response.dofs=[99]", "DOF 99 is outside 0 .. 17"),
    "not a list": ("response.dofs=9", "expected a list such as [17]"),
    "too short a row": ("contact.dofs=[[0, 1]]", "rows of 3 DOFs"),
    "a group": ("contact.group=foot", "unknown key contact.group"),
    "no labels": ('response.dofs=[[7, "z"]]', "no labels"),
    "no matrices": ("model.file=", "expected file"),
    "unit": ("contact.area=10 mm", "contact.area: expected"),
    "geometry": ("geometry.part=beam", "unknown key geometry"),
    "two kinds": ("response.vector={variable = 'tip'}", "expected either dofs = [17] or vector"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_is_one_sentence(case: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    override, words = BAD[case]
    where = ["--out", str(folder / "out")]
    assert words in refusal(["run", str(folder / "own.toml"), "--set", override, *where], capsys)
    assert not (folder / "out" / "result.h5").exists()


def test_a_scene_of_matrices_has_no_mesh() -> None:
    with pytest.raises(ValueError, match="made of matrices and has no mesh"):
        modelling.make_mesh(parse(SCENE, "own.toml"), Path())
