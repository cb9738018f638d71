"""What a wheel's study reads: peaks whatever the scan, planar friction through a resonance, damping left out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.wheel_scene import WHEEL
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import aft
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.workflows.run import modelling, sanity_checks, sector
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.many.run_task import numbers_of
from tribodyn.workflows.studies.wheels import wheel_model as wheels

QUICK = ("verdict.enabled=false", 'damping.modal="0.5 %"')
FIVE = WHEEL.replace("n_blades = 6", "n_blades = 5").replace("sectors = 6", "sectors = 5")
OPEN = ("contact.gap='1 mm'", "response.frequency=['190 Hz', '240 Hz']")
SLIPPING = ("contact.friction=0.3", "response.frequency=['560 Hz', '680 Hz']", "loads.harmonic.wave.value='5 N'")


def of(tmp_path: Path, *overrides: str, wheel: str = FIVE) -> td.Result:
    file = tmp_path / "wheel.toml"
    file.write_text(wheel, encoding="utf-8")
    return td.run(str(file), overrides=[*QUICK, *overrides])


@pytest.mark.parametrize("state", [OPEN, SLIPPING])
def test_the_peak_that_a_study_reads_does_not_hang_on_the_scan(tmp_path: Path, state: tuple[str, ...]) -> None:
    """Of 5, 10 and 30 points: the highest of ten alone is off by 57 % where a resonance has 0.5 % damping."""
    rows = [numbers_of(of(tmp_path, *state, f"response.points={points}")) for points in (5, 10, 30)]
    for name, within in (("peak_frequency_first", 1e-4), ("amplitude_first", 1e-4)):
        values = [row[name] for row in rows]
        assert np.ptp(values) < within * max(values)
    assert not any(row["peak_at_end"] for row in rows)


def test_a_wheel_without_a_contact_is_one_whose_contact_is_open(tmp_path: Path) -> None:
    texts = WHEEL[: WHEEL.index("[contact]")] + WHEEL[WHEEL.index("[loads.h") :], WHEEL.replace("-0.1 mm", "1 mm")
    files = (scene_file.parse(text, "w.toml", ("wheel.speed=6000 rpm",), Path()) for text in texts)
    alone, opened = map(wheels.build, files)
    assert alone.diagram([0, 2], 3, False, True) == pytest.approx(opened.diagram([0, 2], 3, False, True), rel=1e-7)
    assert of(tmp_path, wheel=texts[0]).response.converged.all()
    table = opened.table.model_copy(update={"seam": ("cyclic_left", "cyclic_right")})
    with pytest.raises(ValueError, match="swap the two faces"):  # of a part that is made already
        sector.sector(opened.scene.model_copy(update={"wheel": table}), opened.part)


def test_a_wheel_without_damping_is_warned_of() -> None:
    for text, warned in ((WHEEL, False), (WHEEL.replace('[damping]\nmodal = "2 %"\n', ""), True)):
        file = scene_file.parse(text, "w.toml", (), Path())
        items = " ".join(sanity_checks.remarks(file, modelling.build(file, Progress())))
        assert ("no damping but that of friction" in items) is warned


@pytest.mark.parametrize(("law", "most"), [("jenkins", np.sqrt(2)), ("coulomb_planar", 1.0)])
def test_the_resultant_of_friction_on_a_shroud(law: str, most: float) -> None:
    """Over mu N: uncoupled sliders come to the square root of two, planar friction to one; both near the resonance."""
    b = slipping(law)
    solved = arc_length.solve_along_load(b, 2 * np.pi * 640.0)
    assert solved.converged
    (joint,) = b.contact.joints
    force = aft.history(joint.module, solved.state.x, joint.parameters, b.basis)[1]
    assert np.max(np.hypot(force[:, 0], force[:, 1]) / (0.3 * force[:, 2])) == pytest.approx(most, rel=1e-3)


def slipping(law: str = "coulomb_planar") -> HarmonicBalance:
    requested = (f'contact.law="{law}"', *SLIPPING, "loads.harmonic.wave.value='20 N'", "harmonics.samples=128")
    return modelling.build(scene_file.parse(WHEEL, "w.toml", requested, Path()), Progress()).balance


def test_planar_friction_behind_a_jump_begins_with_uncoupled_sliders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own curve over the load has a corner wherever a pair can just stick: 8467 evaluations, and no end of it."""
    b, laws, evaluate = slipping(), [], HarmonicBalance.evaluate

    def counted(self: HarmonicBalance, *arguments: Any, **named: Any) -> State:
        laws.append(self.contact.joints[0].law)
        return evaluate(self, *arguments, **named)

    monkeypatch.setattr(HarmonicBalance, "evaluate", counted)
    assert arc_length.solve_along_load(b, 2 * np.pi * 605.51724).converged
    assert laws.count("coulomb_planar") < 10
    assert len(laws) < 2000


@pytest.mark.slow
def test_a_scan_with_planar_friction_solves_every_frequency() -> None:
    """Through two jumps, at 597.2 and 602 Hz; the second needs springs that stiffen."""
    branch = natural.follow(slipping(), 2 * np.pi * 560, 2 * np.pi * 680, natural.Options(n_points=30))
    assert branch.arrived
    assert branch.converged.all()
