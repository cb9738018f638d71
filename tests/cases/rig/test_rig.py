"""The fretting rig: its prescribed height, its fits, and a coarse run of the study beside the published experiment."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from proof import __main__ as cli
from proof.cases.rig import cases as rig_cases, fit as rig_fit, published, table as rig_table
from proof.cases.rig.cases import in_time
from proof.cases.rig.joints import Modes, joints_of
from proof.cases.rig.model import Rig
from proof.cases.rig.wear import wear_down
from tests.helpers.coarse_scenes import QUICK_RIG as QUICK, RIG as COARSE
from tests.helpers.fits import STEP, fit_by_differences as fit
from tribodyn.hbm.outcome import WearEnd
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.workflows.run.joints import contact_stiffness
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.fits.identification import FitParameter, MeasuredNumber
from tribodyn.workflows.studies.forces import forces


@pytest.fixture(scope="module")
def rig():
    return Rig.of(scene_file.read("rig_thesis", COARSE))


@pytest.fixture(scope="module")
def joints():
    return joints_of(scene_file.read("rig_thesis", COARSE))


# ---- prescribed height ----


def test_forces_at_rest_leave_a_prescribed_height_to_what_holds_the_part():
    """Both contact faces are of the one part: what they give to it adds up to nothing."""
    (part,) = forces("rig_thesis", overrides=COARSE).bodies
    assert part.is_supported
    assert not part.load.any()
    assert np.abs(part.joints["contact"]).max() < 1e-9


def test_platform_height_and_mating_height_are_the_same_interference(rig):
    raised, pushed = rig.with_height(rig.height + 2e-6).at_rest(), rig.with_mating_height(2e-6).at_rest()
    assert raised.preload == pytest.approx(pushed.preload, rel=1e-6)
    assert raised.preload > rig.at_rest().preload + 3.0


@pytest.mark.slow
def test_the_balance_comes_closer_to_time_integration_with_more_harmonics(rig):
    errors = []
    for saved in ((0, 1), (0, 1, 2, 3, 4, 5)):
        extra = rig.with_harmonics(saved)
        cycle = extra.cycle()
        result = in_time(extra, cycle)
        assert result.periodic
        assert result.preload == pytest.approx(cycle.preload, rel=0.02)
        errors.append((abs(cycle.energy / result.energy - 1), abs(result.amplitude)))
    (energy, amplitude), (finer_energy, finer_amplitude) = errors
    assert finer_energy < min(0.5 * energy, 0.05)
    assert finer_amplitude < min(0.5 * amplitude, 0.05)


# ---- joints and fits ----


def test_frequencies_of_the_joint_model_are_those_of_the_rig(rig, joints):
    """Other masters, the same rig: springs put in after the reduction or before it."""
    system, stuck = rig.plain().system, contact_stiffness(rig.scene, rig.plain())
    for K, state in (
        (system.stiffness, False),
        (stuck_stiffness(system.stiffness, rig.plain().interface.B, stuck), True),
    ):
        exact = np.sqrt(eigh(K, system.mass, eigvals_only=True, subset_by_index=[0, 2])) / (2 * np.pi)
        np.testing.assert_allclose(joints.modes({}, state).frequency[:3], exact, rtol=3e-3)


@pytest.mark.slow
def test_the_scene_has_the_fitted_joints(joints):
    """What the scene states is what the fit finds, here on a coarser contact grid."""
    fitted_joints = rig_fit.fit_joints(joints)
    np.testing.assert_allclose(fitted_joints.after, joints.frequencies({}), rtol=1e-2)
    assert fitted_joints.rms < 0.02
    assert np.sqrt(np.mean(np.log(fitted_joints.before / fitted_joints.after) ** 2)) > 0.3  # rigid joints are far off
    assert fitted_joints.verdict(2) == "at its upper bound"


def test_known_springs_are_found_again(joints):
    """From eight modes; near the ninth one there are several of its kind, so that it may be taken for another."""
    true = {"base_vertical": 7e8, "base_sliding": 3e9, "seat": rig_fit.RIGID}
    numbers = joints.frequencies(rig_fit.stiffnesses(true))[:8]
    parameters = [FitParameter(name, 1e8, 1e11, (1e9,), "N/m") for name in ("base_vertical", "base_sliding")]
    result = fit(
        parameters,
        [MeasuredNumber(str(i), value, "Hz") for i, value in enumerate(numbers)],
        lambda values: joints.frequencies(rig_fit.stiffnesses({**values, "seat": rig_fit.RIGID}))[:8],
    )
    assert result.values[0] == pytest.approx(7e8, rel=1e-2)
    assert result.values[1] == pytest.approx(3e9, rel=5e-2)


def test_modes_are_told_apart_by_their_motion():
    frequency = np.array([90.0, 300.0, 310.0, 900.0])
    share = np.array([[0.9, 0.1, 0.0], [0.0, 1.0, 0.0], [0.8, 0.2, 0.0], [0.1, 0.0, 0.9]])
    expected = (("tangential", 91.0), ("tangential", 300.0), ("normal", 305.0))
    np.testing.assert_array_equal(Modes(frequency, share).assigned(expected), [90.0, 310.0, 300.0])


def test_the_height_is_found_from_the_preload(rig):
    solved_height = rig_fit.fit_height(rig.with_height(10e-6))
    height = solved_height.named()["platform"]
    assert rig.with_height(height).at_rest().preload == pytest.approx(published.PRELOAD, rel=1e-6)
    assert solved_height.before[0] < 0.9 * published.PRELOAD


def test_life_and_work_tell_the_coefficient(rig):
    run = wear_down(Rig.of(scene_file.read("rig_thesis", QUICK)), 0.0, lambda sentence: None)
    assert run.lost
    fitted = rig_fit.fit_coefficient(run, 5.5e-15)
    ratios = [run.history.cycles[-1] / published.LIFE_MEASURED, run.spent[-1] / published.WORK]
    assert fitted.values[0] == pytest.approx(5.5e-15 * np.sqrt(np.prod(ratios)), rel=1e-6)
    np.testing.assert_allclose(fitted.sensitivity, [[-1.0], [-1.0]], rtol=2 * STEP**2)  # of differences of 1 / x
    stopped = replace(run.history, end=WearEnd.STEPS_DONE.say(" 3 wear steps"))
    with pytest.raises(ValueError, match="a run that loses its preload"):
        rig_fit.fit_coefficient(replace(run, history=stopped), 5.5e-15)


# ---- the study ----


def test_the_study_compares_every_number_and_draws(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(rig_cases, "STEPS", 128)
    monkeypatch.setattr(rig_cases, "PERIODS", 40)
    words = ["rig", "study", "--out", str(tmp_path)]
    smaller = ("geometry.n_contact_width=3", "wear.step=25 %", "response.frequency=['287 Hz', '293 Hz']")
    for override in (*QUICK, *smaller):
        words += ["--set", override]
    with pytest.raises(SystemExit) as stop:
        cli.main(words)
    assert not stop.value.code
    out, err = capsys.readouterr()
    assert out.count("| frequency: ") == len(published.OPEN) + len(published.STUCK) + 1
    assert out.count("| energy per cycle: ") == len(published.TABLE_5_3)
    lives = [line for line in out.splitlines() if line.startswith("| life: ")]
    assert sum("harmonics 0 to 2," in line for line in lives) == 1
    assert len(lives) == len(published.MATING_HEIGHTS) + 1
    assert "| wear: slope of volume over work, um3/J | 5500 | 5500 |" in out
    assert f"| preload: at the start, N | {published.PRELOAD:.4g} |" in out
    for trend in (
        "the reaction at the platform is the preload", "no interference, no preload", "linear in friction work",
        "without contact the response is the open one", "3 um less: shorter life", "falls all the time",
    ):  # fmt: skip
        assert any(f"| {trend} |" in line and line.endswith("| yes |") for line in out.splitlines()), trend
    assert "mating height -3 um" in err
    table, files = out.split("| 10^6 cycles |")[1].splitlines(), out.rsplit("one thread", 1)[1].split()
    assert sum(line.startswith("| ") for line in table[1:]) == 5
    assert len(files) == 9
    assert all(Path(name).stat().st_size > 1000 for name in files)
    assert (tmp_path / "comparison.md").read_text(encoding="utf-8") in out


@pytest.mark.parametrize(("override", "words"), [
    ("wear.at=peak", 'need wear at one frequency, wear.at = "290 Hz"'),
    ("wear=", "need wear at one frequency"),
    ("prescribed=", r"need one table under prescribed, \[prescribed.platform\]"),
    ("springs.seat_along=", r"need the joint \[springs.seat_along\]"),
    ("harmonics.kept=auto", "need harmonics that are named"),
])  # fmt: skip
def test_a_scene_that_is_not_this_rig_is_one_sentence(override, words):
    with pytest.raises(ValueError, match=words):
        Rig.of(scene_file.read("rig_thesis", (override,)))


def test_differences_are_relative():
    number = rig_table.Number("topic", "name", "N", 4.0, 5.0)
    assert number.difference == pytest.approx(0.25)
    assert "+25 %" in rig_table.as_text(rig_table.Table((number,), (), (), 0.0))
