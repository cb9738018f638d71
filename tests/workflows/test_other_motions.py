"""What a verdict says where a contact has more than one motion, and where more harmonics are lost on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import tribodyn as td
from tests.proof.scoreboard_scenes import draw
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.operating_point import AtFrequency, OperatingPoint
from tribodyn.workflows.accuracy import motion_probe, other_meshes, probes, verdict
from tribodyn.workflows.accuracy.probes import Answers, Climbed, State
from tribodyn.workflows.accuracy.time_limit import TimeUp
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> SceneFile:
    """Plate 25 of seed 16180: rest and a sweep from below lead to one motion, a sweep from above to another."""
    folder: Path = tmp_path_factory.mktemp("plate")
    return draw(25, 16180, folder).file(folder)


def _unworn(file: SceneFile) -> State:
    return probes.unworn(file, modelling.build(file, None, Progress()))


def test_an_answer_of_one_motion_among_several_has_no_known_error(plate: SceneFile) -> None:
    found = list(motion_probe.contributions(_unworn(plate), 60.0, ""))
    known = {part.quantity: part.error for part in found if part.error is not None}
    assert known["amplitude"] == pytest.approx(2.358 / 1.339 - 1, rel=0.01)  # of two motions that were looked at alone
    assert known["preload"] == pytest.approx(1 - 132.7 / 171.2, rel=0.02)
    assert known["life"] == known["energy"] > 0.5
    assert {part.quantity for part in found if part.error is None} == set(motion_probe.CONCERNED)
    (said,) = {part.how for part in found if part.error is None}
    assert "more than one motion, of amplitudes 2.36e-05 and 1.34e-05 m" in said


def test_a_motion_that_every_way_leads_to_adds_no_error(plate: SceneFile) -> None:
    """The coarser mesh of the same plate, with a tenth of its vibration force."""
    coarse = other_meshes.around(plate, 1, 1)[0].file.changed("loads.harmonic.shake.value=80")
    found = list(motion_probe.contributions(_unworn(coarse), 60.0, ""))
    assert [part.quantity for part in found] == ["amplitude", "energy", "preload", "life"]
    assert max(part.error or 0.0 for part in found) < 1e-6


def test_no_seconds_leave_other_motions_unknown_and_peaks_have_none(plate: SceneFile) -> None:
    state = _unworn(plate)
    assert [part.error for part in motion_probe.contributions(state, 0.0, "no seconds")] == [None] * 5
    at_peak = replace(state, site=probes.scene_peak(plate))
    assert list(motion_probe.contributions(at_peak, 60.0, "")) == []


def _harmonics(first: Climbed) -> dict[str, list[float | None]]:
    """Errors by more harmonics of a state with the answers 100 Hz, 1 m, 1 J, 10 N."""
    seen: Any = [SimpleNamespace(answers=Answers(100.0, 1.0, 1.0, 10.0), site=AtFrequency("tip", 1.0))]
    found: dict[str, list[float | None]] = {}
    for part in verdict._of_harmonics(td.Result({}, {}, ""), seen, [first], None, "lost"):
        found.setdefault(part.quantity, []).append(part.error)
    return found


def test_a_climb_of_harmonics_that_was_cut_is_not_taken_for_all() -> None:
    """Rig 23 of seed 16180: harmonics 0 to 3 change 2 %, 0 to 5 would change 4 %, and the seconds ended between."""
    once, twice = Answers(100.0, 0.98, 0.99, 10.0), Answers(100.0, 0.97, 0.99, 10.0)
    assert _harmonics(Climbed(twice, once, ""))["amplitude"] == [pytest.approx(1 / 0.97 - 1)]
    assert _harmonics(Climbed(twice, once, "cut"))["amplitude"] == [pytest.approx(1 / 0.97 - 1 + 0.98 / 0.97 - 1)]
    cut = _harmonics(Climbed(once, None, "harmonics 0 to 5: beyond the seconds"))
    assert cut["amplitude"] == [pytest.approx(1 / 0.98 - 1), None]
    assert None in cut["life"]
    assert cut["peak_frequency"] == [0.0]  # the scene gives it


def test_a_climb_says_where_it_was_cut(plate: SceneFile) -> None:
    class Slow:
        """A place whose solves take longer than there is, from the second on."""

        def __init__(self, site: AtFrequency):
            self._site, self._left = site, iter([True, False])

        def next(self, balance: HarmonicBalance, omega: float, x: Any) -> OperatingPoint:
            if not next(self._left):
                raise TimeUp("0 s are left")
            return self._site.next(balance, omega, x)

    state = _unworn(plate)
    whole = probes.with_more_harmonics(state)
    site: Any = Slow(state.site)
    cut = probes.with_more_harmonics(replace(state, site=site))
    assert whole is not None
    assert cut is not None
    assert (whole.cut, cut.cut, cut.before) == ("", "harmonics 0 to 5: beyond the seconds", None)
    assert whole.answers.amplitude != cut.answers.amplitude
