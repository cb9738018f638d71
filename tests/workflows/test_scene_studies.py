"""Supports of any scene; on the beam, which they were not made for."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.supports import support_work

TINY = (
    "harmonics.kept=[0, 1]",
    "geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "harmonics.samples=32",
    "response.points=8", "wear=", "verdict.enabled=false",
)  # fmt: skip
HANGER = (
    'springs.hanger={group = "static_load", direction = "z", stiffness = "1 N/um"}',
    'response.others.hung={group = "static_load", direction = "z"}',
)


def words(*said: str, sets: tuple[str, ...] = TINY) -> list[str]:
    return [*said, *(word for text in sets for word in ("--set", text))]


def call(said: list[str]) -> None:
    cli.app(said, result_action="return_value")


def test_work_of_a_support_in_closed_form() -> None:
    basis, k, a = HarmonicBasis((0, 1), 512), 2e5, 1e-3
    swing = support_work(basis, np.array([0.0, a, 0.0]), k)
    assert swing == pytest.approx(k * a**2, rel=1e-4)  # twice k a^2 / 2: to either side
    hung = support_work(basis, np.array([3 * a, 0.0, a]), k)
    assert hung == pytest.approx(2 * k * 3 * a * a, rel=1e-4)  # k (4 a)^2 / 2 - k (2 a)^2 / 2 once


def test_supports_of_the_beam(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--no-pictures", "--out", str(tmp_path)]
    call([*words("run", "beam", *out, sets=(*TINY, *HANGER))])
    capsys.readouterr()
    call(["study", "supports", str(tmp_path), "--area", "hanger=10 mm2", "--coefficient", "2e3 um3/J", "--json"])
    (row,) = json.loads(capsys.readouterr().out)
    assert row["support"] == "hanger"
    assert row["work_J"] > 0
    assert row["depth_m_per_cycle"] == pytest.approx(2e-15 * row["work_J"] / 10e-6)
    with (tmp_path / "supports.csv").open(encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    assert max(float(line["hanger_work_J"]) for line in table) == row["work_J"]


@pytest.mark.parametrize(
    ("sets", "said"),
    [((), "no spring to the ground"), (HANGER[:1], r"add \[response.others.hanger\]")],
)
def test_a_scene_without_observed_supports_says_what_to_add(sets: tuple[str, ...], said: str, tmp_path: Path) -> None:
    from tribodyn.workflows.studies.supports import supports_of

    with pytest.raises(ValueError, match=said):
        supports_of(scene_file.read("beam", (*TINY, *sets)).scene)
